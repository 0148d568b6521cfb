"""What to do and to record next: by what is confused, and by how far two effects lie apart elsewhere."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from gearsig.gap import (
    AddedEffect,
    Condition,
    GapCause,
    GapOutcome,
    HasFurtherPlaces,
    NextRecording,
    OperatingCondition,
    Reduced,
    StructuralFloor,
    Task,
    TriedEffect,
    Twin,
    next_recordings,
    next_steps,
)

FAST = [OperatingCondition(1500.0, 60.0)]
TWO_SPEEDS = [OperatingCondition(700.0, 60.0), *FAST]
SLOW = [OperatingCondition(200.0, 60.0), OperatingCondition(200.0, 20.0)]


def codes(
    *names: str,
    outcome=GapOutcome.CANNOT_SEPARATE,
    points=FAST,
    reference=True,
    encoders=False,
    labelled=True,
    run_up=True,
):
    causes = [GapCause(name, "", name, "", 0.9 / len(names)) for name in names]
    found = next_steps(
        outcome,
        causes,
        points,
        has_reference=reference,
        has_encoders=encoders,
        is_labelled=labelled,
        has_run_up=run_up,
    )
    return [step.code for step in found]


def test_a_healthy_reference_comes_first_and_nothing_is_needed_without_a_gap() -> None:
    assert codes("root_crack", "tooth_spall", reference=False)[0] == "healthy"
    assert codes("none", outcome=GapOutcome.NO_GAP, reference=False) == []


def test_damaged_teeth_ask_for_encoders_and_two_slow_loads() -> None:
    assert codes("root_crack", "tooth_spall") == ["encoders", "slow_loads"]
    assert codes("root_crack", "pitch_error", encoders=True) == ["slow_loads"]
    assert codes("root_crack", "tooth_spall", points=SLOW) == ["encoders"]
    assert codes("root_crack", "unbalance", run_up=False) == []
    assert codes("root_crack", "tooth_spall", encoders=True, points=SLOW, run_up=False) == ["run_up"]
    assert "run_up" not in codes("root_crack", "tooth_spall", reference=False, run_up=False)  # nothing would pass it


@pytest.mark.parametrize("both", [("unbalance", "eccentricity"), ("transfer_path", "tooth_wear")])
def test_paths_and_shafts_ask_for_another_speed_where_the_speed_was_not_varied(both: tuple[str, str]) -> None:
    assert codes(*both) == ["other_speed"]
    assert codes(*both, points=TWO_SPEEDS) == []


def test_what_may_be_cut_off_asks_for_less_gain() -> None:
    assert codes("clipping", "misalignment") == ["less_gain"]
    assert codes("clipping") == codes("misalignment") == []


def test_labels_are_asked_for_where_it_is_not_settled() -> None:
    assert codes("root_crack", labelled=False) == ["label"]
    assert codes("root_crack", labelled=False, outcome=GapOutcome.EFFECT) == []
    assert codes("unknown", labelled=False, outcome=GapOutcome.UNKNOWN) == []  # there is no likely cause to label


# --------------------
# What to record next: other points and sensors, by how far two effects lie apart there.
# --------------------


HERE = OperatingCondition(1500.0, 60.0)
NAMES = ("mesh.total", "raw.level")
CRACK, SPALL = (
    cast("TriedEffect", SimpleNamespace(name=name, fit=SimpleNamespace(added=AddedEffect(name, 1.0))))
    for name in ("root_crack", "tooth_spall")
)
TITLES = ("a crack", "a spall")


@dataclass(frozen=True)
class Placed:
    """A twin with one further place; it never runs."""

    def with_further_sensors(self) -> tuple[Twin, Mapping[str, str]]:
        return cast("Twin", self), {"b": "the far end"}


def condition(point: OperatingCondition = HERE) -> Condition:
    floor = StructuralFloor(NAMES, np.array([1.0, 2.0]))
    facts = SimpleNamespace(point=point, sampling_rate_hz=2e4)
    return cast(
        "Condition", SimpleNamespace(facts=facts, trial_s=5.0, floor=floor, change=SimpleNamespace(names=NAMES))
    )


class Simulated:
    """Stands for the simulator: the spall changes nothing, the crack so many dB, by speed and torque factor."""

    def __init__(self, own_db: Mapping[tuple[float, float], float], further_db: float = 0.0) -> None:
        self.own_db, self.further_db = own_db, further_db
        self.tasks: list[Task] = []

    def __call__(self, tasks: Sequence[Task], *_: object, **__: object) -> list[Reduced | str]:
        self.tasks.extend(tasks)
        return [self.row(task) for task in tasks]

    def row(self, task: Task) -> Reduced | str:
        key = (round(task.run.point.speed_rpm / 1500.0, 3), round(task.run.point.torque_nm / 60.0, 3))
        if key not in self.own_db:
            return "it cannot be simulated"
        is_crack = task.added == CRACK.fit.added
        own = np.array([self.own_db[key] * is_crack, 0.0])
        alone = {"a": own, "b": np.array([self.further_db * is_crack, 0.0])} if task.further else {}
        return Reduced((), np.empty(0), NAMES, own, np.empty(0, dtype=complex), alone)

    def recordings(self, twin: Any = None, conditions: Sequence[Condition] = ()) -> tuple[NextRecording, ...]:
        points = conditions or [condition()]
        return next_recordings(CRACK, SPALL, TITLES, cast("Twin", twin), points, simulate=self)

    def answer(
        self, twin: Any = None, conditions: Sequence[Condition] = ()
    ) -> list[tuple[OperatingCondition, str, float, float]]:
        recordings = self.recordings(twin, conditions)
        return [(each.point, each.place, each.standard_deviations, each.now) for each in recordings]


def test_the_best_point_is_first_and_points_hardly_better_are_left_out() -> None:
    simulated = Simulated({(1.0, 1.0): 2.0, (1.0, 0.3): 9.0, (1.0, 0.6): 2.2, (1.4, 1.0): 4.0})
    assert simulated.answer() == [
        (OperatingCondition(1500.0, 18.0), "", 9.0, 2.0),
        (OperatingCondition(2100.0, 60.0), "", 4.0, 2.0),
    ]


def test_distances_are_held_against_the_same_simulation_at_the_points_there_are() -> None:
    simulated = Simulated({(1.0, 1.0): 2.0, (1.0, 0.3): 9.0, (2.0, 1.0): 8.5})
    assert simulated.answer(conditions=[condition(), condition(OperatingCondition(3000.0, 60.0))]) == []
    assert OperatingCondition(3000.0, 60.0) in {task.run.point for task in simulated.tasks}
    assert Simulated({(1.0, 0.3): 9.0}).answer() == []  # nothing to compare with


def test_a_further_sensor_is_named_only_if_it_shows_more_than_those_there_are() -> None:
    assert isinstance(Placed(), HasFurtherPlaces)
    simulated = Simulated({(1.0, 1.0): 2.0}, further_db=3.0)
    assert simulated.answer(Placed()) == [(HERE, "the far end", 3.0, 2.0)]
    (one,) = simulated.recordings(Placed())
    assert one.text == (
        "at the same speed and load, add a further sensor at the far end: there a crack and a spall are 3 structural "
        "floors apart, 2 so far."
    )
    assert Simulated({(1.0, 1.0): 2.0}, further_db=2.2).answer(Placed()) == []
