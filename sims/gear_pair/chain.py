"""The measurement chain of the cracked spur pair: accelerometers at the bearings, a tachometer at the input shaft."""

from __future__ import annotations

from math import cos, radians, sin

from sims.gear_pair.installed import HousingMode, Installed, Pickup, SensorSeat
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
from sims.wanted import Wanted

_PLACES = (
    (1, "input shaft, drive end"),
    (3, "output shaft, drive end"),
    (2, "input shaft, free end"),
    (4, "output shaft, free end"),
)
"""Bearings in the order of their channels."""

_HOUSING = (
    HousingMode(1150.0, 0.03, 0.06, (1.0, 0.8, 0.9, 0.7)),
    HousingMode(2900.0, 0.02, 0.05, (1.0, -0.7, 0.6, -0.8)),
    HousingMode(6300.0, 0.02, 0.04, (1.0, 0.5, -0.9, -0.4)),
)
"""The housing's modes where none are given: plausible for a small cast housing; no housing was measured."""
_HORIZONTAL = 0.85
"""Horizontal modes lie lower by this factor: a housing stands on its feet."""


def build_chain(
    wanted: Wanted,
    line_of_action_deg: float,
    first_pulse_rev: tuple[float, float],
    sampling_rate_hz: float,
    installed: Installed | None = None,
) -> MeasurementChain:
    """Return the chain that the parameters describe.

    Parameters
    ----------
    wanted : Wanted
    line_of_action_deg : float
        β: upwards is x sin β + y cos β, to the right x cos β − y sin β.
    first_pulse_rev : (float, float)
        Angle of the driver's and the driven shaft at a rising edge of a tachometer on it.
    sampling_rate_hz : float
    installed : Installed or None
        Its sensors, housing and tachometer take the place of the usual ones.
    """
    beta = radians(line_of_action_deg)
    directions = {"vertical": (sin(beta), cos(beta)), "horizontal": (cos(beta), -sin(beta))}
    modes = _HOUSING if installed is None else installed.modes
    channels = [
        _channel(seat, wanted, directions[seat.direction], modes if wanted.is_on("path_modes") else ())
        for seat in (_usual_seats(wanted) if installed is None else installed.sensors)
    ]
    names, pickup = (("input", "output"), Pickup()) if installed is None else (installed.shafts, installed.pickup)
    return MeasurementChain(
        sampling_rate_hz,
        tuple(channels),
        AntiAlias(),
        _tachometer(wanted, pickup, names[pickup.side], first_pulse_rev[pickup.side], installed is None),
        _encoders(wanted, names[0]),
    )


def _usual_seats(wanted: Wanted) -> tuple[SensorSeat, ...]:
    everything = wanted.word("channels") == "all"
    seats = [(*place, "vertical") for place in (_PLACES if everything else _PLACES[:2])]
    if everything:
        seats += [(*place, "horizontal") for place in _PLACES]
    return tuple(
        SensorSeat(f"a{i}", bearing, direction, f"bearing {bearing}, {where}, {direction}")
        for i, (bearing, where, direction) in enumerate(seats, 1)
    )


def _channel(
    seat: SensorSeat, wanted: Wanted, direction: tuple[float, float], housing: tuple[HousingMode, ...]
) -> MeasuredChannel:
    range_mps2 = wanted.number("sensor_range_mps2")
    hum = wanted.number("hum_mps2")
    return MeasuredChannel(
        seat.channel,
        _path(seat.bearing, direction, _HORIZONTAL if seat.direction == "horizontal" else 1.0, housing),
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
        seat.position,
    )


def _path(bearing: int, direction: tuple[float, float], factor: float, housing: tuple[HousingMode, ...]) -> ModalPath:
    """Straight from the bearing under the sensor, and by the housing's modes from all four."""
    modes = [
        PathMode(
            factor * mode.frequency_hz,
            mode.damping_ratio,
            {
                name: gain
                for i, at_bearing in enumerate(mode.shape)
                for name, gain in _along(i + 1, direction, mode.gain * mode.shape[bearing - 1] * at_bearing).items()
            },
        )
        for mode in housing
    ]
    return ModalPath(_along(bearing, direction, 1.0), tuple(modes))


def _along(bearing: int, direction: tuple[float, float], gain: float) -> dict[str, float]:
    return {f"bearing {bearing} x": gain * direction[0], f"bearing {bearing} y": gain * direction[1]}


def _tachometer(wanted: Wanted, pickup: Pickup, shaft: str, first_pulse_rev: float, usual: bool) -> Tachometer | None:
    pulses = wanted.whole("tachometer_pulses") if usual else pickup.pulses_per_revolution
    if not pulses:
        return None
    jitter_s = 1e-6 * wanted.number("tachometer_jitter_us")
    return Tachometer(shaft, pulses, pickup.channel, jitter_s=jitter_s, first_pulse_rev=first_pulse_rev, noise_v=0.01)


def _encoders(wanted: Wanted, shaft: str) -> tuple[Encoder, ...]:
    counts = wanted.whole("encoder_counts")
    return (Encoder("encoder", shaft, counts),) if counts else ()
