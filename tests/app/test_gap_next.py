"""What to record next: other points and sensors, by how far two effects lie apart there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import gearsig.gap._next_recording as room
from gearsig.gap import (
    Added,
    Condition,
    HasFurtherPlaces,
    OperatingCondition,
    Reduced,
    StructuralFloor,
    Task,
    TriedEffect,
    Twin,
)

HERE = OperatingCondition(1500.0, 60.0)
NAMES = ("mesh.total", "raw.level")
CRACK, SPALL = (
    cast("TriedEffect", SimpleNamespace(name=name, fit=SimpleNamespace(added=Added(name, 1.0))))
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


@pytest.fixture
def simulated(monkeypatch: pytest.MonkeyPatch) -> Callable[..., list[Task]]:
    """Let the spall change nothing and the crack so many dB of the mesh, by speed and torque factor and channel."""

    def answer_with(own_db: Mapping[tuple[float, float], float], further_db: float = 0.0) -> list[Task]:
        asked: list[Task] = []

        def rows(tasks: Sequence[Task], *_: object, **__: object) -> list[Reduced | str]:
            asked.extend(tasks)
            return [row(task) for task in tasks]

        def row(task: Task) -> Reduced | str:
            key = (round(task.run.point.speed_rpm / 1500.0, 3), round(task.run.point.torque_nm / 60.0, 3))
            if key not in own_db:
                return "it cannot be simulated"
            is_crack = task.added == CRACK.fit.added
            own = np.array([own_db[key] * is_crack, 0.0])
            alone = {"a": own, "b": np.array([further_db * is_crack, 0.0])} if task.further else {}
            return Reduced((), np.empty(0), NAMES, own, np.empty(0, dtype=complex), alone)

        monkeypatch.setattr(room, "finished_runs", rows)
        return asked

    return cast("Callable[..., list[Task]]", answer_with)


def found(twin: Any = None, conditions: Sequence[Condition] = ()) -> list[tuple[OperatingCondition, str, float, float]]:
    answer = room.next_recordings(CRACK, SPALL, TITLES, cast("Twin", twin), conditions or [condition()])
    return [(one.point, one.place, one.standard_deviations, one.now) for one in answer]


def test_the_best_point_is_first_and_points_hardly_better_are_left_out(simulated: Callable[..., list[Task]]) -> None:
    simulated({(1.0, 1.0): 2.0, (1.0, 0.3): 9.0, (1.0, 0.6): 2.2, (1.4, 1.0): 4.0})
    assert found() == [
        (OperatingCondition(1500.0, 18.0), "", 9.0, 2.0),
        (OperatingCondition(2100.0, 60.0), "", 4.0, 2.0),
    ]


def test_distances_are_held_against_the_same_simulation_at_the_points_there_are(
    simulated: Callable[..., list[Task]],
) -> None:
    asked = simulated({(1.0, 1.0): 2.0, (1.0, 0.3): 9.0, (2.0, 1.0): 8.5})
    assert found(conditions=[condition(), condition(OperatingCondition(3000.0, 60.0))]) == []
    assert OperatingCondition(3000.0, 60.0) in {task.run.point for task in asked}
    simulated({(1.0, 0.3): 9.0})
    assert found() == []  # nothing to compare with


def test_a_further_sensor_is_named_only_if_it_shows_more_than_those_there_are(
    simulated: Callable[..., list[Task]],
) -> None:
    assert isinstance(Placed(), HasFurtherPlaces)
    simulated({(1.0, 1.0): 2.0}, further_db=3.0)
    assert found(Placed()) == [(HERE, "the far end", 3.0, 2.0)]
    (one,) = room.next_recordings(CRACK, SPALL, TITLES, cast("Twin", Placed()), [condition()])
    assert one.text == (
        "at the same speed and load, add a further sensor at the far end: there a crack and a spall lie 3 structural "
        "floors apart, 2 so far."
    )
    simulated({(1.0, 1.0): 2.0}, further_db=2.2)
    assert found(Placed()) == []
