"""Gear indicators: moments of Gaussian noise, exact sidebands, invariances, direct formulas, undefined values."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.indicators import (
    energy_operator,
    energy_ratio,
    envelope,
    fm0,
    fm4,
    gear_indicators,
    healthy_records,
    line_amplitude,
    m6a,
    m8a,
    na4,
    nb4,
    sideband_index,
    sideband_level_factor,
)
from gearsig.orders import SynchronousAverage

N, Z = 1024, 29
THETA = 2 * np.pi * np.arange(N) / N


def average(values, kind="average", **changes):
    settings = {"shaft": "input", "channel": "a1", "unit": "m/s^2", "highest_order": 400.0} | changes
    return SynchronousAverage(
        values=values, standard_error=np.zeros(len(values)), n_revolutions=50, kind=kind, **settings
    )


def modulated(carrier=3.0, depth=0.4, phase=0.7, order=1):
    return carrier * (1 + depth * np.cos(order * THETA)) * np.cos(Z * THETA + phase)


def noise(seed, n=N):
    return np.random.default_rng(seed).standard_normal(n)


def test_gaussian_moments():
    d = average(noise(1, 1_000_000), "difference")
    # Expectation 1·3, 1·3·5, 1·3·5·7; tolerances are five standard deviations of the estimates.
    assert fm4(d) == pytest.approx(3, abs=0.025)
    assert m6a(d) == pytest.approx(15, abs=0.4)
    assert m8a(d) == pytest.approx(105, abs=8)


@given(st.integers(0, 1000))
def test_moments_by_the_papers_formulas(seed):
    x = noise(seed, 64) ** 3
    d, n = x - x.mean(), 64
    signal = average(x, "difference")
    assert fm4(signal) == pytest.approx(n * np.sum(d**4) / np.sum(d**2) ** 2)
    assert m6a(signal) == pytest.approx(n**2 * np.sum(d**6) / np.sum(d**2) ** 3)
    assert m8a(signal) == pytest.approx(n**3 * np.sum(d**8) / np.sum(d**2) ** 4)


def test_single_peak_has_its_closed_form():
    # One unit among N zeros: kurtosis is N - 2 + 1/(N - 1).
    x = np.zeros(100)
    x[17] = 1.0
    assert fm4(average(x, "difference")) == pytest.approx(98 + 1 / 99)


@pytest.mark.parametrize(("carrier", "depth", "phase"), [(3.0, 0.4, 0.7), (0.2, 1.0, -2.0), (50.0, 0.0, 0.0)])
def test_sidebands_of_amplitude_modulation_are_exact(carrier, depth, phase):
    a = average(modulated(carrier, depth, phase))
    assert sideband_index(a, Z) == pytest.approx(carrier * depth / 2, abs=1e-12 * carrier)
    sigma = carrier * math.sqrt(0.5 * (1 + depth**2 / 2))
    assert sideband_level_factor(a, Z) == pytest.approx(carrier * depth / sigma, abs=1e-12)


def test_phase_modulation_gives_bessel_sidebands():
    from scipy.special import jv

    a = average(2.0 * np.cos(Z * THETA + 0.3 * np.sin(THETA)))
    assert sideband_index(a, Z) == pytest.approx(2 * jv(1, 0.3), rel=1e-12)


def test_fm0_of_pure_mesh():
    assert fm0(average(5 * np.cos(32 * THETA)), 32) == pytest.approx(2.0)
    two = average(5 * np.cos(32 * THETA) + 2 * np.cos(64 * THETA))
    span = two.values.max() - two.values.min()
    assert fm0(two, 32) == pytest.approx(span / 7)
    assert fm0(two, 32, n_harmonics=1) == pytest.approx(span / 5)
    assert math.isnan(fm0(average(np.cos(3 * THETA)), 500))


def test_fm0_rises_when_wear_lowers_the_mesh():
    local = np.exp(-0.5 * ((THETA - 2) / 0.05) ** 2)
    new, worn = (average(m * np.cos(32 * THETA) + local) for m in (5.0, 1.0))
    assert fm0(worn, 32) > fm0(new, 32)


def test_energy_ratio_of_known_parts():
    d, y = average(np.sin(7 * THETA), "difference"), average(4 * np.sin(Z * THETA) + 9, "regular")
    assert energy_ratio(d, y) == pytest.approx(0.25)
    assert energy_ratio(d, y.values) == pytest.approx(0.25)
    assert math.isnan(energy_ratio(d, np.zeros(N)))


def test_energy_operator_against_the_definition_written_as_a_loop():
    a = average(modulated() + 0.1 * noise(3))
    x = a.values
    psi = np.array([x[i] ** 2 - x[i - 1] * x[(i + 1) % N] for i in range(N)])
    expected = N * np.sum((psi - psi.mean()) ** 4) / np.sum((psi - psi.mean()) ** 2) ** 2
    assert energy_operator(a) == pytest.approx(expected)


def test_energy_operator_of_a_sine_is_undefined():
    assert math.isnan(energy_operator(average(np.sin(Z * THETA))))
    assert math.isnan(energy_operator(average(np.zeros(N))))


def family(a, residual, difference, band):
    return {
        (i.name, i.computed_on): i.value
        for i in gear_indicators(
            average(a), average(residual, "residual"), average(difference, "difference"),
            average(band, "band-passed mesh"), teeth=Z, history=(average(noise(9), "residual"),)
        )
        # NA4 weighs against history, whose gain does not change here.
        if i.name not in ("NA4", "NA4*", "NB4*")
    }  # fmt: skip


@pytest.mark.slow
@given(st.integers(0, 1000), st.floats(1e-3, 1e3), st.integers(0, N - 1))
def test_gain_and_shift_of_the_shaft_angle(seed, gain, shift):
    rng = np.random.default_rng(seed)
    d = rng.standard_normal(N)
    parts = (modulated() + d, modulated() - 3 * np.cos(Z * THETA + 0.7) + d, d, modulated())
    before = family(*parts)
    after = family(*(np.roll(gain * p, shift) for p in parts))
    for (name, on), value in before.items():
        factor = gain if name == "sideband index" else 1.0
        assert after[name, on] == pytest.approx(factor * value, rel=1e-7), name


def test_na4_alone_is_the_kurtosis_and_grows_with_damage():
    r = average(noise(4), "residual")
    assert na4(r) == pytest.approx(fm4(average(r.values, "difference")))
    louder = average(2 * r.values, "residual")
    # Fourth moment times 16; the mean variance of {v, 4 v} is 2.5 v.
    assert na4(louder, [r]) == pytest.approx(na4(r) * 16 / 2.5**2)
    assert na4(louder, [r], star=True) == pytest.approx(na4(r) * 16)
    assert na4(r, [r, r, r]) == pytest.approx(na4(r))
    assert math.isnan(na4(r, [], star=True))


def test_na4_by_the_papers_formula():
    records = [noise(k) * (1 + k) for k in range(4)]
    n, m, last = N, 4, records[-1]
    denominator = sum(np.sum((r - r.mean()) ** 2) for r in records) / m
    expected = n * np.sum((last - last.mean()) ** 4) / denominator**2
    averages = [average(r, "residual") for r in records]
    assert na4(averages[-1], averages[:-1]) == pytest.approx(expected)


def test_nb4_sees_the_envelope():
    a = modulated(depth=0.4)
    np.testing.assert_allclose(envelope(a), 3 * (1 + 0.4 * np.cos(THETA)), atol=1e-9)
    band = average(a, "band-passed mesh")
    assert nb4(band) == pytest.approx(1.5)  # of a sine
    deeper = average(modulated(depth=0.8), "band-passed mesh")
    assert nb4(deeper, [band]) == pytest.approx(1.5 * 16 / 2.5**2)
    assert nb4(deeper, [band], star=True) == pytest.approx(1.5 * 16)
    assert math.isnan(nb4(average(np.cos(Z * THETA), "band-passed mesh")))


@pytest.mark.parametrize("n", [63, 64, 1, 2])
def test_envelope_agrees_with_scipy_for_even_and_odd_lengths(n):
    from scipy.signal import hilbert

    np.testing.assert_allclose(envelope(noise(5, n)), np.abs(hilbert(noise(5, n))), atol=1e-12)


def test_healthy_records_end_at_the_first_jump():
    steady = [1.0, 1.1, 0.9, 1.05, 0.95, 1.02]
    assert healthy_records(steady) == (True,) * 6
    assert healthy_records([*steady, 5.0, 1.0]) == (True,) * 6 + (False, False)
    assert healthy_records([1.0, 9.0]) == (True, True)
    with pytest.raises(InputError):
        healthy_records(steady, n_first=1)


def test_collected_indicators_say_what_they_rest_on():
    d = average(0.1 * noise(1), "difference")
    found = gear_indicators(
        average(modulated() + d.values), average(d.values, "residual"), d, average(modulated(), "band-passed mesh"),
        teeth=Z, gear="stage 1/input",
    )  # fmt: skip
    by_name = {(i.name, i.computed_on): i for i in found}
    assert by_name["FM4", "difference"].gear == "stage 1/input"
    assert by_name["FM4", "difference"].note == ""
    assert by_name["sideband index", "synchronous average"].unit == "m/s^2"
    assert "without earlier records" in by_name["NA4", "residual"].note
    assert math.isnan(by_name["NA4*", "residual"].value)
    assert "healthy" in by_name["NA4*", "residual"].note
    assert all(i.note.startswith("undefined") for i in found if math.isnan(i.value))
    assert {"FM0", "FM4", "M6A", "M8A", "NA4", "NA4*", "NB4", "NB4*", "energy ratio", "energy operator",
            "sideband index", "sideband level factor"} == {i.name for i in found}  # fmt: skip


def test_rounding_is_not_taken_for_a_signal():
    rounding = 1e-15 * noise(2)
    found = gear_indicators(
        average(modulated(depth=0.0)), average(rounding, "residual"), average(rounding, "difference"), teeth=Z
    )
    undefined = {i.name for i in found if math.isnan(i.value)}
    assert {"FM4", "M6A", "M8A", "NA4", "NA4*", "energy operator"} == undefined


def test_mesh_above_the_average_is_undefined_with_a_note():
    parts = [average(noise(1), k, highest_order=20.0) for k in ("average", "residual", "difference")]
    found = {i.name: i for i in gear_indicators(*parts, teeth=Z)}
    assert math.isnan(found["sideband index"].value)
    assert "highest order 20" in found["sideband index"].note
    assert math.isnan(found["FM0"].value)


def test_line_amplitude_at_zero_and_half_the_samples():
    a = average(3 + 2 * np.cos(512 * THETA), highest_order=512.0)
    assert line_amplitude(a, 0) == pytest.approx(3)
    assert line_amplitude(a, 512) == pytest.approx(2)
    assert math.isnan(line_amplitude(a, 513))


def test_wrong_kind_and_foreign_history():
    a = average(noise(1))
    with pytest.raises(InputError, match="kind 'average'"):
        fm4(a)
    with pytest.raises(InputError, match="kind"):
        na4(average(noise(1), "residual"), [a])
    with pytest.raises(InputError, match="history of shaft 'output'"):
        na4(average(noise(1), "residual"), [average(noise(1), "residual", shaft="output")])
    with pytest.raises(InputError, match="belongs to shaft"):
        gear_indicators(a, average(noise(1), "residual", shaft="x"), average(noise(1), "difference"), teeth=Z)
