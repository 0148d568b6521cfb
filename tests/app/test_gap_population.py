"""Where the rows of the gap diagnosis's population come from."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from app.calibration.gap import independent
from app.calibration.gap.machines import draw_machine
from app.calibration.gap.sample import Sample, write
from app.calibration.rigs import DrawnRig
from app.calibration.simulate import simulate_rig
from gearsig.gap.floors import soft_size
from gearsig.gap.gather import gather
from gearsig.gap.population import BY_HAND, INDEPENDENT, load_population
from gearsig.gap.types import NONE, UNKNOWN
from sims.blind import CATALOGUE

FLOOR = load_population().floor(with_reference=True)


def size(sample: Sample) -> float:
    return soft_size(FLOOR.names, FLOOR.from_centre(FLOOR.names, sample.change) / FLOOR.of(FLOOR.names))


@pytest.fixture(scope="module")
def outer_race() -> list[Sample]:
    return independent.one_case(list(CATALOGUE).index("bearing_outer_race"))


def test_a_case_of_the_independent_rig_gives_its_effect_and_the_same_machine_without_it(
    outer_race: list[Sample],
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
    own, sound = (next(s for s in outer_race if s.label == label) for label in ("bearing_outer_race", NONE))
    assert size(own) > 2.0 * size(sound)


def test_the_table_is_read_as_it_was_written(outer_race: list[Sample], tmp_path) -> None:
    write(tmp_path / "raw.npz", outer_race)
    with np.load(tmp_path / "raw.npz", allow_pickle=False) as raw:
        assert raw["label"].tolist() == [s.label for s in outer_race]
        assert tuple(raw["change_names"]) == outer_race[0].names[0]
        np.testing.assert_allclose(raw["change"][1], outer_race[1].change, rtol=1e-6)


def drawn_machine() -> DrawnRig:
    """A light pair that the finite-element model takes."""
    return next(
        drawn
        for drawn in (draw_machine(np.random.default_rng([8, i])) for i in range(100))
        if max(drawn.teeth) < 40 and drawn.parameters["rotor_inertia_input_kg_m2"] < 2e-3
    )


def test_both_models_record_a_drawn_machine() -> None:
    drawn = drawn_machine()
    speeds = []
    for model in ("cracked", "reduced-fe"):
        recording = simulate_rig(drawn, severity=0.0, run=1, model=model)
        assert recording.rig is not None
        found = gather(recording, recording.rig)
        assert found.frame.teeth == drawn.teeth
        assert np.isfinite(recording.samples).all()
        speeds.append(60.0 * found.speed_hz)
    assert speeds == pytest.approx([drawn.speed_rpm] * 2, rel=0.01)
