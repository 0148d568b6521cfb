"""A comparison as JSON, in a schema that stays.

The object has these members; names end in their unit, numbers carry nine significant digits, and what is not known or
not defined is null. Members may be added within a version, never renamed or removed. Levels are in dB re one unit, rms;
every ``difference_db`` is simulated less recorded; every ``repeatability`` is a standard error from the halves of the
records.

- ``schema``: "gearsig.comparison", ``schema_version``: 1, ``gearsig_version``
- ``verdict``: one sentence per channel; ``findings``: more of them; ``notes``: what to know before believing a figure
- ``simulated``, ``recorded``: ``source``, ``sha256``, ``duration_s``, ``sampling_rate_hz``, ``mean_speed_rpm``,
  ``speed_range_rpm``, ``n_revolutions``, ``speed_method``, ``notes``
- ``machine``, ``reference_shaft``, ``mesh_orders``, ``highest_order``
- ``alignments``: per shaft ``shaft``, ``method`` ("marks" or "correlation"), ``shift_deg``, ``repeatability_deg``,
  ``tooth_is_certain``, ``best_shift_deg``, ``gain``
- ``channels``: each with ``simulated_name``, ``recorded_name``, ``quantity``, ``unit``, ``levels_compare``;
  ``overall``, a level; ``locked``: shares of energy that turn with the shafts, ``simulated`` and ``recorded``;
  ``lines`` and ``other_lines``: ``label``, ``kind``, ``order``, ``shaft``, ``simulated_is_seen``, ``recorded_is_seen``
  and a level; ``order_bands`` and ``third_octaves``: ``label``, ``low``, ``high``, ``axis``, a level, ``agreement`` (or
  null); ``shafts``: ``shaft``, ``n_teeth``, ``correlation``, ``simulated_reliability``, ``recorded_reliability``,
  ``agreement``, ``tooth_levels``
- a level: ``simulated_db``, ``recorded_db``, ``difference_db``, ``repeatability_db``, ``is_beyond``
- an agreement: ``complex_frac`` and ``magnitude_frac`` with ``value`` and ``repeatability``, ``complex_by_chance``,
  ``n_lines``
"""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import Any

from gearsig import __version__
from gearsig.compare.types import (
    Agreement,
    BandLevel,
    ChannelComparison,
    Comparison,
    LevelPair,
    LineLevel,
    Repeated,
    ShaftComparison,
)
from gearsig.report.numbers import rounded

SCHEMA, SCHEMA_VERSION = "gearsig.comparison", 1
Json = dict[str, Any]


def comparison_to_json(comparison: Comparison) -> str:
    """Return a comparison as JSON text."""
    return json.dumps(comparison_to_dict(comparison), indent=2, ensure_ascii=False, allow_nan=False)


def comparison_to_dict(comparison: Comparison) -> Json:
    """Return a comparison as plain dictionaries, see the module's description. Waveforms and spectra are left out."""
    return {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "gearsig_version": __version__,
        "verdict": comparison.verdict,
        "findings": list(comparison.findings),
        "notes": list(comparison.notes),
        "simulated": _plain(asdict(comparison.simulated)),
        "recorded": _plain(asdict(comparison.recorded)),
        "machine": comparison.machine,
        "reference_shaft": comparison.reference_shaft,
        "mesh_orders": _plain(comparison.mesh_orders),
        "highest_order": rounded(comparison.highest_order),
        "alignments": [_plain(asdict(alignment)) for alignment in comparison.alignments],
        "channels": [_channel(channel) for channel in comparison.channels],
    }


def _channel(channel: ChannelComparison) -> Json:
    return {
        "simulated_name": channel.simulated_name,
        "recorded_name": channel.recorded_name,
        "quantity": channel.quantity,
        "unit": channel.unit,
        "levels_compare": channel.levels_compare,
        "overall": _level(channel.overall),
        "locked": {side: _repeated(getattr(channel.locked, side)) for side in ("simulated", "recorded")},
        "lines": [_line(line) for line in channel.lines],
        "other_lines": [_line(line) for line in channel.other_lines],
        "order_bands": [_band(band) for band in channel.order_bands],
        "third_octaves": [_band(band) for band in channel.third_octaves],
        "shafts": [_shaft(shaft) for shaft in channel.shafts],
    }


def _level(level: LevelPair) -> Json:
    return {
        "simulated_db": rounded(level.simulated_db),
        "recorded_db": rounded(level.recorded_db),
        "difference_db": rounded(level.difference_db),
        "repeatability_db": rounded(level.repeatability_db),
        "is_beyond": level.is_beyond,
    }


def _line(line: LineLevel) -> Json:
    return {
        "label": line.label,
        "kind": line.kind,
        "order": rounded(line.order),
        "shaft": line.shaft,
        "simulated_is_seen": line.simulated_is_seen,
        "recorded_is_seen": line.recorded_is_seen,
    } | _level(line.level)


def _band(band: BandLevel) -> Json:
    place: Json = {"label": band.label, "low": rounded(band.low), "high": rounded(band.high), "axis": band.axis}
    return place | _level(band.level) | {"agreement": _agreement(band.agreement) if band.agreement else None}


def _shaft(shaft: ShaftComparison) -> Json:
    return {
        "shaft": shaft.shaft,
        "n_teeth": shaft.n_teeth,
        "correlation": _repeated(shaft.correlation),
        "simulated_reliability": rounded(shaft.simulated_reliability),
        "recorded_reliability": rounded(shaft.recorded_reliability),
        "agreement": _agreement(shaft.agreement),
        "tooth_levels": [_level(level) for level in shaft.tooth_levels],
    }


def _agreement(agreement: Agreement) -> Json:
    return {
        "complex_frac": _repeated(agreement.complex_frac),
        "magnitude_frac": _repeated(agreement.magnitude_frac),
        "complex_by_chance": rounded(agreement.complex_by_chance),
        "n_lines": agreement.n_lines,
    }


def _repeated(figure: Repeated) -> Json:
    return {"value": rounded(figure.value), "repeatability": rounded(figure.repeatability)}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, tuple):
        return [_plain(item) for item in value]
    return rounded(value) if isinstance(value, float) else value
