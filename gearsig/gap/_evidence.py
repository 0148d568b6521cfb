"""Evidence for and against an effect: predicted changes beside observed ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearsig.gap._features import ECHO_LAGS_PITCHES, N_QUARTERS
from gearsig.gap._floors import family_members
from gearsig.gap._prediction import Fit, ObservedChange
from gearsig.gap._reduction import GearFrame, shaft_text
from gearsig.gap._report import Evidence
from gearsig.rig import SIDES
from gearsig.severity import SINGLE_TOOTH_FAULTS

MAX_SHOWN, MAX_OF_A_FAMILY = 10, 3
CLEAR = 1.0
"""Floors from which a change, predicted or observed, is evidence."""

MIN_SIGN_FLOORS = 0.3
"""Floors from which the sign of a prediction is evidence, and a predicted start–stop change is worth a line."""

OWN_FEATURE_WEIGHT = 2.0

MIN_AGREEING_RATIO = 0.5
"""Ratio of observed to predicted from which, up to its inverse, a change speaks for the effect."""


def evidence_of(fit: Fit, observed: Sequence[ObservedChange], frame: GearFrame) -> tuple[Evidence, ...]:
    """Return the strongest features of each family, clearest first, at the condition with the largest change.

    Changes that the effect predicts count twice as much as others, so that its own features are among them.

    Parameters
    ----------
    fit : Fit
    observed : sequence of ObservedChange
        One per condition.
    frame : GearFrame
    """
    clearest = max(observed, key=lambda change: float(np.abs(change.normalised).max()))
    predicted = fit.at(clearest.condition)
    sizes = np.maximum(OWN_FEATURE_WEIGHT * np.abs(predicted), np.abs(clearest.distances)) / clearest.floors
    clear = np.maximum(np.abs(predicted), np.abs(clearest.distances)) >= CLEAR * clearest.floors
    best = [
        int(i)
        for rows in family_members(fit.path.names).values()
        for i in rows[np.argsort(-sizes[rows], kind="stable")][:MAX_OF_A_FAMILY]
    ]
    largest = sorted((i for i in best if clear[i]), key=lambda i: -sizes[i])
    return tuple(
        evidence_of_feature(
            feature_text(fit.path.names[i], frame),
            float(predicted[i]),
            float(clearest.distances[i]),
            float(clearest.floors[i]),
        )
        for i in largest[:MAX_SHOWN]
    )


def evidence_of_feature(
    feature: str, predicted_db: float, observed_db: float, floor_db: float, *, min_floors: float = CLEAR
) -> Evidence:
    """Return a predicted change beside the observed one, with the resulting evidence on the effect.

    It speaks for the effect where both have the same sign and similar size, or where the prediction exceeds the floor
    and the two differ by less than the floor. A larger change in the predicted direction is no evidence against it
    where the prediction exceeds the floor or the excess is within it: the simulated size of the effect is uncertain,
    and something else may contribute. A change that was not predicted, did not occur, or has the opposite sign is
    evidence against it.

    Parameters
    ----------
    feature : str
        In words.
    predicted_db, observed_db, floor_db : float
    min_floors : float
        Floors from which a prediction of the right size speaks for the effect.
    """
    size, remainder = abs(predicted_db), abs(predicted_db - observed_db)
    if size == 0.0 or size < MIN_SIGN_FLOORS * floor_db:
        return Evidence(feature, predicted_db, observed_db, floor_db, speaks_for=False)
    ratio, is_clear = observed_db / predicted_db, size >= CLEAR * floor_db
    alike = size >= min_floors * floor_db and MIN_AGREEING_RATIO <= ratio <= 1.0 / MIN_AGREEING_RATIO
    agrees = alike or (is_clear and remainder <= floor_db)
    further = not agrees and ratio > 1.0 and (is_clear or remainder <= floor_db)
    return Evidence(feature, predicted_db, observed_db, floor_db, agrees, further)


# --------------------
# Identification of a cause's shaft, from the changes on both shafts, where possible.
#
# What turns with a shaft shows at that shaft's own orders and sidebands and in its own synchronous average. The signs
# of each cause there are compared between the shafts. No simulation is needed, so this serves any way of naming causes.
# --------------------


_BURST = ("change.{}.peak", "change.{}.prominence", "tooth.{}.peak", "tooth.{}.prominence", "tooth.{}.kurtosis")
_ALL_ROUND = ("change.{}.level", "change.{}.elsewhere", "tooth.{}.level", "tooth.{}.elsewhere", "shaft.{}.low")

SIGNS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(SINGLE_TOOTH_FAULTS, _BURST),
    "pitch_error": _ALL_ROUND,
    "eccentricity": ("sideband.{}.1", "sideband.{}.own", "shaft.{}.1", "shaft.{}.1.to_mesh"),
    "unbalance": ("shaft.{}.1", "shaft.{}.1.to_mesh"),
    "misalignment": ("shaft.{}.2", "shaft.{}.2.to_mesh", "sideband.{}.2"),
}
"""Cause → features that rise on its shaft. Wear and friction change the mesh, which both shafts share."""

FIRST_ORDER = {"misalignment": 2}
"""Cause → the first order of its shaft that it raises, where it is not 1."""


MAX_RISE = 6.0
"""Floors to which one sign is limited."""

MIN_SHAFT_RATIO = 1.5
"""Ratio of the signs on one shaft to those on the other."""


def determined_options(cause: str, changes: Sequence[Mapping[str, float]], teeth: tuple[int, int]) -> dict[str, str]:
    """Return the effect's option for its shaft, for example {"gear": "driven"}; empty: not known.

    A cause's signs on both shafts are compared, r_s = √(mean over conditions and signs of min(max(u, 0), 6)²), u the
    change of a sign on shaft s in floors. A cause that does not belong to one shaft has no option.

    Parameters
    ----------
    cause : str
        Name of an effect.
    changes : sequence of mappings
        Feature → change over its floor, see `Condition.over_floors`; one per operating condition.
    teeth : (int, int)
        Of driver and driven gear.
    """
    rises = []
    for side in SIDES:
        names = [sign.format(side) for sign in SIGNS.get(cause, ())]
        risen = [float(np.clip(change[name], 0.0, MAX_RISE)) for change in changes for name in names if name in change]
        rises.append(float(np.sqrt(np.mean(np.square(risen)))) if risen else 0.0)
    shaft = _shaft(rises, _slow(cause, teeth))
    return {} if shaft is None else {"shaft" if cause == "misalignment" else "gear": SIDES[shaft]}


def _shaft(rises: Sequence[float], slow: int | None) -> int | None:
    """Return the shaft on which a cause's signs rose: 0: driver, 1: driven, None: not known.

    `slow` is the shaft whose sign the other cannot produce, although the other's sign falls on an order of this one;
    see `_slow`.
    """
    if slow is not None and MIN_SHAFT_RATIO * rises[slow] > rises[1 - slow]:
        return slow if rises[slow] >= CLEAR else None
    larger = int(np.argmax(rises))
    is_clear = rises[larger] >= CLEAR and rises[larger] >= MIN_SHAFT_RATIO * rises[1 - larger]
    return larger if is_clear else None


def _slow(cause: str, teeth: tuple[int, int]) -> int | None:
    """Return the slower shaft if the other makes a whole number of revolutions for one of it; None otherwise.

    The faster shaft's orders then coincide with orders of the slower one, but not the other way round for its first
    order or a single tooth of it.
    """
    slow = int(np.argmax(teeth))
    ratio, remainder = divmod(teeth[slow], teeth[1 - slow])
    return slow if not remainder and FIRST_ORDER.get(cause, 1) % ratio else None


# --------------------
# Features in words.
# --------------------


_SIDEBANDS = {
    "1": "first sidebands",
    "2": "second sidebands",
    "3to5": "sidebands 3 to 5",
    "6to12": "sidebands 6 to 12",
    "own": "first sidebands over their own mesh harmonic",
    "strongest": "strongest sideband over the others",
}
_SHAFT = {
    "1": "order 1",
    "2": "order 2",
    "3": "order 3",
    "1.to_mesh": "order 1 over the mesh",
    "2.to_mesh": "order 2 over the mesh",
    "3.to_mesh": "order 3 over the mesh",
    "strongest": "strongest of the orders above 3 over the others",
    "strongest.to_mesh": "strongest of the orders above 3 over the mesh",
    "low": "orders above 3",
}
_TOOTH = {
    "level": "level besides the mesh",
    "elsewhere": "level at the median tooth",
    "peak": "level of the burst at the strongest tooth",
    "prominence": "burst over the median tooth",
    "second": "burst over the next strongest tooth",
    "kurtosis": "kurtosis",
    "width": "number of teeth within 3 dB of the strongest",
    "below_mesh": "part below the mesh order",
    "centroid": "centroid of the spectrum",
    "agreement": "agreement with the reference",
}
_OF_A_SHAFT = {
    "sideband": ("", _SIDEBANDS),
    "shaft": ("", _SHAFT),
    "tooth": ("average, ", _TOOTH),
    "change": ("change of the average, ", _TOOTH),
    "surprise": ("change of the average over its noise, ", _TOOTH),
}
_CYCLIC = {
    "outer": "outer races",
    "inner": "inner races",
    "ball": "rolling elements",
    "cage": "cages",
    "mesh": "mesh order",
    "strange": "an order of unknown origin",
    "depth": "depth of modulation",
    "half_mesh": "half the mesh order",
}
_ALIKE_PARTS = {"mesh": "harmonics", "repeated": "part that either gear repeats", "noise": "part that neither repeats"}
_ALIKE = {
    f"{key}{suffix}": f"{words}{', ' if said else ''}{said}"
    for key, words in _ALIKE_PARTS.items()
    for suffix, said in (("", ""), (".spread", "spread"), (".rise", "rise from one to the next"))
} | {
    f"{a}_{b}.{suffix}": f"{_ALIKE_PARTS[a]} and {_ALIKE_PARTS[b]}, {said}"
    for a, b in (("mesh", "repeated"), ("repeated", "noise"), ("mesh", "noise"))
    for suffix, said in (("less", "the former over the latter"), ("apart", "apart"), ("together", "changed alike"))
}
_BURST_WAYS = {"plain": "as it is", "even": "magnitudes flattened"}
_BURST_WORDS = (
    {f"course.{i}": f"share of quarter pitch {i}" for i in range(N_QUARTERS)}
    | {f"echo.{i}": f"autocorrelation at lag {lag:.2f} pitches" for i, lag in enumerate(ECHO_LAGS_PITCHES)}
    | {"elsewhere": "share further away"}
)
_SINGLE_FEATURES = {
    "mesh.total": "mesh harmonics together",
    "mesh.half": "half mesh orders",
    "apart.mesh": "mesh harmonics, difference between sensors",
    "apart.floor": "floor, difference between sensors",
    **{f"alike.{key}": f"about the mesh harmonics: {words}" for key, words in _ALIKE.items()},
    **{
        f"burst.{way}.{key}": f"burst of a tooth, {said}: {words}"
        for way, said in _BURST_WAYS.items()
        for key, words in _BURST_WORDS.items()
    },
    "floor.total": "floor, all bands",
    "floor.to_signal": "floor over the whole signal",
    "raw.level": "level of the whole signal",
    "raw.kurtosis": "kurtosis of the whole signal",
    "raw.near_the_extreme": "samples close to the extreme",
    "speed.drift": "drift of the speed",
    "speed.swing": "swing of the speed",
    "speed.swing_line": "strongest line of the speed's swing",
    "hum": "mains lines",
}


def feature_text(name: str, frame: GearFrame) -> str:
    """Return a feature's name in words, e.g. "input shaft: sidebands 6 to 12"."""
    if name in _SINGLE_FEATURES:
        return _SINGLE_FEATURES[name]
    first, _, remainder = name.partition(".")
    side, _, detail = remainder.partition(".")
    if first == "mesh":
        return f"mesh harmonic {detail} over all"
    if first in _OF_A_SHAFT and side in SIDES:
        kind, table = _OF_A_SHAFT[first]
        return f"{shaft_text(frame, SIDES.index(side))}: {kind}{table[detail]}"
    if first == "floor":
        return f"floor, band {detail}" if side == "band" else f"kurtosis of the floor, band {detail}"
    where = "envelope" if first == "envelope" else "lines"
    if remainder.endswith("_shaft"):
        return f"{where}: orders of {shaft_text(frame, SIDES.index(remainder.removesuffix('_shaft')))}"
    return f"{where}: {_CYCLIC[remainder]}"
