"""The rule table: textbook signatures of the effects, in the features of `gearsig.gap`.

Each rule names what rises (or falls, or changes either way) where the effect is. ``{side}`` is driver or driven,
whichever shows more.

Signatures: R. B. Randall, Vibration-based Condition Monitoring (Wiley, 2011), chapters 2, 5 and 6.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gearsig.gap.gear_lines import SIDES
from gearsig.gap.types import UNKNOWN

UP, DOWN, EITHER = 1, -1, 0


@dataclass(frozen=True)
class Rule:
    """A cause and its signs; one cause may have several rules, of which the strongest counts.

    Parameters
    ----------
    cause : str
    signs : tuple of (str, int)
        Feature and direction; their mean is the rule's strength.
    words : str
        What the textbook says.
    """

    cause: str
    signs: tuple[tuple[str, int], ...]
    words: str


RULES = (
    Rule(
        "root_crack",
        (("tooth.{side}.prominence", UP), ("tooth.{side}.kurtosis", UP), ("sideband.{side}.6to12", UP)),
        "once per revolution a dip in stiffness: one tooth in the residual, a wide family of low sidebands",
    ),
    Rule(
        "tooth_spall",
        (("tooth.{side}.prominence", UP), ("tooth.{side}.kurtosis", UP), ("tooth.{side}.centroid", UP)),
        "a short impact at one tooth, high in frequency",
    ),
    Rule(
        "chipped_tooth",
        (("tooth.{side}.peak", UP), ("tooth.{side}.prominence", UP), ("tooth.{side}.second", UP)),
        "a strong impact at one tooth",
    ),
    Rule(
        "tooth_wear",
        (("mesh.total", UP), ("mesh.share.2", UP), ("mesh.share.3", UP)),
        "mesh harmonics rise, the higher ones most",
    ),
    Rule(
        "pitch_error",
        (("tooth.{side}.elsewhere", UP), ("shaft.{side}.low", UP), ("sideband.{side}.3to5", UP)),
        "all orders of the shaft rise, at every tooth",
    ),
    Rule(
        "surface_roughness",
        (("floor.band.3", UP), ("floor.band.4", UP), ("tooth.driver.elsewhere", UP)),
        "noise rises over a wide band",
    ),
    Rule("sliding_friction", (("mesh.share.2", UP), ("mesh.share.4", UP)), "the force reverses at the pitch point"),
    Rule(
        "eccentricity",
        (("sideband.{side}.1", UP), ("shaft.{side}.1", UP)),
        "first sidebands of the shaft about the mesh, and its first order",
    ),
    Rule("unbalance", (("shaft.{side}.1", UP), ("shaft.{side}.1.to_mesh", UP)), "the shaft's first order"),
    Rule(
        "misalignment",
        (("shaft.{side}.2", UP), ("sideband.{side}.2", UP)),
        "the shaft's second order, second sidebands",
    ),
    Rule(
        "torque_ripple",
        (("sideband.{side}.strongest", UP), ("shaft.{side}.strongest", UP)),
        "a single pair of sidebands, a single order of the shaft",
    ),
    Rule("speed_fluctuation", (("speed.swing", UP), ("speed.drift", UP)), "the speed wanders"),
    Rule("backlash", (("mesh.half", UP), ("line.half_mesh", UP)), "half orders of the mesh when teeth part"),
    Rule("bearing_outer_race", (("envelope.outer", UP),), "envelope lines at the ball pass order of the outer race"),
    Rule("bearing_inner_race", (("envelope.inner", UP),), "envelope lines at the ball pass order of the inner race"),
    Rule(
        "bearing_clearance",
        (("shaft.{side}.3", UP), ("shaft.{side}.low", UP), ("envelope.cage", UP)),
        "looseness: many orders of the shaft",
    ),
    Rule(
        "transfer_path",
        (("floor.band.2", EITHER), ("floor.band.3", EITHER), ("raw.level", EITHER)),
        "levels of whole bands change, lines and noise alike",
    ),
    Rule("mains_hum", (("hum", UP),), "lines at the supply's frequency"),
    Rule("clipping", (("raw.near_the_extreme", UP), ("raw.kurtosis", DOWN)), "flat tops"),
    Rule(UNKNOWN, (("envelope.strange", UP),), "a modulation that belongs to no part"),
    Rule(UNKNOWN, (("line.strange", UP),), "a line that belongs to no part"),
)

NOTHING_SAID = 1.0
"""Strength that counts for no gap, of which there is no rule: sound machines are one spread from usual."""

MOST_OF_A_SIGN = 8.0
"""In spreads: one sign alone shall not carry a rule of three."""


def rule_strength(rule: Rule, side: str, deviations: Mapping[str, float]) -> float:
    """Return the mean of a rule's signs, each over its spread."""
    signs = []
    for name, direction in rule.signs:
        value = deviations[name.format(side=side)]
        signs.append(min(direction * value if direction else abs(value), MOST_OF_A_SIGN))
    return float(np.mean(signs))


def sides_of(rule: Rule) -> tuple[str, ...]:
    """Return the sides that a rule is asked of; an empty one where it knows none."""
    return SIDES if any("{side}" in name for name, _ in rule.signs) else ("",)


def strengths(deviations: Mapping[str, float]) -> dict[str, float]:
    """Return cause → how strongly its rules speak for it, in spreads: the strongest rule, at either side.

    Parameters
    ----------
    deviations : mapping
        Feature → distance from usual, in spreads of sound machines.
    """
    found: dict[str, float] = {}
    for rule in RULES:
        strength = max(rule_strength(rule, side, deviations) for side in sides_of(rule))
        found[rule.cause] = max(strength, found.get(rule.cause, -np.inf))
    return found
