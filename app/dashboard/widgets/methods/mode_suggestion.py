"""How many modes a signal supports: the suggestion with its reasons, everything tried, and a button to take it over."""

from __future__ import annotations

from typing import TYPE_CHECKING

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.methods.mode_signal import ModeSignal
from gearsig.diagnosis.types import Analysis

if TYPE_CHECKING:
    from gearsig.decompose.suggestion import ModeSuggestion, ModeTrial

N_KEPT = 16


def show_suggestion(analysis: Analysis, signal: ModeSignal, names: tuple[str, str, str]) -> None:
    """Show the suggestion for a signal once it is asked for.

    Parameters
    ----------
    analysis : Analysis
    signal : ModeSignal
    names : (str, str, str)
        Keys of the widgets of number, penalty and start, which "Use it" sets.
    """
    asked = state.view_key("modes suggested", analysis)
    if st.session_state.get(asked) != signal.key:
        st.button(
            "Suggest K and penalty",
            icon=":material/lightbulb:",
            key=f"{asked} button",
            on_click=_ask,
            args=(asked, signal.key),
            help="Tries up to 8 modes at 6 penalties on up to 16 384 samples: a few seconds.",
        )
        return
    with st.spinner("Trying numbers of modes and penalties …", show_time=True):
        found = suggestion(signal.key, signal)
    with st.container(border=True):
        _show(found, names)


def _ask(asked: str, key: str) -> None:
    st.session_state[asked] = key


def _show(found: ModeSuggestion, names: tuple[str, str, str]) -> None:
    told = found.settings
    head, button = st.columns((4, 1), vertical_alignment="center")
    plural = "mode" if told.n_modes == 1 else "modes"
    head.markdown(f"Suggested: **{told.n_modes} {plural}** at penalty **{told.penalty:g}**, start **{told.start}**")
    values = (told.n_modes, int(told.penalty), told.start)
    button.button(
        "Use it", type="primary", key=f"{names[0]} use it", on_click=_use, args=(names, values), width="stretch"
    )
    st.markdown("\n".join(f"- {as_typed(reason)}" for reason in found.reasons))
    with st.expander(f"Everything that was tried ({len(found.trials)})"):
        number = st.column_config.NumberColumn(format="%.3g")
        numbers = ("residual (% of rms)", "separation", "widest", "weakest (% of energy)")
        st.dataframe(
            [_row(trial, chosen=trial is found.chosen) for trial in found.trials],
            hide_index=True,
            width="stretch",
            column_config=dict.fromkeys(numbers, number),
        )
        st.caption(
            "Separation: closest centres over the distance at which a mode's gain is one half; below 1, modes share "
            "lines. Widest: largest bandwidth over that of white noise; near 1 it is noise."
        )


def _use(names: tuple[str, str, str], values: tuple[object, ...]) -> None:
    for name, value in zip(names, values, strict=True):
        st.session_state[name] = value


def _row(trial: ModeTrial, *, chosen: bool) -> dict[str, object]:
    return {
        "": "➤" if chosen else "",
        "penalty": int(trial.penalty),
        "modes": trial.n_modes,
        "start": str(trial.settings.start),
        "residual (% of rms)": 100.0 * trial.reconstruction_error,
        "separation": trial.separation if trial.n_modes > 1 else None,
        "widest": trial.widest,
        "weakest (% of energy)": 100.0 * trial.smallest_share,
        "objection": trial.objection or "none",
    }


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def suggestion(key: str, _signal: ModeSignal) -> ModeSuggestion:
    """Return the suggestion; `key` stands for the signal."""
    from gearsig.decompose.suggest import suggest_modes

    del key
    return suggest_modes(_signal.values, _signal.rate, axis=_signal.axis, source=_signal.source)
