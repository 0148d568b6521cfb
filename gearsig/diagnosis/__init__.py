"""From signals and indicators to findings in words and numbers."""

from gearsig.diagnosis._analyze import analyze
from gearsig.diagnosis._bearing import smallest_depth
from gearsig.diagnosis._bearing_families import slower_train, stands_out_from_neighbours
from gearsig.diagnosis._crack import crack_depth, with_crack
from gearsig.diagnosis._lines import (
    LineExcess,
    best_comb,
    comb_at,
    level_beside,
    levels_beside,
    line_excess,
    score_needed,
    tail_probability,
)
from gearsig.diagnosis._modulation import Modulation, modulation_of
from gearsig.diagnosis._reference import (
    Earlier,
    IndicatorChange,
    beside_reference,
    changes,
    in_reference,
    rig_of_reference,
)
from gearsig.diagnosis._resonance import detect_resonances
from gearsig.diagnosis._signals import BandEnvelope, floor_of
from gearsig.diagnosis._speed import determine_angle, exact_angle
from gearsig.diagnosis._tooth import localise
from gearsig.diagnosis._types import (
    Analysis,
    AnalysisSettings,
    CannotTell,
    ChannelAnalysis,
    Finding,
    Kind,
    OrderLevel,
    Outcome,
    Strength,
    Where,
    from_p_value,
    outcome_of,
)
from gearsig.diagnosis._verdict import ranked, verdict_of

__all__ = [
    "Analysis",
    "AnalysisSettings",
    "BandEnvelope",
    "CannotTell",
    "ChannelAnalysis",
    "Earlier",
    "Finding",
    "IndicatorChange",
    "Kind",
    "LineExcess",
    "Modulation",
    "OrderLevel",
    "Outcome",
    "Strength",
    "Where",
    "analyze",
    "beside_reference",
    "best_comb",
    "changes",
    "comb_at",
    "crack_depth",
    "detect_resonances",
    "determine_angle",
    "exact_angle",
    "floor_of",
    "from_p_value",
    "in_reference",
    "level_beside",
    "levels_beside",
    "line_excess",
    "localise",
    "modulation_of",
    "outcome_of",
    "ranked",
    "rig_of_reference",
    "score_needed",
    "slower_train",
    "smallest_depth",
    "stands_out_from_neighbours",
    "tail_probability",
    "verdict_of",
    "with_crack",
]
