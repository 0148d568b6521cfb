"""The start page: the user's own recording, three things to try, and the samples."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.cached import kept_file
from app.dashboard.state import ChosenFile
from app.dashboard.widgets.chooser import choose_with_rig, open_file, open_sample
from app.dashboard.widgets.texts import as_typed
from app.samples import samples
from gearsig.checks import FloatArray
from gearsig.recording import FORMAT_NAMES

SVG = "http://www.w3.org/2000/svg"
BLUE, ORANGE = "#2B86C5", "#D55E00"
N_SHOWN = 8


def path(x: FloatArray, y: FloatArray, colour: str, *, width: float = 2.0, closed: bool = False) -> str:
    """Return an SVG path through points."""
    points = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True))
    end = "Z" if closed else ""
    return f'<path d="M{points}{end}" fill="none" stroke="{colour}" stroke-width="{width}" stroke-linejoin="round"/>'


def ring_of_teeth() -> str:
    """Return SVG paths of a ring of teeth in which one tooth stands out."""
    turn = np.linspace(0, 2 * np.pi, 900, endpoint=False)
    noise = np.sin(29 * turn) * 2.0 + np.sin(58 * turn + 1) * 1.2 + np.sin(7 * turn) * 0.8
    away = np.abs(turn - 2.46)
    burst = 19 * np.exp(-((away / 0.09) ** 2)) * np.cos(110 * (turn - 2.46))
    radius = 40 + noise + burst
    x, y = 150 + radius * np.sin(turn), 62 - radius * np.cos(turn)
    hurt = away < 0.16
    return path(x, y, BLUE, width=1.6, closed=True) + path(x[hurt], y[hurt], ORANGE, width=2.6)


def crack_dial() -> str:
    """Return SVG of two teeth with a crack in a root, above a slider."""
    teeth = "M60 84V62C68 58 72 46 76 22H104C108 46 112 58 120 62H136C144 58 148 46 152 22H180C184 46 188 58 196 62V84"
    return (
        f'<path d="{teeth}" fill="none" stroke="{BLUE}" stroke-width="2.2"/>'
        f'<path d="M121 62L132 70L138 69L146 78" fill="none" stroke="{ORANGE}" stroke-width="3"/>'
        f'<path d="M40 106H260" stroke="{BLUE}" stroke-opacity="0.35" stroke-width="4" stroke-linecap="round"/>'
        f'<path d="M40 106H150" stroke="{ORANGE}" stroke-width="4" stroke-linecap="round"/>'
        f'<circle cx="150" cy="106" r="8" fill="{ORANGE}"/>'
    )


def two_spectra() -> str:
    """Return SVG of a simulation's spectral lines beside those of a recording, which has sidebands."""
    lines = [(60, 60, 0), (140, 78, 1), (220, 44, 2)]
    made = ""
    for at, height, n in lines:
        made += f'<path d="M{at} 104V{104 - height}" stroke="{BLUE}" stroke-width="4"/>'
        for k in (-2, -1, 1, 2):
            tall = height * (0.5 - 0.17 * abs(k)) * (1 if n != 2 else 0.8)
            made += f'<path d="M{at + 13 * k} 104V{104 - tall:.0f}" stroke="{ORANGE}" stroke-width="3"/>'
    return made + f'<path d="M24 104H276" stroke="{BLUE}" stroke-opacity="0.4" stroke-width="1.5"/>'


TO_TRY: tuple[tuple[str, str, str, Callable[[], str], str], ...] = (
    (
        "Find the damaged tooth",
        "A recording compared with one of the same gearbox when healthy: which tooth, how certain, on what evidence.",
        "Open the recording",
        ring_of_teeth,
        "analysis",
    ),
    (
        "Dial a crack into a gearbox",
        "A simulated gear pair that responds to sliders: set the crack to 4\u00a0mm and watch the sensors.",
        "Open the laboratory",
        crack_dial,
        "laboratory",
    ),
    (
        "Why does my simulation differ?",
        "A recording against a simulation of its rig: where they differ, which effect is missing, what it explains.",
        "Find the reason",
        two_spectra,
        "gap",
    ),
)


def show() -> None:
    """Show the title and purpose, the user's own and recent files, three things to try, and samples."""
    st.html(
        '<div class="hero"><h1>Gear vibration, from the recording to the reason</h1>'
        "<p>gearsig reads a recording, names the damaged tooth or bearing with its evidence, and says why a simulation "
        "differs from the machine.</p></div>"
    )
    with st.container(key="own", border=True):
        show_own()
    with st.container(key="try"):
        for column, (title, about, label, picture, page) in zip(st.columns(3), TO_TRY, strict=True):
            with column.container(border=True, height="stretch", vertical_alignment="distribute"):
                with st.container():
                    st.image(f'<svg xmlns="{SVG}" viewBox="0 0 300 124">{picture()}</svg>', width="stretch", alt="")
                    st.markdown(f"**{title}**")
                    st.caption(about)
                if st.button(label, type="primary", width="stretch", key=f"try {page}"):
                    if page == "analysis":
                        open_sample("damaged_tooth")
                    elif page == "gap":
                        state.start_gap()
                    state.go_to(page)
    show_samples()


def show_own() -> None:
    """Take a recording from the user, with its rig file if there is one, or one of those opened last."""
    words, files = st.columns((5, 7), gap="medium", vertical_alignment="center")
    with words:
        st.subheader("Open your own recording", anchor=False)
        st.caption(
            "If you have a rig file (TOML), add both at once. Without one, describe the machine in a form afterwards. "
            "Files stay on this computer."
        )
        tokens = state.tokens(state.RECORDING_FILE)
        for kept in [file for token in tokens if (file := kept_file(token)) is not None][:5]:
            if st.button(as_typed(kept.name), key=f"recent {kept.sha256}", icon=":material/history:", type="tertiary"):
                open_own(kept)
    with files:
        file, has_rig = choose_with_rig("Recording and its rig file", "start file", about=f"{FORMAT_NAMES}.")
        if file is None and has_rig:
            st.caption(":material/upload_file: Now add the recording that this rig file describes.")
        elif file is not None and has_rig:
            open_own(file)
        elif file is not None:
            with st.container(horizontal=True, vertical_alignment="center"):
                if st.button("Open it", type="primary", key="open own", icon=":material/troubleshoot:"):
                    open_own(file)
                st.caption("or add its rig file first.", width="content")


def open_own(file: ChosenFile) -> None:
    """Open a file on the analysis page."""
    open_file(file)
    state.go_to("analysis")


def show_samples() -> None:
    """Show the first `N_SHOWN` samples, which are the most instructive."""
    st.subheader("Samples and what each one shows", anchor=False)
    with st.container(key="samples", gap="small"):
        shown = samples()[:N_SHOWN]
        for first in range(0, len(shown), 2):
            cells = st.columns((3, 5) * 2, vertical_alignment="center")
            for button, text, sample in zip(cells[::2], cells[1::2], shown[first : first + 2], strict=False):
                text.markdown(f":gray[{sample.about}]")
                if button.button(sample.title, key=f"sample {sample.rig.stem}", width="stretch"):
                    open_sample(sample.rig.stem)
                    state.go_to("analysis")
