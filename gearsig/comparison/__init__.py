"""A simulation compared with a recording: aligned in angle, by order, band and angle. Identifies no cause."""

from gearsig.comparison._compare import ALIGN, compare
from gearsig.comparison._lines import (
    HalvedLines,
    band_powers,
    frac,
    order_band_limits,
    third_octave_limits,
    third_octaves,
    tooth_powers,
    waveform,
)
from gearsig.comparison._sides import SIMULATION_OPTIONS, for_simulation
from gearsig.comparison._types import (
    BEYOND,
    Agreement,
    BandLevel,
    ChannelComparison,
    Comparison,
    LevelPair,
    LineLevel,
    RecordFacts,
    RepeatableValue,
    ShaftComparison,
    power_levels,
)
from gearsig.comparison._verdict import (
    MIN_REPEATED,
    STEADY,
    differing_lines,
    differing_tooth,
    mesh_lines,
    missing_line_text,
)

__all__ = [
    "ALIGN",
    "BEYOND",
    "MIN_REPEATED",
    "SIMULATION_OPTIONS",
    "STEADY",
    "Agreement",
    "BandLevel",
    "ChannelComparison",
    "Comparison",
    "HalvedLines",
    "LevelPair",
    "LineLevel",
    "RecordFacts",
    "RepeatableValue",
    "ShaftComparison",
    "band_powers",
    "compare",
    "differing_lines",
    "differing_tooth",
    "for_simulation",
    "frac",
    "mesh_lines",
    "missing_line_text",
    "order_band_limits",
    "power_levels",
    "third_octave_limits",
    "third_octaves",
    "tooth_powers",
    "waveform",
]
