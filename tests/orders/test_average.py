"""Synchronous average, its standard error, its parts, and the modulation of a mesh harmonic."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.angle import AngleSignal, ShaftAngle, find_shaft_angle
from gearsig.errors import InputError, RefusalError
from gearsig.orders import (
    SynchronousAverage,
    average_lines,
    band_passed_mesh,
    mean_and_error,
    mesh_modulation,
    order_spectrum,
    separate,
    separate_shafts,
    synchronous_average,
)
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed

PER_REV = 256
ANGLE = np.arange(PER_REV) / PER_REV


def _average(values):
    return SynchronousAverage(values, np.zeros(len(values)), 10, "pinion", "a", "g", "average", len(values) / 2)


def _gear(r):
    return np.cos(2 * np.pi * 23 * r + 0.4) + 0.3 * np.cos(2 * np.pi * 46 * r) + 0.2 * np.cos(2 * np.pi * r)


@pytest.mark.parametrize("start", [0.0, 0.5, 3.75])
def test_average_of_a_periodic_signal_is_one_period(angle_signal, start):
    average = synchronous_average(angle_signal(_gear, 30.3, start=start), "a")
    assert average.values == pytest.approx(_gear(ANGLE), abs=1e-12)
    assert average.n_revolutions in (29, 30)
    assert average.standard_error.max() < 1e-12


def test_noise_falls_as_one_over_root_n(angle_signal):
    rng = np.random.default_rng(0)
    n = np.array([10, 40, 160, 640])
    errors, stated = [], []
    for n_rev in n:
        average = synchronous_average(angle_signal(lambda r: _gear(r) + rng.normal(size=len(r)), n_rev), "a")
        errors.append(np.std(average.values - _gear(ANGLE)))
        stated.append(np.sqrt(np.mean(average.standard_error**2)))
    slope = np.polyfit(np.log(n), np.log(errors), 1)[0]
    assert slope == pytest.approx(-0.5, abs=0.05)
    assert stated == pytest.approx(1 / np.sqrt(n), rel=0.1)


def test_another_shafts_order_falls_as_the_comb_filter_says(angle_signal):
    n, order = 50, 17.3
    average = synchronous_average(angle_signal(lambda r: np.cos(2 * np.pi * order * r), n), "a")
    gain = abs(np.sin(np.pi * n * order) / (n * np.sin(np.pi * order)))
    assert np.abs(average.values).max() <= gain * (1 + 1e-9) + 1e-12
    slightly_off = synchronous_average(angle_signal(lambda r: np.cos(2 * np.pi * 17.001 * r), n), "a")
    gain = abs(np.sin(np.pi * n * 17.001) / (n * np.sin(np.pi * 17.001)))
    assert np.abs(slightly_off.values).max() == pytest.approx(gain, rel=0.02)


def test_jackknife_of_single_revolutions_is_the_textbook_standard_error():
    x = np.random.default_rng(1).normal(size=(20, 8))
    mean, error = mean_and_error(x, 20)
    assert mean == pytest.approx(x.mean(axis=0))
    assert error == pytest.approx(x.std(axis=0, ddof=1) / np.sqrt(20))


def test_one_revolution_is_refused(angle_signal):
    with pytest.raises(RefusalError, match="1 whole revolution"):
        synchronous_average(angle_signal(_gear, 1.5), "a")


@settings(max_examples=40, deadline=None)
@given(n=st.integers(64, 301), teeth=st.integers(7, 30), seed=st.integers(0, 2**32 - 1), n_sidebands=st.integers(0, 2))
def test_parts_sum_back_to_the_average(n, teeth, seed, n_sidebands):
    average = _average(np.random.default_rng(seed).normal(size=n))
    parts = separate(average, teeth, n_sidebands=n_sidebands)
    assert np.abs(parts.regular.values + parts.difference.values - average.values).max() < 1e-14 * n
    assert np.dot(parts.regular.values, parts.difference.values) == pytest.approx(0.0, abs=1e-9)
    again = separate(_average(parts.difference.values), teeth, n_sidebands=n_sidebands)
    assert again.difference.values == pytest.approx(parts.difference.values, abs=1e-12)


def test_each_part_holds_its_own_lines():
    def line(order):
        return np.cos(2 * np.pi * order * ANGLE + order)

    parts = separate(_average(sum(line(o) for o in (0, 1, 2, 3, 21, 22, 23, 24, 46, 47, 50))), 23)
    assert parts.residual.values == pytest.approx(sum(line(o) for o in (3, 21, 22, 24, 47, 50)), abs=1e-12)
    assert parts.difference.values == pytest.approx(sum(line(o) for o in (3, 21, 50)), abs=1e-12)
    assert parts.regular.values == pytest.approx(sum(line(o) for o in (0, 1, 2, 22, 23, 24, 46, 47)), abs=1e-12)
    assert (parts.residual.kind, parts.difference.kind, parts.regular.kind) == ("residual", "difference", "regular")


def test_two_gears_on_a_shaft_are_both_taken_out():
    x = np.cos(2 * np.pi * 23 * ANGLE) + np.cos(2 * np.pi * 31 * ANGLE)
    assert separate(_average(x), (23, 31)).residual.values == pytest.approx(np.zeros(PER_REV), abs=1e-12)


def test_standard_error_of_a_part_is_that_of_its_share_of_the_noise(angle_signal):
    rng = np.random.default_rng(2)
    signal = angle_signal(lambda r: rng.normal(size=len(r)), 400)
    parts = separate(synchronous_average(signal, "a"), 11)
    assert np.mean(parts.difference.standard_error) == pytest.approx(np.std(parts.difference.values), rel=0.1)


def test_what_cannot_be_separated_is_refused():
    average = _average(_gear(ANGLE))
    with pytest.raises(RefusalError, match="lies above"):
        separate(average, 200)
    with pytest.raises(RefusalError, match="cover all"):
        separate(average, 3)
    with pytest.raises(InputError, match="teeth"):
        separate(average, 2)
    with pytest.raises(InputError, match="kind"):
        separate(separate(average, 23).residual, 23)


def test_band_passed_mesh_holds_the_harmonic_and_its_sidebands():
    x = (1 + 0.5 * np.cos(2 * np.pi * 3 * ANGLE)) * np.cos(2 * np.pi * 23 * ANGLE)
    rest = np.cos(2 * np.pi * 2 * ANGLE) + np.cos(2 * np.pi * 46 * ANGLE)
    band = band_passed_mesh(_average(x + rest), 23)
    assert band.values == pytest.approx(x, abs=1e-12)
    assert band.kind == "band-passed mesh"


@pytest.mark.parametrize("harmonic", [1, 2])
def test_modulation_is_recovered(harmonic):
    order = 23 * harmonic
    amplitude = 2.0 * (1 + 0.3 * np.cos(2 * np.pi * ANGLE) - 0.1 * np.cos(2 * np.pi * 4 * ANGLE))
    phase = 0.2 * np.sin(2 * np.pi * 2 * ANGLE)
    x = amplitude * np.cos(2 * np.pi * order * ANGLE + 0.7 + phase)
    found = mesh_modulation(_average(x), 23, harmonic=harmonic)
    assert found.amplitude == pytest.approx(amplitude, abs=1e-4)
    # The carrier's own phase is the mean one only where amplitude and phase modulation are uncorrelated.
    assert found.phase_rad + found.carrier_phase_rad - 0.7 == pytest.approx(phase, abs=1e-4)
    assert (found.carrier_order, found.half_width_orders) == (order, 11)


def test_a_weak_tooth_shows_where_it_meshes():
    at = 90 / 360
    dip = np.exp(-0.5 * ((ANGLE - at) / 0.03) ** 2)
    x = (1 - 0.4 * dip) * np.cos(2 * np.pi * 23 * ANGLE - 0.3 * dip)
    found = mesh_modulation(_average(x), 23)
    assert ANGLE[np.argmin(found.amplitude)] == pytest.approx(at, abs=0.01)
    assert ANGLE[np.argmin(found.phase_rad)] == pytest.approx(at, abs=0.01)


def test_modulation_of_what_is_not_there_is_refused():
    with pytest.raises(RefusalError, match="no line"):
        mesh_modulation(_average(np.cos(2 * np.pi * ANGLE)), 23)
    with pytest.raises(RefusalError, match="reaches above"):
        mesh_modulation(_average(_gear(ANGLE)), 23, harmonic=6)
    with pytest.raises(InputError, match="half_width_orders"):
        mesh_modulation(_average(_gear(ANGLE)), 23, half_width_orders=23)


def test_lines_of_parts_and_of_the_whole(angle_signal):
    rng = np.random.default_rng(1)
    signal = angle_signal(lambda r: 0.7 + _gear(r) + rng.normal(size=len(r)), 41, start=0.3)
    lines = average_lines(signal, n_parts=2)
    average = synchronous_average(signal, "a")
    assert lines.parts.shape == (2, 1, 128)
    assert list(lines.n_revolutions) == [20, 20]
    assert lines.whole[0] == pytest.approx(average.lines(), abs=1e-12)
    assert average.lines()[0].real == pytest.approx(average.values.mean())
    assert average.lines()[23] == pytest.approx(np.exp(0.4j), abs=0.2)
    rms = average_lines(signal, ["a"], scaling="amplitude rms")
    assert rms.whole[0, 1:] == pytest.approx(average.lines()[1:] / np.sqrt(2))


def test_hann_weights_keep_other_shafts_orders_out(angle_signal):
    signal = angle_signal(lambda r: np.cos(2 * np.pi * 7.27 * r), 40)
    equal, hann = (abs(average_lines(signal, weighting=w).whole[0, 7]) for w in ("equal", "hann"))
    assert hann < 0.05 * equal


def test_shafts_with_close_orders_are_told_apart():
    teeth, n_angles = (25, 41), 256
    signals = []
    for own in (1.0, teeth[0] / teeth[1]):
        n = int(40 * own) * n_angles
        driver = np.arange(n) / n_angles / own
        # 8 turns of the driver are nearly 13 of the driven gear; both share the mesh.
        waves = [np.cos(2 * np.pi * o * driver) for o in (8, 13 * teeth[0] / teeth[1], teeth[0])]
        angle = ShaftAngle(f"{own:g}", np.array([0.0, 1.0]), np.array([0.0, 40 * own]), np.full(2, 40 * own), "given")
        signals.append(AngleSignal(sum(waves)[None], n_angles, angle, 0.0, ("v",), ("g",), 100.0))
    found = separate_shafts(signals, teeth)
    for signal, order, z in zip(found.signals, (8, 13), teeth, strict=True):
        lines = np.abs(average_lines(signal).whole[0])
        assert lines[[order, z]] == pytest.approx(1.0, abs=0.02)
        assert np.delete(lines, [order, z]).max() < 0.02
    assert np.abs(found.residual.samples).max() < 0.1


@pytest.mark.parametrize(
    ("given", "said"),
    [(0.0, "channel, an array's sampling rate, is 0 Hz"), ("a1", "channel: an array has no channel 'a1'")],
)
def test_a_wrong_rate_of_an_array_is_named_by_the_parameter_that_holds_it(given, said):
    with pytest.raises(InputError, match=said):
        synchronous_average(np.ones(1000), given, speed_rpm=600.0)


def test_average_and_spectrum_of_a_recording_and_of_an_array():
    rate, speed = 5000.0, 7.0
    x = _gear(speed * np.arange(50000) / rate)
    recording = Recording(x[None], rate, (Channel("a1", "acceleration", "g"),), ConstantSpeed(60 * speed, shaft="in"))
    average = synchronous_average(recording, "a1")
    assert (average.unit, average.channel) == ("g", "a1")
    assert abs(average.lines()[23]) == pytest.approx(1.0, abs=1e-5)
    of_array = synchronous_average(x, rate, shaft_angle=find_shaft_angle(recording))
    assert of_array.values == pytest.approx(average.values, abs=1e-12)
    spectrum = order_spectrum(recording, "a1")
    assert spectrum.values[spectrum.index_of(46.0)] == pytest.approx(0.3, abs=1e-4)
    with pytest.raises(InputError):
        synchronous_average(x, rate)
    with pytest.raises(RefusalError):
        synchronous_average(recording, "a1", shaft="out")
