"""What the fault laboratory computes: runs, marks, bands, files."""

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.dashboard.laboratory.run import (
    LaboratoryRun,
    affected_sides,
    bearing_lines_hz,
    entries,
    run_setup,
    spectrum_cursors,
    zipped,
)
from app.dashboard.laboratory.setup import Setup
from app.dashboard.laboratory.views import portrait, stiffness, telling_band_hz
from gearsig.errors import RefusalError
from gearsig.recording import Channel, Recording, read_recording
from gearsig.rig import read_rig
from sims.effects import EffectSetting, completed

SMOOTH = Setup("small_30_25", 1800.0, 20.0, (("roughness_um", 0.0),), duration_s=0.3, seed=3)


def with_effect(name: str, severity: float, **options: float | str) -> Setup:
    return replace(SMOOTH, effects=completed((EffectSetting(name, severity, options),)))


@pytest.fixture(scope="module")
def healthy() -> LaboratoryRun:
    return run_setup(SMOOTH)


@pytest.fixture(scope="module")
def cracked() -> LaboratoryRun:
    return run_setup(with_effect("root_crack", 1.5, tooth=8.0))


def test_the_recording_is_that_of_the_command_line(cracked: LaboratoryRun) -> None:
    """Sample by sample: the page must not show another machine than `gearsig simulate` writes."""
    same = cracked.setup.record()
    assert np.array_equal(cracked.recording.samples, same.samples)
    assert cracked.recording.channel_names == same.channel_names
    assert cracked.recording.warnings == same.warnings


def test_hum_leaves_the_motion_and_adds_its_lines_only(healthy: LaboratoryRun) -> None:
    hum = run_setup(with_effect("mains_hum", 2.0, harmonics_percent=0.0))
    for name in healthy.response.signals:
        assert np.array_equal(healthy.response[name], hum.response[name])
    added = hum.recording.values("a1") - healthy.recording.values("a1")
    assert float(np.sqrt(2.0 * np.mean(added**2))) == pytest.approx(2.0, rel=1e-3)  # 15 whole periods


def test_a_crack_shows_after_its_tooth_has_entered(healthy: LaboratoryRun, cracked: LaboratoryRun) -> None:
    """The twin differs by bursts that begin at the marked times, one revolution apart."""
    marks = np.array([cursor.position for cursor in entries(cracked)])
    assert len(marks) in (8, 9, 10)
    assert np.diff(marks) == pytest.approx(60.0 / 1800.0, rel=1e-3)
    time = cracked.response.time_s
    change = np.abs(cracked.response["transmission_error_m"] - healthy.response["transmission_error_m"])
    cycle = 60.0 / 1800.0 / 30.0
    for mark in marks[1:-1]:
        revolution = (time >= mark - 0.5 * cycle) & (time < mark + 29.5 * cycle)
        latest = time[revolution][np.argmax(change[revolution])] - mark
        assert 0.0 < latest < 2.5 * cycle


def test_a_crack_takes_stiffness_from_its_own_tooth_only(healthy: LaboratoryRun, cracked: LaboratoryRun) -> None:
    cycles = np.linspace(0.0, 30.0, 3001)
    ratio = stiffness(cracked, cycles) / stiffness(healthy, cycles)
    contact = 1.8  # above the contact ratio of 30/25 teeth
    meshing = (cycles > 6.9) & (cycles < 7.0 + contact)
    assert ratio[meshing].min() < 0.97
    assert ratio[~meshing] == pytest.approx(1.0, abs=1e-9)


def test_poincare_points_of_a_smooth_machine_fall_together(healthy: LaboratoryRun) -> None:
    y, v, y_points, v_points = portrait(healthy, "driver y", 30.0)
    n_periods = 0.3 * 1800.0 / 60.0 * 30.0
    assert len(y_points) == pytest.approx(n_periods, abs=1.5)
    assert np.ptp(y_points) < 0.1 * np.ptp(y)
    assert np.ptp(v_points) < 0.1 * np.ptp(v)


def test_bearing_lines_include_slip() -> None:
    """BPFO = n(1 − d/D)/2 less slip, BPFI more by as many passings."""
    n, ratio, turns = 9, 8.0 / 40.0, 30.0
    balls = (("n_balls", 9.0), ("ball_diameter_mm", 8.0), ("ball_pitch_diameter_mm", 40.0))
    outer = n * (1 - ratio) / 2
    setup = with_effect("bearing_outer_race", 1.0, slip_percent=2.0)
    found = bearing_lines_hz(run_setup(replace(setup, duration_s=0.05, parameters=balls)))
    assert found == {"BPFO bearing 1": pytest.approx(0.98 * outer * turns)}
    setup = with_effect("bearing_inner_race", 1.0, slip_percent=2.0, bearing="bearing 3")
    found = bearing_lines_hz(run_setup(replace(setup, duration_s=0.05, parameters=balls)))
    inner = n - outer + 0.02 * outer
    assert found == {"BPFI bearing 3": pytest.approx(inner * turns * 30 / 25)}


def test_marks_follow_the_effects(cracked: LaboratoryRun) -> None:
    mesh = [c.position for c in spectrum_cursors(cracked) if c.kind == "mesh"]
    assert mesh == pytest.approx([900.0 * k for k in range(1, 6)])
    assert affected_sides(cracked.setup) == ("driver",)
    sidebands = {round(c.position - 900.0, 6) for c in spectrum_cursors(cracked) if c.kind == "sideband"}
    assert {-30.0, 30.0} <= sidebands
    assert not any(abs(abs(s) - 36.0) < 1e-3 for s in sidebands)  # of the driven shaft, which the crack is not on
    assert affected_sides(with_effect("eccentricity", 10.0, gear="driven")) == ("driven",)
    assert affected_sides(SMOOTH) == ("driver", "driven")


def test_the_telling_band_is_where_the_carrier_is() -> None:
    rng, rate = np.random.default_rng(0), 20480.0
    time = np.arange(20480) / rate
    carrier = np.sin(2 * np.pi * 6000.0 * time) * (1 + 0.8 * np.cos(2 * np.pi * 40.0 * time))
    signal = carrier + 0.5 * rng.standard_normal(len(time))
    recording = Recording(signal[None], rate, (Channel("a1", "acceleration", "m/s^2"),))
    low, high = telling_band_hz(recording, "a1", [40.0])
    assert low < 6000.0 < high
    with pytest.raises(RefusalError):
        telling_band_hz(recording, "a1", [])


@pytest.mark.slow
def test_files_hold_recording_rig_and_truth(tmp_path: Path, cracked: LaboratoryRun) -> None:
    setup = cracked.setup
    content = zipped((setup, setup.healthy), ".h5")
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        archive.extractall(tmp_path)
    stem = "small_30_25_root_crack_1_5"
    names = {f"{s}{e}" for s in (stem, "small_30_25_healthy") for e in (".h5", ".toml", ".truth.json")}
    assert {path.name for path in tmp_path.iterdir()} == names
    recording = read_recording(tmp_path / f"{stem}.h5", rig=read_rig(tmp_path / f"{stem}.toml"))
    assert np.array_equal(recording.samples, cracked.recording.samples)
    truth = json.loads((tmp_path / f"{stem}.truth.json").read_text(encoding="utf-8"))
    assert [(e["name"], e["severity"], e["options"]["tooth"]) for e in truth["effects"]] == [("root_crack", 1.5, 8.0)]


def test_a_healthy_setup_is_written_once() -> None:
    with zipfile.ZipFile(io.BytesIO(zipped((SMOOTH, SMOOTH.healthy), ".csv"))) as archive:
        assert len(archive.namelist()) == 3
