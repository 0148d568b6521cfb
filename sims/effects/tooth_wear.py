"""Effect: flanks that have worn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from sims.effects import textbook as book
from sims.effects._effect import GEAR_OPTION, DriveEffect, DriveParameters, Effect, Options, PlausibleRange, Severity
from sims.effects._parts import any_gear, either_gear, gear_index, mesh_field, tolerance_of, with_mesh_field
from sims.machine import Machine, profile_tolerance_um
from sims.mesh import FlankDeviation


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with wear added on every tooth of one gear."""
    del rng
    index = gear_index(options)
    flank: FlankDeviation = mesh_field(machine, "flank", index)
    return with_mesh_field(machine, "flank", index, replace(flank, wear_um=flank.wear_um + severity))


def on_drive(drive: DriveParameters, severity: float, options: Options) -> DriveEffect:
    """Wear one gear's drive flanks, most at their ends and not at the pitch point: pairs come into contact later."""
    name = f"sliding_wear_{options['gear']}_um"
    return DriveEffect({name: drive.number(name) + severity})


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """A profile worn away from the pitch line: mesh harmonics grow, the higher ones more, and flanks become rough.

    The modulation of the mesh grows less than the mesh itself; equal growth of both would be a changed path.
    """
    gains = 1.0 + 8.0 * size * np.abs(rng.standard_normal(book.N_MESH_HARMONICS)) * book.steeply(rng)[::-1]
    noise = size * rng.uniform() ** 2 * book.at_the_mesh(scene, book.band_noise(scene, rng), rng)
    return book.mesh_louder(scene, gains, noise, 0.4 * min(size, 1.0), rng)


EFFECT = Effect(
    name="tooth_wear",
    group="flank",
    title="worn flanks",
    severity=Severity("depth_um", "um", 0.0, 200.0, 15.0, "maximum depth of wear on the flank; adds to existing wear"),
    changes="Every flank of one gear loses metal where it slides: none at the pitch point, most towards root and tip, "
    "by Archard's law.",
    signature="Mesh harmonics, the same on every tooth: no sidebands and no pulse, the same shape in every mesh "
    "period. On teeth without relief the first micrometres act as relief and quieten the mesh; beyond that, every "
    "harmonic grows. Strongest at light load, where deflection no longer covers the worn shape. A path that passes "
    "other frequencies better looks similar; ratios at another load distinguish them.",
    shows_in=("mesh_harmonics",),
    change=change,
    options=(GEAR_OPTION,),
    plausible=PlausibleRange(
        1.0,
        10.0,
        "of the profile tolerance of class 5 of ISO 1328: to that of class 11 or 12",
        tolerance_of(profile_tolerance_um),
        either_gear,
        any_gear,
    ),
    on_drive=on_drive,
    textbook=book.Textbook(
        (("mesh.total", book.UP), ("mesh.share.2", book.UP), ("mesh.share.3", book.UP)),
        "mesh harmonics rise, the higher ones most",
        textbook_signature,
        source="H. Ding, A. Kahraman, Interactions between nonlinear spur gear dynamics and surface wear, J. Sound "
        "Vib. 307 (2007)",
    ),
)
