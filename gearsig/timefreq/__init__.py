"""Spectra over time: STFT, wavelets, synchrosqueezing, over time or shaft angle."""

from gearsig.timefreq._cwt import component, cwt, cwt_map, inverse, squeezed_cwt, squeezed_cwt_map
from gearsig.timefreq._packets import WaveletPackets, node_path, packet_inverse, wavelet_packet_map, wavelet_packets
from gearsig.timefreq._ridges import (
    NOT_HIDDEN,
    best_path,
    crossing_segments,
    maxima_of_separate_paths,
    reconnected_paths,
    ridges,
)
from gearsig.timefreq._squeezing import SqueezeEngine, squeeze_lines
from gearsig.timefreq._stft import squeezed_stft, squeezed_stft_map, stft, stft_map
from gearsig.timefreq._types import Axis, Reduction, Ridge, Source, TimeFrequencyMap, UniformSignal, at_label, uniform
from gearsig.timefreq._wavelets import (
    Morlet,
    Morse,
    admissibility,
    band,
    footprint_periods,
    half_support,
    lowest_analysable,
    pieces,
    plan_groups,
)

__all__ = [
    "NOT_HIDDEN",
    "Axis",
    "Morlet",
    "Morse",
    "Reduction",
    "Ridge",
    "Source",
    "SqueezeEngine",
    "TimeFrequencyMap",
    "UniformSignal",
    "WaveletPackets",
    "admissibility",
    "at_label",
    "band",
    "best_path",
    "component",
    "crossing_segments",
    "cwt",
    "cwt_map",
    "footprint_periods",
    "half_support",
    "inverse",
    "lowest_analysable",
    "maxima_of_separate_paths",
    "node_path",
    "packet_inverse",
    "pieces",
    "plan_groups",
    "reconnected_paths",
    "ridges",
    "squeeze_lines",
    "squeezed_cwt",
    "squeezed_cwt_map",
    "squeezed_stft",
    "squeezed_stft_map",
    "stft",
    "stft_map",
    "uniform",
    "wavelet_packet_map",
    "wavelet_packets",
]
