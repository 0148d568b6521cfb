"""Order spectra of a motion that stops and turns back: stretch by stretch, over angle alone."""

from __future__ import annotations

from math import floor

import numpy as np

from gearsig.checks import FloatArray, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.motion.course import Course, Stretch
from gearsig.spectra.amplitude import amplitude_spectrum
from gearsig.spectra.types import Spectrum

HIGHEST_PART = 0.25
"""Highest order over samples per revolution: the mean over a step of angle has lost a tenth there, which is made up."""
LEAST_SAMPLES = 16
"""Per revolution."""


def stretch_order_spectrum(
    values: FloatArray,
    angle_rad: FloatArray,
    course: Course,
    *,
    direction: str = "forwards",
    revolutions_per_block: float = 1.0,
    unit: str = "",
    source: str = "",
    shaft: str = "",
) -> Spectrum:
    """Return the order spectrum of all stretches of one direction, however fast, slow or short they are.

    Each stretch is cut into equal steps of angle; a step holds the signal's mean over it, ∫x dθ/Δθ, so that slow
    passages are averaged and do not fold back, and the passage to and from standstill needs no speed. Blocks of whole steps are
    windowed (Hann), and their power is averaged over all stretches.

    Parameters
    ----------
    values : array, (n,)
    angle_rad : array, (n,)
        Of the shaft, running on.
    course : Course
    direction : str
        "forwards" or "backwards"; backwards orders count up as well.
    revolutions_per_block : float
        Stretches that are shorter are left out. The lines lie 1/this apart.
    unit, source, shaft : str

    Returns
    -------
    Spectrum
        Over order, "amplitude peak".

    Raises
    ------
    RefusalError
        If no stretch of that direction is long enough.

    Notes
    -----
    Phases differ from stretch to stretch and are not kept. A resonance that rings on in time smears here.
    """
    one_of(direction, "direction", ("forwards", "backwards"))
    positive(revolutions_per_block, "revolutions_per_block")
    if len(values) != len(angle_rad):
        raise InputError(f"{len(values)} values for {len(angle_rad)} angles", allowed="equal lengths")
    sign = 1 if direction == "forwards" else -1
    chosen = [s for s in course.moving if s.direction == sign]
    turns = [abs(s.turned_rad) / (2.0 * np.pi) for s in chosen]
    long = [s for s, n in zip(chosen, turns, strict=True) if n >= revolutions_per_block]
    if not long:
        longest = max(turns, default=0.0)
        raise RefusalError(
            f"no stretch {direction} holds {revolutions_per_block:g} revolutions (the longest {longest:.3g})",
            remedy="give fewer revolutions per block: the lines then lie further apart",
        )
    per_revolution = _samples_per_revolution(angle_rad, long)
    n_block = floor(revolutions_per_block * per_revolution)
    spectra = []
    for stretch in long:
        steps = steps_of_angle(values, sign * angle_rad, stretch, per_revolution)
        if len(steps) >= n_block:
            spectra.append(
                amplitude_spectrum(steps, float(per_revolution), unit=unit, scaling="power", n_per_block=n_block)
            )
    if not spectra:
        raise RefusalError(f"no stretch {direction} holds a whole block", remedy="give fewer revolutions per block")
    return _mean(spectra, per_revolution, unit, f"{source}, {len(spectra)} stretch(es) {direction}", shaft)


def steps_of_angle(values: FloatArray, angle_rad: FloatArray, stretch: Stretch, per_revolution: int) -> FloatArray:
    """Mean of a signal over equal steps of a rising angle within a stretch, (n_steps,)."""
    rising = np.maximum.accumulate(angle_rad[stretch.first : stretch.last]) / (2.0 * np.pi)
    x = np.asarray(values[stretch.first : stretch.last], dtype=np.float64)
    integral = np.concatenate([[0.0], np.cumsum(0.5 * (x[1:] + x[:-1]) * np.diff(rising))])
    first, last = np.ceil(rising[0] * per_revolution), np.floor(rising[-1] * per_revolution)
    edges = np.arange(first, last + 1) / per_revolution
    steps: FloatArray = np.diff(np.interp(edges, rising, integral)) * per_revolution
    return steps


def _samples_per_revolution(angle_rad: FloatArray, stretches: list[Stretch]) -> int:
    """As many as the fastest passage has samples, no more."""
    step = max(float(np.quantile(np.abs(np.diff(angle_rad[s.first : s.last])), 0.99)) for s in stretches)
    found = floor(2.0 * np.pi / step)
    if found < LEAST_SAMPLES:
        raise RefusalError(
            f"the shaft turns by {step:.3g} rad between samples: {found} samples a revolution",
            remedy="record at a higher rate",
        )
    return found


def _mean(spectra: list[Spectrum], per_revolution: int, unit: str, source: str, shaft: str) -> Spectrum:
    """Mean power of the stretches, as amplitude over order, what the steps' means lost made up."""
    weights = np.array([s.n_averages for s in spectra], dtype=np.float64)
    power = np.average([s.values for s in spectra], axis=0, weights=weights)
    first = spectra[0]
    keep = first.positions <= HIGHEST_PART * per_revolution
    lost = np.sinc(first.positions[keep] / per_revolution)
    amplitude = np.sqrt(2.0 * power[keep]) / lost
    amplitude[0] /= np.sqrt(2.0)  # of a mean the amplitude is the value itself
    return Spectrum(
        amplitude,
        first.positions[keep],
        "order",
        "amplitude peak",
        unit,
        first.resolution,
        first.noise_bandwidth,
        first.window,
        int(weights.sum()),
        source,
        shaft,
    )
