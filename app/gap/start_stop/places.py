"""Where a start–stop gap lies: which part of the motion, which flank, which tooth, which order."""

from __future__ import annotations

import numpy as np

from app.gap.start_stop.compare import Compared
from gearsig.formatting import readable
from gearsig.gap.start_stop.floors import FLOOR
from gearsig.gap.start_stop.prediction_error import COMPRESSION, UNITS, prediction_errors
from gearsig.gap.start_stop.told import NAMES, Examined
from gearsig.gap.types import GapPlace, PlaceKind

LEAST_SHARE = 0.01
LEAST_CHANGE_DB = 3.0
"""Of a prediction error, to be shown."""
MOST_PHASES = 3

KINDS = {
    "curve": PlaceKind.MESH,
    "flank_friction": PlaceKind.MESH,
    "tooth": PlaceKind.TOOTH,
    "next_tooth": PlaceKind.TOOTH,
    "ripple": PlaceKind.SHAFT,
    "next_ripple": PlaceKind.SHAFT,
    "driver_wave": PlaceKind.SHAFT,
    "driven_wave": PlaceKind.SHAFT,
    "off_centre": PlaceKind.SHAFT,
}
"""Of a change; all others lie in time and speed."""

FEATURES = {
    "play": "play, from drive to back flank",
    "deflection": "deflection of the loaded teeth",
    "curve": "course of the drive flank over the mesh cycle",
    "inertia": "torque per acceleration of the load",
    "load_friction": "torque that turns the load without accelerating it",
    "flank_friction": "friction of the flanks",
    "tooth": "one tooth that yields more than all others",
    "next_tooth": "teeth that differ, drive flank",
    "ripple": "one order of the torque over all others",
    "next_ripple": "other orders of the torque",
    "driver_wave": "wave of the compression once per revolution of the driver",
    "driven_wave": "wave of the compression once per revolution of the driven gear",
    "off_centre": "torque of the load once per revolution",
    "impact": "hardest impact of the flanks in a cycle",
    "contact_scatter": "what the loaded flanks' equation leaves over",
    "load_scatter": "what the load's equation of motion leaves over",
}
"""In words, for evidence."""


def drive_places(compared: Compared) -> tuple[GapPlace, ...]:
    """Return where a recording differs, largest share first; then the phases of motion that are predicted worst.

    Size of a change over its floor z; share max(z² − 1, 0)/Σ max(z² − 1, 0).
    """
    floor = compared.floor()
    distance = compared.change - floor.centre
    z = np.nan_to_num(np.abs(distance) / (FLOOR * floor.scale))
    repeated = np.abs(np.nan_to_num(compared.change)) / (FLOOR * np.maximum(compared.scatter, 0.05))
    energies = np.maximum(z**2 - 1.0, 0.0)
    total = float(np.sum(energies))
    order = np.argsort(-energies)
    found = [
        _place(compared, int(i), float(distance[i]), float(repeated[i]), float(z[i]), float(energies[i]) / total)
        for i in order
        if total > 0.0 and energies[i] > LEAST_SHARE * total
    ]
    return (*found, *_phases(compared))


def _place(compared: Compared, i: int, change_db: float, repeated: float, structural: float, share: float) -> GapPlace:
    name = NAMES[i]
    spot, m = compared.spot, compared.now.cycles.motion
    n_teeth = m.path.teeth[0]
    is_tooth = name == "tooth"
    shafts = {"driver_wave": "pinion", "driven_wave": "wheel", "off_centre": "wheel"}
    orders = {"driver_wave": 1.0, "driven_wave": m.path.teeth[0] / m.path.teeth[1]}
    order = float(compared.now.orders[spot.order]) if name == "ripple" else orders.get(name)
    shaft = "pinion" if name in ("tooth", "ripple") else shafts.get(name, "")
    return GapPlace(
        KINDS.get(name, PlaceKind.SPEED),
        title_of(compared, name),
        change_db,
        repeated,
        structural,
        share,
        shaft=shaft,
        orders=(order,) if order is not None else (),
        angle_deg=360.0 * (spot.tooth + 0.5) / n_teeth if is_tooth else None,
        tooth=spot.tooth + 1 if is_tooth else None,
        follows=name in ("contact_scatter", "load_scatter", "impact", "next_tooth", "next_ripple"),
    )


def title_of(compared: Compared, name: str) -> str:
    """Return a change in one sentence, with its numbers."""
    now, other, spot = compared.told, compared.other, compared.spot
    c, d, a, b = now.contact, other.contact, now.load, other.load
    extra = (c.teeth_um - d.teeth_um)[spot.tooth]
    texts = {
        "play": f"where the drive stops and the back flank takes over: play {_pair(c.play_um, d.play_um, 'µm')}",
        "deflection": f"under load: teeth yield by {_pair(c.deflection_um, d.deflection_um, 'µm')}",
        "curve": "drive flank, over each mesh cycle: its course differs by "
        f"{readable(float(np.nanmax(c.curve_um - d.curve_um) - np.nanmin(c.curve_um - d.curve_um)), 2)} µm",
        "inertia": "in starts and stops, torque per acceleration of the load: "
        f"{_pair(a.inertia_kg_m2, b.inertia_kg_m2, 'kg·m²')}",
        "load_friction": "while the load turns, torque that does not accelerate it: "
        f"{_pair(a.friction_nm, b.friction_nm, 'N·m')}",
        "flank_friction": f"loaded flanks, friction coefficient {_pair(a.flank_friction, b.flank_friction, '')}",
        "tooth": f"drive flank, tooth {spot.tooth + 1} of the pinion yields {readable(float(extra), 2)} µm more than "
        "the middling tooth",
        "ripple": f"torque while running, order {int(compared.now.orders[spot.order])} of the pinion: "
        f"{_pair(100 * now.ripple[spot.order], 100 * other.ripple[spot.order], '% of its mean')}",
        "driver_wave": "compression once per revolution of the pinion: a wave of "
        f"{readable(float(np.hypot(*(c.waves_um[:2] - d.waves_um[:2]))), 2)} µm",
        "driven_wave": "compression once per revolution of the wheel: a wave of "
        f"{readable(float(np.hypot(*(c.waves_um[2:] - d.waves_um[2:]))), 2)} µm",
        "off_centre": "load once per revolution of the wheel: a torque of "
        f"{readable(float(np.hypot(*(a.off_centre_nm - b.off_centre_nm))), 2)} N·m",
        "impact": f"hardest impact of the flanks: {_pair(now.impact_mps, other.impact_mps, 'm/s')}",
    }
    return texts.get(name, FEATURES[name])


def _pair(now: float, other: float, unit: str) -> str:
    return f"{readable(float(now), 3)}{' ' if unit else ''}{unit} against {readable(float(other), 3)}"


def _phases(compared: Compared) -> list[GapPlace]:
    """Return the phases in which motion or torque are predicted worse than the sound machine's own."""
    sound: Examined = compared.sound_run if compared.reference is None else compared.reference
    now, other = (prediction_errors(one, compared.other) for one in (compared.now, sound))
    rows = []
    for key, rms in now.items():
        change = 20.0 * np.log10(max(rms, 1e-9) / max(other.get(key, np.nan), 1e-9))
        if np.isfinite(change) and change > LEAST_CHANGE_DB:
            quantity, phase, flank = key
            where = f"{phase}{f', {flank} flank' if flank else ''}"
            rows.append(
                GapPlace(
                    PlaceKind.SPEED,
                    f"{where}: measured {quantity} is {readable(rms, 2)} {UNITS[quantity]} off its prediction, "
                    f"{readable(other[key], 2)} ordinarily",
                    float(change),
                    float("nan"),
                    float("nan"),
                    float("nan"),
                    channel="" if quantity == COMPRESSION else quantity,
                    follows=True,
                )
            )
    return sorted(rows, key=lambda place: -place.change_db)[:MOST_PHASES]
