"""A recording beside a reference: what belongs together, and by how much it has changed."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from gearsig.diagnosis.analyze import analyze
from gearsig.diagnosis.comparison import changes, rig_of_reference
from gearsig.diagnosis.types import Analysis, Kind
from gearsig.errors import InputError
from gearsig.rig.toml import write_rig
from sims.kinematic import BearingFault
from tests.diagnosis.machines import GOOD, RIG, codes, finding, record, teeth


@pytest.fixture(scope="module")
def louder() -> Analysis:
    """Analyse a recording that is the reference twice as loud."""
    recording = record()
    return analyze(replace(recording, samples=2.0 * recording.samples), reference=recording)


def test_twice_as_loud_is_6_db_in_levels_and_nothing_in_shapes(louder: Analysis) -> None:
    by_name = {
        (i.name, i.computed_on): c for i, c in zip(louder.indicators, changes(louder), strict=True) if c is not None
    }
    assert by_name["rms", "raw"].change_db == pytest.approx(20 * math.log10(2), abs=1e-6)
    assert by_name["kurtosis", "raw"].change_db == pytest.approx(0.0, abs=1e-6)
    assert by_name["rms", "raw"].reference_value == pytest.approx(
        next(i.value for i in louder.indicators if (i.name, i.computed_on) == ("rms", "raw")) / 2
    )


def test_levels_in_db_change_by_their_difference(louder: Analysis) -> None:
    pairs = [(i, c) for i, c in zip(louder.indicators, changes(louder), strict=True) if i.unit == "dB" and c]
    assert pairs
    assert all(c.change_db == pytest.approx(i.value - c.reference_value) for i, c in pairs)


def test_without_a_reference_nothing_is_compared() -> None:
    analysis = analyze(record())
    assert set(changes(analysis)) == {None}
    assert analysis.crack is None


def test_a_fault_says_whether_the_reference_shows_it() -> None:
    damaged = replace(GOOD, bearing_faults=(BearingFault("front", "outer", 12.0, 3000.0, 0.04, 0.01, 0.2),))
    new = analyze(record(damaged), reference=record(seed=1))
    assert codes(new, Kind.FAULT) == ["bearing-outer-race"]
    assert "The reference does not show it." in finding(new, "bearing-outer-race").evidence
    old = analyze(record(damaged), reference=record(damaged, seed=1))
    assert any(t.startswith("The reference shows it as well") for t in finding(old, "bearing-outer-race").evidence)


def test_a_reference_whose_own_rig_file_has_other_teeth_is_of_another_machine(tmp_path: Path) -> None:
    recording = tmp_path / "then.csv"
    recording.touch()
    assert rig_of_reference(recording, RIG) is RIG
    write_rig(teeth(20, 40), tmp_path / "then.toml")
    with pytest.raises(InputError, match="another machine: its rig file says teeth 20/40, the recording's 27/43"):
        rig_of_reference(recording, RIG)
    write_rig(replace(RIG, operating_point=replace(RIG.operating_point, torque_nm=70.0)), tmp_path / "then.toml")
    rig = rig_of_reference(recording, RIG)
    assert rig is not None
    assert rig.operating_point.torque_nm == 70.0
