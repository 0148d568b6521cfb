"""A number of the page: a slider over the usual range, or typed, without any bounds but the simulator's."""

from __future__ import annotations

from math import floor, log10

import streamlit as st

PREFIX, SUFFIX, TYPED = "lab ", " typed", "lab typed values"


def show_typed_toggle() -> None:
    """Let the user type numbers instead of pulling sliders; the values carry over."""
    st.toggle(
        "Type the numbers",
        key=TYPED,
        on_change=_carry_over,
        persist_state="session",
        help="Exact values, also beyond the sliders. What is not possible is said on the page.",
    )


def choose_number(label: str, name: str, default: float, high: float, *, low: float = 0.0, about: str = "") -> float:
    """Return a number that the user chooses.

    Parameters
    ----------
    label : str
        With the unit.
    name : str
        Of the number, unique on the page.
    default : float
    high, low : float
        Ends of the slider; a value that was typed beyond them widens it.
    about : str
        Shown on demand.
    """
    key = PREFIX + name
    step = slider_step(low, high)
    typed = bool(st.session_state.get(TYPED, False))
    if typed:
        key += SUFFIX
    value = float(st.session_state.setdefault(key, float(default)))
    if typed:
        number: float = st.number_input(
            label, step=step, format="%g", key=key, help=about or None, persist_state="session"
        )
        return float(number)
    ends = min(low, value), max(high, value)
    return float(st.slider(label, *ends, step=step, format="%g", key=key, help=about or None, persist_state="session"))


def slider_step(low: float, high: float) -> float:
    """Return the step of a slider: some 150 of them from end to end."""
    return nice_step((high - low) / 150.0)


def nice_step(size: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is no larger than `size`.

    Examples
    --------
    >>> nice_step(0.07), nice_step(13.3), nice_step(3.0)
    (0.05, 10.0, 2.0)
    """
    exponent = floor(log10(size))
    digit = max(d for d in (1, 2, 5) if d <= size / 10.0**exponent * (1 + 1e-9))
    return float(f"{digit}e{exponent}")


def _carry_over() -> None:
    """Give every number its value on the other kind of widget."""
    typed = st.session_state[TYPED]
    for key in [str(k) for k in st.session_state]:
        value = st.session_state[key]
        if not key.startswith(PREFIX) or key == TYPED or isinstance(value, bool) or not isinstance(value, float):
            continue
        if key.endswith(SUFFIX) and not typed:
            st.session_state[key.removesuffix(SUFFIX)] = value
        elif typed and not key.endswith(SUFFIX):
            st.session_state[key + SUFFIX] = value
