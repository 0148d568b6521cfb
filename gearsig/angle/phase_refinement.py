"""A rough shaft angle made exact by the phase of mesh harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.angle.resample import resample_to_angle
from gearsig.angle.slopes import monotone_slopes
from gearsig.angle.types import ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.recording.types import Recording

# Half widths around the mesh order, in orders of the shaft: below one, so that the shaft's sidebands stay outside.
_HALF_WIDTHS = (0.45, 0.45, 0.3, 0.2)
_MOST_HARMONICS = 3
# Power of the band over its median line: noise has 0.5. A band of noise must not take part, or it would be bent into
# a line.
_LEAST_RATIO, _LEAST_SHARE = 2.0, 0.05
_PER_WIDTH = 4  # points per reciprocal half width; two would do by the sampling theorem


@dataclass(frozen=True)
class _Harmonic:
    """Baseband of one mesh harmonic in all channels, (n_channels, n), and how far it stands out."""

    order: float
    baseband: FloatArray
    ratio: float


def refine_by_phase(
    recording: Recording, channels: tuple[str, ...], angle: ShaftAngle, orders: tuple[float, ...]
) -> ShaftAngle:
    """Return the angle with which the strongest mesh harmonics run at constant phase.

    Over the estimated angle a harmonic of order o has the phase 2πo(θ_true - θ), so θ_true = θ + phase/(2πo). The
    phase is summed
    from sample to sample over all channels, weighted over harmonics by o² times their height over the neighbourhood.
    Repeated, each time over a better angle and with a narrower band.

    Parameters
    ----------
    recording : Recording
    channels : tuple of str
    angle : ShaftAngle
        Off by less than half an order of the mesh harmonic, i.e. 2 % for 23 teeth.
    orders : tuple of float
        Mesh harmonics.

    Notes
    -----
    Source: F. Bonnardot, M. El Badaoui, R. B. Randall, J. Danière, F. Guillet, *Use of the acceleration signal of a
    gearbox in
    order to perform angular resampling*, Mech. Syst. Signal Process. 19 (2005); J. Urbanek, T. Barszcz, J. Antoni, *A
    two-step procedure for estimation of instantaneous rotational speed with large fluctuations*, ibid. 38 (2013).
    """
    for half_width in _HALF_WIDTHS:
        refined = _refined_once(recording, channels, angle, orders, half_width)
        if refined is None:
            return angle
        angle = refined
    return angle


def _refined_once(
    recording: Recording, channels: tuple[str, ...], angle: ShaftAngle, orders: tuple[float, ...], half_width: float
) -> ShaftAngle | None:
    top_speed = angle.speed_range_rpm[1] / 60.0
    wanted = [o for o in orders if (o + 1) * top_speed < 0.4 * recording.sampling_rate_hz]
    if not wanted:
        return None
    try:
        signal = resample_to_angle(recording, angle, channels=channels, highest_order=max(wanted) + 2.0)
    except RefusalError:
        return None
    n_per_rev = signal.samples_per_revolution
    harmonics = [_demodulate(signal.samples, n_per_rev, o, half_width) for o in wanted]
    best = sorted((h for h in harmonics if h is not None), key=lambda h: -h.ratio)[:_MOST_HARMONICS]
    best = [h for h in best if h.ratio > max(_LEAST_RATIO, _LEAST_SHARE * best[0].ratio)]
    if not best or best[0].baseband.shape[1] < 8:
        return None
    shift = _common_shift(best)
    n = best[0].baseband.shape[1]
    revolutions = signal.start_revolution + np.arange(n) * (signal.samples.shape[1] / n_per_rev / n)
    times = _times(angle, revolutions)
    refined = np.maximum.accumulate(revolutions + shift)
    return ShaftAngle(angle.shaft, times, refined, monotone_slopes(times, refined), "tachless")


def _demodulate(samples: FloatArray, n_per_rev: int, order: float, half_width: float) -> _Harmonic | None:
    """Shift one order to zero and keep ± half_width around it, sampled accordingly."""
    from scipy.fft import ifft, rfft

    n_samples = samples.shape[1]
    per_order = n_samples / n_per_rev  # bins per order
    reach = int(half_width * per_order)
    middle = round(order * per_order)
    n = int(per_order * _PER_WIDTH * half_width)
    if reach < 4 or middle + reach >= n_samples // 2 or middle <= reach:
        return None
    taper = 0.5 + 0.5 * np.cos(np.pi * np.arange(-reach, reach + 1) / (reach + 1))
    basebands = []
    for row in samples:
        lines = rfft(row)[middle - reach : middle + reach + 1]
        # In units of its own neighbourhood, so that no channel drowns the others.
        floor = float(np.median(np.abs(lines))) or 1.0
        spread = np.zeros(max(n, 2 * reach + 1), dtype=complex)
        spread[np.arange(-reach, reach + 1)] = lines * taper / floor
        basebands.append(ifft(spread) * len(spread))
    baseband = np.array(basebands)
    # The middle is a whole number of bins; the rest of the shift is a slow turn.
    turn = np.exp(
        2j * np.pi * (middle / per_order - order) * per_order * np.arange(baseband.shape[1]) / baseband.shape[1]
    )
    z = baseband * turn
    power = np.square(np.abs(z)).sum() / (z.size * (2 * reach + 1))
    return _Harmonic(order, z, float(power))


def _common_shift(harmonics: list[_Harmonic]) -> FloatArray:
    """Angle by which the shaft runs ahead of the estimate, in revolutions, from all harmonics."""
    n = harmonics[0].baseband.shape[1]
    total, weights = np.zeros(n), 0.0
    for h in harmonics:
        product = (h.baseband[:, 1:] * np.conj(h.baseband[:, :-1])).sum(axis=0)
        phase = np.concatenate([[0.0], np.cumsum(np.angle(product))])
        weight = h.order**2 * h.ratio
        total += weight * phase / (2 * np.pi * h.order)
        weights += weight
    shift = total / weights
    # The band's own ringing spoils both ends: half a reciprocal width of revolutions.
    edge = min(n // 4, max(1, int(_PER_WIDTH / 2)))
    shift[:edge] = shift[edge]
    shift[n - edge :] = shift[n - edge - 1]
    centred: FloatArray = shift - shift.mean()
    return centred


def _times(angle: ShaftAngle, revolutions: FloatArray) -> FloatArray:
    from gearsig.angle.inversion import times_at

    out = np.empty(len(revolutions))
    knots, values, slopes = (
        np.ascontiguousarray(a, dtype=np.float64) for a in (angle.time_s, angle.revolutions, angle.speed_rev_per_s)
    )
    k = min(max(0, int(np.searchsorted(values, revolutions[0])) - 1), len(knots) - 2)
    times_at(knots, values, slopes, k, float(revolutions[0]), float(revolutions[1] - revolutions[0]), out)
    return out
