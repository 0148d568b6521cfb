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
from dataclasses import dataclass, field, replace
from functools import cache, cached_property
from itertools import pairwise
from math import exp, gcd, hypot, inf, log, log10, pi, sqrt
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.special import logsumexp, ndtr, softmax

from gearsig.cache import read_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import odds_text
from gearsig.motion import TransmissionError, transmission_error
from gearsig.prepared import circular_correlation
from gearsig.recording import Recording
from gearsig.rig import SIDES, Rig
from gearsig.severity._features import ReferenceRefusalError

TOOTH_ERRORS_FILE = Path(__file__).with_name("tooth_errors.npz")
MAX_BYTES = 10_000_000
MAKE_TOOTH_ERRORS = "in a checkout of the project: python -m app.studies.gap.tooth_errors"

CRACK = "root_crack"
SINGLE_TOOTH_FAULTS = (CRACK, "tooth_spall", "chipped_tooth")
"""Causes on a single tooth."""

TOOTH_FAULTS = (*SINGLE_TOOTH_FAULTS, "pitch_error")
"""Causes that each change one engagement with a characteristic profile, which waveforms distinguish. A pitch error may
affect one tooth or all."""

OTHER = "other"
"""Any change that is no fault of single teeth: another load, wear, run-out or uneven pitch of all teeth, noise."""

OF_ALL_TEETH = ("pitch_error", OTHER)
"""Causes with one likelihood, see `KnownToothErrors.log_likelihoods`, although a pitch error may be of one tooth."""

STEPS = 32
"""Steps per pitch."""
WINDOW = 3 * STEPS
"""Steps of the window around a tooth's engagement, with a margin."""
LOWEST_ORDER, HIGHEST_PITCH_ORDER = 3, 8.0
"""Order of the shaft below which events are not searched, where the drive's torsion and a remounted disc act; order per
pitch above which the encoders' resolution dominates."""

STATIC_MESH_HZ = 500.0
"""Mesh frequency f0 at which a static profile counts half, ln L/(1 + f/f0): the faster teeth meet, the more gears and
drive ring. Of 46 faults of the independent rig at 270 to 2700 Hz, 22 are identified correctly, two with a probability
of 0.9 or more."""

MIN_OVER_NOISE = 2.0
"""Minimum ratio of the event's RMS to the standard error of one value; the loudest windows of 1200 revolutions of white
noise reach 1.7."""

TOWARDS_TIP = 0.3
"""Distance in pitches of the middle of a crack's change from the middle of the tooth's contact, towards the tip."""

MAX_SIZE_ERROR = 0.3
"""Largest standard error of the event's size over the revolutions, relative to it: an impact that does not turn with
the gear, as of a bearing, is averaged over few revolutions to an event of which each revolution shows another part."""

BOTH_GEARS = 0.9
"""Fraction of the larger change from which the other gear shows it as well."""

ONE_IN = 100.0
"""Largest ratio of the static likelihoods of a damaged tooth and of any other change, and of its inverse: encoders'
discs have faults that no simulator draws. Of 1800 other changes of simulators left out one reaches it."""

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
        The part common to all pairs of teeth, which one damaged tooth hardly changes.
    rms_um : float
        Within the window with the most energy.
    noise_um : float
        Standard error of one value, in the band in which events are searched.
    size_error : float
        Standard error of the event's size over the revolutions, relative to it.
    """

    side: int
    pattern_um: FloatArray
    mesh_um: FloatArray
    rms_um: float
    noise_um: float
    size_error: float = 0.0

    @property
    def is_clear(self) -> bool:
        """Whether it stands out from the noise."""
        return self.rms_um >= MIN_OVER_NOISE * self.noise_um

    @property
    def is_repeated(self) -> bool:
        """Whether all revolutions show it."""
        return self.size_error <= MAX_SIZE_ERROR

    @property
    def place_rev(self) -> float:
        """Middle of the contact of the tooth that shows it, in revolutions of its gear from angle zero, 0 to 1."""
        start, _ = _event(_banded(self.pattern_um, LOWEST_ORDER))
        size = np.abs(_straightened(np.roll(_banded(self.pattern_um, 0), -start)[:WINDOW]))
        centre = start + float(np.average(np.arange(WINDOW), weights=np.clip(size / size.max() - 0.5, 0.0, None)))
        later = TOWARDS_TIP if self.side == 0 else -TOWARDS_TIP
        return (centre - later * STEPS) / self.pattern_um.size % 1.0


def tooth_error_changes(now: TransmissionError, healthy: TransmissionError) -> list[ToothErrorChange]:
    """Return the change on the gear where it is larger, or on both where they are similar, as with equal teeth.

    Teeth are aligned by the encoder counts, unless another rotation leaves less than half of the difference: encoders
    without an index pulse start anywhere. Where the teeth of one gear are a multiple of the other's, a change of the
    smaller gear also repeats on the larger one, while a change of the larger one is diluted on the smaller.
    """
    changes: list[ToothErrorChange] = []
    after_both, before_both = _patterns_um(now), _patterns_um(healthy)
    residuals = _residual_um(now), _residual_um(healthy)
    mesh_um = _resampled(now.mesh_um[None])[0]  # the reference's angles may start elsewhere
    for side in (0, 1):
        after, before = after_both[side], before_both[side]
        turn = _turn(before, after)
        pattern = after - np.roll(before, turn)
        noise_um = hypot(*(_noise_um(residual, now.teeth[side]) for residual in residuals))
        first = [(t.first_pitch, t.first_driven_pitch)[side] * STEPS for t in (now, healthy)]
        size_error = hypot(
            _size_error(residuals[0], pattern, first[0]), _size_error(residuals[1], pattern, first[1] + turn)
        )
        changes.append(ToothErrorChange(side, pattern, mesh_um, event_rms_um(pattern), noise_um, size_error))
    largest_um = max(change.rms_um for change in changes)
    similar = [change for change in changes if change.rms_um >= BOTH_GEARS * largest_um]
    smaller, larger = sorted(now.teeth)
    if len(similar) > 1 and smaller < larger and larger % smaller == 0:
        return [min(similar, key=lambda change: len(change.pattern_um))]
    return similar


def _patterns_um(error: TransmissionError) -> list[FloatArray]:
    """Return, for each gear, all that it repeats, (z, STEPS).

    What both gears repeat, because their teeth have a common divisor g, `TransmissionError` divides evenly. One damaged
    tooth is its cause, so that the other gear's part is added: its mean over every g-th tooth.
    """
    patterns, ahead = (error.driver_um, error.driven_um), error.first_driven_pitch - error.first_pitch
    divisor = gcd(*error.teeth)
    repeated = [rows.reshape(-1, divisor, rows.shape[1]).mean(axis=0) for rows in patterns]
    complete = []
    for side, turned in ((0, -ahead), (1, ahead)):
        added = np.tile(np.roll(repeated[1 - side], turned, axis=0), (error.teeth[side] // divisor, 1))
        complete.append(_resampled(patterns[side] + added))
    return complete


def _residual_um(error: TransmissionError) -> FloatArray:
    """Return what no gear repeats, (n_cycles, STEPS), as large as if the patterns had not been fitted to it."""
    n_rows, n_fitted = len(error.cycles_um), sum(error.teeth) - gcd(*error.teeth)
    return _resampled(error.residual_um) * sqrt(n_rows / max(n_rows - n_fitted, 1))


def _noise_um(residual_um: FloatArray, teeth: int) -> float:
    """Return the standard error of one value of a gear's pattern, in the band in which events are searched."""
    n_revolutions = len(residual_um) / teeth
    return float(np.std(_banded(residual_um, LOWEST_ORDER, n_revolutions))) / sqrt(n_revolutions)


def event_rms_um(pattern_um: FloatArray) -> float:
    """Return the RMS of a change within the window around it."""
    return sqrt(_event(_banded(pattern_um, LOWEST_ORDER))[1] / WINDOW)


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


def _turn(before: FloatArray, after: FloatArray) -> int:
    """Return by how many steps the pattern of the healthy gear has to be rolled."""
    x, y = after.ravel(), before.ravel()
    turns = [0, *np.argsort(-circular_correlation(x, y))[:5].tolist()]
    differences = [
        float(np.median(np.abs(_banded((x - np.roll(y, t)).reshape(after.shape), LOWEST_ORDER)))) for t in turns
    ]
    best = int(np.argmin(differences))
    return turns[best] if 2.0 * differences[best] < differences[0] else 0


def _size_error(residual_um: FloatArray, pattern_um: FloatArray, first_step: int) -> float:
    """Return the standard error of an event's size over the revolutions of a recording, relative to it.

    The size in revolution p is ⟨x_p, e⟩/⟨e, e⟩ with the event e in its window and x_p the recording there, whose first
    value is at this step of the pattern.
    """
    rest, wave = residual_um.ravel(), _banded(pattern_um, LOWEST_ORDER)
    start, energy = _event(wave)
    begin = (start - first_step) % wave.size
    begins = np.arange(begin, rest.size - WINDOW + 1, wave.size)
    if len(begins) < 2 or energy == 0.0:
        return inf
    sizes = sliding_window_view(rest, WINDOW)[begins] @ np.roll(wave, -start)[:WINDOW] / energy
    return float(np.std(sizes, ddof=1)) / sqrt(len(sizes))


def _banded(pattern: FloatArray, lowest: int, n_revolutions: float = 1.0) -> FloatArray:
    """Return revolutions without the lowest orders and without what encoders cannot resolve, (n_pitches STEPS,)."""
    lines = np.fft.rfft(pattern.ravel())
    orders = np.arange(len(lines)) / n_revolutions
    per_pitch = np.arange(len(lines)) / len(pattern)
    part = np.cos(0.5 * pi * np.clip(per_pitch / HIGHEST_PITCH_ORDER, 0.0, 1.0)) ** 2
    banded: FloatArray = np.fft.irfft(lines * np.where(orders < lowest, 0.0, part), pattern.size)
    return banded


def _event(wave: FloatArray) -> tuple[int, float]:
    """Return the first step of the window around the largest event, and the energy in it.

    Energy is weighted towards the middle: without weights, each window that holds a short event has as much of it, and
    most hold it at an edge.
    """
    square = wave**2
    weighted = np.convolve(np.concatenate([square, square[: WINDOW - 1]]), np.hanning(WINDOW + 2)[1:-1], "valid")
    start = int(np.argmax(weighted))
    return start, float(np.roll(square, -start)[:WINDOW].sum())


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
    start, energy = _event(wave)
    background = float(np.median(np.roll(wave, -start)[WINDOW:] ** 2)) if len(wave) > WINDOW else 0.0
    over = 10.0 * log10(max(energy / WINDOW, 1e-12) / max(background, 1e-12))
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
            energy / max(float(np.sum(wave**2)), 1e-24),
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
    reach : array, (3, 2)
        Lowest and highest load per face width and module, in N/mm²; numbers of teeth; crack depths in percent.
    """

    descriptors: FloatArray
    causes: NDArray[np.str_]
    depth: FloatArray
    reach: FloatArray

    @cached_property
    def _root(self) -> FloatArray:
        """Aᵀ."""
        within = np.mean([_covariance(self.descriptors[self.causes == name]) for name in TOOTH_FAULTS], axis=0)
        return np.asarray(np.linalg.cholesky(np.linalg.inv(within)))

    @cached_property
    def _scaled(self) -> FloatArray:
        return np.asarray(self.descriptors @ self._root)

    def log_likelihoods(self, descriptors: FloatArray) -> dict[str, float]:
        """Return ln L of each of `TOOTH_FAULTS` and of `OTHER`; equal where the profile is unlike any known one.

        Uneven pitch of all teeth and run-out differ in degree only. On the independent rig, eccentric and misaligned
        gears look like pitch errors as much as pitch errors do, so that these two have one likelihood, their mean.
        """
        kernels = np.exp(-0.5 * np.sum((self._scaled - descriptors @ self._root) ** 2, axis=1))
        names = (*TOOTH_FAULTS, OTHER)
        beyond = exp(-0.5 * FAR**2) * len(names) / len(self.causes)
        means = {name: float(np.mean(kernels[self.causes == name])) for name in names}
        means |= dict.fromkeys(OF_ALL_TEETH, float(np.mean([means[name] for name in OF_ALL_TEETH])))
        return {name: log(mean + beyond) for name, mean in means.items()}

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

    def check_reach(self, load_n_per_mm2: float, teeth: int, percent: float) -> None:
        """Refuse a crack unlike those that are known.

        Raises
        ------
        RefusalError
        """
        named = {
            "a load per face width and module of {} N/mm²": load_n_per_mm2,
            "{} teeth": float(teeth),
            "a crack through {} % of the root": percent,
        }
        lowest, highest = self.reach.T * [[1.0, 1.0, 0.0], [1.0, 1.0, 1.0]]  # shallower cracks are alike
        for (name, value), low, high in zip(named.items(), lowest, highest, strict=True):
            if not low <= value <= high:
                raise RefusalError(
                    f"{name.format(f'{value:.3g}')} is beyond the known cracks, {low:.3g} to {high:.3g}",
                    remedy="judge by the vibration",
                )


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
    if arrays is None or not {"descriptors", "causes", "depth", "reach"} <= arrays.keys():
        raise InputError(
            "the known changes of transmission errors are missing, damaged or of another version",
            where=TOOTH_ERRORS_FILE.name,
            remedy=MAKE_TOOTH_ERRORS,
        )
    descriptors = arrays["descriptors"].astype(np.float64)
    return KnownToothErrors(descriptors, arrays["causes"], arrays["depth"], arrays["reach"])


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
    weight : float
        How much a static profile counts at this speed, 0 to 1; ln L includes it.
    rms_um : float
        RMS of the change while the teeth that show it are in mesh; where nothing shows, the smallest that would.
    places_rev : mapping
        "driver" or "driven" → middle of the contact of the tooth that shows it, in revolutions of that gear from its
        encoder's zero, 0 to 1; one gear, both where they show it alike, none where nothing shows.
    passes_s : mapping
        The same gears → a time at which that place passes, by which other sources of the angle find it.
    """

    log_likelihoods: Mapping[str, float]
    weight: float
    rms_um: float
    places_rev: Mapping[str, float]
    passes_s: Mapping[str, float] = field(default_factory=dict)

    @property
    def probabilities(self) -> dict[str, float]:
        """Return fault → probability if a single tooth is damaged, for equal priors, most probable first."""
        levels = np.array([self.log_likelihoods[name] for name in SINGLE_TOOTH_FAULTS])
        shares = dict(zip(SINGLE_TOOTH_FAULTS, softmax(levels).tolist(), strict=True))
        return dict(sorted(shares.items(), key=lambda item: -item[1]))

    @property
    def is_seen(self) -> bool:
        """Whether the transmission error changed by more than its noise."""
        return bool(self.places_rev)

    @property
    def gear(self) -> str:
        """The gear that shows it, "driver" or "driven"; empty if both do, or none."""
        return next(iter(self.places_rev)) if len(self.places_rev) == 1 else ""

    @property
    def odds_of_a_tooth(self) -> float:
        """Likelihood of a single damaged tooth, its faults equally likely, over that of any other change.

        The factor lies within `ONE_IN` of 1; that of one fault may be three times as large.
        """
        return exp(_log_mean(self.log_likelihoods) - self.log_likelihoods[OTHER])

    @property
    def distinguishes_faults(self) -> bool:
        """Whether the profile makes one fault of a tooth likelier than another."""
        return max(self.probabilities.values()) >= UNLIKE

    def with_load(self, load_n_per_mm: float, teeth: Sequence[int]) -> ToothErrorEvidence:
        """Return the evidence where load and teeth are known: a crack cannot be deeper than the root.

        Parameters
        ----------
        load_n_per_mm : float
            Normal force on the teeth per face width.
        teeth : sequence of int
            Of driver and driven gear.
        """
        if not (self.is_seen and load_n_per_mm > 0.0):
            return self
        known = load_known_tooth_errors()
        depths = [known.log_percent(self.rms_um, load_n_per_mm, teeth[SIDES.index(gear)]) for gear in self.places_rev]
        within = max(float(ndtr((log(100.0) - mean) / spread)) for mean, spread in depths)
        crack = self.log_likelihoods[CRACK] + self.weight * log(max(within, 1.0 / ONE_IN))
        return replace(self, log_likelihoods={**self.log_likelihoods, CRACK: crack})

    @property
    def text(self) -> str:
        """What the encoders show, in one sentence or two."""
        if not self.is_seen:
            finer = "Finer encoders, or a longer recording, show smaller changes."
            changed = f"By the encoders, no tooth changed the transmission error by {self.rms_um:.2g} µm rms or more"
            return f"{changed}. {finer}"
        where = {"driver": " on the driver", "driven": " on the driven gear"}.get(self.gear, "")
        changed = f"By the encoders, the transmission error changed by {self.rms_um:.2g} µm rms where it changed most"
        odds, other = self.odds_of_a_tooth, "wear, run-out, uneven pitch or another load"
        if 1.0 / UNDECIDED < odds < UNDECIDED and not self.distinguishes_faults:
            if self.weight >= 0.5:
                return f"{changed}{where}, which resembles no known fault."
            return f"{changed}{where}, which resembles no known fault: at this speed the drive oscillates too. {SLOWER}"
        if odds <= 1.0 / UNDECIDED:
            return f"{changed}{where}, {1.0 / odds:.0f} times as likely with {other} as with a damaged tooth."
        if odds < UNDECIDED:
            return f"{changed}{where}, as likely with a damaged tooth as with {other}."
        faults = [f"{FAULT_WORDS[name]} {odds_text(p)}" for name, p in self.probabilities.items() if p >= 0.05]
        which = f" A damaged tooth would be {', '.join(faults)}." if self.distinguishes_faults else ""
        return f"{changed}{where}, {odds:.0f} times as likely with a damaged tooth as with {other}.{which}"


UNLIKE = 0.4
"""Probability of the most probable of three faults below which they are practically equal."""
UNDECIDED = 3.0
"""Odds, and their inverse, within which a change is as likely with a damaged tooth as without."""
SLOWER = "At a few revolutions per second or less its profile distinguishes crack, spall and chip."
FAULT_WORDS = {CRACK: "cracked", "tooth_spall": "spalled", "chipped_tooth": "chipped"}


def _log_mean(log_likelihoods: Mapping[str, float]) -> float:
    """Return ln L of a single damaged tooth, its faults equally likely."""
    levels = [log_likelihoods[name] for name in SINGLE_TOOTH_FAULTS]
    return float(logsumexp(levels)) - log(len(levels))


def combined_evidence(evidences: Sequence[ToothErrorEvidence]) -> ToothErrorEvidence | None:
    """Return the evidence of several operating points, ln L = w_max Σ ln L_i/Σ w_i; None where there is none.

    They show the same teeth, so that they are dependent: the static likelihoods are averaged, each with the weight of
    its speed, and count as much as at the slowest.
    """
    if not evidences:
        return None
    seen = [evidence for evidence in evidences if evidence.is_seen] or evidences
    weights = np.array([evidence.weight for evidence in seen])
    largest = float(weights.max())
    clearest = max(seen, key=lambda evidence: evidence.rms_um)
    log_likelihoods = {
        name: largest * float(np.sum([evidence.log_likelihoods[name] for evidence in seen]) / weights.sum())
        for name in (*TOOTH_FAULTS, OTHER)
    }
    return replace(clearest, log_likelihoods=log_likelihoods, weight=largest)


def tooth_error_evidence(
    recording: Recording, reference: Recording, rig: Rig | None = None, *, pair: str = ""
) -> ToothErrorEvidence | None:
    """Return the evidence from a change in transmission error; None where neither recording has encoders.

    Parameters
    ----------
    recording, reference : Recording
        The encoders must be the same, and not moved in between.
    rig : Rig or None
        Of both. None: each recording's own.
    pair : str
        Name of the gear pair; default: the first.

    Raises
    ------
    InputError, RefusalError
        If only one has encoders, the transmission error cannot be computed, see `transmission_error`, or changed in
        some revolutions only, or the wrong way round.
    """
    of_both = has_encoders(recording), has_encoders(reference)
    if not any(of_both):
        return None
    if not all(of_both):
        which = "recording" if of_both[0] else "reference"
        raise RefusalError(f"only the {which} has encoders on two shafts", remedy="record both with the same encoders")
    rigs = [rig or measured.rig for measured in (recording, reference)]
    now, healthy = (
        transmission_error(measured, of, pair=pair or (of.pairs[0].name if of is not None and of.pairs else ""))
        for measured, of in zip((recording, reference), rigs, strict=True)
    )
    largest = tooth_error_changes(now, healthy)
    clear = [change for change in largest if change.is_clear]
    weight = 1.0 / (1.0 + max(now.mesh_hz, healthy.mesh_hz) / STATIC_MESH_HZ)
    if not clear:
        smallest_um = MIN_OVER_NOISE * max(change.noise_um for change in largest)
        return ToothErrorEvidence(dict.fromkeys((*TOOTH_FAULTS, OTHER), 0.0), weight, smallest_um, {})
    changes = [change for change in clear if change.is_repeated]
    if not changes:
        raise RefusalError(
            f"the transmission error changed by {clear[0].rms_um:.2g} µm rms, but not alike in all revolutions",
            remedy="record more revolutions; something else on the machine may cause it, such as a bearing",
        )
    known = load_known_tooth_errors()
    per_gear = [known.log_likelihoods(tooth_error_descriptors(change)) for change in changes]
    static = {name: log(float(np.mean([exp(of_gear[name]) for of_gear in per_gear]))) for name in per_gear[0]}
    _check_direction(changes, static, known)
    odds = float(np.clip(_log_mean(static) - static[OTHER], -log(ONE_IN), log(ONE_IN)))
    static |= dict.fromkeys(OF_ALL_TEETH, _log_mean(static) - odds)
    return ToothErrorEvidence(
        {name: weight * value for name, value in static.items()},
        weight,
        max(change.rms_um for change in changes),
        {SIDES[change.side]: change.place_rev for change in changes},
        {SIDES[change.side]: _pass_s(now, change) for change in changes},
    )


def _pass_s(error: TransmissionError, change: ToothErrorChange) -> float:
    """Return the time, in the middle of the recording, at which the place of a change passes."""
    teeth, first = error.teeth[change.side], (error.first_pitch, error.first_driven_pitch)[change.side]
    row = (change.place_rev * teeth - 0.5 - first) % teeth
    row += teeth * max(round((0.5 * len(error.time_s) - row) / teeth), 0)
    return float(np.interp(row, np.arange(len(error.time_s)), error.time_s))


def _check_direction(
    changes: Sequence[ToothErrorChange], log_likelihoods: Mapping[str, float], known: KnownToothErrors
) -> None:
    """Refuse recordings that seem to be exchanged: a crack, spall or chip always lets the driven gear lag."""
    likeliest = max(log_likelihoods.values())
    for change in changes:
        exchanged = known.log_likelihoods(tooth_error_descriptors(replace(change, pattern_um=-change.pattern_um)))
        if max(exchanged[name] for name in SINGLE_TOOTH_FAULTS) - likeliest > log(CLEARLY_A_TOOTH):
            raise ReferenceRefusalError(
                "by the encoders, a tooth seems to be damaged in the reference, not in the recording",
                remedy="swap both if they were exchanged, or take a reference of healthy gears",
            )


CLEARLY_A_TOOTH = 20.0
"""Odds of a damaged tooth from which the encoders alone show one."""
