"""Why a reference that was given could not be used is said wherever an analysis is read."""

import json
from dataclasses import replace

import pytest

from gearsig.diagnosis import Analysis, analyze
from gearsig.report import analysis_text, analysis_to_json, page_html
from tests.diagnosis.machines import RIG, record

REASON = "The depth of a root crack cannot be told: the rig file does not give torque_nm"
SIZED = replace(RIG, pairs=tuple(replace(pair, module_mm=2.0, face_width_mm=20.0) for pair in RIG.pairs))


@pytest.fixture(scope="module")
def analysis() -> Analysis:
    """Analyse a healthy gearbox, of whose torque nothing is known, against a reference."""
    return analyze(record(rig=SIZED), reference=record(rig=SIZED, seed=1))


def test_terminal_page_and_json_say_why(analysis: Analysis) -> None:
    assert REASON in analysis.verdict
    head = " ".join(analysis_text(analysis).partition(" 1. ")[0].split())
    assert REASON in head
    assert REASON in page_html(analysis).partition("<h2>")[0]
    told = json.loads(analysis_to_json(analysis))
    assert REASON in told["verdict"]
    assert told["crack"]["reason"].startswith("the rig file does not give torque_nm")


def test_nobody_asks_for_the_reference_that_was_given(analysis: Analysis) -> None:
    without = " ".join(f.surer for f in analyze(record()).findings)
    assert "earlier recording" in without or "gearbox when it was healthy" in without
    for text in [analysis.verdict, *(f.surer for f in analysis.findings)]:
        for wish in ("earlier recording", "when it was healthy", "when they were healthy", "known to be healthy"):
            assert wish not in text
