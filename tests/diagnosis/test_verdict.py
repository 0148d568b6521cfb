"""The verdict says no more than the findings do."""

from dataclasses import replace

import pytest

from gearsig.diagnosis import Finding, Kind, analyze, from_p_value, ranked, verdict_of
from tests.diagnosis.machines import motor


def test_whether_columns_are_separate_runs_is_asked_first() -> None:
    runs = replace(motor("", 0), warnings=("Are these separate runs? The 3 columns share no noise.",))
    assert analyze(runs).verdict.startswith("Are these separate runs?")


def test_faults_come_first_and_the_surest_of_them() -> None:
    findings = ranked(
        [
            Finding("a", Kind.INFORMATION, "info"),
            Finding("b", Kind.FAULT, "less sure", confidence=0.8),
            Finding("c", Kind.CANNOT_TELL, "gap"),
            Finding("d", Kind.FAULT, "surer", confidence=0.9),
        ]
    )
    assert [f.code for f in findings] == ["d", "b", "c", "a"]
    assert verdict_of(findings) == "Fault: surer (at most 90 % sure), and 1 more."
    assert verdict_of(findings, brief=True) == "surer (at most 90 % sure), and 1 more."


@pytest.mark.parametrize(
    ("findings", "start"),
    [
        ([], "Cannot tell"),
        ([Finding("speed-unknown", Kind.CANNOT_TELL, "No speed.")], "Cannot tell. No speed."),
        ([Finding("no-tooth-local-damage", Kind.INFORMATION, "Teeth look alike.", confidence=0.8)], "No fault shows."),
        ([Finding("x", Kind.NOTICE, "hum")], "Cannot tell"),
        ([Finding("x", Kind.SUSPICION, "odd", confidence=0.5)], "Suspicion: odd"),
    ],
)
def test_no_fault_is_only_said_where_one_would_have_shown(findings: list[Finding], start: str) -> None:
    assert verdict_of(tuple(findings)).startswith(start)


def test_an_open_question_comes_with_what_would_settle_it() -> None:
    gap = Finding("x", Kind.CANNOT_TELL, "Noise hides it.", surer="A longer recording. Or another sensor.")
    assert verdict_of((gap,)) == "Cannot tell. Noise hides it. More certain with: a longer recording."
    assert verdict_of((gap,), brief=True) == "Noise hides it."


UNUSED = Finding(
    "crack-depth-unknown",
    Kind.CANNOT_TELL,
    "The depth of a root crack cannot be told: the reference was taken at 50 N m, the recording at 70 N m.",
    surer="Take it within 10 % of the same torque.",
)


@pytest.mark.parametrize("kind", [Kind.FAULT, Kind.SUSPICION, Kind.CANNOT_TELL, Kind.INFORMATION])
def test_why_a_reference_was_of_no_use_is_always_said(kind: Kind) -> None:
    gaps = [Finding(f"gap {i}", Kind.CANNOT_TELL, f"Gap {i}.", surer=f"Thing {i}.") for i in range(4)]
    verdict = verdict_of(ranked([*gaps, Finding("x", kind, "it is odd"), UNUSED]), has_reference=True)
    assert UNUSED.title in verdict
    assert "odd" in verdict or kind in (Kind.CANNOT_TELL, Kind.INFORMATION)


def test_what_kind_of_reference_would_do_comes_before_other_wishes() -> None:
    gap = Finding("tooth-damage-undecided", Kind.CANNOT_TELL, "They differ.", surer="More revolutions.")
    verdict = verdict_of((gap, UNUSED), has_reference=True)
    assert verdict.endswith("What would help: take it within 10 % of the same torque.")
    assert "They differ." in verdict


def test_a_reference_that_was_given_is_not_asked_for() -> None:
    healthy = (Finding("no-tooth-local-damage", Kind.INFORMATION, "Teeth look alike."),)
    assert "against an earlier recording" in verdict_of(healthy)
    assert "recording" not in verdict_of(healthy, has_reference=True)
    assert "earlier recording" not in verdict_of(healthy, has_reference=True)


def test_confidence_falls_with_the_p_value_and_is_bounded() -> None:
    values = [from_p_value(p) for p in (1e-9, 1e-4, 1e-3, 1e-2, 0.05, 0.3, 1.0)]
    assert values == sorted(values, reverse=True)
    assert values[0] == 0.95
    assert values[-1] == pytest.approx(0.1)  # a test that says nothing leaves the prior
    # Sellke, Bayarri, Berger 2001, table 1: p = 0.05 and 0.01 leave 0.289 and 0.111 for the null at even prior.
    assert 1 - from_p_value(0.05, prior=0.5, limit=1) == pytest.approx(0.289, abs=5e-4)
    assert 1 - from_p_value(0.01, prior=0.5, limit=1) == pytest.approx(0.111, abs=5e-4)
