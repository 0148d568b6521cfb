"""Effect: pitch errors of one gear, of all its teeth or of a single one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from sims.effects import _parts as parts
from sims.effects import textbook as book
from sims.effects._effect import (
    GEAR_OPTION,
    TOOTH_OPTION,
    Effect,
    MachineFacts,
    Option,
    Options,
    PlausibleRange,
    Severity,
)
from sims.machine import Machine, pitch_tolerance_um
from sims.mesh import FlankDeviation

ONE_TOOTH_SHARE = 1.0 / 3.0
"""Share of drawn pitch errors with a single tooth out of place, as after a dent, a repair or an indexing slip.

ISO 1328-1:2013 assesses the single deviation by the worst tooth and the cumulative one by all teeth; both occur."""


def change(machine: Machine, severity: float, options: Options, rng: np.random.Generator) -> Machine:
    """Return the machine with further pitch errors, of all teeth or of one."""
    index = parts.gear_index(options)
    flank: FlankDeviation = parts.mesh_field(machine, "flank", index)
    n_teeth = parts.gear_geometry(machine, index).teeth
    if "tooth" in options:
        behind = 1.0 if options["stands"] == "behind" else -1.0
        pattern: FloatArray = behind * np.eye(n_teeth)[parts.tooth_number(machine, options)]
    else:
        pattern = cumulative_pitch(n_teeth, rng)
    added = severity * pattern
    total = added + np.asarray(flank.pitch_um) if flank.pitch_um else added
    return parts.with_mesh_field(machine, "flank", index, replace(flank, pitch_um=tuple(total.tolist())))


def cumulative_pitch(n_teeth: int, rng: np.random.Generator) -> FloatArray:
    """Cumulative pitch deviation of each tooth, from drawn single deviations of standard deviation 1, (n_teeth,).

    F_k = Σ_{i≤k} f_i with f_i normal and Σ f_i = 0 over the revolution, so that the circle closes. The mean is
    subtracted, as it would only rotate the gear.
    """
    single = rng.standard_normal(n_teeth)
    # Closing the circle takes one of n degrees of freedom; the factor restores the variance.
    closed = (single - single.mean()) * np.sqrt(n_teeth / (n_teeth - 1.0))
    cumulative = np.cumsum(closed)
    return np.asarray(cumulative - cumulative.mean())


def textbook_signature(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """Each tooth, or a single one, is early or late by its own amount: lines at all orders of its shaft."""
    if rng.uniform() < ONE_TOOTH_SHARE:
        return _pitch_of_one_tooth(scene, size, rng)
    return pitch_of_all_teeth(scene, size, rng)


def _pitch_of_one_tooth(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """One tooth is early or late, and takes more or less load than its neighbours."""
    side = book.draw_side(rng)
    window, _ = book.tooth_window(scene, side, float(rng.uniform(1.0, 2.5)), rng)
    late, gain, _ = book.balance(rng, 3)
    return book.Signature(
        book.swollen(0.6 * book.sign(rng) * gain * size, window), book.late_tooth(scene, late * size, window, rng)
    )


def pitch_of_all_teeth(scene: book.SyntheticScene, size: float, rng: np.random.Generator) -> book.Signature:
    """Each tooth is early or late by its own amount: lines at all orders of its shaft."""
    side = book.draw_side(rng)
    errors, gains = (rng.standard_normal(scene.teeth[side]) for _ in range(2))
    at, gain, slow = book.balance(rng, 3)
    run = np.cumsum(errors - errors.mean())
    early, louder, low = (book.over_teeth(scene, side, of_teeth) for of_teeth in (errors, gains, run))
    low = low / max(float(run.std()), 1e-12)
    return book.Signature(
        np.maximum(1.0 + 0.6 * gain * size * louder, 0.0),
        0.3 * book.MAX_ADVANCE * min(at * size, 1.0) / scene.teeth[0] * np.clip(early, -2.5, 2.5),
        (0.5 * slow * size * low,),
    )


def _drawn(machine: MachineFacts, rng: np.random.Generator) -> Options:
    """Draw a gear, or a single tooth of one."""
    if rng.uniform() >= ONE_TOOTH_SHARE:
        return parts.any_gear(machine, rng)
    return {**parts.any_tooth(machine, rng), "stands": str(rng.choice(STANDS))}


STANDS = ("behind", "ahead")

EFFECT = Effect(
    name="pitch_error",
    group="flank",
    title="pitch errors",
    severity=Severity(
        "deviation_um", "um", 0.0, 50.0, 5.0, "standard deviation of the single pitch deviations, normal and closed"
    ),
    changes="Every tooth of one gear is a little ahead or behind: its pairs come into contact early or late, and share "
    "the load unevenly. The pattern is drawn, closes over the revolution and adds to existing pitch errors.",
    signature="All orders of that gear's shaft, decreasing with order, and its sidebands of every number about the "
    "mesh harmonics, irregular and asymmetric; the same pattern every revolution, on no tooth in particular, so that "
    "the synchronous average changes over the whole revolution while its kurtosis hardly does. It fades as the load "
    "rises.",
    shows_in=("shaft_orders", "mesh_sidebands"),
    is_on_every_tooth=True,
    change=change,
    options=(
        GEAR_OPTION,
        replace(TOOTH_OPTION, default=None, meaning="the only tooth with an error, of that size; none: all teeth"),
        Option("stands", "behind", "position of that tooth, in the gear's direction of rotation", choices=STANDS),
    ),
    plausible=PlausibleRange(
        0.4,
        3.0,
        "standard deviation over the pitch tolerance (a limit) of class 5: gears of classes 5 to 11",
        parts.tolerance_of(pitch_tolerance_um),
        parts.either_gear,
        _drawn,
        # The deviations are drawn; a small one has the same effect on every tooth. A large one separates its tooth.
        further_settings=lambda machine: [
            (options, (0, 2)) for stands in STANDS for options in parts.first_teeth(machine, stands=stands)
        ],
    ),
    textbook=book.Textbook(
        (("tooth.{side}.elsewhere", book.UP), ("shaft.{side}.low", book.UP), ("sideband.{side}.3to5", book.UP)),
        "all orders of the shaft rise, at every tooth",
        textbook_signature,
        source="W. D. Mark, Analysis of the vibratory excitation of gear systems: basic theory, J. Acoust. Soc. Am. 63 "
        "(1978)",
    ),
)
