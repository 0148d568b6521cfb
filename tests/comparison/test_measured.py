"""The comparison on a real gear pair, used in place; skipped where it is absent."""

from pathlib import Path

import pytest

from gearsig.comparison import compare
from gearsig.recording import read_recording
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft

DATA = Path(__file__).parents[3] / "shared" / "data" / "gear_pair_23_46"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured recordings are not here")
RIG = Rig(
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage", "input", "output", 23, 46),),
    operating_point=OperatingPoint("input", 2000.0),
)


def test_two_sensors_of_one_gear_pair_without_tachometer() -> None:
    one, other = (read_recording(DATA / f"3027_217_Data_Chan{n}.mat", rig=RIG) for n in (12, 14))
    found = compare(one, other)
    channel = found.channels[0]
    assert found.recorded.mean_speed_rpm == pytest.approx(1999.76, abs=0.05)
    mesh = [line for line in channel.lines if line.kind == "mesh"]
    assert all(line.is_seen for line in mesh)
    # The speed wanders by ± 0.02 %: unless its course is followed, the second harmonic repeats to some dB only.
    assert mesh[1].level.repeatability_db < 0.1
    assert channel.shafts[0].recorded_reliability > 0.99
    # The family beside the mesh at ± 5.15 orders turns with no shaft.
    assert any(abs(abs(line.order - 23) - 5.15) < 0.03 for line in channel.other_lines)
