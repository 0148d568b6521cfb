"""Which orders of a Vold–Kalman problem lie close to each other, cross, or are the same; and how long each is there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.orders.vold_kalman_tracks import Tracks
from gearsig.orders.vold_kalman_weight import HALF_POWER

BoolArray = NDArray[np.bool_]
LOOKED_AT = 2**15
"""Samples at which orders are compared: their frequencies are smooth."""
CLOSE = 4.0
"""Distance in half bandwidths below which orders count as close."""


@dataclass(frozen=True)
class Neighbours:
    """How close orders k and m come while both are there.

    Parameters
    ----------
    k, m : int
    distance : float
        Smallest, in the unit of the tracks; infinite if they are never there together.
    leak : float
        Largest gain of either's filter for the other, 0 to 1.
    close_share : float
        Share of the common time at a distance below twice the wider bandwidth.
    drift : float
        Range of their phase difference in cycles.
    """

    k: int
    m: int
    distance: float
    leak: float
    close_share: float
    drift: float


def neighbours_of(tracks: Tracks, bandwidth: FloatArray, valid: BoolArray, poles: int) -> list[Neighbours]:
    """Compare each two orders; bandwidth (n_orders, n) or (n_orders, 1) in the unit of the tracks.

    The gain at distance d is 1/(1 + (√2 - 1)(2d/B)^2p), p being `poles`.
    """
    step = max(1, valid.shape[1] // LOOKED_AT)
    there, f, cycles = valid[:, ::step], tracks.frequency_hz[:, ::step], tracks.cycles[:, ::step]
    width = np.broadcast_to(bandwidth, valid.shape)[:, ::step]
    found = []
    for k, m in combinations(range(len(valid)), 2):
        both = there[k] & there[m]
        if not both.any():
            found.append(Neighbours(k, m, np.inf, 0.0, 0.0, np.inf))
            continue
        difference = (f[k] - f[m])[both]
        of_half = 2.0 * np.abs(difference) / np.maximum(width[k], width[m])[both]
        crossing = difference.min() <= 0.0 <= difference.max()
        nearest = 0.0 if crossing else float(of_half.min())
        found.append(
            Neighbours(
                k,
                m,
                distance=0.0 if crossing else float(np.abs(difference).min()),
                leak=1.0 / (1.0 + float(HALF_POWER) ** 2 * nearest ** (2 * poles)),
                close_share=float(np.mean(of_half < CLOSE)),
                drift=float(np.ptp((cycles[k] - cycles[m])[both])),
            )
        )
    return found


def check_distinct(neighbours: Iterable[Neighbours], tracks: Tracks) -> None:
    """Raise InputError if two orders never drift apart by half a cycle."""
    for pair in neighbours:
        if pair.drift < 0.5:
            raise InputError(
                f"orders {tracks.names[pair.k]!r} and {tracks.names[pair.m]!r} drift apart by {pair.drift:.3g} cycles "
                "only",
                where="orders",
                allowed="different orders",
                remedy="leave one of them out or record longer",
            )


def check_record_length(tracks: Tracks, bandwidth: FloatArray, valid: BoolArray, sampling_rate: float) -> None:
    """Raise InputError if a band is narrower than one over the time that the order is there."""
    for k, name in enumerate(tracks.names):
        duration = valid[k].sum() / sampling_rate
        width = float(np.median(np.broadcast_to(bandwidth[k], valid[k].shape)[valid[k]]))
        if width * duration < 1.0:
            raise InputError(
                f"the bandwidth of order {name!r} is {width:.4g} {tracks.unit}, and the order is there for "
                f"{duration:.4g} {tracks.duration_unit} only",
                where="bandwidth",
                allowed=f"at least {1 / duration:.4g} {tracks.unit}",
                remedy="widen the band or record longer",
            )


def mask_notes(tracks: Tracks, valid: BoolArray) -> list[str]:
    """Return a note for each order that is left out of a part of the recording."""
    left_out = 100.0 * (1.0 - valid.mean(axis=1))
    return [
        f"order {name!r} is left out for {percent:.2g} % of the time, where its band passes half the sampling rate or "
        "zero, or the shaft angle is not known"
        for name, percent in zip(tracks.names, left_out, strict=True)
        if percent > 0.0
    ]
