"""Two halves of one recording, the first as the healthy reference of the second, are no gap and no crack."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gearsig.gap import (
    GapOutcome,
    attribute,
    conditions_of,
    diagnose_gap,
    twin_rig,
    with_stage,
    with_unknown_within_floor,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording, read_recording
from gearsig.rig import GearPair, OperatingPoint, Rig, Shaft, read_rig
from gearsig.severity import NoCrackSeen, estimate_crack
from sims.cracked import CrackedPair
from sims.effects import EffectSetting
from sims.machine import Operation
from sims.registry import gap_simulator
from sims.simulator import SimulationSetup
from tests.marks import further
from tests.measured import BY_NAME, needs_data
from tests.measured import RECORDINGS as MEASURED_RECORDINGS

ROOT = Path(__file__).parents[2]
MEASURED = ROOT.parent / "shared" / "data"
PAIR = Rig(
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage", "input", "output", 23, 46),),
    operating_point=OperatingPoint("input", 2000.0),
)
TWO_STAGES = Rig(
    shafts=(Shaft("input"), Shaft("middle"), Shaft("output")),
    pairs=(GearPair("first", "input", "middle", 32, 96), GearPair("second", "middle", "output", 32, 80)),
    operating_point=OperatingPoint("input", 1800.0),
    sampling_rate_hz=4266.7,
)


def sample(name: str) -> Recording:
    (path,) = (one for one in (ROOT / "sample_data").glob(f"{name}.*") if one.suffix != ".toml")
    return read_recording(path, rig=read_rig(ROOT / "sample_data" / f"{name}.toml"))


def measured(name: str, rig: Rig) -> Recording:
    if not MEASURED.is_dir():
        pytest.skip("the measured recordings are not here")
    recording = read_recording(MEASURED / name, rig=rig)
    channels = tuple(replace(channel, quantity="acceleration", unit="m/s^2") for channel in recording.channels)
    return replace(recording, channels=channels)  # accelerometers in an unknown unit


def halves(recording: Recording) -> tuple[Recording, Recording]:
    middle = recording.duration_s / 2.0
    first, second = recording.between(0.0, middle), recording.between(middle, recording.duration_s)
    return first.with_name("first half"), second.with_name("second half")


RECORDINGS = {
    "cracked sample": lambda: sample("root_crack_3mm"),
    "healthy sample": lambda: sample("healthy"),
    "measured pair, channel 12": lambda: measured("gear_pair_23_46/3027_217_Data_Chan12.mat", PAIR),
    "measured pair, channel 14": lambda: measured("gear_pair_23_46/3027_217_Data_Chan14.mat", PAIR),
    "measured gearbox, healthy": lambda: measured(next_file("h"), with_stage(TWO_STAGES, "first")),
    "measured gearbox, broken tooth": lambda: measured(next_file("b"), with_stage(TWO_STAGES, "second")),
    "measured gearbox, healthy, second stage": lambda: measured(next_file("h"), with_stage(TWO_STAGES, "second")),
    "measured gearbox, broken tooth, first stage": lambda: measured(next_file("b"), with_stage(TWO_STAGES, "first")),
}


def next_file(start: str) -> str:
    found = sorted((MEASURED / "two_stage_gearbox").glob(f"{start}*.csv.gz"))
    if not found:
        pytest.skip("the measured recordings are not here")
    return f"two_stage_gearbox/{found[0].name}"


# Two without damage and one with it; the others take two minutes more.
QUICK = {"cracked sample", "healthy sample", "measured gearbox, healthy"}


@pytest.mark.slow
@pytest.mark.parametrize("name", [name if name in QUICK else further(name) for name in RECORDINGS])
def test_two_halves_of_one_recording_are_no_gap(name: str) -> None:
    assert_no_gap(*halves(RECORDINGS[name]()))


def assert_no_gap(first: Recording, second: Recording) -> None:
    """Without trials, which take most of the time."""
    assert first.rig is not None
    simulator = gap_simulator("cracked")
    twin = simulator.twin_of(twin_rig(first.rig)[0])
    conditions, _ = conditions_of([PreparedRecording(second)], [PreparedRecording(first)], twin)
    found = attribute(conditions, simulator.gap_effects(), (), twin, None, lambda *_: None, max_tried=0)
    probabilities = with_unknown_within_floor(found.probabilities(), conditions[0].size.structural)
    assert found.outcome(probabilities) is GapOutcome.NO_GAP, (conditions[0].size, list(probabilities)[:3])


@pytest.mark.parametrize("name", list(RECORDINGS)[:4])
def test_two_halves_of_one_recording_have_no_crack(name: str) -> None:
    first, second = halves(RECORDINGS[name]())
    assert first.rig is not None
    known = first.rig.pairs[0]
    pair = replace(known, module_mm=known.module_mm or 2.0, face_width_mm=known.face_width_mm or 20.0)
    rig = replace(first.rig, pairs=(pair,), operating_point=replace(first.rig.operating_point, torque_nm=50.0))
    assert isinstance(estimate_crack(second.with_rig(rig), reference=first.with_rig(rig)), NoCrackSeen)


@pytest.mark.slow
@pytest.mark.parametrize("fault", [("chipped_tooth", 2.0, 1), ("tooth_spall", 4.0, 4)], ids=lambda fault: fault[0])
def test_two_halves_of_a_damaged_machine_are_no_gap_and_have_no_crack(fault: tuple[str, float, int]) -> None:
    """What its halves differ by stands out at the damaged tooth, but is weaker than that of the shallowest crack."""
    effect, severity, seed = fault
    setup = SimulationSetup("published_55_75", {}, [EffectSetting(effect, severity)], Operation.steady(900.0, 110.0))
    rng = np.random.default_rng(seed)
    first, second = halves(CrackedPair().simulate(setup, rng, sampling_rate_hz=20480.0, duration_s=4.0))
    assert isinstance(estimate_crack(second, reference=first), NoCrackSeen)
    assert_no_gap(first, second)


GEARLESS = [one.name for one in MEASURED_RECORDINGS if one.rig is not None and not one.rig.pairs]


@pytest.mark.slow
@needs_data
@pytest.mark.parametrize(
    "name", [name if "unbalance" in name or "OR007" in name else further(name) for name in GEARLESS]
)
def test_two_halves_of_one_recording_without_gears_are_no_gap(name: str) -> None:
    """A damaged machine is no healthy reference: it is said to be none, and not compared with."""
    parts = halves(BY_NAME[name].read())
    for reference, part in (parts, parts[::-1]):
        report = diagnose_gap([part], gap_simulator("cracked"), references=[reference])
        if report.references:
            assert report.outcome is GapOutcome.NO_GAP, report.places
        else:
            assert any("not healthy" in notice for notice in report.notes)
