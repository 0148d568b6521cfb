"""The gap's population: where its rows come from, its machines' tolerances, signatures by hand."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from errno import ENOSPC
from typing import IO

import numpy as np
import pytest

from app.studies.drawn_rigs import DrawnRig, simulate_rig
from app.studies.gap import gearboxes as independent
from app.studies.gap.by_hand import FOREIGN, SIGNATURES, scene_of, with_foreign_vibration, with_signature
from app.studies.gap.gearboxes import Ordinary, PopulationSample, draw_machine, write
from app.studies.gap.population import pack
from gearsig.errors import InputError
from gearsig.gap import (
    BY_HAND,
    INDEPENDENT,
    LEARNED_FILE,
    NONE,
    UNKNOWN,
    ReducedRecording,
    change_features,
    feature_values,
    load_learned,
    load_population,
    read_learned,
    reduce_recording,
    soft_size,
)
from sims.blind import CATALOGUE
from sims.effects import EffectSetting
from tests.gap.synthetic import RATE_HZ, RIG, SPEED_HZ, TEETH, record
from tests.marks import further

FLOOR = load_learned().floor(with_reference=True)


def size(sample: PopulationSample) -> float:
    return soft_size(FLOOR.names, FLOOR.from_centre(FLOOR.names, sample.change.values) / FLOOR.of(FLOOR.names))


@pytest.fixture(scope="module")
def outer_race() -> list[PopulationSample]:
    return independent.one_case(list(CATALOGUE).index("bearing_outer_race"))


@pytest.mark.study
def test_a_case_of_the_independent_rig_gives_its_effect_and_the_same_machine_without_it(
    outer_race: list[PopulationSample],
) -> None:
    n_conditions = len({sample.rig for sample in outer_race})
    kinds = Counter(BY_HAND if sample.detail == BY_HAND else sample.label for sample in outer_race)
    assert kinds == {
        NONE: n_conditions,
        "bearing_outer_race": n_conditions,
        UNKNOWN: n_conditions,
        BY_HAND: independent.N_BY_HAND * n_conditions,
    }
    assert {sample.simulator for sample in outer_race} == {INDEPENDENT}
    own, healthy = (next(s for s in outer_race if s.label == label) for label in ("bearing_outer_race", NONE))
    assert size(own) > 2.0 * size(healthy)


@pytest.mark.slow
def test_the_table_is_read_as_it_was_written(outer_race: list[PopulationSample], tmp_path) -> None:
    write(tmp_path / "raw.npz", outer_race)
    with np.load(tmp_path / "raw.npz", allow_pickle=False) as raw:
        assert raw["label"].tolist() == [s.label for s in outer_race]
        assert tuple(raw["change_names"]) == outer_race[0].change.names
        np.testing.assert_allclose(raw["change"][1], outer_race[1].change.values, rtol=1e-6)


def drawn_machine() -> DrawnRig:
    """A light pair that the finite-element model takes."""
    return next(
        drawn
        for drawn in (draw_machine(np.random.default_rng([8, i])) for i in range(100))
        if max(drawn.teeth) < 40 and drawn.parameters["rotor_inertia_input_kg_m2"] < 2e-3
    )


@pytest.mark.parametrize("model", ["cracked", further("reduced-fe")])
def test_both_models_record_a_drawn_machine(model: str) -> None:
    drawn = drawn_machine()
    drawn = replace(drawn, duration_s=0.5 * drawn.duration_s)
    recording = simulate_rig(drawn, severity=0.0, run=1, model=model)
    assert recording.rig is not None
    reduced = reduce_recording(recording, recording.rig)
    assert reduced.frame.teeth == drawn.teeth
    assert np.isfinite(recording.samples).all()
    assert 60.0 * reduced.speed_hz == pytest.approx(drawn.speed_rpm, rel=0.01)


def test_drawn_machines_lie_every_way_and_most_stand_on_mounts() -> None:
    drawn = [draw_machine(np.random.default_rng([8, i])) for i in range(200)]
    angles = [float(one.parameters["line_of_action_deg"]) for one in drawn]
    assert np.histogram(angles, 4, (-180.0, 180.0))[0].min() > 30
    assert all(mode.direction_deg is not None for one in drawn for mode in one.modes)
    on_mounts = [sum(mode.frequency_hz <= 40.0 for mode in one.modes) for one in drawn]
    assert set(on_mounts) == {0, 2}  # heave and pitch
    assert 130 < np.count_nonzero(on_mounts) < 170


@pytest.mark.slow
def test_an_unbalance_is_heard_where_the_housing_yields() -> None:
    """A body of mass M takes a force F at a = F/M; on rigid ground a bearing's spring hardly moves."""
    drawn = next(d for d in (draw_machine(np.random.default_rng([8, i])) for i in range(50)) if d.speed_rpm > 1500.0)
    rigid = tuple(mode for mode in drawn.modes if mode.frequency_hz > 40.0)
    mount = next(
        m
        for d in (draw_machine(np.random.default_rng([8, i])) for i in range(50))
        for m in d.modes
        if m.frequency_hz < 15.0
    )
    unbalance = EffectSetting("unbalance", 500.0, {"gear": "driver"})
    heard = []
    for modes in (rigid, (*rigid, replace(mount, direction_deg=90.0))):
        recording = simulate_rig(replace(drawn, modes=modes), severity=0.0, run=0, further=[unbalance])
        first = recording.samples[0]
        time = np.arange(len(first)) / recording.sampling_rate_hz
        heard.append(abs(np.mean(first * np.exp(-2j * np.pi * drawn.speed_rpm / 60.0 * time))))
    assert heard[1] > 5.0 * heard[0]


def test_a_damaged_population_is_named(tmp_path) -> None:
    (tmp_path / "population.npz").write_bytes(LEARNED_FILE.read_bytes()[:10_000])
    assert read_learned(tmp_path / "population.npz") is None
    with pytest.raises(InputError, match=r"population\.npz: the population is missing or damaged"):
        load_population(tmp_path / "population.npz")


def test_a_full_disk_leaves_the_library_as_it_was(tmp_path, monkeypatch) -> None:
    raw, to = tmp_path / "raw.npz", tmp_path / "library" / "population.npz"
    table = np.zeros((2, 3), np.float32)
    names = ("change", "change_scatter", "features", "feature_scatter", "simulated", "simulated_scatter")
    texts = np.array(["a", "b"])
    of_rows = {"rig": np.arange(2), "load_n_per_mm": np.ones(2)} | dict.fromkeys(
        ("simulator", "label", "detail"), texts
    )
    np.savez(raw, **dict.fromkeys(names, table), **of_rows, change_names=texts, feature_names=texts)
    pack([raw], to)
    whole = to.read_bytes()

    def fill(file: IO[bytes], **_: object) -> None:
        file.write(b"half")
        raise OSError(ENOSPC, "No space left on device")

    monkeypatch.setattr(np, "savez_compressed", fill)
    with pytest.raises(InputError, match="No space left"):
        pack([raw], to)
    assert (to.read_bytes(), list(to.parent.iterdir())) == (whole, [to])


# Tolerances of the population's machines: the same on every day, at the driven gear's own place, and no more.

HEALTHY = record()


def test_a_day_repeats_the_machine_and_not_the_noise() -> None:
    ordinary = Ordinary.of(HEALTHY, 3)
    first, again = (ordinary.on(HEALTHY, 0, np.random.default_rng(5)) for _ in range(2))
    other = ordinary.on(HEALTHY, 0, np.random.default_rng(6))
    np.testing.assert_array_equal(first.samples, again.samples)
    assert 0.0 < np.std(first.samples - other.samples) < 0.2 * np.std(first.samples)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_machines_get_sidebands_and_shaft_lines_that_last(seed: int) -> None:
    ordinary = Ordinary.of(HEALTHY, seed)
    days = [reduce_recording(ordinary.on(record(seed=day), 0, np.random.default_rng(day)), RIG) for day in (1, 2)]
    names, before = feature_values(reduce_recording(HEALTHY, RIG))
    _, after = feature_values(days[0])
    raised = dict(zip(names, after - before, strict=True))
    assert max(raised[f"shaft.{side}.{n}.to_mesh"] for side in ("driver", "driven") for n in (1, 2, 3)) > 6.0
    between = change_features(days[1], days[0])
    change = dict(zip(between.names, between.values, strict=True))
    assert abs(change["sideband.driver.1"]) < 1.0
    assert max(change["change.driver.agreement"], change["change.driven.agreement"]) > 7.0


def test_a_later_beginning_keeps_the_driven_gears_place() -> None:
    """After as many turns as the driven gear has teeth all is as before; after one it is not."""
    ordinary = Ordinary.of(HEALTHY, 1)
    rows = [ordinary.on(HEALTHY, turns, np.random.default_rng(0)).samples for turns in (0, 1, TEETH[1])]
    assert np.abs(rows[2] - rows[0]).max() < 1e-6 * np.abs(rows[0]).max()
    assert np.abs(rows[1] - rows[0]).max() > 1e-3 * np.abs(rows[0]).max()


def test_pulses_move_by_less_than_a_hundredth_of_a_turn() -> None:
    time = np.arange(round(RATE_HZ * 2.0)) / RATE_HZ
    pulses = (np.mod(SPEED_HZ * time, 1.0) < 0.1).astype(np.float64)
    channel = replace(HEALTHY.channels[0], name="tacho", quantity="tachometer", unit="V")
    n = len(time)
    with_mark = replace(
        HEALTHY,
        samples=np.vstack([HEALTHY.samples[:, :n], pulses]),
        channels=(*HEALTHY.channels, channel),
        speed=replace(HEALTHY.speed, times_s=HEALTHY.speed.times_s[HEALTHY.speed.times_s < 2.0]),
    )
    found = Ordinary.of(with_mark, 2).on(with_mark, 0, np.random.default_rng(1)).samples[-1]
    before, after = (np.flatnonzero(np.diff(row) > 0.5) for row in (pulses, np.round(found)))
    assert len(before) == len(after)
    assert np.abs(after - before).max() <= 0.01 * RATE_HZ / SPEED_HZ


# Signatures by hand: each moves what the literature says it moves, and nothing but the vibration.

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
        since = change_features(reduce_recording(now, RIG), reference)
        change = dict(zip(since.names, since.values, strict=True))
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
