"""Vold–Kalman order tracking: orders extracted from a recording as waveforms.

`track_vold_kalman` is in `gearsig.orders`; this package holds its solvers, for one order and for several.
"""

from gearsig.orders.vold_kalman._joint import (
    accuracy_of,
    expected_error,
    rounding_growth,
    samples_per_cell,
    single_order_error,
    solve_band,
    solve_by_splines,
    solve_envelopes,
    solve_waveforms,
)
from gearsig.orders.vold_kalman._single import envelope_alone, oscillator, waveform_alone
from gearsig.orders.vold_kalman._tracks import cosine_and_sine, envelope_weight, settling_time, waveform_weight

__all__ = [
    "accuracy_of",
    "cosine_and_sine",
    "envelope_alone",
    "envelope_weight",
    "expected_error",
    "oscillator",
    "rounding_growth",
    "samples_per_cell",
    "settling_time",
    "single_order_error",
    "solve_band",
    "solve_by_splines",
    "solve_envelopes",
    "solve_waveforms",
    "waveform_alone",
    "waveform_weight",
]
