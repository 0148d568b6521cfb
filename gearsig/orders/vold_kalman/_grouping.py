"""Which orders the Vold–Kalman filter solves for together, and why."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.orders.vold_kalman._tracks import HALF_POWER, Tracks, settling_time

# Which orders of a Vold–Kalman problem lie close to each other, cross, or are the same; and how long each is there.


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


Coupling = bool | Literal["automatic"] | Sequence[Sequence[int]]
Group = NDArray[np.intp]
MAX_LEAK = 1e-4
"""Share of one order that another's band may let through before both are solved for together: -80 dB."""
NOTED_LEAK = 0.03


def grouped(coupled: Coupling, neighbours: Sequence[Neighbours], n_orders: int, *, cheap: bool) -> list[Group]:
    """Return the positions of the orders solved for together; each order is in one group.

    "automatic": orders are in one group if, at any time, more than `MAX_LEAK` of one would pass through the band of
    the other, and with them those that either is grouped with. Where that is `cheap`, all are.
    """
    if coupled is True or (cheap and isinstance(coupled, str) and coupled == "automatic"):
        return [np.arange(n_orders)]
    if coupled is False:
        return [np.array([k]) for k in range(n_orders)]
    if isinstance(coupled, str):
        if coupled != "automatic":
            raise InputError(f"coupled is {coupled!r}", allowed='True, False, "automatic" or groups of positions')
        return _connected([(pair.k, pair.m) for pair in neighbours if pair.leak > MAX_LEAK], n_orders)
    return _given(coupled, n_orders)


def coupling_notes(groups: Sequence[Group], neighbours: Sequence[Neighbours], tracks: Tracks) -> list[str]:
    """Return why close orders are solved for together, and a warning for those that are not."""
    group_of = {int(k): i for i, group in enumerate(groups) for k in group}
    unit = tracks.unit
    notes = []
    for pair in neighbours:
        if pair.leak <= MAX_LEAK:
            continue
        text = (
            f"orders {tracks.names[pair.k]!r} and {tracks.names[pair.m]!r} come as close as {pair.distance:.3g} {unit}"
        )
        leak = f"up to {_percent(pair.leak)} of one lies in the band of the other"
        if group_of[pair.k] == group_of[pair.m]:
            close = ", and told apart where they stay close for long enough to beat" if pair.leak > NOTED_LEAK else ""
            notes.append(f"{text}, where {leak}: they are solved for together{close}")
        else:
            notes.append(
                f"{text}, and leak into each other ({leak}; more than {_percent(NOTED_LEAK)} for "
                f"{100 * pair.close_share:.1f} % of the time): couple them or narrow the band"
            )
    apart = [k for k in range(len(tracks.names)) if len(groups[group_of[k]]) == 1]
    leaks = [p.leak for p in neighbours if group_of[p.k] != group_of[p.m]]
    if len(groups) == 1 and len(tracks.names) > 1 and not notes:
        notes.append("all orders are solved for together, though they lie far apart")
    if len(groups) > 1 and apart and max(leaks, default=1.0) <= MAX_LEAK:
        names = ", ".join(repr(tracks.names[k]) for k in apart)
        notes.append(
            f"solved for by themselves, at most {_percent(max(leaks))} of another order in their band: {names}"
        )
    return notes


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _connected(pairs: Sequence[tuple[int, int]], n: int) -> list[Group]:
    """Return the connected parts of a graph of n nodes, in the order of their first node."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ends = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
    graph = coo_array((np.ones(len(pairs)), (ends[0], ends[1])), shape=(n, n))
    n_parts, labels = connected_components(graph, directed=False)
    return [np.flatnonzero(labels == part) for part in range(n_parts)]


def _given(groups: Sequence[Sequence[int]], n_orders: int) -> list[Group]:
    """Return the user's groups, and every order that is in none by itself."""
    try:
        members = [sorted(int(k) for k in group) for group in groups]
    except (TypeError, ValueError):
        members = [[-1]]
    flat = [k for group in members for k in group]
    if any(not 0 <= k < n_orders for k in flat) or len(set(flat)) != len(flat):
        raise InputError(
            f"the groups are {groups!r}",
            where="coupled",
            allowed=f"positions from 0 to {n_orders - 1}, each in one group at most",
        )
    single = [[k] for k in range(n_orders) if k not in flat]
    return [np.array(group) for group in sorted([group for group in members if group] + single)]


# Where a separated order is not settled: at the ends, and beside parts that were left out.


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
