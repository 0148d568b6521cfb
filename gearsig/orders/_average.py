"""Time-synchronous averages: mean revolution, standard error and lines; separation of several shafts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np

from gearsig.angle import (
    AngleSignal,
    ShaftAngle,
    check_shaft_angle,
    constant_speed_angle,
    find_shaft_angle,
    resample_to_angle,
    speed_channel_angle,
    times_of_revolutions,
)
from gearsig.checks import ComplexArray, FloatArray, count, freeze, instance_of, listed, not_negative, one_of
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.recording import Channel, Recording
from gearsig.results import Result
from gearsig.rig import known_ratio
from gearsig.spectra import array_rate_hz, check_signal, checked_signal

LineScaling = Literal["amplitude peak", "amplitude rms"]


@dataclass(frozen=True)
class SynchronousAverage(Result, columns=("revolutions", "values", "standard_error")):
    """The mean revolution of a shaft and its standard error.

    Parameters
    ----------
    values : array, (n_angles,)
        Mean over the revolutions, at equal steps of angle from 0 to just under 1 revolution.
    standard_error : array, (n_angles,)
        Standard error of the mean, from the scatter of the revolutions (jackknife over blocks of revolutions).
    n_revolutions : int
        Revolutions averaged.
    shaft, channel, unit : str
    kind : str
        "average"; "residual": without mesh harmonics; "difference": without mesh harmonics and their sidebands, see
        `separate`; "regular": what was removed for the difference; "band-passed mesh": lines around a mesh harmonic;
        "change": the difference from a reference's average.
    highest_order : float
        Orders above it are not in the average.
    """

    values: FloatArray
    standard_error: FloatArray
    n_revolutions: int
    shaft: str
    channel: str
    unit: str
    kind: Literal["average", "residual", "difference", "regular", "band-passed mesh", "change"]
    highest_order: float

    def __post_init__(self) -> None:
        freeze(self, "values", "standard_error")
        if len(self.values) != len(self.standard_error):
            raise InputError(f"{len(self.values)} values, {len(self.standard_error)} standard errors")

    @property
    def revolutions(self) -> FloatArray:
        """Angle of each value, (n_angles,), from 0 to just under 1."""
        return np.arange(len(self.values)) / len(self.values)

    @property
    def highest_line(self) -> int:
        """Highest whole order that is valid in the average."""
        return min(int(self.highest_order + 1e-9), (len(self.values) - 1) // 2)

    def lines(self, scaling: LineScaling = "amplitude peak") -> ComplexArray:
        """Return the complex amplitudes of the shaft's whole orders, (highest_line + 1,).

        With "amplitude peak", A_o = 2/N Σ_m a[m] exp(-2πi o m/N), and the mean A_0 = 1/N Σ_m a[m]; with "amplitude rms"
        all except the mean are divided by √2. The phase is that of the cosine at shaft angle 0.
        """
        return lines_of_revolution(self.values, scaling)[: self.highest_line + 1]


@dataclass(frozen=True)
class AverageLines(Result):
    """Complex lines of a shaft's synchronous averages of several channels, in consecutive parts of a record.

    Parameters
    ----------
    parts : complex array, (n_parts, n_channels, n_orders)
        parts[i, c, o] is the complex amplitude of the shaft's order o in channel c, averaged over part i.
    n_revolutions : array, (n_parts,)
        Revolutions in each part.
    shaft : str
    channels, units : tuples of str
    scaling : str
        See `SynchronousAverage.lines`.
    """

    parts: ComplexArray
    n_revolutions: FloatArray
    shaft: str
    channels: tuple[str, ...]
    units: tuple[str, ...]
    scaling: LineScaling

    def __post_init__(self) -> None:
        freeze(self, "parts", "n_revolutions", ndim=None)
        if self.parts.shape[:2] != (len(self.n_revolutions), len(self.channels)):
            raise InputError(
                f"parts of shape {self.parts.shape} for {len(self.n_revolutions)} parts, {len(self.channels)} channels"
            )

    @property
    def highest_order(self) -> int:
        """Order of the last line."""
        return int(self.parts.shape[2]) - 1

    @property
    def whole(self) -> ComplexArray:
        """Lines of the whole record, (n_channels, n_orders): the mean of the parts, weighted by their revolutions."""
        mean: ComplexArray = np.tensordot(self.n_revolutions / self.n_revolutions.sum(), self.parts, axes=1)
        return mean


def lines_of_revolution(revolution: FloatArray, scaling: LineScaling) -> ComplexArray:
    """Return lines 0 … (N - 1)//2 of periodic waveforms of N samples along the last axis."""
    n = revolution.shape[-1]
    lines: ComplexArray = np.fft.rfft(revolution)[..., : (n - 1) // 2 + 1] * (2.0 / n)
    lines[..., 0] *= 0.5
    if scaling == "amplitude rms":
        lines[..., 1:] /= np.sqrt(2.0)
    return lines


def revolution_of_lines(lines: ComplexArray, n_angles: int, scaling: LineScaling) -> FloatArray:
    """Return the periodic waveform, `n_angles` samples without the mean, of lines 0 … along the last axis."""
    waves = np.array(lines, dtype=np.complex128)
    waves[..., 0] = 0.0
    scale = n_angles / (2.0 if scaling == "amplitude peak" else np.sqrt(2.0))
    values: FloatArray = np.fft.irfft(waves, n_angles) * scale
    return values


def first_whole_sample(signal: AngleSignal) -> tuple[int, int]:
    """Return (index of the first sample that starts a whole revolution, number of that revolution).

    The index is exact if the samples lie on multiples of 1/samples_per_revolution; otherwise it is off by at most half
    a sample.
    """
    per_rev = signal.samples_per_revolution
    first = int(np.ceil(signal.start_revolution - 0.5 / per_rev))
    return round((first - signal.start_revolution) * per_rev), first


def whole_revolutions(signal: AngleSignal, channel: str, *, minimum: int = 1) -> FloatArray:
    """Return a channel as (n_revolutions, samples_per_revolution), without partial revolutions at either end.

    Raises
    ------
    RefusalError
        If there are fewer than `minimum` whole revolutions.
    """
    x = signal.values(channel)
    start, _ = first_whole_sample(signal)
    per_rev = signal.samples_per_revolution
    n_rev = max(0, (len(x) - start) // per_rev)
    if n_rev < minimum:
        raise RefusalError(
            f"only {counted(n_rev, 'whole revolution')} of shaft {signal.shaft_angle.shaft!r}, {minimum} needed",
            remedy="record longer or at a higher speed",
        )
    revolutions: FloatArray = x[start : start + n_rev * per_rev].reshape(n_rev, per_rev)
    return revolutions


def unit_of(signal: AngleSignal, channel: str) -> str:
    """Return the unit of a channel."""
    signal.values(channel)  # raises where there is no such channel
    return signal.units[signal.channel_names.index(channel)]


def block_times(
    signal: AngleSignal, first_sample: int, n_per_block: int, step: int, n_blocks: int
) -> tuple[FloatArray, FloatArray]:
    """Return (time of the middle in s, mean speed in rpm) of blocks of an angle signal, (n_blocks,) each."""
    per_rev = signal.samples_per_revolution
    start = signal.start_revolution + first_sample / per_rev
    length = n_per_block / per_rev
    begin, middle, end = (
        times_of_revolutions(signal.shaft_angle, start + part * length, step / per_rev, n_blocks)
        for part in (0.0, 0.5, 1.0)
    )
    return middle, 60.0 * length / (end - begin)


def over_angle(
    signal: AngleSignal | Recording | FloatArray,
    channel_or_rate_hz: str | float,
    shaft: str,
    shaft_angle: ShaftAngle | None,
    speed_rpm: float | FloatArray | None,
) -> tuple[AngleSignal, str]:
    """Return (a channel over a shaft's angle, its name) from any signal that `synchronous_average` accepts."""
    check_signal(signal, AngleSignal | Recording)
    instance_of(shaft, str, "shaft")
    if isinstance(signal, AngleSignal):
        if shaft not in ("", signal.shaft_angle.shaft) or shaft_angle is not None or speed_rpm is not None:
            raise InputError(
                f"the signal is already over the angle of shaft {signal.shaft_angle.shaft!r}",
                where="shaft",
                allowed="no other",
            )
        return signal, str(channel_or_rate_hz)
    recording, name = as_recording(signal, channel_or_rate_hz)
    angle = angle_of(recording, shaft_angle, speed_rpm)
    if shaft not in ("", angle.shaft):
        angle = angle.of_shaft(shaft, known_ratio(recording.rig, shaft, to=angle.shaft))
    return resample_to_angle(recording, angle, channels=[name]), name


def as_recording(signal: Recording | FloatArray, channel_or_rate_hz: str | float) -> tuple[Recording, str]:
    """Return (a recording, the channel's name) from a recording and channel, or from an array and its rate in Hz."""
    check_signal(signal)
    if isinstance(signal, Recording):
        return signal, signal.channel_names[signal.index(str(channel_or_rate_hz))]
    rate_hz = array_rate_hz(channel_or_rate_hz, "channel")
    return Recording(checked_signal(signal)[None], rate_hz, (Channel("signal"),)), "signal"


def angle_of(recording: Recording, shaft_angle: ShaftAngle | None, speed_rpm: float | FloatArray | None) -> ShaftAngle:
    """Return the given shaft angle, or the one that follows from the given speed or from the recording."""
    if shaft_angle is not None and speed_rpm is not None:
        raise InputError("both shaft_angle and speed_rpm are given", remedy="leave one of them out")
    if shaft_angle is not None:
        check_shaft_angle(shaft_angle)
        return shaft_angle
    if speed_rpm is None:
        if recording.speed_source is None and recording.rig is None:
            raise InputError("the shaft's speed is not known", remedy="give speed_rpm, or shaft_angle")
        return find_shaft_angle(recording)
    if np.ndim(speed_rpm) == 0:
        rpm: Any = speed_rpm
        return constant_speed_angle(not_negative(rpm, "speed_rpm", "rpm"), recording.duration_s)
    if np.shape(speed_rpm) != (recording.n_samples,):
        raise InputError(
            f"speed_rpm has shape {np.shape(speed_rpm)}",
            allowed=f"one number, or one for each of {recording.n_samples} samples",
        )
    return speed_channel_angle(np.asarray(speed_rpm), recording.sampling_rate_hz)


def synchronous_average(
    signal: AngleSignal | Recording | FloatArray,
    channel: str | float,
    *,
    shaft: str = "",
    shaft_angle: ShaftAngle | None = None,
    speed_rpm: float | FloatArray | None = None,
    n_jackknife_blocks: int = 32,
) -> SynchronousAverage:
    """Return the mean over whole revolutions of a shaft, with its standard error.

    a(θ) = 1/N Σ_r x(θ + r). Over N revolutions, the shaft's whole orders stay, noise falls as 1/√N, and order o is
    multiplied by |sin(πNo)/(N sin πo)|: other shafts' orders fall as 1/N, but vanish only if N·o is whole.

    Parameters
    ----------
    signal : AngleSignal, Recording or array, (n_samples,)
        An AngleSignal is averaged over the shaft whose angle it was resampled to.
    channel : str or float
        The channel's name, or an array's sampling rate in Hz.
    shaft : str
        For a recording: the shaft to average over; default: that of the angle.
    shaft_angle : ShaftAngle or None
        For a recording or an array; default: the angle that `gearsig.angle.find_shaft_angle` finds in the recording.
    speed_rpm : float, array, (n_samples,), or None
        Instead of the angle: the speed, constant or at each sample.
    n_jackknife_blocks : int
        At least 2. Revolutions are grouped into this many blocks (or as many as there are revolutions) before their
        scatter is taken, so that correlation between neighbouring revolutions does not make the error too small.

    Returns
    -------
    SynchronousAverage
        From shaft angle 0, in the channel's unit, with the standard error of the mean at each angle; its `lines` are
        the complex amplitudes of the shaft's orders.

    Raises
    ------
    RefusalError
        With fewer than two whole revolutions, or if the speed is not known.
    InputError
        On an unknown channel or shaft.

    References
    ----------
    P. D. McFadden, "A revised model for the extraction of periodic waveforms by time domain averaging", 1987.
    S. Braun, "The synchronous (time domain) average revisited", 2011.
    M. H. Quenouille, "Notes on bias in estimation", 1956 (jackknife).
    """
    count(n_jackknife_blocks, "n_jackknife_blocks", minimum=2)
    signal, channel = over_angle(signal, channel, shaft, shaft_angle, speed_rpm)
    revolutions = whole_revolutions(signal, channel, minimum=2)
    mean, standard_error = mean_and_error(revolutions, n_jackknife_blocks)
    return SynchronousAverage(
        values=mean,
        standard_error=standard_error,
        n_revolutions=len(revolutions),
        shaft=signal.shaft_angle.shaft,
        channel=channel,
        unit=unit_of(signal, channel),
        kind="average",
        highest_order=signal.highest_order,
    )


def mean_and_error(revolutions: FloatArray, n_blocks: int) -> tuple[FloatArray, FloatArray]:
    """Return the mean over rows and its standard error by the delete-one-block jackknife.

    With B blocks, block sums s_b of n_b rows out of N: m_(b) = (Σs - s_b)/(N - n_b),
    SE² = (B - 1)/B Σ_b (m_(b) - mean of m_(b))².
    """
    n = len(revolutions)
    blocks = _blocks(n, min(n, n_blocks))
    # Row blocks are summed one by one to avoid a double-precision copy of the whole signal.
    sums = np.stack([revolutions[block].sum(axis=0, dtype=np.float64) for block in blocks])
    total = sums.sum(axis=0)
    without = (total - sums) / np.array([n - (block.stop - block.start) for block in blocks])[:, None]
    standard_error: FloatArray = np.sqrt((len(blocks) - 1.0) * without.var(axis=0))
    mean: FloatArray = total / n
    return mean, standard_error


def _blocks(n_revolutions: int, n_blocks: int) -> list[slice]:
    """Return slices of consecutive blocks of revolutions, of nearly equal length."""
    edges = np.linspace(0, n_revolutions, n_blocks + 1).round().astype(int)
    return [slice(int(i), int(j)) for i, j in pairwise(edges)]


def average_lines(
    signal: AngleSignal,
    channels: Sequence[str] | None = None,
    *,
    n_parts: int = 1,
    weighting: Literal["equal", "hann"] = "equal",
    scaling: LineScaling = "amplitude peak",
    highest_order: float | None = None,
) -> AverageLines:
    """Return the complex lines of a shaft's synchronous averages for several channels and parts of the record.

    a(θ) = Σ_r w_r x(θ + r)/Σ w_r over the revolutions of each part, then its Fourier transform at whole orders.

    Parameters
    ----------
    signal : AngleSignal
        Over the angle of the shaft in question; see `separate_shafts` for shafts with close orders.
    channels : sequence of str or None
        Default: all channels of the signal.
    n_parts : int
        Number of consecutive parts with (nearly) equally many whole revolutions: 2 for halves, more for a jackknife.
    weighting : str
        "equal", or "hann" for w_r = sin²(π(r + 1/2)/N): another shaft's order that lies d orders from a whole one then
        leaks as 1/(N d)³ instead of 1/(N d), and noise grows by 1.8 dB.
    scaling : str
        See `SynchronousAverage.lines`.
    highest_order : float or None
        Highest order of the lines; default: the signal's, up to which they are valid. `inf`: all that its samples hold.

    Returns
    -------
    AverageLines

    Raises
    ------
    RefusalError
        With fewer whole revolutions than parts.
    InputError
        On an unknown channel, weighting or scaling.
    """
    count(n_parts, "n_parts")
    one_of(weighting, "weighting", ("equal", "hann"))
    one_of(scaling, "scaling", get_args(LineScaling))
    _check_angle_signals([signal], "signal")
    names = listed(channels, "channels", str) if channels is not None else signal.channel_names
    per_rev = signal.samples_per_revolution
    limit = signal.highest_order if highest_order is None else highest_order
    highest = int(min(limit + 1e-9, (per_rev - 1) // 2))
    rows = []
    for name in names:
        revolutions = whole_revolutions(signal, name, minimum=n_parts)
        blocks = _blocks(len(revolutions), n_parts)
        means = np.stack([_weighted_mean(revolutions[block], weighting) for block in blocks])
        rows.append(lines_of_revolution(means, scaling)[:, : highest + 1])
    return AverageLines(
        parts=np.stack(rows, axis=1),
        n_revolutions=np.array([float(block.stop - block.start) for block in blocks]),
        shaft=signal.shaft_angle.shaft,
        channels=names,
        units=tuple(unit_of(signal, name) for name in names),
        scaling=scaling,
    )


def _weighted_mean(revolutions: FloatArray, weighting: str) -> FloatArray:
    n = len(revolutions)
    if weighting == "equal":
        return np.asarray(revolutions.mean(axis=0, dtype=np.float64))
    weights = np.sin(np.pi * (np.arange(n) + 0.5) / n) ** 2
    return np.asarray((weights / weights.sum()) @ revolutions)


# Several shafts at once, so that the periodic part of one does not leak into the average of another.


@dataclass(frozen=True)
class SeparatedShafts(Result):
    """A signal separated into the periodic parts of several meshing shafts.

    Parameters
    ----------
    signals : tuple of AngleSignal
        Over the angle of each shaft, without the periodic parts of the others except the mesh: input for
        `synchronous_average` and `average_lines`.
    residual : AngleSignal
        Over the first shaft's angle, without the periodic parts of all shafts.
    """

    signals: tuple[AngleSignal, ...]
    residual: AngleSignal


def separate_shafts(signals: Sequence[AngleSignal], teeth: Sequence[int]) -> SeparatedShafts:
    """Separate the periodic parts of several meshing shafts from each other, and from the residual.

    Alternating projections (Gauss–Seidel on the normal equations of x(θ) = a1(θ) + a2(θ z1/z2) + … + residual): from
    each shaft's signal, the averages of the others are subtracted in turn before it is averaged.

    Parameters
    ----------
    signals : sequence of AngleSignal
        The same record and channels over the angle of each shaft; all angles count from the same instant.
    teeth : sequence of int
        Teeth of the gear on each shaft; all share one mesh frequency, as in a pair or a train of idlers. Mesh harmonics
        stay in all signals; other orders common to several shafts go to the first of them.

    Returns
    -------
    SeparatedShafts

    Raises
    ------
    InputError
        If the numbers of signals and teeth differ, or the channels differ.
    RefusalError
        If a signal has no whole revolution.
    """
    signals = _check_angle_signals(signals, "signals")
    teeth = [count(z, f"teeth[{k}]") for k, z in enumerate(listed(teeth, "teeth", object))]
    if len(signals) != len(teeth) or len({signal.channel_names for signal in signals}) != 1:
        raise InputError("signals and teeth do not belong together", allowed="one gear per signal, the same channels")
    separated = [np.array(signal.samples, dtype=np.float64) for signal in signals]
    residual = separated[0].copy()
    for row, name in enumerate(signals[0].channel_names):
        means: list[FloatArray | None] = [None] * len(signals)
        for _ in range(3):  # few revolutions separate close orders badly: each pass squares the relative leak
            for k, signal in enumerate(signals):
                separated[k][row] = signal.samples[row]
                for j, mean in enumerate(means):
                    if j != k and mean is not None:
                        separated[k][row] -= _at(_without_mesh(mean, teeth[j]), _places(signal) * teeth[k] / teeth[j])
                means[k] = whole_revolutions(replace(signal, samples=separated[k]), name).mean(axis=0)
        for j, mean in enumerate(means):
            assert mean is not None  # noqa: S101 - there is at least one pass
            periodic = mean if j == 0 else _without_mesh(mean, teeth[j])
            residual[row] -= _at(periodic, _places(signals[0]) * teeth[0] / teeth[j])
    shaft_signals = tuple(replace(signal, samples=samples) for signal, samples in zip(signals, separated, strict=True))
    return SeparatedShafts(shaft_signals, replace(signals[0], samples=residual))


def _check_angle_signals(signals: Sequence[AngleSignal], name: str) -> tuple[AngleSignal, ...]:
    remedy = "gearsig.resample_to_angle(recording, shaft_angle) makes one"
    return listed(signals, name, AngleSignal, remedy=remedy)


def _without_mesh(revolution: FloatArray, teeth: int) -> FloatArray:
    lines = np.fft.rfft(revolution)
    lines[::teeth] = 0.0
    return np.asarray(np.fft.irfft(lines, len(revolution)))


def _places(signal: AngleSignal) -> FloatArray:
    """Return the shaft's angle at each sample, in revolutions."""
    n = signal.samples_per_revolution
    places: FloatArray = (np.arange(signal.samples.shape[1]) + round(signal.start_revolution * n)) / n
    return places


def _at(revolution: FloatArray, place_rev: FloatArray) -> FloatArray:
    """Return a periodic waveform at arbitrary angles, by cubic splines through oversampled points."""
    from scipy.ndimage import map_coordinates

    n = 2 * len(revolution)  # cubic splines through twice the points are accurate to 10⁻³ at the highest order
    fine = np.fft.irfft(np.fft.rfft(revolution), n) * 2
    values: FloatArray = map_coordinates(fine, [place_rev * n % n], order=3, mode="grid-wrap")
    return values
