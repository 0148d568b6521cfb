"""Vold–Kalman order tracking: orders taken out of a recording as waveforms, exact and by a coarse grid."""

from gearsig.orders.vold_kalman._filter import Method, separated
from gearsig.orders.vold_kalman._grouping import Coupling
from gearsig.orders.vold_kalman._tracks import (
    FrequencyTrack,
    Generation,
    OrderLike,
    OrderSeparation,
    bandwidths_of,
    tracks_of_orders,
    tracks_over_angle,
)

__all__ = [
    "Coupling",
    "FrequencyTrack",
    "Generation",
    "Method",
    "OrderLike",
    "OrderSeparation",
    "bandwidths_of",
    "separated",
    "tracks_of_orders",
    "tracks_over_angle",
]
