"""The forging drive set to a rig and to how it is driven in a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import pi, radians

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap import N_PLACES, PHASES, CycledMotion, PreparedCycles, Told, cut_cycles
from gearsig.motion import PairMotion, measure_motion
from gearsig.rig import standard_path
from sims.effects import EffectSetting
from sims.forging import NAME, ForgingManipulator
from sims.machine import Operation
from sims.mesh import GearGeometry, PairGeometry, wear_profile
from sims.presets import Preset, preset_text
from sims.simulator import ParameterValue

N_CYCLES = 2
SAMPLING_RATE_HZ = 1000.0
SEED = 11
SPEED_BAND = 0.3
NOISE_FREE: dict[str, ParameterValue] = {
    "encoder_counts": 0,
    "angle_noise_urad": 0.0,
    "speed_noise_mrad_per_s": 0.0,
    "acceleration_noise_rad_per_s2": 0.0,
    "torque_noise_nm": 0.0,
}
"""What a cause changes is wanted, not what noise does to it."""
LEAST_BRAKE = 0.5
"""Of the motor's torque: in a stop the back flanks must carry, for the play to be told."""
ORDINARY_FRICTION = 0.5
"""Of the drive's torque on the load, where no torque says more."""

Parameters = Mapping[str, ParameterValue]


@dataclass(frozen=True)
class DriveTwin:
    """A simulated drive by a rig's drawing, driven as a recording shows it.

    Parameters
    ----------
    parameters : mapping
        Of `sims.forging`.
    torque_nm, speed_rpm : float
        Of the motor's open valve; that the flow allows.
    """

    parameters: Parameters
    torque_nm: float
    speed_rpm: float

    @property
    def duration_s(self) -> float:
        """Of the runs that predictions come from."""
        return N_CYCLES * (float(self.parameters["on_s"]) + float(self.parameters["off_s"])) - 1e-6

    def tell(self, parameters: Parameters, effects: Sequence[EffectSetting] = ()) -> Told:
        """Run the drive and return what its cycles tell; teeth that its short run does not pass are like the others."""
        examined = self.examine(parameters, effects)
        told = examined.tell(examined.every)
        return replace(told, contact=replace(told.contact, teeth_um=np.nan_to_num(told.contact.teeth_um)))

    def examine(self, parameters: Parameters, effects: Sequence[EffectSetting] = ()) -> PreparedCycles:
        """Run the drive and cut it into cycles."""
        recording = ForgingManipulator().simulate(
            parameters,
            effects,
            Operation.steady(self.speed_rpm, self.torque_nm),
            np.random.default_rng(SEED),
            sampling_rate_hz=SAMPLING_RATE_HZ,
            duration_s=self.duration_s,
        )
        motion = measure_motion(recording, use={"force": ""})
        return PreparedCycles(cut_cycles(motion))

    @cached_property
    def sound(self) -> Told:
        """What the sound drive's cycles tell."""
        return self.tell(self.parameters)

    def at_torque(self, factor: float) -> DriveTwin:
        """Return the drive with another torque of the motor, and so another top speed."""
        return replace(self, torque_nm=self.torque_nm * factor)

    def preset(self, effects: Sequence[EffectSetting], parameters: Parameters, notes: Sequence[str]) -> str:
        """Return the drive as a preset file that `gearsig simulate forging --preset FILE` runs."""
        preset = Preset(
            "",
            NAME,
            "Forging drive set to a rig and to its starts and stops",
            ("the rig file, and the recording's own torque and motion",),
            ("times of valve and brake, friction of the load, noise: read off the recording or usual",),
            ("press blows, elastic shafts, pitch errors",),
            dict(parameters),  # type: ignore[arg-type]  # read only
            round(self.speed_rpm, 2),
            round(self.torque_nm, 3),
            tuple(effects),
        )
        return preset_text(preset, notes)


def drive_twin(cycles: CycledMotion, told: Told, sound: Told | None) -> DriveTwin:
    """Set the drive to a rig and a recording.

    Geometry, inertias, contact, friction of the flanks and play are the rig's; where a sound recording tells play,
    inertia and friction better, they are that recording's. Times of valve and brake, friction of the load and the speed
    that the flow allows are the recording's own: how the machine is driven is no gap.
    """
    m = cycles.motion
    c, path = m.contact, m.path
    ratio = path.teeth[1] / path.teeth[0]
    torque, brake = _torques(m)
    friction = told.load.friction_nm if sound is None else sound.load.friction_nm
    if not 0.0 < friction < 0.9 * torque * ratio:
        friction = ORDINARY_FRICTION * torque * ratio
    on_s, off_s = _times(cycles)
    drag = 0.05 * torque
    top = float(np.quantile(np.abs(m.driver_speed_rad_s), 0.98))
    needed = min((drag + friction / ratio) / torque, 0.95)
    limit = top / (1.0 - SPEED_BAND * needed) * 30.0 / pi
    contact = _contact(c.half_backlash_um, c.driven_inertia_kg_m2 or 45.0, c.friction_coefficient, sound)
    parameters: dict[str, ParameterValue] = {
        "teeth_driver": path.teeth[0],
        "teeth_driven": path.teeth[1],
        "module_mm": _module_mm(m),
        "contact_ratio": min(path.contact_ratio, 1.84),
        "mesh_phase": c.mesh_phase,
        "stiffness_n_per_m_lambda": c.stiffness_n_per_m_lambda,
        "exponent": c.exponent,
        "restitution": max(c.restitution, 0.05),
        "damping_law": c.damping_law,
        "impact_speed_floor_mps": c.impact_speed_floor_mps,
        "half_backlash_um": contact[0],
        "friction_coefficient": contact[2],
        "motor_inertia_kg_m2": c.motor_inertia_kg_m2,
        "pinion_inertia_kg_m2": max(c.driver_inertia_kg_m2, 1e-4),
        "wheel_inertia_kg_m2": contact[1],
        "piece_mass_kg": 0.0,
        "on_s": on_s,
        "off_s": off_s,
        "valve_rise_s": 0.02,
        "brake_nm": brake,
        "press_nm": 0.0,
        "motor_speed_band": SPEED_BAND,
        "drag_nm": drag,
        **NOISE_FREE,
        "drag_viscous_nm_s_per_rad": 0.002 * torque,
        "load_friction_nm": 0.95 * friction,
        "load_viscous_nm_s_per_rad": 0.1 * friction / (top / ratio),
    }
    return DriveTwin({k: v if isinstance(v, str) else float(f"{v:.6g}") for k, v in parameters.items()}, torque, limit)


def _contact(half_um: float, inertia: float, friction: float, sound: Told | None) -> tuple[float, float, float]:
    """Return half play, inertia and friction of the flanks: the sound recording's where it tells them."""
    if sound is None:
        return half_um, inertia, friction
    if sound.contact.play_um > 0.0:
        half_um = 0.5 * sound.contact.play_um
    if sound.load.inertia_kg_m2 > 0.0:
        inertia = sound.load.inertia_kg_m2
    return half_um, inertia, friction


def _module_mm(m: PairMotion) -> float:
    """Module from the base pitch: 20° is what the path was made with, unless the rig says otherwise."""
    r1 = m.path.base_radii_m[0]
    pitch_radius = m.path.length_m * r1 / sum(m.path.base_radii_m)  # tan α times the base radius
    reference = float(np.hypot(r1, pitch_radius))
    return round(2e3 * reference / m.path.teeth[0], 6)


def _torques(m: PairMotion) -> tuple[float, float]:
    """Return the motor's torque and the brake's; without a torque usual ones, which carry the load's inertia."""
    if m.torque_nm is None:
        ratio = m.path.teeth[1] / m.path.teeth[0]
        fastest = float(np.quantile(m.driven_acceleration_rad_s2, 0.98))
        torque = 2.0 * (m.contact.driven_inertia_kg_m2 or 45.0) * max(fastest, 1.0) / ratio
        return torque, 0.6 * torque
    forward, backward = np.quantile(m.torque_nm, [0.97, 0.01])
    torque = max(float(forward), 1e-3)
    return torque, float(np.clip(-backward, LEAST_BRAKE * torque, 3.0 * torque))


def _times(cycles: CycledMotion) -> tuple[float, float]:
    """Return how long the drive is on and off in a cycle."""
    rate = cycles.motion.sampling_rate_hz
    driven = np.isin(cycles.phase, (PHASES.index("start"), PHASES.index("run")))
    on = [np.sum(driven & (cycles.number == i)) / rate for i in range(cycles.n_cycles)]
    starts = np.array([s.start_s for s in cycles.course.moving])
    on_s = float(max(np.median(on), 0.2))
    period = float(np.median(np.diff(starts)))
    return round(on_s, 3), round(max(period - on_s, 0.3), 3)


# --------------------
# How worn flanks move the gears against each other over a mesh cycle.
# --------------------


N_BISECTIONS = 40


def worn_curve_um(parameters: Parameters, deflection_um: float, depth_um: float) -> FloatArray:
    """Return how much further the driver turns, at each place of the mesh cycle, with worn teeth, (N_PLACES,).

    A pair whose flank has lost h touches later: Σ (δ − h_i)₊^λ = n g^λ at an equal load, g the deflection of n sound
    pairs. Where two pairs share the load, the less worn one decides. Wear is that of the driver's teeth, by Archard's
    law (`sims.mesh.wear_profile`).

    Parameters
    ----------
    parameters : mapping
        Of the drive.
    deflection_um : float
        Of one pair under the ordinary load.
    depth_um : float
        Where the wear is greatest.
    """
    module = float(parameters["module_mm"])
    teeth = int(float(parameters["teeth_driver"])), int(float(parameters["teeth_driven"]))
    driver, driven = (GearGeometry(z, module, 20.0, face_width_mm=16.0 * module) for z in teeth)
    pair = PairGeometry(driver, driven)
    path = standard_path(teeth, 1e-3 * module, radians(20.0))
    u = (np.arange(N_PLACES) + 0.5) / N_PLACES
    positions = np.stack([u, u + 1.0])
    touches = positions < path.contact_ratio
    worn = depth_um * np.stack([wear_profile(pair, 1, 1e3 * path.driver_lever_m(row)) for row in positions])
    exponent = float(parameters["exponent"])
    g = deflection_um if np.isfinite(deflection_um) and deflection_um > 0.0 else 20.0
    n = np.sum(touches, axis=0)
    wanted = g**exponent * np.ones(N_PLACES)  # the load of one pair: with two the compression is less
    sound = g / n ** (1.0 / exponent)
    low, high = np.zeros(N_PLACES), sound + depth_um
    for _ in range(N_BISECTIONS):
        middle = 0.5 * (low + high)
        carried = np.sum(np.where(touches, np.maximum(middle - worn, 0.0) ** exponent, 0.0), axis=0)
        low, high = np.where(carried < wanted, middle, low), np.where(carried < wanted, high, middle)
    curve: FloatArray = 0.5 * (low + high) - sound
    return curve
