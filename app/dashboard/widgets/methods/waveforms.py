"""Whole waveforms that a method found, and the part of them that is drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from app.dashboard import state
from app.dashboard.widgets.line_chart import Axes
from app.dashboard.widgets.methods.curves import Curve, show_curves
from app.dashboard.widgets.range_slider import choose_range
from gearsig.checks import FloatArray
from gearsig.diagnosis.types import Analysis
from gearsig.plot.display import with_unit
from gearsig.plot.thin import thin

if TYPE_CHECKING:
    from app.dashboard.widgets.methods.stretch import Stretch
    from gearsig.timefreq.types import Axis

N_SHOWN = 3000
"""Samples at first."""


@dataclass(frozen=True)
class Waveforms:
    """Signals of equal length at equal steps of time or angle.

    Parameters
    ----------
    columns : mapping
        Name → samples, (n_samples,).
    rate : float
        Samples per second, or per revolution of `shaft`.
    start : float
        Time or angle of the first sample.
    unit, quantity : str
    step : str
        What was done to the stretch, for the history of a file.
    axis : str
        "frequency" for signals over time, "order" for those over angle.
    shaft : str
    """

    columns: Mapping[str, FloatArray]
    rate: float
    start: float
    unit: str
    quantity: str
    step: str
    axis: Axis = "frequency"
    shaft: str = ""

    @property
    def n_samples(self) -> int:
        """Samples of each."""
        return len(next(iter(self.columns.values())))

    @property
    def end(self) -> float:
        """Time or angle one step after the last sample."""
        return self.start + self.n_samples / self.rate

    def at(self, part: slice = slice(None)) -> FloatArray:
        """Return time in s or angle in revolutions of some samples."""
        result: FloatArray = self.start + np.arange(self.n_samples)[part] / self.rate
        return result


def waveforms_of(
    stretch: Stretch, columns: Mapping[str, FloatArray], step: str, *, unit: str | None = None
) -> Waveforms:
    """Return waveforms over the time of a stretch, in its channel's unit unless another one is given."""
    channel = stretch.recording.channels[0]
    own = unit is None or unit == channel.unit
    return Waveforms(
        columns,
        stretch.recording.sampling_rate_hz,
        stretch.start_s,
        channel.unit if unit is None else unit,
        channel.quantity if own else "unknown",
        f"{step}, of {stretch.channel} from {stretch.start_s:.6g} to {stretch.end_s:.6g} s",
    )


def choose_window(
    analysis: Analysis, waveforms: Waveforms, name: str, *, shown: float | None = None, in_middle: bool = False
) -> tuple[float, float]:
    """Return the time or angle that is drawn.

    Parameters
    ----------
    analysis : Analysis
    waveforms : Waveforms
    name : str
        Of the view, for the key.
    shown : float or None
        Length at first, in s or revolutions; None: `N_SHOWN` samples.
    in_middle : bool
        Begin in the middle instead of at the start.
    """
    start, end = waveforms.start, waveforms.end
    length = min(N_SHOWN / waveforms.rate if shown is None else shown, end - start)
    first = (start + end - length) / 2.0 if in_middle else start
    unit = "s" if waveforms.axis == "frequency" else "revolutions"
    return choose_range(
        f"Waveforms shown ({unit})", analysis, end, start=start, shown=(first, first + length), name=name
    )


def show_waveforms(
    analysis: Analysis,
    waveforms: Waveforms,
    limits: tuple[float, float],
    looks: Mapping[str, int],
    name: str,
    *,
    label: str = "signal",
    last: bool = True,
    height_px: int = 240,
) -> None:
    """Draw some of the waveforms in one chart.

    Parameters
    ----------
    analysis : Analysis
    waveforms : Waveforms
    limits : (float, float)
        From `choose_window`.
    looks : mapping
        Column → colour as in `Curve`.
    name : str
        Of the chart, for the key.
    label : str
        Of the value axis.
    last : bool
        Whether the lower axis is named.
    height_px : int
    """
    part = _part(waveforms, limits)
    at = waveforms.at(part)
    curves = [Curve(*thin(at, waveforms.columns[column][part]), column, colour) for column, colour in looks.items()]
    from gearsig.timefreq.types import at_label

    below = at_label(waveforms.axis, waveforms.shaft) if last else ""
    axes = Axes(below, with_unit(label, waveforms.unit), limits)
    show_curves(curves, axes, state.view_key(f"{name} waveforms", analysis), height_px=height_px)


def _part(waveforms: Waveforms, limits: tuple[float, float]) -> slice:
    """Return the samples between limits, two at least."""
    start = max(0, int((limits[0] - waveforms.start) * waveforms.rate))
    start = min(start, max(0, waveforms.n_samples - 2))
    return slice(start, start + max(2, int(np.ceil((limits[1] - limits[0]) * waveforms.rate)) + 1))
