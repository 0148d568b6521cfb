"""From a recording to its sums over blocks of revolutions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.orders import first_whole_sample
from gearsig.prepared import has_mark
from gearsig.recording import Recording
from gearsig.rig import GearPair, Rig

# --------------------
# The gear pair under study, with every order counted on its driver's shaft.
# --------------------


DRIVER, DRIVEN = 0, 1


@dataclass(frozen=True)
class BearingFrame:
    """A bearing's orders, in cycles per revolution of the driver.

    Parameters
    ----------
    name : str
    side : int
        0: on the driver's shaft; 1: on the driven one.
    outer, inner, spin, cage : float
        BPFO, BPFI, BSF, FTF; nan where not known.
    """

    name: str
    side: int
    outer: float
    inner: float
    spin: float
    cage: float


@dataclass(frozen=True)
class GearFrame:
    """A spur gear pair with its shafts and bearings.

    Parameters
    ----------
    pair : GearPair
    shafts : (str, str)
        Of driver and driven gear.
    teeth : (int, int)
    bearings : tuple of BearingFrame
    """

    pair: GearPair
    shafts: tuple[str, str]
    teeth: tuple[int, int]
    bearings: tuple[BearingFrame, ...]

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of either shaft per revolution of the driver."""
        return 1.0, self.teeth[0] / self.teeth[1]


def gear_frame(rig: Rig) -> GearFrame:
    """Return the frame of a rig's only gear pair.

    Raises
    ------
    RefusalError
        If there is no pair or more than one, or its teeth are not known.
    """
    remedy = "describe one pair with both tooth counts in the rig file"
    if len(rig.pairs) != 1:
        have = "no gear pair" if not rig.pairs else f"{len(rig.pairs)} gear pairs"
        raise RefusalError(f"the rig has {have}; the models have one", remedy=remedy)
    pair = rig.pairs[0]
    if pair.driver_teeth is None or pair.driven_teeth is None:
        raise RefusalError(f"the teeth of pair {pair.name!r} are not known", remedy=remedy)
    teeth = (pair.driver_teeth, pair.driven_teeth)
    shafts = (pair.driver, pair.driven)
    orders = (1.0, teeth[0] / teeth[1])
    bearings = []
    for bearing in rig.bearings:
        if bearing.shaft not in shafts:
            continue
        side = shafts.index(bearing.shaft)
        own = {name: order * orders[side] for name, order in bearing.orders().items()}
        nan = float("nan")
        bearings.append(
            BearingFrame(bearing.name, side, *(own.get(name, nan) for name in ("BPFO", "BPFI", "BSF", "FTF")))
        )
    return GearFrame(pair, shafts, teeth, tuple(bearings))


# --------------------
# What a recording is reduced to: sums over blocks of revolutions, of which every feature is made.
# --------------------


ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True)
class ChannelSums:
    """Sums of one channel, one row per block; leaving a row out gives the jackknife's replicate.

    Parameters
    ----------
    lines : (array, array)
        (n_blocks, n_orders) complex amplitudes (peak) of the blocks' averages of driver and driven gear.
    counts : (array, array)
        (n_blocks,) revolutions in each average.
    residual_power : array, (n_blocks, n_orders)
        Power spectrum, over order of the driver, of what neither shaft repeats.
    envelope_power : array, (n_blocks, n_bands, n_cycles)
        Power spectrum of the residual's squared envelope in each band, over its squared mean.
    moments : array, (n_blocks, n_bands, 2)
        Mean square and mean fourth power of the residual in each band.
    tail : array, (n_blocks, 3)
        Of the raw signal: mean square, mean fourth power, share of samples close to the extreme.
    """

    lines: tuple[ComplexArray, ComplexArray]
    counts: tuple[FloatArray, FloatArray]
    residual_power: FloatArray
    envelope_power: FloatArray
    moments: FloatArray
    tail: FloatArray

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return len(self.residual_power)

    def without(self, block: int) -> ChannelSums:
        """Return the sums with one block left out."""
        keep = np.arange(self.n_blocks) != block
        return replace(
            self,
            lines=(self.lines[0][keep], self.lines[1][keep]),
            counts=(self.counts[0][keep], self.counts[1][keep]),
            residual_power=self.residual_power[keep],
            envelope_power=self.envelope_power[keep],
            moments=self.moments[keep],
            tail=self.tail[keep],
        )


@dataclass(frozen=True)
class ReducedRecording:
    """One recording, reduced.

    Parameters
    ----------
    frame : GearFrame
    channels : mapping of str to ChannelSums
    order_step : float
        Between the lines of `residual_power`, in orders of the driver.
    cycle_step : float
        Between the lines of `envelope_power`, in orders of the driver.
    bands_hz : tuple of (float, float)
        Of `envelope_power` and `moments`.
    highest_order : float
        Of the driver, up to which lines are true.
    speed_hz : float
        Mean frequency of the driver.
    speed : tuple of float
        What the speed does; see `gearsig.gap`.
    hum : tuple of float
        Mains lines; see `gearsig.gap`.
    marks : (bool, bool)
        Whether angle 0 of driver and driven shaft is a mark on that shaft.
    n_revolutions : float
        Of the driver.
    known : list
        What `gearsig.gap.whole_and_parts` found; it is asked for again and again.
    """

    frame: GearFrame
    channels: dict[str, ChannelSums]
    order_step: float
    cycle_step: float
    bands_hz: tuple[tuple[float, float], ...]
    highest_order: float
    speed_hz: float
    speed: tuple[float, ...]
    hum: tuple[float, ...]
    marks: tuple[bool, bool]
    n_revolutions: float
    known: list[tuple[tuple[str, ...], FloatArray]] = field(default_factory=list, compare=False, repr=False)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return next(iter(self.channels.values())).n_blocks

    def without(self, block: int) -> ReducedRecording:
        """Return the recording with one block of revolutions left out."""
        return self.with_channels({name: sums.without(block) for name, sums in self.channels.items()})

    def with_channels(self, channels: dict[str, ChannelSums]) -> ReducedRecording:
        """Return the recording with other sums."""
        return replace(self, channels=channels, known=[])


# --------------------
# Synchronous averages of both shafts of a gear pair at once: what one repeats does not leak into the other's.
# --------------------


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


# --------------------
# Lines of the electric supply, at their frequency whatever the speed.
# --------------------


SUPPLIES_HZ = (50.0, 60.0)
N_HARMONICS = 3
_TOLERANCE = 0.002  # how far a supply's frequency wanders
_NEIGHBOURHOOD_HZ = 8.0
_N_SHAFT_HARMONICS = 8
_APART = 20.0
"""Widths between a shaft's orders from which they can be told from the supply in four places of five."""


def mains_lines(recording: Recording, names: Sequence[str], speed_hz: float, frame: GearFrame) -> tuple[float, ...]:
    """Return, for each supply, the mean excess in dB of its harmonics over the neighbourhood, on the best channel.

    Harmonics that fall on a line of the gears are left out; 0 where none is left.
    """
    return tuple(
        max(_excess(recording.values(name), recording, supply, speed_hz, frame) for name in names)
        for supply in SUPPLIES_HZ
    )


def _excess(values: FloatArray, recording: Recording, supply_hz: float, speed_hz: float, frame: GearFrame) -> float:
    n = len(values)
    x = np.asarray(values, dtype=np.float64)
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(n))) ** 2
    step = recording.sampling_rate_hz / n
    found = []
    for k in range(1, N_HARMONICS + 1):
        frequency = k * supply_hz
        width = max(2.0 * step, _TOLERANCE * frequency)
        if frequency + _NEIGHBOURHOOD_HZ > recording.sampling_rate_hz / 2 or _on_a_gear_line(
            frequency, width, speed_hz, frame
        ):
            continue
        positions = np.arange(len(power)) * step
        line = np.abs(positions - frequency) <= width
        around = (np.abs(positions - frequency) <= _NEIGHBOURHOOD_HZ) & (np.abs(positions - frequency) > 2.0 * width)
        found.append(10.0 * np.log10(power[line].max() / max(float(np.median(power[around])), 1e-300)))
    return float(np.mean(found)) if found else 0.0


def _on_a_gear_line(frequency_hz: float, width_hz: float, speed_hz: float, frame: GearFrame) -> bool:
    """Whether a frequency falls on a mesh harmonic or a shaft's order.

    Of a slow shaft only the first orders count, which are strong: all of them lie everywhere.
    """
    shafts_hz = [order * speed_hz for order in frame.shaft_orders]
    told = [hz for hz in shafts_hz if hz >= _APART * width_hz or round(frequency_hz / hz) <= _N_SHAFT_HARMONICS]
    return any(_to_a_multiple(frequency_hz, hz) < 2.0 * width_hz for hz in (frame.teeth[0] * speed_hz, *told))


def _to_a_multiple(frequency_hz: float, of_hz: float) -> float:
    """Return the distance to the nearest multiple, from 1 on."""
    return abs(max(round(frequency_hz / of_hz), 1) * of_hz - frequency_hz)


# --------------------
# What the speed does besides standing still: figures of the shaft angle.
# --------------------


SPEED_FIGURES = ("drift", "swing", "swing_line", "swing_frequency_hz")
"""Relative linear change; relative rms about it; ratio of its strongest line to the others; that line's frequency."""

HIGHEST_SHAFT_ORDER = 2
"""Of each other shaft, that is taken out of the speed: a run-out shakes the speed at its shaft's orders."""


def speed_figures(angle: ShaftAngle, other_shafts: Sequence[float] = ()) -> tuple[float, ...]:
    """Return `SPEED_FIGURES` of a shaft's speed, taken once per revolution.

    Faster changes belong to the shaft's orders and are left to the vibration; so do those at other shafts' orders,
    which once a revolution look slower than they are.

    Parameters
    ----------
    angle : ShaftAngle
    other_shafts : sequence of float
        Their revolutions per revolution of this one.
    """
    n = int(angle.n_revolutions)
    time = np.linspace(angle.start_s, angle.end_s, 8 * n + 1)
    revolutions = angle.revolutions_at(time)
    whole = np.interp(np.arange(np.ceil(revolutions[0]), np.floor(revolutions[-1]) + 1), revolutions, time)
    speed = 1.0 / np.diff(whole)
    middle = 0.5 * (whole[1:] + whole[:-1])
    slope, level = np.polyfit(middle - middle.mean(), speed, 1)
    rest = (speed - level - slope * (middle - middle.mean())) / level
    rest = _without_cycles(rest, tuple(_cycles_per_revolution(other_shafts, len(rest))))
    window = np.hanning(len(rest) + 2)[1:-1]
    power = np.abs(np.fft.rfft(rest * window, 4 * len(rest)))[1:] ** 2
    strongest = int(np.argmax(power))
    typical = float(np.median(power)) / np.log(2.0)
    return (
        float(slope * (middle[-1] - middle[0]) / level),
        float(np.std(rest)),
        float(power[strongest] / max(typical, 1e-30)),
        float((strongest + 1) / (4 * len(rest)) * level),
    )


def _cycles_per_revolution(other_shafts: Sequence[float], n: int) -> Iterator[float]:
    """Yield the shafts' orders as they look once a revolution, 0 to 1/2; not those as slow as the record is long."""
    for ratio in other_shafts:
        for order in range(1, HIGHEST_SHAFT_ORDER + 1):
            cycles = abs(order * ratio - round(order * ratio))
            if cycles > 2.0 / n:
                yield cycles


def _without_cycles(rest: FloatArray, cycles: Sequence[float]) -> FloatArray:
    """Return a signal without the best-fitting sine at each of some frequencies, in cycles per sample."""
    if not cycles:
        return rest
    phase = 2.0 * np.pi * np.outer(np.arange(len(rest)), cycles)
    waves = np.hstack([np.cos(phase), np.sin(phase)])
    left: FloatArray = rest - waves @ np.linalg.lstsq(waves, rest, rcond=None)[0]
    return left


LEAST_REVOLUTIONS = 16
"""Of the driver and of the driven gear: fewer leave either shaft's orders in the other's average."""

REVOLUTIONS_PER_BLOCK = 20
FEWEST_BLOCKS, MOST_BLOCKS = 4, 8
"""Blocks long enough to tell bearing orders from shaft orders, and enough of them for a jackknife."""

N_BANDS = 4
LOWEST_BAND_HZ = 300.0
HIGHEST_CYCLE, BEYOND_THE_MESH = 40.0, 5.0
"""Modulation orders are looked at up to here, in orders of the driver, or to so many beyond the mesh order."""

NEAR_THE_EXTREME = 0.005
"""A sample within this share of the largest magnitude counts as close to it."""


def reduce_recording(
    recording: Recording, rig: Rig, channels: Sequence[str] = (), angle: ShaftAngle | None = None
) -> ReducedRecording:
    """Reduce a recording to what the features need.

    Parameters
    ----------
    recording : Recording
    rig : Rig
        With one gear pair.
    channels : sequence of str
        Default: all vibration channels.
    angle : ShaftAngle or None
        Of the rig's reference shaft; None: found as `analyze` finds it.

    Raises
    ------
    RefusalError
        If the speed cannot be known, there are too few revolutions, or the mesh lies above what is sampled.
    """
    frame = gear_frame(rig)
    turned = angle if angle is not None else _angle_of(recording, rig)
    shaft_angles = tuple(_of_shaft(turned, rig, shaft) for shaft in frame.shafts)
    for own in shaft_angles:
        if own.n_revolutions < LEAST_REVOLUTIONS:
            raise RefusalError(
                f"shaft {own.shaft!r} turns {own.n_revolutions:.3g} times in the record, "
                f"{LEAST_REVOLUTIONS} are needed",
                remedy="record longer",
            )
    names = tuple(channels) or recording.vibration_names()
    signals = tuple(_over_angle(recording, own, names) for own in shaft_angles)
    n_blocks = int(np.clip(shaft_angles[0].n_revolutions // REVOLUTIONS_PER_BLOCK, FEWEST_BLOCKS, MOST_BLOCKS))
    speed_hz = shaft_angles[0].mean_speed_rpm / 60.0
    _check_mesh(signals[0], frame, recording, speed_hz)
    bands = _bands(recording.sampling_rate_hz, signals[0].samples_per_revolution * speed_hz)
    sums, steps = {}, (0.0, 0.0)
    for i, name in enumerate(names):
        sums[name], steps = _channel_sums(signals, i, recording.values(name), frame, n_blocks, bands, speed_hz)
    return ReducedRecording(
        frame=frame,
        channels=sums,
        order_step=steps[0],
        cycle_step=steps[1],
        bands_hz=bands,
        highest_order=signals[0].highest_order,
        speed_hz=speed_hz,
        speed=speed_figures(shaft_angles[0], frame.shaft_orders[1:]),
        hum=mains_lines(recording, names, speed_hz, frame),
        marks=tuple(has_mark(recording, rig, shaft) for shaft in frame.shafts),  # type: ignore[arg-type]  # two
        n_revolutions=shaft_angles[0].n_revolutions,
    )


def _check_mesh(signal: AngleSignal, frame: GearFrame, recording: Recording, speed_hz: float) -> None:
    """Refuse a record that was sampled too slowly to hold the mesh and its sidebands, which all is compared with."""
    if signal.highest_order < frame.teeth[0] + max(frame.shaft_orders):
        mesh_hz = frame.teeth[0] * speed_hz
        raise RefusalError(
            f"the gears mesh at {mesh_hz:.4g} Hz, above what {recording.sampling_rate_hz:.6g} Hz of sampling rate show",
            remedy=f"sample at {4.0 * mesh_hz:.2g} Hz at least",
        )


def _angle_of(recording: Recording, rig: Rig) -> ShaftAngle:
    from gearsig.prepared import phase_followed_angle, refined_angle

    angle = phase_followed_angle(recording, rig, refined_angle(recording, rig))
    return angle.between(0.0, recording.duration_s)


def _of_shaft(angle: ShaftAngle, rig: Rig, shaft: str) -> ShaftAngle:
    ratio = rig.ratio(shaft, to=angle.shaft or rig.reference_shaft)
    if ratio is None:
        raise RefusalError(f"the speed of shaft {shaft!r} does not follow from the teeth", remedy="complete the rig")
    return angle if ratio == 1.0 else angle.of_shaft(shaft, ratio)


def _over_angle(recording: Recording, angle: ShaftAngle, names: Sequence[str]) -> AngleSignal:
    from gearsig.angle import resample_to_angle

    return resample_to_angle(recording, angle, channels=names)


def _bands(sampling_rate_hz: float, angle_rate_hz: float) -> tuple[tuple[float, float], ...]:
    """Bands of equal relative width, then all of them together."""
    top = 0.42 * min(sampling_rate_hz, angle_rate_hz)
    low = min(LOWEST_BAND_HZ, top / 8.0)
    edges = [low * (top / low) ** (i / N_BANDS) for i in range(N_BANDS + 1)]
    return (*pairwise(edges), (low, top))


def _channel_sums(
    signals: tuple[AngleSignal, ...],
    channel: int,
    raw: FloatArray,
    frame: GearFrame,
    n_blocks: int,
    bands: Sequence[tuple[float, float]],
    speed_hz: float,
) -> tuple[ChannelSums, tuple[float, float]]:
    joint = joint_averages(signals, channel, frame)
    lines, counts = [], []
    for revolutions in joint.revolutions:
        edges = np.linspace(0, len(revolutions), n_blocks + 1).round().astype(np.intp)
        averages = np.stack([revolutions[i:j].mean(axis=0) for i, j in pairwise(edges)])
        lines.append(2.0 * np.fft.rfft(averages, axis=1) / averages.shape[1])
        counts.append(np.diff(edges).astype(np.float64))
    n = signals[0].samples_per_revolution
    power, order_step = _segment_power(joint.residual, n, n_blocks)
    highest_cycle = min(max(HIGHEST_CYCLE, frame.teeth[0] + BEYOND_THE_MESH), 0.4 * n)
    envelopes, moments, cycle_step = _envelopes(joint.residual, n, n_blocks, bands, speed_hz, highest_cycle)
    sums = ChannelSums((lines[0], lines[1]), (counts[0], counts[1]), power, envelopes, moments, _tail(raw, n_blocks))
    return sums, (order_step, cycle_step)


def _segment_power(values: FloatArray, rate: float, n_segments: int) -> tuple[FloatArray, float]:
    """Return the Hann power spectra (mean square per line) of equal segments and the lines' distance."""
    from scipy.fft import rfft

    length = len(values) // n_segments
    segments = values[: length * n_segments].reshape(n_segments, length)
    window = np.hanning(length + 1)[:-1]
    spectrum = rfft((segments - segments.mean(axis=1, keepdims=True)) * window, axis=1)
    power: FloatArray = 2.0 * np.abs(spectrum) ** 2 / (length * np.sum(window**2))
    return power, rate / length


def _envelopes(
    residual: FloatArray,
    n_per_rev: int,
    n_blocks: int,
    bands: Sequence[tuple[float, float]],
    speed_hz: float,
    highest_cycle: float,
) -> tuple[FloatArray, FloatArray, float]:
    """Return spectra of squared envelopes over their squared mean, the bands' moments, and the spectra's step."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(residual)
    lines = rfft(residual)
    m = 2 * next_fast_len(int(highest_cycle * n / n_per_rev) + 1)
    powers, moments, step = [], [], 0.0
    for low, high in bands:
        first, last = (int(f / speed_hz * n / n_per_rev) for f in (low, high))
        square = _squared_envelope(lines[first : min(last, len(lines) - 1)], n)
        # |z|² is low-passed to the modulation orders of interest by keeping its first lines.
        slow_lines = np.zeros(m // 2 + 1, dtype=np.complex128)
        kept = rfft(square)[: m // 2 + 1] * (m / len(square))
        slow_lines[: len(kept)] = kept
        slow = irfft(slow_lines, m)
        power, step = _segment_power(slow / max(slow.mean(), 1e-300), m / n * n_per_rev, n_blocks)
        powers.append(power)
        edges = np.linspace(0, len(square), n_blocks + 1).astype(np.intp)
        # With z the analytic signal: E x² = E|z|²/2, E x⁴ = 3/8 E|z|⁴.
        moments.append([[square[i:j].mean() / 2.0, 0.375 * (square[i:j] ** 2).mean()] for i, j in pairwise(edges)])
    return np.stack(powers, axis=1), np.asarray(moments).transpose(1, 0, 2), step


def _squared_envelope(band: NDArray[np.complex128], n: int) -> FloatArray:
    """Return |z|² of a band of lines of n samples, at just the rate that it needs: twice the band's width."""
    from scipy.fft import ifft, next_fast_len

    m = next_fast_len(2 * len(band) + 1)
    z = ifft(2.0 * band, m) * (m / n)
    square: FloatArray = z.real**2 + z.imag**2
    return square


def _tail(raw: FloatArray, n_blocks: int) -> FloatArray:
    values = np.asarray(raw, dtype=np.float64) - float(np.mean(raw))
    top, bottom = values.max(), values.min()
    near = (values > top - NEAR_THE_EXTREME * abs(top)) | (values < bottom + NEAR_THE_EXTREME * abs(bottom))
    edges = np.linspace(0, len(values), n_blocks + 1).astype(np.intp)
    return np.array(
        [[(values[i:j] ** 2).mean(), (values[i:j] ** 4).mean(), near[i:j].mean()] for i, j in pairwise(edges)]
    )
