"""What a phase plane needs: the band that is integrated, and what the section is locked to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import streamlit as st

from app.dashboard import state
from app.dashboard.as_typed import one_line
from app.dashboard.widgets.methods.choice import choose_one
from app.dashboard.widgets.methods.stretch import Stretch
from gearsig.diagnosis.types import Analysis
from gearsig.errors import InputError

if TYPE_CHECKING:
    from gearsig.angle.types import ShaftAngle
    from gearsig.phase.lock import CycleLock
    from gearsig.phase.plane import MotionQuantity
    from gearsig.rig.types import Rig

QUANTITIES = ("acceleration", "velocity", "displacement")
OF_MOTION = (*QUANTITIES, "transmission_error", "unknown")
WITHOUT_SPEED_HZ = 10.0
"""Low cut suggested where no shaft's frequency is known."""
SPARE = 1.05
STEADY = 0.05
"""Share of the mean by which the speed may vary while a section is still one of one motion."""


@dataclass(frozen=True)
class PhaseSettings:
    """What `phase_plane` is told."""

    low_cut_hz: float | None
    high_cut_hz: float | None
    quantity: MotionQuantity | None


def choose_band(analysis: Analysis, stretch: Stretch) -> PhaseSettings:
    """Let the user choose the band, and say what the channel measures where the recording does not.

    Raises
    ------
    InputError
        If the channel measures something else than motion.
    """
    known = stretch.recording.channels[0].quantity
    if known not in OF_MOTION:
        raise InputError(
            f"channel {stretch.channel!r} measures {known.replace('_', ' ')}: displacement and velocity do not follow "
            "from it",
            allowed="acceleration, velocity, displacement",
            remedy="choose another channel, or correct its quantity in the rig's [[sensor]] table",
        )
    left, right = st.columns(2)
    quantity: MotionQuantity | None = None
    if known == "unknown":
        with right:
            chosen = choose_one("The channel measures", QUANTITIES, _key(f"quantity {stretch.channel}", analysis))
            quantity = cast("MotionQuantity", chosen)
    measured = quantity or known
    with left:
        low = _choose_low_cut(analysis, stretch) if measured in ("acceleration", "velocity") else None
        if low is None:
            st.caption("A displacement is differentiated: nothing slow needs to be cut off.")
    half = stretch.recording.sampling_rate_hz / 2.0
    high = right.number_input(
        "Highest frequency (Hz)",
        value=None,
        placeholder=f"{0.8 * half:.5g}",
        key=_key("high", analysis),
        help=f"Up to {half:.5g} Hz. A lower one shows the slower motion alone, without resonances.",
        persist_state="session",
    )
    return PhaseSettings(low, None if high is None else float(high), quantity)


def _choose_low_cut(analysis: Analysis, stretch: Stretch) -> float | None:
    suggested, why = suggested_low_cut_hz(analysis, stretch)
    low = st.number_input(
        "Lowest frequency (Hz)",
        value=None,
        placeholder=f"{suggested:.3g}, {why}",
        key=_key("low", analysis),
        help="Integration magnifies whatever is slow. Too low, noise turns into drift; too high, slow motion is bent.",
        persist_state="session",
    )
    return suggested if low is None else float(low)


def suggested_low_cut_hz(analysis: Analysis, stretch: Stretch) -> tuple[float, str]:
    """Return a frequency below the slowest mesh, or else shaft, or what the stretch allows if that is higher, and why.

    Far below the mesh, integrated noise outgrows the motion of the teeth and makes a cloud of the section.
    """
    from gearsig.phase.integration import SETTLING_PERIODS
    from gearsig.phase.plane import LEAST_PERIODS

    possible = SPARE * (2.0 * SETTLING_PERIODS + LEAST_PERIODS) / stretch.recording.duration_s
    meshes = _mesh_orders(analysis.rig)
    if stretch.angle is None:
        wanted, why = WITHOUT_SPEED_HZ, "as no shaft's frequency is known"
    elif meshes:
        wanted, why = min(meshes) * _lowest_hz(stretch.angle) / 3.0, "a third of the slowest mesh frequency"
    else:
        slowest = min(_ratios(analysis.rig))
        wanted, why = 0.5 * slowest * _lowest_hz(stretch.angle), "half of the slowest shaft's frequency"
    low, why = (wanted, why) if wanted >= possible else (possible, "as low as the stretch allows")
    return float(f"{low:.3g}"), why


def _lowest_hz(angle: ShaftAngle) -> float:
    return angle.speed_range_rpm[0] / 60.0


def _mesh_orders(rig: Rig | None) -> list[float]:
    orders = [] if rig is None else [rig.mesh_order(pair) for pair in rig.pairs]
    return [order for order in orders if order]


def _ratios(rig: Rig | None) -> list[float]:
    ratios = [] if rig is None else [rig.ratio(name) for name in rig.shaft_names]
    return [ratio for ratio in ratios if ratio] or [1.0]


def choose_lock(analysis: Analysis, stretch: Stretch) -> CycleLock | None:
    """Return what gives a point per cycle; None where the speed is not known."""
    from gearsig.phase.lock import find_lock

    if stretch.angle is None:
        st.info("There is no Poincaré section: it takes a shaft angle, and the speed is not known.")
        return None
    lowest, highest = stretch.angle.speed_range_rpm
    if highest - lowest > STEADY * stretch.angle.mean_speed_rpm:
        st.warning(
            f"The speed runs from {lowest:.4g} to {highest:.4g} rpm here: a Poincaré section shows one motion only at "
            "a steady speed. Its points smear, and what is said of them does not hold; choose a steady stretch."
        )
    choices: dict[str, tuple[str, str]] = {}
    rig = analysis.rig
    if rig is not None:
        choices |= {f"mesh cycle of {one_line(pair.name)}": (pair.name, "") for pair in rig.pairs}
        choices |= {f"revolution of {one_line(name)}": ("", name) for name in rig.shaft_names}
    if not choices:
        choices = {"revolution of the shaft": ("", "")}
    key = _key(f"lock {list(choices)}", analysis)
    chosen = st.selectbox("A point once per", list(choices), key=key, persist_state="session")
    pair, shaft = choices[chosen]
    return find_lock(stretch.recording, pair=pair, shaft=shaft, rig=rig, angle=stretch.angle)


def _key(name: str, analysis: Analysis) -> str:
    return state.view_key(f"phase plane {name}", analysis)
