"""A figure in one call: of a result, of a refusal's intermediate result, or of a method and its signal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import singledispatch, wraps
from typing import ParamSpec

import numpy as np
from matplotlib.figure import Figure

from gearsig import angle, decompose, orders, phase, recording, spectra, timefreq
from gearsig.errors import InputError, RefusalError
from gearsig.plot._average import average_figure
from gearsig.plot._cursors import Cursor
from gearsig.plot._maps import coherence_figure, kurtogram_figure, order_map_figure, time_frequency_figure
from gearsig.plot._panels import ChartLine, LinePanel, panels_figure, tracked_panel
from gearsig.plot._phase import bifurcation_figure, divergence_figure, phase_portrait_figure, recurrence_figure
from gearsig.plot._spectrum import modes_figure, spectrum_figure, speed_figure, time_figure
from gearsig.severity import ToothSearch

OptionsP = ParamSpec("OptionsP")


@singledispatch
def figure_of(result: object) -> Figure:
    """Draw a result with the function for its type, which also takes limits, marks and titles.

    Parameters
    ----------
    result : Recording, ShaftAngle, Spectrum, OrderMap, TimeFrequencyMap, SynchronousAverage, tuple of TrackedOrder, …

    Raises
    ------
    InputError
        If there is no figure for this type of result.
    """
    drawn = sorted("TrackedOrder" if cls is tuple else cls.__name__ for cls in figure_of.registry if cls is not object)
    raise InputError(f"there is no figure of a {type(result).__name__}", allowed=", ".join(drawn))


@figure_of.register
def _(result: orders.SynchronousAverage) -> Figure:
    return average_figure([result])


@figure_of.register
def _(result: tuple) -> Figure:  # type: ignore[type-arg]  # the registry does not see item types
    if not result or not all(isinstance(item, orders.TrackedOrder) for item in result):
        kinds = sorted({type(item).__name__ for item in result})
        raise InputError(f"there is no figure of a tuple of {', '.join(kinds) or 'nothing'}", allowed="TrackedOrder")
    return panels_figure([tracked_panel(result)], title=result[0].source)


figure_of.register(recording.Recording, time_figure)
figure_of.register(angle.ShaftAngle, speed_figure)
figure_of.register(spectra.Spectrum, spectrum_figure)
figure_of.register(spectra.Kurtogram, kurtogram_figure)
figure_of.register(spectra.SpectralCoherence, coherence_figure)
figure_of.register(orders.OrderMap, order_map_figure)
figure_of.register(timefreq.TimeFrequencyMap, time_frequency_figure)
figure_of.register(decompose.Modes, modes_figure)
figure_of.register(phase.PhasePortrait, phase_portrait_figure)
figure_of.register(phase.BifurcationDiagram, bifurcation_figure)
figure_of.register(phase.LyapunovExponent, divergence_figure)
figure_of.register(phase.RecurrencePlot, recurrence_figure)


# --------------------
# Searches that found nothing.
# --------------------


def search_panels(searched: Sequence[ToothSearch]) -> tuple[LinePanel, ...]:
    """Return one panel per gear: how far each angle stands out, with the threshold of a detectable crack.

    Parameters
    ----------
    searched : sequence of ToothSearch
    """
    panels = []
    for search in searched:
        highest = int(np.argmax(search.level_db))
        threshold = ChartLine(
            np.array([0.0, 360.0]), np.full(2, search.threshold_db), "seen as a crack", 1, dotted=True
        )
        what = "change since the reference" if search.with_reference else "average"
        line = ChartLine(search.angle_deg, search.level_db, what)
        at = float(search.angle_deg[highest])
        top = max(float(search.level_db[highest]), search.threshold_db)
        bottom = float(search.level_db.min())
        panels.append(
            LinePanel(
                [line, threshold],
                f"angle of {search.shaft} (deg)",
                "over the median tooth (dB)",
                (bottom - 0.08 * (top - bottom), top + 0.12 * (top - bottom)),
                cursors=[Cursor(at, "finding", f"clearest, {at:.0f}°", 0)],
                x_limits=(0.0, 360.0),
                title=f"{search.gear}, {search.teeth} teeth",
            )
        )
    return tuple(panels)


def figure_of_refusal(refusal: RefusalError) -> Figure | None:
    """Draw the intermediate result behind a refusal; None if it has none that can be drawn."""
    looked_at = refusal.looked_at
    if isinstance(looked_at, phase.LyapunovExponent):
        return divergence_figure(looked_at)
    if isinstance(looked_at, tuple) and looked_at and all(isinstance(search, ToothSearch) for search in looked_at):
        return panels_figure(search_panels(looked_at))
    return None


# --------------------
# Methods that return the figure of their result.
# --------------------


def _drawn(method: Callable[OptionsP, object]) -> Callable[OptionsP, Figure]:
    """Return a function that runs the method and draws its result, with the method's arguments and docstring."""

    @wraps(method)
    def figure(*args: OptionsP.args, **settings: OptionsP.kwargs) -> Figure:
        return figure_of(method(*args, **settings))

    figure.__annotations__ = method.__annotations__ | {"return": "Figure"}
    return figure


amplitude_spectrum = _drawn(spectra.amplitude_spectrum)
power_density = _drawn(spectra.power_density)
envelope_spectrum = _drawn(spectra.envelope_spectrum)
cepstrum = _drawn(spectra.cepstrum)
kurtogram = _drawn(spectra.kurtogram)
spectral_coherence = _drawn(spectra.spectral_coherence)
order_spectrum = _drawn(orders.order_spectrum)
order_map = _drawn(orders.order_map)
track_orders = _drawn(orders.track_orders)
synchronous_average = _drawn(orders.synchronous_average)
stft = _drawn(timefreq.stft_map)
cwt = _drawn(timefreq.cwt_map)
squeezed_stft = _drawn(timefreq.squeezed_stft_map)
squeezed_cwt = _drawn(timefreq.squeezed_cwt_map)
vmd = _drawn(decompose.vmd)
phase_plane = _drawn(phase.phase_plane)
delay_embedding = _drawn(phase.delay_embedding)
