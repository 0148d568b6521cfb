"""The difference between a shaft's average and that of the sound gear: what every tooth is born with cancels."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.severity.shaft_lines import ShaftLines, orders_from_mesh

LARGEST_SPEED_DIFFERENCE = 0.02
"""Relative, as in the calibration; beyond, resonances amplify both recordings differently."""

LARGEST_GAIN_CHANGE = 0.15

_MESH_HARMONICS = 6
_FINE_STEPS_PER_TOOTH = 16
_SHAFT_ORDERS = 4


def difference_lines(now: ShaftLines, sound: ShaftLines, *, whole_teeth: bool) -> tuple[ShaftLines, float]:
    """Return the lines of `now` less those of the sound gear, turned so that the same teeth meet.

    d[n] = x[n] − r[n] e^{−2πi n s}, with the shift s that gives the largest Σ w[n] Re(x[n] r*[n] e^{2πi n s}).

    Parameters
    ----------
    now, sound : ShaftLines
        Of the same shaft and channels.
    whole_teeth : bool
        Whether the shift can only be a whole number of teeth: the mate's mark fixes the phase of the mesh. Without a
        mark anywhere it is searched in sixteenths of a tooth; where both have a mark on this shaft, it is 0.

    Returns
    -------
    ShaftLines
    agreement : float
        Σ w Re(…)/Σ w |…| at the shift: 1 where the teeth's pattern is the same. A deep crack lowers it, too.

    Raises
    ------
    RefusalError
        If the speeds differ too much.
    """
    check_same_speed(now, sound)
    highest = min(now.highest_order, sound.highest_order)
    orders = np.arange(highest + 1)
    x, r = now.lines[:, : highest + 1], sound.lines[:, : highest + 1]
    cross = _weighted_cross(x, r, now.teeth)
    shifts = _shifts(now, sound, whole_teeth)
    scores = np.real(np.exp(2j * np.pi * np.outer(shifts, orders)) @ cross)
    best = int(np.argmax(scores))
    agreement = float(scores[best] / np.abs(cross).sum()) if np.any(cross) else 0.0
    turned = r * np.exp(-2j * np.pi * orders * shifts[best])
    return replace(now, lines=x - _matched(turned, x, now.teeth), highest_order=highest), agreement


def check_same_speed(now: ShaftLines, sound: ShaftLines) -> None:
    """Refuse a reference at another speed."""
    change = abs(now.order_hz / sound.order_hz - 1.0)
    if change > LARGEST_SPEED_DIFFERENCE:
        rpm = tuple(60.0 * shaft.order_hz for shaft in (sound, now))
        raise RefusalError(
            f"the reference was taken at a speed {100 * change:.1f} % off: shaft {now.shaft!r} turns at {rpm[0]:.5g} "
            f"rpm there, at {rpm[1]:.5g} rpm in the recording",
            remedy=f"take it within {100 * LARGEST_SPEED_DIFFERENCE:.0f} % of the same speed, at the same load",
        )


def _matched(reference: np.ndarray, x: np.ndarray, teeth: int) -> np.ndarray:
    """Return the reference, each mesh harmonic's band of each channel times the complex gain that fits `x` best.

    A slightly other speed or load changes amplitude and phase of the teeth's pattern a little, alike within a band.
    g = Σ x r*/Σ|r|², held within `LARGEST_GAIN_CHANGE` of 1: more would take the crack for a gain.
    """
    orders = np.arange(x.shape[1])
    used = telling_teeth_apart(orders, teeth)
    fitted = reference.copy()
    for k in range(x.shape[1] // teeth + 1):
        band = (orders + teeth // 2) // teeth == k
        fit = band & used
        power = np.sum(np.abs(reference[:, fit]) ** 2, axis=1)
        product = np.sum(x[:, fit] * np.conj(reference[:, fit]), axis=1)
        change = np.divide(product, power, out=np.ones_like(product), where=power > 0) - 1.0
        change *= np.minimum(1.0, LARGEST_GAIN_CHANGE / np.maximum(np.abs(change), 1e-12))
        fitted[:, band] *= (1.0 + change)[:, None]
    return fitted


def telling_teeth_apart(orders: np.ndarray, teeth: int) -> np.ndarray:
    """Return which orders tell one tooth from another; shaft orders, mesh lines and their sidebands hardly do."""
    used: np.ndarray = (orders > _SHAFT_ORDERS) & (orders_from_mesh(orders, teeth) > 1)
    return used


def _shifts(now: ShaftLines, sound: ShaftLines, whole_teeth: bool) -> FloatArray:
    if now.has_mark and sound.has_mark:
        return np.zeros(1)
    n = now.teeth * (1 if whole_teeth else _FINE_STEPS_PER_TOOTH)
    return np.arange(n) / n


def _weighted_cross(x: np.ndarray, r: np.ndarray, teeth: int) -> np.ndarray:
    """Cross spectrum, summed over channels; strong lines count by their root."""
    orders = np.arange(x.shape[1])
    used = telling_teeth_apart(orders, teeth) & (orders <= _MESH_HARMONICS * teeth)
    size = np.sqrt(np.abs(x) * np.abs(r))
    cross: np.ndarray = np.divide(x * np.conj(r), size, out=np.zeros_like(x), where=(size > 0) & used).sum(axis=0)
    return cross
