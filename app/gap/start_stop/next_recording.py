"""Which further start–stop recording would tell the two likeliest causes apart."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from app.gap.start_stop.causes import TORQUE_GAIN, TRIED, parameters_with, setting_of
from app.gap.start_stop.compare import Compared
from app.gap.start_stop.predict import Predictions
from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.gap.simulator import Point
from gearsig.gap.start_stop.floors import FLOOR
from gearsig.gap.start_stop.told import NAMES, change_of
from gearsig.gap.start_stop.weigh import Fitted
from gearsig.gap.types import NextRecording

FACTORS = (0.7, 1.5)
"""Torques that are tried, over the present one."""
ANALYTIC = ("tooth_wear", "root_crack", TORQUE_GAIN)
LEAST_GAIN, SAME = 1.1, 0.1


def next_drive_recordings(
    compared: Compared,
    predictions: Predictions,
    fits: Mapping[str, Fitted],
    pair: tuple[str, str],
    titles: Mapping[str, str],
) -> tuple[NextRecording, ...]:
    """Return starts and stops at other torques that put the predictions of two causes further apart, best first."""
    floor = compared.floor()
    now = _distance(fits[pair[0]].predicted, fits[pair[1]].predicted, floor.scale)
    found = []
    for factor in FACTORS:
        if not _turns(compared, factor):
            continue
        try:
            first, second = (_change(compared, predictions, fits[name], factor) for name in pair)
            apart = _distance(first, second, floor.scale)
        except GearsigError:
            continue
        if apart > LEAST_GAIN * now:
            point = Point(compared.twin.speed_rpm, compared.twin.torque_nm * factor)
            text = (
                f"starts and stops at {point.torque_nm:.3g} N·m; {titles[pair[0]]} and {titles[pair[1]]} are then "
                f"{apart:.2g} structural floors apart instead of {now:.2g}."
            )
            found.append(NextRecording(point, pair, apart, now, text))
    return tuple(sorted(found, key=lambda one: -one.standard_deviations))


def _change(compared: Compared, predictions: Predictions, fitted: Fitted, factor: float) -> FloatArray:
    """Return the predicted change at another torque, where the cause is expected to show."""
    name, twin = fitted.name, compared.twin.at_torque(factor)
    if name in ANALYTIC:
        return fitted.predicted
    severity = fitted.severity.value
    told = twin.tell(
        parameters_with(name, severity, twin.parameters),
        setting_of(name, severity, predictions.options.get(name, {})),
    )
    change = change_of(told, twin.sound, predictions.shape, compared.spot)
    return np.where(np.isin(NAMES, TRIED[name].shows_in), np.nan_to_num(change), 0.0)


def _turns(compared: Compared, factor: float) -> bool:
    """Whether the sound drive turns its load at another torque: what its cycles tell is then the same."""
    now, there = compared.twin.sound.load.friction_nm, compared.twin.at_torque(factor).sound.load.friction_nm
    return bool(abs(there - now) < SAME * now)


def _distance(first: FloatArray, second: FloatArray, scale: FloatArray) -> float:
    return float(np.sqrt(np.sum(((first - second) / (FLOOR * scale)) ** 2)))
