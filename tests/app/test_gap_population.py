"""Where the rows of the gap diagnosis's population come from."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from errno import ENOSPC
from typing import IO

import numpy as np
import pytest

from app.studies.drawn_rigs import DrawnRig, simulate_rig
from app.studies.gap import gearboxes as independent
from app.studies.gap.gearboxes import PopulationSample, draw_machine, write
from app.studies.gap.population import pack
from gearsig.errors import InputError
from gearsig.gap import (
    BY_HAND,
    INDEPENDENT,
    LEARNED_FILE,
    NONE,
    UNKNOWN,
    load_learned,
    load_population,
    read_learned,
    reduce_recording,
    soft_size,
)
from sims.blind import CATALOGUE
from sims.effects import EffectSetting
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
