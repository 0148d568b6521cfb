"""What the rig file must say for crack severity, checked: one spur pair, its size, its load."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.checks import positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.rig.types import GearPair, Rig

PRESSURE_ANGLE_DEG = 20.0
"""Of every machine in the calibration."""


@dataclass(frozen=True)
class PairFacts:
    """A spur pair of which everything is known that the calibration needs.

    Parameters
    ----------
    pair : GearPair
    driver_teeth, driven_teeth : int
    module_mm, face_width_mm : float
    load_mpa : float
        Tangential force at the pitch circle per face width and module.
    """

    pair: GearPair
    driver_teeth: int
    driven_teeth: int
    module_mm: float
    face_width_mm: float
    load_mpa: float


def pair_facts(rig: Rig, torque_nm: float | None) -> PairFacts:
    """Return what is known of the rig's gear pair.

    Parameters
    ----------
    rig : Rig
    torque_nm : float or None
        Of the shaft that the rig's operating point names; None: the operating point's own.

    Raises
    ------
    InputError
        If the torque is not above zero.
    RefusalError
        If there is not exactly one pair, something is missing, or the pressure angle is another one.
    """
    if torque_nm is not None:
        positive(torque_nm, "torque_nm", "N m")
    if not rig.pairs:
        raise RefusalError(
            "no rig file describes a gear pair: teeth, module, face width and torque are needed",
            remedy="give a rig file; `gearsig rig example` prints one to start from",
        )
    if len(rig.pairs) != 1:
        raise RefusalError(
            f"the rig has {len(rig.pairs)} gear pairs; crack severity is calibrated for one",
            remedy="describe the pair in question alone, if the others are far away",
        )
    pair, torque = rig.pairs[0], torque_nm if torque_nm is not None else rig.operating_point.torque_nm
    known = {
        "driver_teeth": pair.driver_teeth,
        "driven_teeth": pair.driven_teeth,
        "module_mm": pair.module_mm,
        "face_width_mm": pair.face_width_mm,
        "torque_nm of the operating point": torque,
    }
    missing = [name for name, value in known.items() if not value]
    if missing or not (pair.driver_teeth and pair.driven_teeth and pair.module_mm and pair.face_width_mm and torque):
        raise RefusalError(
            f"the rig file does not give {', '.join(missing)}: the size of a crack's effect hangs on it",
            remedy="complete the rig file; the torque may be given with the call",
        )
    angle = pair.pressure_angle_deg
    if angle is not None and abs(angle - PRESSURE_ANGLE_DEG) > 0.5:
        raise RefusalError(
            f"the pressure angle is {angle:g}°, the calibration has {PRESSURE_ANGLE_DEG:g}°",
            remedy="make a calibration for such gears",
        )
    shaft = rig.operating_point.shaft or rig.reference_shaft
    turns = rig.ratio(shaft, to=pair.driver) or 1.0  # same power: torque falls as speed rises
    force_n = abs(torque) * turns / (0.5e-3 * pair.module_mm * pair.driver_teeth)
    load_mpa = force_n / (pair.face_width_mm * pair.module_mm)
    return PairFacts(pair, pair.driver_teeth, pair.driven_teeth, pair.module_mm, pair.face_width_mm, load_mpa)


def acceleration_channels(recording: Recording, wanted: tuple[str, ...]) -> tuple[str, ...]:
    """Return the wanted channels, or all accelerations; other quantities weigh frequencies differently."""
    found = tuple(channel.name for channel in recording.channels if channel.quantity == "acceleration")
    unknown = [name for name in wanted if name not in found]
    if unknown:
        raise InputError(f"{unknown[0]!r} is no acceleration channel", where="channels", allowed=", ".join(found))
    if not found:
        raise RefusalError(
            "there is no acceleration channel, and the calibration has no others",
            remedy="name the channel's quantity with a [[sensor]] in the rig file",
        )
    return wanted or found


def check_alive(recording: Recording, names: tuple[str, ...], whose: str = "") -> None:
    """Refuse channels that hold one value only."""
    rows = {name: recording.samples[recording.channel_names.index(name)] for name in names}
    dead = [name for name, row in rows.items() if float(row.max()) == float(row.min())]
    if dead:
        raise RefusalError(
            f"channel {dead[0]!r} {whose}is dead: it holds one value only", remedy="check the sensor, or leave it out"
        )
