"""Where a separated order is not settled: at the ends, and beside parts that were left out."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.orders.vold_kalman_tracks import Tracks
from gearsig.orders.vold_kalman_weight import settling_time

BoolArray = NDArray[np.bool_]


def settled_parts(bandwidth: FloatArray, valid: BoolArray, sampling_rate: float, skirt_poles: int) -> BoolArray:
    """Return where each order has been valid for a settling time before, and stays so for one after, (n_orders, n).

    Where the bandwidth varies, so does the settling time T: it has passed once ∫ dt/T has grown by one.
    """
    settled = np.zeros(valid.shape, dtype=bool)
    for k, there in enumerate(valid):
        rate = 1.0 / (settling_time(bandwidth[k], skirt_poles) * sampling_rate)
        passed = rate[0] * np.arange(len(there)) if len(rate) == 1 else np.cumsum(rate)
        edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).view(np.int8)))
        for first, end in edges.reshape(-1, 2):
            begin = first + np.searchsorted(passed[first:end], passed[first] + 1.0)
            stop = first + np.searchsorted(passed[first:end], passed[end - 1] - 1.0, side="right")
            settled[k, begin : max(begin, stop)] = True
    return settled


def end_notes(tracks: Tracks, bandwidth: FloatArray, settled: BoolArray, skirt_poles: int) -> list[str]:
    """Return over what time at the ends the orders are not reliable, and which never are."""
    times = [settling_time(bandwidth[k], skirt_poles) for k in range(len(settled))]
    shortest, longest = min(float(t.min()) for t in times), max(float(t.max()) for t in times)
    span = f"{longest:.3g}" if longest < 1.005 * shortest else f"{shortest:.3g} to {longest:.3g}"
    notes = [
        (
            f"at the ends of the recording, and beside parts left out, levels are not reliable over {span} "
            f"{tracks.duration_unit}, in which the filter's response decays to 1 %"
        )
    ]
    never = [name for name, there in zip(tracks.names, settled, strict=True) if not there.any()]
    if never:
        names = ", ".join(repr(name) for name in never)
        notes.append(f"the recording is too short for order(s) {names} to settle: widen the band")
    return notes
