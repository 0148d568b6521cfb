"""From signals and indicators to findings in words and numbers.

`analyze` diagnoses a recording, `analyze_file` a file that may be larger than memory. Both return an `Analysis`: a
`verdict`, `findings` with location (`Where`), `Strength` and confidence, indicators, and the changes since a reference
(`LevelChange`).
"""

from gearsig.diagnosis._analyze import analyze, only_channel_assumed, with_known_angle, with_matching_channel_names
from gearsig.diagnosis._bearing import smallest_depth
from gearsig.diagnosis._bearing_families import (
    BEARING_PARTS,
    SAME_BEARING_ORDER,
    stands_out_from_neighbours,
    underlying_impulse_train,
)
from gearsig.diagnosis._blocks import RecordBlocks, record_blocks
from gearsig.diagnosis._crack import crack_depth, with_crack
from gearsig.diagnosis._long import (
    MEMORY_BYTES,
    AnalysedPart,
    LongAnalysis,
    LongOverview,
    analyze_file,
    long_overview,
    read_reference,
    read_typical_part,
    read_whole,
)
from gearsig.diagnosis._modulation import Modulation, modulation_of
from gearsig.diagnosis._reference import (
    REFERENCE_OPTIONS,
    IndicatorChange,
    ReferenceFinding,
    beside_reference,
    changes,
    in_reference,
    rig_and_rate_of_reference,
)
from gearsig.diagnosis._resonance import detect_resonances
from gearsig.diagnosis._signals import BandEnvelope
from gearsig.diagnosis._tooth import localise
from gearsig.diagnosis._types import (
    CHANGED,
    VIBRATION_ZONE,
    Analysis,
    AnalysisSettings,
    CannotTell,
    ChannelAnalysis,
    Finding,
    Kind,
    LevelChange,
    OrderLevel,
    Outcome,
    Strength,
    Where,
    from_p_value,
    outcome_of,
)
from gearsig.diagnosis._verdict import SURER_WITH, WHAT_WOULD_HELP, ranked, verdict_of

__all__ = [
    "BEARING_PARTS",
    "CHANGED",
    "MEMORY_BYTES",
    "REFERENCE_OPTIONS",
    "SAME_BEARING_ORDER",
    "SURER_WITH",
    "VIBRATION_ZONE",
    "WHAT_WOULD_HELP",
    "AnalysedPart",
    "Analysis",
    "AnalysisSettings",
    "BandEnvelope",
    "CannotTell",
    "ChannelAnalysis",
    "Finding",
    "IndicatorChange",
    "Kind",
    "LevelChange",
    "LongAnalysis",
    "LongOverview",
    "Modulation",
    "OrderLevel",
    "Outcome",
    "RecordBlocks",
    "ReferenceFinding",
    "Strength",
    "Where",
    "analyze",
    "analyze_file",
    "beside_reference",
    "changes",
    "crack_depth",
    "detect_resonances",
    "from_p_value",
    "in_reference",
    "localise",
    "long_overview",
    "modulation_of",
    "only_channel_assumed",
    "outcome_of",
    "ranked",
    "read_reference",
    "read_typical_part",
    "read_whole",
    "record_blocks",
    "rig_and_rate_of_reference",
    "smallest_depth",
    "stands_out_from_neighbours",
    "underlying_impulse_train",
    "verdict_of",
    "with_crack",
    "with_known_angle",
    "with_matching_channel_names",
]
