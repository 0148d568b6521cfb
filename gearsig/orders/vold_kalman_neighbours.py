"""Which orders of a Vold–Kalman problem lie close to each other, cross, or are the same."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.orders.vold_kalman_tracks import Tracks

BoolArray = NDArray[np.bool_]
CLOSE_SHARE = 1e-3
"""Share of the time below which closeness is not worth a note."""


def check_record_length(tracks: Tracks, bandwidth_hz: FloatArray, valid: BoolArray, sampling_rate_hz: float) -> None:
    """Raise InputError if a band is narrower than one over the time that the order is there."""
    for k, name in enumerate(tracks.names):
        duration = valid[k].sum() / sampling_rate_hz
        width = float(np.median(np.broadcast_to(bandwidth_hz[k], valid[k].shape)[valid[k]]))
        if width * duration < 1.0:
            raise InputError(
                f"the bandwidth of order {name!r} is {width:.4g} Hz, and the order is there for {duration:.4g} s only",
                where="bandwidth",
                allowed=f"at least {1 / duration:.4g} Hz",
                remedy="widen the band or record longer",
            )


def check_distinct(tracks: Tracks, valid: BoolArray) -> None:
    """Raise InputError if two orders never drift apart by half a cycle."""
    for k, m in combinations(range(len(valid)), 2):
        both = valid[k] & valid[m]
        if not both.any():
            continue
        drift = (tracks.cycles[k] - tracks.cycles[m])[both]
        if np.ptp(drift) < 0.5:
            raise InputError(
                f"orders {tracks.names[k]!r} and {tracks.names[m]!r} drift apart by {np.ptp(drift):.3g} cycles only",
                where="orders",
                allowed="different orders",
                remedy="leave one of them out or record longer",
            )


def closeness_notes(tracks: Tracks, bandwidth_hz: FloatArray, valid: BoolArray, coupled: bool) -> list[str]:
    """Return a note for each two orders whose distance falls below twice a bandwidth."""
    notes = []
    for k, m in combinations(range(len(valid)), 2):
        both = valid[k] & valid[m]
        distance = np.abs(tracks.frequency_hz[k] - tracks.frequency_hz[m])
        close = both & (distance < 2.0 * np.maximum(bandwidth_hz[k], bandwidth_hz[m]))
        share = close.sum() / max(1, both.sum())
        if share <= CLOSE_SHARE:
            continue
        pair = f"orders {tracks.names[k]!r} and {tracks.names[m]!r} come as close as {distance[close].min():.3g} Hz"
        if coupled:
            notes.append(
                f"{pair}; they are solved for together, and told apart where they stay close for long enough to beat"
            )
        else:
            notes.append(
                f"{pair}, and leak into each other for {100 * share:.1f} % of the time: couple them or narrow the band"
            )
    return notes


def mask_notes(tracks: Tracks, valid: BoolArray) -> list[str]:
    """Return a note for each order that is left out of a part of the recording."""
    left_out = 100.0 * (1.0 - valid.mean(axis=1))
    return [
        f"order {name!r} is left out for {percent:.2g} % of the time, where its band passes half the sampling rate or "
        "zero, or the shaft angle is not known"
        for name, percent in zip(tracks.names, left_out, strict=True)
        if percent > 0.0
    ]
