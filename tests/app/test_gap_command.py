"""`gearsig gap` around the diagnosis: what it is given, what it prints and leaves, and that bad input is one line."""

import json
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import pytest

from app.gap_job import check_folder, write_results
from app.samples import sample_folder
from gearsig.cache import cache_folder
from gearsig.errors import InputError, RefusalError
from gearsig.gap import GapReport, GapRequest, read_gap_inputs
from gearsig.rig import Bearing, OperatingPoint, read_rig, write_rig
from tests.app.test_cli import run as command
from tests.gap.example_report import TWIN, cannot_separate_report, effect_report, no_gap_report, with_few_curves

SAMPLES = sample_folder()
CRACKED, HEALTHY = SAMPLES / "root_crack_3mm.h5", SAMPLES / "root_crack_0mm.h5"
RIG = SAMPLES / "root_crack_3mm.toml"
NAMES = ["gap.html", "gap.json", "twin.toml"]


@dataclass
class Stub:
    """A diagnosis that answers at once and remembers what it was given."""

    answer: Callable[[], GapReport] = effect_report
    given: dict[str, Any] = field(default_factory=dict)

    def diagnose_gap(self, recordings, simulator, **more):
        self.given = {"recordings": recordings, "simulator": simulator, **more}
        more["on_stage"]("fitting [bold]effects", 0.5)
        return with_few_curves(self.answer())


@pytest.fixture
def stub(monkeypatch: pytest.MonkeyPatch) -> Stub:
    found = Stub()
    monkeypatch.setattr("gearsig.gap.diagnose_gap", found.diagnose_gap)
    return found


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    return command(capsys, "gap", *arguments)


def copied(folder: Path, stem: str, **changes: object) -> Path:
    """Put the cracked sample into a folder, with a rig file beside it where there are changes."""
    path = folder / f"{stem}.h5"
    path.write_bytes(CRACKED.read_bytes())
    if changes:
        write_rig(replace(read_rig(RIG), **changes), path.with_suffix(".toml"))
    return path


@pytest.mark.slow
def test_it_prints_the_verdict_and_leaves_three_files(capsys, stub, tmp_path) -> None:
    folder = tmp_path / "new" / "gap"
    code, out, err = run(capsys, CRACKED, "--reference", HEALTHY, "-o", folder)
    assert code == 0
    lines = out.splitlines()
    assert lines[:4] == list(effect_report().verdict)
    assert str(folder / "gap.html") in lines[-2]
    assert f"--preset {folder / 'twin.toml'}" in lines[-1]
    assert "Note: The mean torque is the rig file's" in err
    assert sorted(p.name for p in folder.iterdir()) == NAMES
    assert sorted(p.name for p in folder.parent.iterdir()) == ["gap"]
    assert (folder / "twin.toml").read_text() == TWIN
    found = json.loads((folder / "gap.json").read_text())
    assert found["outcome"] == "effect"
    assert [r.provenance.source for r in stub.given["recordings"]] == [CRACKED.name]
    assert [r.provenance.source for r in stub.given["references"]] == [HEALTHY.name]
    assert stub.given["simulator"].name == "cracked"
    assert stub.given["recordings"][0].rig.operating_point.torque_nm == 110.0


def test_one_condition_is_told_of_what_a_second_would_give(capsys, stub, tmp_path) -> None:
    stub.answer = cannot_separate_report
    code, out, _ = run(capsys, CRACKED, "-o", tmp_path / "gap")
    assert code == 0
    assert out.splitlines()[4].startswith("One operating condition: ")
    assert "5.4 structural floors apart" in out


@pytest.mark.slow
def test_results_of_an_earlier_diagnosis_are_replaced_and_an_old_twin_goes(capsys, stub, tmp_path) -> None:
    folder = tmp_path / "gap"
    assert run(capsys, CRACKED, "-o", folder)[0] == 0
    stub.answer = no_gap_report
    assert run(capsys, CRACKED, "-o", folder)[0] == 0
    assert sorted(p.name for p in folder.iterdir()) == NAMES[:2]
    assert json.loads((folder / "gap.json").read_text())["outcome"] == "no gap"


@pytest.mark.parametrize("name", ["notes.txt", "gap.html", "twin.toml"])
def test_a_folder_with_foreign_files_is_refused_before_the_work(capsys, stub, tmp_path, name) -> None:
    (tmp_path / name).write_text("mine")
    code, out, err = run(capsys, CRACKED, "-o", tmp_path)
    assert (code, out) == (2, "")
    assert "do not belong to a gap diagnosis" in err
    assert not stub.given
    assert [p.name for p in tmp_path.iterdir()] == [name]


@pytest.mark.parametrize(
    "stop", [KeyboardInterrupt(), RefusalError("the rig has no teeth", remedy="give them"), InputError("wrong")]
)
def test_a_stop_leaves_nothing(capsys, stub, tmp_path, stop) -> None:
    def answer() -> GapReport:
        raise stop

    stub.answer = answer
    code, out, err = run(capsys, CRACKED, "-o", tmp_path / "deep" / "gap")
    assert code == (130 if isinstance(stop, KeyboardInterrupt) else 2)
    assert out == ""
    assert len(err.splitlines()) <= 2
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_a_failure_while_writing_leaves_what_was_there(tmp_path, monkeypatch) -> None:
    folder = tmp_path / "gap"
    write_results(with_few_curves(effect_report()), folder)
    before = {p.name: p.read_bytes() for p in folder.iterdir()}

    def fail(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("app.gap_job.write_gap_json", fail)
    with pytest.raises(KeyboardInterrupt):
        write_results(with_few_curves(no_gap_report()), folder)
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before
    assert [p.name for p in tmp_path.iterdir()] == ["gap"]


@pytest.mark.slow
def test_the_folder_one_is_in_may_be_given(tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    check_folder(Path())
    write_results(with_few_curves(effect_report()), Path())
    assert sorted(p.name for p in Path.cwd().iterdir()) == NAMES
    check_folder(Path())


@pytest.mark.parametrize("place", ["file", "file/deep"])
def test_a_folder_that_cannot_be_is_refused(tmp_path, place) -> None:
    (tmp_path / "file").write_text("x")
    with pytest.raises(InputError, match=r"-o"):
        check_folder(tmp_path / place)


def test_a_folder_that_nothing_can_be_made_in_is_refused() -> None:
    with pytest.raises(InputError, match=r"/proc/nosuch.*cannot be written.*-o"):
        check_folder(Path("/proc/nosuch"))


def test_a_rig_file_beside_a_recording_overrides_speed_and_torque(tmp_path) -> None:
    slow = copied(tmp_path, "slow", operating_point=OperatingPoint("input", 300.0, 5.0, 40.0))
    half = copied(tmp_path, "half", operating_point=OperatingPoint("input", 250.0))
    bare = copied(tmp_path, "bare")
    inputs = read_gap_inputs(GapRequest((slow, half, bare), rig=RIG))
    rigs = [recording.rig for recording in inputs.recordings]
    points = [(rig.operating_point.speed_rpm, rig.operating_point.torque_nm) for rig in rigs]
    assert points == [(300.0, 40.0), (250.0, 110.0), (500.0, 110.0)]
    assert all(rig.pairs == rigs[0].pairs for rig in rigs)


def test_without_a_rig_those_beside_are_taken(tmp_path) -> None:
    inputs = read_gap_inputs(GapRequest((CRACKED,), (HEALTHY,), run_up=HEALTHY.with_name("root_crack_2mm.h5")))
    assert inputs.run_up.name == "root_crack_2mm.h5"
    assert inputs.recordings[0].rig.name == read_rig(RIG).name
    assert [reference.rig.name for reference in inputs.references] == [read_rig(HEALTHY.with_suffix(".toml")).name]
    with pytest.raises(InputError, match="--rig"):
        read_gap_inputs(GapRequest((copied(tmp_path, "bare"),)))


def test_torques_are_one_for_all_or_one_for_each(tmp_path) -> None:
    one, two = copied(tmp_path, "one"), copied(tmp_path, "two")

    def torques(*stated: float) -> list[float | None]:
        inputs = read_gap_inputs(GapRequest((one, two), (HEALTHY,), RIG, stated))
        return [r.rig.operating_point.torque_nm for r in (*inputs.recordings, *inputs.references)]

    assert torques() == [110.0, 110.0, 110.0]
    assert torques(60.0) == [60.0, 60.0, 60.0]
    assert torques(60.0, 80.0) == [60.0, 80.0, 110.0]
    with pytest.raises(InputError, match="3 torques are given for 2 recordings"):
        torques(1.0, 2.0, 3.0)


def rig_with(**changes: object) -> dict[str, object]:
    pair = read_rig(RIG).pairs[0]
    return {"pairs": (replace(pair, **changes),)}


@pytest.mark.parametrize(
    ("changes", "what"),
    [
        (rig_with(driver_teeth=54), "teeth 54/75, elsewhere 55/75"),
        (rig_with(module_mm=3.0), "module of pair 1 3 mm, elsewhere 2 mm"),
        ({"bearings": (Bearing("bearing 1", "input", 8, 7.94, 39.04),)}, "orders of bearing 'bearing 1'"),
    ],
)
def test_recordings_of_different_rigs_are_refused(tmp_path, changes, what) -> None:
    other = copied(tmp_path, "other", **changes)
    for request in (
        GapRequest((CRACKED, other), rig=RIG),
        GapRequest((CRACKED, other)),
        GapRequest((CRACKED,), (other,)),
    ):
        with pytest.raises(InputError) as refused:
            read_gap_inputs(request)
        assert what in str(refused.value)
        assert "other.h5" in str(refused.value)


def test_what_a_rig_file_does_not_say_is_no_difference(tmp_path) -> None:
    own = copied(tmp_path, "own", bearings=(), **rig_with(module_mm=None, face_width_mm=None))
    assert read_gap_inputs(GapRequest((own,), rig=RIG)).recordings[0].rig.bearings


def test_files_given_twice_are_refused() -> None:
    with pytest.raises(InputError, match="twice"):
        read_gap_inputs(GapRequest((CRACKED, CRACKED)))
    with pytest.raises(InputError, match="its own healthy reference"):
        read_gap_inputs(GapRequest((CRACKED,), (CRACKED,)))
    with pytest.raises(InputError, match="twice"):
        read_gap_inputs(GapRequest((CRACKED,), (HEALTHY,), run_up=HEALTHY))


def test_names_of_equal_files_in_different_folders_stay_apart(tmp_path) -> None:
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    paths = tuple(copied(tmp_path / name, "run") for name in ("a", "b"))
    inputs = read_gap_inputs(GapRequest(paths, rig=RIG))
    assert [recording.name for recording in inputs.recordings] == ["a/run.h5", "b/run.h5"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((CRACKED,), "-o DIR"),
        (("-o", "{folder}"), "no recording is given"),
        ((CRACKED, "-o", "{folder}", "--model", "craked"), "did you mean cracked?"),
        (("missing.h5", "--rig", RIG, "-o", "{folder}"), "missing.h5"),
        ((CRACKED, "-o", "{folder}", "--torque", "5mm"), "torque"),
        ((CRACKED, "-o", "{folder}", "--torque", "-3Nm"), "torque"),
    ],
)
@pytest.mark.usefixtures("stub")
def test_bad_input_is_one_line(capsys, tmp_path, arguments, said) -> None:
    code, out, err = run(capsys, *(str(a).format(folder=tmp_path / "gap") for a in arguments))
    assert (code, out) == (2, "")
    assert said in err
    assert len(err.splitlines()) <= 2  # the rig file that was found may be told
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_the_cache_is_the_users_own_or_a_given_one_and_can_be_made_anew(capsys, stub, tmp_path, monkeypatch) -> None:
    monkeypatch.delenv("GEARSIG_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    run(capsys, CRACKED, "-o", tmp_path / "gap")
    assert stub.given["cache"] == cache_folder("gap") == tmp_path / "cache" / "gearsig" / "gap"
    assert not stub.given["fresh"]
    run(capsys, CRACKED, "-o", tmp_path / "gap", "--cache", tmp_path / "mine")
    assert stub.given["cache"] == tmp_path / "mine"
    (tmp_path / "file").touch()
    _, _, err = run(capsys, CRACKED, "-o", tmp_path / "gap", "--cache", tmp_path / "file")
    assert "--cache" in err
    assert "-o" not in err.split()
    run(capsys, CRACKED, "-o", tmp_path / "gap", "--fresh")
    assert (stub.given["cache"], stub.given["fresh"]) == (cache_folder("gap"), True)


def test_an_effect_of_ones_own_is_listed_as_such(capsys, tmp_path, monkeypatch) -> None:
    from sims.effects import VARIABLE, effects

    monkeypatch.setenv(VARIABLE, "")
    file = tmp_path / "seal.py"
    file.write_text(
        "from sims.effects import Effect, Severity\n"
        "EFFECT = Effect('dry_seal', 'shaft', 'dry seal', Severity('x', 'N m', 0.0, 9.0, 1.0, ''), '', '', (), None)\n"
    )
    try:
        code, out, _ = run(capsys, "--effect-file", file, "--list-effects")
        assert (code, "dry_seal" in out, "your own" in out, "N·m" in out) == (0, True, True, True)
        code, _, err = run(capsys, "--effect-file", tmp_path / "none.py", "--list-effects")
        assert (code, len(err.splitlines())) == (2, 1)
    finally:
        monkeypatch.undo()
        effects.cache_clear()


def test_the_catalogue_is_listed(capsys) -> None:
    from sims.registry import gap_simulator

    code, out, _ = run(capsys, "--list-effects")
    assert code == 0
    for effect in gap_simulator("cracked").gap_effects().values():
        assert effect.name in out
        assert effect.group in out
    assert "envelope orders" in out
    assert "µm" in out
    assert max(map(len, out.splitlines())) <= 110
    assert "not recognised" not in out


def test_an_effect_that_was_not_learned_is_listed_as_such(capsys, monkeypatch) -> None:
    from gearsig.gap import load_learned

    learned = load_learned()
    fewer = replace(learned.classifiers[True], causes=("none", "tooth_wear"))
    only = replace(learned, classifiers={True: fewer, False: fewer})
    monkeypatch.setattr("gearsig.gap.load_learned", lambda: only)
    _, out, _ = run(capsys, "--list-effects")
    assert out.count("not recognised") == 18
    _, out, _ = run(capsys, "--list-effects", "--model", "forging")
    assert "not recognised" not in out


def test_a_file_that_is_not_there_is_told_before_its_rig(capsys, tmp_path) -> None:
    code, out, err = run(capsys, tmp_path / "missing.h5", "-o", tmp_path / "gap")
    assert (code, out, list(tmp_path.iterdir())) == (2, "", [])
    assert "there is no such file" in err


def test_a_rig_that_does_not_know_all_teeth_is_no_other_machine(tmp_path) -> None:
    path = copied(tmp_path, "now", name="of its own")
    rig = read_rig(RIG)
    partly = replace(rig, pairs=(replace(rig.pairs[0], driven_teeth=None),))
    write_rig(partly, tmp_path / "common.toml")
    (read,) = read_gap_inputs(GapRequest((path,), rig=tmp_path / "common.toml")).recordings
    assert read.rig.pairs[0].driven_teeth is None
