"""Effect: a piece broken off a tooth's tip."""

from __future__ import annotations

from math import log

import numpy as np

from sims.effects import _parts as parts
from sims.effects import textbook as book
from sims.effects._effect import GEAR_OPTION, TOOTH_OPTION, Effect, Option, Options, PlausibleRange, Severity
from sims.machine import Machine
from sims.mesh import ToothChip


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with the chip."""
    del rng
    chip = ToothChip(severity, parts.loaded_width_mm(machine, options), parts.tooth_number(machine, options))
    return parts.with_tooth_fault(machine, "chips", parts.gear_index(options), chip)


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """A missing corner: the tooth loses load, and the next tooth takes it over with an impact."""
    side = book.draw_side(rng)
    window, place = book.tooth_window(scene, side, float(rng.uniform(0.5, 1.2)), rng)
    blow = book.tooth_impacts(scene, side, place, 0.08, rng)
    return book.Signature(
        book.swollen(book.sign(rng) * size * rng.uniform(0.3, 1.2), window),
        book.late_tooth(scene, size * rng.uniform(0.3, 1.2), window, rng),
        (4.0 * size * 10.0 ** -rng.uniform(0.0, 0.7) * blow,),
    )


LOW, HIGH = 0.2, 0.9
"""Plausible heights, in modules."""
EVEN_HEIGHTS = tuple((2.0 * np.log(np.linspace(LOW, HIGH, 8) / LOW) / log(HIGH / LOW)).tolist())
"""Eight equally spaced heights as severity indices above the lowest, see `PlausibleRange`."""

EFFECT = Effect(
    name="chipped_tooth",
    group="tooth-local",
    title="piece broken off a tooth's tip",
    severity=Severity("height_mm", "mm", 0.0, 10.0, 1.0, "radially, from the tip down to the edge of the break"),
    changes="The outer part of one tooth carries less load, or, with a chip over the whole face, the remaining edge "
    "carries it: its pair disengages early (driver) or engages late (driven gear), and the neighbours carry instead.",
    signature="One burst per revolution of the gear's shaft, at the tooth's angle and where its tip is in mesh: in "
    "recess for the driver, in approach for the driven gear. A shock when the next pair takes over the load: wide "
    "sidebands of that shaft, ringing resonances, envelope lines at multiples of its order. Small chips are in double "
    "contact and show little.",
    shows_in=("tooth_window", "envelope_orders", "mesh_sidebands", "resonances"),
    # The pair disengages one pitch earlier per module of height: half the step between the largest two heights tried.
    moves_pitches=0.16,
    profile_varies_with="height_mm",
    change=change,
    options=(
        GEAR_OPTION,
        TOOTH_OPTION,
        Option("width_percent", 50.0, "part of the loaded face, up to 90, or 100", "%", 1.0, 100.0),
    ),
    plausible=PlausibleRange(
        LOW,
        HIGH,
        "of the module: a broken corner to half of the tooth's height; smaller chips are in double contact",
        parts.module_mm,
        lambda machine: parts.first_teeth(machine, width_percent=85.0),
        lambda machine, rng: {
            **parts.any_tooth(machine, rng),
            "width_percent": float(rng.choice((30.0, 60.0, 85.0, 100.0))),
        },
        # With the whole width of its tip gone a tooth carries nothing there; with most of it left, nearly as much as
        # before. The height determines where in the engagement that is: in steps of a tenth of the module, profiles in
        # between are mixtures of their neighbours, with correlations of at least 0.98. One of the eight is next to a
        # candidate.
        further_settings=lambda machine: [
            (options, places)
            for percent, places in (
                (35.0, EVEN_HEIGHTS),
                (85.0, (EVEN_HEIGHTS[1], *EVEN_HEIGHTS[3:-1])),
                (100.0, EVEN_HEIGHTS),
            )
            for options in parts.first_teeth(machine, width_percent=percent)
        ],
    ),
    textbook=book.Textbook(
        (("tooth.{side}.peak", book.UP), ("tooth.{side}.prominence", book.UP), ("tooth.{side}.second", book.UP)),
        "a strong impact at one tooth",
        textbook_signature,
    ),
)
