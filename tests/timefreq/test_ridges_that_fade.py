"""Ridges stay with their component where it fades or noise covers it, instead of leaping to what is clearer there."""

from pathlib import Path

import numpy as np
import pytest

from gearsig.angle import find_shaft_angle
from gearsig.recording import read_recording
from gearsig.rig import read_rig
from gearsig.timefreq import (
    Morse,
    TimeFrequencyMap,
    UniformSignal,
    cwt_map,
    ridges,
    squeezed_cwt_map,
    tops_of_parted_paths,
)
from tests.marks import further

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
    upper, lower = tops_of_parted_paths(np.ones((18, 3)), beyond, 0)
    assert np.all((lower >= 0) & (lower <= upper) & (upper <= 17))
