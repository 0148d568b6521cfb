"""Variational modes of a channel, of its envelope or over the shaft's angle, with a suggestion of their number."""

from __future__ import annotations

from dataclasses import replace
from typing import cast, get_args

import streamlit as st

from app.dashboard.methods.frame import Columns, MethodPage, SignalSegment, cached, signal_of, waveforms_of
from app.dashboard.theme import as_typed
from app.dashboard.widgets.charts import show_picture
from app.dashboard.widgets.messages import show_warnings
from gearsig.decompose import Modes, ModeSuggestion, VmdEngine, VmdSettings, suggest_modes, vmd
from gearsig.plot import modes_figure
from gearsig.spectra import band_envelope
from gearsig.timefreq import UniformSignal

N_PER_BLOCK = 2**18
"""Longer segments are taken block by block."""
MAX_OF_VMDPY = 2**13
"""Samples: it keeps all iterations, 16 kB per sample and mode."""
PENALTIES = (50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000, 200_000)
"""A logarithmic scale that holds whatever is suggested."""
SUGGESTED = ("K", "penalty", "start")
"""Keys of the widgets that a suggestion sets."""
suggestion_of = cached(16, "Trying numbers of modes and penalties …")(suggest_modes)


def show_modes(page: MethodPage) -> None:
    """Show the modes of one channel."""
    left, right = st.columns(2)
    about = "vmdpy: the reference program, for comparison; slow, and short segments only."
    engine = page.choose(left, "Engine", get_args(VmdEngine), about=about, as_written=True)
    with right:
        segment = page.segment(n_first=2**16, n_max=2**21 if engine == "gearsig" else MAX_OF_VMDPY)
    with left:
        signal, offset = _choose_signal(page, segment)
    settings = _choose_settings(page, cast("VmdEngine", engine))
    _show_suggestion(page, signal)
    modes = replace(modes_of(signal, settings), offset=offset)
    show_warnings(modes.notes)
    _show_figure(page, segment, signal, modes)
    end = "Converged" if modes.converged else "Stopped"
    n_blocks = len(modes.centre_history) - 1
    blocks = f" in {n_blocks} overlapping blocks" if len(modes.residual) > N_PER_BLOCK else ""
    st.caption(
        f"{end} after {modes.n_iterations} iterations{blocks}. Marked in each spectrum: the mode's centre, and its "
        "width to both sides. Grey: the residual."
    )
    names = [f"mode {k + 1}, {modes.centres[k]:.5g} {signal.position_unit}" for k in range(modes.n_modes)]
    columns = dict(zip(names, modes.waveforms, strict=True)) | {"residual": modes.residual}
    step = f"{modes.n_modes} variational modes, penalty {settings.penalty:g}, of {modes.source} less {offset:g}"
    unit = "Hz" if modes.axis == "frequency" else "orders"
    table: Columns = {
        "mode": [k + 1 for k in range(modes.n_modes)],
        f"centre ({unit})": modes.centres,
        f"bandwidth ({unit})": modes.bandwidths,
        f"rms ({modes.unit or 1})": modes.rms,
    }
    page.offer(waveforms_of(segment, signal, columns, step), {"Modes": table})


def _choose_signal(page: MethodPage, segment: SignalSegment) -> tuple[UniformSignal, float]:
    """Return what of the segment is taken apart, and the constant that was subtracted from it."""
    kinds = ("Signal", "Envelope", "Over angle") if segment.angle is not None else ("Signal", "Envelope")
    about = "The envelope of a band shows what modulates it. Over the shaft's angle, centres are orders."
    kind = page.choose(st, "Modes of", kinds, key=f"of {kinds}", about=about)
    if kind != "Envelope":
        return signal_of(segment, over_angle=kind == "Over angle"), 0.0
    rate, channel = segment.recording.sampling_rate_hz, page.channel
    # where the analysis found no band that carries impacts, the upper part of the spectrum
    usual = channel.envelope_band_hz or (0.25 * rate, 0.45 * rate)
    band = page.range("Band of the envelope (Hz)", rate / 2.0, shown=usual, name=channel.channel)
    envelope = band_envelope(segment.values, rate, band, kind="magnitude", unit=segment.unit)
    # Its mean would be a mode of its own that outweighs the others.
    mean = float(envelope.values.mean())
    signal = UniformSignal(
        envelope.values - mean,
        envelope.sampling_rate_hz,
        start=segment.start_s,
        unit=envelope.unit,
        source=envelope.source,
    )
    return signal, mean


def _choose_settings(page: MethodPage, engine: VmdEngine) -> VmdSettings:
    one, two, three, four, five = st.columns((2.6, 4, 4.8, 3, 3.2))
    # a suggestion sets the values of both
    for name, value in (("K", 4), ("penalty", 2000)):
        st.session_state.setdefault(page.key(name), value)
    n_modes = page.ask(one.slider, "Modes K", 1, 10, key="K")
    about = "Weight of the modes' bandwidth, α: large for narrow modes. 2000 is usual."
    penalty = page.ask(two.select_slider, "Penalty α", PENALTIES, key="penalty", about=about)
    about = "First centre frequencies: evenly spread, at the peaks of the spectrum, or all at zero."
    start = page.choose(three, "Start", ("uniform", "peaks", "zero"), key="start", about=about)
    about = "Keep the first mode's centre at zero, so that it takes mean and drift."
    zero_mode = page.ask(five.toggle, "Mode at zero", about=about)
    # vmdpy iterates up to 499 times
    iterations = (499, 1000, 2000, 5000)
    disabled = engine == "vmdpy"
    max_iterations = page.ask(four.select_slider, "Iterations", iterations, disabled=disabled)
    with st.expander("More settings"):
        about = "Above 0 the modes must sum to the signal, noise included; 0 leaves noise in the residual."
        column = st.columns(3)[0]
        dual_step = page.ask(
            column.number_input, "Dual step τ", min_value=0.0, value=0.0, step=0.1, format="%g", about=about
        )
    return VmdSettings(
        n_modes,
        float(penalty),
        dual_step=float(dual_step),
        zero_mode=zero_mode,
        start=start,
        max_iterations=499 if disabled else max_iterations,
        engine=engine,
    )


@cached(2, "Finding the modes …")
def modes_of(signal: UniformSignal, settings: VmdSettings) -> Modes:
    """Return the modes by rising centre: the first one shown is number 1."""
    modes = vmd(signal, None, settings)
    order = list(modes.by_centre())
    return replace(
        modes,
        waveforms=modes.waveforms[order],
        centres=modes.centres[order],
        bandwidths=modes.bandwidths[order],
        centre_history=modes.centre_history[:, order],
    )


def _show_figure(page: MethodPage, segment: SignalSegment, signal: UniformSignal, modes: Modes) -> None:
    over_angle, is_envelope = signal.axis == "order", signal.source != segment.channel
    # an envelope's rhythms are slow
    length = page.first_length(segment, over_angle=over_angle, of_mesh=not is_envelope) or 2000 / signal.rate
    left, right = st.columns(2)
    end = float(modes.positions[-1])
    with left:
        label = f"Waveforms shown ({'revolutions' if over_angle else 's from the start of the segment'})"
        limits = page.range(label, end, shown=(0.0, min(end, length)))
    with right:
        label = "Orders shown" if over_angle else "Frequencies shown (Hz)"
        lines = page.range(label, modes.sampling_rate / 2.0)
    figure = modes_figure(modes, limits=limits, spectrum_limits=lines)
    show_picture(figure, f"Waveforms and spectra of {modes.n_modes} modes of {modes.source}")


def _show_suggestion(page: MethodPage, signal: UniformSignal) -> None:
    """Show the suggestion for a signal once it is asked for."""
    about = "Tries up to 8 modes at 6 penalties on up to 16 384 samples: a few seconds."
    if not page.asked("suggested", signal, "Suggest K and penalty", icon=":material/lightbulb:", about=about):
        return
    suggestion = suggestion_of(signal)
    settings = suggestion.settings
    with st.container(border=True):
        head, button = st.columns((4, 1), vertical_alignment="center")
        plural = "mode" if settings.n_modes == 1 else "modes"
        head.markdown(
            f"Suggested: **{settings.n_modes} {plural}** at penalty **{settings.penalty:g}**, start "
            f"**{settings.start}**"
        )
        values = dict(zip(SUGGESTED, (settings.n_modes, int(settings.penalty), settings.start), strict=True))
        update = {page.key(name): value for name, value in values.items()}
        button.button(
            "Use it",
            type="primary",
            key=page.key("use it"),
            on_click=st.session_state.update,
            args=(update,),
            width="stretch",
        )
        st.markdown("\n".join(f"- {as_typed(reason)}" for reason in suggestion.reasons))
        with st.expander(f"Everything that was tried ({len(suggestion.trials)})"):
            numbers = ("residual (% of rms)", "separation", "widest", "weakest (% of energy)")
            st.dataframe(
                _trial_rows(suggestion),
                hide_index=True,
                width="stretch",
                column_config=dict.fromkeys(numbers, st.column_config.NumberColumn(format="%.3g")),
            )
            st.caption(
                "Separation: closest centres over the distance at which a mode's gain is one half; below 1, modes "
                "share lines. Widest: largest bandwidth over that of white noise; near 1 it is noise."
            )


def _trial_rows(suggestion: ModeSuggestion) -> list[dict[str, object]]:
    return [
        {
            "": "➤" if trial is suggestion.chosen else "",
            "penalty": int(trial.penalty),
            "modes": trial.n_modes,
            "start": str(trial.settings.start),
            "residual (% of rms)": 100.0 * trial.reconstruction_error,
            "separation": trial.separation if trial.n_modes > 1 else None,
            "widest": trial.widest,
            "weakest (% of energy)": 100.0 * trial.smallest_share,
            "objection": trial.objection or "none",
        }
        for trial in suggestion.trials
    ]
