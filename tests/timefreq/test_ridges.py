"""Ridges against closed forms, through crossings above all, and the components along them."""

from pathlib import Path

import numpy as np
import pytest

from gearsig.angle import find_shaft_angle
from gearsig.errors import InputError, RefusalError
from gearsig.recording import read_recording
from gearsig.rig import read_rig
from gearsig.timefreq import (
    NOT_HIDDEN,
    Morse,
    Ridge,
    TimeFrequencyMap,
    UniformSignal,
    best_path,
    component,
    crossing_segments,
    cwt,
    cwt_map,
    inverse,
    lowest_analysable,
    maxima_of_separate_paths,
    reconnected_paths,
    ridges,
    squeezed_cwt,
    squeezed_cwt_map,
    squeezed_stft,
    squeezed_stft_map,
    stft,
    stft_map,
)
from tests.marks import further

MAPS = {
    "CWT": lambda s: cwt_map(s, lowest=50, highest=800, wavelet=Morse(60.0), n_per_octave=32),
    "CWT coefficients": lambda s: cwt(s, lowest=50, highest=800, wavelet=Morse(60.0), n_per_octave=32, step=20),
    "squeezed CWT": lambda s: squeezed_cwt_map(s, lowest=50, highest=800, wavelet=Morse(60.0)),
    "STFT": lambda s: stft_map(s, window_length=0.2),
    "squeezed STFT": lambda s: squeezed_stft_map(s, window_length=0.2),
}
MIDDLE = slice(40, -40)


@pytest.mark.parametrize("kind", MAPS)
def test_chirp_and_its_frequency_error(crossing, kind):
    signal, (rising, _) = crossing(second=0.0)
    (ridge,) = ridges(MAPS[kind](signal))
    assert not ridge.shared.any()
    error = (ridge.positions - rising(ridge.at))[MIDDLE]
    assert np.abs(error).max() < 0.012 * 400  # a line is 2 % wide in the CWT
    assert np.sqrt(np.mean(error**2)) < 1.6
    if "coefficients" not in kind:  # of which every 20th sample alone is looked at
        assert np.sqrt(np.mean(error**2)) < 0.25  # the parabola reads between the lines


@pytest.mark.slow
@pytest.mark.parametrize("kind", MAPS)
@pytest.mark.parametrize(
    ("second", "noise", "seed"), [further(1.0, 0.0, 0), (0.3, 0.0, 0), further(1.0, 0.5, 1), (3.0, 0.5, 2)]
)
def test_crossing_chirps_do_not_change_over(crossing, kind, second, noise, seed):
    signal, both = crossing(second, noise, seed)
    found = ridges(MAPS[kind](signal), 2)
    taken = set()
    for ridge in found:
        errors = [np.abs(ridge.positions - f(ridge.at))[MIDDLE].max() for f in both]
        which = int(np.argmin(errors))
        taken.add(which)
        assert errors[which] < 40.0  # they are 300 Hz apart at the ends
        assert ridge.shared[MIDDLE].any()
        assert not ridge.shared[:100].any()
    assert taken == {0, 1}


USUAL = {"CWT": cwt_map, "squeezed CWT": squeezed_cwt_map, "STFT": stft_map, "squeezed STFT": squeezed_stft_map}
FAR_APART_S = np.array([1.0, 2.0, 6.0, 7.0])


def _branches(rate, least_hz):
    """Return a chirp and a tone that cross after 4 s, or the two hyperbolas between them if kept apart."""
    t = np.arange(int(8 * rate)) / rate
    chirp, tone = 100 + 50 * t, 300 + 0 * t
    if least_hz == 0:
        return t, (chirp, tone)
    half = np.sqrt((chirp - tone) ** 2 + least_hz**2) / 2
    return t, ((chirp + tone) / 2 + half, (chirp + tone) / 2 - half)


def _followed(kind, least_hz, amplitudes, phase=0.7):
    t, both = _branches(2048.0, least_hz)
    phases = [2 * np.pi * np.cumsum(f) / 2048.0 for f in both]
    x = amplitudes[0] * np.cos(phases[0]) + amplitudes[1] * np.cos(phases[1] + phase)
    found = ridges(USUAL[kind](UniformSignal(x, 2048.0)), 2)
    truth = [np.interp(FAR_APART_S, t, f) for f in both]
    errors = [[np.abs(r.position_at(FAR_APART_S) - f).max() for f in truth] for r in found]
    assert {int(np.argmin(e)) for e in errors} == {0, 1}
    assert max(min(e) for e in errors) < 20.0  # at 2 s and 6 s, the wavelets' footprints still overlap


@pytest.mark.parametrize("kind", USUAL)
@pytest.mark.parametrize("amplitudes", [(1.0, 1.0), (1.0, 0.7), pytest.param((0.7, 1.0), marks=pytest.mark.slow)])
def test_a_chirp_crosses_a_tone_with_usual_settings(kind, amplitudes):
    _followed(kind, 0, amplitudes)
    _followed(kind, 0, amplitudes, phase=0.7 + np.pi)


@pytest.mark.parametrize(
    ("kind", "least_hz"), [("CWT", 100), ("squeezed CWT", 100), ("STFT", 60), ("squeezed STFT", 60), ("STFT", 40)]
)
@pytest.mark.parametrize("amplitudes", [(1.0, 1.0), (1.0, 0.7), pytest.param((0.7, 1.0), marks=pytest.mark.slow)])
def test_components_that_can_be_told_apart_turn_back(kind, least_hz, amplitudes):
    _followed(kind, least_hz, amplitudes)


def test_three_crossing_components():
    t = np.arange(20_001) / 2000.0
    f = [lambda at: 150 + 40 * at, lambda at: 500 - 30 * at, lambda at: 350 + 0 * at]
    phases = [150 * t + 20 * t**2, 500 * t - 15 * t**2, 350 * t]
    x = sum(a * np.cos(2 * np.pi * p) for a, p in zip((1.0, 0.7, 0.5), phases, strict=True))
    found = ridges(stft_map(UniformSignal(x, 2000.0), window_length=0.2), 3)
    errors = [[np.abs(r.positions - g(r.at))[MIDDLE].max() for g in f] for r in found]
    assert {int(np.argmin(e)) for e in errors} == {0, 1, 2}
    assert max(min(e) for e in errors) < 15.0


def test_modulated_frequency_is_followed():
    t = np.arange(20_001) / 2000.0
    x = np.cos(2 * np.pi * (300 * t) + 40 * np.sin(2 * np.pi * 0.4 * t))
    (ridge,) = ridges(stft_map(UniformSignal(x, 2000.0), window_length=0.1))
    error = ridge.positions - (300 + 16 * np.cos(2 * np.pi * 0.4 * ridge.at))
    assert np.abs(error[MIDDLE]).max() < 1.0


@pytest.mark.parametrize("kind", ["CWT", "STFT"])
def test_amplitude_of_a_modulated_component(kind):
    t = np.arange(20_001) / 2000.0
    amplitude = 2.0 + 0.6 * np.cos(2 * np.pi * 0.5 * t)
    x = amplitude * np.cos(2 * np.pi * 200 * t + 10 * np.sin(2 * np.pi * 0.3 * t))
    signal = UniformSignal(x, 2000.0, unit="g")
    fine = {"CWT": MAPS["CWT"], "STFT": lambda s: stft_map(s, window_length=0.2, zero_padding=2)}
    (ridge,) = ridges(fine[kind](signal))
    expected = np.interp(ridge.at, t, amplitude)
    assert ridge.amplitude[MIDDLE] == pytest.approx(expected[MIDDLE], rel=0.02)
    assert ridge.unit == "g"


def test_order_ridge(swept_angle_signal):
    (ridge,) = ridges(squeezed_cwt_map(swept_angle_signal, "a", lowest=1, highest=20))
    assert ridge.axis == "order"
    assert ridge.positions[MIDDLE] == pytest.approx(7.0, rel=0.011)


def test_path_prefers_going_straight():
    scores = np.zeros((40, 160))
    columns = np.arange(160)
    scores[np.round(5 + 0.18 * columns).astype(int), columns] = 1.0
    scores[np.round(35 - 0.18 * columns).astype(int), columns] = 1.0
    hidden = np.full(scores.shape, NOT_HIDDEN, dtype=np.int16)
    path = best_path(scores, hidden, 2.0, 1.0)
    slopes = np.diff(path[::40])
    assert np.all(slopes > 0) or np.all(slopes < 0)


def test_tails_are_exchanged_only_where_that_is_smoother():
    t = np.arange(200.0)
    level = [np.zeros(200), np.zeros(200)]
    up, down = 0.3 * t, 60 - 0.3 * t
    bounced = [np.minimum(up, down), np.maximum(up, down)]
    a, b = reconnected_paths(bounced, level, 6.0, 3.0)
    assert a == pytest.approx(up, abs=0.5)
    assert b == pytest.approx(down, abs=0.5)
    a, b = reconnected_paths([up, down], level, 6.0, 3.0)
    assert np.array_equal(a, up)
    assert np.array_equal(b, down)
    assert [(m.start, m.stop) for m in crossing_segments(up, down, 6.0)] == [(90, 111)]


def test_level_decides_where_shape_does_not():
    t = np.arange(200.0)
    near = [30 + 2 / np.cosh((t - 100) / 12), 30 - 2 / np.cosh((t - 100) / 12)]
    wide = [p + np.where(np.abs(t - 100) > 40, 1, 0) * s * 8 for p, s in zip(near, (1, -1), strict=True)]
    weak_then_strong = np.where(t < 100, -2.0, 0.0)
    a, _ = reconnected_paths(wide, [weak_then_strong, weak_then_strong[::-1]], 6.0, 30.0)
    assert a[0] > 30 > a[-1]


def test_fewer_ridges_than_asked_where_there_are_no_more():
    t = np.arange(20_001) / 2000.0
    assert len(ridges(stft_map(UniformSignal(np.cos(2 * np.pi * 200 * t), 2000.0)), 3)) == 1


@pytest.mark.slow
def test_the_strongest_are_kept_not_the_clearest():
    t = np.arange(20_001) / 2000.0
    noise = np.random.default_rng(3).normal(size=len(t))
    # Four strong lines with noise around them, and weak ones where there is none.
    strong = sum(3.0 * np.cos(2 * np.pi * f * t) for f in (600.0, 700.0, 800.0, 900.0))
    around = np.convolve(noise, np.sinc(np.arange(-60, 61) / 2.5) * np.cos(np.pi * 0.75 * np.arange(-60, 61)), "same")
    weak = sum(0.3 * np.cos(2 * np.pi * f * t) for f in (100.0, 200.0, 300.0, 400.0))
    levels = stft_map(UniformSignal(strong + 0.3 * around + weak, 2000.0), window_length=0.1)
    for n in (2, 4):
        found = ridges(levels, n)
        assert all(np.median(r.positions) > 500 for r in found)
    powers = [float(np.mean(r.amplitude**2)) for r in found]
    assert powers == sorted(powers, reverse=True)


def test_nothing_is_found_in_silence():
    with pytest.raises(RefusalError, match="no ridge"):
        ridges(stft_map(UniformSignal(np.zeros(4000), 100.0)))


def test_wrong_input_is_named(crossing):
    levels = stft_map(crossing()[0])
    with pytest.raises(InputError, match="n_ridges"):
        ridges(levels, 0)
    with pytest.raises(InputError, match=r"n_ridges is 500 on .*allowed: 1 to"):
        ridges(levels, 500)
    with pytest.raises(InputError, match="steepest"):
        ridges(levels, steepest=0)
    with pytest.raises(RefusalError, match="fewer than three"):
        ridges(levels, lowest=100, highest=101)
    with pytest.raises(InputError, match="differ in length"):
        Ridge(np.zeros(3), np.zeros(2), np.zeros(3), np.zeros(3, bool), "frequency", "")


def test_a_meeting_that_lasts_to_the_end_is_read_and_not_drawn_flat():
    t = np.arange(20_001) / 2000.0
    # The second comes down to 20 Hz above the first and stays there, within reach of it.
    above = 20 + 200 * np.clip(1 - t / 6, 0, None)
    first = 200 + 15 * t
    phase = 2 * np.pi * np.cumsum(first) / 2000.0
    x = np.cos(phase) + 0.8 * np.cos(phase + 2 * np.pi * np.cumsum(above) / 2000.0)
    found = ridges(stft_map(UniformSignal(x, 2000.0), window_length=0.1, zero_padding=2), 2)
    for ridge in found:
        rising = ridge.positions[-60] - ridge.positions[-300]
        assert rising == pytest.approx(15 * (ridge.at[-60] - ridge.at[-300]), rel=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.0, 0.05, 0.3])
@pytest.mark.parametrize("transform", [squeezed_cwt, squeezed_cwt_map, squeezed_stft, squeezed_stft_map])
def test_noise_leaves_the_level_along_a_squeezed_ridge(transform, sigma):
    rate, n = 2048.0, 8192
    x = np.cos(2 * np.pi * 200.0 * np.arange(n) / rate) + sigma * np.random.default_rng(0).normal(size=n)
    (ridge,) = ridges(transform(x, rate, lowest=50.0, highest=800.0))
    inside = slice(len(ridge.at) // 10, -len(ridge.at) // 10)
    # What noise adds to the mean square of a sine within the band of the wavelet or window is well below 2 %.
    assert np.mean(ridge.amplitude[inside]) == pytest.approx(1.0, abs=0.015)


@pytest.mark.parametrize("hz_per_s", [100.0, 300.0])
@pytest.mark.parametrize("transform", [squeezed_cwt, squeezed_cwt_map, squeezed_stft])
def test_a_squeezed_ridge_follows_the_frequency_of_a_chirp(transform, hz_per_s):
    rate, n = 2048.0, 4096
    t = np.arange(n) / rate
    x = np.cos(2 * np.pi * (100.0 * t + hz_per_s / 2 * t**2))
    (ridge,) = ridges(transform(x, rate, lowest=50.0, highest=900.0))
    inside = slice(len(ridge.at) // 10, -len(ridge.at) // 10)
    error = ridge.positions - (100.0 + hz_per_s * ridge.at)
    assert np.sqrt(np.mean(error[inside] ** 2)) < 0.4
    assert np.mean(ridge.amplitude[inside]) == pytest.approx(1.0, abs=0.01)


# Ridges stay with their component where it fades or noise covers it, instead of leaping to what is clearer there.

SAMPLES = Path(__file__).parents[2] / "sample_data"
RATE = 4096.0
TEETH = 29


@pytest.fixture(scope="module")
def run_up():
    """Squeezed map of the run-up; mesh frequency over time from the tachometer."""
    rig = read_rig(SAMPLES / "run_up.toml")
    recording = read_recording(SAMPLES / "run_up.h5", rig=rig)
    angle = find_shaft_angle(recording, rig)

    def mesh_hz(at):
        ends = [np.interp(at + d, angle.time_s, angle.revolutions) for d in (-0.02, 0.02)]
        return TEETH * (ends[1] - ends[0]) / 0.04

    return squeezed_cwt_map(recording, "a1", wavelet=Morse(82.0)), mesh_hz


@pytest.mark.slow
@pytest.mark.parametrize("n_ridges", [1, 2, 3])
def test_the_mesh_is_followed_from_where_it_is_weak(run_up: tuple[TimeFrequencyMap, object], n_ridges: int):
    levels, mesh_hz = run_up
    found = ridges(levels, n_ridges)
    assert len(found) == n_ridges
    shares = []
    for ridge in found:
        inside = (ridge.at > 0.2) & (ridge.at < 7.7)
        order = ridge.positions[inside] / mesh_hz(ridge.at[inside])
        shares.append(max((float(np.mean(np.abs(order / h - 1) < 0.06)), -h) for h in range(1, 7)))
    assert -shares[0][1] == 1  # below 2 s it is 30 dB under the fourth harmonic
    assert shares[0][0] > 0.95
    assert min(share for share, _ in shares) > 0.75
    assert len({h for _, h in shares}) == n_ridges


@pytest.mark.parametrize("transform", [cwt_map, squeezed_cwt_map])
@pytest.mark.parametrize("seed", [0, further(1), further(2)])
@pytest.mark.parametrize("course", ["chirp", "step"])
def test_a_ridge_in_noise_of_more_power_is_followed(transform, seed: int, course: str):
    t = np.arange(int(8 * RATE)) / RATE
    hertz = 100.0 * 2 ** (t / 2) if course == "chirp" else np.where(t < 4, 300.0, 900.0)
    x = np.cos(2 * np.pi * np.cumsum(hertz) / RATE)
    x += 1.5 * np.random.default_rng(seed).standard_normal(len(t))  # 6.5 dB over the sine
    (ridge,) = ridges(transform(UniformSignal(x, RATE)))
    error = ridge.positions / np.interp(ridge.at, t, hertz) - 1
    assert np.mean(np.abs(error) < 0.1) > 0.85


def test_paths_that_would_meet_beyond_the_map_part_at_its_edge():
    beyond = [np.array([19.0, 20.5, 21.0]), np.array([17.0, 19.5, 20.0])]
    upper, lower = maxima_of_separate_paths(np.ones((18, 3)), beyond, 0)
    assert np.all((lower >= 0) & (lower <= upper) & (upper <= 17))


# Waveforms from ridges, and signals from their coefficients.

T = np.arange(20_001) / 2000.0
AMPLITUDE = 1 + 0.3 * np.cos(2 * np.pi * 2 * T)
CHIRP = AMPLITUDE * np.exp(2j * np.pi * (100 * T + 15 * T**2))
OTHER = np.exp(2j * np.pi * (500 * T + 10 * T**2))
HIGH = np.exp(2j * np.pi * (750 * T + 5 * T**2))
INSIDE = slice(500, -500)


def _ridge(signal, wavelet):
    return ridges(cwt_map(signal, wavelet=wavelet, lowest=50, highest=450, n_per_octave=32))[0]


@pytest.mark.parametrize(
    ("beta", "squeezed", "error"), [(20.0, True, 1e-2), (60.0, True, 1e-4), (20.0, False, 2e-2), (60.0, False, 2e-2)]
)
def test_modulated_chirp_comes_out_of_its_band(beta, squeezed, error):
    signal = UniformSignal((CHIRP + HIGH).real, 2000.0, unit="g", source="a")
    wavelet = Morse(beta)
    found = component(signal, _ridge(signal, wavelet), squeezed=squeezed, wavelet=wavelet)
    assert np.abs(found.analytic - CHIRP)[INSIDE].max() < error
    assert np.abs(found.amplitude - AMPLITUDE)[INSIDE].max() < error
    assert np.array_equal(found.values, found.analytic.real)
    assert (found.unit, found.source) == ("g", "a")


def test_noise_outside_the_band_is_left_out():
    noise = 0.5 * np.random.default_rng(0).normal(size=len(T))
    signal = UniformSignal(CHIRP.real + noise, 2000.0)
    wavelet = Morse(60.0)
    ridge = _ridge(signal, wavelet)
    for squeezed in (True, False):
        found = component(signal, ridge, squeezed=squeezed, wavelet=wavelet)
        error = np.sqrt(np.mean((found.values - CHIRP.real)[INSIDE] ** 2))
        assert error < 0.2


def test_whole_signal_from_the_cwt():
    """The error is that of Σ over lines instead of ∫ over scale, and of lines that are not there."""
    x = CHIRP.real
    found = inverse(cwt(UniformSignal(x, 2000.0), lowest=20, highest=990, n_per_octave=12))
    assert np.abs(found.real - x).max() < 0.02  # at the ends, where frequencies jump in the reflection
    assert np.abs(found - CHIRP)[INSIDE].max() < 1e-3


def test_inverse_between_limits_that_follow_a_component():
    x = (CHIRP + OTHER).real
    coefficients = stft(UniformSignal(x, 2000.0), window_length=0.1)
    low = 100 + 30 * T
    found = inverse(coefficients, lowest=low - 60, highest=low + 60)
    assert np.abs(found - CHIRP)[INSIDE].max() < 0.02
    with pytest.raises(InputError, match="lowest has shape"):
        inverse(coefficients, lowest=np.zeros(7))
    with pytest.raises(InputError, match="NaN"):
        inverse(coefficients, highest=np.nan)


def test_order_component(swept_angle_signal):
    at = np.array([0.0, 200.0])
    ridge = Ridge(at, np.full(2, 7.0), np.ones(2), np.zeros(2, bool), "order", "g")
    found = component(swept_angle_signal, ridge, "a")
    revolutions = np.arange(200 * 64) / 64
    assert np.abs(found.analytic - np.exp(14j * np.pi * revolutions))[INSIDE].max() < 1e-3
    with pytest.raises(InputError, match="over order"):
        component(UniformSignal(np.zeros(1000), 1.0), ridge)


def test_a_ridge_at_zero_has_no_waveform():
    ridge = Ridge(T[[0, -1]], np.array([0.0, 40.0]), np.ones(2), np.zeros(2, bool), "frequency", "")
    with pytest.raises(InputError, match="touches zero"):
        component(UniformSignal(CHIRP.real, 2000.0), ridge)


def test_half_width_has_limits():
    signal = UniformSignal(CHIRP.real, 2000.0)
    ridge = Ridge(T[[0, -1]], np.array([100.0, 400.0]), np.ones(2), np.zeros(2, bool), "frequency", "")
    with pytest.raises(InputError, match="half_width"):
        component(signal, ridge, half_width=0.6)


def test_a_ridge_at_the_lowest_line_has_a_component():
    """The band's lower half would need a longer signal; the upper half is there."""
    n = 1000
    signal = UniformSignal(np.cos(2 * np.pi * 8.0 * np.arange(n) / 2000.0), 2000.0)
    lowest = lowest_analysable(signal, Morse())
    at = np.array([0.0, n / 2000.0])
    ridge = Ridge(at, np.full(2, max(lowest, 8.0)), np.ones(2), np.zeros(2, dtype=bool), "frequency", "")
    assert np.isfinite(component(signal, ridge).values).all()
    below = Ridge(at, np.full(2, 0.5 * lowest), np.ones(2), np.zeros(2, dtype=bool), "frequency", "")
    with pytest.raises(RefusalError, match="shorter than the wavelet"):
        component(signal, below)
