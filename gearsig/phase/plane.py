"""The phase plane of one measured channel: displacement and velocity."""

from __future__ import annotations

from typing import Literal

import numpy as np

from gearsig.checks import FloatArray, one_of, positive, within
from gearsig.errors import InputError, RefusalError
from gearsig.phase.checked_series import checked_series
from gearsig.phase.integration import SETTLING_PERIODS, integrate_band, n_unsettled
from gearsig.phase.types import PhasePortrait
from gearsig.recording.types import Recording

MotionQuantity = Literal["acceleration", "velocity", "displacement"]

# Integrations from the measured quantity to displacement; velocity takes one less.
_INTEGRATIONS = {"acceleration": 2, "velocity": 1, "displacement": 0, "transmission_error": 0}

# Metres (per second, per second squared) in the units that files use.
_SI = {"m": 1.0, "mm": 1e-3, "um": 1e-6, "µm": 1e-6, "g": 9.80665}

LEAST_PERIODS = 4.0
"""Periods of the low cut that must be left between the disturbed ends."""


def phase_plane(
    recording: Recording,
    channel: str,
    *,
    low_cut_hz: float | None = None,
    high_cut_hz: float | None = None,
    quantity: MotionQuantity | None = None,
) -> PhasePortrait:
    """Return displacement and velocity of a channel that measures acceleration, velocity or displacement.

    Acceleration is integrated twice and once, velocity once and not at all; displacement (and transmission error) is
    differentiated. All within the band from `low_cut_hz` to `high_cut_hz`, in the frequency domain, with no phase
    shift.

    Parameters
    ----------
    recording : Recording
    channel : str
    low_cut_hz : float or None
        Lowest frequency kept in full; a quarter of it and less is gone. Needed for acceleration and velocity:
        integration magnifies whatever is slow. None for a displacement keeps everything slow, the mean included.
    high_cut_hz : float or None
        Highest frequency kept in full; None: 0.4 of the sampling rate.
    quantity : str or None
        What the channel measures where the recording does not know.

    Returns
    -------
    PhasePortrait
        Axes displacement (m where the unit is known) and velocity. Starts 5/low_cut after the recording's start and
        ends as much before its end (256 samples without a low cut), as the integral near the ends rests on what is not
        known; the error is below 5e-4 of the amplitude of displacement.

    Raises
    ------
    InputError
        If the quantity is not one of motion, the low cut is missing, or the band does not lie in the signal's.
    RefusalError
        If the channel is constant or too short for the low cut.

    Notes
    -----
    Not for judging slow motion: below the low cut nothing is left. A low cut that is too low turns sensor noise into
    drift; one too high bends the portrait of slow motion.

    Source: L. Meirovitch, *Elements of Vibration Analysis* (1986), for the phase plane; integration: the property of
    the Fourier transform.
    """
    of_channel = recording.channels[recording.index(channel)]
    known = quantity if quantity is not None else of_channel.quantity
    values = recording.values(channel)
    return phase_plane_of(
        values,
        recording.sampling_rate_hz,
        quantity=known,
        low_cut_hz=low_cut_hz,
        high_cut_hz=high_cut_hz,
        unit=of_channel.unit,
        source=channel,
    )


def phase_plane_of(
    values: FloatArray,
    sampling_rate_hz: float,
    *,
    quantity: str,
    low_cut_hz: float | None = None,
    high_cut_hz: float | None = None,
    unit: str = "",
    source: str = "",
) -> PhasePortrait:
    """Return displacement and velocity of a plain signal; see `phase_plane`."""
    rate = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    n_times = _integrations(quantity, source)
    x = checked_series(values, minimum=16)
    low, high = _band(low_cut_hz, high_cut_hz, rate, n_times)
    n_lost = n_unsettled(rate, low)
    _check_length(len(x), n_lost, low, rate)
    factor, length_unit = _length_unit(unit, n_times)
    kept = slice(n_lost, len(x) - n_lost)
    axes = [integrate_band(x, rate, n, (low, high))[kept] * factor for n in (n_times, n_times - 1)]
    return PhasePortrait(
        points=np.column_stack(axes),
        sampling_rate_hz=rate,
        axis_names=("displacement", "velocity"),
        units=(length_unit, f"{length_unit}/s" if length_unit else ""),
        kind="phase plane",
        source=f"{source}, {low:g} to {high:g} Hz".lstrip(", "),
        start_s=n_lost / rate,
        band_hz=(low, high),
    )


def _integrations(quantity: str, source: str) -> int:
    if quantity not in _INTEGRATIONS:
        raise InputError(
            f"channel {source!r} measures {quantity}: displacement and velocity do not follow from it",
            allowed="acceleration, velocity, displacement",
            remedy="say quantity='acceleration' if it is one, or embed the channel with delays instead",
        )
    one_of(quantity, "quantity", _INTEGRATIONS)
    return _INTEGRATIONS[quantity]


def _band(low_cut_hz: float | None, high_cut_hz: float | None, rate: float, n_times: int) -> tuple[float, float]:
    if low_cut_hz is None and n_times > 0:
        raise InputError(
            "low_cut_hz is not given",
            allowed="> 0 Hz",
            remedy="integration magnifies what is slow: give half of the lowest frequency you want to see",
        )
    high = 0.4 * rate if high_cut_hz is None else within(high_cut_hz, "high_cut_hz", 0.0, 0.5 * rate, "Hz")
    low = 0.0 if low_cut_hz is None else positive(low_cut_hz, "low_cut_hz", "Hz")
    if not low < high:
        raise InputError(f"the band goes from {low:g} to {high:g} Hz", allowed=f"ascending, up to {0.5 * rate:g} Hz")
    return low, high


def _check_length(n: int, n_lost: int, low: float, rate: float) -> None:
    if low == 0.0 and n < 4 * n_lost:
        raise InputError(f"values has {n} sample(s)", allowed=f"at least {4 * n_lost}", remedy="record longer")
    if low > 0.0 and n - 2 * n_lost < LEAST_PERIODS * rate / low:
        need = (2 * SETTLING_PERIODS + LEAST_PERIODS) / low
        raise RefusalError(
            f"{n / rate:.4g} s are too short for a low cut of {low:g} Hz, which needs {need:.4g} s",
            remedy=f"raise low_cut_hz above {low * need * rate / n:.4g} Hz or record longer",
        )


def _length_unit(unit: str, n_times: int) -> tuple[float, str]:
    """Return the factor to metres and "m", or 1 and the unit as it follows from the channel's own."""
    known = unit.replace("²", "^2").replace(" ", "")
    length = known.split("/")[0]
    expected = {2: (f"{length}/s^2", "g"), 1: (f"{length}/s",), 0: (length,)}[n_times]
    if length in _SI and known in expected and (length != "g" or n_times == 2):
        return _SI[length], "m"
    if not unit:
        return 1.0, ""
    return 1.0, unit if n_times == 0 else f"{unit} s" if n_times == 1 else f"{unit} s^2"
