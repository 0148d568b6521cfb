"""The size of a gap relative to repeatability, and to differences between healthy machines and their simulation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.gap._features import Feature, Features, jackknife_variance
from gearsig.gap._report import Interval, PlaceKind

# --------------------
# Families of features that describe the same place of the spectrum, angle or signal.
# --------------------


Family = tuple[PlaceKind, str]
"""The kind of place, and "driver", "driven" or ""."""

_KIND = {
    "mesh": PlaceKind.MESH,
    "alike": PlaceKind.MESH,
    "apart.mesh": PlaceKind.MESH,
    "line.half_mesh": PlaceKind.MESH,
    "sideband": PlaceKind.SIDEBANDS,
    "shaft": PlaceKind.SHAFT,
    "tooth": PlaceKind.TOOTH,
    "change": PlaceKind.TOOTH,
    "surprise": PlaceKind.TOOTH,
    "burst": PlaceKind.TOOTH,
    "envelope": PlaceKind.ENVELOPE,
    "line": PlaceKind.LINE,
    "hum": PlaceKind.LINE,
    "floor": PlaceKind.BAND,
    "apart.floor": PlaceKind.BAND,
    "speed": PlaceKind.SPEED,
    "raw": PlaceKind.TAIL,
}
"""Family of features, or a single feature → the kind of place that it describes."""

UNPREDICTED = ("surprise.", "apart.", "alike.", "burst.")
"""Features, at the end, that depend on noise and sensors: no simulation predicts them, and they do not count in
sizes."""

_KINDS = {
    "mesh_harmonics": (PlaceKind.MESH,),
    "mesh_sidebands": (PlaceKind.SIDEBANDS,),
    "shaft_orders": (PlaceKind.SHAFT,),
    "tooth_window": (PlaceKind.TOOTH,),
    "envelope_orders": (PlaceKind.ENVELOPE,),
    "broadband": (PlaceKind.BAND,),
    "resonances": (PlaceKind.BAND, PlaceKind.MESH),
    "amplitude_tail": (PlaceKind.TAIL,),
    "speed": (PlaceKind.SPEED,),
}
"""Where an effect shows (`gearsig.gap.GapEffect.shows_in`), as kinds of places."""


def kinds_of(shows_in: Sequence[str]) -> set[PlaceKind]:
    """Return the kinds of places in which an effect shows."""
    return {kind for shown in shows_in for kind in _KINDS.get(shown, ())}


def shown_in(names: Sequence[str], shows_in: Sequence[str]) -> np.ndarray:
    """Return which features are of the kinds in which an effect shows; all of them if it states no known kind.

    Parameters
    ----------
    names : sequence of str
    shows_in : sequence of str
        See `gearsig.gap.GapEffect.shows_in`.

    Returns
    -------
    array of bool, (n,)
    """
    kinds = kinds_of(shows_in)
    shown = np.array([_is_shown(name, kinds, shows_in) for name in names], dtype=np.bool_)
    return shown if shown.any() else np.ones(len(names), dtype=np.bool_)


def _is_shown(name: str, kinds: set[PlaceKind], shows_in: Sequence[str]) -> bool:
    if name == "hum":
        return "mains_lines" in shows_in
    kind = family_of(name)[0]
    if kind is PlaceKind.TOOTH and "shaft_orders" in shows_in and Feature.of(name).detail in ("level", "elsewhere"):
        return True  # they describe all orders of the shaft, not one tooth
    return kind in kinds


def family_of(name: str) -> Family:
    """Return the family of a feature.

    Examples
    --------
    >>> family_of("sideband.driven.3to5")
    (<PlaceKind.SIDEBANDS: 'sidebands'>, 'driven')
    """
    feature = Feature.of(name)
    key = name if name in _KIND else feature.family
    return _KIND[key], feature.side


@cache
def family_members(names: tuple[str, ...]) -> dict[Family, np.ndarray]:
    """Return for each family the indices of its features."""
    members_of: dict[Family, list[int]] = {}
    for i, name in enumerate(names):
        members_of.setdefault(family_of(name), []).append(i)
    return {family: np.array(members, dtype=np.intp) for family, members in members_of.items()}


@cache
def sized_members(names: tuple[str, ...]) -> dict[Family, np.ndarray]:
    """Return for each family the indices of its features that count in the size of a gap."""
    kept = {
        family: np.array([i for i in rows if not names[i].startswith(UNPREDICTED)], dtype=np.intp)
        for family, rows in family_members(names).items()
    }
    return {family: rows for family, rows in kept.items() if len(rows)}


FLOOR_IN_DEVIATIONS = 1.96
"""A floor is the limit for 19 of 20 values, in standard deviations."""

WITHIN, ACROSS = 8, 4
"""Orders of the means within a family of features, and of the sum over families."""

PRIOR_WEIGHT = 4.0
"""Degrees of freedom with which a family's median scatter is pooled with a feature's own."""

MIN_SCATTER_DB = 0.05

_TAIL = 0.05


@dataclass(frozen=True)
class StructuralFloor:
    """Distances of healthy machines' features from their baseline.

    Parameters
    ----------
    names : tuple of str
        Names of features, see `feature_values` and `change_feature_values`.
    values : array, (n,), above 0
        dB: 19 of 20 healthy machines are within `centres` ± `values`.
    centres : array, (n,)
        dB, the healthy machines' median; default 0. It is 0 for differences, but not for features of a difference of
        patterns, `change.…`: noise alone has a level and a kurtosis.
    whole : float or None
        `soft_size` that one healthy machine in twenty exceeds; None: that of independent features.
    """

    names: tuple[str, ...]
    values: FloatArray
    centres: FloatArray | None = None
    whole: float | None = None
    _row: Mapping[str, int] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        n = len(self.names)
        if len(set(self.names)) != n:
            raise InputError("names of the floor repeat", allowed="each feature once")
        for name, default in (("values", None), ("centres", np.zeros(n))):
            values = getattr(self, name)
            array = frozen_array(default if values is None else values, name, ndim=1)
            if len(array) != n:
                raise InputError(f"{name} has {len(array)} numbers for {n} features", allowed="one each")
            object.__setattr__(self, name, array)
        if n and float(self.values.min()) <= 0.0:
            raise InputError("a floor is not above 0", where=self.names[int(np.argmin(self.values))], allowed="above 0")
        object.__setattr__(self, "_row", {name: i for i, name in enumerate(self.names)})

    @classmethod
    def of_healthy(cls, names: Sequence[str], rows: FloatArray, *, min_db: float = 0.2) -> StructuralFloor:
        """Return the floor from a table of healthy changes: medians, 95 % of distances, and the size of the whole.

        Parameters
        ----------
        names : sequence of str
        rows : array, (n_machines, n)
            At least 20 machines are needed for a meaningful result.
        min_db : float
            Minimum floor, as features that never changed in the table may still do so.
        """
        table = np.asarray(rows, dtype=np.float64)
        centres = np.median(table, axis=0)
        values = np.maximum(np.quantile(np.abs(table - centres), 1.0 - _TAIL, axis=0), min_db)
        sizes = [soft_size(names, row) for row in (table - centres) / values]
        return cls(tuple(names), values, centres, float(np.quantile(sizes, 1.0 - _TAIL)))

    def rows_of(self, names: Sequence[str]) -> np.ndarray:
        """Return the rows of features in the table.

        Raises
        ------
        InputError
            If one is missing.
        """
        missing = [name for name in names if name not in self._row]
        if missing:
            raise InputError(
                f"the structural floor lacks {', '.join(missing[:3])}",
                remedy="make the floor's table with the present features",
            )
        return np.array([self._row[name] for name in names], dtype=np.intp)

    def of(self, names: Sequence[str]) -> FloatArray:
        """Return the floors of features, in dB."""
        floors: FloatArray = self.values[self.rows_of(names)]
        return floors

    def from_centre(self, names: Sequence[str], values: FloatArray) -> FloatArray:
        """Return the distances of changes from the healthy machines' median, in dB."""
        assert self.centres is not None  # noqa: S101 - set above, said to the type checker
        distances: FloatArray = values - self.centres[self.rows_of(names)]
        return distances

    def over(self, change: Features) -> FloatArray:
        """Return signed changes in structural floors."""
        return self.from_centre(change.names, change.values) / self.of(change.names)

    def floor_size(self, names: Sequence[str]) -> float:
        """Return the `soft_size` that equals one structural floor."""
        return independent_floor_size(tuple(names)) if self.whole is None else self.whole


@dataclass(frozen=True)
class GapSize:
    """The size of the whole gap; one healthy machine, or one repeated record, in twenty exceeds 1.

    Parameters
    ----------
    structural, repeatability : Interval
    """

    structural: Interval
    repeatability: Interval


def gap_size(change: Features, structural: StructuralFloor) -> GapSize:
    """Return the size of the whole gap in both floors, with 90 % intervals from the blocks of revolutions.

    s = [Σ_f (mean_{i∈f} |d_i/e_i|⁸)^(4/8)]^(1/4)/s_0, families f, changes d, floors e, s_0 the size of one floor.

    An RMS over all features would hide a few large changes among a hundred small ones; the maximum would depend on a
    single number, and its jackknife on chance. Means of high order are in between, and smooth. Features of one family
    are redundant: their mean counts once however many there are; families add.

    The interval is ± t SE, from the jackknife over the sizes without each block. Correlated features change together in
    it, so no assumption about them is needed.

    Parameters
    ----------
    change : Features
        With its `left_out` values.
    structural : StructuralFloor
    """
    scatter = FLOOR_IN_DEVIATIONS * pooled_scatter(change)
    floors = structural.of(change.names)
    return GapSize(
        _size(change, structural, floors, structural.floor_size(change.names)),
        _size(change, structural, scatter, independent_floor_size(change.names)),
    )


def _size(change: Features, structural: StructuralFloor, floors: FloatArray, whole: float) -> Interval:
    """Return the size with its interval."""

    def size(values: FloatArray) -> float:
        return soft_size(change.names, structural.from_centre(change.names, values) / floors) / whole

    value = size(change.values)
    variance = sum(float(jackknife_variance(np.array([size(row) for row in rows]))) for rows in change.left_out)
    return Interval.around(value, t_quantile(_degrees(change)) * variance**0.5, low=0.0)


def _degrees(change: Features) -> int:
    """Return the degrees of freedom of the jackknife with the fewest blocks."""
    return min((len(rows) for rows in change.left_out), default=2) - 1


def t_quantile(degrees: int) -> float:
    """Return the two-sided 90 % quantile of Student's t."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.95))


def soft_size(names: Sequence[str], normalised: FloatArray) -> float:
    """Return the size of a gap, [Σ_f (mean_{i∈f} |u_i|⁸)^(4/8)]^(1/4), over families f of features.

    It is close to the largest family's size, and slightly larger where several changed. See `family_size`.

    Parameters
    ----------
    names : sequence of str
        Names of the n features.
    normalised : array, (n,)
        Changes over their floors.
    """
    sizes = np.array([family_size(normalised[members]) for members in sized_members(tuple(names)).values()])
    largest = float(sizes.max(initial=0.0))
    return largest * float(np.sum((sizes / largest) ** ACROSS) ** (1 / ACROSS)) if largest > 0.0 else 0.0


def family_size(normalised: FloatArray) -> float:
    """Return (mean |u_i|⁸)^(1/8): close to the maximum, and three quarters of it where only one of nine changed.

    Parameters
    ----------
    normalised : array, (n,)
        Changes of a family's features over their floors.
    """
    largest = float(np.max(np.abs(normalised), initial=0.0))
    if largest == 0.0:
        return 0.0
    return largest * float(np.mean((np.abs(normalised) / largest) ** WITHIN) ** (1 / WITHIN))


def pooled_scatter(change: Features) -> FloatArray:
    """Return standard errors shrunk towards their family's median, since a jackknife over few blocks is uncertain.

    s² = (ν0 s0² + ν s²)/(ν0 + ν), s0 the family's median, ν the degrees of freedom, ν0 = `PRIOR_WEIGHT`.

    Source: G. K. Smyth, *Linear models and empirical Bayes methods for assessing differential expression in microarray
    experiments* (Statistical Applications in Genetics and Molecular Biology, 2004).

    Parameters
    ----------
    change : Features

    Returns
    -------
    array, (n,)
        dB, at least `MIN_SCATTER_DB` before pooling.
    """
    variance = np.maximum(change.scatter, MIN_SCATTER_DB) ** 2
    degrees = _degrees(change)
    pooled = np.empty_like(variance)
    for members in family_members(change.names).values():
        typical = float(np.median(variance[members]))
        pooled[members] = (PRIOR_WEIGHT * typical + degrees * variance[members]) / (PRIOR_WEIGHT + degrees)
    scatter: FloatArray = np.sqrt(pooled)
    return scatter


_N_DRAWS = 2000


@cache
def independent_floor_size(names: tuple[str, ...]) -> float:
    """Return the `soft_size` that one in twenty exceeds if features are independent and normal, each at its floor.

    It depends on the features' names only and is found by simulation with a fixed seed.

    Parameters
    ----------
    names : tuple of str
        Names of the features.
    """
    draws = np.random.default_rng(0).standard_normal((_N_DRAWS, len(names))) / FLOOR_IN_DEVIATIONS
    total = np.zeros(_N_DRAWS)
    for members in sized_members(names).values():
        total += np.mean(np.abs(draws[:, members]) ** WITHIN, axis=1) ** (ACROSS / WITHIN)
    return float(np.quantile(total, 1.0 - _TAIL) ** (1 / ACROSS))


def credibility_of(features: FloatArray, simulated: FloatArray) -> FloatArray:
    """Return the slope of healthy machines' features over those of their simulations, limited to 0 … 1.

    A simulation knows how a feature depends on geometry, speed and load, but little about how impulsive or irregular a
    machine is; there, subtracting its full value would add its own scatter. The slope leaves the smallest remainder.

    Source: the credibility factor of H. Bühlmann, "Experience rating and credibility", ASTIN Bulletin 4 (1967).

    Parameters
    ----------
    features, simulated : arrays, (n, n_features)
    """
    recorded, twin = features - features.mean(axis=0), simulated - simulated.mean(axis=0)
    slope: FloatArray = (recorded * twin).sum(axis=0) / np.maximum((twin**2).sum(axis=0), 1e-9)
    return np.clip(slope, 0.0, 1.0)
