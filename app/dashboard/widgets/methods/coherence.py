"""Cyclic coherence: which carriers are modulated at which frequency or order, and the mean over the carriers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.downloads import offer_downloads
from app.dashboard.widgets.methods.kurtogram import PREPARATIONS, spectrum_columns
from app.dashboard.widgets.methods.modulation_lines import highest_of_interest, modulation_cursors, of_stretch
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.picture import show_picture
from app.dashboard.widgets.range_slider import choose_range
from app.dashboard.widgets.spectrum import FOUND_SHARE, show_spectrum
from gearsig.diagnosis.types import Analysis, ChannelAnalysis
from gearsig.errors import InputError
from gearsig.report.lines import marked_positions, speed_is_constant

if TYPE_CHECKING:
    from gearsig.plot.cursors import Cursor
    from gearsig.spectra.coherence_types import EnhancedEnvelope, SpectralCoherence
    from gearsig.spectra.kurtogram_preparation import Preparation

VIEW = "coherence"
N_FIRST, N_MOST = 262_144, 4_000_000
BANDS = (8, 16, 32, 64, 128, 256)
PROBABILITIES = {"1 line in 20": 0.05, "1 line in 100": 0.01, "1 line in 1000": 1e-3, "1 line in 10 000": 1e-4}
MOST_CELLS = 1 << 22
"""100 MB of results."""
N_KEPT = 3
HEIGHT_IN = 5.0
MARKED_KINDS = ("bearing", "shaft")


@dataclass(frozen=True)
class CoherenceSettings:
    """What the coherence is told; `highest` in Hz, or orders where it runs over them."""

    over_orders: bool
    highest: float
    n_bands: int
    preparation: Preparation


def show_coherence(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show the coherence of one channel as a map, and its mean over the carriers."""
    stretch = choose_stretch(analysis, channel, VIEW, n_first=N_FIRST, n_most=N_MOST)
    settings = _choose_settings(analysis, stretch)
    _check_size(stretch, settings)
    with st.spinner("Computing the coherence …", show_time=True):
        found = coherence_of(stretch.key, settings, stretch)
    mean = _choose_mean(analysis, found)
    cursors = modulation_cursors(analysis, stretch, mean.spectrum)
    marked = marked_positions(of_stretch(analysis, stretch), mean.spectrum, channel.channel, of_bearings=True)
    name = f"{VIEW} {found.alpha_axis}"
    limits = show_spectrum(
        analysis, mean.spectrum, cursors, name, marked=marked, scale="Linear", quantity="mean squared coherence"
    )
    st.caption(
        f"Mean squared coherence over the carriers from {mean.band_hz[0]:.5g} to {mean.band_hz[1]:.5g} Hz. "
        f"Stationary noise exceeds **{mean.level:.3g}** in 1 line of {1 / mean.probability:.5g}."
    )
    _show_map(found, mean, _standing_out(cursors, mean), _of_shafts(cursors, mean), limits)
    offer_downloads(analysis, VIEW, tables={"Enhanced spectrum": lambda: spectrum_columns(mean.spectrum)})


def _choose_settings(analysis: Analysis, stretch: Stretch) -> CoherenceSettings:
    one, two = st.columns(2)
    three, four = st.columns(2)
    over_orders = False
    if stretch.angle is not None:
        about = "Over orders, modulation that is locked to the shaft stays on one line when the speed changes."
        names = ("Cyclic frequency", "Cyclic order")
        first = names[0] if speed_is_constant(of_stretch(analysis, stretch)) else names[1]
        with one:
            over_orders = choose_one("Over", names, _key("over", analysis), default=first, about=about) == names[1]
    prepared = next(iter(PREPARATIONS))
    if not over_orders:
        about = "Steady tones are coherent with each other: remove them, or mesh harmonics fill the picture."
        key = _key("preparation", analysis)
        with two:
            prepared = choose_one("Signal", list(PREPARATIONS), key, default="Tones removed", about=about)
    usual = float(f"{highest_of_interest(analysis, stretch, of_orders=over_orders):.3g}")
    highest = three.number_input(
        f"Highest cyclic {'order' if over_orders else 'frequency (Hz)'}",
        value=usual,
        step=usual / 10.0,
        format="%g",
        key=_key(f"highest {over_orders} {usual!r}", analysis),
        help="The fastest rhythm sought. Carriers below half of it are left out.",
        persist_state="session",
    )
    about = "Fewer bands average more and find weaker modulation; more show better where its carrier is."
    key = _key("bands", analysis)
    n_bands = four.select_slider("Carrier bands", BANDS, value=64, key=key, help=about, persist_state="session")
    preparation = cast("Preparation", PREPARATIONS[prepared])
    return CoherenceSettings(over_orders, float(highest), int(n_bands), preparation)


def _check_size(stretch: Stretch, settings: CoherenceSettings) -> None:
    """Refuse results that a browser session should not hold."""
    length = stretch.recording.duration_s
    if settings.over_orders and stretch.angle is not None:
        length = stretch.angle.n_revolutions
    n_cells = settings.highest * length * settings.n_bands
    if n_cells > MOST_CELLS:
        raise InputError(
            f"{settings.highest * length:.0f} cyclic frequencies × {settings.n_bands} bands are too many cells",
            allowed=f"at most {MOST_CELLS} on this page",
            remedy="lower the highest cyclic frequency or order, take fewer bands or a shorter stretch",
        )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def coherence_of(key: str, settings: CoherenceSettings, _stretch: Stretch) -> SpectralCoherence:
    """Return the coherence; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    del key
    recording, name, highest, n_bands = _stretch.recording, _stretch.channel, settings.highest, settings.n_bands
    if settings.over_orders and _stretch.angle is not None:
        from gearsig.spectra.coherence_order import order_coherence

        return order_coherence(recording, name, _stretch.angle, highest_order=highest, n_bands=n_bands)
    from gearsig.spectra.coherence import channel_coherence

    return channel_coherence(
        recording, name, highest_alpha_hz=highest, n_bands=n_bands, preparation=settings.preparation
    )


def _choose_mean(analysis: Analysis, found: SpectralCoherence) -> EnhancedEnvelope:
    from gearsig.spectra.coherence_types import enhanced_envelope

    left, right = st.columns((2, 1))
    carriers = found.frequency_hz
    with left:
        band = (
            choose_range("Carriers averaged (Hz)", analysis, float(carriers[-1]), start=float(carriers[0]), name=VIEW)
            if len(carriers) > 1
            else (float(carriers[0]), float(carriers[0]))
        )
    key = _key("probability", analysis)
    about = "How often noise alone passes the dashed line."
    odds = right.selectbox(
        "Noise passes the level in", list(PROBABILITIES), index=2, key=key, help=about, persist_state="session"
    )
    return enhanced_envelope(found, band, probability=PROBABILITIES[odds])


def _standing_out(cursors: Sequence[Cursor], mean: EnhancedEnvelope) -> list[Cursor]:
    """Return the lines of shafts and bearings at which the mean is above noise's level, within a bearing's slip."""
    end = float(mean.spectrum.positions[-1])
    inside = [c for c in cursors if c.kind in MARKED_KINDS and float(mean.spectrum.positions[0]) <= c.position <= end]
    return [c for c in inside if _peak(c, mean)[1] > mean.level]


def _peak(cursor: Cursor, mean: EnhancedEnvelope) -> tuple[float, float]:
    """Return place and height of the largest value at a line, a bearing's within its slip."""
    slack = FOUND_SHARE * cursor.position if cursor.kind == "bearing" else 0.0
    return mean.spectrum.largest_near(cursor.position, slack + mean.spectrum.resolution)


def _of_shafts(cursors: Sequence[Cursor], mean: EnhancedEnvelope) -> set[Cursor]:
    """Return the bearing lines whose peak lies on a multiple of a shaft's speed, as meshes and their sidebands do."""
    speeds = [c.position / c.number for c in cursors if c.kind == "shaft"]
    peaks = {c: _peak(c, mean)[0] for c in _standing_out(cursors, mean) if c.kind == "bearing"}
    near = mean.spectrum.resolution
    return {c for c, at in peaks.items() if any(abs(at - max(1, round(at / f)) * f) <= near for f in speeds)}


def _show_map(
    found: SpectralCoherence,
    mean: EnhancedEnvelope,
    marked: Sequence[Cursor],
    of_shafts: set[Cursor],
    limits: tuple[float, float],
) -> None:
    from gearsig.plot.coherence import coherence_figure

    low, high = limits
    inside = [cursor for cursor in marked if low <= cursor.position <= high]
    step = found.alpha_resolution
    around = (min(low, high - 2.5 * step), max(high, float(found.alpha[0]) + 2.5 * step))
    positions = [cursor.position for cursor in inside]
    figure = coherence_figure(found, mean, marked=positions, limits=around, height_in=HEIGHT_IN)
    show_picture(figure, f"Squared coherence of {found.source} over {found.alpha_label} and carrier frequency")
    st.caption(_in_words(inside, of_shafts) if inside else "No line of a shaft or bearing stands above noise's level.")


def _in_words(inside: Sequence[Cursor], of_shafts: set[Cursor]) -> str:
    """Name the lines that stand out, those that gears may cause as well last."""
    own, shared = ([c for c in inside if (c in of_shafts) == either] for either in (False, True))
    text = "Above noise's level means that there is modulation, not that there is damage: sound gears modulate too. "
    if own:
        text += (
            "Dotted, lines that stand above noise's level, bearings' within 1 % for their slip: " + _names(own) + ". "
        )
    if shared:
        text += (
            "Bearing lines whose peak lies on a multiple of a shaft's speed, which meshes and shafts cause as well: "
        )
        text += _names(shared) + "."
    return text


def _names(cursors: Sequence[Cursor]) -> str:
    return as_typed(", ".join(dict.fromkeys(f"{cursor.label} ({cursor.position:.5g})" for cursor in cursors)))


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"{VIEW} {name}", analysis)
