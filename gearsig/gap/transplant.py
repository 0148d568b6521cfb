"""What an effect that was simulated on a twin would change on the real machine, whose own unevenness is another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.gear_lines import SIDEBANDS, SIDES

_RELATIVE = (
    "mesh.half",
    *(f"sideband.{side}.{label}" for side in SIDES for label in (*SIDEBANDS, "own")),
    *(f"shaft.{side}.{n}.to_mesh" for side in SIDES for n in (1, 2, 3, "strongest")),
    *(f"shaft.{side}.low" for side in SIDES),
    *(f"tooth.{side}.{what}" for side in SIDES for what in ("level", "elsewhere", "peak")),
)
"""Powers over that of the mesh, or of its harmonic."""

_ABSOLUTE = (*(f"shaft.{side}.{n}" for side in SIDES for n in (1, 2, 3)), "floor.total")
_OF_THE_BODY = tuple(f"shaft.{side}.{n}{what}" for side in SIDES for n in (1, 2, 3) for what in ("", ".to_mesh"))
"""Low orders, at which a machine moves as a whole."""

_STRONGEST = {"shaft.{}.strongest": "shaft.{}.strongest.to_mesh", "sideband.{}.strongest": "sideband.{}.6to12"}
"""How far the strongest line stands out, and the power by which an effect raises it."""

_BANDS, _KURTOSIS = "floor.band.", "floor.kurtosis."
_EXCESSES = ("envelope.", "line.")
_NO_EXCESS = ("envelope.depth",)
_OF_A_PATTERN = ("prominence", "second", "kurtosis", "width", "below_mesh", "centroid")


def transplanted(
    names: Sequence[str],
    change: FloatArray,
    simulated: Mapping[str, float],
    real: Mapping[str, float],
    usual: Mapping[str, float],
    level_db: float = 0.0,
    ground_db: float = 0.0,
) -> FloatArray:
    """Return the changes that a simulated effect makes on the real machine's own baseline.

    Powers of different causes add: P = P_real + (P_with − P_sound). On a twin whose teeth are rougher than the real
    ones, or whose floor is lower, the same effect changes the decibels less or more. Mesh harmonics pass through the
    same resonances as those of the sound machine and change by the same decibels each; what they do together hangs on
    which of them the real machine has. What falls, falls by the same decibels.

    Parameters
    ----------
    names : sequence of str
        Of the changes, see `gearsig.gap.change`; those of patterns last, or none.
    change : array, (n,)
        dB, with the effect less sound, both simulated. `change.…`: the pattern's own value.
    simulated, real : mapping
        Feature → value of the sound twin and of the sound machine.
    usual : mapping
        `change.…` → what mere repetition gives.
    level_db : float
        By which everything the effect adds is louder on the real machine than on the twin: its path is another.
    ground_db : float
        By which the lowest shaft orders are louder still: it stands otherwise. There a machine moves as a whole, as
        force over mass, and not by the path on which the mesh reaches a sensor: what is added does not fall with a
        mesh that is quieter than the twin's.

    Returns
    -------
    array, (n,)
        dB; `change.…` from what repetition gives.
    """
    given = dict(zip(names, change.tolist(), strict=True))
    found = dict(given)
    gain_db = real["mesh.total"] - simulated["mesh.total"]
    floor_db = real["floor.total"] - simulated["floor.total"] - gain_db
    for name in names:
        own_db = level_db + (ground_db - gain_db if name in _OF_THE_BODY else 0.0)
        if name in _RELATIVE:
            found[name] = _added(given[name], simulated[name], real[name], own_db)
        elif name in _ABSOLUTE or name.startswith(_BANDS):
            found[name] = _added(given[name], simulated[name], real[name], gain_db + own_db)
        elif name.startswith(_EXCESSES) and name not in _NO_EXCESS:
            found[name] = _added(given[name], simulated[name], real[name], level_db - floor_db)
    found |= _mesh(given, real, level_db)
    for name in names:
        if name.startswith(_KURTOSIS):
            part = _part(found[name.replace(_KURTOSIS, _BANDS)])
            found[name] = part * (simulated[name] + given[name] - real[name])
    for side in SIDES:
        for name, rose in _STRONGEST.items():
            own = name.format(side)
            found[own] = _risen(real[own], simulated[own] + given[own], found[rose.format(side)])
        found |= _tooth(f"tooth.{side}", found, given, simulated, real)
        if f"change.{side}.level" in given:
            found |= _pattern(f"change.{side}", given, usual, real[f"tooth.{side}.level"], level_db)
    return np.array([found[name] for name in names])


def _power(decibels: float) -> float:
    return float(10.0 ** (decibels / 10.0))


def _added(change_db: float, simulated_db: float, real_db: float, gain_db: float) -> float:
    """Return the change that the same added power makes on the real baseline."""
    if change_db <= 0.0:
        return change_db
    more = (_power(simulated_db + change_db) - _power(simulated_db)) * _power(gain_db)
    return float(10.0 * np.log10(1.0 + more / _power(real_db)))


def _mesh(given: Mapping[str, float], real: Mapping[str, float], level_db: float) -> dict[str, float]:
    """Return the mesh harmonics' changes: what is added comes as much louder, on the harmonics that the machine has."""
    shares = [name for name in given if name.startswith("mesh.share.")]
    levels = [_louder(given[name] + given["mesh.total"], level_db) for name in shares]
    powers = np.array([_power(real[name]) for name in shares])
    total = float(10.0 * np.log10(powers @ [_power(level) for level in levels] / powers.sum()))
    return {"mesh.total": total} | {name: level - total for name, level in zip(shares, levels, strict=True)}


def _louder(change_db: float, level_db: float) -> float:
    """Return the change in decibels if what is added were louder by a level; what falls, falls alike."""
    return _added(change_db, 0.0, 0.0, level_db)


def _part(change_db: float) -> float:
    """Return which part of the power is the effect's, if that raised it by so many decibels."""
    return 1.0 - 1.0 / _power(change_db) if change_db > 0.0 else 0.0


def _risen(born_db: float, own_db: float, more_db: float) -> float:
    """Return by how much the strongest stands out further: as much as it rose, no further than by itself alone."""
    return min(born_db + max(more_db, 0.0), max(own_db, born_db)) - born_db


def _tooth(
    name: str,
    found: Mapping[str, float],
    given: Mapping[str, float],
    simulated: Mapping[str, float],
    real: Mapping[str, float],
) -> dict[str, float]:
    """Return the shape of a shaft's pattern where the effect's own is added to what the real teeth are born with."""
    peak, elsewhere = found[f"{name}.peak"], found[f"{name}.elsewhere"]
    part = _part(found[f"{name}.level"])
    shapes = {
        f"{name}.{what}": part * (simulated[f"{name}.{what}"] + given[f"{name}.{what}"] - real[f"{name}.{what}"])
        for what in ("kurtosis", "width", "below_mesh", "centroid")
    }
    second = _risen(real[f"{name}.second"], simulated[f"{name}.second"] + given[f"{name}.second"], peak)
    return {f"{name}.prominence": peak - elsewhere, f"{name}.second": second, **shapes}


def _pattern(
    name: str, given: Mapping[str, float], usual: Mapping[str, float], own_db: float, level_db: float
) -> dict[str, float]:
    """Return how far the pattern of the difference lies from what mere repetition gives."""
    found = {}
    for what in ("level", "elsewhere", "peak"):
        key = f"{name}.{what}"
        found[key] = float(10.0 * np.log10(1.0 + _power(given[key] + level_db) / _power(usual[key])))
    part = _part(found[f"{name}.level"])
    for what in _OF_A_PATTERN:
        key = f"{name}.{what}"
        found[key] = part * (given[key] - usual[key])
    agreement = (1.0 + _power(given[f"{name}.level"] + level_db - own_db)) ** -0.5
    found[f"{name}.agreement"] = 10.0 * (agreement - 1.0)
    return found
