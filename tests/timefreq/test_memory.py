"""Maps for display never hold the whole transform: their memory hardly grows with the signal."""

import tracemalloc

import numpy as np
import pytest

from gearsig.timefreq import UniformSignal, cwt_map, squeezed_cwt_map, squeezed_stft_map, stft_map, wavelet_packet_map

SHORT, LONG = 1 << 17, 1 << 19
MAPS = {
    stft_map: 0.5,
    squeezed_stft_map: 0.5,
    cwt_map: 0.5,
    squeezed_cwt_map: 0.5,
    wavelet_packet_map: 5.0,  # critically sampled: as many coefficients as samples, and their squares
}
"""Bytes per byte of the signal, of which the whole transform would take hundreds."""


def peak_bytes(transform, n: int) -> int:
    x = UniformSignal(np.random.default_rng(1).normal(size=n), 1000.0)
    tracemalloc.start()
    try:
        transform(x, **settings_of(transform))
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def settings_of(transform) -> dict[str, object]:
    if transform in (stft_map, squeezed_stft_map):
        return {"n_columns": 200, "window_length": 1.024}
    if transform is wavelet_packet_map:
        return {"n_columns": 200, "level": 4}
    return {"n_columns": 200, "lowest": 30.0, "highest": 240.0, "n_per_octave": 8}


@pytest.mark.slow
@pytest.mark.parametrize("transform", MAPS, ids=lambda f: f.__name__)
def test_memory_hardly_grows_with_the_length(transform) -> None:
    peak_bytes(transform, 4096)  # what is loaded and compiled on first use
    growth = peak_bytes(transform, LONG) - peak_bytes(transform, SHORT)
    assert growth < MAPS[transform] * 8 * (LONG - SHORT)
