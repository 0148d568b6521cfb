"""Forces from motion as text, as a table of samples, and as JSON.

The JSON object has these members; names end in their unit, numbers carry nine significant digits, and what is not known
is null. Members may be added within a version, never renamed or removed.

- ``schema``: "gearsig.force", ``schema_version``: 1, ``gearsig_version``, ``source``
- ``duration_s``, ``sampling_rate_hz``, ``n_samples``
- ``methods``: where each motion came from; ``notes``
- ``datum``: ``compression_um``, ``uncertainty_um``, ``method``
- ``models``: each with ``name``, ``description``, ``largest_n``, ``lowest_n``
- ``errors``: each with ``model``, ``reference``, ``rms_n``, ``relative_rms``, ``bias_n``, ``largest_n``,
  ``correlation``
- ``noise``: null, or ``reference``, ``levels_um``, ``rms_n`` (model → list), ``crossover_um``, ``text``
"""

from __future__ import annotations

import csv
import json
from dataclasses import asdict
from io import StringIO
from textwrap import fill
from typing import Any

import numpy as np

from gearsig import __version__
from gearsig.formatting import readable, rounded
from gearsig.gap import severity_unit
from gearsig.motion import (
    AngleProfile,
    FittedParameter,
    ForceEstimate,
    Identification,
    Impact,
    NoiseStudy,
    StartStop,
    acceleration_limit_rad_s2,
)
from gearsig.plot import unit_text
from gearsig.spectra import Spectrum

SCHEMA, SCHEMA_VERSION = "gearsig.force", 1
WIDTH = 100
Json = dict[str, Any]


def force_text(estimate: ForceEstimate, noise: NoiseStudy | None = None) -> str:
    """Return where the motion came from, the models, their errors and the study of noise, in plain text."""
    motion, datum = estimate.motion, estimate.datum
    zero = f"{1e6 * datum.compression_m:.4g} µm"
    spread = "" if datum.uncertainty_m != datum.uncertainty_m else f" ± {1e6 * datum.uncertainty_m:.2g}"
    n = len(motion.driver_angle_rad)
    lines = [
        f"{motion.source or 'recording'}: {n} samples at {motion.sampling_rate_hz:g} Hz",
        "",
        "Motion",
        *(f"  {role:<20} {text}" for role, text in motion.methods.items()),
        f"  {'middle of the play':<20} at {zero}{spread} of the compression: {datum.method}",
        *(_wrapped(f"Note: {note}", "  ") for note in motion.notes),
        "",
        "Models",
        *(_wrapped(f"{name}: {text}", "  ") for name, text in estimate.descriptions.items()),
        "",
        *_error_lines(estimate),
    ]
    if noise is not None:
        lines += ["", *_noise_lines(noise), *_acceleration_line(estimate, noise)]
    return "\n".join(lines)


def force_json(estimate: ForceEstimate, noise: NoiseStudy | None = None) -> str:
    """Return an estimate as JSON, see the module's description; the samples are in the table."""
    motion, datum = estimate.motion, estimate.datum
    data: Json = {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "gearsig_version": __version__,
        "source": motion.source,
        "sampling_rate_hz": rounded(motion.sampling_rate_hz),
        "n_samples": len(motion.driver_angle_rad),
        "duration_s": rounded(len(motion.driver_angle_rad) / motion.sampling_rate_hz),
        "methods": dict(motion.methods),
        "notes": list(motion.notes),
        "datum": {
            "compression_um": rounded(1e6 * datum.compression_m),
            "uncertainty_um": rounded(1e6 * datum.uncertainty_m),
            "method": datum.method,
        },
        "models": [
            {"name": name, "description": text, "largest_n": rounded(float(estimate.forces_n[name].max())),
             "lowest_n": rounded(float(estimate.forces_n[name].min()))}
            for name, text in estimate.descriptions.items()
        ],
        "errors": [
            {"model": e.model, "reference": e.reference, "rms_n": rounded(e.rms_n),
             "relative_rms": rounded(e.relative_rms), "bias_n": rounded(e.bias_n), "largest_n": rounded(e.largest_n),
             "correlation": rounded(e.correlation)}
            for e in estimate.errors
        ],
        "noise": None if noise is None else _noise_json(noise),
    }  # fmt: skip
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def force_csv(estimate: ForceEstimate) -> str:
    """Return time, references, models, depth and pairs in contact as CSV."""
    columns = {
        "time_s": estimate.motion.time_s,
        **{f"{name} [N]": values for name, values in {**estimate.references_n, **estimate.forces_n}.items()},
        "depth [um]": 1e6 * estimate.depth_m,
        "pairs in contact": estimate.n_pairs,
    }
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([f"{value:.9g}" for value in row] for row in zip(*columns.values(), strict=True))
    return text.getvalue()


def _error_lines(estimate: ForceEstimate) -> list[str]:
    if not estimate.errors:
        return ["Nothing was measured to compare with: neither torque nor force."]
    head = f"{'model':<24} {'against':<14} {'rms N':>10} {'rms %':>8} {'bias N':>10} {'largest N':>11} {'r':>7}"
    rows = [
        f"{e.model:<24} {e.reference:<14} {e.rms_n:>10.1f} {100 * e.relative_rms:>8.1f} {e.bias_n:>10.1f} "
        f"{e.largest_n:>11.1f} {e.correlation:>7.3f}"
        for e in estimate.errors
    ]
    return [head, *rows]


def _noise_lines(noise: NoiseStudy) -> list[str]:
    head = f"{'noise added (µm rms)':<24}" + "".join(f"{level:>9g}" for level in noise.levels_um)
    rows = [f"{model:<24}" + "".join(f"{value:>9.0f}" for value in rms) for model, rms in noise.rms_n.items()]
    return [head, *rows, f"(rms error in N against {noise.reference})", fill(noise.text, WIDTH)]


def _acceleration_line(estimate: ForceEstimate, noise: NoiseStudy) -> list[str]:
    """Noise of the angle is what the study adds; what the acceleration's does follows from the inertia."""
    motion = estimate.motion
    limit = acceleration_limit_rad_s2(noise, motion)
    if limit is None:
        return []
    each = motion.contact.driver_inertia_kg_m2 / motion.path.base_radii_m[0]
    text = (
        f"Noise on the driver's acceleration adds J1/rb1 = {each:.3g} N per rad/s²: the piecewise model is nearer up "
        f"to {limit:.0f} rad/s² rms. Noise on the speeds moves the damping alone."
    )
    return [fill(text, WIDTH)]


def _noise_json(noise: NoiseStudy) -> Json:
    return {
        "reference": noise.reference,
        "levels_um": [rounded(level) for level in noise.levels_um],
        "rms_n": {model: [rounded(v) for v in rms] for model, rms in noise.rms_n.items()},
        "crossover_um": None if noise.crossover_um is None else rounded(noise.crossover_um),
        "text": noise.text,
    }


def _wrapped(text: str, indent: str) -> str:
    return fill(text, WIDTH, initial_indent=indent, subsequent_indent=indent + "  ")


# --------------------
# Fitted parameters as text and as JSON.
#
# The JSON object has these members; names end in their unit, numbers carry nine significant digits, and what is not
# known is null. Members may be added within a version, never renamed or removed.
#
# - ``schema``: "gearsig.identify", ``schema_version``: 1, ``gearsig_version``, ``source``
# - ``parameters``: each with ``name``, ``unit``, ``value``, ``low``, ``high`` (95 %), ``is_told``, ``why_not``,
#   ``rig_value``, ``most_like``
# - ``equations``: each with ``name``, ``text``, ``condition``
# --------------------


IDENTIFY_TEXT_SCHEMA, IDENTIFY_TEXT_SCHEMA_VERSION = "gearsig.identify", 1


def identify_text(found: Identification) -> str:
    """Return the parameters with their intervals, and what cannot be told, in plain text."""
    lines = [f"{found.source or 'recording'}: parameters with 95 % intervals", ""]
    lines += [f"{name} equation: {text}" for name, text in found.equations.items()]
    lines += ["", f"{'parameter':<26} {'value':>11} {'from':>11} {'to':>11} {'rig':>11}  unit"]
    lines += [_row(p) for p in found.parameters if p.is_told]
    untold = [p for p in found.parameters if not p.is_told]
    if untold:
        lines += ["", "Cannot be told from this record"]
        lines += [fill(f"{p.name}: {p.why_not}", WIDTH, initial_indent="  ", subsequent_indent="    ") for p in untold]
    alike = [f"{p.name} moves with {p.most_like}" for p in found.parameters if p.is_told and p.most_like]
    if alike:
        lines += ["", fill(f"Told together rather than each by itself: {'; '.join(alike)}.", WIDTH)]
    return "\n".join(lines)


def identify_json(found: Identification) -> str:
    """Return the same as JSON, see the module's description."""
    data = {
        "schema": IDENTIFY_TEXT_SCHEMA,
        "schema_version": IDENTIFY_TEXT_SCHEMA_VERSION,
        "gearsig_version": __version__,
        "source": found.source,
        "parameters": [
            {"name": p.name, "unit": p.unit, "value": rounded(p.value), "low": rounded(p.interval[0]),
             "high": rounded(p.interval[1]), "is_told": p.is_told, "why_not": p.why_not,
             "rig_value": None if p.rig_value is None else rounded(p.rig_value), "most_like": p.most_like}
            for p in found.parameters
        ],
        "equations": [
            {"name": name, "text": text, "condition": rounded(found.condition.get(name, float("nan")))}
            for name, text in found.equations.items()
        ],
    }  # fmt: skip
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _row(p: FittedParameter) -> str:
    rig = "" if p.rig_value is None else readable(p.rig_value, 5)
    low, high = (readable(v, 5) for v in p.interval)
    unit = unit_text(severity_unit(p.unit))
    return f"{p.name:<26} {readable(p.value, 5):>11} {low:>11} {high:>11} {rig:>11}  {unit}".rstrip()


# --------------------
# Start–stop motion as text and as JSON.
#
# The JSON object has these members; names end in their unit, numbers carry nine significant digits, and what is not
# known is null. Members may be added within a version, never renamed or removed.
#
# - ``schema``: "gearsig.start_stop", ``schema_version``: 1, ``gearsig_version``, ``source``
# - ``stretches``: each with ``direction`` (1, −1, 0 at rest), ``start_s``, ``end_s``, ``turned_rad``, ``top_speed_rpm``
# - ``backlash``: null, or ``backlash_um``, ``uncertainty_um``, ``stiffness_n_per_m_lambda``, ``n_drive``, ``n_back``,
#   ``scatter_um``, ``method``
# - ``impacts``: each with ``time_s``, ``flank``, ``driver_tooth``, ``driven_tooth``, ``driver_angle_deg``,
#   ``speed_mps``, ``energy_j``, ``restitution``, ``lost_j``, ``peak_force_n``, ``note`` (why it has no restitution)
# - ``indicators``: each with ``name``, ``value``, ``unit``, ``computed_on``
# - ``teeth``: per tooth of the driver ``passes_forwards``, ``passes_backwards``, ``rms_forwards``, ``rms_backwards`` of
#   ``signal`` in ``unit``; null where there was nothing to average
# - ``compliance``: null, or per tooth of the driver ``extra_um``, ``uncertainty_um``, ``n_samples``;
#   ``deflection_um`` and ``weak_teeth``
# - ``orders``: of the same signal, forwards: ``order`` and ``amplitude`` (peak) as lists; null where no stretch holds a
#   revolution
# - ``refusals``: what could not be told; ``notes``: what was told in part
# --------------------


START_STOP_TEXT_SCHEMA, START_STOP_TEXT_SCHEMA_VERSION = "gearsig.start_stop", 1
MOST_ROWS = 12
"""Of stretches and impacts on a terminal; the JSON has all."""


def start_stop_text(examined: StartStop) -> str:
    """Return stretches, backlash, the hardest impacts and the indicators, in plain text."""
    lines = [f"{examined.motion.source or 'recording'}: {examined.segments.summary}", ""]
    lines += ["stretch           from s     to s   turned rev   top rpm"]
    for s in examined.segments.segments[:MOST_ROWS]:
        name = {1: "forwards", -1: "backwards", 0: "at rest"}[s.direction]
        lines.append(
            f"{name:<14} {s.start_s:>9.3f} {s.end_s:>8.3f} {s.turned_rad / (2 * np.pi):>12.4f} "
            f"{s.top_speed_rad_s * 30 / np.pi:>9.2f}"
        )
    lines += _more(len(examined.segments.segments))
    if examined.backlash is not None:
        b = examined.backlash
        lines += [
            "",
            fill(
                f"Backlash {b.backlash_um:.4g} ± {b.uncertainty_um:.2g} µm along the line of action: {b.method}.", 100
            ),
        ]
    if examined.teeth is not None:
        weak = ", ".join(map(str, examined.teeth.weak_teeth))
        lines.append(f"Teeth of the driver that yield more than the others: {weak or 'none'}.")
    if examined.impacts:
        lines += ["", f"{len(examined.impacts)} impacts, the hardest:"]
        lines += ["   time s  flank  tooth    speed m/s   energy J  restitution   force N"]
        hardest = sorted(examined.impacts, key=lambda i: -i.speed_mps)[:MOST_ROWS]
        lines += [_impact_row(impact) for impact in sorted(hardest, key=lambda i: i.time_s)]
        lines += _more(len(examined.impacts))
    lines += [
        "",
        *(
            f"{i.name:<24} {readable(i.value, 5):>12} {unit_text(severity_unit(i.unit))}".rstrip()
            for i in examined.indicators
        ),
    ]
    lines += [fill(f"Cannot tell: {text}", 100) for text in examined.refusals]
    lines += [fill(f"Note: {text}", 100) for text in examined.notes]
    return "\n".join(lines)


def start_stop_json(
    examined: StartStop,
    profile: AngleProfile | None = None,
    signal: str = "",
    unit: str = "",
    orders: Spectrum | None = None,
) -> str:
    """Return the same as JSON, see the module's description."""
    backlash = None
    if examined.backlash is not None:
        backlash = {k: _number(v) for k, v in asdict(examined.backlash).items() if k != "datum_m"}
    data: Json = {
        "schema": START_STOP_TEXT_SCHEMA,
        "schema_version": START_STOP_TEXT_SCHEMA_VERSION,
        "gearsig_version": __version__,
        "source": examined.motion.source,
        "stretches": [
            {"direction": s.direction, "start_s": rounded(s.start_s), "end_s": rounded(s.end_s),
             "turned_rad": rounded(s.turned_rad), "top_speed_rpm": rounded(s.top_speed_rad_s * 30 / np.pi)}
            for s in examined.segments.segments
        ],
        "backlash": backlash,
        "impacts": [{k: _number(v) for k, v in asdict(impact).items()} for impact in examined.impacts],
        "indicators": [
            {"name": i.name, "value": rounded(i.value), "unit": i.unit, "computed_on": i.computed_on}
            for i in examined.indicators
        ],
        "teeth": None if profile is None else _teeth(profile, signal, unit),
        "compliance": _compliance(examined),
        "orders": None if orders is None else _orders(orders),
        "refusals": list(examined.refusals),
        "notes": list(examined.notes),
    }  # fmt: skip
    return json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def _teeth(profile: AngleProfile, signal: str, unit: str) -> Json:
    return {
        "signal": signal,
        "unit": unit,
        "passes_forwards": profile.passes_forwards.tolist(),
        "passes_backwards": profile.passes_backwards.tolist(),
        "rms_forwards": [rounded(v) for v in profile.rms_forwards],
        "rms_backwards": [rounded(v) for v in profile.rms_backwards],
    }


def _compliance(examined: StartStop) -> Json | None:
    found = examined.teeth
    if found is None:
        return None
    return {
        "extra_um": [rounded(v) for v in found.extra_um],
        "uncertainty_um": [rounded(v) for v in found.uncertainty_um],
        "n_samples": found.n_samples.tolist(),
        "deflection_um": rounded(found.deflection_um),
        "weak_teeth": list(found.weak_teeth),
    }


def _orders(orders: Spectrum) -> Json:
    return {"order": [rounded(v) for v in orders.positions], "amplitude": [rounded(v) for v in orders.values]}


def _impact_row(i: Impact) -> str:
    flank = "drive" if i.flank > 0 else "back"
    return (
        f"{i.time_s:>9.4f}  {flank:<5}  {i.driver_tooth:>5} {i.speed_mps:>12.4f} {readable(i.energy_j, 3):>10} "
        f"{readable(i.restitution, 3):>12} {i.peak_force_n:>9.0f}"
    )


def _more(n: int) -> list[str]:
    return [f"… {n - MOST_ROWS} more"] if n > MOST_ROWS else []


def _number(value: float | int | str) -> float | int | str | None:
    return rounded(value) if isinstance(value, float) else value
