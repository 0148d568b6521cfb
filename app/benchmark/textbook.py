"""The rule table: textbook signatures of the effects, in the features of `gearsig.gap`.

Each rule names what rises (or falls, or changes either way) where the effect is; a feature counts by how far it is from
usual, over its usual spread. With a healthy reference the change against it counts, over the change's usual spread.
``{side}`` is driver or driven, whichever shows more.

Signatures: R. B. Randall, Vibration-based Condition Monitoring (Wiley, 2011), chapters 2, 5 and 6. Usual: the middle
and the spread of 24 healthy machines of the development cases, rounded.
"""

from __future__ import annotations

from dataclasses import dataclass

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

LEAST_STRENGTH = 2.0
"""In spreads: the strength at which "none" stands."""

USUAL: dict[str, tuple[float, float, float]] = {
    "mesh.total": (5.0, 16.0, 1.5),
    "mesh.share.2": (-15.0, 9.0, 1.5),
    "mesh.share.3": (-28.0, 12.0, 2.0),
    "mesh.share.4": (-35.0, 12.0, 2.0),
    "mesh.half": (-60.0, 18.0, 2.0),
    "sideband.{side}.1": (-27.0, 14.0, 3.0),
    "sideband.{side}.2": (-29.0, 14.0, 2.5),
    "sideband.{side}.3to5": (-37.0, 15.0, 2.5),
    "sideband.{side}.6to12": (-38.0, 15.0, 1.5),
    "sideband.{side}.strongest": (29.0, 7.0, 2.0),
    "shaft.{side}.1": (-38.0, 16.0, 3.5),
    "shaft.{side}.1.to_mesh": (-43.0, 20.0, 4.0),
    "shaft.{side}.2": (-30.0, 18.0, 2.0),
    "shaft.{side}.3": (-44.0, 14.0, 4.0),
    "shaft.{side}.strongest": (19.0, 7.0, 2.5),
    "shaft.{side}.low": (-40.0, 21.0, 2.0),
    "tooth.driver.elsewhere": (-16.0, 15.0, 1.0),
    "tooth.{side}.elsewhere": (-15.0, 15.0, 1.0),
    "tooth.{side}.peak": (-8.0, 16.0, 1.5),
    "tooth.{side}.prominence": (6.0, 3.0, 1.5),
    "tooth.{side}.second": (0.8, 1.4, 1.0),
    "tooth.{side}.kurtosis": (4.7, 1.3, 0.7),
    "tooth.{side}.centroid": (1.2, 4.0, 0.3),
    "envelope.outer": (4.7, 4.0, 1.6),
    "envelope.inner": (5.4, 3.6, 1.8),
    "envelope.cage": (4.7, 4.4, 1.8),
    "envelope.strange": (11.0, 5.4, 2.2),
    "line.half_mesh": (0.6, 3.2, 1.4),
    "line.strange": (13.0, 6.0, 2.9),
    "floor.band.2": (-9.0, 15.0, 3.0),
    "floor.band.3": (-11.0, 14.0, 1.5),
    "floor.band.4": (-23.0, 12.0, 1.0),
    "raw.level": (8.0, 9.0, 1.4),
    "raw.kurtosis": (3.3, 2.2, 1.0),
    "raw.near_the_extreme": (-47.0, 2.3, 2.2),
    "speed.drift": (-61.0, 11.0, 11.0),
    "speed.swing": (-60.0, 8.0, 3.7),
    "hum": (8.0, 6.0, 2.0),
}
"""Feature → usual value, its spread, and the usual spread of its change against a reference, in dB."""
