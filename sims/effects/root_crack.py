"""Effect: a crack in a tooth root."""

from __future__ import annotations

import numpy as np

from gearsig.checks import within
from sims.effects import _parts as parts
from sims.effects import textbook as book
from sims.effects._effect import (
    GEAR_OPTION,
    TOOTH_OPTION,
    DriveEffect,
    DriveParameters,
    Effect,
    MachineFacts,
    Option,
    Options,
    PlausibleRange,
    Severity,
)
from sims.machine import Machine, WeakTooth
from sims.mesh import GearMesh, RootCrack, deepest_crack_mm, mesh_stiffness


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the crack."""
    del rng  # nothing is drawn
    tooth, width_mm = parts.tooth_number(machine, options), parts.part_of_width_mm(machine, options)
    crack = RootCrack(severity, float(options["angle_deg"]), tooth, width_mm)
    return parts.with_tooth_fault(machine, "cracks", parts.gear_index(options), crack)


def on_drive(drive: DriveParameters, severity: float, options: Options) -> DriveEffect:
    """Weaken a tooth: its pairs lose stiffness in the ratio of their mean stiffness with and without the crack.

    Applies to the drive flank, where the load opens the crack; from the potential energy of the tooth (`sims.mesh`).
    """
    if severity == 0.0:
        return DriveEffect()
    gear, pair = parts.gear_index(options), drive.gear_pair()
    n_teeth = (pair.driver, pair.driven)[gear].teeth
    tooth = int(within(float(options["tooth"]), f"tooth of the {parts.GEARS[gear]} gear", 1, n_teeth)) - 1
    percent = float(options["width_percent"])
    width = None if percent == 100.0 else percent / 100.0 * pair.face_width_mm
    crack = RootCrack(severity, float(options["angle_deg"]), tooth, width)
    cracked = GearMesh(pair, cracks_1=(crack,) if gear == 0 else (), cracks_2=(crack,) if gear == 1 else ())
    # Pair `tooth` alone, over the first pitch from its entry: its column changes when the next pair enters.
    cycles = tooth + np.linspace(0.05, 0.95, 40)
    healthy_n_per_m, weak_n_per_m = (
        mesh_stiffness(mesh, cycles).pairs_n_per_m[:, 0] for mesh in (GearMesh(pair), cracked)
    )
    return DriveEffect(weak_tooth=WeakTooth(gear, tooth, 1.0 - float(np.mean(weak_n_per_m / healthy_n_per_m))))


def _deepest_mm(machine: MachineFacts, options: Options) -> float:
    return deepest_crack_mm(machine.gears[parts.gear_index(options)], float(options.get("angle_deg", 45.0)))


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """A softer tooth: late, and deflecting more under load, more slowly than the mesh, which continues.

    With a deep crack the next tooth engages with an impact.
    """
    side = book.draw_side(rng)
    window, place = book.tooth_window(scene, side, float(rng.uniform(0.8, 2.0)), rng)
    gain, late = rng.uniform(0.0, 1.0, 2)
    blow, slow = book.balance(rng, 2) * (4.0, 2.0)
    impact = book.tooth_impacts(scene, side, place, 0.03, rng)
    giving_way = np.gradient(np.gradient(window))
    giving_way /= max(float(np.abs(giving_way).max()), 1e-12)
    return book.Signature(
        book.swollen(book.sign(rng) * gain * size, window),
        book.late_tooth(scene, late * size, window, rng),
        (blow * size * impact, slow * size * giving_way),
    )


EFFECT = Effect(
    name="root_crack",
    group="tooth-local",
    title="crack in a tooth root",
    severity=Severity("depth_mm", "mm", 0.0, 10.0, 2.0, "length of the crack in the cross-section, from mid-fillet"),
    changes="One tooth loses bending, shear and axial stiffness in the sections behind the crack; the mean force is "
    "unchanged, so the tooth deflects more while it carries load.",
    signature="One burst per revolution of the gear's shaft, at the tooth's angle and about a mesh period long, which "
    "rings at the natural frequencies; a family of low, wide sidebands of that shaft about the mesh harmonics and the "
    "resonances. In the shaft's synchronous average the residual's kurtosis rises, and the phase lags at the tooth. "
    "The burst grows faster than the depth, and with the load.",
    shows_in=("tooth_window", "mesh_sidebands", "envelope_orders"),
    change=change,
    options=(
        GEAR_OPTION,
        TOOTH_OPTION,
        Option("angle_deg", 45.0, "between the crack and the tooth's centre line", "deg", 15.0, 90.0),
        Option("width_percent", 100.0, "part of the face width it reaches over, from one end", "%", 1.0, 100.0),
    ),
    plausible=PlausibleRange(
        0.2,
        0.85,
        "of the deepest crack that the tooth allows; below a fifth the stiffness hardly changes",
        _deepest_mm,
        parts.first_teeth,
        lambda machine, rng: {**parts.any_tooth(machine, rng), "angle_deg": float(rng.uniform(35.0, 75.0))},
        lambda machine, options: 0.95 * _deepest_mm(machine, options),
    ),
    on_drive=on_drive,
    textbook=book.Textbook(
        (("tooth.{side}.prominence", book.UP), ("tooth.{side}.kurtosis", book.UP), ("sideband.{side}.6to12", book.UP)),
        "once per revolution a dip in stiffness: one tooth in the residual, a wide family of low sidebands",
        textbook_signature,
        source="P. D. McFadden, Detecting fatigue cracks in gears by amplitude and phase demodulation of the meshing "
        "vibration, J. Vib. Acoust. 108 (1986)",
    ),
)
