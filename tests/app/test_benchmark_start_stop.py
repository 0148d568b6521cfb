"""Blind start–stop cases: their plan, what a case's folder holds, and how answers are scored."""

import json
from collections import Counter
from math import isnan

import pytest

from app.benchmark.answer import Answer
from app.benchmark.cases import BLIND, PlannedCase, Truth
from app.benchmark.diagnosers import START_STOP
from app.benchmark.run import BenchmarkRequest, Done
from app.benchmark.scores import scores
from app.benchmark.start_stop import (
    FIGURES,
    DrivePlan,
    drive_row,
    effects_named,
    judge_drives,
    planned,
    write_drive_results,
)
from app.cli.main import main
from app.studies.gap.start_stop import numbers_of
from gearsig.recording import read_recording
from gearsig.rig import read_rig
from sims.blind_drive import CATALOGUE
from tests.app.answers import cause


def run(arguments: list[str]) -> int:
    """Run the command line; return its exit code."""
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


def test_effects_come_in_turn_and_seeds_decide():
    plan = planned(100, 3)
    counts = Counter(effect for kind, effect, _ in plan if kind == "single")
    assert set(counts) == set(CATALOGUE)
    assert max(counts.values()) - min(counts.values()) <= 1
    assert plan == planned(100, 3) != planned(100, 4)


@pytest.mark.slow
def test_a_case_folder_holds_recordings_and_rigs_and_no_label(tmp_path):
    plan = DrivePlan(10, 2, "development", "with")
    case = plan.cases()[0]
    label = plan.make(case, tmp_path).labels
    names = {path.name for path in tmp_path.iterdir()}
    assert names == {"condition_1.h5", "condition_1.toml", "reference_1.h5", "reference_1.toml"}
    read = read_recording(tmp_path / "condition_1.h5", rig=read_rig(tmp_path / "condition_1.toml"))
    assert not read.truth
    assert list(label["pair"].values()) == [read.rig.pairs[0].driver_teeth, read.rig.pairs[0].driven_teeth]
    assert plan.make(case, None).labels == label


def done(
    number: int,
    kind: str,
    effect: str,
    causes: dict[str, float],
    outcome: str,
    shrink: float = 0.8,
    placebo: float = 0.1,
    inseparable: tuple[str, ...] = (),
) -> Done:
    n_placebos = 4 if effect == "root_crack" else 0
    answered = [
        cause(name, p, {"tooth": 3.0} if name == "root_crack" else {}, shrink, placebo=placebo, n_placebos=n_placebos)
        for name, p in causes.items()
    ]
    answer = Answer(outcome, tuple(answered), inseparable, seconds=5.0, cpu_seconds=4.0)
    place = {"tooth": 3} if effect == "root_crack" else {}
    labels = {
        "kind": kind,
        "effects": [{"name": effect, "severity": 1.0, "unit": "um", "level": 0.7, "place": place}] if effect else [],
        "has_reference": number % 2 == 0,
        "conditions": [{}],
        "pair": {"z1": 20, "z2": 100},
    }
    case = PlannedCase(number, BLIND, kind, effect, 0.7, with_reference=number % 2 == 0, n_conditions=1)
    return Done(case, Truth(labels, ()), {START_STOP: answer})


def figures(cases: list[Done]):
    return scores([drive_row(case) for case in cases], 1, FIGURES)


CASES = [
    done(0, "single", "root_crack", {"root_crack": 0.8, "backlash": 0.1, "none": 0.1}, "effect"),
    done(1, "single", "backlash", {"none": 0.5, "root_crack": 0.3, "backlash": 0.2}, "no gap"),
    done(2, "none", "", {"none": 0.9, "backlash": 0.1}, "no gap"),
    done(3, "none", "", {"backlash": 0.9, "none": 0.1}, "effect"),
    done(4, "unknown", "run_out", {"unknown": 0.9, "backlash": 0.1}, "unknown"),
]


def test_figures_count_what_they_say():
    found = {name: score.value for name, score in figures(CASES).items()}
    assert found["top_1"] == 0.5
    assert found["top_2"] == 1.0
    assert found["named_right"] == 0.5
    assert found["named_wrong"] == 0.0
    assert found["place"] == 1.0
    assert found["named_on_none"] == 0.5
    assert found["unknown_recognised"] == 1.0
    assert found["shrink_true"] == 0.8
    assert isnan(figures([])["top_1"].value)


def test_all_effects_that_cannot_be_separated_are_named():
    said = {"backlash": 0.4, "tooth_wear": 0.3, "root_crack": 0.25, "none": 0.05}
    three = ("backlash", "tooth_wear", "root_crack")
    case = done(0, "single", "root_crack", said, "cannot separate", inseparable=three)
    assert effects_named(drive_row(case)) == list(three)
    assert figures([case])["named_right"].value == 1.0
    assert figures([case])["named_wrong"].value == 0.0


def test_placebos_count_where_there_are_any():
    crack, play = (
        ("single", "root_crack", {"root_crack": 1.0}, "effect"),
        ("single", "backlash", {"backlash": 1.0}, "effect"),
    )
    cases = [done(0, *crack, placebo=0.0), done(1, *crack, placebo=0.3), done(2, *play, placebo=0.0)]
    found = figures(cases)["placebo"]
    assert (found.value, found.n) == (pytest.approx(0.15), 2)


def test_the_interval_of_a_median_is_its_own_and_not_that_of_its_values():
    cases = [done(i, "single", "root_crack", {"root_crack": 1.0}, "effect", shrink=0.01 * i) for i in range(1, 102)]
    found = figures(cases)["shrink_true"]
    assert found.value == pytest.approx(0.51)
    assert 0.35 < found.low < 0.51 < found.high < 0.67


@pytest.mark.parametrize("n_cases", [1, 7, 30, 50, 70, 101])
def test_as_many_cases_are_planned_as_are_asked_for(n_cases):
    assert len(planned(n_cases, 3)) == n_cases


def test_scores_are_written_whole(tmp_path):
    out = tmp_path / "out"
    out.mkdir()
    request = BenchmarkRequest(DrivePlan(5), (START_STOP,))

    def write(cases: list[Done]):
        return write_drive_results(judge_drives(request, cases), cases, out, "gearsig benchmark gap")

    write(CASES[:1])
    before = {path.name: path.read_text(encoding="utf-8") for path in out.iterdir() if path.is_file()}
    for name in before:  # who has the old file open keeps all of it
        (tmp_path / name).hardlink_to(out / name)
    table = write(CASES)
    for name, text in before.items():
        assert (tmp_path / name).read_text(encoding="utf-8") == text != (out / name).read_text(encoding="utf-8")
    assert "| likeliest effect right | 50 % (" in table.read_text()
    parts = json.loads((out / "scores.json").read_text())["parts"]
    assert {part["cases"]: part["n_cases"] for part in parts} == {"all": 5, "with reference": 3, "without reference": 2}
    assert parts[0]["scores"]["no_answer"]["value"] == 0.0
    assert len((out / "cases.csv").read_text().splitlines()) == 1 + len(CASES)
    assert len(list((out / "labels").iterdir())) == len(CASES)


@pytest.mark.parametrize(
    "option", [["--same-simulator"], ["--diagnoser", "rules"], ["--longest", "3"], ["--least-level", "0.5"]]
)
def test_options_of_the_other_benchmark_are_refused(tmp_path, capsys, option):
    assert run(["benchmark", "gap", "--model", "forging", *option, "-o", str(tmp_path / "b")]) == 2
    assert option[0] in capsys.readouterr().err


def test_calibration_cases_are_chosen_by_their_numbers():
    assert numbers_of("", 3) == [0, 1, 2]
    assert numbers_of("0-2,7,9-10", 20) == [0, 1, 2, 7, 9, 10]
