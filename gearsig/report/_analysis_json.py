"""An analysis as JSON, in a schema that stays.

The object has these members; names end in their unit, numbers carry nine significant digits, and what is not known or
not defined is null. Members may be added within a version, never renamed or removed.

- ``schema``: "gearsig.analysis", ``schema_version``: 1, ``gearsig_version``
- ``outcome``: "fault", "suspicion", "cannot tell" or "no fault"
- ``verdict``: one sentence
- ``findings``: most important first; each with ``code``, ``kind`` ("fault", "suspicion", "data problem", "cannot tell",
  "notice", "information"), ``title``, ``where``, ``strength`` (or null), ``confidence``, ``confidence_basis``,
  ``evidence``, ``surer``
- ``speed``: ``known``; if true ``shaft``, ``method``, ``mean_rpm``, ``lowest_rpm``, ``highest_rpm``,
  ``relative_uncertainty``, ``quality``, ``n_revolutions``, ``notes``; if false ``question``, ``reason``, ``remedy``
- ``indicators``: each with ``name``, ``value``, ``unit``, ``channel``, ``computed_on``, ``shaft``, ``gear``,
  ``band``, ``note``; ``reference_value`` and ``change_db``, null where there is no reference or it lacks the indicator
- ``recording``: ``source``, ``sha256``, ``reader``, ``history``, ``warnings``, ``sampling_rate_hz``, ``n_samples``,
  ``duration_s``, ``channels``, ``speed_source``
- ``rig``: what is known of the machine, or null
- ``channels``: per analysed channel the description of its spectra and averages; arrays as their
  ``{"shape": […]}``, or as lists where they were asked for; ``order_levels`` always with their
  numbers, and ``largest``, ``largest_at_rpm``, ``largest_at_hz``
- ``settings``: the parameters that were in force
- ``crack``: null where nobody asked and none is clear; else ``answer`` ("crack", "none seen", "cannot tell") with
  ``text``, ``shaft``, ``gear``, ``tooth``, ``angle_deg``, ``depth_mm``, ``interval_mm`` and the like; with
  ``below_mm``; or with ``reason`` and ``remedy``
- ``reference``: null, or ``source``, ``sha256``, ``outcome``, ``verdict`` of the recording that was compared with
- ``level_changes``: against it, levels of lines, sidebands, bearing parts and noise by channel: ``label``, ``kind``,
  ``where``, ``harmonic``, ``unit``, ``level_db`` and ``reference_db`` (rms, dB re one unit), ``change_db``,
  ``repeatability_db`` (half against half), ``p_value``, ``is_change``, ``stands_out``; empty without a reference
"""

from __future__ import annotations

import json
from pathlib import Path

from gearsig.angle import ShaftAngle
from gearsig.cache import write_text
from gearsig.diagnosis import Analysis, CannotTell, ChannelAnalysis, LongAnalysis, changes
from gearsig.formatting import rounded
from gearsig.recording import Recording
from gearsig.report._json import Json, head, plain
from gearsig.rig import SpeedSource
from gearsig.severity import CrackEstimate, NoCrackSeen


def analysis_to_dict(analysis: Analysis, *, arrays: bool = False) -> Json:
    """Return an analysis as plain dictionaries, lists, texts and numbers, see the module's description.

    Parameters
    ----------
    analysis : Analysis
    arrays : bool
        Whether spectra, maps and averages come with their numbers; a long recording then makes a large object.

    Returns
    -------
    dict
        `json.dumps(..., allow_nan=False)` takes it.
    """
    return head("gearsig.analysis") | {
        "outcome": analysis.outcome.value,
        "verdict": analysis.verdict,
        "findings": [plain(finding, arrays=False) for finding in analysis.findings],
        "speed": _speed(analysis.shaft_angle, arrays=arrays),
        "indicators": _indicators(analysis),
        "recording": _recording(analysis.recording),
        "rig": plain(analysis.rig, arrays=False),
        "channels": [_channel(channel, arrays=arrays) for channel in analysis.channels],
        "settings": plain(analysis.settings, arrays=False),
        "crack": _crack(analysis.crack),
        "reference": _reference(analysis.reference),
        "level_changes": [plain(c, arrays=False) | {"change_db": rounded(c.change_db)} for c in analysis.level_changes],
    }


def analysis_to_json(analysis: Analysis, *, arrays: bool = False) -> str:
    """Return an analysis as JSON text, see `analysis_to_dict`."""
    indent = None if arrays else 2
    return json.dumps(analysis_to_dict(analysis, arrays=arrays), indent=indent, ensure_ascii=False, allow_nan=False)


def write_json(analysis: Analysis, path: str | Path, *, arrays: bool = False) -> Path:
    """Write an analysis as JSON; the file appears only when it is complete."""
    return write_text(Path(path), analysis_to_json(analysis, arrays=arrays) + "\n")


def _recording(recording: Recording) -> Json:
    origin = recording.provenance
    return {
        "source": origin.source,
        "sha256": origin.sha256,
        "reader": origin.reader,
        "history": list(origin.history),
        "warnings": list(recording.warnings),
        "sampling_rate_hz": recording.sampling_rate_hz,
        "n_samples": recording.n_samples,
        "duration_s": rounded(recording.duration_s),
        "channels": [plain(channel, arrays=False) for channel in recording.channels],
        "speed_source": _speed_source(recording.speed_source),
    }


def _speed_source(source: SpeedSource | None) -> Json | None:
    return None if source is None else {"kind": type(source).__name__, **plain(source, arrays=False)}


def _speed(angle: ShaftAngle | CannotTell, *, arrays: bool) -> Json:
    if isinstance(angle, CannotTell):
        return {"known": False, **plain(angle, arrays=False)}
    lowest, highest = angle.speed_range_rpm
    result = {
        "known": True,
        "shaft": angle.shaft,
        "method": angle.method,
        "mean_rpm": rounded(angle.mean_speed_rpm),
        "lowest_rpm": rounded(lowest),
        "highest_rpm": rounded(highest),
        "relative_uncertainty": rounded(angle.relative_speed_uncertainty),
        "quality": rounded(angle.quality),
        "n_revolutions": rounded(angle.n_revolutions),
        "notes": list(angle.notes),
    }
    if arrays:
        result |= {name: plain(getattr(angle, name), arrays=True) for name in ("time_s", "revolutions")}
    return result


def _indicators(analysis: Analysis) -> list[Json]:
    nothing: Json = {"reference_value": None, "change_db": None}
    return [
        plain(indicator, arrays=False) | (nothing if change is None else plain(change, arrays=False))
        for indicator, change in zip(analysis.indicators, changes(analysis), strict=True)
    ]


def _crack(answer: CrackEstimate | NoCrackSeen | CannotTell | None) -> Json | None:
    if answer is None:
        return None
    if isinstance(answer, CannotTell):
        return {"answer": "cannot tell", **plain(answer, arrays=False)}
    kind, told = "crack" if isinstance(answer, CrackEstimate) else "none seen", plain(answer, arrays=False)
    told.pop("searched", None)  # of the figure
    return {"answer": kind, "text": answer.text, **told}


def _reference(reference: Analysis | None) -> Json | None:
    if reference is None:
        return None
    origin = reference.recording.provenance
    return {
        "source": origin.source,
        "sha256": origin.sha256,
        "outcome": reference.outcome.value,
        "verdict": reference.verdict,
    }


def _channel(channel: ChannelAnalysis, *, arrays: bool) -> Json:
    result: Json = plain(channel, arrays=arrays)
    result["averages"] = [plain(average, arrays=arrays) for average in channel.averages.values()]
    result["order_levels"] = [
        plain(level, arrays=True)
        | dict(zip(("largest", "largest_at_rpm", "largest_at_hz"), map(rounded, level.largest), strict=True))
        for level in channel.order_levels
    ]
    return result


def long_analysis_to_json(analysis: LongAnalysis) -> str:
    """Return a long analysis as JSON text; each part as `analysis_to_dict` gives it."""
    overview = analysis.overview
    levels: Json = {
        name: plain(getattr(overview, name), arrays=True)
        for name in ("channel_names", "units", "time_s", "rms", "peak", "crest_factor", "kurtosis")
    }
    parts = [
        {"start_s": p.start_s, "end_s": p.end_s, "reason": p.reason, "analysis": analysis_to_dict(p.analysis)}
        for p in analysis.parts
    ]
    content = {
        "outcome": analysis.outcome.value,
        "verdict": analysis.verdict,
        "duration_s": analysis.duration_s,
        "overview": levels,
        "parts": parts,
    }
    return json.dumps(content, ensure_ascii=False, allow_nan=False)
