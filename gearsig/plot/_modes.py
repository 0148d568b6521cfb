"""Modes of a signal: waveform and spectrum of each, by rising centre, the residual last."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from gearsig.decompose import Modes, mode_spectra
from gearsig.errors import InputError
from gearsig.plot import _style as style
from gearsig.plot._series import envelope, thin
from gearsig.plot._style import above_zero, plain, unit_text, with_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def modes_figure(
    modes: Modes, *, limits: tuple[float, float] | None = None, spectrum_limits: tuple[float, float] | None = None
) -> Figure:
    """Draw each mode's waveform and its amplitude spectrum in one row, the residual in the last.

    Parameters
    ----------
    modes : Modes
        At most 12.
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
    if modes.n_modes > 12:
        raise InputError(f"there are {modes.n_modes} modes", allowed="up to 12 in a figure")
    spectra = mode_spectra(modes)
    rate = modes.sampling_rate
    shown = _limits(limits, 0.0, float(modes.positions[-1]), 2.0 / rate, "limits")
    lines = _limits(spectrum_limits, 0.0, rate / 2, 2.0 * spectra[0].resolution, "spectrum_limits")
    within = slice(max(0, int(np.floor(shown[0] * rate))), int(np.ceil(shown[1] * rate)) + 1)
    highest = max(float(above_zero(s.values[1:]).max()) for s in spectra)
    lowest = 1e-5 * highest  # of the axis that all spectra share
    rows = [*modes.by_centre(), modes.n_modes]
    figure, panels = style.panels(
        (0.82,) * len(rows), (0.55, 0.45), top_in=0.45, row_gap_in=0.33, column_gap_in=0.75, share_x=True
    )
    for i, k in enumerate(rows):
        waveform, axes = panels[2 * i : 2 * i + 2]
        is_mode = k < modes.n_modes
        colour = style.MEASURED if is_mode else style.FLOOR
        values = modes.waveforms[k] if is_mode else modes.residual
        waveform.plot(*thin(modes.positions[within], values[within], 1600), color=colour, linewidth=0.6)
        style.no_offset(waveform)
        spectrum = spectra[k]
        start, stop = spectrum.index_of(lines[0]), spectrum.index_of(lines[1]) + 1
        at, _, high = envelope(spectrum.positions[start:stop], np.maximum(spectrum.values[start:stop], lowest), 800)
        axes.plot(at, high, color=colour, linewidth=0.8)
        axes.set_yscale("log")
        axes.set_ylim(lowest, 3.0 * highest)
        if is_mode:
            centre, width = float(modes.centres[k]), float(modes.bandwidths[k])
            axes.axvspan(centre - width, centre + width, color=style.FAULT, alpha=0.15, linewidth=0, zorder=1.2)
            axes.axvline(centre, color=style.FAULT, linewidth=0.9, linestyle="--", zorder=1.5)
        style.label_axes(waveform, "", unit_text(modes.unit), _title(modes, k))
    over = "time (s)" if modes.axis == "frequency" else f"angle of {modes.shaft or 'the shaft'} (revolutions)"
    style.label_axes(panels[-2], over, panels[-2].get_ylabel())
    style.label_axes(panels[-1], spectra[0].axis_label)
    panels[0].set_xlim(*shown)
    panels[1].set_xlim(*lines)
    style.note(panels[1], with_unit("amplitude peak", modes.unit))
    return figure


def _title(modes: Modes, k: int) -> str:
    if k == modes.n_modes:
        return f"residual, {100 * modes.reconstruction_error:.2g} % of the rms"
    unit = "Hz" if modes.axis == "frequency" else "orders"
    text = f"mode {k + 1}: {_digits(modes.centres[k], 4)} ± {_digits(modes.bandwidths[k], 2)} {unit}"
    return f"{text}, {plain(modes.source, 40)}" if modes.source else text


def _digits(value: float, n: int) -> str:
    """Write `n` significant digits without an exponent."""
    return np.format_float_positional(value, precision=n, unique=False, fractional=False, trim="-")


def _limits(
    limits: tuple[float, float] | None, low: float, high: float, least: float, name: str
) -> tuple[float, float]:
    """Return limits within the axis, wide enough for two points."""
    if limits is None:
        return low, high
    cut = max(low, float(limits[0])), min(high, float(limits[1]))
    if not cut[1] - cut[0] >= least:
        raise InputError(
            f"{name} is {limits[0]:g} to {limits[1]:g}",
            allowed=f"ascending, between {low:g} and {high:g}, {least:g} apart",
        )
    return cut
