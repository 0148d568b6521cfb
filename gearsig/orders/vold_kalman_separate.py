"""From a signal and the orders' tracks to separated orders: checks, grouping, solution, notes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, one_of
from gearsig.errors import InputError
from gearsig.orders.vold_kalman_ends import end_notes, settled_parts
from gearsig.orders.vold_kalman_groups import Coupling, Group, coupling_notes, grouped
from gearsig.orders.vold_kalman_neighbours import check_distinct, check_record_length, mask_notes, neighbours_of
from gearsig.orders.vold_kalman_solve import accuracy_of, cheap_together, waveform_accuracy_of
from gearsig.orders.vold_kalman_splines import BoolArray, ComplexArray
from gearsig.orders.vold_kalman_sweeps import Problem, solve_groups
from gearsig.orders.vold_kalman_tracks import Tracks, valid_parts
from gearsig.orders.vold_kalman_types import Generation, OrderSeparation, SeparatedOrder
from gearsig.orders.vold_kalman_weight import checked_poles

FEWEST_SAMPLES = 16
NOTED_ERROR = 1e-5


@dataclass(frozen=True)
class Method:
    """How the orders are solved for; as the parameters of `track_vold_kalman`."""

    n_poles: int
    generation: Generation
    coupled: Coupling
    mirror: bool

    def __post_init__(self) -> None:
        one_of(self.generation, "generation", ("first", "second"))
        if self.generation == "second":
            checked_poles(self.n_poles)

    @property
    def p(self) -> int:
        """Order of the structural equation."""
        return self.n_poles if self.generation == "second" else 2

    @property
    def skirt_poles(self) -> int:
        """Poles that the gain has on either side of the order: with two in all, the first generation has one."""
        return self.n_poles if self.generation == "second" else 1


def separated(
    y: FloatArray, rate: float, tracks: Tracks, widths: FloatArray, method: Method, *, unit: str = "", source: str = ""
) -> OrderSeparation:
    """Return the orders and the residual.

    Parameters
    ----------
    y : array, (n,)
    rate : float
        Samples per unit of the tracks' duration.
    tracks : Tracks
    widths : array, (n_orders, n) or (n_orders, 1)
        Bandwidths in the unit of the tracks.
    method : Method
    unit, source : str
    """
    if len(y) < FEWEST_SAMPLES:
        raise InputError(f"the signal has {len(y)} samples", allowed=f"at least {FEWEST_SAMPLES}")
    valid = valid_parts(tracks, widths, rate, method.generation)
    check_record_length(tracks, widths, valid, rate)
    neighbours = neighbours_of(tracks, widths, valid, method.skirt_poles)
    check_distinct(neighbours, tracks)
    problem = Problem(
        tracks.cycles, valid, _continued(widths, valid) / rate, method.p, method.generation, method.mirror
    )
    cheap = method.generation == "second" and cheap_together(
        problem.cycles, problem.valid, problem.bandwidths, method.p
    )
    groups = grouped(method.coupled, neighbours, len(valid), cheap=cheap)
    envelopes, waveforms, left = solve_groups(y, problem, groups, share=isinstance(method.coupled, str))
    settled = settled_parts(widths, valid, rate, method.skirt_poles)
    error = left + max(_expected_error(problem, g) for g in groups)
    residual = y.astype(np.float64)
    for waveform in waveforms:
        residual -= waveform
    orders = tuple(
        _order(k, tracks, widths, envelopes[k], waveforms[k], valid[k], settled[k], unit, source)
        for k in range(len(valid))
    )
    axis: Literal["time", "angle"] = "angle" if tracks.unit == "orders" else "time"
    members = tuple(tuple(int(k) for k in group) for group in groups)
    notes = (
        *mask_notes(tracks, valid),
        *end_notes(tracks, widths, settled, method.skirt_poles),
        *coupling_notes(groups, neighbours, tracks),
        *_error_notes(error),
    )
    return OrderSeparation(orders, residual, rate, axis, method.generation, method.p, members, error, notes)


def _order(
    k: int,
    tracks: Tracks,
    widths: FloatArray,
    envelope: ComplexArray,
    waveform: FloatArray,
    valid: BoolArray,
    settled: BoolArray,
    unit: str,
    source: str,
) -> SeparatedOrder:
    """Wrap one order; over angle, frequency and bandwidth become Hz with the speed."""
    frequency, width = tracks.frequency_hz[k], widths[k]
    if tracks.unit == "orders" and tracks.speed_rev_per_s is not None:
        frequency, width = frequency * tracks.speed_rev_per_s, width * tracks.speed_rev_per_s
    return SeparatedOrder(
        name=tracks.names[k],
        shaft=tracks.shafts[k],
        order=float(tracks.orders[k]),
        envelope=envelope,
        waveform=waveform,
        frequency_hz=frequency,
        bandwidth_hz=width,
        valid=valid,
        settled=settled,
        time_s=tracks.time_s,
        unit=unit,
        source=source,
    )


def _expected_error(problem: Problem, group: Group) -> float:
    """Return the rounding error of one group's solution."""
    widths = problem.bandwidths[group]
    if problem.generation == "second":
        return accuracy_of(problem.cycles[group], problem.valid[group], widths, problem.p)
    return waveform_accuracy_of(problem.cycles[group], problem.valid[group], widths)


def _error_notes(error: float) -> list[str]:
    if error <= NOTED_ERROR:
        return []
    text = f"rounding may reach {error:.1g} of the largest component: the band is too narrow for this rate"
    return [f"{text}, or the bandwidths differ too much for one solution"]


def _continued(widths: FloatArray, valid: BoolArray) -> FloatArray:
    """Return the bandwidths, those outside the valid part limited to those inside it: zero width has no weight."""
    if widths.shape[1] == 1:
        return widths
    out = np.empty_like(widths)
    for k, width in enumerate(widths):
        inside = width[valid[k]]
        out[k] = np.clip(width, inside.min(), inside.max())
    return out
