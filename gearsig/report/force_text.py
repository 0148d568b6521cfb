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
from io import StringIO
from textwrap import fill
from typing import Any

from gearsig import __version__
from gearsig.formatting import rounded
from gearsig.motion.noise_study import NoiseStudy, acceleration_limit_rad_s2
from gearsig.motion.types import ForceEstimate

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
