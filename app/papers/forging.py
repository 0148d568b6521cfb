"""The forging drive: interaction force and its errors, starts and stops and continuous rotation.

Machine: preset "manipulator_formula", with the study's 95 N·m, 290 kg, 1 ms; sensors without noise unless stated.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import brentq

from app.papers import Claim, Paper, PaperFigure, Progress, judged, within_part
from gearsig import plot
from gearsig.motion import (
    AS_PRINTED,
    FROM_TORQUE,
    HUNT_CROSSLEY,
    PIECEWISE,
    TEETH,
    TOOTH_FORCE,
    ForceEstimate,
    StartStop,
    estimate_forces,
    examine_start_stop,
    measure_motion,
)
from gearsig.plot import curve_panel, panels_figure
from gearsig.recording import Recording
from sims import simulate
from sims.presets import preset

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PRESETS = ("manipulator_formula", "manipulator_table")
EXACT = {
    "encoder_counts": 0,
    "angle_noise_urad": 0,
    "speed_noise_mrad_per_s": 0,
    "acceleration_noise_rad_per_s2": 0,
    "torque_noise_nm": 0,
}
"""Sensors without noise: the study compares models, not sensors."""
SOURCE = (
    "Z. Xu, H. Deng, Y. Zhang, Piecewise nonlinear dynamic modeling for gear transmissions with rotary inertia and "
    "backlash, IEEE Access"
)


@cache
def recording(mode: str, preset_name: str = PRESETS[0]) -> Recording:
    """Return a recording of the drive in mode "start-stop" or "continuous"."""
    return simulate(
        "forging",
        preset=preset_name,
        parameters={**EXACT, "mode": mode},
        duration_s=6.0 if mode == "start-stop" else 3.0,
        sampling_rate_hz=1000.0,
    )


@cache
def estimated(mode: str, preset_name: str = PRESETS[0]) -> ForceEstimate:
    """Estimate the force from the motion and compare it with torque over base radius."""
    return estimate_forces(measure_motion(recording(mode, preset_name)))


def _relative(estimate: ForceEstimate, model: str, reference: str = FROM_TORQUE) -> float:
    return 100.0 * estimate.error(model, reference).relative_rms


def _reason_not_as_printed(estimate: ForceEstimate) -> str:
    """Return a text about the contribution of the printed inertia term and its share of the formula's error."""
    motion, contact = estimate.motion, estimate.motion.contact
    r1, r2 = motion.path.base_radii_m
    pinion_kg, load_kg = contact.driver_inertia_kg_m2 / r1**2, (contact.driven_inertia_kg_m2 or 0.0) / r2**2
    added = load_kg * motion.compression_acceleration_mps2 - pinion_kg * r1 * motion.driver_acceleration_rad_s2
    error = estimate.forces_n[AS_PRINTED] - estimate.references_n[FROM_TORQUE]
    explained = 1.0 - float(np.mean((error - added) ** 2) / np.mean(error**2))
    return (
        "it is an identity of two free bodies, with the opposite sign. A torque on the pinion shaft accelerates the "
        f"pinion, {pinion_kg:.3g} kg at its base radius, and not m₀ = J₂/rb₂² = {load_kg:.3g} kg: using that term "
        f"instead of J₁α₁/rb₁ explains {100 * explained:.1f} % of the mean square error"
    )


def _force(mode: str, answers: str) -> PaperFigure:
    estimate = estimated(mode)
    rigid = estimated(mode, PRESETS[1])
    piecewise, hunt, printed = (_relative(estimate, model) for model in (PIECEWISE, HUNT_CROSSLEY, AS_PRINTED))
    claims = [
        judged(
            "the piecewise model agrees with the force from the measured torque",
            f"{piecewise:.2g} % rms (rigid Table 1 stiffness: {_relative(rigid, PIECEWISE):.2g} %), the teeth alone "
            f"{_relative(estimate, TEETH, TOOTH_FORCE):.2g} % of the simulated tooth force",
            agrees=piecewise < 5.0,
        ),
        judged(
            "its errors are smaller than those of Hunt–Crossley",
            f"{piecewise:.2g} % against {hunt:.3g} %",
            agrees=piecewise < 0.5 * hunt,
        ),
        judged(
            "the formula as printed, with m₀q̈ of the impacted body, fits",
            f"{printed:.0f} % rms",
            agrees=printed < 5.0,
            partly=printed < hunt,
            because=_reason_not_as_printed(estimate),
        ),
    ]
    if mode == "start-stop":
        claims.append(_back_impact(estimate))
    return PaperFigure(
        f"force_{mode.replace('-', '_')}",
        answers,
        f"interaction force and errors, {mode} rotation",
        _force_figure(estimate, mode),
        tuple(claims),
    )


def _back_impact(estimate: ForceEstimate) -> Claim:
    """Judge the force after the torque ends at 1 s: the load, which still turns, strikes back."""
    time = estimate.motion.time_s
    after = (time > 1.0) & (time < 3.0)
    reverse = estimate.references_n[FROM_TORQUE][after]
    lowest, delay_ms = float(reverse.min()), 1e3 * (float(time[after][np.argmin(reverse)]) - 1.0)
    return judged(
        "a reverse back impact when the torque is removed: the driven gear strikes the pinion",
        f"{lowest:.0f} N, {delay_ms:.0f} ms after the torque is removed",
        agrees=lowest < -100.0,
    )


def _force_figure(estimate: ForceEstimate, mode: str) -> Figure:
    """Draw forces and errors of the start and, if the drive stops, of the back impact after 1 s."""
    time = estimate.motion.time_s
    shown = (time < 1.4) if mode == "start-stop" else (time < 0.6)
    measured = estimate.references_n[FROM_TORQUE][shown]
    models = {
        "piecewise": estimate.forces_n[PIECEWISE][shown],
        "Hunt–Crossley": estimate.forces_n[HUNT_CROSSLEY][shown],
    }
    forces = {FROM_TORQUE: measured} | models
    errors = {name: force - measured for name, force in models.items()}
    panels = [
        curve_panel(time[shown], {k: 1e-3 * v for k, v in curves.items()}, "time (s)", f"{label} (kN)", title)
        for curves, label, title in (
            (forces, "force", "total interaction force; the piecewise curve is hidden by the first"),
            (errors, "error", "force errors"),
        )
    ]
    return panels_figure(panels, title=f"Interaction force, {mode} rotation")


PRESSURE_ANGLE_RAD, TEETH_OF_BOTH = np.radians(20.0), (20, 100)
YOUNG_PA, POISSON = 210e9, 0.3


def _contact_ratio(addendum: float) -> float:
    """Return the contact ratio ε = (Σ √(ra² − rb²) − a sin α)/(π m cos α), lengths in modules."""
    cosine, sine = np.cos(PRESSURE_ANGLE_RAD), np.sin(PRESSURE_ANGLE_RAD)
    reach = sum(np.sqrt((z / 2 + addendum) ** 2 - (z / 2 * cosine) ** 2) for z in TEETH_OF_BOTH)
    return float((reach - sum(TEETH_OF_BOTH) / 2 * sine) / (np.pi * cosine))


def _addendum_of(contact_ratio: float) -> float:
    """Return the addendum of both gears, in modules, that gives a contact ratio."""
    return float(brentq(lambda addendum: _contact_ratio(addendum) - contact_ratio, 0.8, 1.3))


def _why_not_in_the_table(by_formula: float) -> str:
    """Return a text about what formula (13) would need for the table's number, and what else has its unit."""
    modulus_pa = YOUNG_PA / (2 * (1 - POISSON**2))  # E*
    width_mm = 1e3 * 1.72e9 / (np.pi / 4 * modulus_pa)
    part = 1.72e9 / by_formula
    return (
        f"formula (13) with the stated geometry gives {1 / part:.2f} times as much, in N/m^1.5; for the table's "
        f"number it would need {part:.4f} of the steel modulus, or {part**2:.4f} of the radius. In the table's unit, "
        f"N/m, it equals (π/4) E* b of a line contact on a face of {width_mm:.1f} mm. Both numbers are presets"
    )


def _parameters() -> PaperFigure:
    estimate = estimated("start-stop")
    contact, path = estimate.motion.contact, estimate.motion.path
    claims = (
        within_part(
            "contact ratio 1.749",
            1.749,
            path.contact_ratio,
            "",
            part=0.02,
            because="gears of 20 and 100 standard teeth, addendum 1.00 module, have that; the printed value belongs to "
            f"{_addendum_of(1.749):.3f} modules",
        ),
        within_part(
            "stiffness by (13): 1.72e9 N/m",
            1.72e9,
            contact.stiffness_n_per_m_lambda,
            "N/m^1.5",
            part=0.05,
            because=_why_not_in_the_table(contact.stiffness_n_per_m_lambda),
        ),
        within_part("base radius 50 mm · cos 20°", 46.985, 1e3 * path.base_radii_m[0], "mm", part=1e-3),
    )
    depth_um = np.linspace(0.0, 40.0, 200)
    panels = []
    for name in PRESETS:
        c = estimated("start-stop", name).motion.contact
        force = c.stiffness_n_per_m_lambda * (1e-6 * depth_um) ** c.exponent
        panels.append(
            curve_panel(
                depth_um, {"one pair": 1e-3 * force, "two pairs": 2e-3 * force}, "depth (µm)", "force (kN)", name
            )
        )
    figure = panels_figure(
        panels, n_columns=2, title="Static force of the flanks: stiffness of the formula and of the table"
    )
    return PaperFigure("parameters", "Table 1", "parameters", figure, claims)


def _start_stop() -> PaperFigure:
    examined: StartStop = examine_start_stop(measure_motion(recording("start-stop")))
    impacts = examined.impacts
    back = [impact for impact in impacts if impact.flank < 0]
    first = [impact for impact in impacts if impact.time_s < 1.0]
    claims = (
        judged(
            "starts and stops cause intermittent motion: the flanks separate and strike",
            f"{len(impacts)} impacts, {len(back)} of them on the back flank, {len(first)} during the start",
            agrees=len(impacts) > 2 and len(back) > 0,
        ),
    )
    return PaperFigure(
        "start_stop",
        "Figure 6a, the stopping phase",
        "starts, stops and impacts",
        plot.start_stop_figure(examined),
        claims,
    )


UNANSWERED = {
    "1, 2 and 4": "sketches of gear meshing",
    "3": "an impact test rig of another publication",
    "5": "a photograph of the manipulator",
    "6 and 7, measured curves": "torque and motion of the manipulator, which are not available: the drive is simulated",
}


def compute(on_progress: Progress) -> Paper:
    """Compute all figures."""
    on_progress("start-stop", 0.0)
    figures = [_force("start-stop", "Figure 6")]
    on_progress("continuous", 0.4)
    figures += [_force("continuous", "Figure 7"), _start_stop(), _parameters()]
    on_progress("done", 1.0)
    about = preset("forging", PRESETS[0])
    return Paper(
        "forging",
        "The forging drive",
        SOURCE,
        f"preset {about.name}; inertias, backlash, motor and brake are assumed",
        tuple(figures),
        UNANSWERED,
    )
