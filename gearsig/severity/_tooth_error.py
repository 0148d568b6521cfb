"""Find and identify a tooth fault by the change in transmission error between encoders: no transfer path is involved.

While the damaged tooth is in mesh, a root crack makes it deflect throughout the engagement, most where it carries the
load alone; a spall does so briefly around the pitch point; a chip where the tip should carry load. A pitch error moves
all teeth. The change in that gear's contribution to the transmission error is therefore described by its profile: its
duration, how it rises and falls, and its place in the mesh cycle. The densities of these descriptors were learned from
the static contact of simulators that model teeth in different ways (`app.studies.gap.tooth_errors`), those of other
changes as well: another load, wear of all teeth, run-out. A profile unlike any of these, for example where the drive's
torsion rings, is no evidence. If it is a crack, its depth follows from the size of the change relative to the load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise
from math import exp, hypot, log, log10, pi, sqrt
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp, softmax

from gearsig.cache import read_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.motion import TransmissionError, transmission_error
from gearsig.prepared import circular_correlation
from gearsig.recording import Recording
from gearsig.rig import SIDES, Rig

TOOTH_ERRORS_FILE = Path(__file__).with_name("tooth_errors.npz")
MAX_BYTES = 10_000_000
MAKE_TOOTH_ERRORS = "in a checkout of the project: python -m app.studies.gap.tooth_errors"

CRACK = "root_crack"
SINGLE_TOOTH_FAULTS = (CRACK, "tooth_spall", "chipped_tooth")
"""Causes on a single tooth."""

TOOTH_FAULTS = (*SINGLE_TOOTH_FAULTS, "pitch_error")
"""Causes that each change one engagement with a characteristic profile, which waveforms and encoders distinguish. A
pitch error may affect one tooth or all."""

OTHER = "other"
"""Any change that is no fault of a tooth: another load, wear of all teeth, run-out, noise and torsion of the drive."""

STEPS = 32
"""Steps per pitch."""
WINDOW = 3 * STEPS
"""Steps of the window around a tooth's engagement, with a margin."""
LOWEST_ORDER, HIGHEST_PITCH_ORDER = 3, 8.0
"""Order of the shaft below which events are not searched, where the drive's torsion and a remounted disc act; order per
pitch above which the encoders' resolution dominates."""

STATIC_MESH_HZ = 500.0
"""Mesh frequency f0 at which a static profile counts half, ln L/(1 + f/f0): the faster teeth meet, the more gears and
drive ring. Of 31 faults of the independent rig at 250 to 2800 Hz, profiles learned from two simulators identified 17 of
27 correctly, none with a probability of 0.9 or more; the test was not repeated with three simulators."""

MIN_OVER_NOISE = 1.25
"""Minimum ratio of the event's RMS to the standard error of one value: the loudest window of noise alone, of which the
band keeps half, reaches 0.9."""

LATER, TOWARDS_TIP = 0.6, 0.3
"""Distances in pitches of the middle of a crack's change from the middle of the tooth's pitch: later, and towards the
tip. On three simulated pairs they leave −0.2 to 0.3."""

BOTH_GEARS = 0.9
"""Fraction of the larger change from which the other gear shows it as well."""

ONE_IN = 100.0
"""Largest ratio of the likelihoods of a damaged tooth and of any other change, and of its inverse: encoders' discs have
faults that no simulator draws. Of 1800 other changes of simulators left out none reaches it."""

FAR = 4.3
"""Distance in standard deviations, over all descriptors, at which one known profile counts as much as none, about 0.85
per descriptor: for 3.5 to 5, with simulators left out, statements with a probability of 0.9 are right 95 to 99 times in
100."""


@dataclass(frozen=True)
class ToothErrorChange:
    """The change in the transmission error while the teeth of one gear are in mesh.

    Parameters
    ----------
    side : int
        0: driver, 1: driven gear.
    pattern_um : array, (z, STEPS)
        The change, for each of its teeth in turn.
    mesh_um : array, (STEPS,)
        The part common to all pairs of teeth when the machine was healthy.
    rms_um : float
        Within the window with the most energy.
    noise_um : float
        Standard error of one value.
    """

    side: int
    pattern_um: FloatArray
    mesh_um: FloatArray
    rms_um: float
    noise_um: float

    @property
    def is_clear(self) -> bool:
        """Whether it stands out from the noise."""
        return self.rms_um >= MIN_OVER_NOISE * self.noise_um

    @property
    def place_rev(self) -> float:
        """Middle of the pitch of the tooth that shows it, in revolutions of its gear from angle zero, 0 to 1."""
        start = int(np.argmax(_window_energy(_banded(self.pattern_um, LOWEST_ORDER))))
        size = np.abs(_straightened(np.roll(_banded(self.pattern_um, 0), -start)[:WINDOW]))
        centre = start + float(np.average(np.arange(WINDOW), weights=np.clip(size / size.max() - 0.5, 0.0, None)))
        later = LATER + (TOWARDS_TIP if self.side == 0 else -TOWARDS_TIP)
        return (centre - later * STEPS) / self.pattern_um.size % 1.0


def tooth_error_changes(now: TransmissionError, healthy: TransmissionError) -> list[ToothErrorChange]:
    """Return the change on the gear where it is larger, or on both where they are similar, as with equal teeth.

    Teeth are aligned by the encoder counts, unless another rotation leaves less than half of the difference: encoders
    without an index pulse start anywhere.
    """
    changes = []
    for side in (0, 1):
        after, before = (_resampled((t.driver_um, t.driven_um)[side]) for t in (now, healthy))
        errors = [float(np.mean((t.driver_error_um, t.driven_error_um)[side])) for t in (now, healthy)]
        pattern = after - _turned(before, after)
        mesh_um = _resampled(healthy.mesh_um[None])[0]
        changes.append(ToothErrorChange(side, pattern, mesh_um, event_rms_um(pattern), hypot(*errors)))
    largest_um = max(change.rms_um for change in changes)
    return [change for change in changes if change.rms_um >= BOTH_GEARS * largest_um]


def event_rms_um(pattern_um: FloatArray) -> float:
    """Return the RMS of a change within the window with the most energy."""
    return sqrt(float(_window_energy(_banded(pattern_um, LOWEST_ORDER)).max()) / WINDOW)


def _resampled(rows: FloatArray) -> FloatArray:
    """Return rows of means over equal steps, resampled to `STEPS` per row with the lines common to both."""
    n, m = rows.size, len(rows) * STEPS
    lines = np.fft.rfft(rows.ravel())
    kept = np.zeros(m // 2 + 1, dtype=np.complex128)
    n_kept = min(len(lines), len(kept))
    # Both are sampled at the centres of their steps.
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
    """Return one revolution without its lowest orders and without what encoders cannot resolve, (z STEPS,)."""
    lines = np.fft.rfft(pattern.ravel())
    orders = np.arange(len(lines))
    part = np.cos(0.5 * pi * np.clip(orders / len(pattern) / HIGHEST_PITCH_ORDER, 0.0, 1.0)) ** 2
    banded: FloatArray = np.fft.irfft(lines * np.where(orders < lowest, 0.0, part), pattern.size)
    return banded


def _window_energy(wave: FloatArray) -> FloatArray:
    square = wave**2
    return np.convolve(np.concatenate([square, square[: WINDOW - 1]]), np.ones(WINDOW), "valid")


def tooth_error_descriptors(change: ToothErrorChange) -> FloatArray:
    """Return the profile of the largest event, 26 numbers on a scale that is logarithmic for large values.

    It is read from the root of the damaged tooth to its tip, as contact runs on the driver. The descriptors are: the
    event's fraction of the total energy, and its level over the background; its sign; its width at 20, 50 and 80 % of
    its peak; its spread, skewness and kurtosis in pitches; whether it has a single sign; its steepest rise and fall;
    the places of its centre, start and end relative to the greatest compliance of the healthy pair; its centroid over
    order; its area and swing over the peak; the mean of each quarter from start to end over the peak; whether the
    healthy pair is compliant for less than half a pitch. A crack rises towards the tip; a displaced tooth looks the
    same from both ends; a chip ends where its pair leaves contact, which start and end show better than the centre.
    With tip relief larger than the load's deflection, pairs recede while two of them carry the load: the longer part of
    a pitch then seems compliant, not the shorter.
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
"""Fraction of the peak above which an event lasts: twice what torsion and noise mostly reach beside it."""


def _extent(event: FloatArray) -> tuple[int, int]:
    """Return the first step of the part that contains the peak, 1, and the step after its last."""
    peak, low = int(np.argmax(event)), np.flatnonzero(event <= EXTENT)
    return int(max(low[low < peak], default=-1)) + 1, int(min(low[low > peak], default=len(event)))


def _straightened(event: FloatArray) -> FloatArray:
    """Return a window less the straight line through the quarter pitches at both ends."""
    quarter = STEPS // 4
    at = np.r_[np.arange(quarter), np.arange(WINDOW - quarter, WINDOW)]
    slope, level = np.polyfit(at, event[at], 1)
    straight: FloatArray = event - (slope * np.arange(WINDOW) + level)
    return straight


@dataclass(frozen=True)
class KnownToothErrors:
    """Descriptors of events of known cause, and the likelihood of each cause as a mean of Gaussian kernels.

    L(x | cause) = mean_i exp(−|A (x − x_i)|²/2) + b, A the inverse root of the covariance within faults, b the weight
    of an unknown profile. The depth of a crack, as a percentage q of the root, follows from the RMS change δ, the load
    per face width w and the number of teeth z: ln q = c0 + c1 ln(δ/w) + c2/z ± s, δ in µm, w in N/mm.

    Source: B. W. Silverman, *Density Estimation for Statistics and Data Analysis*, 1986, chapter 4.

    Parameters
    ----------
    descriptors : array, (n, 26)
    causes : array of str, (n,)
        One of `TOOTH_FAULTS`, or `OTHER`.
    depth : array, (4,)
        c0, c1, c2 and the standard deviation s.
    """

    descriptors: FloatArray
    causes: NDArray[np.str_]
    depth: FloatArray

    @cached_property
    def _root(self) -> FloatArray:
        """Aᵀ."""
        within = np.mean([_covariance(self.descriptors[self.causes == name]) for name in TOOTH_FAULTS], axis=0)
        return np.asarray(np.linalg.cholesky(np.linalg.inv(within)))

    @cached_property
    def _scaled(self) -> FloatArray:
        return np.asarray(self.descriptors @ self._root)

    def log_likelihoods(self, descriptors: FloatArray) -> dict[str, float]:
        """Return ln L of each of `TOOTH_FAULTS` and of `OTHER`; equal where the profile is unlike any known one."""
        kernels = np.exp(-0.5 * np.sum((self._scaled - descriptors @ self._root) ** 2, axis=1))
        names = (*TOOTH_FAULTS, OTHER)
        beyond = exp(-0.5 * FAR**2) * len(names) / len(self.causes)
        return {name: log(float(np.mean(kernels[self.causes == name])) + beyond) for name in names}

    def log_percent(self, rms_um: float, load_n_per_mm: float, teeth: int) -> tuple[float, float]:
        """Return ln of a crack's depth in percent of the root, and its standard deviation.

        Parameters
        ----------
        rms_um : float
            The change, see `ToothErrorChange`.
        load_n_per_mm : float
            Normal force on the teeth per face width.
        teeth : int
            Of the cracked gear.
        """
        return float(depth_terms(rms_um, load_n_per_mm, teeth) @ self.depth[:3]), float(self.depth[3])


def depth_terms(rms_um: float, load_n_per_mm: float, teeth: int) -> FloatArray:
    """Return 1, ln(δ/w) and 1/z, of which a crack's ln(depth) is a linear function; see `KnownToothErrors`."""
    return np.array([1.0, log(rms_um / load_n_per_mm), 1.0 / teeth])


SHRINKAGE = 0.2
"""Shrinkage of a covariance towards its diagonal."""


def _covariance(rows: FloatArray) -> FloatArray:
    covariance = np.cov(rows.T)
    return np.asarray((1.0 - SHRINKAGE) * covariance + SHRINKAGE * np.diag(np.diag(covariance) + 1e-6))


@cache
def load_known_tooth_errors() -> KnownToothErrors:
    """Return the events shipped with this version.

    Raises
    ------
    InputError
        If the file is missing or damaged.
    """
    arrays = read_arrays(TOOTH_ERRORS_FILE, MAX_BYTES)
    if arrays is None or not {"descriptors", "causes", "depth"} <= arrays.keys():
        raise InputError(
            "the known changes of transmission errors are missing, damaged or of another version",
            where=TOOTH_ERRORS_FILE.name,
            remedy=MAKE_TOOTH_ERRORS,
        )
    return KnownToothErrors(arrays["descriptors"].astype(np.float64), arrays["causes"], arrays["depth"])


def has_encoders(recording: Recording) -> bool:
    """Return whether the angles of two shafts were measured."""
    return sum(channel.quantity == "encoder" for channel in recording.channels) > 1


@dataclass(frozen=True)
class ToothErrorEvidence:
    """The evidence from a change in transmission error.

    Parameters
    ----------
    log_likelihoods : mapping
        One of `TOOTH_FAULTS`, or `OTHER` → ln L.
    rms_um : float
        RMS of the change, while the teeth that show it are in mesh.
    gear : str
        Gear that shows it, "driver" or "driven"; empty if not known.
    place_rev : float
        Middle of the pitch of the tooth that shows it, in revolutions of that gear (where it is not known, of the
        driver) from angle zero, 0 to 1.
    """

    log_likelihoods: Mapping[str, float]
    rms_um: float
    gear: str
    place_rev: float = 0.0

    @property
    def probabilities(self) -> dict[str, float]:
        """Return tooth fault → probability if a tooth is damaged, for equal priors, most probable first."""
        levels = np.array([self.log_likelihoods[name] for name in TOOTH_FAULTS])
        shares = dict(zip(TOOTH_FAULTS, softmax(levels).tolist(), strict=True))
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    @property
    def gear_text(self) -> str:
        """The gear that shows it, in words; empty if not known."""
        return {"driver": "the driver", "driven": "the driven gear"}.get(self.gear, "")

    @property
    def odds_of_a_tooth(self) -> float:
        """Likelihood of a damaged tooth over that of any other change, within a factor `ONE_IN` of 1."""
        return exp(_log_mean(self.log_likelihoods) - self.log_likelihoods[OTHER])

    @property
    def is_unlike_any(self) -> bool:
        """Whether the profile is unlike any known one, so that it distinguishes no faults."""
        return max(self.probabilities.values()) < UNLIKE


UNLIKE = 0.3
"""Probability of the most probable of four faults below which they are practically equal."""


def _log_mean(log_likelihoods: Mapping[str, float]) -> float:
    """Return ln L of a damaged tooth, all faults equally likely."""
    return float(logsumexp([log_likelihoods[name] for name in TOOTH_FAULTS])) - log(len(TOOTH_FAULTS))


def mean_log_likelihoods(evidence: Sequence[ToothErrorEvidence]) -> dict[str, float]:
    """Return cause → mean ln L over conditions, which are strongly dependent; empty where there is no evidence."""
    return {
        name: float(np.mean([at_condition.log_likelihoods[name] for at_condition in evidence]))
        for name in (*TOOTH_FAULTS, OTHER)
        if evidence
    }


def tooth_error_evidence(
    recording: Recording, reference: Recording, rig: Rig | None = None
) -> ToothErrorEvidence | None:
    """Return the evidence from a change in transmission error; None where it was not measured.

    Parameters
    ----------
    recording, reference : Recording
        The encoders must be the same, and not moved in between.
    rig : Rig or None
        Of both. None: each recording's own.

    Raises
    ------
    InputError, RefusalError
        If there are encoders, but the transmission error cannot be computed, see `transmission_error`, or did not
        change by more than its noise.
    """
    if not (has_encoders(recording) and has_encoders(reference)):
        return None
    rigs = [rig or measured.rig for measured in (recording, reference)]
    now, healthy = (
        transmission_error(measured, of, pair=of.pairs[0].name if of is not None and of.pairs else "")
        for measured, of in zip((recording, reference), rigs, strict=True)
    )
    largest = tooth_error_changes(now, healthy)
    changes = [change for change in largest if change.is_clear]
    if not changes:
        noise_um = MIN_OVER_NOISE * max(change.noise_um for change in largest)
        raise RefusalError(
            f"the transmission error did not change by more than its noise, {noise_um:.2g} µm rms",
            remedy="finer encoders, or a longer recording, show smaller changes",
        )
    weight = 1.0 / (1.0 + now.mesh_hz / STATIC_MESH_HZ)
    per_gear = [load_known_tooth_errors().log_likelihoods(tooth_error_descriptors(change)) for change in changes]
    log_likelihoods = {
        name: weight * log(float(np.mean([exp(measured[name]) for measured in per_gear]))) for name in per_gear[0]
    }
    odds = float(np.clip(_log_mean(log_likelihoods) - log_likelihoods[OTHER], -log(ONE_IN), log(ONE_IN)))
    log_likelihoods[OTHER] = _log_mean(log_likelihoods) - odds
    clearest = max(changes, key=lambda change: change.rms_um)
    gear = SIDES[changes[0].side] if len(changes) == 1 else ""
    return ToothErrorEvidence(log_likelihoods, clearest.rms_um, gear, (clearest if gear else changes[0]).place_rev)
