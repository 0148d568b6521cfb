"""Orders taken out as waveforms by Vold–Kalman, their levels beside those of resampling-based tracking."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import as_typed
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.order_results import show_separation
from app.dashboard.widgets.methods.stretch import Stretch, choose_stretch
from app.dashboard.widgets.speed import show_unknown_speed
from gearsig.diagnosis.types import Analysis, CannotTell, ChannelAnalysis
from gearsig.errors import GearsigError, InputError

if TYPE_CHECKING:
    from gearsig.orders.types import TrackedOrder
    from gearsig.orders.vold_kalman_types import Generation, OrderSeparation

N_FIRST = 250_000
N_FEWEST, N_EFFORT = 2**16, 1_600_000
"""Coupled orders take time as their number squared: so many samples times orders squared, but not less than that."""
MOST_ORDERS = 6
KINDS = ("mesh", "shaft", "bearing", "sideband")
COUPLINGS: dict[str, bool | Literal["automatic"]] = {"Automatic": "automatic", "All": True, "None": False}
N_KEPT = 4
"""Separations hold several arrays as long as the stretch for every order."""
HANN_BANDWIDTH = 1.5
"""Noise bandwidth of a Hann window in lines: blocks of 1.5/B revolutions collect over B orders."""
LONGEST_BLOCK = 0.25
"""Of the stretch, in revolutions."""


@dataclass(frozen=True)
class OrderSettings:
    """What the filter is told; one of both bandwidths is None."""

    orders: tuple[float, ...]
    bandwidth_hz: float | None
    bandwidth_orders: float | None
    n_poles: int
    generation: Generation
    coupled: bool | Literal["automatic"]


def show_order_tracking(analysis: Analysis, channel: ChannelAnalysis) -> None:
    """Show levels and waveforms of chosen orders of one channel."""
    if isinstance(analysis.shaft_angle, CannotTell):
        show_unknown_speed(analysis.shaft_angle)
        return
    left, right = st.columns(2)
    with left:
        named = _choose_orders(analysis)
    n_most = max(N_FEWEST, N_EFFORT // max(2, len(named)) ** 2)
    with right:
        stretch = choose_stretch(analysis, channel, "order tracking", n_first=N_FIRST, n_most=n_most)
    settings = _choose_settings(analysis, tuple(named.values()))
    if stretch.angle is None:
        st.info("The shaft's angle is not known in this stretch.")
        return
    with st.spinner("Separating the orders …", show_time=True):
        separation = separated(stretch.key, settings, stretch)
        tracks, reason = _tracks(settings, stretch)
    show_separation(analysis, stretch, list(named), separation, tracks)
    if reason:
        st.caption(f"No resampling-based track: {as_typed(reason)}")


def _choose_orders(analysis: Analysis) -> dict[str, float]:
    """Return chosen orders of the reference shaft by name; the first two at first."""
    known = _known_orders(analysis)
    first = list(known)[:2]
    chosen = st.multiselect(
        "Orders",
        list(known),
        default=first,
        max_selections=MOST_ORDERS,
        accept_new_options=True,
        placeholder="choose, or type a number",
        help="Cycles per revolution of the reference shaft. Any number can be typed, such as 2 or 0.42.",
        key=_key(f"orders {list(known)}", analysis),
        persist_state="session",
    )
    if not chosen:
        raise InputError("no orders are chosen", where="Orders", remedy="choose some from the list or type a number")
    return {name: known[name] if name in known else _number(name) for name in chosen}


def _known_orders(analysis: Analysis) -> dict[str, float]:
    """Return the orders that follow from the rig, the most telling kinds first."""
    if analysis.rig is None or not analysis.rig.shafts:
        return {f"{k}× shaft": float(k) for k in (1, 2, 3)}
    from gearsig.rig.orders import order_lines

    lines = [line for line in order_lines(analysis.rig, n_sidebands=1) if line.kind in KINDS]
    lines.sort(key=lambda line: KINDS.index(line.kind))
    return {f"{line.label} ({line.order:.5g})": line.order for line in lines}


def _number(text: str) -> float:
    try:
        return float(text.replace(",", "."))
    except ValueError:
        raise InputError(
            f"{text!r} is no number", where="Orders", allowed="cycles per revolution, such as 29 or 0.42"
        ) from None


def _choose_settings(analysis: Analysis, orders: tuple[float, ...]) -> OrderSettings:
    one, two, three = st.columns(3)
    four, five, _ = st.columns(3)
    with one:
        unit = choose_one("Bandwidth in", ("Orders", "Hz"), _key("unit", analysis))
    first = 0.5 if unit == "Orders" else 5.0
    about = "Between the -3 dB points. Narrow bands tell close orders apart and smooth changes of level."
    width = two.number_input(
        f"Bandwidth ({unit.lower() if unit == 'Orders' else unit})",
        value=first,
        step=first / 5.0,
        format="%g",
        key=_key(f"bandwidth {unit}", analysis),
        help=about,
        persist_state="session",
    )
    with four:
        about = "The second generation has 1 to 3 poles; the first has two and a fixed shape."
        generation = choose_one("Generation", ("Second", "First"), _key("generation", analysis), about=about)
    with three:
        about = "More poles: steeper skirts, longer settling. The first generation has two."
        poles = choose_one("Poles", ("1", "2", "3"), _key("poles", analysis), default="2", about=about)
    with five:
        about = "Orders solved for together share the signal where they cross or lie close: automatic where it matters."
        coupling = choose_one("Coupling", tuple(COUPLINGS), _key("coupling", analysis), about=about)
    in_hz = unit == "Hz"
    name: Generation = "second" if generation == "Second" else "first"
    return OrderSettings(
        orders, float(width) if in_hz else None, None if in_hz else float(width), int(poles), name, COUPLINGS[coupling]
    )


@st.cache_resource(max_entries=N_KEPT, show_spinner=False)
def separated(key: str, settings: OrderSettings, _stretch: Stretch) -> OrderSeparation:
    """Return the separated orders; `key` stands for the stretch. It is frozen, so that sessions may share it."""
    from gearsig.orders.vold_kalman import track_vold_kalman

    del key
    return track_vold_kalman(
        _stretch.recording,
        _stretch.channel,
        settings.orders,
        bandwidth_hz=settings.bandwidth_hz,
        bandwidth_orders=settings.bandwidth_orders,
        n_poles=settings.n_poles,
        generation=settings.generation,
        coupled=settings.coupled,
        shaft_angle=_stretch.angle,
    )


def _tracks(settings: OrderSettings, stretch: Stretch) -> tuple[tuple[TrackedOrder, ...], str]:
    """Return resampling-based tracks, of the same bandwidth where the stretch allows it, or why there are none."""
    if stretch.angle is None:
        return (), "the shaft's angle is not known"
    wanted = settings.bandwidth_orders
    if wanted is None:
        wanted = 60.0 * (settings.bandwidth_hz or 1.0) / max(stretch.angle.mean_speed_rpm, 1e-9)
    revolutions = min(max(HANN_BANDWIDTH / wanted, 1.0), LONGEST_BLOCK * stretch.angle.n_revolutions)
    try:
        return resampled(stretch.key, settings.orders, round(revolutions, 6), stretch), ""
    except GearsigError as error:
        return (), str(error)


@st.cache_data(max_entries=N_KEPT, show_spinner=False)
def resampled(
    key: str, orders: tuple[float, ...], revolutions_per_block: float, _stretch: Stretch
) -> tuple[TrackedOrder, ...]:
    """Return levels from blocks of revolutions; `key` stands for the stretch."""
    from gearsig.angle.resample import resample_to_angle
    from gearsig.orders.track import track_orders

    del key
    if _stretch.angle is None:
        return ()
    signal = resample_to_angle(_stretch.recording, _stretch.angle, channels=[_stretch.channel])
    return track_orders(signal, _stretch.channel, orders, revolutions_per_block=revolutions_per_block)


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"order tracking {name}", analysis)
