"""Mesh, shaft and bearing levels from spectra and averages."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.indicators import (
    bearing_indicators,
    defect_orders,
    find_line,
    floor_near,
    mesh_indicators,
    noise_reaches,
    over_orders,
    shaft_indicators,
)
from gearsig.orders import SynchronousAverage
from gearsig.rig import Bearing, GearPair, Rig, Shaft
from gearsig.spectra import Spectrum

N_REV, N = 64, 64 * 256
REV = np.arange(N) * N_REV / N
RIG = Rig(shafts=(Shaft("input"), Shaft("output")), pairs=(GearPair("stage 1", "input", "output", 29, 47),))
PAIR = RIG.pairs[0]
BEARING = Bearing("b", "input", 9, 7.94, 39.04)
HANN = 0.5 - 0.5 * np.cos(2 * np.pi * np.arange(N) / N)


def spectrum(x, **changes):
    """Hann amplitude spectrum over order, written out here to be independent of gearsig.spectra."""
    values = changes.pop("values", 2 * np.abs(np.fft.rfft(x * HANN)) / HANN.sum())
    facts = {
        "positions": np.arange(len(values)) / N_REV, "axis": "order", "scaling": "amplitude peak", "unit": "m/s^2",
        "resolution": 1 / N_REV, "noise_bandwidth": 1.5 / N_REV, "window": "hann", "n_averages": 1, "source": "a1",
        "shaft": "input",
    }  # fmt: skip
    return Spectrum(values, **(facts | changes))


def cosine(order, amplitude=1.0, phase=0.0):
    return amplitude * np.cos(2 * np.pi * order * REV + phase)


@settings(deadline=None)
@given(st.floats(5, 100), st.floats(-3, 3))
def test_amplitude_does_not_depend_on_the_place_between_lines(order, phase):
    assert find_line(spectrum(cosine(order, 3.0, phase)), order).amplitude == pytest.approx(3.0, rel=0.003)


@pytest.mark.parametrize("name", ["flattop", "blackman", "boxcar"])
def test_amplitude_in_other_windows_and_on_a_denser_axis(name):
    from scipy.signal import get_window

    w = get_window(name, N)
    values = 2 * np.abs(np.fft.rfft(cosine(29.3, 3.0) * w, 4 * N)) / w.sum()
    bandwidth = N * np.sum(w**2) / w.sum() ** 2 / N_REV
    s = spectrum(
        cosine(1), values=values, positions=np.arange(len(values)) / (4 * N_REV), resolution=1 / (4 * N_REV),
        noise_bandwidth=bandwidth, window=name,
    )  # fmt: skip
    # The rectangular window leaves a tenth of the power outside its main lobe, wherever the line lies.
    assert find_line(s, 29.3, search_orders=0.02).amplitude == pytest.approx(
        3.0, rel=0.06 if name == "boxcar" else 0.003
    )


def test_rms_scaling_and_frequency_axis_give_the_same_peak_amplitude():
    s = spectrum(cosine(29, 2.0))
    as_rms = spectrum(cosine(29, 2.0) / math.sqrt(2), scaling="amplitude rms")
    hz = spectrum(
        cosine(29, 2.0), axis="frequency", positions=s.positions * 25, resolution=25 / N_REV,
        noise_bandwidth=1.5 * 25 / N_REV,
    )  # fmt: skip
    for source in (s, as_rms, over_orders(hz, 25.0)):
        assert find_line(source, 29).amplitude == pytest.approx(2.0, rel=1e-9)
    with pytest.raises(InputError, match="cannot be placed"):
        find_line(hz, 29)
    with pytest.raises(InputError, match="scaled as 'power'"):
        find_line(spectrum(cosine(29), scaling="power"), 29)


def modulated(spacing, am, pm):
    angle = 2 * np.pi * spacing * REV
    return 4 * (1 + am * np.cos(angle)) * np.cos(2 * np.pi * 29 * REV + pm * np.sin(angle))


@pytest.mark.parametrize("shaft", ["input", "output"])
def test_sidebands_belong_to_the_shaft_that_modulates(shaft):
    spacing = RIG.ratio(shaft)
    found = {(i.name, i.shaft): i.value for i in mesh_indicators(spectrum(modulated(spacing, 0.3, 0.0)), RIG, PAIR)}
    other = "output" if shaft == "input" else "input"
    assert found["mesh level 1×", ""] == pytest.approx(4.0, rel=0.003)
    assert found["sideband level 1× − 1", shaft] == pytest.approx(0.6, rel=0.005)
    assert found["sideband level 1× + 1", shaft] == pytest.approx(0.6, rel=0.005)
    assert found["sideband ratio 1×", shaft] == pytest.approx(20 * math.log10(0.15), abs=0.05)
    assert found["sideband ratio 1×", other] < -50


def test_lines_are_called_by_the_order_at_which_they_are_expected():
    """Two recordings whose lines lie on other grids have the same indicators, which can be compared."""
    plain = spectrum(modulated(1.0, 0.3, 0.0))
    shifted = replace(plain, positions=plain.positions * 1.0004)
    bands = [[(i.name, i.band) for i in mesh_indicators(s, RIG, PAIR)] for s in (plain, shifted)]
    assert bands[0] == bands[1]
    assert ("sideband level 1× − 1", "order 28") in bands[0]


def test_amplitude_and_phase_modulation_together_lean_to_one_side():
    found = {
        i.name: i.value for i in mesh_indicators(spectrum(modulated(1.0, 0.1, 0.06)), RIG, PAIR) if i.shaft == "input"
    }
    lower, upper = found["sideband level 1× − 1"], found["sideband level 1× + 1"]
    assert lower == pytest.approx(4 * (0.1 - 0.06) / 2, rel=0.02)
    assert upper == pytest.approx(4 * (0.1 + 0.06) / 2, rel=0.02)


def test_each_sideband_is_reported_on_its_own_side():
    x = cosine(29, 4.0) + sum(cosine(29 + k, 0.1 * (k + 3)) for k in (-2, -1, 1, 2))
    found = {i.name: i.value for i in mesh_indicators(spectrum(x), RIG, PAIR) if i.shaft == "input"}
    levels = [found[f"sideband level 1× {k}"] for k in ("− 2", "− 1", "+ 1", "+ 2")]
    assert levels == pytest.approx([0.1, 0.2, 0.4, 0.5], rel=1e-6)
    assert found["sideband ratio 1×"] == pytest.approx(20 * math.log10(0.3 / 4), abs=1e-6)


def test_average_and_spectrum_agree():
    x = modulated(1.0, 0.2, 0.0) + cosine(1, 0.5)
    one = SynchronousAverage(x[:256], np.zeros(256), N_REV, "input", "a1", "m/s^2", "average", 120.0)
    s = spectrum(x)
    for source in (one, s):
        levels = {i.name: i.value for i in mesh_indicators(source, RIG, PAIR) if i.shaft in ("", "input")}
        assert levels["mesh level 1×"] == pytest.approx(4.0, rel=1e-6)
        assert levels["sideband ratio 1×"] == pytest.approx(-20.0, abs=1e-6)
        assert shaft_indicators(source, "input")[0].value == pytest.approx(0.5, rel=1e-6)
    found = mesh_indicators(one, RIG, PAIR)
    assert {i.shaft for i in found} == {"", "input"}
    assert {i.channel for i in found} == {"a1"}


def test_orders_that_are_not_there_are_nan_with_a_note():
    one = SynchronousAverage(modulated(1, 0.2, 0)[:256], np.zeros(256), 9, "input", "a1", "g", "average", 60.0)
    found = {i.name: i for i in mesh_indicators(one, RIG, PAIR)}
    assert math.isnan(found["mesh level 3×"].value)
    assert "above the average's end" in found["mesh level 3×"].note
    assert math.isnan(found["sideband ratio 3×"].value)
    odd = shaft_indicators(one, "output", shaft_ratio=29 / 47)[0]
    assert math.isnan(odd.value)
    assert "not whole" in odd.note
    assert "lies above the spectrum's end" in find_line(spectrum(cosine(3)), 1000.0).note


def test_unresolved_sidebands_are_refused_by_a_note():
    coarse = spectrum(modulated(1.0, 0.2, 0), resolution=0.5, noise_bandwidth=0.75, positions=np.arange(N // 2 + 1) / 2)
    found = [i for i in mesh_indicators(coarse, RIG, PAIR) if i.name.startswith("sideband")]
    assert all(math.isnan(i.value) and "not resolved" in i.note for i in found)


def test_mesh_order_must_follow_from_the_rig():
    rig = Rig(shafts=(Shaft("input"), Shaft("output")), pairs=(GearPair("p", "input", "output"),))
    with pytest.raises(RefusalError, match="mesh order"):
        mesh_indicators(spectrum(cosine(3)), rig, rig.pairs[0])


def test_shaft_orders_and_the_line_at_zero():
    found = shaft_indicators(spectrum(cosine(1, 0.5) + cosine(2, 0.2)), "input", channel="a1")
    assert [i.value for i in found] == pytest.approx([0.5, 0.2, 0.0], abs=1e-9)
    near_zero = shaft_indicators(spectrum(cosine(1)), "slow", shaft_ratio=0.03)
    assert "close to zero" in near_zero[0].note


def envelope_with(order, strength, seed=1):
    rng = np.random.default_rng(seed)
    lines = sum(cosine(h * order, strength / h) for h in (1, 2, 3))
    return spectrum(lines + rng.standard_normal(N), unit="(m/s^2)^2")


def test_bearing_order_is_found_within_its_slip():
    orders = defect_orders(BEARING)
    assert orders["2×BSF"] == pytest.approx(2 * BEARING.orders()["BSF"])
    found = {i.name: i for i in bearing_indicators(envelope_with(1.01 * orders["BPFO"], 0.5), BEARING, channel="a1")}
    assert found["BPFO envelope level 1×"].value == pytest.approx(0.5, rel=0.1)
    assert found["BPFO over floor 1×"].value > 25
    assert found["BPFI over floor 1×"].value < 14
    assert (found["BPFO over floor 1×"].unit, found["BPFO envelope level 1×"].unit) == ("dB", "(m/s^2)^2")
    assert found["BPFO over floor 1×"].shaft == "input"
    assert found["BPFO over floor 1×"].bearing == "b"


def test_floor_of_noise_is_exceeded_as_rarely_as_stated():
    over, n_trials = 0, 400
    for seed in range(20):
        s = envelope_with(50.0, 0.0, seed)
        for order in range(15, 15 + 5 * n_trials // 20, 5):
            line = find_line(s, order, search_orders=0.3)
            floor = floor_near(s, order, 2.0, leave_out_orders=0.3)
            over += line.largest / floor > noise_reaches(line.n_lines)
    # At most 5 % by the docstring; three standard deviations of a binomial count on top.
    assert over / n_trials <= 0.05 + 3 * math.sqrt(0.05 * 0.95 / n_trials)
    assert over > 0


def test_noise_reaches_is_the_rayleigh_quantile():
    draws = np.random.default_rng(3).rayleigh(size=(20_000, 12))
    share = np.mean(draws.max(axis=1) / np.median(draws) > noise_reaches(12))
    assert share == pytest.approx(0.05, abs=0.006)


def test_too_few_lines_for_a_floor():
    assert math.isnan(floor_near(spectrum(cosine(9)), 9.0, 0.05, leave_out_orders=0.0))


def test_bearing_without_orders_is_refused():
    with pytest.raises(RefusalError, match="no order of bearing"):
        bearing_indicators(envelope_with(3, 1.0), Bearing("x", "input"))


@pytest.mark.parametrize("ratio", [1.0, 29 / 47])
def test_bearing_on_another_shaft(ratio):
    s = envelope_with(defect_orders(BEARING)["BPFI"] * ratio, 0.5)
    found = {i.name: i.value for i in bearing_indicators(s, BEARING, shaft_ratio=ratio)}
    assert found["BPFI over floor 1×"] > 25
