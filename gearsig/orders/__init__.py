"""Spectra and averages over shaft angle: orders, maps, tracked orders, synchronous averages."""

from gearsig.orders._average import (
    AverageLines,
    SeparatedShafts,
    SynchronousAverage,
    average_lines,
    first_whole_sample,
    mean_and_error,
    revolution_of_lines,
    separate_shafts,
    synchronous_average,
    whole_revolutions,
)
from gearsig.orders._separate import SeparatedAverage, band_passed_mesh, check_average, mesh_modulation, separate
from gearsig.orders._spectrum import OrderMap, frequency_map, order_map, order_spectrum
from gearsig.orders._track import TrackedOrder, amplitude_at_speeds, track_order_bands, track_orders
from gearsig.orders.vold_kalman._filter import track_vold_kalman
from gearsig.orders.vold_kalman._tracks import FrequencyTrack, Generation, OrderSeparation, SeparatedOrder

__all__ = [
    "AverageLines",
    "FrequencyTrack",
    "Generation",
    "OrderMap",
    "OrderSeparation",
    "SeparatedAverage",
    "SeparatedOrder",
    "SeparatedShafts",
    "SynchronousAverage",
    "TrackedOrder",
    "amplitude_at_speeds",
    "average_lines",
    "band_passed_mesh",
    "check_average",
    "first_whole_sample",
    "frequency_map",
    "mean_and_error",
    "mesh_modulation",
    "order_map",
    "order_spectrum",
    "revolution_of_lines",
    "separate",
    "separate_shafts",
    "synchronous_average",
    "track_order_bands",
    "track_orders",
    "track_vold_kalman",
    "whole_revolutions",
]
