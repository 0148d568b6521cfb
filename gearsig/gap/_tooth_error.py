"""Which fault of a tooth changed the transmission error between encoders on both shafts: no path lies between.

While one tooth is in mesh, a root crack lets it give way all through the engagement, most where it carries alone; a
spall for a short while about the pitch point; a chip where the tip should carry; a wrong pitch moves all teeth. So the
change of what that gear adds to the transmission error is described by its profile: how long it lasts, how it rises and
falls, where it lies in the mesh cycle. The descriptors' densities were learned from the static contact of simulators
that describe teeth otherwise than each other (`app.studies.gap.tooth_errors`); a profile like none of those, as where
the drive's torsion rings, says nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from math import exp, hypot, log, log10, pi, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gearsig.cache import read_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError
from gearsig.gap._evidence import TOOTH_FAULTS
from gearsig.gap._report import shares_of
from gearsig.motion import TransmissionError, transmission_error
from gearsig.prepared import circular_correlation
from gearsig.recording import Recording
from gearsig.rig import SIDES

TOOTH_ERRORS_FILE = Path(__file__).with_name("tooth_errors.npz")
MAX_BYTES = 10_000_000
MAKE_TOOTH_ERRORS = "in a checkout of the project: python -m app.studies.gap.tooth_errors"

STEPS = 32
"""Of a pitch."""
WINDOW = 3 * STEPS
"""In which a tooth's engagement lies, with what is beside it."""
LOWEST_ORDER, HIGHEST_PITCH_ORDER = 3, 8.0
"""Of the shaft, below which an event is not looked for, as the drive's torsion and a disc put on anew are; per pitch,
above which the resolution of encoders is most of what there is."""

STATIC_MESH_HZ = 500.0
"""Mesh frequency at which a static profile counts half, ln L/(1 + f/f0): the faster teeth meet, the more gears and
drive ring on. Of 31 faults of the independent rig at 250 to 2800 Hz, profiles that two simulators had taught named 17
rightly of 27, none with 0.9 or more; it was not tried again with those of three."""

MIN_OVER_NOISE = 1.25
"""Of the event's rms over the standard error of one value: the loudest window of noise alone, of which the band keeps
half, reaches 0.9."""

BOTH_GEARS = 0.9
"""Of the larger change, from which the other gear shows it as well."""

FAR = 4.3
"""Distance in standard deviations, over all descriptors, at which one known profile counts as much as none, some 0.85
of each: of 3.5 to 5, with simulators left out, what is said with 0.9 is right 95 to 99 times in 100."""


@dataclass(frozen=True)
class ToothErrorChange:
    """What changed about the transmission error while the teeth of one gear mesh.

    Parameters
    ----------
    side : int
        0: driver, 1: driven gear.
    pattern_um : array, (z, STEPS)
        Of its teeth in turn.
    mesh_um : array, (STEPS,)
        What each pair of teeth repeated when the machine was healthy.
    rms_um : float
        Within the window that holds most.
    noise_um : float
        Standard error of a value.
    """

    side: int
    pattern_um: FloatArray
    mesh_um: FloatArray
    rms_um: float
    noise_um: float

    @property
    def is_clear(self) -> bool:
        """Whether it stands out of the noise."""
        return self.rms_um >= MIN_OVER_NOISE * self.noise_um


def tooth_error_changes(now: TransmissionError, healthy: TransmissionError) -> list[ToothErrorChange]:
    """Return the change on the gear that shows more of it; on both where they show it alike, as those of equal teeth.

    The teeth meet as the encoders count, unless another turn leaves less than half of the difference: encoders that
    know no zero begin anywhere.
    """
    changes = []
    for side in (0, 1):
        after, before = (_resampled((t.driver_um, t.driven_um)[side]) for t in (now, healthy))
        errors = [float(np.mean((t.driver_error_um, t.driven_error_um)[side])) for t in (now, healthy)]
        pattern = after - _turned(before, after)
        rms = sqrt(float(_window_energy(_banded(pattern, LOWEST_ORDER)).max()) / WINDOW)
        changes.append(ToothErrorChange(side, pattern, _resampled(healthy.mesh_um[None])[0], rms, hypot(*errors)))
    largest_um = max(change.rms_um for change in changes)
    return [change for change in changes if change.rms_um >= BOTH_GEARS * largest_um]


def _resampled(rows: FloatArray) -> FloatArray:
    """Return rows of means over equal steps at `STEPS` a row, by the lines that both have."""
    n, m = rows.size, len(rows) * STEPS
    lines = np.fft.rfft(rows.ravel())
    kept = np.zeros(m // 2 + 1, dtype=np.complex128)
    n_kept = min(len(lines), len(kept))
    # Both are at the middles of their steps.
    kept[:n_kept] = lines[:n_kept] * np.exp(1j * pi * np.arange(n_kept) * (1.0 / m - 1.0 / n))
    resampled: FloatArray = np.fft.irfft(kept, m).reshape(-1, STEPS) * (m / n)
    return resampled


def _turned(before: FloatArray, after: FloatArray) -> FloatArray:
    x, y = after.ravel(), before.ravel()
    turns = [0, *np.argsort(-circular_correlation(x, y))[:5].tolist()]
    differences = [
        float(np.median(np.abs(_banded((x - np.roll(y, t)).reshape(after.shape), LOWEST_ORDER)))) for t in turns
    ]
    best = int(np.argmin(differences))
    turned: FloatArray = np.roll(y, turns[best] if 2.0 * differences[best] < differences[0] else 0).reshape(after.shape)
    return turned


def _banded(pattern: FloatArray, lowest: int) -> FloatArray:
    """Return one revolution without its lowest orders and what encoders hardly resolve, (z STEPS,)."""
    lines = np.fft.rfft(pattern.ravel())
    orders = np.arange(len(lines))
    part = np.cos(0.5 * pi * np.clip(orders / len(pattern) / HIGHEST_PITCH_ORDER, 0.0, 1.0)) ** 2
    banded: FloatArray = np.fft.irfft(lines * np.where(orders < lowest, 0.0, part), pattern.size)
    return banded


def _window_energy(wave: FloatArray) -> FloatArray:
    square = wave**2
    return np.convolve(np.concatenate([square, square[: WINDOW - 1]]), np.ones(WINDOW), "valid")


def tooth_error_descriptors(change: ToothErrorChange) -> FloatArray:
    """Return the profile of the largest event, 26 numbers on a scale that is logarithmic where they are large.

    Read from the root of the damaged tooth to its tip, as the driver's contact runs: how much of all is in it, and
    over what lies beside; its sign; how long it is above 20, 50 and 80 % of its peak, its spread, skewness and
    kurtosis in pitches; whether it is of one sign; its steepest rise and fall; where its centre, begin and end lie from
    where the healthy pair gives way most; its centroid over order; its area and swing over the peak; the mean of each
    quarter from begin to end over the peak; whether the healthy pair gives way for less than half of a pitch. A crack
    rises towards the tip, a tooth out of its place is the same from both ends; a chip ends where its pair leaves,
    which begin and end tell better than the centre. Where tips are relieved by more than the load presses out, pairs
    stand back while two of them carry: the longer part of a pitch then seems to give way, not the shorter.
    """
    wave = _banded(change.pattern_um, LOWEST_ORDER)
    energy = _window_energy(wave)
    start = int(np.argmax(energy))
    background = float(np.median(np.roll(wave, -start)[WINDOW:] ** 2)) if len(wave) > WINDOW else 0.0
    over = 10.0 * log10(max(float(energy[start]) / WINDOW, 1e-12) / max(background, 1e-12))
    event = _straightened(np.roll(_banded(change.pattern_um, 0), -start)[:WINDOW])
    event = event if change.side == 0 else event[::-1]
    size = np.abs(event)
    peak = max(float(size.max()), 1e-12)
    place = np.arange(WINDOW) / STEPS
    share = event**2 / max(float(np.sum(event**2)), 1e-24)
    centre = float(np.sum(share * place))
    moments = [float(np.sum(share * (place - centre) ** n)) for n in (2, 3, 4)]
    spread = max(sqrt(moments[0]), 1e-6)
    sign = float(np.sign(event[np.argmax(size)]))
    slope = np.diff(event * sign) * STEPS / peak
    first, second = np.fft.fft(change.mesh_um)[1:3]
    softest = -float(np.angle(first)) / (2.0 * pi)
    size_of_both = max(abs(first) ** 2 * max(abs(first), abs(second)), 1e-24)
    begin, end = _extent(event * sign / peak)

    def place_in_mesh(from_start: float) -> list[float]:
        at = start / STEPS + (from_start if change.side == 0 else (WINDOW - 1) / STEPS - from_start) - softest
        phase = 2.0 * pi * (at if change.side == 0 else -at)
        return [float(np.cos(phase)), float(np.sin(phase))]

    edges = np.linspace(begin, end, 5).astype(int)
    power = np.abs(np.fft.rfft(event, 16 * STEPS)) ** 2
    orders = np.fft.rfftfreq(16 * STEPS, 1.0 / STEPS)
    descriptors = np.array(
        [
            float(energy[start]) / max(float(np.sum(wave**2)), 1e-24),
            min(over, 40.0),
            sign,
            *(float(np.mean(size > part * peak)) * WINDOW / STEPS for part in (0.2, 0.5, 0.8)),
            spread,
            moments[1] / spread**3,
            moments[2] / spread**4,
            float(event.sum() / max(float(size.sum()), 1e-12)),
            float(slope.max()),
            -float(slope.min()),
            *place_in_mesh(centre),
            float((power * orders).sum() / max(float(power.sum()), 1e-24)),
            float(size.sum()) / peak / STEPS,
            float(np.ptp(event)) / peak,
            *place_in_mesh(begin / STEPS),
            *place_in_mesh((end - 1) / STEPS),
            *(float(event[i : max(j, i + 1)].mean()) * sign / peak for i, j in pairwise(edges)),
            float((second * first.conjugate() ** 2).real) / size_of_both,
        ]
    )
    return np.asarray(np.sign(descriptors) * np.log1p(np.abs(descriptors)))


EXTENT = 0.15
"""Of the peak, above which an event lasts: twice what torsion and noise mostly leave beside it."""


def _extent(event: FloatArray) -> tuple[int, int]:
    """Return the first step of what holds the peak, 1, and the one behind it."""
    peak, low = int(np.argmax(event)), np.flatnonzero(event <= EXTENT)
    return int(max(low[low < peak], default=-1)) + 1, int(min(low[low > peak], default=len(event)))


def _straightened(event: FloatArray) -> FloatArray:
    """Return a window less the straight line through the quarter pitches at either end."""
    quarter = STEPS // 4
    at = np.r_[np.arange(quarter), np.arange(WINDOW - quarter, WINDOW)]
    slope, level = np.polyfit(at, event[at], 1)
    straight: FloatArray = event - (slope * np.arange(WINDOW) + level)
    return straight


@dataclass(frozen=True)
class KnownToothErrors:
    """Descriptors of events of known cause, and how likely each fault makes another: a mean of Gaussian kernels.

    L(x | fault) = mean_i exp(−|A (x − x_i)|²/2) + b, A the inverse root of the covariance within faults, b the weight
    of a profile like none.

    Source: B. W. Silverman, *Density Estimation for Statistics and Data Analysis*, 1986, chapter 4.

    Parameters
    ----------
    descriptors : array, (n, 26)
    faults : array of str, (n,)
    """

    descriptors: FloatArray
    faults: NDArray[np.str_]

    def log_likelihoods(self, descriptors: FloatArray) -> dict[str, float]:
        """Return fault → ln L, of each of `TOOTH_FAULTS`; equal where the profile is like none that is known."""
        within = np.mean([_covariance(self.descriptors[self.faults == name]) for name in TOOTH_FAULTS], axis=0)
        root = np.linalg.cholesky(np.linalg.inv(within))
        apart = np.sum(((self.descriptors - descriptors) @ root) ** 2, axis=1)
        beyond = exp(-0.5 * FAR**2) * len(TOOTH_FAULTS) / len(self.faults)
        return {name: log(float(np.mean(np.exp(-0.5 * apart[self.faults == name]))) + beyond) for name in TOOTH_FAULTS}


SHRINKAGE = 0.2
"""Of a covariance, towards its diagonal."""


def _covariance(rows: FloatArray) -> FloatArray:
    covariance = np.cov(rows.T)
    return np.asarray((1.0 - SHRINKAGE) * covariance + SHRINKAGE * np.diag(np.diag(covariance) + 1e-6))


@cache
def load_known_tooth_errors() -> KnownToothErrors:
    """Return those that come with this version.

    Raises
    ------
    InputError
        If the file is not there, or damaged.
    """
    arrays = read_arrays(TOOTH_ERRORS_FILE, MAX_BYTES)
    if arrays is None:
        raise InputError(
            "the known changes of transmission errors are missing or damaged",
            where=TOOTH_ERRORS_FILE.name,
            remedy=MAKE_TOOTH_ERRORS,
        )
    return KnownToothErrors(np.asarray(arrays["descriptors"], dtype=np.float64), arrays["faults"])


def has_encoders(recording: Recording) -> bool:
    """Return whether the angles of two shafts were measured."""
    return sum(channel.quantity == "encoder" for channel in recording.channels) > 1


def _first_pair(recording: Recording) -> str:
    return recording.rig.pairs[0].name if recording.rig is not None and recording.rig.pairs else ""


@dataclass(frozen=True)
class ToothErrorEvidence:
    """What the change of the transmission error says.

    Parameters
    ----------
    log_likelihoods : mapping
        Fault → ln L.
    rms_um : float
        Of the change, while the teeth that show it mesh.
    gear : str
        "driver" or "driven", which shows it; empty: cannot be told.
    """

    log_likelihoods: Mapping[str, float]
    rms_um: float
    gear: str

    @property
    def probabilities(self) -> dict[str, float]:
        """Return fault → probability, were all as likely beforehand, likeliest first."""
        return shares_of(self.log_likelihoods)

    @property
    def is_unlike_any(self) -> bool:
        """Whether the profile is like none that is known, so that nothing is told apart."""
        return max(self.probabilities.values()) < UNLIKE


UNLIKE = 0.3
"""Probability of the likeliest of four faults, below which they are as good as equal."""


def mean_log_likelihoods(evidence: Sequence[ToothErrorEvidence]) -> dict[str, float]:
    """Return fault → mean ln L over conditions, which say nearly the same; empty where there is none."""
    return {
        name: float(np.mean([at_condition.log_likelihoods[name] for at_condition in evidence]))
        for name in TOOTH_FAULTS
        if evidence
    }


def tooth_error_evidence(recording: Recording, reference: Recording) -> ToothErrorEvidence | None:
    """Return what the change of the transmission error says; None where it was not measured, or did not change.

    Parameters
    ----------
    recording, reference : Recording
        With their rig; the same encoders, not moved in between.

    Raises
    ------
    InputError, RefusalError
        If encoders are there, and the transmission error cannot be had of them; see `transmission_error`.
    """
    if not (has_encoders(recording) and has_encoders(reference)):
        return None
    now, healthy = (transmission_error(measured, pair=_first_pair(measured)) for measured in (recording, reference))
    changes = [change for change in tooth_error_changes(now, healthy) if change.is_clear]
    if not changes:
        return None
    weight = 1.0 / (1.0 + now.mesh_hz / STATIC_MESH_HZ)
    per_gear = [load_known_tooth_errors().log_likelihoods(tooth_error_descriptors(change)) for change in changes]
    log_likelihoods = {
        name: weight * log(float(np.mean([exp(measured[name]) for measured in per_gear]))) for name in TOOTH_FAULTS
    }
    gear = SIDES[changes[0].side] if len(changes) == 1 else ""
    return ToothErrorEvidence(log_likelihoods, max(change.rms_um for change in changes), gear)
