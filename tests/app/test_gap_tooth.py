"""A cracked tooth of a sample, diagnosed whole: kind, place, effect and depth."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from gearsig import diagnose_gap, read_recording, read_rig
from gearsig.gap import GapReport
from gearsig.report import gap_to_dict
from sims.cracked import cracked_gap_simulator

FOLDER = Path(__file__).parents[2] / "sample_data"
TRUE_MM, TRUE_TOOTH = 3.0, 21


@pytest.fixture(scope="module")
def report() -> GapReport:
    rig = read_rig(FOLDER / "root_crack_3mm.toml")
    cracked, healthy = (read_recording(FOLDER / f"root_crack_{mm}mm.h5", rig=rig) for mm in (3, 0))
    return diagnose_gap([cracked], cracked_gap_simulator(), references=[healthy])


@pytest.mark.slow
def test_a_tooth_is_damaged_and_the_twin_shows_how(report: GapReport) -> None:
    assert report.kind is not None
    assert report.kind.group == "tooth-local"
    assert report.kind.probability > 0.95
    assert report.causes[0].probability > 0.9
    assert f"tooth {TRUE_TOOTH} " in report.kind.place
    assert json.loads(json.dumps(gap_to_dict(report)))["kind"]["group"] == "tooth-local"


@pytest.mark.slow
def test_the_crack_is_likeliest_and_its_depth_is_that_of_the_crack_estimate(report: GapReport) -> None:
    crack = report.causes[0]
    assert crack.name == "root_crack"
    assert crack.severity is not None
    assert crack.severity.low <= TRUE_MM <= crack.severity.high
    assert crack.severity.value == pytest.approx(TRUE_MM, rel=0.2)
    assert crack.fitted is not None
    assert crack.fitted.severity == pytest.approx(crack.severity.value)
