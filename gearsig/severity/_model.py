"""The fitted relation between features and depth, with its intervals and its limits; numbers only, no fitting."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, freeze, frozen_array
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import odds_text, with_minus
from gearsig.results import Result
from gearsig.severity._features import FEATURES, IN_WORDS, RELIEF, RISING, SHAPE, SHAPED

MIN_SPREAD = 0.1
"""Of ln percent: no machine is known better than to ten percent."""


def _freeze(model: object, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Make the arrays of a frozen model read-only, if they have the shapes they must have."""
    for name, shape in shapes.items():
        array = frozen_array(getattr(model, name), f"{name} of the model", ndim=len(shape))
        if array.shape != shape:
            raise InputError(f"{name} of the model has shape {array.shape}", allowed=str(shape))
        object.__setattr__(model, name, array)


def segments(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Return how far values lie below the first knot, between both, and above the second; (…, 3).

    Examples
    --------
    >>> segments(np.array([-2.0, 0.5, 4.0]), np.array([0.0, 1.0])).tolist()
    [[-2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 1.0, 3.0]]
    """
    first, second = knots
    below, between = np.minimum(values, first) - first, np.clip(values, first, second) - first
    return np.stack([below, between, np.maximum(values, second) - second], axis=-1)


@dataclass(frozen=True)
class DepthModel:
    """ln percent = c + Σ b_i z_i + Σ_j g_j(z_j), z = (f − m)/s, with rising curves g_j; and what belongs to it.

    Parameters
    ----------
    mean, scale : arrays, (n_features,)
        m and s.
    intercept : float
    coefficients : array, (n_features,)
        b; 0 for the features that rise with the depth.
    knots, slopes : arrays, (n_shaped, 2) and (n_shaped, 3)
        Of the curves g of the features `SHAPED`: straight below, between and above the knots. Slopes are not negative.
    spread : array, (n_features + 1,)
        Of ln percent: σ = max(spread[0] + Σ spread[i] (f_i − m_i)/s_i, 0.1).
    quantiles : tuple of two floats
        5 % and 95 % quantiles of (ln true percent − predicted)/σ, each by a model that was not fitted to that rig.
    detection : array, (n_features,)
        Weights of the detection score.
    threshold : float
        Score from which a crack counts as seen.
    healthy_scores : array, (n_healthy,)
        Scores of healthy gear pairs, rising: the higher one of either gear.
    precision : array, (n_features, n_features)
        Inverse covariance of the features (f_i − m_i)/s_i; 0 for those that the depth is not read from.
    largest_distance : float
        Mahalanobis distance beyond which a feature vector is unlike the calibration's.
    lowest, highest : arrays, (n_features,)
        Range of each feature among the calibration's cracks.
    percent_range : tuple of two floats
        Depths of the calibration.
    """

    mean: FloatArray
    scale: FloatArray
    intercept: float
    coefficients: FloatArray
    knots: FloatArray
    slopes: FloatArray
    spread: FloatArray
    quantiles: tuple[float, float]
    detection: FloatArray
    threshold: float
    healthy_scores: FloatArray
    precision: FloatArray
    largest_distance: float
    lowest: FloatArray
    highest: FloatArray
    percent_range: tuple[float, float]

    def __post_init__(self) -> None:
        n, curves = len(FEATURES), len(SHAPED)
        names = ("mean", "scale", "coefficients", "detection", "lowest", "highest")
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(names, (n,))
        shapes |= {"spread": (n + 1,), "precision": (n, n), "knots": (curves, 2), "slopes": (curves, 3)}
        _freeze(self, shapes | {"healthy_scores": self.healthy_scores.shape[:1]})
        rising = [FEATURES.index(name) for name in RISING]
        falls = np.any(self.coefficients[rising] < 0) or np.any(self.slopes < 0) or np.any(self.detection < 0)
        if np.any(self.scale <= 0) or np.any(np.diff(self.knots) <= 0) or falls:
            raise InputError("the model of crack depth would fall with a rising excess", remedy="fit it again")

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> DepthModel:
        """Build it from what a JSON file holds."""
        fitted: dict[str, Any] = {}
        for f in fields(cls):
            value = values[f.name]
            is_array, is_pair = f.type == "FloatArray", f.type == "tuple[float, float]"
            fitted[f.name] = np.asarray(value, dtype=float) if is_array else tuple(value) if is_pair else float(value)
        return cls(**fitted)

    def standardised(self, features: FloatArray) -> FloatArray:
        """Return (f − m)/s."""
        return np.asarray((features - self.mean) / self.scale)

    def log_percent(self, features: FloatArray) -> float:
        """Return the predicted ln of the depth in percent of the root's thickness."""
        z = self.standardised(features)
        curves = [
            segments(z[FEATURES.index(name)], knots) @ slopes
            for name, knots, slopes in zip(SHAPED, self.knots, self.slopes, strict=True)
        ]
        return self.intercept + float(z @ self.coefficients) + float(sum(curves))

    def log_interval(self, features: FloatArray) -> tuple[float, float]:
        """Return the 90 % interval of ln percent."""
        # No machine is known better than to ten percent.
        spread = max(float(self.spread[0] + self.standardised(features) @ self.spread[1:]), MIN_SPREAD)
        centre = self.log_percent(features)
        return centre + self.quantiles[0] * spread, centre + self.quantiles[1] * spread

    def score(self, features: FloatArray) -> float:
        """Return the detection score."""
        return float(self.standardised(features) @ self.detection)

    def p_value(self, score: float) -> float:
        """Return (1 + number of healthy pairs with as high a score)/(1 + number of healthy pairs)."""
        higher = len(self.healthy_scores) - int(np.searchsorted(self.healthy_scores, score, side="left"))
        return (1.0 + higher) / (1.0 + len(self.healthy_scores))

    def unlike(self, features: FloatArray) -> str:
        """Say in which way a feature vector is unlike the calibration's cracks; empty if it is not."""
        margin = 0.05 * (self.highest - self.lowest)
        beyond = np.maximum(self.lowest - margin - features, features - self.highest - margin)
        beyond[np.diag(self.precision) == 0] = 0.0  # a clearer event than any in the calibration is no harm
        i = int(np.argmax(beyond))
        if beyond[i] > 0:
            phrase, unit, scale = IN_WORDS.get(FEATURES[i], (FEATURES[i].replace("_", " "), "", 1.0))
            value, lowest, highest = scale * features[i], scale * self.lowest[i], scale * self.highest[i]
            theirs = f"theirs {lowest:.1f} to {highest:.1f} {unit}".rstrip()
            return with_minus(f"{phrase} is {value:.1f} {unit}".rstrip() + f"; {theirs}")
        z = self.standardised(features)
        distance = float(np.sqrt(z @ self.precision @ z))  # Mahalanobis
        if distance > self.largest_distance:
            return f"its features lie {distance:.1f} from their middle, the limit is {self.largest_distance:.1f}"
        return ""

    def at_threshold(self, features: FloatArray) -> FloatArray:
        """Return the features that the least visible crack at this place would have.

        All energies of the event rise by the same factor until the score reaches the threshold. If it is there already,
        nothing changes.
        """
        result = np.array(features, dtype=np.float64)
        result[[FEATURES.index(name) for name in RISING]] += max(0.0, self._missing_rise(features))
        return result

    def threshold_prominence(self, features: FloatArray) -> float:
        """Return ln of the prominence at which an event with these features would just be a crack, as `at_threshold`.

        Of one that is a crack it lies below the event's own.
        """
        return float(features[FEATURES.index("prominence")]) + self._missing_rise(features)

    def _missing_rise(self, features: FloatArray) -> float:
        """Return by how much ln of all energies would have to rise to the threshold; below 0 beyond it."""
        rising = [FEATURES.index(name) for name in RISING]
        gain = float(np.sum(self.detection[rising] / self.scale[rising]))
        return (self.threshold - self.score(features)) / gain


CRACKED, CHIPPED, SPALLED = KINDS = ("cracked", "chipped", "spalled")
OTHER_DAMAGE = "chipped or spalled"

# Not how large the event is and how far it stands out: a deep crack is no chip for being large.
_USED = [i for i, name in enumerate(FEATURES) if name not in (*RELIEF, *RISING)]
KIND_FEATURES = (*(FEATURES[i] for i in _USED), *SHAPE)


def kind_vector(features: FloatArray, shape: FloatArray) -> FloatArray:
    """Return what the kind is read from, in the order of `KIND_FEATURES`."""
    return np.concatenate([np.asarray(features)[_USED], shape])


@dataclass(frozen=True)
class KindModel:
    """p_k = exp(b_k + Σ w_ki z_i)/Σ_j exp(b_j + …), z = (f − m)/s held within ±4: what is further says no more.

    Parameters
    ----------
    mean, scale : arrays, (n_features,)
        m and s.
    weights : array, (3, n_features + 1)
        b_k before w_ki, in the order of `KINDS`. As many cracks as chips and spalls together, whatever the depths.
    """

    mean: FloatArray
    scale: FloatArray
    weights: FloatArray

    def __post_init__(self) -> None:
        n = len(KIND_FEATURES)
        _freeze(self, {"mean": (n,), "scale": (n,), "weights": (len(KINDS), n + 1)})

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> KindModel:
        """Build it from what a JSON file holds."""
        return cls(*(np.asarray(values[name], dtype=np.float64) for name in ("mean", "scale", "weights")))

    def probabilities(self, vector: FloatArray) -> dict[str, float]:
        """Return kind → probability."""
        z = np.clip((vector - self.mean) / self.scale, -4.0, 4.0)
        levels = self.weights[:, 0] + self.weights[:, 1:] @ z
        shares = np.exp(levels - levels.max())
        return dict(zip(KINDS, (shares / shares.sum()).tolist(), strict=True))


FILE = Path(__file__).with_name("calibration.json")
WITH_REFERENCE, ALONE = "with_reference", "alone"
RELIEF_KNOWN = "_relief_known"
"""Ending of the names of the models that know the tip relief."""


@dataclass(frozen=True)
class Calibration:
    """What `python -m app.studies.crack_severity` made.

    Parameters
    ----------
    models : mapping
        "with_reference" and "alone", also with the ending "_relief_known" → DepthModel.
    kinds : mapping
        "with_reference" and "alone" → KindModel.
    reach : mapping
        Quantity → (lowest, highest) value among the calibration's machines.
    lag_pitches : float
        By how many pitches the event's middle follows the middle of the tooth's engagement.
    provenance : mapping
        Simulator, version, seeds, numbers of cases.
    """

    models: Mapping[str, DepthModel]
    kinds: Mapping[str, KindModel]
    reach: Mapping[str, tuple[float, float]]
    lag_pitches: float
    provenance: Mapping[str, Any]

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> Calibration:
        """Build it from what a JSON file holds.

        Raises
        ------
        InputError
            If it belongs to other features than this version computes.
        """
        if (tuple(values["features"]), tuple(values.get("shape", ()))) != (FEATURES, SHAPE):
            raise InputError(
                "the calibration of crack severity belongs to other features than this version computes",
                where=str(FILE.name),
                remedy="make it again: python -m app.studies.crack_severity",
            )
        return cls(
            {name: DepthModel.from_mapping(model) for name, model in values["models"].items()},
            {name: KindModel.from_mapping(model) for name, model in values["kinds"].items()},
            {name: (float(low), float(high)) for name, (low, high) in values["reach"].items()},
            float(values["lag_pitches"]),
            values["provenance"],
        )

    def check_reach(self, features: Mapping[str, float]) -> None:
        """Refuse a machine that is unlike the calibration's.

        Raises
        ------
        RefusalError
            With every quantity that is outside.
        """
        outside = [
            f"{name} is {value:.4g}, the calibration has {self.reach[name][0]:.4g} to {self.reach[name][1]:.4g}"
            for name, value in features.items()
            if not self.reach[name][0] * (1 - 1e-9) <= value <= self.reach[name][1] * (1 + 1e-9)
        ]
        if outside:
            raise RefusalError(
                "the calibration does not reach this machine or operating point: " + "; ".join(outside),
                remedy="record at another speed or load, or make a calibration for such machines",
            )


@cache
def load_calibration() -> Calibration:
    """Return the calibration that comes with this version."""
    return Calibration.from_mapping(json.loads(FILE.read_text(encoding="utf-8")))


@dataclass(frozen=True)
class CrackEstimate(Result):
    """A damaged tooth was seen; whether it is cracked, and how deep the crack is, if it is one.

    Parameters
    ----------
    shaft : str
        Of the gear with the crack.
    gear : str
        "pair/shaft".
    tooth : int or None
        From 1 at the shaft's mark, as they engage; None where there is no mark on this shaft.
    angle_deg : float
        Of the shaft at the middle of the tooth's engagement; counted from the mark, or from an arbitrary start.
    gear_is_certain : bool
        False where both gears show it alike: gears of equal teeth meet the same mate every revolution.
    depth_mm, depth_percent : float
        Length of a straight crack at 45° through the face width, and the part of the root's thickness it takes away.
    interval_mm, interval_percent : tuples of two floats
        Holds the depth in 90 % of the cases, among machines like the calibration's.
    p_value : float
        Chance of as clear an event on a healthy gear pair, among the calibration's healthy ones.
    with_reference : bool
        Whether a recording of the healthy gears was compared with.
    features : mapping
        Name → value of what the estimate rests on; see `gearsig.severity`.
    reasons : tuple of str
        What the reader should know, one sentence each.
    kind_probabilities : mapping
        "cracked", "chipped", "spalled" → probability, if cracks are as frequent as chips and spalls together.
    reach_cycles : float
        For how many mesh cycles after its middle the event has four times a median other tooth's energy. It hangs on
        damping and resonances as much as on the depth; the estimate does not rest on it.
    squeezed_rise_db : float
        Synchrosqueezed energy at high orders near the tooth over that of a median healthy tooth; see
        `gearsig.severity`. The estimate does not rest on it.
    agreement : float or None
        How far the teeth's pattern is that of the reference, see `difference_lines`; None without one.
    """

    shaft: str
    gear: str
    tooth: int | None
    angle_deg: float
    gear_is_certain: bool
    depth_mm: float
    depth_percent: float
    interval_mm: tuple[float, float]
    interval_percent: tuple[float, float]
    p_value: float
    with_reference: bool
    features: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    kind_probabilities: Mapping[str, float] = field(default_factory=dict)
    reach_cycles: float = 0.0
    squeezed_rise_db: float = 0.0
    agreement: float | None = None

    def __post_init__(self) -> None:
        low, high = self.interval_mm
        if not 0.0 <= low <= self.depth_mm <= high:
            raise InputError(f"the interval {low:g} to {high:g} mm does not hold the depth {self.depth_mm:g} mm")

    @property
    def kind(self) -> str:
        """What the event looks like: "cracked", "chipped or spalled", or "undecided".

        Very even gears, as in the demonstrations, let deep cracks look like chips: that takes more evidence.
        """
        cracked = self.kind_probabilities.get(CRACKED, 1.0)
        return CRACKED if cracked >= 0.7 else OTHER_DAMAGE if cracked <= 0.1 else "undecided"

    @property
    def likelier_other(self) -> bool:
        """Whether it is likelier chipped or spalled than cracked."""
        return self.kind_probabilities.get(CRACKED, 1.0) < 0.5

    @property
    def place(self) -> str:
        """Tooth or angle, and the gear, in words."""
        where = f"tooth {self.tooth}" if self.tooth is not None else f"{self.angle_deg:.0f}°"
        return f"{where} of {self.gear}{'' if self.gear_is_certain else ' (or its mate)'}"

    @property
    def size(self) -> str:
        """The depth with its interval, in words."""
        return f"{self.depth_mm:.1f} mm ({self.interval_mm[0]:.1f} to {self.interval_mm[1]:.1f} mm)"

    @property
    def text(self) -> str:
        """The statement in one sentence, or two."""
        not_cracked = odds_text(1.0 - self.kind_probabilities.get(CRACKED, 1.0))
        if self.kind == OTHER_DAMAGE:
            rather = f"{OTHER_DAMAGE} rather than cracked ({not_cracked})"
            return f"Damage at {self.place}, {rather}; a crack would be {self.size}."
        if self.likelier_other:
            return f"Damage at {self.place}: {OTHER_DAMAGE} ({not_cracked}), or a crack of {self.size}."
        text = f"Crack of {self.size}, {self.depth_percent:.0f} % of the root, at {self.place}."
        return text if self.kind == CRACKED else f"{text} Or it is {OTHER_DAMAGE} ({not_cracked})."


@dataclass(frozen=True)
class ToothSearch:
    """What was looked at on one gear: how far each place stands out, and how far a crack would have to.

    Parameters
    ----------
    gear, shaft : str
    teeth : int
    angle_deg : array, (n,)
        Of the shaft, 0 to 360: the middle of the engagement that a tooth at this angle has.
    level_db : array, (n,)
        Energy of a window of 1.5 pitches over that of the median window, mean over bands about the mesh harmonics.
    threshold_db : float
        Level from which the clearest event of this gear would count as a crack, all its energies rising alike.
    with_reference : bool
        Whether it is the difference from the healthy gear that was searched.
    """

    gear: str
    shaft: str
    teeth: int
    angle_deg: FloatArray
    level_db: FloatArray
    threshold_db: float
    with_reference: bool

    def __post_init__(self) -> None:
        freeze(self, "angle_deg", "level_db")


@dataclass(frozen=True)
class NoCrackSeen(Result):
    """No crack was seen, and how deep one may be that would not have shown.

    Parameters
    ----------
    below_mm, below_percent : float
        A crack that is deeper would have been seen in 95 of 100 cases, on either gear.
    p_value : float
        Of the clearest event there is.
    with_reference : bool
    features : mapping
        Of the clearest event.
    reasons : tuple of str
    searched : tuple of ToothSearch
        Of both gears.
    """

    below_mm: float
    below_percent: float
    p_value: float
    with_reference: bool
    features: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    searched: tuple[ToothSearch, ...] = field(default=(), repr=False, compare=False)

    @property
    def text(self) -> str:
        """The statement in one sentence."""
        return f"No crack seen: below {self.below_mm:.1f} mm ({self.below_percent:.0f} % of the root)."
