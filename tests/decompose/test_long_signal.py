"""A long signal's modes as one answer."""

from __future__ import annotations

import numpy as np
import pytest

from gearsig.decompose import VmdSettings, vmd
from gearsig.timefreq import UniformSignal

SAMPLES = np.arange(20_000)
TONES = np.stack([np.cos(0.2 * SAMPLES), 0.5 * np.cos(1.3 * SAMPLES + 0.4)])


def test_a_short_signal_is_taken_whole():
    x = TONES.sum(axis=0)[:3000]
    found, whole = vmd(x, 1.0, VmdSettings(2)), vmd(x, 1.0, VmdSettings(2))
    np.testing.assert_array_equal(found.waveforms, whole.waveforms)
    assert found.n_iterations == whole.n_iterations


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
    assert "does not go on over the seam at" in note
