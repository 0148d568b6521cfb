"""`gearsig benchmark gap`: what the diagnosing process can see, stopping and going on, the files."""

import csv
import json
import os
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path

import h5py
import pytest

from app.benchmark import diagnosers, run
from app.benchmark.answer import Answer, from_text, to_text
from app.benchmark.cases import BLIND, SAME, Plan, PlannedCase
from app.benchmark.diagnosers import DIAGNOSERS, USUAL, diagnoser, read_visible
from app.benchmark.run import ANSWERS_FOLDER, BenchmarkRequest, diagnosed, environment, run_benchmark, state_of_code
from app.cli.main import main
from gearsig.cache import FOLDERS
from gearsig.errors import InputError
from gearsig.gap import INDEPENDENT, LEFT_OUT, NONE, UNKNOWN, GapPlace, PlaceKind, textbook_rules
from sims.blind import CATALOGUE, OUTSIDE_CATALOGUE
from sims.effects import as_gap_effect, effects
from tests.app.answers import cause

ROOT = Path(__file__).parents[2]
SHORT = Plan(n_cases=2, seed=4, role="development", reference="with", longest_s=2.0)
WORDS = (
    *CATALOGUE,
    *OUTSIDE_CATALOGUE,
    "single",
    "pair",
    "seed",
    "label",
    "twin",
    "development",
    "evaluation",
    "blind",
)


def case(kind, effect, source=BLIND):
    return PlannedCase(7, source, kind, effect, 0.9, with_reference=True, n_conditions=1)


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Three cases of different kind on the same draw of rig, conditions and noise."""
    found = {}
    for kind, effect in (("none", None), ("single", "root_crack"), ("unknown", "coupling_knock")):
        folder = tmp_path_factory.mktemp("seen")
        found[kind] = folder, SHORT.make(case(kind, effect), folder)
    return found


def everything_but_samples(folder):
    """Names, sizes, times, and all of each file that is no sample."""
    found = {}
    for path in sorted(folder.iterdir()):
        found[path.name] = path.stat().st_size, path.stat().st_mtime_ns, path.stat().st_mode
        if path.suffix != ".h5":
            found[f"{path.name} text"] = path.read_bytes()
            continue
        with h5py.File(path) as file:
            objects = {"/": file}
            file.visititems(objects.__setitem__)
            for name, item in objects.items():
                found[f"{path.name} {name} attributes"] = {key: repr(value) for key, value in item.attrs.items()}
                if isinstance(item, h5py.Dataset):
                    found[f"{path.name} {name}"] = item.shape, str(item.dtype), item.compression, item.chunks
                    if name != "samples":
                        found[f"{path.name} {name} content"] = bytes(item[()])
    return found


@pytest.mark.slow
def test_cases_of_different_kind_differ_in_their_samples_only(folders):
    healthy, *others = (everything_but_samples(folder) for folder, _ in folders.values())
    assert all(other == healthy for other in others)
    values = [read_visible(folder).recordings[0].values("a1") for folder, _ in folders.values()]
    assert all((values[0] != other).any() for other in values[1:])


def test_the_truth_is_returned_and_not_written(folders):
    for kind, (folder, truth) in folders.items():
        assert truth.labels["kind"] == kind
        assert {p.stem.rpartition("_")[0] or p.stem for p in folder.iterdir()} == {"condition", "reference", "rig"}
    healthy, cracked = folders["none"][1], folders["single"][1]
    assert not healthy.fault_changes
    assert max(abs(db) for db in cracked.fault_changes[0].values()) > 3.0


@pytest.mark.slow
def test_the_diagnosing_process_finds_no_label(folders):
    folder, _ = folders["single"]
    spy = "tests.app.benchmark_spy:diagnose"
    before = sorted(p.name for p in folder.iterdir())
    answers = diagnosed(folder, (spy, "majority", "rules"))
    found = json.loads(answers[spy].error)
    assert found["files"] == before
    assert found["arguments"] == [spy, "majority", "rules"]
    assert found["recordings"] == ["condition_1.h5"]
    assert found["truths"] == [None, None]
    assert not [m for m in found["modules"] if m.startswith("sims.blind")]
    making = {f"app.benchmark.{name}" for name in ("cases", "run", "start_stop")}
    assert making.isdisjoint(found["modules"])
    # The checkout and the interpreter may lie anywhere: their places are not the case's.
    own = {
        k: v
        for k, v in found["environment"].items()
        if k not in ("PATH", "HOME", "PYTHONPATH", "VIRTUAL_ENV", *FOLDERS)
    }
    assert own.pop("TMPDIR") == found["folder"] == str(folder)
    assert not [w for w in WORDS if w in json.dumps(own).lower()]
    assert answers["majority"].causes[0].name == NONE
    assert sum(c.probability for c in answers["majority"].causes) == pytest.approx(1.0)
    assert sum(c.probability for c in answers["rules"].causes) == pytest.approx(1.0)


@pytest.mark.slow
def test_the_diagnosing_simulator_makes_the_same_cases_too(tmp_path):
    truth = SHORT.make(case("single", "eccentricity", SAME), tmp_path)
    seen = read_visible(tmp_path)
    assert len(seen.recordings) == len(seen.references) == 1
    assert seen.recordings[0].truth is None
    assert [e["name"] for e in truth.labels["effects"]] == ["eccentricity"]
    largest = max(truth.fault_changes[0], key=lambda name: abs(truth.fault_changes[0][name]))
    assert largest.startswith(("sideband", "shaft"))


@pytest.mark.slow
def test_the_same_cases_have_the_same_gears_conditions_and_effects():
    plan = Plan(n_cases=10, seed=4, role="development", same_simulator=True, longest_s=2.0)
    same = next(c for c in plan.cases() if c.source == SAME and c.kind == "pair" and c.n_conditions == 1)
    blind = next(c for c in plan.cases() if c.number == same.repeats)
    ours, theirs = (plan.make(planned, None).labels for planned in (same, blind))
    assert ours["pair"] == theirs["pair"]
    assert [e["name"] for e in ours["effects"]] == [e["name"] for e in theirs["effects"]]
    kept = ("true_rpm", "true_nm")
    assert ours["conditions"] == [{key: c[key] for key in kept} for c in theirs["conditions"]]


@pytest.mark.study
def test_a_stopped_run_leaves_answers_and_goes_on(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(run, "state_of_code", lambda: "the same")  # others may be at work on it
    wanted = BenchmarkRequest(SHORT, ("rules", "majority"))
    target = tmp_path / "out"

    def stop(n_done):
        assert n_done == 1
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_benchmark(wanted, target, n_processes=1, on_progress=stop)
    kept = {p: p.stat().st_mtime_ns for p in (target / ANSWERS_FOLDER).glob("case_*.json")}
    assert kept
    assert {p.name for p in target.iterdir()} == {"benchmark.json", ANSWERS_FOLDER}
    options = ["--cases", "2", "--seed", "4", "--role", "development", "--with-reference", "--longest", "2"]
    command = ["benchmark", "gap", *options, "--diagnoser", "rules", "-j", "2", "-o", str(target)]
    with pytest.raises(SystemExit) as end:
        main(command)
    assert not end.value.code
    assert all(path.stat().st_mtime_ns == time for path, time in kept.items())
    damaged = next(iter(kept))
    whole = damaged.read_text(encoding="utf-8")
    for content in (whole[: len(whole) // 2], '{"rules": {}}'):
        damaged.write_text(content, encoding="utf-8")  # given again, not believed
        with pytest.raises(SystemExit) as end:
            main(command)
        assert not end.value.code
        assert set(json.loads(damaged.read_text(encoding="utf-8"))) == {"majority", "rules"}
    told = capsys.readouterr().out
    assert "Against the targets" in told
    check_files(target, wanted.plan)
    with pytest.raises(InputError, match="seed differs"):
        run_benchmark(BenchmarkRequest(Plan(2, 5, "development", "with", False, 2.0), wanted.diagnosers), target)


def check_files(target, plan):
    names = {"benchmark.json", "answers", "labels", "report.html", "table.md", "scores.json", "cases.csv"}
    assert {p.name for p in target.iterdir()} == names
    labels = [json.loads(p.read_text(encoding="utf-8")) for p in sorted((target / "labels").iterdir())]
    assert [found["kind"] for found in labels] == [c.kind for c in plan.cases()]
    with (target / "cases.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert Counter(row["diagnoser"] for row in rows) == {"rules": 2, "majority": 2}
    found = json.loads((target / "scores.json").read_text(encoding="utf-8"))
    part = next(
        p for p in found["parts"] if (p["cases"], p["diagnoser"], p["least_strength"]) == ("all", "majority", 0.0)
    )
    assert part["scores"]["answered"] == {
        "value": 1.0,
        "low": pytest.approx(2 / (2 + 1.6448536**2)),
        "high": 1.0,
        "n": 2,
    }
    html = (target / "report.html").read_text(encoding="utf-8")
    assert "http" not in html.replace("http-equiv", "")
    assert html.count("<img") == 2


def test_the_plan_is_balanced_and_repeats():
    plan = Plan(200, 3)
    cases = plan.cases()
    assert [c.number for c in cases] == list(range(1, 201))
    assert Counter(c.kind for c in cases) == {"single": 120, "none": 30, "unknown": 30, "pair": 20}
    singles = Counter(c.effect for c in cases if c.kind == "single")
    assert set(singles) == set(CATALOGUE)
    assert set(singles.values()) == {6, 7}
    assert Counter(c.effect for c in cases if c.kind == "unknown") == dict.fromkeys(OUTSIDE_CATALOGUE, 3)
    assert set(Counter((c.with_reference, c.n_conditions) for c in cases).values()) <= set(range(47, 54))
    cracks = sorted(c.level for c in cases if c.effect == "root_crack")
    assert all(i / len(cracks) <= level <= (i + 1) / len(cracks) for i, level in enumerate(cracks))
    assert plan.cases() == cases
    assert Plan(200, 4).cases() != cases
    assert not any(c.with_reference for c in Plan(20, reference="without").cases())


def test_cases_can_be_strong_ones_only():
    strong = Plan(200, 3, least_level=0.75)
    levels = [c.level for c in strong.cases()]
    assert min(levels) >= 0.75
    assert max(levels) <= 1.0
    assert [0.75 + 0.25 * c.level for c in Plan(200, 3).cases()] == pytest.approx(levels)
    with pytest.raises(InputError, match="least level"):
        Plan(200, 3, least_level=1.5)


def test_the_same_simulator_repeats_all_but_the_unknown():
    plan = Plan(40, same_simulator=True)
    cases = plan.cases()
    blind, same = ([c for c in cases if c.source == source] for source in (BLIND, SAME))
    assert [(c.kind, c.effect, c.level) for c in same] == [
        (c.kind, c.effect, c.level) for c in blind if c.kind != "unknown"
    ]
    assert len({c.number for c in cases}) == len(cases)
    assert [c.repeats for c in same] == [c.number for c in blind if c.kind != "unknown"]
    assert not any(c.repeats for c in blind)
    drawn = {c.number: plan.rng_of(c).random() for c in cases}
    assert all(drawn[c.number] == drawn[c.repeats] for c in same)
    assert len({*drawn.values(), *(plan.rng_of_run(c).random() for c in same)}) == len(blind) + len(same)


def test_the_rule_table_names_every_effect_and_known_features_only():
    rules = textbook_rules(map(as_gap_effect, effects().values()))
    assert {cause for cause, _ in rules} == {*effects(), UNKNOWN}
    assert {name for _, signs in rules for name, _ in signs} == set(USUAL)


def test_answers_survive_the_way_through_a_file():
    causes = (cause("root_crack", 0.9, {"gear": "driver", "tooth": 3.0}, 0.7, n_placebos=3), cause("none", 0.1))
    place = GapPlace(PlaceKind.TOOTH, "", 3.0, 1.0, 1.0, 1.0, "input", (1.0, 2.0), angle_deg=30.0, tooth=3)
    answer = Answer("effect", causes, ("root_crack", "tooth_spall"), (place,), 4.0, 12.0, 20.0)
    assert from_text(to_text({"gap": answer})) == {"gap": answer}


def test_a_diagnoser_that_is_not_there_is_named():
    with pytest.raises(InputError, match="no diagnoser 'nothing'"):
        diagnoser("nothing")
    with pytest.raises(InputError, match=r"app\.gap_job:nothing"):
        diagnoser("app.gap_job:nothing")

    with pytest.raises(InputError, match="no diagnoser '__main__:main'"):
        diagnoser("__main__:main")  # of this process, not of the one that would call it


def test_a_users_own_diagnoser_is_found_by_the_diagnosing_process(tmp_path, monkeypatch):
    own, other, case_folder = (tmp_path / name for name in ("own", "out", "case"))
    for place in (own, other, case_folder):
        place.mkdir()
    text = "from gearsig.errors import RefusalError\n\ndef diagnose(seen):\n    raise RefusalError('asked')\n"
    (own / "my_diagnoser.py").write_text(text, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join([str(other), str(own)]))
    monkeypatch.syspath_prepend(str(own))
    diagnoser("my_diagnoser:diagnose")
    assert diagnosed(case_folder, ["my_diagnoser:diagnose"])["my_diagnoser:diagnose"].error == "asked"
    assert environment(case_folder, ["my_diagnoser:diagnose"])["PYTHONPATH"].split(os.pathsep) == [str(ROOT), str(own)]
    assert environment(case_folder, ["gap", "majority", "sys:exit"])["PYTHONPATH"] == str(ROOT)


def test_the_state_of_the_code_hangs_on_the_code_and_not_on_where_it_lies(tmp_path, monkeypatch):
    states = []
    for place in ("report", "elsewhere"):
        root = tmp_path / place
        for folder, text in (("gearsig/gap", "1"), ("gearsig/report", place)):
            (root / folder).mkdir(parents=True)
            (root / folder / "a.py").write_text(text, encoding="utf-8")
        monkeypatch.setattr(run, "_ROOT", root)
        states.append(state_of_code())
    assert states[0] == states[1]
    (root / "gearsig/gap/a.py").write_text("2", encoding="utf-8")
    assert state_of_code() != states[1]


@pytest.mark.slow
def test_sigterm_leaves_answers_only(tmp_path):
    target, temporary, told = tmp_path / "out", tmp_path / "temporary", tmp_path / "lingering"
    temporary.mkdir()
    options = ["--cases", "1", "--role", "development", "--longest", "2", "-j", "1", "-o", str(target)]
    options += ["--diagnoser", "tests.app.benchmark_spy:linger"]
    stopped = subprocess.Popen(
        [sys.executable, "-m", "app.cli.main", "benchmark", "gap", *options],
        env={**os.environ, "TMPDIR": str(temporary), "HOME": str(tmp_path)},
        cwd=ROOT,
        stderr=subprocess.PIPE,
        text=True,
    )
    until(lambda: told.exists() and told.read_text().count(" ") == 1)
    stopped.terminate()
    _, said = stopped.communicate(timeout=30.0)
    assert stopped.returncode == 130
    assert "0 of 1 cases are answered" in said
    assert list(temporary.iterdir()) == []
    until(lambda: not any(map(is_running, told.read_text().split())))


def until(holds):
    end = time.monotonic() + 60.0
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def is_running(pid):
    state = Path(f"/proc/{pid}/stat")
    return state.exists() and state.read_text().rpartition(")")[2].split()[0] != "Z"


def test_the_unseen_know_nothing_of_the_rig_that_makes_the_cases() -> None:
    unseen = diagnosers.unseen(lambda _: LEFT_OUT.get())  # type: ignore[arg-type,return-value]  # it looks at nothing
    assert unseen(None) == INDEPENDENT  # type: ignore[arg-type,comparison-overlap]
    assert not LEFT_OUT.get()


def test_each_name_is_a_diagnoser_of_its_own() -> None:
    assert len(set(DIAGNOSERS.values())) == len(DIAGNOSERS)
    assert all(diagnoser(name) is function for name, function in DIAGNOSERS.items())
