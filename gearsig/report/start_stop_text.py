"""Start–stop motion as text and as JSON.

The JSON object has these members; names end in their unit, numbers carry nine significant digits, and what is not known
is null. Members may be added within a version, never renamed or removed.

- ``schema``: "gearsig.start_stop", ``schema_version``: 1, ``gearsig_version``, ``source``
- ``stretches``: each with ``direction`` (1, −1, 0 at rest), ``start_s``, ``end_s``, ``turned_rad``, ``top_speed_rpm``
- ``backlash``: null, or ``backlash_um``, ``uncertainty_um``, ``stiffness_n_per_m_lambda``, ``n_drive``, ``n_back``,
  ``scatter_um``, ``method``
- ``impacts``: each with ``time_s``, ``flank``, ``driver_tooth``, ``driven_tooth``, ``driver_angle_deg``, ``speed_mps``,
  ``energy_j``, ``restitution``, ``lost_j``, ``peak_force_n``, ``note`` (why it has no restitution)
- ``indicators``: each with ``name``, ``value``, ``unit``, ``computed_on``
- ``teeth``: per tooth of the driver ``passes_forwards``, ``passes_backwards``, ``rms_forwards``, ``rms_backwards`` of
  ``signal`` in ``unit``; null where there was nothing to average
- ``compliance``: null, or per tooth of the driver ``extra_um``, ``uncertainty_um``, ``n_samples``;
  ``deflection_um`` and ``weak_teeth``
- ``orders``: of the same signal, forwards: ``order`` and ``amplitude`` (peak) as lists; null where no stretch holds a
  revolution
- ``refusals``: what could not be told; ``notes``: what was told in part
"""

from __future__ import annotations

import json
from dataclasses import asdict
from textwrap import fill
from typing import Any

import numpy as np

from gearsig import __version__
from gearsig.formatting import readable, rounded
from gearsig.gap.words import severity_unit
from gearsig.motion.angle_profile import AngleProfile
from gearsig.motion.impacts import Impact
from gearsig.motion.start_stop import StartStop
from gearsig.plot.display import unit_text
from gearsig.spectra.types import Spectrum

SCHEMA, SCHEMA_VERSION = "gearsig.start_stop", 1
MOST_ROWS = 12
"""Of stretches and impacts on a terminal; the JSON has all."""
Json = dict[str, Any]


def start_stop_text(examined: StartStop) -> str:
    """Return stretches, backlash, the hardest impacts and the indicators, in plain text."""
    lines = [f"{examined.motion.source or 'recording'}: {examined.course.summary}", ""]
    lines += ["stretch           from s     to s   turned rev   top rpm"]
    for s in examined.course.stretches[:MOST_ROWS]:
        name = {1: "forwards", -1: "backwards", 0: "at rest"}[s.direction]
        lines.append(
            f"{name:<14} {s.start_s:>9.3f} {s.end_s:>8.3f} {s.turned_rad / (2 * np.pi):>12.4f} "
            f"{s.top_speed_rad_s * 30 / np.pi:>9.2f}"
        )
    lines += _more(len(examined.course.stretches))
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
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "gearsig_version": __version__,
        "source": examined.motion.source,
        "stretches": [
            {"direction": s.direction, "start_s": rounded(s.start_s), "end_s": rounded(s.end_s),
             "turned_rad": rounded(s.turned_rad), "top_speed_rpm": rounded(s.top_speed_rad_s * 30 / np.pi)}
            for s in examined.course.stretches
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
