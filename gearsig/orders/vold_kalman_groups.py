"""Which orders the Vold–Kalman filter solves for together, and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from gearsig.errors import InputError
from gearsig.orders.vold_kalman_neighbours import Neighbours
from gearsig.orders.vold_kalman_tracks import Tracks

Coupling = bool | Literal["automatic"] | Sequence[Sequence[int]]
Group = NDArray[np.intp]
LARGEST_LEAK = 1e-4
"""Share of one order that another's band may let through before both are solved for together: -80 dB."""
NOTED_LEAK = 0.03


def grouped(coupled: Coupling, neighbours: Sequence[Neighbours], n_orders: int, *, cheap: bool) -> list[Group]:
    """Return the positions of the orders solved for together; each order is in one group.

    "automatic": orders are in one group if, at any time, more than `LARGEST_LEAK` of one would pass through the band of
    the other, and with them those that either is grouped with. Where that is `cheap`, all are.
    """
    if coupled is True or (cheap and isinstance(coupled, str) and coupled == "automatic"):
        return [np.arange(n_orders)]
    if coupled is False:
        return [np.array([k]) for k in range(n_orders)]
    if isinstance(coupled, str):
        if coupled != "automatic":
            raise InputError(f"coupled is {coupled!r}", allowed='True, False, "automatic" or groups of positions')
        return _connected([(pair.k, pair.m) for pair in neighbours if pair.leak > LARGEST_LEAK], n_orders)
    return _given(coupled, n_orders)


def coupling_notes(groups: Sequence[Group], neighbours: Sequence[Neighbours], tracks: Tracks) -> list[str]:
    """Return why close orders are solved for together, and a warning for those that are not."""
    group_of = {int(k): i for i, group in enumerate(groups) for k in group}
    unit = tracks.unit
    notes = []
    for pair in neighbours:
        if pair.leak <= LARGEST_LEAK:
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
    if len(groups) > 1 and apart and max(leaks, default=1.0) <= LARGEST_LEAK:
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
    left = [[k] for k in range(n_orders) if k not in flat]
    return [np.array(group) for group in sorted([group for group in members if group] + left)]
