"""The angle of a recording's reference shaft, from any available speed source."""

from __future__ import annotations

from dataclasses import replace
from typing import assert_never

import numpy as np

from gearsig.angle._encoder import encoder_angle, speed_channel_angle
from gearsig.angle._pulses import PulseEdges, find_pulse_edges, pulse_train_angle
from gearsig.angle._tachless import estimate_shaft_angle
from gearsig.angle._types import ShaftAngle
from gearsig.checks import not_negative, positive
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.recording import Recording, check_recording
from gearsig.rig import (
    STATED_SPEED_TOLERANCE_PERCENT,
    ConstantSpeed,
    EncoderChannel,
    OperatingPoint,
    PulseTimes,
    Rig,
    SpeedChannel,
    SpeedSource,
    TachometerChannel,
    check_rig,
)


def find_shaft_angle(recording: Recording, rig: Rig | None = None) -> ShaftAngle:
    """Return the angle of the reference shaft.

    It comes from the recording's speed source, else from the rig's, else from the vibration itself or, for a machine
    without gears, from its nominal speed. A source on another shaft is converted by the teeth between the two.

    Parameters
    ----------
    recording : Recording
    rig : Rig, optional
        Default: the recording's rig.

    Returns
    -------
    ShaftAngle
        Pulses may begin before and end after the recording, or cover only part of it.

    Raises
    ------
    InputError
        If the source is malformed, or names a channel or shaft that does not exist.
    RefusalError
        If the machine is at rest or the source does not determine the speed.
    """
    check_recording(recording)
    check_rig(rig)
    rig = rig if rig is not None else recording.rig
    source = recording.speed if recording.speed is not None else (rig.speed_source if rig is not None else None)
    if source is not None:
        angle = _from_source(recording, source)
        if angle.n_revolutions <= 0.0:
            raise RefusalError("the machine is at rest: the shaft angle does not move", remedy="record while it turns")
        if recording.speed is None and rig is not None and rig.speed is None:
            angle = replace(angle, notes=("no speed source is given: the nominal speed is taken",))
        return _to_reference_shaft(angle, source.shaft, rig)
    if rig is None or not rig.pairs:
        point = rig.operating_point if rig is not None else OperatingPoint()
        off = f"; the nominal speed may be {point.speed_tolerance_percent:g} % off" if point.speed_rpm else ""
        raise RefusalError(
            f"there is no speed source, and no gear is described whose mesh lines would give the speed{off}",
            remedy="give a tachometer, a speed channel, a speed that is known to "
            f"{STATED_SPEED_TOLERANCE_PERCENT:g} %, or the teeth in a rig file",
        )
    return estimate_shaft_angle(recording, rig)


def _from_source(recording: Recording, source: SpeedSource) -> ShaftAngle:
    rate = recording.sampling_rate_hz
    match source:
        case ConstantSpeed():
            return constant_speed_angle(source.speed_rpm, recording.duration_s)
        case PulseTimes():
            return pulse_train_angle(source.times_s, source.pulses_per_revolution)
        case TachometerChannel():
            return _from_tachometer(recording, source)
        case EncoderChannel():
            values = recording.values(source.channel)
            return encoder_angle(values, rate, source.units_per_revolution, wraps=source.wraps)
        case SpeedChannel():
            return speed_channel_angle(recording.values(source.channel), rate, source.rpm_per_unit)
        case _:  # neither a Recording nor a Rig accepts any other
            assert_never(source)


def tachometer_edges(recording: Recording, source: TachometerChannel) -> PulseEdges:
    """Return the pulses of a tachometer channel, found with its source's threshold, hysteresis and edge."""
    return find_pulse_edges(
        recording.values(source.channel),
        recording.sampling_rate_hz,
        threshold=source.threshold,
        hysteresis=source.hysteresis,
        edge=source.edge,
    )


def _from_tachometer(recording: Recording, source: TachometerChannel) -> ShaftAngle:
    edges = tachometer_edges(recording, source)
    if len(edges.times_s) < 2:
        raise InputError(
            f"the tachometer has {counted(len(edges.times_s), 'pulse')} in {recording.duration_s:.4g} s",
            where=f"channel {source.channel!r}",
            allowed="at least two",
            remedy=f"the machine is at rest, or the threshold of {edges.threshold:.4g} does not fit the signal, which "
            f"runs from {edges.low:.4g} to {edges.high:.4g}",
        )
    return pulse_train_angle(edges.times_s, source.pulses_per_revolution, tick_s=edges.tick_s)


def _to_reference_shaft(angle: ShaftAngle, shaft: str, rig: Rig | None) -> ShaftAngle:
    if rig is None or not rig.shafts:
        return replace(angle, shaft=shaft)
    reference = rig.reference_shaft
    if not shaft or shaft == reference:
        return replace(angle, shaft=reference)
    ratio = rig.ratio(reference, to=shaft)
    if ratio is None:
        raise InputError(
            f"the speed is that of shaft {shaft!r}, but the teeth do not give its ratio to {reference!r}",
            where="rig",
            remedy=f"complete the teeth between both shafts, or make {shaft!r} the reference shaft",
        )
    converted = angle.of_shaft(reference, ratio)
    note = f"converted from shaft {shaft!r}, which makes {1 / ratio:.6g} revolutions per revolution of {reference!r}"
    return replace(converted, notes=(*converted.notes, note))


# Shaft angle at a stated constant speed.


def constant_speed_angle(speed_rpm: float, duration_s: float) -> ShaftAngle:
    """Return the angle of a shaft at constant speed, zero at time zero.

    revolutions = speed · time

    Parameters
    ----------
    speed_rpm : float
        Above zero.
    duration_s : float
        Above zero.

    Raises
    ------
    RefusalError
        If the speed is zero: there is no angle to resample over.
    """
    not_negative(speed_rpm, "speed_rpm", "rpm")
    positive(duration_s, "duration_s", "s")
    if speed_rpm == 0.0:
        raise RefusalError(
            "the machine is at rest: the stated speed is 0 rpm",
            remedy="look at spectra over frequency, or state the true speed",
        )
    speed = speed_rpm / 60.0
    return ShaftAngle(
        "",
        np.array([0.0, duration_s]),
        np.array([0.0, speed * duration_s]),
        np.array([speed, speed]),
        "constant",
        notes=("the speed is stated, not measured",),
    )
