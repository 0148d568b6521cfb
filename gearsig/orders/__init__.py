"""Spectra and averages over shaft angle: orders, maps, tracked orders, synchronous averages."""

from gearsig.orders._average import (
    first_whole_sample,
    mean_and_error,
    synchronous_average,
    times_of_revolutions,
    whole_revolutions,
)
from gearsig.orders._separate import SeparatedAverage, band_passed_mesh, highest_line, mesh_modulation, separate
from gearsig.orders._spectrum import frequency_map, order_map, order_spectrum
from gearsig.orders._track import amplitude_at_speeds, track_order_bands, track_orders
from gearsig.orders._types import OrderMap, SynchronousAverage, TrackedOrder
from gearsig.orders.vold_kalman._banded import eliminate, rotate, solve_band
from gearsig.orders.vold_kalman._filter import separate_frequencies, track_vold_kalman
from gearsig.orders.vold_kalman._joint import (
    accuracy_of,
    closeness,
    error_alone,
    expected_error,
    samples_per_cell,
    solve_by_splines,
    solve_envelopes,
    solve_waveforms,
)
from gearsig.orders.vold_kalman._single import envelope_alone, oscillator, waveform_alone
from gearsig.orders.vold_kalman._tracks import (
    FrequencyTrack,
    Generation,
    OrderSeparation,
    SeparatedOrder,
    bandwidth_of_weight,
    cosine_and_sine,
    envelope_response,
    envelope_weight,
    settling_time,
    waveform_weight,
    waveform_weight_of_bandwidth,
    weight_of_bandwidth,
)

__all__ = [
    "FrequencyTrack",
    "Generation",
    "OrderMap",
    "OrderSeparation",
    "SeparatedAverage",
    "SeparatedOrder",
    "SynchronousAverage",
    "TrackedOrder",
    "accuracy_of",
    "amplitude_at_speeds",
    "band_passed_mesh",
    "bandwidth_of_weight",
    "closeness",
    "cosine_and_sine",
    "eliminate",
    "envelope_alone",
    "envelope_response",
    "envelope_weight",
    "error_alone",
    "expected_error",
    "first_whole_sample",
    "frequency_map",
    "highest_line",
    "mean_and_error",
    "mesh_modulation",
    "order_map",
    "order_spectrum",
    "oscillator",
    "rotate",
    "samples_per_cell",
    "separate",
    "separate_frequencies",
    "settling_time",
    "solve_band",
    "solve_by_splines",
    "solve_envelopes",
    "solve_waveforms",
    "synchronous_average",
    "times_of_revolutions",
    "track_order_bands",
    "track_orders",
    "track_vold_kalman",
    "waveform_alone",
    "waveform_weight",
    "waveform_weight_of_bandwidth",
    "weight_of_bandwidth",
    "whole_revolutions",
]
