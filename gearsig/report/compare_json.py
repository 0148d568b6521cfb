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

from gearsig import __version__
from gearsig.compare.types import (
    BandLevel,
    ChannelComparison,
    Comparison,
    LevelPair,
    LineLevel,
    ShaftComparison,
)
from gearsig.report.plain import Json, members, plain

SCHEMA, SCHEMA_VERSION = "gearsig.comparison", 1


def comparison_to_json(comparison: Comparison) -> str:
    """Return a comparison as JSON text."""
    return json.dumps(comparison_to_dict(comparison), indent=2, ensure_ascii=False, allow_nan=False)


def comparison_to_dict(comparison: Comparison) -> Json:
    """Return a comparison as plain dictionaries, see the module's description. Waveforms and spectra are left out."""
    return {
        "schema": SCHEMA,
        "schema_version": SCHEMA_VERSION,
        "gearsig_version": __version__,
        **members(comparison, "verdict", "findings", "notes"),
        **members(comparison, "simulated", "recorded", "machine", "reference_shaft", "mesh_orders", "highest_order"),
        "alignments": plain(comparison.alignments),
        "channels": [_channel(channel) for channel in comparison.channels],
    }


def _channel(channel: ChannelComparison) -> Json:
    return {
        **members(channel, "simulated_name", "recorded_name", "quantity", "unit", "levels_compare"),
        "overall": _level(channel.overall),
        "locked": members(channel.locked, "simulated", "recorded"),
        "lines": [_line(line) for line in channel.lines],
        "other_lines": [_line(line) for line in channel.other_lines],
        "order_bands": [_band(band) for band in channel.order_bands],
        "third_octaves": [_band(band) for band in channel.third_octaves],
        "shafts": [_shaft(shaft) for shaft in channel.shafts],
    }


def _line(line: LineLevel) -> Json:
    names = ("label", "kind", "order", "shaft", "simulated_is_seen", "recorded_is_seen")
    return members(line, *names) | _level(line.level)


def _band(band: BandLevel) -> Json:
    return members(band, "label", "low", "high", "axis") | _level(band.level) | members(band, "agreement")


def _shaft(shaft: ShaftComparison) -> Json:
    names = ("shaft", "n_teeth", "correlation", "simulated_reliability", "recorded_reliability", "agreement")
    return members(shaft, *names) | {"tooth_levels": [_level(level) for level in shaft.tooth_levels]}


def _level(level: LevelPair) -> Json:
    return members(level, "simulated_db", "recorded_db", "difference_db", "repeatability_db", "is_beyond")
