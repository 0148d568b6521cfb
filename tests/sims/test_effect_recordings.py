"""Whole recordings with each effect: settled from the first sample on, inside the range, told by their truth."""

from functools import cache
from typing import Any

import numpy as np
import pytest

from gearsig.recording import Recording
from sims import simulate
from sims.effects import effects
from sims.presets import presets
from tests.marks import further

USUAL = "workshop_29_47"
OTHERS = [preset for preset in presets("cracked") if preset != USUAL]
BEARINGS = [name for name, e in effects().items() if e.group == "bearing"]
# Of each group one effect, and each machine once, say most; all of them, on demand, take minutes.
OF_EACH_GROUP = {e.group: name for name, e in effects().items()}.values()
QUICK = {*((USUAL, name) for name in OF_EACH_GROUP), *((preset, BEARINGS[0]) for preset in OTHERS)}
CASES = [(USUAL, name) for name in effects()] + [(preset, name) for preset in OTHERS for name in BEARINGS]


def study_but(cases: list[tuple[str, str]]) -> list[Any]:
    return [case if case in QUICK else further(*case) for case in cases]


@cache
def recorded(preset: str, effect: str) -> Recording:
    return simulate(
        "cracked", preset=preset, effects={effect: effects()[effect].severity.typical}, duration_s=0.8, seed=3
    )


@pytest.mark.parametrize(("preset", "effect"), study_but(CASES))
def test_a_recording_begins_settled(preset: str, effect: str) -> None:
    """Filters, governor and bearings have forgotten the start: the first tenth is like the last."""
    recording = recorded(preset, effect)
    for row in range(2):
        values = recording.samples[row]
        tenth = len(values) // 10
        first, last = values[:tenth], values[-tenth:]
        assert abs(first.mean() - last.mean()) < 0.02 * values.std()
        # Rates of revolution and hunting make tenths differ; a decaying offset would make them differ by more.
        assert 0.6 < first.std() / last.std() < 1.67


@pytest.mark.parametrize(
    ("preset", "effect"),
    study_but([(p, e) for p in (USUAL, *OTHERS) for e in ("root_crack", *BEARINGS, "eccentricity")]),
)
def test_a_typical_fault_stays_inside_the_range(preset: str, effect: str) -> None:
    recording = recorded(preset, effect)
    limit = np.abs(recording.samples[:2]).max()
    assert np.mean(np.abs(recording.samples[:2]) >= 0.999 * limit) < 1e-3


def test_the_truth_tells_what_was_put_in() -> None:
    recording = recorded(USUAL, "root_crack")
    assert recording.truth is not None
    (told,) = recording.truth["effects"]
    assert (told["name"], told["severity"], told["unit"]) == ("root_crack", 2.0, "mm")
    assert recording.truth["machine"]["mesh"]["cracks_1"][0]["depth_mm"] == 2.0
