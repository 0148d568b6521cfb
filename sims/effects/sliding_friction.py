"""Effect: more friction between the flanks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import within
from sims.effects import textbook as book
from sims.effects._effect import DriveEffect, DriveParameters, Effect, Options, PlausibleRange, Severity
from sims.machine import MAX_DRY_FRICTION, Machine


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with friction added."""
    del options, rng
    oil = machine.lubrication
    dry = oil.dry_coefficient if oil.friction else 0.0
    within(severity, f"added_coefficient, beside the {dry:g} there are,", 0.0, MAX_DRY_FRICTION - dry)
    # A machine without friction has factor 0 on the regression, whatever its field says.
    factor = oil.factor if oil.friction else 0.0
    return replace(machine, lubrication=replace(oil, friction=True, factor=factor, dry_coefficient=dry + severity))


def on_drive(drive: DriveParameters, severity: float, options: Options) -> DriveEffect:
    """Raise the flanks' friction coefficient; the bristle deflection is unchanged."""
    del options
    now, highest = (of("friction_coefficient") for of in (drive.number, drive.highest))
    within(severity, f"added_coefficient of sliding_friction, beside the {now:g} there are,", 0.0, highest - now)
    return DriveEffect({"friction_coefficient": now + severity})


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """A force along the flanks that reverses at the pitch point, and some noise.

    Nearly a square wave at the mesh order, with decreasing harmonics. Across the line of action there is little other
    force, so it may be far louder than the vibration before.
    """
    waves = np.abs(1.0 + 0.5 * rng.standard_normal(book.N_MESH_HARMONICS)) * book.steeply(rng)
    gains = 1.0 + size * 10.0 ** rng.uniform(0.0, 1.0) * waves
    gains *= np.exp(
        0.7 * min(size, 1.0) * rng.standard_normal(book.N_MESH_HARMONICS)
    )  # it may oppose the existing vibration
    noise = 0.8 * size * rng.uniform(0.2, 1.0) * book.at_the_mesh(scene, book.band_noise(scene, rng), rng)
    return book.mesh_louder(scene, gains, noise, 0.7 * min(size, 1.0), rng)


EFFECT = Effect(
    name="sliding_friction",
    group="flank",
    title="more sliding friction",
    severity=Severity(
        "added_coefficient",
        "",
        0.0,
        MAX_DRY_FRICTION,
        0.1,
        "friction coefficient added to that of the oil film; well-lubricated flanks have 0.03 to 0.05 in total",
    ),
    changes="Every contact has this coefficient in addition to that of the oil film, the same at every sliding speed: "
    "where oil is starved, thinned or aged, metal touches metal, with Coulomb friction.",
    signature="Mesh harmonics, above all across the line of action, where friction is the only force: it reverses "
    "abruptly at the pitch point and jumps where pairs engage and disengage, so the second and higher harmonics gain. "
    "Far below the mesh resonance it is the louder force, since the gears follow transmission errors there. No "
    "sidebands, nothing at a single tooth. The drive gives a little more torque at the same load: more power is lost. "
    "It grows with the load.",
    shows_in=("mesh_harmonics",),
    change=change,
    plausible=PlausibleRange(0.03, 0.4, "mixed film with worn-out oil to dry, rough steel"),
    on_drive=on_drive,
    textbook=book.Textbook(
        (("mesh.share.2", book.UP), ("mesh.share.4", book.UP)),
        "the force reverses at the pitch point",
        textbook_signature,
        source="S. He, S. Cho, R. Singh, Prediction of dynamic friction forces in spur gears using alternate sliding "
        "friction formulations, J. Sound Vib. 309 (2008)",
    ),
)
