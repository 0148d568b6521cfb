"""What changes about the mesh harmonics: a path takes all along, a worn flank does not, noise comes alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.gap import (
    alike_features,
    change_features,
    change_once,
    feature_words,
    gear_frame,
    reduce_recording,
    segment_changes,
    soft_size,
)
from gearsig.recording import Recording
from tests.gap.synthetic import RATE_HZ, RIG, SPEED_HZ, TEETH, record

MESH_HZ = TEETH[0] * SPEED_HZ


def repeated(time: FloatArray, revolutions: FloatArray) -> FloatArray:
    """What the driver repeats about its first three mesh harmonics."""
    return sum((0.05 * np.cos(2 * np.pi * n * revolutions + n) for n in range(15, 80, 4)), np.zeros(len(time)))


HEALTHY = record(repeated)


def found(now: Recording) -> dict[str, float]:
    changes = dict(alike_features(reduce_recording(now, RIG), reduce_recording(HEALTHY, RIG)))
    return {name.removeprefix("alike."): value for name, value in changes.items()}


def test_a_path_changes_all_three_alike_about_each_harmonic() -> None:
    lines = np.fft.rfft(record(repeated, seed=1).samples)
    mesh_orders = np.fft.rfftfreq(HEALTHY.samples.shape[1], 1.0 / RATE_HZ) / MESH_HZ
    gains_db = np.interp(mesh_orders, [1.49, 1.51, 2.49, 2.51], [8.0, 0.0, 0.0, -6.0])
    now = replace(HEALTHY, samples=np.fft.irfft(lines * 10.0 ** (gains_db / 20.0), HEALTHY.samples.shape[1]))
    changes = segment_changes(reduce_recording(now, RIG), reduce_recording(HEALTHY, RIG))
    for k, gain_db in enumerate((8.0, 0.0, -6.0)):
        assert changes[:, k] == pytest.approx(np.full((2, 3), gain_db), abs=1.5)
    assert np.isnan(changes[:, 3:5, 0]).all()  # there is no fourth and fifth harmonic
    change = found(now)
    assert change["mesh_repeated.together"] > 9.5
    assert change["mesh_repeated.apart"] < 0.3


def test_a_harmonic_that_grows_alone_is_apart_from_what_surrounds_it() -> None:
    def grown(time: FloatArray, revolutions: FloatArray) -> FloatArray:
        return repeated(time, revolutions) + 4.0 * np.cos(2 * np.pi * 2 * TEETH[0] * revolutions + 1.0)

    change = found(record(grown, seed=1))
    assert change["mesh.spread"] > 3.0
    assert change["mesh_repeated.apart"] > 4.0
    assert abs(change["mesh_repeated.together"]) < 2.0
    assert abs(change["repeated"]) < 0.5


def test_noise_alone_changes_noise_alone() -> None:
    now = record(repeated, seed=1)
    louder = now.samples + 0.3 * np.random.default_rng(2).standard_normal(now.samples.shape)
    change = found(replace(now, samples=louder))
    assert change["noise"] == pytest.approx(10.0, abs=0.7)  # 0.1 becomes √(0.1² + 0.3²)
    assert abs(change["mesh"]) < 0.2
    assert change["mesh_noise.less"] == pytest.approx(-10.0, abs=0.8)


@pytest.mark.slow
def test_it_is_a_feature_of_a_change_with_a_name_in_words_and_no_part_of_its_size() -> None:
    now, healthy = reduce_recording(record(repeated, seed=1), RIG), reduce_recording(HEALTHY, RIG)
    names = change_features(now, healthy).names
    assert change_once(now, healthy)[0] == names
    own = [i for i, name in enumerate(names) if name.startswith("alike.")]
    values = np.zeros(len(names))
    values[own] = 99.0
    assert soft_size(names, values) == 0.0
    words = {feature_words(names[i], gear_frame(RIG)) for i in own}
    assert len(words) == len(own)
