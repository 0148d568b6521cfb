"""Figures of a whole signal in a band: the overall velocity that maintenance goes by, and the impulsiveness up high."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil, floor

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.indicators._amplitude import Amplitudes, Indicator, checked_values, crest_factor, kurtosis, rms
from gearsig.recording import SI_FACTORS, Channel, si_factor
from gearsig.spectra import Spectrum, amplitude_spectrum

VELOCITY_BAND_HZ = (10.0, 1000.0)
"""Of the overall velocity, ISO 20816-1."""

SLOW_RPM, SLOW_LOWEST_HZ = 600.0, 2.0
"""Below that speed the band begins at 2 Hz, ISO 20816-3."""

MIN_PERIODS = 10
"""Of the lowest frequency, in a recording: its lines are then apart from the mean."""

SAME_FREQUENCY = 0.005
"""Relative: a speed that is stated, and one that wanders a little."""

HIGH_BAND_HZ = (1000.0, 10_000.0)
"""Where bearings ring, and gears and unbalance hardly do."""

ZONE_LIMITS_MM_PER_S = {
    (1, "rigid"): (2.3, 4.5, 7.1),
    (1, "flexible"): (3.5, 7.1, 11.0),
    (2, "rigid"): (1.4, 2.8, 4.5),
    (2, "flexible"): (2.3, 4.5, 7.1),
}
"""Boundaries A/B, B/C, C/D of the rms velocity by machine group and mounting: ISO 20816-3:2022, annex A."""


def overall_velocity_mm_per_s(
    values: FloatArray,
    sampling_rate_hz: float,
    channel: Channel,
    band_hz: tuple[float, float] = VELOCITY_BAND_HZ,
    *,
    spectrum: Spectrum | None = None,
) -> float:
    r"""Return the rms vibration velocity in a band, in mm/s.

    From the Hann-windowed amplitude spectrum A of acceleration, of noise bandwidth 1.5 lines:

    .. math:: v_{rms}^2 = \frac{1}{1.5} \sum_{f \in band} \frac{A(f)^2}{2 (2 \pi f)^2}

    Parameters
    ----------
    values : array, (n_samples,)
        In the channel's unit.
    sampling_rate_hz : float
    channel : Channel
        An acceleration or a velocity in a known unit.
    band_hz : (float, float)
    spectrum : Spectrum or None
        The values' `amplitude_spectrum`, where it is known.

    Raises
    ------
    InputError
        If the channel is neither, its unit is not known, or the recording is too short or sampled too slowly.
    """
    quantity = "velocity" if channel.quantity == "velocity" else "acceleration"
    factor = si_factor(quantity, channel.unit) if channel.quantity in ("velocity", "acceleration") else None
    where = f"channel {channel.name!r}"
    if factor is None:
        raise InputError(
            f"its unit is {channel.unit or 'not known'!r}, its quantity {channel.quantity}",
            where=where,
            allowed=", ".join((*SI_FACTORS["acceleration"], *SI_FACTORS["velocity"])),
            remedy="state quantity and unit with a [[sensor]] in the rig file",
        )
    low_hz, high_hz = band_hz
    if 2 * high_hz >= sampling_rate_hz:
        raise InputError(f"it was sampled at {sampling_rate_hz:g} Hz", where=where, allowed=f"above {2 * high_hz:g} Hz")
    x = checked_values(values)
    if len(x) * low_hz < MIN_PERIODS * sampling_rate_hz:
        raise InputError(
            f"it is {len(x) / sampling_rate_hz:.3g} s long", where=where, allowed=f"{MIN_PERIODS / low_hz:g} s or more"
        )
    _, mean_square = _velocity_lines(spectrum or amplitude_spectrum(x, sampling_rate_hz), quantity, band_hz)
    return 1e3 * factor * float(np.sqrt(mean_square.sum()))


def velocity_shares(
    spectrum: Spectrum, channel: Channel, places_hz: Mapping[str, Sequence[float]], band_hz: tuple[float, float]
) -> dict[str, float]:
    """Return which share of the squared overall velocity lies about the frequencies of each place, 0 to 1.

    Parameters
    ----------
    spectrum : Spectrum
        `amplitude_spectrum` of an acceleration or a velocity.
    channel : Channel
    places_hz : mapping
        Name of a place → its frequencies; a line counts within two lines of them, or half a per cent.
    band_hz : (float, float)
        See `velocity_band_hz`.
    """
    hertz, mean_square = _velocity_lines(spectrum, channel.quantity, band_hz)
    total = float(mean_square.sum())
    shares = {}
    for name, frequencies in places_hz.items():
        is_there = np.zeros(len(hertz), dtype=bool)
        for frequency in frequencies:
            is_there |= np.abs(hertz - frequency) <= max(2.0 * spectrum.resolution, SAME_FREQUENCY * frequency)
        shares[name] = float(mean_square[is_there].sum()) / total if total > 0.0 else 0.0
    return shares


def _velocity_lines(spectrum: Spectrum, quantity: str, band_hz: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Return the frequencies within a band, and what each line adds to the mean square velocity."""
    inside = slice(*np.searchsorted(spectrum.positions, (band_hz[0], np.nextafter(band_hz[1], np.inf))))
    amplitude, hertz = spectrum.values[inside], spectrum.positions[inside]
    if quantity == "acceleration":
        amplitude = amplitude / (2 * np.pi * hertz)
    return hertz, 0.5 * np.square(amplitude) * spectrum.resolution / spectrum.noise_bandwidth


def velocity_band_hz(speed_rpm: float | None) -> tuple[float, float]:
    """Return the band of the overall velocity, wider for slow machines (ISO 20816-3)."""
    low_hz, high_hz = VELOCITY_BAND_HZ
    return (SLOW_LOWEST_HZ if speed_rpm is not None and speed_rpm < SLOW_RPM else low_hz), high_hz


def vibration_zone(velocity_mm_per_s: float, group: int, mounting: str) -> str:
    """Return the zone of ISO 20816-3 of an overall velocity.

    A: as of new machines; B: fit for unlimited service; C: not fit for long service; D: severe enough to damage.

    Parameters
    ----------
    velocity_mm_per_s : float
        Rms from 10 to 1000 Hz, at a bearing housing, at steady speed; the largest of all places.
    group : int
        1 or 2, see `gearsig.rig.MachineSize`.
    mounting : str
        "rigid" or "flexible".

    Raises
    ------
    InputError
        On a group or mounting that the standard does not have.

    Examples
    --------
    >>> vibration_zone(2.0, 2, "rigid"), vibration_zone(7.2, 1, "rigid")
    ('B', 'D')
    """
    if (group, mounting) not in ZONE_LIMITS_MM_PER_S:
        known = ", ".join(f"{g} {m}" for g, m in ZONE_LIMITS_MM_PER_S)
        raise InputError(f"machine group and mounting are {group!r} {mounting!r}", allowed=known)
    return "ABCD"[sum(velocity_mm_per_s > limit for limit in ZONE_LIMITS_MM_PER_S[group, mounting])]


def overall_indicators(
    values: FloatArray,
    sampling_rate_hz: float,
    channel: Channel,
    speed_rpm: float | None = None,
    *,
    spectrum: Spectrum | None = None,
    transform: NDArray[np.complexfloating] | None = None,
) -> Iterator[Indicator]:
    """Yield the overall velocity, and rms, crest factor and kurtosis of the high frequencies, where they are defined.

    Parameters
    ----------
    values : array, (n_samples,)
    sampling_rate_hz : float
    channel : Channel
    speed_rpm : float or None
        Slow machines have a band from 2 Hz.
    spectrum, transform
        The values' `amplitude_spectrum` and `rfft`, where they are known.
    """
    from scipy.fft import irfft, rfft

    band_hz = velocity_band_hz(speed_rpm)
    try:
        velocity = overall_velocity_mm_per_s(values, sampling_rate_hz, channel, band_hz, spectrum=spectrum)
    except InputError:
        pass
    else:
        yield Indicator("overall velocity", velocity, "mm/s", channel.name, "velocity", band=_band_text(band_hz))
    low_hz, high_hz = HIGH_BAND_HZ[0], min(HIGH_BAND_HZ[1], 0.45 * sampling_rate_hz)
    if channel.quantity in ("acceleration", "unknown") and high_hz > 2 * low_hz:
        n, known = len(values), rfft(checked_values(values)) if transform is None else transform
        inside = slice(ceil(low_hz * n / sampling_rate_hz), floor(high_hz * n / sampling_rate_hz) + 1)
        lines = np.zeros_like(known)
        lines[inside] = known[inside]
        high = Amplitudes(irfft(lines, n, overwrite_x=True))
        for name, value, unit in (
            ("high-frequency rms", rms(high), channel.unit),
            ("high-frequency crest factor", crest_factor(high), ""),
            ("high-frequency kurtosis", kurtosis(high), ""),
        ):
            yield Indicator(name, value, unit, channel.name, "band-passed", band=_band_text((low_hz, high_hz)))


def _band_text(band_hz: tuple[float, float]) -> str:
    return f"{band_hz[0]:g} to {band_hz[1]:g} Hz"
