"""Synchronous averages of both shafts of a gear pair at once: what one repeats does not leak into the other's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.angle.types import AngleSignal
from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVEN, DRIVER, GearFrame
from gearsig.orders.revolutions import first_whole_sample

PASSES = 3
"""Each shaft's average less the other's, in turn. Orders of both lie close, and few revolutions tell them apart
badly: each pass leaves of the leak its square."""

_FINER = 2  # a periodic waveform's points per given one: cubic splines are good to 10⁻³ at the highest order then


@dataclass(frozen=True)
class JointAverages:
    """What either shaft repeats in one channel.

    Parameters
    ----------
    revolutions : (array, array)
        (n_revolutions, n_angles) of driver and driven gear, without what the other shaft repeats besides the mesh.
    residual : array, (n,)
        Over the driver's angle, what neither repeats.
    """

    revolutions: tuple[FloatArray, FloatArray]
    residual: FloatArray


def joint_averages(signals: tuple[AngleSignal, ...], channel: int, frame: GearFrame) -> JointAverages:
    """Separate a channel into what the driver repeats, what the driven gear repeats, and the rest.

    Alternating projections (Gauss–Seidel on the normal equations of x(θ) = a1(θ) + a2(θ z1/z2) + rest). Mesh harmonics
    stay in both averages; other orders that both shafts have go to the driver.

    Parameters
    ----------
    signals : (AngleSignal, AngleSignal)
        The same record over the angle of driver and driven gear; both count from the same instant.
    channel : int
    frame : GearFrame
    """
    ratio = frame.shaft_orders[DRIVEN]
    places = tuple(_places(signal) for signal in signals)
    own = tuple(signal.samples[channel] for signal in signals)
    other_mean: FloatArray | None = None
    for _ in range(PASSES):
        without_driven = own[DRIVER] if other_mean is None else own[DRIVER] - _at(other_mean, places[DRIVER] * ratio)
        driver = _whole(signals[DRIVER], without_driven)
        mean = driver.mean(axis=0)
        without_driver = own[DRIVEN] - _at(_without_mesh(mean, frame.teeth[DRIVER]), places[DRIVEN] / ratio)
        driven = _whole(signals[DRIVEN], without_driver)
        other_mean = _without_mesh(driven.mean(axis=0), frame.teeth[DRIVEN])
    assert other_mean is not None  # noqa: S101 - there is at least one pass
    residual = own[DRIVER] - _at(mean, places[DRIVER]) - _at(other_mean, places[DRIVER] * ratio)
    return JointAverages((driver, driven), residual)


def _whole(signal: AngleSignal, values: FloatArray) -> FloatArray:
    """Return (n_revolutions, n_angles), each from shaft angle 0."""
    n = signal.samples_per_revolution
    first, _ = first_whole_sample(signal)
    count = (len(values) - first) // n
    revolutions: FloatArray = values[first : first + count * n].reshape(count, n)
    return revolutions


def _without_mesh(revolution: FloatArray, teeth: int) -> FloatArray:
    lines = np.fft.rfft(revolution)
    lines[::teeth] = 0.0
    rest: FloatArray = np.fft.irfft(lines, len(revolution))
    return rest


def _places(signal: AngleSignal) -> FloatArray:
    """Return the shaft's angle at each sample, in revolutions."""
    n = signal.samples_per_revolution
    places: FloatArray = (np.arange(signal.samples.shape[1]) + round(signal.start_revolution * n)) / n
    return places


def _at(revolution: FloatArray, place_rev: FloatArray) -> FloatArray:
    """Return a periodic waveform at any angles, by cubic splines through finer points."""
    from scipy.ndimage import map_coordinates

    n = _FINER * len(revolution)
    fine = np.fft.irfft(np.fft.rfft(revolution), n) * _FINER
    values: FloatArray = map_coordinates(fine, [place_rev * n % n], order=3, mode="grid-wrap")
    return values
