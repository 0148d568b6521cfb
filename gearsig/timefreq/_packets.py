"""Wavelet packets: bands of equal width, each critically sampled, with the energy preserved exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, count, freeze, one_of
from gearsig.errors import InputError, RefusalError
from gearsig.results import Result
from gearsig.timefreq._types import Axis, Columns, LinePlan, Reduction, Source, TimeFrequencyMap, plan_columns, uniform

_MODE = "periodization"  # as many coefficients as samples: the only mode that preserves the energy


@dataclass(frozen=True)
class WaveletPackets(Result):
    """Coefficients of an orthogonal wavelet packet transform, in bands of equal width.

    Parameters
    ----------
    values : array, (2^level, n_coefficients)
        One row per band, in ascending frequency. The sum of squares equals that of the samples.
    n_samples : int
        Length of the signal, which was zero-padded to a multiple of 2^level.
    rate : float
        Samples per second or revolution of the signal.
    start : float
        Time or angle of the first sample.
    axis, unit, source, shaft
        As in `TimeFrequencyMap`.
    wavelet : str
        Name in PyWavelets.
    """

    values: FloatArray
    n_samples: int
    rate: float
    start: float
    axis: Axis
    unit: str
    wavelet: str
    source: str = ""
    shaft: str = ""

    def __post_init__(self) -> None:
        freeze(self, "values", ndim=2)

    @property
    def n_bands(self) -> int:
        """Number of bands, 2^level."""
        return len(self.values)

    @property
    def band_width(self) -> float:
        """Width of a band in Hz or orders."""
        return self.rate / 2 / self.n_bands

    @property
    def level(self) -> int:
        """Number of times the signal was split."""
        return self.n_bands.bit_length() - 1

    @property
    def energies(self) -> FloatArray:
        """Sum of squares of each band, (n_bands,); the total is that of the signal."""
        result: FloatArray = np.einsum("ij,ij->i", self.values, self.values)
        return result

    def limits_of(self, band: int) -> tuple[float, float]:
        """Return the lower and upper border of a band in Hz or orders; its filter's skirts extend beyond."""
        return band * self.band_width, (band + 1) * self.band_width

    def band_of(self, position: float) -> int:
        """Return the index of the band that contains a frequency or order."""
        if not 0.0 <= position <= self.rate / 2:
            raise InputError(f"position is {position:g}", allowed=f"0 to {self.rate / 2:g}")
        return min(int(position / self.band_width), self.n_bands - 1)


def node_path(band: int, level: int) -> str:
    """Return the filter path to a band: "a" low-pass, "d" high-pass, the first split first.

    A high-pass branch is mirrored in frequency, so that the paths of successive bands follow the Gray code.

    Examples
    --------
    >>> [node_path(band, 2) for band in range(4)]
    ['aa', 'ad', 'dd', 'da']
    """
    if not 0 <= band < 1 << count(level, "level"):
        raise InputError(f"band {band} does not exist", where="band", allowed=f"0 to {(1 << level) - 1}")
    return f"{band ^ (band >> 1):0{level}b}".replace("0", "a").replace("1", "d")


def wavelet_packets(
    signal: Source, channel: str | float | None = None, *, wavelet: str = "sym12", level: int = 6
) -> WaveletPackets:
    """Return the wavelet packet coefficients of 2^level bands of equal width.

    Parameters
    ----------
    signal : Recording, AngleSignal, UniformSignal or array, (n_samples,)
        Bands are frequencies for a signal over time, orders for one over angle.
    channel : str, float or None
        As in `cwt`.
    wavelet : str
        An orthogonal wavelet of PyWavelets. Longer ones separate bands better. Nearly symmetric ones
        (sym12, dmey) show an event at its true time; db10 shifts it between bands by several coefficients.
    level : int
        1 to 12.

    Returns
    -------
    WaveletPackets
        Σ values² = Σ x². The signal is treated as periodic: within a filter's length of the ends, bands mix both ends.

    Raises
    ------
    InputError
        On an unknown or non-orthogonal wavelet, or non-finite values.
    RefusalError
        If the signal is too short for the level.

    Notes
    -----
    Not for reading frequencies or exact instants: the filters' skirts make bands overlap, and the transform changes if
    the signal is shifted by a sample.

    Source: R. R. Coifman, M. V. Wickerhauser, *Entropy-based algorithms for best basis selection*, IEEE Transactions on
    Information Theory 38 (1992).
    """
    x = uniform(signal, channel)
    filters = _orthogonal(wavelet)
    count(level, "level", maximum=12)
    shortest = filters.dec_len << level
    if x.n_samples < shortest:
        max_level = int(np.log2(max(x.n_samples / filters.dec_len, 1.0)))
        raise RefusalError(
            f"{x.n_samples} samples are too few for level {level} with {wavelet}, which needs {shortest}",
            remedy=f"set level to {max_level}" if max_level else "take a shorter wavelet, or record longer",
        )
    n_per_band = -(-x.n_samples // (1 << level))
    filled = np.zeros(n_per_band << level)
    filled[: x.n_samples] = x.values
    values = _split(filled, filters, level)
    return WaveletPackets(values, x.n_samples, x.rate, x.start, x.axis, x.unit, wavelet, x.source, x.shaft)


def packet_inverse(packets: WaveletPackets, bands: list[int] | None = None) -> FloatArray:
    """Return the signal reconstructed from some bands, or from all, which restores it to 1e-12.

    Parameters
    ----------
    packets : WaveletPackets
    bands : list of int or None
        Indices of the bands to keep; None keeps all.

    Returns
    -------
    array, (n_samples,)

    Raises
    ------
    InputError
        If a band does not exist.
    """
    import pywt

    kept = np.array(packets.values)
    if bands is not None:
        for band in bands:
            if not 0 <= band < packets.n_bands:
                raise InputError(f"band {band} does not exist", where="bands", allowed=f"0 to {packets.n_bands - 1}")
        kept[np.setdiff1d(np.arange(packets.n_bands), bands)] = 0.0
    rows = list(kept)
    while len(rows) > 1:
        merged = []
        for i in range(0, len(rows), 2):
            low, high = (rows[i], rows[i + 1]) if (i // 2) % 2 == 0 else (rows[i + 1], rows[i])
            merged.append(pywt.idwt(low, high, packets.wavelet, _MODE))
        rows = merged
    result: FloatArray = rows[0][: packets.n_samples]
    return result


def wavelet_packet_map(
    signal: Source,
    channel: str | float | None = None,
    *,
    wavelet: str = "sym12",
    level: int = 6,
    n_columns: int = 1000,
    reduction: Reduction = "mean",
    scaling: str = "amplitude peak",
) -> TimeFrequencyMap:
    """Return the levels of the wavelet packet bands in segments of time or angle.

    Parameters
    ----------
    signal, channel, wavelet, level
        As in `wavelet_packets`.
    n_columns : int
        Maximum number of columns, limited to the number of coefficients in a band.
    reduction, scaling
        As in `cwt_map`.

    Returns
    -------
    TimeFrequencyMap
        "power": mean square of the signal's part in each band, so that the mean over columns of the sum over
        bands is the signal's mean square. "amplitude peak": √2 times the root of the power, 1 for a unit sine inside a
        band.

    Raises
    ------
    InputError, RefusalError
        As in `wavelet_packets`.
    """
    x = uniform(signal, channel)
    packets = wavelet_packets(x, wavelet=wavelet, level=level)
    n_bands, n = packets.values.shape
    per_column = plan_columns(x, min(count(n_columns, "n_columns", minimum=2), n)).n_per_column
    columns = Columns(n * n_bands, max(1, -(-per_column // n_bands)) * n_bands)
    transform = LinePlan(
        x,
        (np.arange(n_bands) + 0.5) * packets.band_width,
        "linear",
        f"wavelet packets, {wavelet}, level {level}",
        np.full(n_bands, _orthogonal(wavelet).dec_len * n_bands / 2 / x.rate),
    )
    # A coefficient represents n_bands samples: its square over n_bands is their mean square, half a sine's amplitude².
    gain = np.sqrt(2.0 / n_bands)
    pieces = ((np.array([band]), 0, n_bands, gain * packets.values[band : band + 1]) for band in range(n_bands))
    return transform.level_map(columns, reduction, scaling, pieces)


def _orthogonal(name: str):  # type: ignore[no-untyped-def]
    """Return the filters of an orthogonal wavelet."""
    import pywt

    one_of(name, "wavelet", pywt.wavelist(kind="discrete"))
    wavelet = pywt.Wavelet(name)
    if not wavelet.orthogonal:
        raise InputError(f"wavelet {name} is not orthogonal", allowed="dbN, symN, coifN, haar, dmey")
    return wavelet


def _split(x: FloatArray, filters: object, level: int) -> FloatArray:
    """Return the last level's packets in ascending frequency: high-pass bands are mirrored, so their halves swap."""
    import pywt

    rows = [x]
    for _ in range(level):
        halves = []
        for i, row in enumerate(rows):
            low, high = pywt.dwt(row, filters, _MODE)
            halves += [low, high] if i % 2 == 0 else [high, low]
        rows = halves
    return np.array(rows)
