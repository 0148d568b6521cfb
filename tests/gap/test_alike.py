"""What changes about the mesh harmonics, and on which channels: a path takes all along, a worn flank does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.gap import (
    change_features,
    feature_text,
    gear_frame,
    reduce_recording,
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
    changes = change_features(reduce_recording(now, RIG), reduce_recording(HEALTHY, RIG))
    return {name.removeprefix("alike."): value for name, value in zip(changes.names, changes.values, strict=True)}


def test_a_path_changes_all_three_alike_about_each_harmonic() -> None:
    lines = np.fft.rfft(record(repeated, seed=1).samples)
    mesh_orders = np.fft.rfftfreq(HEALTHY.samples.shape[1], 1.0 / RATE_HZ) / MESH_HZ
    gains_db = np.interp(mesh_orders, [1.49, 1.51, 2.49, 2.51], [8.0, 0.0, 0.0, -6.0])
    now = replace(HEALTHY, samples=np.fft.irfft(lines * 10.0 ** (gains_db / 20.0), HEALTHY.samples.shape[1]))
    change = found(now)
    spread_db = np.std([8.0, 0.0, -6.0])  # there is no fourth and fifth harmonic
    assert [change[f"{part}.spread"] for part in ("mesh", "repeated")] == pytest.approx([spread_db] * 2, abs=1.0)
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
    own = [i for i, name in enumerate(names) if name.startswith("alike.")]
    values = np.zeros(len(names))
    values[own] = 99.0
    assert soft_size(names, values) == 0.0
    words = {feature_text(names[i], gear_frame(RIG)) for i in own}
    assert len(words) == len(own)


# --------------------
# Whether channels changed alike: a gain of one does not look like a stronger excitation.
# --------------------


ALIKE = record()


def louder(first: float, second: float):
    gained = replace(ALIKE, samples=ALIKE.samples * [[first], [second]])
    return reduce_recording(gained, RIG)


@pytest.mark.parametrize(("gains", "apart_db"), [((2.0, 1.0), 3.01), ((2.0, 2.0), 0.0), ((1.0, 1.0), 0.0)])
def test_one_channel_louder_is_apart_by_half_of_it(gains: tuple[float, float], apart_db: float) -> None:
    change = change_features(louder(*gains), reduce_recording(ALIKE, RIG))
    apart = {n: v for n, v in zip(change.names, change.values, strict=True) if n.startswith("apart.")}
    assert apart == pytest.approx({"apart.mesh": apart_db, "apart.floor": apart_db}, abs=0.01)


def test_a_single_channel_has_nothing_to_differ_from() -> None:
    one = reduce_recording(ALIKE, RIG)
    one = one.with_channels({"a1": one.channels["a1"]})
    change = change_features(one, one)
    assert [v for n, v in zip(change.names, change.values, strict=True) if n.startswith("apart.")] == [0.0, 0.0]


@pytest.mark.slow
def test_it_is_a_feature_of_a_change_and_no_part_of_its_size() -> None:
    change = change_features(louder(2.0, 1.0), reduce_recording(ALIKE, RIG))
    own = [change.names.index(f"apart.{name}") for name in ("mesh", "floor")]
    values = change.values.copy()
    values[own] = 99.0
    assert soft_size(change.names, values) == soft_size(change.names, change.values)
