"""gap.json keeps to its schema, loses nothing, and never holds what JSON does not know."""

import json
from dataclasses import fields, is_dataclass, replace
from math import inf, nan

import jsonschema
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.gap import Evidence, GapCause, GapOutcome, Interval
from gearsig.report import gap_schema, gap_to_dict, gap_to_json, write_gap_json
from tests.gap.example_report import all_reports, effect_report, shrinkage

REPORTS = all_reports()
VALIDATOR = jsonschema.Draft202012Validator(gap_schema())


def strict(text):
    def refuse(constant):
        raise AssertionError(f"{constant} is not JSON")

    return json.loads(text, parse_constant=refuse)


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(gap_schema())


@pytest.mark.parametrize("outcome", list(REPORTS))
def test_every_outcome_keeps_to_the_schema(outcome):
    found = strict(gap_to_json(REPORTS[outcome]))
    VALIDATOR.validate(found)
    assert found["outcome"] == REPORTS[outcome].outcome.value


def test_there_is_an_example_of_every_outcome():
    assert {report.outcome for report in REPORTS.values()} == set(GapOutcome)


def described(schema, found, path="$"):
    """Return members of a value that the schema does not name, and those without a description."""
    if "$ref" in schema:
        schema = {**gap_schema()["$defs"][schema["$ref"].rsplit("/", 1)[1]], "description": schema.get("description")}
    for choice in schema.get("anyOf", ()):
        if "$ref" in choice and found is not None:
            return described(choice, found, path)
    wrong = []
    if isinstance(found, dict) and "properties" in schema:
        for name, value in found.items():
            if name not in schema["properties"]:
                wrong.append(f"{path}.{name}")
            else:
                wrong += described(schema["properties"][name], value, f"{path}.{name}")
    if isinstance(found, list) and "items" in schema:
        wrong += [w for value in found[:3] for w in described(schema["items"], value, f"{path}[]")]
    return wrong


def test_the_schema_names_every_member_that_is_written():
    assert described(gap_schema(), gap_to_dict(effect_report())) == []


def numbers_and_texts(value):
    """Return all numbers and texts of a report, however deep."""
    if is_dataclass(value):
        return [x for f in fields(value) for x in numbers_and_texts(getattr(value, f.name))]
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, dict):
        return [x for pair in value.items() for item in pair for x in numbers_and_texts(item)]
    if isinstance(value, (list, tuple)):
        return [x for item in value for x in numbers_and_texts(item)]
    return [] if value is None or isinstance(value, bool) else [getattr(value, "value", value)]


def test_nothing_of_the_report_is_lost():
    report = effect_report()
    written = set(map(str, numbers_and_texts(gap_to_dict(report))))
    lost = [
        x for x in numbers_and_texts(report) if str(float(f"{x:.9g}") if isinstance(x, float) else x) not in written
    ]
    assert not [x for x in lost if str(int(x) if isinstance(x, float) and x == int(x) else x) not in written]


def test_names_that_others_rely_on():
    found = gap_to_dict(effect_report())
    assert (found["schema"], found["schema_version"]) == ("gearsig.gap", 3)
    first = found["causes"][0]
    assert (first["name"], first["probability"], first["severity"]["unit"]) == ("root_crack", 0.88, "mm")
    assert first["fitted"]["options"] == {"gear": "driver", "tooth": 21.0}
    assert found["places"][0]["tooth"] == 21
    assert found["verdict"]["which"].startswith("Which: a damaged tooth")
    assert found["conditions"][1]["speed_rpm"] == 1998.7
    assert found["next_recordings"][0]["distance_in_structural_floors"] == 5.4
    assert found["twin_toml"].startswith("[about]")


bad = st.sampled_from([nan, inf, -inf, 1e300, -0.0])


SHORT = replace(
    REPORTS["effect"],
    angles=(),
    averages=(),
    spectra=tuple(
        replace(s, **{f.name: getattr(s, f.name)[:4] for f in fields(s) if isinstance(getattr(s, f.name), np.ndarray)})
        for s in REPORTS["effect"].spectra[:1]
    ),
)


@settings(max_examples=25)
@given(bad, bad, bad)
def test_what_is_not_finite_becomes_null(a, b, c):
    report = SHORT
    cause = GapCause(
        "root_crack",
        "tooth-local",
        "crack",
        "mm",
        0.9,
        Interval(a, b, c),
        shrinkage=replace(shrinkage(a, b, c), slope=c, placebo=a),
        evidence=(Evidence("f", a, b, c, speaks_for=True),),
    )
    four = {name: values[:4] for name, values in vars(report.spectra[0]).items() if isinstance(values, np.ndarray)}
    curves = replace(report.spectra[0], **four | {"measured": np.full(4, a), "floor": np.full(4, b)})
    place = replace(report.places[0], change_db=a, structural=b, angle_deg=c, orders=(a, b))
    strange = replace(
        report,
        causes=(cause,),
        places=(place,),
        spectra=(curves,),
        angles=(),
        averages=(),
        size=Interval(a, b, c),
        repeatability=b,
    )
    found = strict(gap_to_json(strange))
    VALIDATOR.validate(found)
    finite = abs(a) < inf
    assert (found["size"]["value"] is None) == (not finite)
    assert (found["spectra"][0]["measured"][0] is None) == (not finite)


def test_no_text_can_break_it(tmp_path):
    evil = '"}\n</script> \u2028 é \x00'
    path = write_gap_json(effect_report(rig=evil), tmp_path / "deep" / "gap.json")
    assert strict(path.read_text(encoding="utf-8"))["rig"] == evil
    assert [p.name for p in path.parent.iterdir()] == ["gap.json"]


def test_the_schema_refuses_what_it_must():
    found = gap_to_dict(effect_report())
    for change in ({"schema_version": 1}, {"outcome": "perhaps"}, {"causes": None}, {"size": 7.9}):
        with pytest.raises(jsonschema.ValidationError):
            VALIDATOR.validate({**found, **change})
