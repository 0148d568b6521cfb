"""Effects of the catalogue on the forging drive: what they change, and that nothing else changes."""

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.motion import estimate_backlash, measure_motion
from gearsig.recording import Recording
from sims import simulate
from sims.effects import EffectSetting
from sims.forging import ForgingManipulator, PreparedDrive, respond
from sims.simulator import SimulationSetup
from tests.sims.forging.drives import driven_by, largest

CRACK = EffectSetting("root_crack", 4.0, {"tooth": 7})


def made(*settings: EffectSetting) -> PreparedDrive:
    return ForgingManipulator().prepare(SimulationSetup("", {"mode": "continuous"}, settings))


def recorded(**effects: float) -> Recording:
    return simulate("forging", effects=effects, duration_s=6.0, sampling_rate_hz=1000.0)


def test_effects_change_their_parameter_and_not_the_rig_file() -> None:
    faulty = recorded(backlash=80.0, sliding_friction=0.05, torque_ripple=10.0)
    assert faulty.truth is not None
    assert faulty.rig is not None
    assert faulty.rig.contact is not None
    assert faulty.truth["backlash_um"] == pytest.approx(380.0)
    assert faulty.rig.contact.half_backlash_um == 150.0
    assert faulty.rig.contact.friction_coefficient == 0.05
    assert [e["name"] for e in faulty.truth["effects"]] == ["backlash", "sliding_friction", "torque_ripple"]
    assert faulty.truth["parameters"]["half_backlash_um"] == 150.0
    assert estimate_backlash(measure_motion(faulty)).backlash_um == pytest.approx(380.0, rel=0.02)


def test_wear_is_of_the_gear_that_is_named() -> None:
    values = made(EffectSetting("tooth_wear", 100.0, {"gear": "driven"})).changed
    assert (values["sliding_wear_driver_um"], values["sliding_wear_driven_um"]) == (0.0, 100.0)


def test_ripple_shows_at_its_order() -> None:
    torque = respond(made(EffectSetting("torque_ripple", 10.0, {"order": 9.0})).drive, driven_by(95.0), duration_s=2.0)[
        "motor torque"
    ]
    assert np.ptp(torque[1500:]) / np.mean(torque[1500:]) > 0.1


def test_a_cracked_tooth_yields_more_while_it_carries_and_only_then() -> None:
    """Compression under the steady load, pitch by pitch: tooth 7 of the pinion, once a revolution."""
    weak = made(CRACK).drive.weak_tooth
    assert weak is not None
    assert (weak.gear, weak.tooth) == (0, 6)
    assert 0.02 < weak.loss < 0.5
    healthy, cracked = (respond(m.drive, driven_by(95.0), duration_s=3.0) for m in (made(), made(CRACK)))
    mean = {}
    for name, run in (("healthy", healthy), ("cracked", cracked)):
        x = run["pinion angle"] * 20.0 / (2.0 * np.pi)
        steady = (run.time_s > 1.2) & (x % 1.0 > 0.75) & (x % 1.0 < 0.95)  # tooth ⌊x⌋ alone
        tooth = np.floor(x[steady]).astype(int) % 20
        depth = run["compression"][steady] - 150e-6
        stiffness = run["interaction force"][steady] / np.maximum(depth, 1e-9) ** 1.5
        mean[name] = np.array([np.median(stiffness[tooth == j]) for j in range(20)])
    ratio = mean["cracked"] / mean["healthy"]
    assert ratio[6] == pytest.approx(1.0 - weak.loss, abs=2e-3)
    assert np.delete(ratio, 6) == pytest.approx(np.ones(19), abs=2e-3)


def test_energy_stays_balanced_with_a_weak_tooth() -> None:
    run = respond(made(CRACK).drive, driven_by(95.0), duration_s=2.0, tolerance=1e-8)
    balance = run["energy"] - run["work put in"] + run["lost in contact"] + run["lost in friction"]
    assert largest(balance) < 1e-5


def test_loss_grows_with_the_crack() -> None:
    losses = [made(EffectSetting("root_crack", d)).drive.weak_tooth.loss for d in (1.0, 2.0, 4.0)]  # type: ignore[union-attr]  # cracked
    assert 0.0 < losses[0] < losses[1] < losses[2]
    assert made(EffectSetting("root_crack", 0.0)).drive.weak_tooth is None


@pytest.mark.parametrize(
    ("setting", "named"),
    [
        (EffectSetting("unbalance", 10.0), "no meaning"),
        (EffectSetting("backlash", -5.0), "added_um"),
        (EffectSetting("root_crack", 2.0, {"tooth": 25}), "tooth of the driver"),
        (EffectSetting("backlash", 5.0, {"gear": "driver"}), "no option"),
    ],
)
def test_effects_that_do_not_fit(setting: EffectSetting, named: str) -> None:
    with pytest.raises(InputError, match=named):
        made(setting)
    with pytest.raises(InputError, match="2 times"):
        made(EffectSetting("backlash", 5.0), EffectSetting("backlash", 5.0))
