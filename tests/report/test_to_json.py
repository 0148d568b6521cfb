import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.formatting import readable, rounded
from gearsig.report import analysis_to_dict, analysis_to_json, write_json

MEMBERS = [
    "schema", "schema_version", "gearsig_version", "outcome", "verdict", "findings", "speed", "indicators", "recording",
    "rig", "channels", "settings", "crack", "reference", "level_changes",
]  # fmt: skip
FINDING = ["code", "kind", "title", "where", "strength", "confidence", "confidence_basis", "evidence", "surer"]
RECORDING = [
    "source", "sha256", "reader", "history", "warnings", "sampling_rate_hz", "n_samples", "duration_s", "channels",
    "speed_source",
]  # fmt: skip
SPEED = [
    "known", "shaft", "method", "mean_rpm", "lowest_rpm", "highest_rpm", "relative_uncertainty", "quality",
    "n_revolutions", "notes",
]  # fmt: skip


def _strict(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_schema_names_stay(gearbox):
    found = _strict(analysis_to_json(gearbox))
    assert list(found) == MEMBERS
    assert (found["schema"], found["schema_version"]) == ("gearsig.analysis", 1)
    assert all(list(finding) == FINDING for finding in found["findings"])
    assert list(found["recording"]) == RECORDING
    assert list(found["speed"]) == SPEED


def test_values_arrive(gearbox):
    found = _strict(analysis_to_json(gearbox))
    first = found["findings"][0]
    assert first["kind"] == "fault"
    assert first["where"]["tooth"] == 17
    assert first["where"]["channels"] == ["a1", "a2"]
    assert first["strength"]["ratio_db"] == 18.6
    assert found["recording"]["sampling_rate_hz"] == 25_600.0
    assert found["rig"]["pairs"][0]["driver_teeth"] == 23
    assert found["settings"]["window"] is None


def test_undefined_indicator_is_null(gearbox):
    values = [i["value"] for i in analysis_to_dict(gearbox)["indicators"] if i["name"] == "NA4"]
    assert values == [None, None, None]


def test_arrays_come_only_when_asked_for(gearbox_with):
    analysis = gearbox_with(["a"], "rig")
    short, long = analysis_to_dict(analysis), _strict(analysis_to_json(analysis, arrays=True))
    assert short["channels"][0]["spectrum"]["values"] == {"shape": [2000]}
    np.testing.assert_allclose(
        long["channels"][0]["spectrum"]["values"], analysis.channels[0].spectrum.values, rtol=1e-8
    )
    assert len(long["channels"][0]["order_map"]["values"]) == 120


def test_no_answer_is_an_object_of_its_own(cannot_tell):
    found = _strict(analysis_to_json(cannot_tell))
    assert list(found["speed"]) == ["known", "question", "reason", "remedy"]
    assert found["speed"]["known"] is False
    assert found["rig"] is None
    assert found["channels"] == []


def test_no_text_of_a_file_can_break_the_json(cannot_tell, tmp_path):
    analysis = replace(cannot_tell, verdict='"}\n</script> \u2028 é')
    path = write_json(analysis, tmp_path / "deep" / "x.json")
    assert _strict(path.read_text(encoding="utf-8"))["verdict"] == analysis.verdict


@given(st.floats())
def test_rounded_numbers_are_json_and_close(value):
    found = rounded(value)
    if np.isfinite(value):
        assert found == pytest.approx(value, rel=1e-8)
    else:
        assert found is None


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_readable_numbers_read_back(value):
    assert float(readable(value, 6).replace("−", "-")) == pytest.approx(value, rel=1e-5)
