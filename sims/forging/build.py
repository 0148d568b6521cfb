"""From parameter values to the drive, its cycle, and its rig."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi, radians, sqrt

from gearsig.errors import InputError
from gearsig.rig.contact import ToothContact, hertz_stiffness_n_per_m1p5
from gearsig.rig.speed import EncoderChannel
from gearsig.rig.tooth_pairs import PathOfContact, standard_path
from gearsig.rig.types import GearPair, OperatingPoint, Rig, Sensor, Shaft
from sims.forging.drive import Bristle, ForgingDrive, GrippedLoad, HydraulicMotor, WeakTooth
from sims.forging.schedule import Cycle
from sims.forging.worn import worn_um
from sims.machine.operation import Operation
from sims.wanted import Wanted

TABLE_STIFFNESS = 1.72e9
"""As the source's table prints it, there in N/m; taken as N/m^1.5."""
SHAFTS = ("pinion", "wheel")
GRAVITY_MPS2 = 9.81
BRISTLE_DAMPING = 0.5
"""Damping ratio of an inertia that swings on its bristles at rest."""


def build_drive(wanted: Wanted, speed_limit_rpm: float, weak_tooth: WeakTooth | None = None) -> ForgingDrive:
    """Return the drive that complete values of `PARAMETERS` describe."""
    path = standard_path(
        (wanted.whole("teeth_driver"), wanted.whole("teeth_driven")),
        wanted.number("module_mm") * 1e-3,
        radians(wanted.number("pressure_angle_deg")),
        phase=wanted.number("mesh_phase"),
        contact_ratio=wanted.optional("contact_ratio"),
    )
    contact = build_contact(wanted, path)
    brake = wanted.number("brake_nm")
    drag, held = wanted.number("drag_nm"), wanted.number("load_friction_nm")
    pinion_side = contact.motor_inertia_kg_m2 + contact.driver_inertia_kg_m2
    motor = HydraulicMotor(
        contact.motor_inertia_kg_m2,
        _bristle(wanted, "drag", drag, drag + brake, pinion_side),
        wanted.number("motor_speed_band"),
        wanted.number("torque_ripple"),
        wanted.number("torque_ripple_order"),
    )
    load = GrippedLoad(
        _bristle(wanted, "load", held, held, contact.driven_inertia_kg_m2 or 0.0),
        wanted.number("piece_mass_kg") * GRAVITY_MPS2 * wanted.number("piece_offset_mm") * 1e-3,
        radians(wanted.number("piece_angle_deg")),
    )
    flanks = Bristle(
        1.0,
        wanted.number("flank_static_ratio"),
        wanted.number("flank_stribeck_mps"),
        wanted.number("flank_presliding_um") * 1e-6,
    )
    limit = speed_limit_rpm * pi / 30.0
    ramp, worn = wanted.number("mesh_ramp"), worn_um(wanted, path)
    return ForgingDrive(path, contact, motor, load, flanks, limit, ramp, weak_tooth, worn)


def build_contact(wanted: Wanted, path: PathOfContact) -> ToothContact:
    """Return the contact of the flanks, with the inertias behind them."""
    piece = 0.5 * wanted.number("piece_mass_kg") * (wanted.number("piece_radius_mm") * 1e-3) ** 2
    offset = wanted.number("piece_mass_kg") * (wanted.number("piece_offset_mm") * 1e-3) ** 2
    return ToothContact(
        _stiffness(wanted, path),
        "stage 1",
        wanted.number("exponent"),
        wanted.number("half_backlash_um") + 0.5 * wanted.number("wear_um"),
        wanted.number("restitution"),
        wanted.word("damping_law"),
        wanted.number("impact_speed_floor_mps"),
        wanted.number("friction_coefficient"),
        wanted.number("pinion_inertia_kg_m2"),
        wanted.number("wheel_inertia_kg_m2") + piece + offset,
        path.phase,
        path.contact_ratio,
        wanted.number("motor_inertia_kg_m2"),
    )


def build_cycle(wanted: Wanted) -> Cycle:
    """Return when the drive works and stands."""
    return Cycle(
        wanted.word("mode"),
        wanted.number("on_s"),
        wanted.number("off_s"),
        wanted.number("valve_rise_s"),
        wanted.number("brake_nm"),
        wanted.number("brake_delay_s"),
        wanted.number("press_nm"),
        wanted.number("press_delay_s"),
        wanted.number("press_duration_s"),
    )


def build_rig(
    drive: ForgingDrive,
    wanted: Wanted,
    operation: Operation,
    sensors: Sequence[Sensor],
    *,
    name: str = "",
    sources: Sequence[str] = (),
) -> Rig:
    """Return what somebody who knows the machine's drawing would write into a rig file; wear is not in it."""
    contact = build_contact(Wanted(wanted.values | {"wear_um": 0.0}), drive.path)
    torque = operation.torque_nm
    pair = GearPair(
        "stage 1",
        *SHAFTS,
        *drive.path.teeth,
        wanted.number("module_mm"),
        wanted.number("pressure_angle_deg"),
        wanted.number("face_width_mm"),
    )
    return Rig(
        name=name,
        shafts=(Shaft(SHAFTS[0], "ccw"), Shaft(SHAFTS[1], "cw")),
        pairs=(pair,),
        sensors=tuple(sensors),
        operating_point=OperatingPoint(SHAFTS[0], torque_nm=torque.largest if len(torque.values) == 1 else None),
        speed=EncoderChannel("pinion angle", 2.0 * pi, wraps=False, shaft=SHAFTS[0]),
        sources=tuple(sources),
        contact=contact,
    )


def _stiffness(wanted: Wanted, path: PathOfContact) -> float:
    own = wanted.optional("stiffness_n_per_m_lambda")
    if own is not None:
        return own
    if wanted.number("exponent") != 1.5:
        raise InputError(
            f"exponent is {wanted.number('exponent'):g}, and both named stiffnesses hold for 1.5",
            remedy="give stiffness_n_per_m_lambda",
        )
    if wanted.word("contact_stiffness") == "table":
        return TABLE_STIFFNESS
    z1, z2 = path.teeth
    return hertz_stiffness_n_per_m1p5(
        z2 / z1, 0.5 * z1 * wanted.number("module_mm") * 1e-3, radians(wanted.number("pressure_angle_deg"))
    )


def _bristle(wanted: Wanted, name: str, level: float, held: float, inertia_kg_m2: float) -> Bristle:
    """Friction of a shaft; its bristles are damped for the inertia that swings on them while it is held."""
    presliding = wanted.number(f"{name}_presliding_rad")
    swing = sqrt(held / presliding / inertia_kg_m2) if held > 0.0 else 0.0
    return Bristle(
        level,
        wanted.number("static_ratio"),
        wanted.number(f"{name}_stribeck_rad_per_s"),
        presliding,
        2.0 * BRISTLE_DAMPING / swing if swing > 0.0 else 0.0,
        wanted.number(f"{name}_viscous_nm_s_per_rad"),
    )
