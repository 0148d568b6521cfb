"""What gap.json says comes back as the report that it was written of."""

import json
from dataclasses import asdict, replace
from math import nan

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.report import gap_from_dict, gap_to_dict, read_gap_json, write_gap_json
from tests.gap.example_report import all_reports, effect_report

REPORTS = all_reports()


@pytest.mark.parametrize("outcome", list(REPORTS))
def test_there_and_back(outcome, tmp_path):
    report = REPORTS[outcome]
    again = read_gap_json(write_gap_json(report, tmp_path / "gap.json"))
    plain = {"spectra": (), "angles": (), "averages": ()}
    np.testing.assert_equal(asdict(replace(again, **plain)), asdict(replace(report, **plain)))
    for one, other in zip((*again.spectra, *again.angles), (*report.spectra, *report.angles), strict=True):
        np.testing.assert_allclose(one.measured, other.measured, rtol=1e-8)
        np.testing.assert_allclose(one.after, other.after, rtol=1e-8)
    for one, other in zip((*again.spectra, *again.averages), (*report.spectra, *report.averages), strict=True):
        np.testing.assert_allclose(one.reference, other.reference, rtol=1e-8)
    assert gap_to_dict(again) == gap_to_dict(report)


def test_reports_of_earlier_versions_have_no_reference_curves():
    found = gap_to_dict(effect_report())
    del found["averages"], found["warnings"]
    for curves in found["spectra"]:
        for name in ("reference", "reference_floor", "reference_structural_floor_db"):
            del curves[name]
    for cause in found["causes"]:
        for one in cause["evidence"]:
            del one["is_further"]
    again = gap_from_dict(found)
    assert again.averages == again.warnings == ()
    assert not any(len(curves.reference) for curves in again.spectra)
    assert not any(one.is_further for cause in again.causes for one in cause.evidence)


OF_VERSION_2 = {"remaining": "left"}
OF_VERSION_1 = {**OF_VERSION_2, "warnings": "doubts", "predicted": "foretold"}


@pytest.mark.parametrize(("version", "names"), [(1, OF_VERSION_1), (2, OF_VERSION_2)])
def test_reports_of_earlier_versions_call_some_members_otherwise(tmp_path, version, names):
    report = replace(effect_report(), warnings=("check the rig",))

    def renamed(content, within=""):
        if isinstance(content, list):
            return [renamed(member, within) for member in content]
        if not isinstance(content, dict):
            return content
        notes = "remarks" if within == "causes" else "notices"
        return {{**names, "notes": notes}.get(k, k): renamed(member, k) for k, member in content.items()}

    found = {**renamed(gap_to_dict(report)), "schema_version": version}
    assert "notices" in found
    (tmp_path / "gap.json").write_text(json.dumps(found))
    assert gap_to_dict(read_gap_json(tmp_path / "gap.json")) == gap_to_dict(report)


def test_null_is_nan():
    again = gap_from_dict(gap_to_dict(replace(effect_report(), repeatability=nan)))
    assert np.isnan(again.repeatability)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        pytest.param(("size", "value"), 10**400, r"report\.size\.value is too large", id="too large"),
        (("size", "low"), "7", r"report\.size\.low is '7', not number or null"),
        (("rig",), ["a"], r"report\.rig is \['a'\], not string"),
        (("notes",), "abc", "report.notes is 'abc', not array"),
        (("notes", 0), 3, r"report\.notes\[0\] is 3, not string"),
        (("groups", "unknown"), "much", "report.groups.unknown is 'much'"),
        (("places", 0, "tooth"), "<b>", r"report\.places\[0\]\.tooth is '<b>', not integer or null"),
        (("places", 0, "tooth"), True, r"tooth is True"),
        (("places", 0, "follows"), "yes", "follows is 'yes', not boolean"),
        (("places", 0, "band_hz"), [], r"report\.places\[0\]\.band_hz has 0 values, not 2"),
        (("causes", 0, "severity"), 3, r"severity is 3, not object"),
        pytest.param(("angles", 0, "n_teeth"), "x" * 10_000, r"n_teeth is 'x+\.\.\.x+', not integer", id="too long"),
        (("spectra", 0, "orders", 1), {}, r"report\.spectra\[0\]\.orders\[1\] is {}"),
    ],
)
def test_what_is_not_of_its_type_is_named(tmp_path, path, value, said):
    found = gap_to_dict(effect_report())
    *way, last = path
    part = found
    for key in way:
        part = part[key]
    part[last] = value
    (tmp_path / "gap.json").write_text(json.dumps(found))
    with pytest.raises(InputError, match=rf"gap\.json: is damaged or not complete .*{said}"):
        read_gap_json(tmp_path / "gap.json")


def test_members_that_later_versions_add_are_passed_over(tmp_path):
    deep = json.loads('{"x":' * 300 + "1" + "}" * 300)
    (tmp_path / "gap.json").write_text(json.dumps({**gap_to_dict(effect_report()), "another": deep}))
    assert read_gap_json(tmp_path / "gap.json").rig == effect_report().rig


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"schema": "gearsig.gap", "schema_version": 4}',
        '{"schema": "gearsig.gap", "schema_version": 3}',
        "[" * 100_000,
    ],
)
def test_what_is_no_report_is_refused(tmp_path, text):
    path = tmp_path / "gap.json"
    path.write_text(text)
    with pytest.raises(InputError, match=r"gap\.json"):
        read_gap_json(path)
