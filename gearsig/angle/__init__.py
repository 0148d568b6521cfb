"""Shaft speed and angle, and resampling over angle."""

from gearsig.angle._encoder import encoder_angle, speed_channel_angle
from gearsig.angle._pulses import clock_tick, count_pulses, find_pulse_edges, pulse_train_angle
from gearsig.angle._resample import (
    REACH,
    delay_table,
    doubling_filter,
    interpolate,
    resample_to_angle,
    times_of_revolutions,
)
from gearsig.angle._source import constant_speed_angle, find_shaft_angle, tachometer_edges
from gearsig.angle._tachless import OffsetComb, estimate_shaft_angle, find_offset_comb, refine_by_phase
from gearsig.angle._types import AngleSignal, ShaftAngle, check_shaft_angle

__all__ = [
    "REACH",
    "AngleSignal",
    "OffsetComb",
    "ShaftAngle",
    "check_shaft_angle",
    "clock_tick",
    "constant_speed_angle",
    "count_pulses",
    "delay_table",
    "doubling_filter",
    "encoder_angle",
    "estimate_shaft_angle",
    "find_offset_comb",
    "find_pulse_edges",
    "find_shaft_angle",
    "interpolate",
    "pulse_train_angle",
    "refine_by_phase",
    "resample_to_angle",
    "speed_channel_angle",
    "tachometer_edges",
    "times_of_revolutions",
]
