"""Data quality: what must be found, and what must not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.recording import Channel, Recording, find_problems

N = 20_000
T = np.arange(N)
RNG = np.random.default_rng(11)


def kinds(*rows, quantity="acceleration"):
    channels = tuple(Channel(f"a{i}", quantity, "m/s^2") for i in range(len(rows)))
    return [(p.channel, p.kind) for p in find_problems(Recording(np.stack(rows), 1e4, channels))]


def quantise(x, bits, full=1.0):
    step = 2 * full / 2**bits
    return np.clip(np.round(x / step), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1) * step


@given(frequency=st.floats(1e-4, 0.49), bits=st.sampled_from([7, 8, 12, 16, 24, None]), amplitude=st.floats(0.6, 0.99))
@settings(max_examples=150, deadline=None)
def test_a_sine_is_not_clipped(frequency, bits, amplitude):
    x = amplitude * np.sin(2 * np.pi * frequency * T + 0.3)
    assert "clipped" not in [kind for _, kind in kinds(x if bits is None else quantise(x, bits))]


@pytest.mark.parametrize("n_per_period", [4, 8, 10, 100, 1000])
@pytest.mark.parametrize("phase", [0.0, 0.5])
def test_a_coherent_sine_is_not_clipped(n_per_period, phase):
    x = np.sin(2 * np.pi * (T + phase) / n_per_period)
    assert "clipped" not in [kind for _, kind in kinds(x)]
    assert "clipped" not in [kind for _, kind in kinds(quantise(0.9 * x, 12))]


@pytest.mark.parametrize("bits", [2, 3, 4, 5, 6, 8, 12])
@pytest.mark.parametrize("relative_rms", [0.05, 0.1, 0.2])
def test_coarse_noise_is_not_clipped(bits, relative_rms):
    x = RNG.standard_normal(N) * relative_rms
    assert "clipped" not in [
        kind for _, kind in kinds(quantise(np.clip(x, -0.9, 0.9) if relative_rms < 0.2 else x, bits, 1.0))
    ]


@pytest.mark.parametrize(("quantity", "found"), [("force", []), ("acceleration", ["clipped"])])
def test_parts_that_come_apart_carry_no_force(quantity, found):
    x = np.maximum(np.sin(2 * np.pi * 0.0131 * T) + 0.3, 0.0)
    assert [kind for _, kind in kinds(x, quantity=quantity)] == found
    held = np.minimum(x, 1.0)
    assert [kind for _, kind in kinds(held, quantity=quantity)] == ["clipped"]


def test_impulses_and_pulse_trains_are_not_clipped():
    ringing = np.convolve((T % 500 == 0) * RNG.uniform(0.5, 1, N), np.exp(-T[:200] / 20) * np.sin(T[:200]))[:N]
    assert kinds(ringing + 1e-3 * RNG.standard_normal(N)) == []
    pulses = (T % 100 < 20) * 5.0
    assert "clipped" not in [kind for _, kind in kinds(pulses + 0.01 * RNG.standard_normal(N))]


@pytest.mark.parametrize("limit", [0.3, 0.7, 0.95])
@pytest.mark.parametrize("frequency", [0.0011, 0.0131, 0.0412])
@pytest.mark.parametrize("bits", [8, 12, 16, None])
def test_a_clipped_sine_is_found(limit, frequency, bits):
    x = np.clip(np.sin(2 * np.pi * frequency * T), -limit, limit)
    x = x if bits is None else quantise(x, bits)
    (problem,) = find_problems(Recording(x[np.newaxis], 1e4, (Channel("a", "acceleration"),)))
    assert problem.kind == "clipped"
    assert problem.share == pytest.approx(1 - 2 * np.arcsin(limit) / np.pi, rel=0.15, abs=0.005)


def test_clipping_at_one_end_with_noise_on_the_limit_and_rare():
    smooth = np.convolve(RNG.standard_normal(N), np.hanning(20), "same")
    smooth /= smooth.std()
    assert kinds(np.minimum(smooth, 1.5)) == [("a0", "clipped")]
    assert kinds(np.clip(smooth, -1.5, 1.5) + 1e-3 * RNG.standard_normal(N)) == [("a0", "clipped")]
    assert kinds(quantise(np.clip(smooth, -2.7, 2.7), 16, 4.0)) == [("a0", "clipped")]


def test_dead_channels():
    x = RNG.standard_normal(N)
    flicker = 1e-4 * RNG.integers(0, 2, N)
    assert kinds(np.zeros(N), x) == [("a0", "dead")]
    assert kinds(x, flicker, x[::-1]) == [("a1", "dead")]
    assert kinds(x, 1e-4 * x) == []
    assert kinds(1e-300 * x) == [("a0", "dead")]  # the squares vanish: there is nothing to divide the mean by


def test_stuck_offset_and_quantised():
    x = RNG.standard_normal(N)
    stuck = x.copy()
    stuck[5000:5200] = stuck[5000]
    assert kinds(stuck) == [("a0", "stuck")]
    assert kinds(x + 10) == [("a0", "offset")]
    assert kinds(quantise(x * 0.2, 4)) == [("a0", "quantised")]
    assert kinds(quantise(x * 0.2, 10)) == []


@pytest.mark.parametrize("bits", [8, 10, 12, 16])
def test_smooth_turning_points_are_not_stuck(bits):
    chirp = np.linspace(0.2, 0.9, N) * np.sin(2 * np.pi * (1e-3 * T + 0.1 * T**2 / N))
    assert "stuck" not in [kind for _, kind in kinds(quantise(chirp, bits))]


def test_a_dropout_in_converter_steps_is_stuck():
    x = quantise(0.5 * np.sin(0.3 * T) + 0.1 * RNG.standard_normal(N), 12)
    x[700:760] = 0.0
    (problem,) = find_problems(Recording(x[np.newaxis], 1e4, (Channel("a", "acceleration"),)))
    assert problem.kind == "stuck"
    assert "sample 700" in problem.evidence
    assert problem.share == pytest.approx(60 / N)


def test_other_quantities_are_not_looked_at():
    assert kinds(np.zeros(N), (T % 100 < 50) * 5.0, quantity="tachometer") == []


def test_short_recordings():
    assert kinds(np.array([1.0, 2.0])) == []
    assert kinds(np.array([1.0])) == [("a0", "dead")]


@pytest.mark.parametrize("share", [0.02, 0.05, 0.2])
@pytest.mark.parametrize("step", [None, 1e-3])
def test_a_limit_that_a_fast_signal_meets_in_single_samples_is_found(share, step):
    """Its sign alternates from sample to sample, so that hardly two in a row are cut."""
    x = np.random.default_rng(5).standard_normal(40_000)
    x -= 0.9 * np.roll(x, 1)
    x = x if step is None else np.round(x / step) * step
    limit = np.quantile(np.abs(x), 1.0 - share)
    assert kinds(np.clip(x, -limit, limit)) == [("a0", "clipped")]
    assert not kinds(x)


def test_a_tone_has_no_direction_of_time():
    assert not kinds(np.sin(2 * np.pi * np.arange(64_000) / 8.0 + 0.3))
