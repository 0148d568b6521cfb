"""Spectral coherence over cyclic order and carrier frequency, for variable speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray, positive
from gearsig.errors import InputError, RefusalError
from gearsig.recording.types import Recording
from gearsig.spectra.blocks import ComplexArray, checked_signal, scaled_unit
from gearsig.spectra.coherence import transform_of
from gearsig.spectra.coherence_bands import FIRST_LINE, CarrierBands, lay_bands
from gearsig.spectra.coherence_turns import TurnSums
from gearsig.spectra.coherence_types import SpectralCoherence

MOST_ENVELOPE_SAMPLES = 1 << 22
"""Beyond it, spreading them over the angles would take more than 2 GB."""


@dataclass(frozen=True)
class _Turning:
    """The stretch of angle that is analysed, seen at the envelopes' rate.

    `weight` is Hann's window over the angle, squared, times the speed over the mean speed.
    """

    sums: TurnSums
    weight: FloatArray
    n_envelope: int
    n_shift: int
    inside: slice | np.ndarray[tuple[int], np.dtype[np.bool_]]


def order_coherence(
    recording: Recording,
    channel: str,
    shaft_angle: ShaftAngle,
    *,
    highest_order: float,
    n_bands: int = 64,
) -> SpectralCoherence:
    """Return the order–frequency spectral correlation and coherence of a channel.

    S(α, f) = ∫ y_f(t) x*(t) exp(-2πi α θ(t)) w(θ) θ̇ dt / ∫ w(θ) θ̇ dt, with y_f the signal's part in the carrier band
    around f (Hz), θ the shaft's angle in revolutions and w the square of Hann's window over the angle. Modulation that
    is locked to the shaft stays on one line while resonances stay in their band. γ² = |S(α, f)|²/S(0, f)², computed
    on the signal whitened by its mean density over time.

    Parameters
    ----------
    recording : Recording
    channel : str
    shaft_angle : ShaftAngle
        On the recording's time axis; only the part it covers is used.
    highest_order : float
        Cycles per revolution of the angle's shaft.
    n_bands : int
        Carrier bands from 0 to half the sampling rate. Bands below half of the highest order at the highest speed are
        left out.

    Returns
    -------
    SpectralCoherence
        Over order, every 1/revolutions from 4/revolutions on.

    Raises
    ------
    InputError, RefusalError
        As `spectral_coherence`; also if the angle covers fewer than 8 revolutions.

    Notes
    -----
    Since the power at f - α is taken from the whitened signal's mean, γ² may pass 1 by chance where few products are
    averaged. The level of noise holds for a level that is steady over the run; a level that rises with speed
    averages over fewer independent products than stated, and its slow change shows as coherence at the lowest orders.

    References
    ----------
    D. Abboud, S. Baudin, J. Antoni, D. Rémond, M. Eltabach and O. Sauvage, "The spectral analysis of
    cyclo-non-stationary signals", 2016.
    """
    values, angle, start_s = _covered(recording, channel, shaft_angle)
    fs = recording.sampling_rate_hz
    order = positive(highest_order, "highest_order")
    n_alphas = int(np.floor(order * angle.n_revolutions * (1 + 1e-12)))
    if n_alphas <= FIRST_LINE:
        raise InputError(
            f"highest_order is {order:g}",
            allowed=f"above {(FIRST_LINE + 1) / angle.n_revolutions:g}, 5 over the revolutions",
        )
    n_shift = order * angle.speed_range_rpm[1] / 60.0 * len(values) / fs
    n_lines = (len(values) + 1) // 2
    if n_shift > 0.9 * n_lines:
        raise InputError(
            f"highest_order is {order:g}",
            allowed=f"up to {0.9 * order * n_lines / n_shift:.4g}, where it nears half the sampling rate at full speed",
        )
    seconds = np.arange(len(values)) / fs + start_s
    inflation = _inflation(angle, seconds)
    bands = lay_bands(n_lines, n_bands, n_shift, inflation, n_alphas - FIRST_LINE + 1)
    lines = transform_of(values, np.ones(len(values)))
    turning = _turning(angle, start_s, len(values), fs, bands, int(np.ceil(n_shift)), n_alphas)
    density = _whiten(lines, bands.half)
    S, gamma = _correlate(lines, bands, turning)
    unit = recording.channels[recording.index(channel)].unit
    return SpectralCoherence(
        coherence_squared=gamma,
        correlation=S * density[bands.centres] * (2.0 / (fs * len(values))),
        alpha=np.arange(FIRST_LINE, n_alphas + 1) / angle.n_revolutions,
        alpha_axis="order",
        frequency_hz=bands.centres * (fs / len(values)),
        n_independent=bands.products_per_band / inflation,
        alpha_resolution=1.0 / angle.n_revolutions,
        unit=scaled_unit(unit, "power density"),
        source=channel,
        shaft=angle.shaft,
    )


def _covered(recording: Recording, channel: str, shaft_angle: ShaftAngle) -> tuple[FloatArray, ShaftAngle, float]:
    """Return the samples that the angle covers, the angle over them and the time of the first."""
    fs = recording.sampling_rate_hz
    x = recording.values(channel)
    angle = shaft_angle.between(0.0, (len(x) - 1) / fs)
    first, last = int(np.ceil(angle.start_s * fs - 1e-6)), int(np.floor(angle.end_s * fs + 1e-6))
    if angle.n_revolutions < 8.0:
        raise RefusalError(
            f"the angle covers {angle.n_revolutions:.3g} revolutions of the recording",
            remedy="record at least 8 revolutions",
        )
    return checked_signal(x[first : last + 1], minimum=64), angle, first / fs


def _weight(angle: ShaftAngle, seconds: FloatArray) -> FloatArray:
    """Return Hann's window over the angle, squared, times the speed in rev/s; zero outside of the angle."""
    turn = (angle.revolutions_at(seconds) - float(angle.revolutions[0])) / angle.n_revolutions
    window = np.where((turn >= 0) & (turn < 1), 0.5 - 0.5 * np.cos(2 * np.pi * turn), 0.0)
    result: FloatArray = window**2 * (angle.speed_rpm_at(seconds) / 60.0)
    return result


def _inflation(angle: ShaftAngle, seconds: FloatArray) -> float:
    """Return by how much the weight over time reduces the independent products: T ∫W²/(∫W)²."""
    weight = _weight(angle, seconds)
    return float(len(weight) * np.dot(weight, weight) / weight.sum() ** 2)


def _whiten(lines: ComplexArray, half: int) -> FloatArray:
    """Divide the lines by the root of their mean power over about two bands, in place, and return that power."""
    from scipy.ndimage import uniform_filter1d

    power = lines.real**2 + lines.imag**2
    smooth = uniform_filter1d(uniform_filter1d(power, half, mode="mirror"), half, mode="mirror")
    smooth = np.maximum(smooth, 1e-14 * float(smooth.max()))
    lines /= np.sqrt(smooth)
    return smooth


def _turning(
    angle: ShaftAngle, start_s: float, n: int, fs: float, bands: CarrierBands, n_shift: int, n_alphas: int
) -> _Turning:
    from scipy.fft import next_fast_len

    # Products reach from -(2 half + shift) to as much; what aliases at this rate falls beyond the shift.
    n_envelope = next_fast_len(2 * (bands.half + n_shift) + 8)
    seconds = start_s + np.arange(n_envelope) * (n / fs / n_envelope)
    weight = _weight(angle, seconds)
    if n_envelope > MOST_ENVELOPE_SAMPLES:
        raise InputError(
            f"{n_envelope} envelope samples are too many", remedy="take more bands, a lower order or a shorter stretch"
        )
    inside = weight > 0.0
    turn = (angle.revolutions_at(seconds[inside]) - float(angle.revolutions[0])) / angle.n_revolutions
    sums = TurnSums(turn, n_alphas)
    return _Turning(sums, weight[inside] / weight.sum(), n_envelope, n_shift, inside)


def _correlate(lines: ComplexArray, bands: CarrierBands, turning: _Turning) -> tuple[ComplexArray, FloatArray]:
    """Return the whitened signal's S and γ², (n_alphas, n_bands) each."""
    n_wide = bands.half + turning.n_shift
    lines = np.concatenate([lines, np.zeros(max(0, n_wide + 1 - len(lines)), dtype=lines.dtype)])
    lines = np.concatenate([np.conj(lines[1 : n_wide + 1][::-1]), lines, np.zeros(n_wide, dtype=lines.dtype)])
    n_rows = turning.sums.n - FIRST_LINE + 1
    S = np.empty((n_rows, bands.n_bands), dtype=np.complex128)
    gamma = np.empty(S.shape)
    for i, centre in enumerate(bands.centres):
        around = lines[int(centre) : int(centre) + 2 * n_wide + 1]  # line `centre` is its middle
        narrow = np.zeros(len(around), dtype=np.complex128)
        low = n_wide - bands.half + 1
        narrow[low : low + len(bands.weight)] = around[low : low + len(bands.weight)] * bands.weight
        product = _at_rate(narrow, turning.n_envelope) * np.conj(_at_rate(around, turning.n_envelope))
        c = turning.sums(product[turning.inside] * turning.weight) * (turning.n_envelope**2 / bands.weight.sum())
        S[:, i] = c[FIRST_LINE:]
        own = abs(float(c[0].real))
        square = S[:, i].real ** 2 + S[:, i].imag ** 2
        gamma[:, i] = square / own**2 if own > 0 else 0.0
    return S, gamma


def _at_rate(around: ComplexArray, n: int) -> ComplexArray:
    """Transform lines -m … m to n ≥ 2m + 1 samples of a complex envelope."""
    from scipy.fft import ifft

    m = len(around) // 2
    spectrum = np.zeros(n, dtype=np.complex128)
    spectrum[: m + 1] = around[m:]
    spectrum[n - m :] = around[:m]
    result: ComplexArray = ifft(spectrum, overwrite_x=True)
    return result
