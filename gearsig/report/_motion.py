"""Forces from motion as text, as a table of samples, and as JSON.

The JSON object has these members; names end in their unit, numbers have nine significant digits, and unknown values are
null. Members may be added within a version, never renamed or removed.

- ``schema``: "gearsig.force", ``schema_version``: 1, ``gearsig_version``, ``source``
- ``duration_s``, ``sampling_rate_hz``, ``n_samples``
- ``methods``: origin of each motion quantity; ``notes``
- ``datum``: ``compression_um``, ``uncertainty_um``, ``method``
- ``models``: each with ``name``, ``description``, ``largest_n``, ``lowest_n``
- ``errors``: each with ``model``, ``reference``, ``rms_n``, ``relative_rms``, ``bias_n``, ``largest_n``,
  ``correlation``
- ``noise``: null, or ``reference``, ``levels_um``, ``rms_n`` (model → list), ``crossover_um``, ``text``
"""

from __future__ import annotations

from functools import partial
from textwrap import fill

import numpy as np

from gearsig.formatting import readable, unit_text
from gearsig.gap import severity_unit
from gearsig.motion import (
    AngleProfile,
    FittedParameter,
    ForceEstimate,
    Identification,
    NoiseStudy,
    StartStop,
    acceleration_limit_rad_s2,
)
from gearsig.report._json import document, members
from gearsig.spectra import Spectrum

WIDTH = 100


def force_text(estimate: ForceEstimate, noise: NoiseStudy | None = None) -> str:
    """Return the origin of the motion, the models, their errors and the noise study in plain text."""
    motion, datum = estimate.motion, estimate.datum
    zero = f"{1e6 * datum.compression_m:.4g} µm"
    spread = "" if datum.uncertainty_m != datum.uncertainty_m else f" ± {1e6 * datum.uncertainty_m:.2g}"
    paragraph = partial(fill, width=WIDTH, initial_indent="  ", subsequent_indent="    ")
    lines = [
        f"{motion.source or 'recording'}: {len(motion.driver_angle_rad)} samples at {motion.sampling_rate_hz:g} Hz",
        "",
        "Motion",
        *(f"  {role:<20} {text}" for role, text in motion.methods.items()),
        f"  {'middle of backlash':<20} at {zero}{spread} of the compression: {datum.method}",
        *(paragraph(f"Note: {note}") for note in motion.notes),
        "",
        "Models",
        *(paragraph(f"{name}: {text}") for name, text in estimate.descriptions.items()),
        "",
    ]
    if estimate.errors:
        lines.append(
            f"{'model':<24} {'against':<20} {'rms N':>10} {'rms %':>8} {'bias N':>10} {'largest N':>11} {'r':>7}"
        )
        lines += [
            f"{e.model:<24} {e.reference:<20} {e.rms_n:>10.1f} {100 * e.relative_rms:>8.1f} {e.bias_n:>10.1f} "
            f"{e.largest_n:>11.1f} {e.correlation:>7.3f}"
            for e in estimate.errors
        ]
    else:
        lines.append("There is no measured reference: neither torque nor force.")
    if noise is None:
        return "\n".join(lines)
    lines += ["", f"{'noise added (µm rms)':<24}" + "".join(f"{level:>9g}" for level in noise.levels_um)]
    lines += [f"{model:<24}" + "".join(f"{value:>9.0f}" for value in rms) for model, rms in noise.rms_n.items()]
    lines += [f"(rms error in N against {noise.reference})", fill(noise.text, WIDTH)]
    # The study adds noise to the angle; the effect of noise on the acceleration follows from the inertia.
    limit = acceleration_limit_rad_s2(noise, motion)
    if limit is not None:
        each = motion.contact.driver_inertia_kg_m2 / motion.path.base_radii_m[0]
        text = (
            f"Noise on the driver's acceleration adds J1/r_b1 = {each:.3g} N per rad/s²: the piecewise model is closer "
            f"up to {limit:.0f} rad/s² rms. Noise on the speeds affects only the damping."
        )
        lines.append(fill(text, WIDTH))
    return "\n".join(lines)


def force_json(estimate: ForceEstimate, noise: NoiseStudy | None = None) -> str:
    """Return an estimate as JSON (members: see the module); the samples are in the table."""
    motion, datum = estimate.motion, estimate.datum
    n = len(motion.driver_angle_rad)
    content = {
        **members(motion, "source", "sampling_rate_hz", "methods", "notes"),
        "n_samples": n,
        "duration_s": n / motion.sampling_rate_hz,
        "datum": {
            "compression_um": 1e6 * datum.compression_m,
            "uncertainty_um": 1e6 * datum.uncertainty_m,
            "method": datum.method,
        },
        "models": [
            {"name": name, "description": text, "largest_n": force.max(), "lowest_n": force.min()}
            for name, text in estimate.descriptions.items()
            for force in (estimate.forces_n[name],)
        ],
        "errors": estimate.errors,
        "noise": noise and members(noise, "reference", "levels_um", "rms_n", "crossover_um", "text"),
    }
    return document("gearsig.force", content)


def force_csv(estimate: ForceEstimate) -> str:
    """Return time, references, models, depth and pairs in contact as CSV."""
    text: str = estimate.to_frame().to_csv(index=False, float_format="%.9g", lineterminator="\n")
    return text


# Fitted parameters as text and as JSON.
#
# The JSON object has these members; names end in their unit, numbers have nine significant digits, and unknown values
# are null. Members may be added within a version, never renamed or removed.
#
# - ``schema``: "gearsig.identify", ``schema_version``: 2, ``gearsig_version``, ``source``
# - ``parameters``: each with ``name``, ``unit``, ``value``, ``low``, ``high`` (95 %), ``is_determined``, ``why_not``,
#   ``rig_value``, ``correlated_with``
# - ``equations``: each with ``name``, ``text``, ``condition``


def identify_text(identification: Identification) -> str:
    """Return the parameters with their intervals, and those not determined, in plain text."""
    lines = [f"{identification.source or 'recording'}: parameters with 95 % intervals", ""]
    lines += [f"{name} equation: {text}" for name, text in identification.equations.items()]
    lines += ["", f"{'parameter':<26} {'value':>11} {'from':>11} {'to':>11} {'rig':>11}  unit"]
    lines += [_row(p) for p in identification.parameters if p.is_determined]
    undetermined = [p for p in identification.parameters if not p.is_determined]
    if undetermined:
        lines += ["", "Not determined by this record"]
        lines += [
            fill(f"{p.name}: {p.why_not}", WIDTH, initial_indent="  ", subsequent_indent="    ") for p in undetermined
        ]
    alike = [
        f"{p.name} with {p.correlated_with}" for p in identification.parameters if p.is_determined and p.correlated_with
    ]
    if alike:
        lines += ["", fill(f"Determined together rather than separately: {'; '.join(alike)}.", WIDTH)]
    return "\n".join(lines)


def identify_json(identification: Identification) -> str:
    """Return the same as JSON; the comment above lists its members."""
    parameters = [
        members(p, "name", "unit", "value")
        | {"low": p.interval[0], "high": p.interval[1]}
        | members(p, "is_determined", "why_not", "rig_value", "correlated_with")
        for p in identification.parameters
    ]
    equations = [
        {"name": name, "text": text, "condition": identification.condition.get(name, float("nan"))}
        for name, text in identification.equations.items()
    ]
    content = {"source": identification.source, "parameters": parameters, "equations": equations}
    return document("gearsig.identify", content, 2)


def _row(p: FittedParameter) -> str:
    rig = "" if p.rig_value is None else readable(p.rig_value, 5)
    low, high = (readable(v, 5) for v in p.interval)
    unit = unit_text(severity_unit(p.unit))
    return f"{p.name:<26} {readable(p.value, 5):>11} {low:>11} {high:>11} {rig:>11}  {unit}".rstrip()


# Start–stop motion as text and as JSON.
#
# The JSON object has these members; names end in their unit, numbers have nine significant digits, and unknown values
# are null. Members may be added within a version, never renamed or removed.
#
# - ``schema``: "gearsig.start_stop", ``schema_version``: 2, ``gearsig_version``, ``source``
# - ``segments``: each with ``direction`` (1, −1, 0 at rest), ``start_s``, ``end_s``, ``turned_rad``, ``top_speed_rpm``
# - ``backlash``: null, or ``backlash_um``, ``uncertainty_um``, ``stiffness_n_per_m_lambda``, ``n_drive``, ``n_back``,
#   ``scatter_um``, ``method``
# - ``impacts``: each with ``time_s``, ``flank``, ``driver_tooth``, ``driven_tooth``, ``driver_angle_deg``,
#   ``speed_mps``, ``energy_j``, ``restitution``, ``lost_j``, ``peak_force_n``, ``note`` (why it has no restitution)
# - ``indicators``: each with ``name``, ``value``, ``unit``, ``computed_on``
# - ``teeth``: per tooth of the driver ``passes_forwards``, ``passes_backwards``, ``rms_forwards``, ``rms_backwards`` of
#   ``signal`` in ``unit``; null if there was nothing to average
# - ``compliance``: null, or per tooth of the driver ``extra_um``, ``uncertainty_um``, ``n_samples``;
#   ``deflection_um`` and ``weak_teeth``
# - ``orders``: of the same signal, forwards: ``order`` and ``amplitude`` (peak) as lists; null if no segment holds a
#   revolution
# - ``refusals``: results that the record does not allow; ``notes``: limitations of the others
MAX_ROWS = 12
"""Maximum number of segments and of impacts in the text; the JSON has all."""


def start_stop_text(examined: StartStop) -> str:
    """Return segments, backlash, the hardest impacts and the indicators, in plain text."""
    segments, impacts = examined.segments.segments, examined.impacts
    lines = [f"{examined.motion.source or 'recording'}: {examined.segments.summary}", ""]
    lines += ["segment           from s     to s   turned rev   top rpm"]
    lines += [
        f"{ {1: 'forwards', -1: 'backwards', 0: 'at rest'}[s.direction]:<14} {s.start_s:>9.3f} {s.end_s:>8.3f} "
        f"{s.turned_rad / (2 * np.pi):>12.4f} {s.top_speed_rad_s * 30 / np.pi:>9.2f}"
        for s in segments[:MAX_ROWS]
    ]
    lines += [f"… {len(segments) - MAX_ROWS} more"] if len(segments) > MAX_ROWS else []
    if (b := examined.backlash) is not None:
        text = f"Backlash {b.backlash_um:.4g} ± {b.uncertainty_um:.2g} µm along the line of action: {b.method}."
        lines += ["", fill(text, WIDTH)]
    if examined.teeth is not None:
        weak = ", ".join(map(str, examined.teeth.weak_teeth))
        lines.append(f"Teeth of the driver that deflect more than the others: {weak or 'none'}.")
    if impacts:
        lines += ["", f"{len(impacts)} impacts, the hardest:"]
        lines += ["   time s  flank  tooth    speed m/s   energy J  restitution   force N"]
        hardest = sorted(impacts, key=lambda i: -i.speed_mps)[:MAX_ROWS]
        lines += [
            f"{i.time_s:>9.4f}  {'drive' if i.flank > 0 else 'back':<5}  {i.driver_tooth:>5} {i.speed_mps:>12.4f} "
            f"{readable(i.energy_j, 3):>10} {readable(i.restitution, 3):>12} {i.peak_force_n:>9.0f}"
            for i in sorted(hardest, key=lambda i: i.time_s)
        ]
        lines += [f"… {len(impacts) - MAX_ROWS} more"] if len(impacts) > MAX_ROWS else []
    lines.append("")
    for i in examined.indicators:
        lines.append(f"{i.name:<24} {readable(i.value, 5):>12} {unit_text(severity_unit(i.unit))}".rstrip())
    lines += [fill(f"Cannot tell: {text}", WIDTH) for text in examined.refusals]
    lines += [fill(f"Note: {text}", WIDTH) for text in examined.notes]
    return "\n".join(lines)


def start_stop_json(
    examined: StartStop,
    profile: AngleProfile | None = None,
    signal: str = "",
    unit: str = "",
    orders: Spectrum | None = None,
) -> str:
    """Return the same as JSON; the comment above lists its members."""
    levels = ("passes_forwards", "passes_backwards", "rms_forwards", "rms_backwards")
    play = ("backlash_um", "uncertainty_um", "stiffness_n_per_m_lambda", "n_drive", "n_back", "scatter_um", "method")
    content = {
        "source": examined.motion.source,
        "segments": [
            members(s, "direction", "start_s", "end_s", "turned_rad")
            | {"top_speed_rpm": s.top_speed_rad_s * 30 / np.pi}
            for s in examined.segments.segments
        ],
        "backlash": examined.backlash and members(examined.backlash, *play),
        "impacts": examined.impacts,
        "indicators": [members(i, "name", "value", "unit", "computed_on") for i in examined.indicators],
        "teeth": profile and {"signal": signal, "unit": unit, **members(profile, *levels)},
        "compliance": examined.teeth,
        "orders": orders and {"order": orders.positions, "amplitude": orders.values},
        "refusals": examined.refusals,
        "notes": examined.notes,
    }
    return document("gearsig.start_stop", content, 2)
