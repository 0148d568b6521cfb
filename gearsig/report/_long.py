"""A record longer than memory, in words and as JSON."""

from __future__ import annotations

import json

import numpy as np

from gearsig.diagnosis import LongAnalysis
from gearsig.report._analysis_json import analysis_to_dict
from gearsig.report._json import Json, plain
from gearsig.report._sections import analysis_text


def long_analysis_text(analysis: LongAnalysis, *, with_indicators: bool = False) -> str:
    """Return the verdict, the levels over time, and what each part shows."""
    overview = analysis.overview
    lines = [analysis.verdict, "", f"{analysis.name}: {analysis.duration_s:.5g} s, in intervals of a second:"]
    for i, (name, unit) in enumerate(zip(overview.channel_names, overview.units, strict=True)):
        low, usual, high = np.percentile(overview.rms[i], (0, 50, 100))
        last = int(np.argmax(overview.rms[i]))
        lines.append(
            f"  {name}: rms {low:.4g} to {high:.4g} {unit}, usually {usual:.4g}; "
            f"highest at {overview.time_s[last]:.4g} s; kurtosis "
            f"{overview.kurtosis[i].min():.3g} to {overview.kurtosis[i].max():.3g}"
        )
    for part in analysis.parts:
        lines += ["", f"From {part.start_s:.5g} to {part.end_s:.5g} s, {part.reason}:", ""]
        lines.append(analysis_text(part.analysis, with_indicators=with_indicators))
    return "\n".join(lines)


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
