"""Block by block, modes join without gap and say where they do not go on."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.decompose import VmdSettings, modes_by_block, vmd
from gearsig.errors import InputError

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
