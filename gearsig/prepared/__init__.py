"""Prepared recordings: angle, resampled channels, averages and lines, each computed once per recording, on demand.

>>> from gearsig.prepared import PreparedRecording
>>> from gearsig import analyze, estimate_crack, read_recording  # doctest: +SKIP
>>> now, healthy = (PreparedRecording(read_recording(name)) for name in ("now.h5", "healthy.h5"))  # doctest: +SKIP
>>> analyze(now, reference=healthy), estimate_crack(now, reference=healthy)  # doctest: +SKIP
"""

from gearsig.prepared._angle import (
    MAINS_TOLERANCE,
    STATED_SPEED_TOLERANCE,
    envelope_bands,
    magnetic_pull_near,
    refined_angle,
)
from gearsig.prepared._lines import (
    INNER_LINES,
    LOG_RATIO_LIMIT,
    RUN_UP_FOOT_ORDERS,
    Comb,
    LinesOverFloor,
    best_comb,
    best_shift,
    chance_of_any,
    circular_correlation,
    comb_at,
    lines_over_floor,
    lines_over_noise_floor,
    neighbour_level,
    neighbour_levels,
    over_floor_db,
    peak_position,
    score_needed,
    shift_scores,
    sliding_mean,
    strongest_window,
    tail_probability,
    turned_lines,
)
from gearsig.prepared._recording import MEMORY_LIMIT_MB, PreparedRecording, has_mark, prepare

__all__ = [
    "INNER_LINES",
    "LOG_RATIO_LIMIT",
    "MAINS_TOLERANCE",
    "MEMORY_LIMIT_MB",
    "RUN_UP_FOOT_ORDERS",
    "STATED_SPEED_TOLERANCE",
    "Comb",
    "LinesOverFloor",
    "PreparedRecording",
    "best_comb",
    "best_shift",
    "chance_of_any",
    "circular_correlation",
    "comb_at",
    "envelope_bands",
    "has_mark",
    "lines_over_floor",
    "lines_over_noise_floor",
    "magnetic_pull_near",
    "neighbour_level",
    "neighbour_levels",
    "over_floor_db",
    "peak_position",
    "prepare",
    "refined_angle",
    "score_needed",
    "shift_scores",
    "sliding_mean",
    "strongest_window",
    "tail_probability",
    "turned_lines",
]
