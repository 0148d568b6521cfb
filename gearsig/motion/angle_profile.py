"""Signals over the angle of a shaft that stops and turns back: no revolution need be complete."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.motion.course import Course


@dataclass(frozen=True)
class AngleProfile:
    """Level of a signal in each tooth pitch of a shaft, forwards and backwards apart.

    Parameters
    ----------
    n_teeth : int
    rms : mapping-like arrays, forwards and backwards, (n_teeth,)
        nan where a tooth was never passed that way.
    passes_forwards, passes_backwards : array of int, (n_teeth,)
    """

    n_teeth: int
    rms_forwards: FloatArray
    rms_backwards: FloatArray
    passes_forwards: NDArray[np.int64]
    passes_backwards: NDArray[np.int64]


def angle_profile(values: FloatArray, angle_rad: FloatArray, course: Course, n_teeth: int) -> AngleProfile:
    """Return the root mean square over angle of a signal within each tooth pitch.

    Every stretch of one direction is followed by its own angle, so that a stop in the middle of a tooth or a turn back
    needs no speed; samples weigh by the angle they cover, so that a slow passage counts no more than a fast one.
    Samples at rest have no angle and are left out.

    Parameters
    ----------
    values : array, (n,)
    angle_rad : array, (n,)
        Of the shaft, running on.
    course : Course
    n_teeth : int

    Raises
    ------
    InputError
        If the lengths differ.
    """
    count(n_teeth, "n_teeth", minimum=3)
    if len(values) != len(angle_rad):
        raise InputError(f"{len(values)} values for {len(angle_rad)} angles", allowed="equal lengths")
    sums, weights = np.zeros((2, n_teeth)), np.zeros((2, n_teeth))
    passes = np.zeros((2, n_teeth), dtype=np.int64)
    for stretch in course.moving:
        row = 0 if stretch.direction > 0 else 1
        x = angle_rad[stretch.first : stretch.last] * n_teeth / (2.0 * np.pi)
        covered = np.abs(np.gradient(x)) if len(x) > 1 else np.zeros(len(x))
        pitch = np.floor(x).astype(np.int64)
        tooth = pitch % n_teeth
        np.add.at(sums[row], tooth, covered * values[stretch.first : stretch.last] ** 2)
        np.add.at(weights[row], tooth, covered)
        np.add.at(passes[row], np.unique(pitch) % n_teeth, 1)
    with np.errstate(invalid="ignore"):
        rms = np.sqrt(np.where(weights > 0.0, sums / np.where(weights > 0.0, weights, 1.0), np.nan))
    return AngleProfile(n_teeth, rms[0], rms[1], passes[0], passes[1])
