"""Effect: a spall on a flank."""

from __future__ import annotations

import numpy as np

from sims.effects import textbook as book
from sims.effects._effect import GEAR_OPTION, TOOTH_OPTION, Effect, Option, Options, PlausibleRange, Severity
from sims.effects._parts import any_tooth, first_teeth, gear_index, tooth_number, with_tooth_fault
from sims.machine import Machine, log_uniform
from sims.mesh import ToothSpall


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the spall, centred on the pitch point."""
    del rng
    width_mm = severity / 100.0 * machine.mesh.pair.face_width_mm
    length_mm, depth_um = float(options["length_mm"]), float(options["depth_um"])
    spall = ToothSpall(length_mm, width_mm, depth_um, tooth_number(machine, options))
    return with_tooth_fault(machine, "spalls", gear_index(options), spall)


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """A pit: short impacts on entry and exit, different each time; the mesh hardly changes."""
    side = book.draw_side(rng)
    window, place = book.tooth_window(scene, side, float(rng.uniform(0.3, 0.8)), rng)
    blows = book.tooth_impacts(scene, side, place, float(rng.uniform(0.05, 0.4)), rng, of=2)
    return book.Signature(
        book.swollen(book.sign(rng) * 0.4 * size * rng.uniform(), window), None, (4.0 * size * blows,)
    )


# The severity is the width, not the length: the remaining face width determines how soft the contact becomes, so the
# burst grows with the severity at any length. With length it does not: the impacts at the two ends cancel or add.
EFFECT = Effect(
    name="tooth_spall",
    group="tooth-local",
    title="spall on a tooth's flank",
    severity=Severity("width_percent", "%", 0.0, 90.0, 60.0, "part of the loaded face that it covers"),
    changes="Metal is missing on one flank about the pitch point: the rest of the face carries alone, and the contact "
    "is softer.",
    signature="A short burst per revolution of the gear's shaft, at the tooth's angle and while the pitch point is in "
    "mesh: shorter than a crack's, so its low, wide sidebands reach to higher frequencies, and it rings the "
    "resonances; envelope lines at multiples of the shaft's order. It begins and ends within one mesh period. Wider "
    "spalls give a stronger burst; longer ones a longer one, not always a stronger.",
    shows_in=("tooth_window", "envelope_orders", "mesh_sidebands", "resonances"),
    profile_varies_with="length_mm",
    change=change,
    options=(
        GEAR_OPTION,
        TOOTH_OPTION,
        Option("length_mm", 1.5, "along the profile, its middle at the pitch point", "mm", 0.05, 20.0),
        Option("depth_um", 100.0, "depth of the spall", "um", 1.0, 2000.0),
    ),
    plausible=PlausibleRange(
        15.0,
        85.0,
        "percent of the face; a pit of a tenth is lost in ordinary flanks, 90 is the model's limit",
        choices=lambda machine: first_teeth(machine, length_mm=0.45 * machine.nominal.module_mm),
        # The ends of a spall are two steps; their distance determines at which orders they add or cancel. In steps of
        # a tenth of the module, 0.45 included, profiles in between are mixtures of their neighbours (correlation 0.95).
        further_settings=lambda machine: [
            (options, (2,))
            for length in (0.2, 0.28, 0.365, 0.55, 0.66, 0.77, 0.88, 1.0)
            for options in first_teeth(machine, length_mm=length * machine.nominal.module_mm)
        ],
        drawn=lambda machine, rng: {
            **any_tooth(machine, rng),
            "length_mm": machine.nominal.module_mm * log_uniform(rng, 0.2, 1.0),
        },
    ),
    textbook=book.Textbook(
        (("tooth.{side}.prominence", book.UP), ("tooth.{side}.kurtosis", book.UP), ("tooth.{side}.centroid", book.UP)),
        "a short impact at one tooth, high in frequency",
        textbook_signature,
        source="H. Endo, R. B. Randall, C. Gosselin, Differential diagnosis of spall vs. cracks in the gear tooth "
        "fillet region: experimental validation, Mech. Syst. Signal Process. 23 (2009)",
    ),
)
