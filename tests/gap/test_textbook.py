"""The textbook's rules."""

from __future__ import annotations

import pytest

from gearsig.gap import NONE, load_learned, textbook_rules, textbook_strengths
from sims.effects import as_gap_effect, effects

RULES = textbook_rules(map(as_gap_effect, effects().values()))


def test_every_effect_has_a_rule_of_features_that_there_are() -> None:
    assert {cause for cause, _ in RULES} >= set(effects())
    names = load_learned().feature_names
    for _, signs in RULES:
        for name, _ in signs:
            assert name.format(side="driven") in names


@pytest.mark.parametrize("side", ["driver", "driven"])
def test_either_shaft_speaks_for_its_effect(side: str) -> None:
    said = textbook_strengths(
        RULES, {f"shaft.{side}.2": 4.0, f"sideband.{side}.2": 6.0} | dict.fromkeys(_others(side), 0.0)
    )
    assert said["misalignment"] == pytest.approx(5.0)
    assert max(said, key=said.__getitem__) == "misalignment"
    assert NONE not in said


def _others(side: str) -> list[str]:
    """All features of the table but those of a misaligned shaft."""
    known = {name.format(side=s) for _, signs in RULES for name, _ in signs for s in ("driver", "driven")}
    return sorted(known - {f"shaft.{side}.2", f"sideband.{side}.2"})


def test_one_sign_alone_does_not_carry_a_rule() -> None:
    names = {name.format(side=s) for _, signs in RULES for name, _ in signs for s in ("driver", "driven")}
    said = textbook_strengths(RULES, dict.fromkeys(names, 0.0) | {"mesh.total": 50.0})
    assert said["tooth_wear"] == pytest.approx(8.0 / 3.0)
