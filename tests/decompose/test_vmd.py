"""Variational modes against vmdpy, closed forms and invariants; block by block; of all kinds of signals."""

from __future__ import annotations

import sys
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from vmdpy import VMD

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.decompose import Modes, VmdSettings, modes_by_block, vmd
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording
from gearsig.spectra import Envelope, band_envelope
from gearsig.timefreq import UniformSignal
from tests.measured import BY_NAME, needs_data

INIT = {"zero": 0, "uniform": 1, "random": 2}


def _signal(n: int, seed: int = 0) -> np.ndarray:
    i = np.arange(n)
    modulated = (1 + 0.5 * np.cos(0.01 * i)) * np.cos(2 * np.pi * 0.12 * i + 1)
    return np.cos(2 * np.pi * 0.03 * i) + modulated + 0.3 * np.random.default_rng(seed).normal(size=n) + 0.2


def _reference(x: np.ndarray, s: VmdSettings) -> tuple[np.ndarray, np.ndarray]:
    tolerance = 1e-9 if s.tolerance is None else s.tolerance
    u, _, omega = VMD(x, s.penalty, s.dual_step, s.n_modes, s.zero_mode, INIT[str(s.start)], tolerance)
    return u, omega


def _assert_equal(x: np.ndarray, s: VmdSettings, rng: np.random.Generator | None = None) -> None:
    u, omega = _reference(x, s)
    modes = vmd(x, 1.0, s, rng=rng)
    assert modes.n_iterations == len(omega)
    # On noise 500 iterations without an end let rounding grow a little.
    assert np.abs(modes.waveforms - u).max() < 1e-11 * np.abs(x).max()
    assert np.abs(modes.centre_history - omega).max() < 1e-11
    assert np.abs(modes.residual - (x - u.sum(axis=0))).max() < 1e-11 * np.abs(x).max()


@pytest.mark.parametrize("n", [64, 254, 1000, 1026, 2048])  # also twice an odd number, where the mirror is odd
@pytest.mark.parametrize("n_modes", [1, 2, 5])
@pytest.mark.parametrize("start", ["uniform", "zero"])
def test_equals_vmdpy(n, n_modes, start):
    _assert_equal(_signal(n), VmdSettings(n_modes, start=start, tolerance=1e-5))


@pytest.mark.parametrize("dual_step", [0.05, 1.0])
@pytest.mark.parametrize("zero_mode", [False, True])
def test_equals_vmdpy_with_multiplier_and_zero_mode(dual_step, zero_mode):
    _assert_equal(_signal(600), VmdSettings(4, dual_step=dual_step, zero_mode=zero_mode, tolerance=1e-7))


@pytest.mark.parametrize("penalty", [1.0, 50.0, 2e5])
def test_equals_vmdpy_at_other_penalties(penalty):
    _assert_equal(_signal(500), VmdSettings(3, penalty=penalty, tolerance=1e-6))


def test_equals_vmdpy_where_it_does_not_converge():
    _assert_equal(_signal(300), VmdSettings(6, tolerance=0.0))


def test_equals_vmdpy_where_it_stops_all_of_a_sudden():
    # A lone tone's change falls ten-thousandfold per iteration: the solver sees its last iteration only afterwards.
    x = np.cos(0.2 * np.arange(1000)) + 0.1 * np.random.default_rng(0).normal(size=1000)
    s = VmdSettings(1, start="zero", tolerance=1e-5)
    before = vmd(x, 1.0, VmdSettings(1, start="zero", tolerance=0.0, max_iterations=3))
    _assert_equal(x, s)
    after = vmd(x, 1.0, s)
    assert before.last_change > 4 * 1e-5 / float(np.sum(x**2)) > 4 * after.last_change
    assert after.n_iterations == 4


def test_equals_vmdpy_from_random_starts():
    np.random.seed(5)  # noqa: NPY002 - the reference program draws from numpy's global state
    twister = np.random.MT19937()
    twister.state = np.random.RandomState(5).get_state(legacy=False)
    _assert_equal(_signal(800), VmdSettings(4, start="random", tolerance=1e-5), np.random.Generator(twister))


@pytest.mark.slow
@settings(max_examples=25)
@given(
    n=st.integers(20, 200).map(lambda half: 2 * half),
    n_modes=st.integers(1, 5),
    penalty=st.floats(10.0, 1e4),
    seed=st.integers(0, 999),
)
def test_equals_vmdpy_on_noise(n, n_modes, penalty, seed):
    # Noise has no modes: the number of iterations may hang on a last digit, so it is fixed by a tolerance of zero.
    x = np.random.default_rng(seed).normal(size=n)
    _assert_equal(x, VmdSettings(n_modes, penalty=penalty, tolerance=0.0))


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))])
def test_where_the_multiplier_amplifies_rounding_it_does_no_more_than_in_vmdpy(seed):
    s = VmdSettings(4, penalty=3000.0, dual_step=0.1, tolerance=0.0)
    x = np.random.default_rng(seed).normal(size=100)
    u, v = _reference(x, s)[0], _reference(x * (1 + 1e-15), s)[0]
    bound = max(1e-12, 20 * np.abs(v - u).max())
    assert bound < 1e-7
    assert np.abs(vmd(x, 1.0, s).waveforms - u).max() < bound


def test_tones_on_lines_of_the_mirrored_signal_come_back_by_the_fixed_point():
    # For cosines that are single lines of the mirrored spectrum, the fixed point solves a 2 × 2 linear system per line:
    # (1 + g) weights with g_k = α (ω - ω_k)²; here the tones are so far apart that each centre is its line.
    n, a, b = 4000, 200, 1600
    q = np.pi * (np.arange(n) + 0.5) / n
    x = 2.0 * np.cos(a * q) + 1.0 * np.cos(b * q)
    modes = vmd(x, 1.0, VmdSettings(2, tolerance=1e-18))
    lines = np.array([np.cos(a * q), np.cos(b * q)])
    gains = 2000.0 * (np.array([a, b])[None, :] / (2 * n) - modes.centres[:, None]) ** 2  # (mode, line)
    expected = np.zeros((2, 2))
    for j, amplitude in enumerate((2.0, 1.0)):
        expected[:, j] = np.linalg.solve(np.ones((2, 2)) + np.diag(gains[:, j]), np.full(2, amplitude))
    assert modes.waveforms == pytest.approx(expected @ lines, abs=1e-7)
    power = expected**2
    assert modes.centres == pytest.approx(power @ [a / (2 * n), b / (2 * n)] / power.sum(axis=1), rel=1e-8)
    spread = np.array([a, b])[None, :] / (2 * n) - modes.centres[:, None]
    assert modes.bandwidths == pytest.approx(np.sqrt((power * spread**2).sum(axis=1) / power.sum(axis=1)), rel=1e-6)


def test_modes_and_residual_sum_to_the_signal():
    x = _signal(1001)
    modes = vmd(x, 1.0, VmdSettings(3))
    assert modes.waveforms.sum(axis=0) + modes.residual == pytest.approx(x, abs=1e-13)


def test_the_multiplier_makes_the_modes_sum_to_the_signal():
    x = _signal(1001)
    loose = vmd(x, 1.0, VmdSettings(4, penalty=20.0))
    exact = vmd(x, 1.0, VmdSettings(4, penalty=20.0, dual_step=0.5, tolerance=0.0))
    assert exact.reconstruction_error < 1e-5
    assert loose.reconstruction_error > 5e-3


@pytest.mark.parametrize("factor", [1e-10, 1e-3, -7.0, 1e12])
def test_the_unit_does_not_matter(factor):
    x = _signal(700)
    a, b = (vmd(v, 1.0, VmdSettings(3)) for v in (x, factor * x))
    assert a.n_iterations == b.n_iterations
    assert b.waveforms / factor == pytest.approx(a.waveforms, abs=1e-12)
    assert b.rms / abs(factor) == pytest.approx(a.rms)
    assert b.reconstruction_error == pytest.approx(a.reconstruction_error)


@pytest.mark.parametrize("seed", [0, 1])
def test_reversed_in_time_the_modes_are_reversed(seed):
    x = _signal(901, seed)
    a, b = (vmd(v, 1.0, VmdSettings(3)) for v in (x, x[::-1]))
    assert a.waveforms == pytest.approx(b.waveforms[:, ::-1], abs=1e-11)


@pytest.mark.parametrize("shorter", [0, 1, 2, 3])
def test_a_sample_more_or_less_changes_little(shorter):
    x = _signal(4000) - 0.2
    settings_ = VmdSettings(2, start=(0.03, 0.12))
    whole = vmd(x, 1.0, settings_)
    part = vmd(x[: len(x) - shorter], 1.0, settings_)
    assert part.centres == pytest.approx(whole.centres, abs=5e-5)
    assert part.waveforms[:, :3000] == pytest.approx(whole.waveforms[:, :3000], abs=2e-2)


def test_single_precision_input_is_computed_in_double():
    x = _signal(2000).astype(np.float32)
    a, b = (vmd(v, 1.0, VmdSettings(3)) for v in (x, x.astype(np.float64)))
    assert np.array_equal(a.waveforms, b.waveforms)
    assert a.waveforms.dtype == np.float64


def test_odd_lengths_keep_the_last_sample():
    modes = vmd(_signal(999), 1.0, VmdSettings(2))
    assert modes.waveforms.shape == (2, 999)


def test_given_starts_are_in_hertz():
    x = _signal(2000)
    modes = vmd(x, 5000.0, VmdSettings(3, start=(0.0, 150.0, 600.0)))
    assert modes.centre_history[0] == pytest.approx([0.0, 150.0, 600.0])
    assert modes.centres[1:] == pytest.approx([150.0, 600.0], abs=5.0)


def test_what_is_not_converged_says_so():
    modes = vmd(_signal(500), 1.0, VmdSettings(3, max_iterations=5))
    assert not modes.converged
    assert modes.n_iterations == 5
    assert "Not converged" in modes.notes[0]


def test_modes_on_the_same_lines_are_noted():
    modes = vmd(np.cos(0.2 * np.arange(1000)), 1.0, VmdSettings(3, max_iterations=5000))
    assert any("share the same lines" in note for note in modes.notes)
    assert not vmd(_signal(1000), 1.0, VmdSettings(2, max_iterations=5000)).notes


def test_modes_are_sorted_by_rising_centre():
    modes = vmd(UniformSignal(_signal(2000), 1000.0, unit="g", source="a1"), None, VmdSettings(2, start=(120.0, 30.0)))
    assert modes.centres[0] > modes.centres[1]
    assert modes.by_centre() == (1, 0)
    assert list(modes.to_frame()["centres"]) == list(modes.centres)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (np.r_[np.nan, np.ones(50)], "NaN"),
        (np.full(100, 3.0), "constant"),
        (np.arange(23.0), "n_modes is 6 for 23 samples"),
        (np.ones((2, 50)), "shape"),
    ],
)
def test_signals_that_do_not_do(values, message):
    with pytest.raises(InputError, match=message):
        vmd(values, 1.0, VmdSettings(6))


@pytest.mark.parametrize(
    "wrong",
    [
        {"n_modes": 0},
        {"penalty": 0.0},
        {"penalty": float("nan")},
        {"dual_step": -1.0},
        {"start": "unifrom"},
        {"start": (1.0,)},
        {"tolerance": -1.0},
        {"max_iterations": 1},
    ],
)
def test_settings_that_do_not_do(wrong):
    with pytest.raises(InputError):
        VmdSettings(**({"n_modes": 2} | wrong))


@pytest.mark.parametrize("start", [(0.1, 0.6), (-0.1, 0.2), (0.1, float("nan"))])
def test_starts_outside_the_spectrum(start):
    with pytest.raises(InputError, match="half the sampling rate"):
        vmd(_signal(100), 1.0, VmdSettings(2, start=start))


def test_random_starts_need_a_generator():
    with pytest.raises(InputError, match="rng"):
        vmd(_signal(100), 1.0, VmdSettings(2, start="random"))


def test_a_tolerance_above_the_signals_energy_is_no_tolerance():
    with pytest.raises(InputError, match="leave tolerance out"):
        vmd(1e-6 * _signal(100), 1.0, VmdSettings(2, tolerance=1e-5))


def _by_both_engines(n: int):
    x = 1e-3 * _signal(n)
    return x, *(vmd(x, 500.0, VmdSettings(3, engine=engine)) for engine in ("gearsig", "vmdpy"))


def test_the_engine_vmdpy_gives_the_same_modes():
    x, ours, theirs = _by_both_engines(1500)
    assert np.abs(theirs.waveforms - ours.waveforms).max() < 1e-12 * np.abs(x).max()
    assert theirs.centre_history == pytest.approx(ours.centre_history, rel=1e-12)
    # Its line at half the sampling rate is the only thing by which its waveforms' spectra differ from the solution.
    assert theirs.bandwidths == pytest.approx(ours.bandwidths, rel=1e-4)
    assert theirs.waveforms.sum(axis=0) + theirs.residual == pytest.approx(x, abs=1e-15)
    assert theirs.converged


def test_the_engine_vmdpy_keeps_the_last_sample_of_an_odd_length():
    x, ours, theirs = _by_both_engines(1501)
    # One mirrored sample more is another end to the signal: the modes differ there, and little elsewhere.
    assert np.abs(theirs.waveforms - ours.waveforms)[:, :-100].max() < 1e-3 * np.abs(x).max()
    assert theirs.centres == pytest.approx(ours.centres, rel=2e-3)
    assert theirs.waveforms.sum(axis=0) + theirs.residual == pytest.approx(x, abs=1e-15)


@pytest.mark.parametrize("wrong", [{"start": "peaks"}, {"start": "random"}, {"max_iterations": 50}])
def test_what_vmdpy_cannot_be_told_is_refused(wrong):
    with pytest.raises(InputError, match=r"vmdpy.*gearsig"):
        VmdSettings(2, engine="vmdpy", **wrong)


def test_an_engine_that_is_missing_or_fails_says_so(monkeypatch):
    monkeypatch.setitem(sys.modules, "vmdpy", None)
    with pytest.raises(InputError, match="pip install vmdpy"):
        vmd(_signal(64), 1.0, VmdSettings(2, engine="vmdpy"))

    def out_of_memory(*_):
        raise MemoryError("too much")

    monkeypatch.setitem(sys.modules, "vmdpy", SimpleNamespace(VMD=out_of_memory))
    with pytest.raises(InputError, match="MemoryError: too much"):
        vmd(_signal(64), 1.0, VmdSettings(2, engine="vmdpy"))
    assert vmd(_signal(64), 1.0, VmdSettings(2)).n_modes == 2


# Block by block, modes join without gap and say where they do not go on.

SAMPLES = np.arange(20_000)
TONES = np.stack([np.cos(0.2 * SAMPLES), 0.5 * np.cos(1.3 * SAMPLES + 0.4)])


@settings(max_examples=25)
@given(n=st.integers(300, 3000), n_per_block=st.integers(64, 700), overlap=st.floats(0.01, 1 / 3))
def test_stretches_cover_the_signal_once_and_sum_to_it(n, n_per_block, overlap):
    x = TONES.sum(axis=0)[:n]
    exact = VmdSettings(2, penalty=20.0, dual_step=0.5, tolerance=0.0)
    segments = list(modes_by_block(x, 1.0, exact, n_per_block=n_per_block, overlap=overlap))
    ends = [s.start + s.waveforms.shape[1] for s in segments]
    assert [s.start for s in segments] == [0, *ends[:-1]]
    assert ends[-1] == n
    # The line at half the sampling rate is all that an exact block leaves; a sample doubled or left out would jump.
    assert np.abs(np.concatenate([s.waveforms for s in segments], axis=1).sum(axis=0) - x).max() < 1e-2
    assert all(0 < s.n_fade <= s.waveforms.shape[1] for s in segments[1:])


def test_a_short_signal_is_one_block():
    (segment,) = modes_by_block(TONES.sum(axis=0), 1.0, VmdSettings(2))
    whole = vmd(TONES.sum(axis=0), 1.0, VmdSettings(2))
    assert np.array_equal(segment.waveforms, whole.waveforms)
    assert (segment.n_fade, segment.start) == (0, 0)


def test_steady_tones_go_on_over_the_seams():
    segments = list(modes_by_block(TONES.sum(axis=0), 1.0, VmdSettings(2), n_per_block=3000))
    assert len(segments) > 5
    assert max(s.seam_mismatch.max() for s in segments) < 0.1
    error = np.concatenate([s.waveforms for s in segments], axis=1)[:, 200:-200] - TONES[:, 200:-200]
    assert np.sqrt(np.mean(error**2)) < 0.02


def test_a_frequency_that_wanders_is_followed():
    phase = np.cumsum(0.5 + 0.6 * SAMPLES / len(SAMPLES))
    blocks = modes_by_block(np.cos(phase), 1.0, VmdSettings(1, penalty=2e4, start=(0.08,)), n_per_block=2000)
    centres = np.array([s.centres[0] for s in blocks]) * 2 * np.pi
    assert np.all(np.diff(centres) > 0)
    assert centres[[0, -1]] == pytest.approx([0.53, 1.07], abs=0.02)


def test_a_component_that_ends_shows_at_its_seam():
    second = np.where(SAMPLES < 10_000, np.cos(1.3 * SAMPLES), np.cos(2.2 * SAMPLES))
    segments = list(modes_by_block(TONES[0] + second, 1.0, VmdSettings(2), n_per_block=3000))
    mismatch = np.array([s.seam_mismatch for s in segments])
    assert mismatch[:, 0].max() < 0.2
    assert mismatch[:, 1].max() > 0.3


def test_the_mode_at_zero_stays_first():
    segments = modes_by_block(TONES[1] + 2.0, 1.0, VmdSettings(2, zero_mode=True), n_per_block=3000)
    assert all(s.centres[0] == 0.0 for s in segments)


def test_a_block_without_signal_has_no_modes():
    x = np.where(SAMPLES < 10_000, TONES[0], 0.0)
    with pytest.raises(InputError, match="constant"):
        list(modes_by_block(x, 1.0, VmdSettings(1), n_per_block=2000))


@pytest.mark.parametrize("wrong", [{"overlap": 0.0}, {"overlap": 0.5}, {"n_per_block": 10}])
def test_blocks_that_do_not_do(wrong):
    with pytest.raises(InputError):
        modes_by_block(TONES[0], 1.0, VmdSettings(1), **wrong)


# A long signal's modes as one answer.


def test_blocks_find_what_the_whole_signal_shows():
    x = TONES.sum(axis=0)
    found = vmd(UniformSignal(x, 1.0, unit="g", source="a"), None, VmdSettings(2), n_per_block=3000)
    whole = vmd(x, 1.0, VmdSettings(2))
    assert found.centres == pytest.approx(whole.centres, rel=2e-3)
    np.testing.assert_allclose(found.waveforms.sum(axis=0) + found.residual, x, atol=1e-12)
    assert np.sqrt(np.mean((found.waveforms - TONES)[:, 200:-200] ** 2)) < 0.02
    assert (found.unit, found.source, found.notes) == ("g", "a", ())
    assert len(found.centre_history) > 6


def test_a_mode_that_wanders_is_as_wide_as_it_wanders():
    """A frequency that rises evenly from f to f + d has the standard deviation d/√12."""
    frequency = 0.08 + 0.02 * SAMPLES / len(SAMPLES)
    x = np.cos(2 * np.pi * np.cumsum(frequency))
    found = vmd(x, 1.0, VmdSettings(1, start=(0.08,)), n_per_block=1000)
    assert found.centres[0] == pytest.approx(0.09, abs=2e-4)
    assert found.bandwidths[0] == pytest.approx(0.02 / np.sqrt(12), rel=0.05)


def test_a_component_that_changes_is_told_at_its_seam():
    second = np.where(SAMPLES < 10_000, np.cos(1.3 * SAMPLES), np.cos(2.2 * SAMPLES))
    (note,) = vmd(TONES[0] + second, 1.0, VmdSettings(2), n_per_block=3000).notes
    assert "does not continue across the seam at" in note


# Modes of channels, of signals over angle, of envelopes.

FS = 10_000.0
TIME = np.arange(20_000) / FS
MODULATION = 1 + 0.5 * np.cos(2 * np.pi * 20 * TIME) + 0.3 * np.cos(2 * np.pi * 90 * TIME)
MODULATED = 2.0 * MODULATION * np.cos(2 * np.pi * 3000 * TIME)


def _recording(*rows: np.ndarray) -> Recording:
    names = [Channel(f"a{i + 1}", "acceleration", "g") for i in range(len(rows))]
    return Recording(np.stack(rows), FS, tuple(names))


def test_a_channels_modes_carry_its_name_and_unit():
    x = np.cos(2 * np.pi * 200 * TIME) + 0.5 * np.cos(2 * np.pi * 2000 * TIME)
    modes = vmd(_recording(MODULATED, x), "a2", 2)
    assert modes.centres == pytest.approx([200.0, 2000.0], abs=1.0)
    assert (modes.source, modes.unit, modes.sampling_rate) == ("a2", "g", FS)
    assert modes.rms == pytest.approx([0.707, 0.354], abs=0.01)
    assert modes.positions[-1] == pytest.approx(TIME[-1])


def test_over_angle_the_centres_are_orders():
    n = 256 * 80
    revolutions = np.arange(n) / 256
    x = np.cos(2 * np.pi * 23 * revolutions) + 0.5 * np.cos(2 * np.pi * 4 * revolutions)
    angle = ShaftAngle("input", np.array([0.0, 10.0]), np.array([0.0, 80.0]), np.array([4.0, 12.0]), "constant")
    signal = AngleSignal(x[None, :], 256, angle, 0.0, ("a1",), ("m/s^2",), 100.0)
    modes = vmd(signal, "a1", VmdSettings(2, start=(4.0, 23.0)))
    assert modes.centres == pytest.approx([4.0, 23.0], abs=0.05)
    assert (modes.axis, modes.shaft, modes.unit) == ("order", "input", "m/s^2")


def envelope_modes(envelope: Envelope, settings: VmdSettings) -> Modes:
    return vmd(envelope.values - envelope.values.mean(), envelope.sampling_rate_hz, settings)


def test_modes_of_the_envelope_are_its_modulations():
    envelope = band_envelope(MODULATED, FS, (2700, 3300), kind="magnitude", unit="g", source="a1")
    modes = envelope_modes(envelope, VmdSettings(2, start="peaks"))
    assert modes.centres == pytest.approx([20.0, 90.0], abs=0.5)
    assert modes.rms * np.sqrt(2) == pytest.approx([1.0, 0.6], abs=0.02)


@needs_data
def test_the_outer_race_shows_in_a_mode_of_the_measured_envelope():
    recording = BY_NAME["bearing_races/OuterRaceFault_vload_4.mat"].read()
    name = recording.vibration_names()[0]
    settings = VmdSettings(4, penalty=20_000.0, start="peaks")
    envelope = band_envelope(recording.values(name), recording.sampling_rate_hz, (2000, 2600), kind="magnitude")
    modes = envelope_modes(envelope, settings)
    assert np.abs(modes.centres - 81.125).min() < 4.0
