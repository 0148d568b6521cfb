"""`gearsig gap --model forging`: from files to the report; recordings that are for another model are refused."""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from app.cli.main import main
from app.samples import sample_folder
from gearsig.errors import InputError
from gearsig.gap import NONE, AddedEffect, GapOutcome, diagnose_gap
from gearsig.gap.start_stop import TRIED, compare_drive, read_cycles
from gearsig.recording import write_recording
from gearsig.report import gap_schema, read_gap_json
from gearsig.rig import write_rig
from sims import simulate
from sims.forging import ForgingManipulator
from sims.registry import gap_simulator, gap_simulators

SIMULATOR = ForgingManipulator()


def run(arguments: list[str]) -> int:
    """Run the command line; return its exit code."""
    with pytest.raises(SystemExit) as end:
        main(arguments)
    return int(end.value.code or 0)


@cache
def made(seed: int, *effects: tuple[str, float], mode: str = "start-stop", **parameters: float):
    parameters = {"mode": mode, **parameters}
    return simulate(
        "forging",
        effects=dict(effects) or None,
        parameters=parameters,
        duration_s=12.0,
        sampling_rate_hz=1000.0,
        seed=seed,
    )


def written(recording, path: Path) -> str:
    write_recording(recording, path)
    write_rig(recording.rig, path.with_suffix(".toml"))
    return str(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    place = tmp_path_factory.mktemp("drives")
    written(made(1), place / "healthy.h5")
    written(made(2, ("backlash", 120.0)), place / "wide.h5")
    written(made(1, mode="continuous"), place / "continuous.h5")
    written(made(1, drag_nm=200.0), place / "stands.h5")
    return place


def diagnosed(recording, reference=None):
    references = [] if reference is None else [reference]
    return diagnose_gap([recording.with_name("now")], SIMULATOR, references=references)


@pytest.mark.slow
def test_more_play_is_named_measured_and_simulated_again(folder, tmp_path, capsys):
    out = tmp_path / "gap"
    files = [str(folder / "wide.h5"), "--reference", str(folder / "healthy.h5")]
    assert run(["gap", *files, "--model", "forging", "-o", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Which: more backlash" in said
    found = json.loads((out / "gap.json").read_text())
    jsonschema.Draft202012Validator(gap_schema()).validate(found)
    report = read_gap_json(out / "gap.json")
    cause = report.causes[0]
    assert (report.outcome, cause.name) == (GapOutcome.EFFECT, "backlash")
    assert cause.severity.low < 120.0 < cause.severity.high
    assert cause.shrinkage.shrink.value > 0.9
    before, after = report.steps
    assert (before.label, after.label) == ("before", "more backlash")
    assert after.remaining.value < 0.3 * before.remaining.value
    assert report.places[0].title.startswith("where the drive stops and the back flank takes over: play 420")
    again = tmp_path / "twin.h5"
    assert run(["simulate", "forging", "--preset", str(out / "twin.toml"), "--duration", "9s", "-o", str(again)]) == 0
    truth = json.loads(again.with_suffix(".truth.json").read_text())
    assert truth["backlash_um"] == pytest.approx(420.0, rel=0.05)


@pytest.mark.slow
def test_a_heavier_load_is_named_by_its_own_name():
    report = diagnosed(made(3, wheel_inertia_kg_m2=80.0), made(4))
    assert report.causes[0].name == "load_inertia"
    assert report.causes[0].severity.value == pytest.approx(100 * 38 / 45.2625, rel=0.15)
    assert report.references == (made(4).name,)


@pytest.mark.slow
def test_a_healthy_drive_has_no_gap_and_it_is_said_what_would_not_show():
    """A crack that would not stand out of the other teeth is named with its depth."""
    report = diagnosed(made(5), made(6))
    assert report.outcome is GapOutcome.NO_GAP
    assert report.causes[0].name == NONE
    assert not report.twin_toml
    assert report.steps == ()
    assert report.verdict[2] == "How far: no effect was added."
    told = next(text for text in report.notes if "would not show" in text)
    depth = float(told.partition("crack in a tooth root below ")[2].split()[0])
    assert 1.0 < depth < 8.0
    assert "more backlash below" in told


WITHOUT_TORQUE = {name for name, tried in TRIED.items() if not tried.needs_torque}


def without_torque(recording):
    """Keep the angles only."""
    kept = [i for i, c in enumerate(recording.channels) if c.quantity == "angle"]
    channels = tuple(recording.channels[i] for i in kept)
    names = {c.name for c in channels}
    rig = replace(recording.rig, sensors=tuple(s for s in recording.rig.sensors if s.channel in names))
    return replace(recording, samples=recording.samples[kept], channels=channels, rig=rig, truth=None)


def test_without_torque_the_play_can_still_be_told():
    now, healthy = made(7, ("backlash", 150.0)), made(8)
    report = diagnosed(without_torque(now), without_torque(healthy))
    ranked = [c.name for c in report.causes if c.severity is not None]
    assert set(ranked) == WITHOUT_TORQUE
    assert any("no torque was recorded in now" in notice for notice in report.notes)
    assert report.causes[0].name == "backlash"


@pytest.mark.slow
def test_a_second_recording_without_torque_is_told_about():
    """Causes are weighed on all recordings, so that what one of them cannot tell is weighed on none."""
    first, second = made(7, ("backlash", 150.0)), without_torque(made(8, ("backlash", 150.0)))
    report = diagnose_gap([first.with_name("first"), second.with_name("second")], SIMULATOR, references=[made(9)])
    assert {c.name for c in report.causes if c.severity is not None} == WITHOUT_TORQUE
    told = next(text for text in report.notes if text.startswith("Not considered, because no torque was recorded in"))
    assert "crack in a tooth root" in told


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["{folder}/wide.h5", "--model", "cracked"], "--model forging"),
        (["{folder}/continuous.h5", "--model", "forging"], "turns all the time"),
        (["{samples}/root_crack_3mm.h5", "--model", "forging"], "--model cracked"),
        (["{folder}/wide.h5", "--model", "forgin"], "forging"),
        (["{folder}/stands.h5", "--model", "forging"], "the machine stands"),
    ],
)
def test_a_recording_for_another_model_is_one_clear_line(folder, tmp_path, capsys, arguments, words):
    filled = [text.format(folder=folder, samples=sample_folder()) for text in arguments]
    assert run(["gap", *filled, "-o", str(tmp_path / "gap")]) == 2
    said = capsys.readouterr().err.strip()
    assert words in said
    assert not (tmp_path / "gap").exists()


def test_models_and_their_effects_are_known():
    assert tuple(gap_simulators()) == ("cracked", "reduced-fe", "forging")
    assert set(SIMULATOR.gap_effects()) == set(TRIED)
    with pytest.raises(InputError, match="cracked"):
        gap_simulator("craked")


@pytest.fixture(scope="module")
def by_its_rig():
    """A drive that is simulated by the rig of a recording."""
    return compare_drive(read_cycles(made(9)), [], SIMULATOR).drive


def test_worn_flanks_touch_later_where_they_slide_most(by_its_rig):
    twin = by_its_rig.twin
    curve = twin.worn_curve_um(20.0, 60.0, 20)
    assert np.all(curve >= -1e-6)
    assert np.max(curve) < 60.0
    assert np.ptp(curve) > 5.0
    assert twin.worn_curve_um(20.0, 0.0, 20) == pytest.approx(np.zeros(len(curve)), abs=1e-6)


@pytest.mark.parametrize("depth_um", [30.0, 120.0])
def test_a_worn_drive_runs_as_its_teeth_at_rest_say(by_its_rig, depth_um):
    """The course of the compression from the balance of forces of two worn pairs, against the drive in motion."""
    drive = by_its_rig
    worn = drive.features(AddedEffect("tooth_wear", depth_um, {"gear": "driver"}))
    healthy, expected = drive.healthy, drive.worn_curve_um(depth_um)
    known = np.isfinite(worn.curve_um) & np.isfinite(healthy.curve_um)
    found = (worn.curve_um - healthy.curve_um)[known]
    assert found - found.mean() == pytest.approx(expected[known] - expected[known].mean(), abs=1.5)
    assert np.ptp(found) > 5.0
    assert worn.play_um - healthy.play_um == pytest.approx(expected.mean(), abs=1.5)


@pytest.mark.slow
def test_a_sensor_that_misreads_is_not_taken_for_another_load():
    first = diagnosed(made(2, torque_gain=0.8), made(1)).causes[0]
    assert first.name == "torque_gain"
    assert first.severity.value == pytest.approx(-20.0, rel=0.15)


def without_force(recording):
    """Leave out the channel of the model that no sensor measures: it would tell a misread torque by itself."""
    return recording.select([name for name in recording.channel_names if name != "interaction force"])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("parameters", "name"), [({"torque_gain": 1.4}, "torque_gain"), ({"piece_mass_kg": 2500.0}, "load_inertia")]
)
def test_without_a_reference_another_load_and_another_reading_are_not_taken_for_each_other(parameters, name):
    """Only what the teeth yield tells them apart then: either the right one is named, or both."""
    answer = diagnosed(without_force(replace(made(2, **parameters), rig=made(1).rig)))
    if answer.outcome is GapOutcome.EFFECT:
        assert answer.causes[0].name == name
    else:
        assert answer.outcome is GapOutcome.CANNOT_SEPARATE
        assert set(answer.inseparable) == {"torque_gain", "load_inertia"}
