"""Signatures by hand: each moves what the literature says it moves, and nothing but the vibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.studies.gap.by_hand import FOREIGN, SIGNATURES, scene_of, with_foreign_vibration, with_signature
from gearsig.gap import ReducedRecording, change_once, reduce_recording
from tests.gap.synthetic import RIG, record

HEALTHY = record()
STRONG = [seed for seed in range(6) if np.random.default_rng(seed).uniform() > 0.6]
EXPECTED = {
    "unbalance": ("shaft.driver.1", "shaft.driven.1"),
    "misalignment": ("shaft.driver.2", "shaft.driven.2"),
    "eccentricity": ("sideband.driver.1", "sideband.driven.1"),
    "pitch_error": ("tooth.driver.level", "tooth.driven.level"),
    "chipped_tooth": ("surprise.driver.peak", "surprise.driven.peak"),
    "root_crack": ("surprise.driver.peak", "surprise.driven.peak"),
    "tooth_wear": ("mesh.total",),
    "sliding_friction": ("mesh.total",),
    "bearing_clearance": ("shaft.driver.low", "shaft.driven.low"),
    "bearing_outer_race": ("envelope.outer",),
    "bearing_inner_race": ("envelope.inner",),
    "surface_roughness": ("floor.total", "tooth.driver.level", "tooth.driven.level"),
    "clipping": ("raw.near_the_extreme",),
}


@pytest.fixture(scope="module")
def reference() -> ReducedRecording:
    return reduce_recording(record(seed=1), RIG)


@pytest.mark.parametrize("name", SIGNATURES)
def test_only_the_vibration_changes_and_a_seed_repeats_it(name: str) -> None:
    first, again = (with_signature(HEALTHY, name, np.random.default_rng(5)) for _ in range(2))
    np.testing.assert_array_equal(first[0].samples, again[0].samples)
    assert first[1] == again[1]
    for row, before, channel in zip(first[0].samples, HEALTHY.samples, HEALTHY.channels, strict=True):
        assert np.isfinite(row).all()
        assert np.array_equal(row, before) is not channel.is_vibration


@pytest.mark.slow
@pytest.mark.parametrize("n_channels", [1, 3])
def test_a_machine_may_have_any_number_of_sensors(n_channels: int) -> None:
    kept = [i for i, channel in enumerate(HEALTHY.channels) if not channel.is_vibration]
    heard = next(i for i, channel in enumerate(HEALTHY.channels) if channel.is_vibration)
    rows = [*([heard] * n_channels), *kept]
    channels = [replace(HEALTHY.channels[row], name=f"c{i}") for i, row in enumerate(rows)]
    channels[n_channels:] = [HEALTHY.channels[row] for row in kept]
    recording = replace(HEALTHY, samples=HEALTHY.samples[rows], channels=tuple(channels))
    for name in SIGNATURES:
        now, _ = with_signature(recording, name, np.random.default_rng(5))
        assert np.isfinite(now.samples).all()


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPECTED)
def test_strong_ones_move_their_own_features(name: str, reference: ReducedRecording) -> None:
    changes = []
    for seed in STRONG:
        now, strength = with_signature(HEALTHY, name, np.random.default_rng(seed))
        assert strength > 0.6
        change = dict(zip(*change_once(reduce_recording(now, RIG), reference), strict=True))
        changes.append(max(change[feature] for feature in EXPECTED[name]))
    assert np.median(changes) > 3.0


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_vibration_lasts_as_long_as_the_recording(name: str) -> None:
    scene = scene_of(HEALTHY)
    for seed in range(3):
        vibration = FOREIGN[name](scene, np.random.default_rng(seed))
        assert vibration.shape == scene.time_s.shape
        assert np.isfinite(vibration).all()
        assert vibration.std() > 0.0


def test_a_neighbours_gear_is_at_no_order_of_this_one() -> None:
    """Its clock is its own: at another speed of the machine it has the same frequencies, and so other orders."""
    scene = scene_of(HEALTHY)
    faster = replace(scene, revolutions=1.37 * scene.revolutions)
    for name in ("gear of another machine", "belt", "motor field"):
        one, other = (FOREIGN[name](s, np.random.default_rng(4)) for s in (scene, faster))
        np.testing.assert_array_equal(one, other)


def test_foreign_vibration_has_a_name_and_is_no_effect() -> None:
    now, name = with_foreign_vibration(HEALTHY, np.random.default_rng(2))
    assert name.replace(" ", "_") not in SIGNATURES
    assert not np.array_equal(now.samples, HEALTHY.samples)
