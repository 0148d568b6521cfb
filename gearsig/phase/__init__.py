"""Motion in phase space: portraits, Poincaré sections, embedding, Lyapunov exponents."""

from gearsig.phase._embedding import (
    EmbeddingDimension,
    MutualInformation,
    average_mutual_information,
    delay_embedding,
    delay_vectors,
    embedding_dimension,
)
from gearsig.phase._kind import (
    ChaosTest,
    MotionKind,
    kind_of_motion,
    mean_square_displacement,
    translation_walk,
    zero_one_test,
    zero_one_test_of_section,
)
from gearsig.phase._lyapunov import LyapunovExponent, largest_lyapunov_exponent
from gearsig.phase._neighbours import evenly_spaced_indices, nearest_beyond_theiler_window
from gearsig.phase._plane import MotionQuantity, PhasePortrait, lowest_low_cut_hz, phase_plane
from gearsig.phase._recurrence import RecurrenceMeasures, RecurrencePlot, recurrence_measures, recurrence_plot
from gearsig.phase._section import (
    BifurcationDiagram,
    CycleLock,
    PoincareSection,
    TwoMotions,
    bifurcation_diagram,
    coexistence_ranges,
    coexistence_values,
    constant_period_lock,
    find_lock,
    poincare_section,
    points_between,
    section_period,
    step_of,
)

__all__ = [
    "BifurcationDiagram",
    "ChaosTest",
    "CycleLock",
    "EmbeddingDimension",
    "LyapunovExponent",
    "MotionKind",
    "MotionQuantity",
    "MutualInformation",
    "PhasePortrait",
    "PoincareSection",
    "RecurrenceMeasures",
    "RecurrencePlot",
    "TwoMotions",
    "average_mutual_information",
    "bifurcation_diagram",
    "coexistence_ranges",
    "coexistence_values",
    "constant_period_lock",
    "delay_embedding",
    "delay_vectors",
    "embedding_dimension",
    "evenly_spaced_indices",
    "find_lock",
    "kind_of_motion",
    "largest_lyapunov_exponent",
    "lowest_low_cut_hz",
    "mean_square_displacement",
    "nearest_beyond_theiler_window",
    "phase_plane",
    "poincare_section",
    "points_between",
    "recurrence_measures",
    "recurrence_plot",
    "section_period",
    "step_of",
    "translation_walk",
    "zero_one_test",
    "zero_one_test_of_section",
]
