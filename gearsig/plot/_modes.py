"""Modes of a signal: waveform and spectrum of each, by rising centre, the residual last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray
from gearsig.decompose import Modes, mode_spectra
from gearsig.errors import InputError
from gearsig.plot import _style as style
from gearsig.plot._series import envelope, thin
from gearsig.plot._style import above_zero, plain, unit_text, with_unit
from gearsig.spectra import Spectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


ROW_IN = 1.15
HEAD_IN, FOOT_IN = 0.12, 0.55
LEFT_IN, GAP_IN, RIGHT_IN = 0.85, 0.75, 0.2
WAVEFORM_SHARE = 0.55
MOST_MODES = 12
POINTS = 1600
SHOWN_DECADES = 5.0
"""The spectra's common axis reaches this far below their highest line."""


def modes_figure(
    modes: Modes, *, limits: tuple[float, float] | None = None, spectrum_limits: tuple[float, float] | None = None
) -> Figure:
    """Draw each mode's waveform and its amplitude spectrum in one row, the residual in the last.

    Parameters
    ----------
    modes : Modes
        At most `MOST_MODES`.
    limits : (float, float) or None
        Of the waveforms, in s or revolutions; None: all.
    spectrum_limits : (float, float) or None
        Of the spectra, in Hz or orders; None: all.

    Returns
    -------
    Figure
        All spectra share one logarithmic axis, so that the modes' sizes compare; waveforms have an axis each. A line in
        each spectrum marks the centre, a band its root mean square width to both sides.

    Raises
    ------
    InputError
        On too many modes, or limits that do not ascend or hold fewer than two samples.
    """
    if modes.n_modes > MOST_MODES:
        raise InputError(f"there are {modes.n_modes} modes", allowed=f"up to {MOST_MODES} in a figure")
    spectra = mode_spectra(modes)
    shown = _limits(limits, 0.0, float(modes.positions[-1]), 2.0 / modes.sampling_rate, "limits")
    lines = _limits(spectrum_limits, 0.0, modes.sampling_rate / 2, 2.0 * spectra[0].resolution, "spectrum_limits")
    rows = [*modes.by_centre(), modes.n_modes]
    figure = style.new_figure(HEAD_IN + FOOT_IN + ROW_IN * len(rows))
    highest = max(float(above_zero(s.values[1:]).max()) for s in spectra)
    first: tuple[Axes, Axes] | None = None
    for i, k in enumerate(rows):
        waveform, spectrum = _row(figure, i, len(rows), first)
        first = first or (waveform, spectrum)
        _draw_waveform(waveform, modes, k, shown)
        _draw_spectrum(spectrum, spectra[k], lines, highest)
        if k < modes.n_modes:
            _mark_centre(spectrum, float(modes.centres[k]), float(modes.bandwidths[k]))
        last = i == len(rows) - 1
        for axes in (waveform, spectrum):
            axes.tick_params(labelbottom=last)
        style.label_axes(waveform, _time_label(modes) if last else "", unit_text(modes.unit), _title(modes, k))
        style.label_axes(spectrum, spectra[k].axis_label if last else "")
    if first is not None:
        first[0].set_xlim(*shown)
        first[1].set_xlim(*lines)
        style.note(first[1], with_unit("amplitude peak", modes.unit))
    return figure


def _row(figure: Figure, i: int, n: int, first: tuple[Axes, Axes] | None) -> tuple[Axes, Axes]:
    width, height = (float(v) for v in figure.get_size_inches())
    inner = width - LEFT_IN - GAP_IN - RIGHT_IN
    bottom = FOOT_IN + ROW_IN * (n - 1 - i)
    top = height - bottom - ROW_IN + 0.33
    edge = LEFT_IN + WAVEFORM_SHARE * inner
    shared = first or (None, None)
    waveform = style.panel(
        figure, left_in=LEFT_IN, right_in=width - edge, bottom_in=bottom, top_in=top, sharex=shared[0]
    )
    spectrum = style.panel(
        figure, left_in=edge + GAP_IN, right_in=RIGHT_IN, bottom_in=bottom, top_in=top, sharex=shared[1]
    )
    return waveform, spectrum


def _draw_waveform(axes: Axes, modes: Modes, k: int, limits: tuple[float, float]) -> None:
    values = modes.waveforms[k] if k < modes.n_modes else modes.residual
    rate = modes.sampling_rate
    start, stop = max(0, int(np.floor(limits[0] * rate))), int(np.ceil(limits[1] * rate)) + 1
    positions = modes.positions[start:stop]
    colour = style.MEASURED if k < modes.n_modes else style.FLOOR
    axes.plot(*thin(positions, values[start:stop], POINTS), color=colour, linewidth=0.6)
    style.no_offset(axes)


def _draw_spectrum(axes: Axes, spectrum: Spectrum, limits: tuple[float, float], highest: float) -> None:
    start, stop = spectrum.index_of(limits[0]), spectrum.index_of(limits[1]) + 1
    lowest = highest * 10.0**-SHOWN_DECADES
    values: FloatArray = np.maximum(spectrum.values[start:stop], lowest)
    at, _, high = envelope(spectrum.positions[start:stop], values, POINTS // 2)
    colour = style.FLOOR if spectrum.source.startswith("residual") else style.MEASURED
    axes.plot(at, high, color=colour, linewidth=0.8)
    axes.set_yscale("log")
    axes.set_ylim(lowest, 3.0 * highest)


def _mark_centre(axes: Axes, centre: float, bandwidth: float) -> None:
    axes.axvspan(centre - bandwidth, centre + bandwidth, color=style.FAULT, alpha=0.15, linewidth=0, zorder=1.2)
    axes.axvline(centre, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1.5)


def _title(modes: Modes, k: int) -> str:
    if k == modes.n_modes:
        return f"residual, {100 * modes.reconstruction_error:.2g} % of the rms"
    unit = "Hz" if modes.axis == "frequency" else "orders"
    text = f"mode {k + 1}: {_digits(modes.centres[k], 4)} ± {_digits(modes.bandwidths[k], 2)} {unit}"
    return f"{text}, {plain(modes.source, 40)}" if modes.source else text


def _digits(value: float, n: int) -> str:
    """Write `n` significant digits without an exponent."""
    return np.format_float_positional(value, precision=n, unique=False, fractional=False, trim="-")


def _time_label(modes: Modes) -> str:
    return "time (s)" if modes.axis == "frequency" else f"angle of {modes.shaft or 'the shaft'} (revolutions)"


def _limits(given: tuple[float, float] | None, low: float, high: float, least: float, name: str) -> tuple[float, float]:
    """Return limits within the axis, wide enough for two points."""
    if given is None:
        return low, high
    cut = max(low, float(given[0])), min(high, float(given[1]))
    if not cut[1] - cut[0] >= least:
        raise InputError(
            f"{name} is {given[0]:g} to {given[1]:g}",
            allowed=f"ascending, between {low:g} and {high:g}, {least:g} apart",
        )
    return cut
