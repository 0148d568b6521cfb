"""A gap report in four sentences."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gearsig.gap import (
    KIND_TITLES,
    NONE,
    UNKNOWN,
    Attribution,
    ConditionFacts,
    GapCause,
    GapOutcome,
    GapPlace,
    Interval,
    OperatingCondition,
    PlaceKind,
    inseparable_effects,
    load_gap_calibration,
    names_single_effect,
    unbounded_fits,
    with_unknown_within_floor,
)
from tests.gap.example_report import (
    cannot_separate_report,
    effect_report,
    no_gap_report,
    shrinkage,
    undecided_report,
    unknown_report,
)


def test_a_severity_has_a_unit_for_people_and_no_exponent() -> None:
    report = effect_report()
    first = replace(report.causes[0], unit="g mm", severity=Interval(1234.0, 1000.0, 1500.0))
    anything = replace(first, severity=Interval(1234.0, 0.0, float("inf")))
    assert "g·mm" not in replace(report, causes=(anything, *report.causes[1:])).verdict[1]
    assert ", 1230 g·mm (probability 88 %)." in replace(report, causes=(first,)).verdict[1]
    assert ", 14 µm (" in replace(report, causes=(report.causes[2],)).verdict[1]


def test_causes_that_cannot_be_told_apart_are_named_even_if_one_is_not_among_them() -> None:
    report = replace(cannot_separate_report(), inseparable=("root_crack", "torque_ripple"))
    assert report.verdict[1] == (
        "Which: a damaged tooth, tooth 21 of the driver (93 %): crack in a tooth root (48 %); otherwise "
        "torque ripple; these recordings cannot tell them apart."
    )


def test_the_kind_of_fault_comes_first_where_it_is_surer_than_the_effect() -> None:
    report = effect_report()
    assert report.kind is not None
    assert (report.kind.group, report.kind.probability) == ("tooth-local", 0.93)
    assert report.kind.place == report.causes[0].place
    line = report.verdict[1]
    assert line.index(report.kind.title) < line.index("93 %") < line.index(report.causes[0].title)
    as_sure = replace(report, groups={"tooth-local": report.causes[0].probability})
    assert KIND_TITLES["tooth-local"] not in as_sure.verdict[1]
    assert no_gap_report().kind is None
    assert replace(report, groups={"tooth-local": 0.4, "shaft": 0.3}).kind is None


def test_what_cannot_be_told_apart_is_named_until_it_is_nearly_all_that_effects_have() -> None:
    report = cannot_separate_report()
    first, second, third, *_ = report.causes
    names = (first.name, second.name)

    def with_chances(*chances: float) -> list[GapCause]:
        return [replace(cause, probability=p) for cause, p in zip((first, second, third), chances, strict=True)]

    assert inseparable_effects(with_chances(0.49, 0.45, 0.06)) == names
    assert inseparable_effects(with_chances(0.9, 0.06, 0.04)) == names
    assert inseparable_effects(with_chances(0.43, 0.35, 0.22)) == (*names, third.name)
    three = replace(report, inseparable=(*names, third.name))
    assert three.verdict[1].count(" or ") == 1
    assert three.verdict[1].count(",") == 1
    others = [replace(third, name=f"other {i}", probability=0.1) for i in range(6)]
    assert len(inseparable_effects([replace(first, probability=0.3), second, *others])) == 4
    assert inseparable_effects([]) == ()


def test_what_is_next_says_only_what_was_computed() -> None:
    nothing = replace(effect_report(), next_recordings=())
    assert "would put the two likeliest effects further apart" in nothing.verdict[3]
    alone = replace(nothing, causes=(nothing.causes[0], replace(nothing.causes[1], shrinkage=None)))
    assert "likely enough" in replace(alone, causes=alone.causes[:2]).verdict[3]
    assert "when it was healthy" in replace(nothing, references=()).verdict[3]
    assert "when it was healthy" in replace(unknown_report(), references=()).verdict[3]


def test_a_healthy_machine_is_the_first_wish_and_another_point_the_second() -> None:
    report = cannot_separate_report()
    assert report.verdict[3].startswith("Next: the same machine when it was healthy")
    assert f" Or {report.next_recordings[0].text}" in report.verdict[3]
    known = replace(report, references=("healthy.h5",))
    assert known.verdict[3] == f"Next: {report.next_recordings[0].text}"


def test_an_effect_that_takes_nothing_away_does_not_shrink_the_gap() -> None:
    report = effect_report()
    worse = replace(report.causes[0], shrinkage=shrinkage(-1.0, -1.0, -1.0))
    line = replace(report, causes=(worse, *report.causes[1:])).verdict[2]
    assert "does not shrink on another operating condition" in line


def test_a_small_gap_as_a_whole_may_be_large_in_one_place() -> None:
    report = replace(effect_report(), size=Interval(0.7, 0.6, 0.8))
    assert report.verdict[0].endswith("tooth 21 of the input shaft, 8.7 structural floors (58 % of the gap).")


def test_what_is_likely_enough_for_nothing_is_undecided() -> None:
    unsure = undecided_report()
    assert unsure.verdict[0].startswith("Where: a burst")
    assert unsure.verdict[1] == (
        "Which: undecided; nothing is likely enough to be named: no gap 30 %, spall on a tooth flank 20 %, effects of "
        "the group “tooth-local” together 60 %."
    )
    assert unsure.verdict[2] == "How far: no effect was added."
    assert replace(unsure, groups={"none": 0.3}).verdict[1].endswith("no gap 30 %, spall on a tooth flank 20 %.")
    assert "another sensor" in unsure.verdict[3]


def test_a_race_that_stands_out_of_no_gap_is_why_it_is_undecided() -> None:
    nan = float("nan")
    race = GapPlace(PlaceKind.ENVELOPE, "envelope lines of the outer race", 25.0, nan, nan, nan)
    report = replace(no_gap_report(), outcome=GapOutcome.UNDECIDED)
    which = replace(report, places=(race, *report.places)).verdict[1]
    assert "nothing is likely enough" not in which
    assert which.endswith("by the features compared, but there are envelope lines of the outer race.")


def test_what_comes_nearest_to_an_unknown_cause_is_told_with_its_probability() -> None:
    report = unknown_report()
    known = replace(effect_report().causes[0], probability=0.4)
    unknown = next(cause for cause in report.causes if cause.name == UNKNOWN)
    line = replace(report, causes=(replace(unknown, probability=0.2), known)).verdict[1]
    assert line == f"Which: unknown; {known.title} comes nearest (40 %), not enough to be named."


def test_without_a_gap_nothing_is_asked_for_that_would_separate_causes() -> None:
    report = no_gap_report()
    assert report.outcome is GapOutcome.NO_GAP
    assert report.references
    assert report.verdict[3] == "Next: nothing is needed; keep these recordings as references for later ones."


def test_a_gap_that_an_effect_explains_ends_within_the_floor() -> None:
    report = effect_report()
    found = replace(shrinkage(1.0, 1.0, 1.0), before=Interval(3.8, 3.7, 3.9), after=Interval(0.4, 0.3, 0.5))
    line = replace(report, causes=(replace(report.causes[0], shrinkage=found), *report.causes[1:])).verdict[2]
    assert "shrinks from 3.8 to 0.4 structural floors, within what healthy machines show, on" in line
    partly = replace(found, after=Interval(2.0, 1.9, 2.1), shrink=Interval(0.6, 0.5, 0.7))
    line = replace(report, causes=(replace(report.causes[0], shrinkage=partly), *report.causes[1:])).verdict[2]
    assert "from 3.8 to 2 structural floors, by 60 % (50 to 70 %) of its energy above one, on" in line


def test_an_effect_that_takes_what_the_first_leaves_is_told_beside_it() -> None:
    report = effect_report()
    beside = "adding housing and sensor resonances takes the whole gap from 3.9 to 1.6 structural floors"
    assert beside in report.verdict[2]
    assert "beside it" not in replace(report, steps=report.steps[:2]).verdict[2]


def test_a_tooth_that_both_likeliest_effects_share_can_be_looked_at() -> None:
    report = replace(cannot_separate_report(), next_recordings=(), references=("healthy.h5",))
    at_one = tuple(replace(cause, place="tooth 21 of the gear on the input shaft") for cause in report.causes)
    assert replace(report, causes=at_one).verdict[3].startswith("Next: look at tooth 21 of the gear on the input shaft")


def test_impacts_without_a_size_are_named_with_the_place_beside_them() -> None:
    report, nan = unknown_report(), float("nan")
    impacts = GapPlace(PlaceKind.ENVELOPE, "impacts at order 5.148", 20.0, nan, nan, nan, orders=(5.148,))
    mesh = effect_report().places[0]
    line = replace(report, places=(impacts, mesh)).verdict[0]
    assert line.startswith(f"Where: impacts at order 5.148; beside it, {mesh.title}, 8.7 structural floors")
    assert replace(report, places=(impacts,)).verdict[0] == "Where: impacts at order 5.148."
    assert "nan" not in line


def test_next_to_an_unknown_cause_is_another_look_at_it() -> None:
    assert "sensor nearer" in replace(unknown_report(), next_recordings=(), references=("healthy.h5",)).verdict[3]


def test_a_fit_that_any_severity_serves_is_a_warning() -> None:
    report = effect_report()
    assert unbounded_fits(report.causes, report.outcome) == []
    anything = replace(report.causes[0], severity=Interval(2.0, 0.0, float("inf")))
    causes = (anything, *report.causes[1:])
    assert (
        len(unbounded_fits(causes, GapOutcome.EFFECT)) == len(unbounded_fits(causes, GapOutcome.CANNOT_SEPARATE)) == 1
    )
    assert unbounded_fits(causes, GapOutcome.UNKNOWN) == []
    at_most = replace(anything, severity=Interval(2.0, 0.0, 4.0))
    assert unbounded_fits((at_most, *report.causes[1:]), GapOutcome.EFFECT) == []


def test_a_gap_within_the_floor_has_no_unknown_cause() -> None:
    found = {UNKNOWN: 0.6, NONE: 0.3, "unbalance": 0.1}
    assert with_unknown_within_floor(found, Interval(0.5, 0.4, 0.6)) == pytest.approx(
        {NONE: 0.9, "unbalance": 0.1, UNKNOWN: 0.0}
    )
    assert with_unknown_within_floor(found, Interval(0.9, 0.7, 1.1)) == found


@pytest.mark.parametrize(
    ("none", "size", "expected"),
    [(0.35, 0.7, GapOutcome.NO_GAP), (0.35, 1.2, GapOutcome.UNDECIDED), (0.1, 0.7, GapOutcome.UNDECIDED)],
)
def test_a_gap_within_the_floor_is_none_if_nothing_is_likelier(none: float, size: float, expected: GapOutcome) -> None:
    """Of many unlikely causes none is named; a gap that healthy machines have as well needs none."""
    others = dict.fromkeys(("unbalance", "misalignment", "tooth_wear", "backlash"), (0.9 - none) / 4.0)
    found = {NONE: none, UNKNOWN: 0.1, **others}
    attribution = Attribution({}, {}, load_gap_calibration(with_reference=True), size)
    assert attribution.outcome(found) is expected


def at(*points: tuple[float, float]) -> tuple[ConditionFacts, ...]:
    first = effect_report().conditions[0]
    return tuple(replace(first, point=OperatingCondition(*point)) for point in points)


def test_where_one_effect_alone_is_likely_no_recording_is_asked_for() -> None:
    report = replace(effect_report(), next_recordings=(), references=("healthy.h5",))
    first, *others = report.causes
    sure = (replace(first, probability=0.996), *(replace(cause, probability=0.001) for cause in others))
    assert names_single_effect(sure)
    assert not names_single_effect(report.causes)
    assert not names_single_effect(sure[:1])
    assert "further apart" not in replace(report, causes=sure).verdict[3]
    alone_tried = (sure[0], *(replace(cause, shrinkage=None) for cause in sure[1:]))
    assert "no other effect is likely enough" in replace(report, causes=alone_tried).verdict[3]


def test_what_was_varied_already_is_not_advised() -> None:
    unknown = replace(unknown_report(), next_recordings=(), references=("healthy.h5",))
    alone = replace(effect_report(), causes=effect_report().causes[:1], next_recordings=())
    for report in (unknown, alone):
        once = replace(report, conditions=at((1500.0, 60.0))).verdict[3]
        two_speeds = replace(report, conditions=at((1500.0, 60.0), (900.0, 60.0))).verdict[3]
        two_loads = replace(report, conditions=at((1500.0, 60.0), (1500.0, 20.0))).verdict[3]
        both = replace(report, conditions=at((1500.0, 60.0), (900.0, 20.0))).verdict[3]
        said = [("speed" in text, "load" in text) for text in (two_speeds, two_loads, both)]
        assert "speed" in once
        assert said == [(False, True), (True, False), (False, False)]


def test_a_shrink_that_the_simulator_cannot_show_is_not_claimed() -> None:
    report = effect_report()
    first = report.causes[0]
    assert first.shrinkage is not None
    faint = replace(first, shrinkage=replace(first.shrinkage, predicted=0.1))
    said = replace(report, causes=(faint, *report.causes[1:])).verdict[2]
    assert said.startswith("How far: not known; ")
    assert "at most 0.1 floors" in said
