"""The fitted relation between features and depth, with its intervals and limits; numbers only, no fitting."""

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

NORMAL_90 = 1.645
"""Half of the interval that holds 90 % of a normal distribution, in standard deviations."""

MIN_SPREAD = 0.1
"""Of ln percent: no machine is known to better than ten percent."""


def _freeze(model: object, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Make the arrays of a frozen model read-only, after checking their shapes."""
    for name, shape in shapes.items():
        array = frozen_array(getattr(model, name), f"{name} of the model", ndim=len(shape))
        if array.shape != shape:
            raise InputError(f"{name} of the model has shape {array.shape}", allowed=str(shape))
        object.__setattr__(model, name, array)


def segments(values: FloatArray, knots: FloatArray) -> FloatArray:
    """Return how far values lie below the first knot, between the knots, and above the second; (…, 3).

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
    """ln percent = c + Σ b_i z_i + Σ_j g_j(z_j), z = (f − m)/s, with rising curves g_j; its interval and its limits.

    Parameters
    ----------
    mean, scale : arrays, (n_features,)
        m and s.
    intercept : float
    coefficients : array, (n_features,)
        b; 0 for the features that rise with the depth.
    knots, slopes : arrays, (n_shaped, 2) and (n_shaped, 3)
        Of the curves g of the features `SHAPED`: linear below, between and above the knots. Slopes are not negative.
    spread : array, (n_features + 1,)
        Of ln percent: σ = max(spread[0] + Σ spread[i] (f_i − m_i)/s_i, 0.1).
    quantiles : tuple of two floats
        5 % and 95 % quantiles of (ln true percent − predicted)/σ, predicted by models not fitted to the same rig.
    detection : array, (n_features,)
        Weights of the detection score.
    threshold : float
        Score from which a crack counts as seen.
    healthy_scores : array, (n_healthy,)
        Scores of healthy gear pairs, ascending: the higher one of the two gears.
    precision : array, (n_features, n_features)
        Inverse covariance of the features (f_i − m_i)/s_i; 0 for those that the depth is not estimated from.
    largest_distance : float
        Mahalanobis distance beyond which a feature vector is unlike the calibration's.
    lowest, highest : arrays, (n_features,)
        Range of each feature among the calibration's cracks.
    percent_range : tuple of two floats
        Range of depths in the calibration.
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
        """Build it from the contents of a JSON file."""
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
        # No machine is known to better than ten percent.
        spread = max(float(self.spread[0] + self.standardised(features) @ self.spread[1:]), MIN_SPREAD)
        centre = self.log_percent(features)
        return centre + self.quantiles[0] * spread, centre + self.quantiles[1] * spread

    def score(self, features: FloatArray) -> float:
        """Return the detection score."""
        return float(self.standardised(features) @ self.detection)

    def p_value(self, score: float) -> float:
        """Return (1 + number of healthy pairs with at least this score)/(1 + number of healthy pairs)."""
        higher = len(self.healthy_scores) - int(np.searchsorted(self.healthy_scores, score, side="left"))
        return (1.0 + higher) / (1.0 + len(self.healthy_scores))

    def is_weaker(self, features: FloatArray) -> bool:
        """Return whether an event is weaker, over the mesh, than those of the shallowest cracks in the calibration."""
        sizes = [FEATURES.index(name) for name in ("band_excess", "line_excess")]
        return bool(np.any(self._beyond(features)[0][sizes] > 0))

    def _beyond(self, features: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far each feature lies below and above the calibration's range and a margin; negative inside."""
        margin = 0.05 * (self.highest - self.lowest)
        return self.lowest - margin - features, features - self.highest - margin

    def unlike(self, features: FloatArray) -> str:
        """Return how a feature vector is unlike the calibration's cracks; empty if it is not."""
        beyond = np.maximum(*self._beyond(features))
        beyond[np.diag(self.precision) == 0] = 0.0  # an event may be clearer than any in the calibration
        i = int(np.argmax(beyond))
        if beyond[i] > 0:
            phrase, unit, scale = IN_WORDS.get(FEATURES[i], (FEATURES[i].replace("_", " "), "", 1.0))
            value, lowest, highest = scale * features[i], scale * self.lowest[i], scale * self.highest[i]
            theirs = f"theirs {lowest:.1f} to {highest:.1f} {unit}".rstrip()
            return with_minus(f"{phrase} is {value:.1f} {unit}".rstrip() + f", {theirs}")
        z = self.standardised(features)
        distance = float(np.sqrt(z @ self.precision @ z))  # Mahalanobis
        if distance > self.largest_distance:
            return f"its features lie {distance:.1f} from their middle, the limit is {self.largest_distance:.1f}"
        return ""

    def at_threshold(self, features: FloatArray) -> FloatArray:
        """Return the features of the smallest visible crack at this place.

        All energies of the event are raised by the same factor until the score reaches the threshold. If it is already
        there, nothing changes.
        """
        result = np.array(features, dtype=np.float64)
        result[[FEATURES.index(name) for name in RISING]] += max(0.0, self._missing_rise(features))
        return result

    def threshold_prominence(self, features: FloatArray) -> float:
        """Return ln of the prominence at which an event with these features would just count as a crack.

        For an event that is a crack it lies below the event's own; see `at_threshold`.
        """
        return float(features[FEATURES.index("prominence")]) + self._missing_rise(features)

    def _missing_rise(self, features: FloatArray) -> float:
        """Return by how much ln of all energies would have to rise to reach the threshold; negative beyond it."""
        rising = [FEATURES.index(name) for name in RISING]
        gain = float(np.sum(self.detection[rising] / self.scale[rising]))
        return (self.threshold - self.score(features)) / gain


CRACKED, CHIPPED, SPALLED = KINDS = ("cracked", "chipped", "spalled")
OTHER_DAMAGE = "chipped or spalled"

# Without the event's size and prominence: a deep crack is not a chip because it is large.
_USED = [i for i, name in enumerate(FEATURES) if name not in (*RELIEF, *RISING)]
KIND_FEATURES = (*(FEATURES[i] for i in _USED), *SHAPE)


def kind_vector(features: FloatArray, shape: FloatArray) -> FloatArray:
    """Return the features that the kind is read from, in the order of `KIND_FEATURES`."""
    return np.concatenate([np.asarray(features)[_USED], shape])


@dataclass(frozen=True)
class KindModel:
    """p_k = exp(b_k + Σ w_ki z_i)/Σ_j exp(b_j + …), z = (f − m)/s limited to ±4: values beyond say no more.

    Parameters
    ----------
    mean, scale : arrays, (n_features,)
        m and s.
    weights : array, (3, n_features + 1)
        b_k before w_ki, in the order of `KINDS`. Prior: as many cracks as chips and spalls together, at any depth.
    """

    mean: FloatArray
    scale: FloatArray
    weights: FloatArray

    def __post_init__(self) -> None:
        n = len(KIND_FEATURES)
        _freeze(self, {"mean": (n,), "scale": (n,), "weights": (len(KINDS), n + 1)})

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> KindModel:
        """Build it from the contents of a JSON file."""
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
"""Suffix of the names of the models that know the tip relief."""


@dataclass(frozen=True)
class Calibration:
    """The calibration made by `python -m app.studies.crack_severity`.

    Parameters
    ----------
    models : mapping
        "with_reference" and "alone", also with the suffix "_relief_known" → DepthModel.
    kinds : mapping
        "with_reference" and "alone" → KindModel.
    reach : mapping
        Quantity → (lowest, highest) value among the calibration's machines.
    lag_pitches : float
        Delay of the event's centre after the middle of the tooth's engagement, in pitches.
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
        """Build it from the contents of a JSON file.

        Raises
        ------
        InputError
            If it was made for other features than this version computes.
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
        """Refuse a machine outside the calibration's range.

        Raises
        ------
        RefusalError
            Naming every quantity that is outside.
        """
        outside = []
        for name, value in features.items():
            low, high = self.reach[name]
            if not low * (1 - 1e-9) <= value <= high * (1 + 1e-9):
                outside.append(
                    f"{REACH_WORDS.get(name, name)} is {value:.4g}, the calibration has {low:.4g} to {high:.4g}"
                )
        if outside:
            raise RefusalError(
                "the crack estimate is not calibrated for this machine or operating point: " + "; ".join(outside),
                remedy="record at another speed or load, or make a calibration for such machines",
            )


REACH_WORDS = {
    "module_mm": "the module in mm",
    "load_mpa": "the tangential force per face width and module in MPa",
    "mesh_hz": "the mesh frequency in Hz",
    "fewer_teeth": "the smaller number of teeth",
    "more_teeth": "the larger number of teeth",
}
"""Quantity of a calibration's reach → in words."""


@cache
def load_calibration() -> Calibration:
    """Return the calibration that comes with this version."""
    return Calibration.from_mapping(json.loads(FILE.read_text(encoding="utf-8")))


class UnlikeCracksError(RefusalError):
    """One tooth stands out, but unlike the calibration's cracks."""


TEETH_COUNT = "Teeth count from 1 at the mark in order of engagement; the place is good to about one tooth."
"""Beside the number of a tooth."""

NO_MARK = "There is no mark on this shaft: the angle holds for this record only, and names no tooth."
LARGEST_BOUND_PERCENT = 50.0
"""Percent of the root: "no crack seen, below 70 %" would be no answer."""


@dataclass(frozen=True)
class CrackEstimate(Result):
    """A damaged tooth was seen: whether it is cracked and, if so, how deep the crack is.

    Parameters
    ----------
    shaft : str
        Of the gear with the crack.
    gear : str
        "pair/shaft".
    tooth : int or None
        From 1 at the shaft's mark, in order of engagement; None where there is no mark on this shaft.
    angle_deg : float
        Of the shaft at the middle of the tooth's engagement; counted from the mark, or from an arbitrary start.
    gear_is_certain : bool
        False where both gears show it alike: gears with equal tooth numbers meet the same mate every revolution.
    depth_mm, depth_percent : float
        Length of a straight crack at 45° through the face width, and the share of the root's thickness it takes away.
    interval_mm, interval_percent : tuples of two floats
        Contains the depth in 90 % of cases, for machines like the calibration's; with a lower end for teeth that give
        way more, as finite elements do.
    p_value : float
        Probability of an event this clear on a healthy gear pair, from the calibration's healthy pairs; by encoders at
        most the inverse of the likelihood ratio (Markov's inequality); by both, the product.
    with_reference : bool
        Whether it was compared with a recording of the healthy gears.
    features : mapping
        Name → value of the features behind the estimate; see `gearsig.severity`.
    reasons : tuple of str
        What the reader should know, one sentence each.
    kind_probabilities : mapping
        "cracked", "chipped", "spalled" → probability, with cracks as frequent as chips and spalls together.
    reach_cycles : float or None
        For how many mesh cycles after its centre the event has four times a median other tooth's energy. It depends on
        damping and resonances as much as on the depth; the estimate does not use it. None: by encoders.
    squeezed_rise_db : float or None
        Synchrosqueezed energy at high orders near the tooth over that of a median healthy tooth; see
        `gearsig.severity`. The estimate does not use it.
    agreement : float or None
        How closely the tooth pattern agrees with the reference's, see `difference_lines`; None without a reference.
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
    reach_cycles: float | None = None
    squeezed_rise_db: float | None = None
    agreement: float | None = None

    def __post_init__(self) -> None:
        low, high = self.interval_mm
        if not 0.0 <= low <= self.depth_mm <= high:
            raise InputError(f"the interval {low:g} to {high:g} mm does not hold the depth {self.depth_mm:g} mm")

    @property
    def kind(self) -> str:
        """What the event looks like: "cracked", "chipped or spalled", or "undecided".

        On very uniform gears, as in the demonstrations, deep cracks look like chips: that verdict needs more evidence.
        """
        cracked = self.kind_probabilities.get(CRACKED, 1.0)
        return CRACKED if cracked >= 0.7 else OTHER_DAMAGE if cracked <= 0.1 else "undecided"

    @property
    def likelier_other(self) -> bool:
        """Whether it is more likely chipped or spalled than cracked."""
        return self.kind_probabilities.get(CRACKED, 1.0) < 0.5

    @property
    def place(self) -> str:
        """Tooth or angle, and the gear, in words."""
        where = f"tooth {self.tooth}" if self.tooth is not None else f"{round(self.angle_deg) % 360}°"
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
    """The search of one gear: how far each place stands out, and how far a crack would have to.

    Parameters
    ----------
    gear, shaft : str
    teeth : int
    angle_deg : array, (n,)
        Of the shaft, 0 to 360: the middle of the engagement of a tooth at this angle.
    level_db : array, (n,)
        Energy of a window of 1.5 pitches over the median window's, averaged over bands about the mesh harmonics.
    threshold_db : float
        Level at which the clearest event of this gear would count as a crack, if all its energies rose alike.
    with_reference : bool
        Whether the difference from the healthy gear was searched.
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
    """No crack was seen, and how deep a crack may be without being seen.

    Parameters
    ----------
    below_mm, below_percent : float
        A deeper crack would have been seen in 95 of 100 cases, on either gear.
    p_value : float
        Of the clearest event.
    with_reference : bool
    features : mapping
        Of the clearest event.
    reasons : tuple of str
    searched : tuple of ToothSearch
        Of both gears.
    stands_out : bool
        Whether something stands out at one tooth as clearly as a crack, though weaker than any of the calibration.
    """

    below_mm: float
    below_percent: float
    p_value: float
    with_reference: bool
    features: Mapping[str, float] = field(default_factory=dict)
    reasons: tuple[str, ...] = ()
    searched: tuple[ToothSearch, ...] = field(default=(), repr=False, compare=False)
    stands_out: bool = False

    @property
    def text(self) -> str:
        """The statement in one sentence."""
        return f"No crack seen: below {self.below_mm:.1f} mm ({self.below_percent:.0f} % of the root)."
