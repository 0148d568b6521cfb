"""Strange families in a recording of gears are named beside the catalogue's causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.diagnosis import Finding, Kind
from gearsig.gap import GapOutcome, UnexpectedFinding, place_of_unexpected, unexpected_findings, with_unexpected
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording
from gearsig.rig import Rig
from tests.gap.synthetic import RIG, record, ringing

STRANGE = 5.148
NO_BEARINGS = replace(RIG, bearings=())


def knocking(_time: FloatArray, revolutions: FloatArray) -> FloatArray:
    return np.asarray(3.0 * ringing(revolutions * STRANGE))


def seen(
    now: Recording, rig: Rig = RIG, *references: Recording
) -> tuple[list[UnexpectedFinding], list[str], list[str]]:
    prepared = [PreparedRecording(recording.with_rig(RIG)) for recording in references]
    return unexpected_findings(PreparedRecording(now.with_rig(rig).with_name("today")), prepared)


@pytest.mark.slow
def test_impacts_at_a_strange_order_are_named_and_a_reference_that_has_them_silences_them() -> None:
    struck, healthy = record(knocking), record(seed=1)
    standing, *_ = seen(struck, RIG, healthy)
    place = place_of_unexpected(standing[0], RIG)
    assert "order 5.148" in place.title
    assert "no gear, no shaft and no bearing explains (" in place.title
    assert "no shaft explains, the rig file naming no bearing" in place_of_unexpected(standing[0], NO_BEARINGS).title
    assert place.orders[0] == pytest.approx(STRANGE, rel=1e-3)
    again, *_ = seen(struck, RIG, record(knocking, seed=2))
    assert not again


@pytest.mark.slow
def test_a_race_that_strikes_in_the_reference_as_well_is_no_gap_but_a_doubt() -> None:
    outer = RIG.bearings[0].orders()["BPFO"]

    def rolling_over(_time: FloatArray, revolutions: FloatArray) -> FloatArray:
        return np.asarray(3.0 * ringing(revolutions * outer))

    standing, _, (doubt,) = seen(record(rolling_over), RIG, record(rolling_over, seed=1))
    assert not standing
    assert "does not look healthy" in doubt
    assert "exchanged" not in doubt


def test_healthy_gears_have_nothing_strange() -> None:
    assert seen(record()) == ([], [], [])


@pytest.mark.slow
def test_a_line_that_a_family_explains_is_no_remark() -> None:
    def struck_and_humming(order: float) -> list[str]:
        def vibration(time: FloatArray, revolutions: FloatArray) -> FloatArray:
            return knocking(time, revolutions) + 20.0 * np.sin(2 * np.pi * order * revolutions)

        return seen(record(vibration))[1]

    assert any("order 41.7" in remark for remark in struck_and_humming(41.7))
    assert not struck_and_humming(9 * STRANGE)


def test_orders_of_a_place_are_the_drivers_whatever_shaft_the_speed_is_of() -> None:
    """Shaft "out" is the reference: the family's order there is 37/23 of that of the driver."""
    turned = replace(RIG, shafts=RIG.shafts[::-1])
    assert turned.reference_shaft == "out"
    standing, *_ = seen(record(knocking), turned)
    assert standing[0].finding.where.order == pytest.approx(STRANGE * 37 / 23, rel=1e-3)
    assert place_of_unexpected(standing[0], turned).orders[0] == pytest.approx(STRANGE, rel=1e-3)
    hunting = replace(standing[0].finding, where=replace(standing[0].finding.where, frequency_hz=None))
    assert "(order 8.282), " in place_of_unexpected(replace(standing[0], finding=hunting), turned).title


def standing(code: str) -> UnexpectedFinding:
    return UnexpectedFinding(Finding(code, Kind.FAULT, "Damage of the outer race", confidence=0.9), "today.h5")


def test_impacts_of_a_known_race_are_not_called_unknown() -> None:
    race, strange = standing("bearing-outer-race"), standing("non-synchronous-impacts")
    outcome, warnings = with_unexpected(GapOutcome.NO_GAP, [race])
    assert outcome is GapOutcome.UNDECIDED
    assert "today.h5: Damage of the outer race (at most 90 %)" in warnings[0]
    assert with_unexpected(GapOutcome.NO_GAP, [race, strange]) == (GapOutcome.UNKNOWN, [])
    assert with_unexpected(GapOutcome.NO_GAP, []) == (GapOutcome.NO_GAP, [])
    assert with_unexpected(GapOutcome.EFFECT, [race]) == (GapOutcome.EFFECT, [])
