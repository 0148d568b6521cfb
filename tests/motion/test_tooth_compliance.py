"""A cracked tooth in a drive that starts and stops: by how much it yields, and that a healthy one is left alone."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import analyze
from gearsig.errors import RefusalError
from gearsig.motion import measure_motion, tooth_compliance
from gearsig.recording import Recording
from sims import simulate
from sims.effects import EffectSetting
from sims.forging import ForgingManipulator, build_rig, record, sensors
from sims.machine import WeakTooth
from sims.simulator import ParameterValues, SimulationSetup
from tests.motion.recordings import start_stop, without


def cracked(
    depth_mm: float, preset: str, mode: str, seed: int = 0, tooth: int = 7, slow: str = "instants"
) -> Recording:
    return simulate(
        "forging",
        preset=preset,
        parameters={"mode": mode, "slow_channels": slow},
        effects=[EffectSetting("root_crack", depth_mm, {"tooth": tooth})],
        duration_s=12.0,
        sampling_rate_hz=1000.0,
        seed=seed,
    )


@pytest.mark.parametrize("part", [0.4, 2.0])
def test_the_min_loss_parts_what_shows_from_what_does_not(part: float) -> None:
    """A tooth that has lost two fifths of it is not named, one that has lost twice as much is."""
    healthy = tooth_compliance(measure_motion(cracked(0.0, "manipulator_formula", "start-stop")))
    prepared = ForgingManipulator().prepare(SimulationSetup("manipulator_formula"))
    drive = replace(prepared.drive, weak_tooth=WeakTooth(0, 6, part * healthy.min_loss(1.5)))
    wanted = ParameterValues(prepared.values)
    recording = record(
        drive,
        prepared.profiles(13.0),
        wanted,
        rig=build_rig(drive, wanted, prepared.operation, sensors(1000.0)),
        rng=np.random.default_rng(0),
        sampling_rate_hz=1000.0,
        duration_s=12.0,
        truth={},
    )
    assert tooth_compliance(measure_motion(recording)).weak_teeth == ((7,) if part > 1.0 else ())


@pytest.mark.parametrize("preset", ["manipulator_formula", "manipulator_table"])
@pytest.mark.parametrize("mode", ["start-stop", "continuous"])
def test_the_cracked_tooth_and_the_stiffness_it_has_lost(preset: str, mode: str) -> None:
    effect = EffectSetting("root_crack", 6.0, {"tooth": 13})
    weak = ForgingManipulator().prepare(SimulationSetup(preset, effects=[effect])).drive.weak_tooth
    assert weak is not None
    slow = "filtered" if mode == "continuous" else "instants"
    found = tooth_compliance(measure_motion(cracked(6.0, preset, mode, tooth=13, slow=slow)))
    assert found.weak_teeth == (13,)
    assert found.stiffness_loss(13, 1.5) == pytest.approx(weak.loss, abs=0.02)
    assert found.extra_um[12] > 5.0 * found.uncertainty_um[12]


@pytest.mark.slow
def test_healthy_teeth_are_left_alone() -> None:
    for preset in ("manipulator_formula", "manipulator_table"):
        for mode in ("start-stop", "continuous"):
            for seed in range(2):
                assert tooth_compliance(measure_motion(cracked(0.0, preset, mode, seed))).weak_teeth == ()


def test_the_analysis_suspects_it() -> None:
    result = analyze(cracked(6.0, "manipulator_formula", "start-stop"))
    weak = [f for f in result.findings if f.code == "weak-tooth"]
    assert [f.where.tooth for f in weak] == [7]
    assert "Tooth 7 of the driver" in result.verdict
    assert "weak-tooth" not in [f.code for f in analyze(start_stop()).findings]


def test_too_few_teeth_or_no_torque() -> None:
    with pytest.raises(RefusalError, match="no torque"):
        tooth_compliance(measure_motion(without(start_stop(), "torque")))
    short = simulate("forging", parameters={"mode": "continuous"}, duration_s=0.6, sampling_rate_hz=1000.0)
    with pytest.raises(RefusalError, match="carried alone"):
        tooth_compliance(measure_motion(short))
    assert np.isfinite(tooth_compliance(measure_motion(start_stop())).deflection_um)
