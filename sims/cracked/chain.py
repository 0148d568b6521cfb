"""The measurement chain of the cracked spur pair: accelerometers at the bearings, a tachometer at the input shaft."""

from __future__ import annotations

from math import cos, radians, sin

from sims.cracked.wanted import Wanted
from sims.measure import (
    Accelerometer,
    AntiAlias,
    ColouredNoise,
    Converter,
    Encoder,
    MainsHum,
    MeasuredChannel,
    MeasurementChain,
    ModalPath,
    PathMode,
    Tachometer,
)

_PLACES = (
    (1, "input shaft, drive end"),
    (3, "output shaft, drive end"),
    (2, "input shaft, free end"),
    (4, "output shaft, free end"),
)
"""Bearings in the order of their channels."""

_HOUSING = (
    (1150.0, 0.03, 0.06, (1.0, 0.8, 0.9, 0.7)),
    (2900.0, 0.02, 0.05, (1.0, -0.7, 0.6, -0.8)),
    (6300.0, 0.02, 0.04, (1.0, 0.5, -0.9, -0.4)),
)
"""Frequency in Hz, damping ratio, static gain and shape at bearings 1 to 4 of the housing's modes in the vertical.

Plausible for a small cast housing; no housing was measured.
"""
_HORIZONTAL = 0.85
"""Horizontal modes lie lower by this factor: a housing stands on its feet."""


def build_chain(
    wanted: Wanted, line_of_action_deg: float, first_pulse_rev: float, sampling_rate_hz: float
) -> MeasurementChain:
    """Return the chain that the parameters describe.

    Parameters
    ----------
    wanted : Wanted
    line_of_action_deg : float
        β: upwards is x sin β + y cos β, to the right x cos β − y sin β.
    first_pulse_rev : float
        Angle of the input shaft at a rising edge of the tachometer.
    sampling_rate_hz : float
    """
    beta = radians(line_of_action_deg)
    up, right = (sin(beta), cos(beta)), (cos(beta), -sin(beta))
    everything = wanted.word("channels") == "all"
    seats = [(*place, "vertical") for place in (_PLACES if everything else _PLACES[:2])]
    if everything:
        seats += [(*place, "horizontal") for place in _PLACES]
    channels = [
        _channel(f"a{i}", wanted, bearing, f"bearing {bearing}, {where}, {direction}", up, right)
        for i, (bearing, where, direction) in enumerate(seats, 1)
    ]
    return MeasurementChain(
        sampling_rate_hz, tuple(channels), AntiAlias(), _tachometer(wanted, first_pulse_rev), _encoders(wanted)
    )


def _channel(
    name: str,
    wanted: Wanted,
    bearing: int,
    position: str,
    up: tuple[float, float],
    right: tuple[float, float],
) -> MeasuredChannel:
    vertical = position.endswith("vertical")
    range_mps2 = wanted.number("sensor_range_mps2")
    hum = wanted.number("hum_mps2")
    return MeasuredChannel(
        name,
        _path(bearing, up if vertical else right, 1.0 if vertical else _HORIZONTAL, wanted.is_on("path_modes")),
        Accelerometer(
            resonance_hz=wanted.number("sensor_resonance_hz") or None,
            lower_limit_hz=0.5,
            range_mps2=range_mps2,
            noise_mps2_per_sqrt_hz=wanted.number("sensor_noise_mps2_per_sqrt_hz"),
            bias_mps2=wanted.number("sensor_bias_mps2"),
            drift_mps2_per_s=wanted.number("sensor_drift_mps2_per_s"),
        ),
        MainsHum((hum, 0.3 * hum, 0.2 * hum) if hum else (), wanted.number("hum_frequency_hz")),
        ColouredNoise(wanted.number("noise_mps2"), wanted.number("noise_slope")),
        Converter(range_mps2, wanted.whole("converter_bits")),
        position,
    )


def _path(bearing: int, direction: tuple[float, float], factor: float, with_modes: bool) -> ModalPath:
    """Straight from the bearing under the sensor, and by the housing's modes from all four."""
    modes = [
        PathMode(
            factor * frequency_hz,
            damping,
            {k: v for i in range(4) for k, v in _along(i + 1, direction, gain * shape[bearing - 1] * shape[i]).items()},
        )
        for frequency_hz, damping, gain, shape in _HOUSING
    ]
    return ModalPath(_along(bearing, direction, 1.0), tuple(modes) if with_modes else ())


def _along(bearing: int, direction: tuple[float, float], gain: float) -> dict[str, float]:
    return {f"bearing {bearing} x": gain * direction[0], f"bearing {bearing} y": gain * direction[1]}


def _tachometer(wanted: Wanted, first_pulse_rev: float) -> Tachometer | None:
    pulses = wanted.whole("tachometer_pulses")
    if not pulses:
        return None
    jitter_s = 1e-6 * wanted.number("tachometer_jitter_us")
    return Tachometer("input", pulses, jitter_s=jitter_s, first_pulse_rev=first_pulse_rev, noise_v=0.01)


def _encoders(wanted: Wanted) -> tuple[Encoder, ...]:
    counts = wanted.whole("encoder_counts")
    return (Encoder("encoder", "input", counts),) if counts else ()
