"""Reduction of a recording to sums over blocks of revolutions."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import gcd
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gearsig import orders
from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.prepared import MAINS_TOLERANCE, PreparedRecording, prepare
from gearsig.recording import MAINS_HZ, Recording, metres_per_second_squared
from gearsig.rig import GearPair, Rig
from gearsig.severity import orders_from_mesh
from gearsig.spectra import BEYOND_THE_ENDS, reflected_ends

# --------------------
# The gear pair under study; all orders refer to its driver's shaft.
# --------------------


DRIVER, DRIVEN = 0, 1


@dataclass(frozen=True)
class BearingFrame:
    """A bearing's orders, in cycles per revolution of the driver.

    Parameters
    ----------
    name : str
    side : int
        0: on the driver's shaft; 1: on the driven shaft.
    outer, inner, spin, cage : float
        BPFO, BPFI, BSF and FTF; nan where not known.
    """

    name: str
    side: int
    outer: float
    inner: float
    spin: float
    cage: float

    @property
    def families(self) -> dict[str, float]:
        """Family of lines → its order; for balls twice the spin, since a defect strikes both races."""
        return {"outer": self.outer, "inner": self.inner, "ball": 2.0 * self.spin, "cage": self.cage}


@dataclass(frozen=True)
class GearFrame:
    """A spur gear pair with its shafts and bearings.

    Parameters
    ----------
    pair : GearPair
    shafts : (str, str)
        Names of the driver's and the driven gear's shaft.
    teeth : (int, int)
    bearings : tuple of BearingFrame
    background : tuple of float
        Orders of a machine's other pairs and shafts per revolution of the driver, see `background_orders`.
    """

    pair: GearPair
    shafts: tuple[str, str]
    teeth: tuple[int, int]
    bearings: tuple[BearingFrame, ...]
    background: tuple[float, ...] = ()

    @property
    def shaft_orders(self) -> tuple[float, float]:
        """Revolutions of either shaft per revolution of the driver."""
        return 1.0, self.teeth[0] / self.teeth[1]


def shaft_text(frame: GearFrame, side: int) -> str:
    """Return a shaft in words, for example "the input shaft" or "shaft 2"."""
    name = frame.shafts[side]
    if "shaft" in name.lower():
        return name
    return f"the {name} shaft" if name.replace(" ", "").isalpha() else f"shaft {name}"


def gear_frame(rig: Rig) -> GearFrame:
    """Return the frame of a rig's first gear pair, the one under study; other pairs are background.

    Raises
    ------
    RefusalError
        If there is no pair, or its numbers of teeth are not known.
    """
    remedy = "describe one pair with both tooth counts in the rig file"
    if not rig.pairs:
        raise RefusalError("the rig has no gear pair", remedy=remedy)
    pair = rig.pairs[0]
    if pair.driver_teeth is None or pair.driven_teeth is None:
        raise RefusalError(f"the teeth of pair {pair.name!r} are not known", remedy=remedy)
    teeth = (pair.driver_teeth, pair.driven_teeth)
    shafts = (pair.driver, pair.driven)
    ratios = (1.0, teeth[0] / teeth[1])
    bearings = []
    for bearing in rig.bearings:
        if bearing.shaft in shafts:
            side, known = shafts.index(bearing.shaft), bearing.orders()
            per_driver = (known.get(name, float("nan")) * ratios[side] for name in ("BPFO", "BPFI", "BSF", "FTF"))
            bearings.append(BearingFrame(bearing.name, side, *per_driver))
    return GearFrame(pair, shafts, teeth, tuple(bearings), background_orders(rig))


N_BACKGROUND_HARMONICS, N_BACKGROUND_SIDEBANDS, N_BACKGROUND_ORDERS = 20, 2, 4
"""Harmonics of another pair's mesh, sidebands of each at either of its shafts, and orders of another shaft."""


def background_orders(rig: Rig) -> tuple[float, ...]:
    """Return the orders of a rig's pairs other than the first, per revolution of the first one's driver, ascending.

    They are mesh harmonics with sidebands at both of a pair's shafts, and the first orders of shafts that do not belong
    to the first pair. Pairs whose ratio or teeth are not known are skipped, as their orders are not known.
    """
    if len(rig.pairs) < 2:
        return ()
    first, *further_pairs = rig.pairs
    line_orders: set[float] = set()
    for pair in further_pairs:
        mesh = rig.mesh_order(pair, first.driver)
        turns = [rig.ratio(shaft, to=first.driver) for shaft in (pair.driver, pair.driven)]
        for shaft, ratio in zip((pair.driver, pair.driven), turns, strict=True):
            if ratio is not None and shaft not in (first.driver, first.driven):
                line_orders |= {k * ratio for k in range(1, N_BACKGROUND_ORDERS + 1)}
        if mesh is None:
            continue
        offsets = {0.0} | {
            sign * k * ratio
            for ratio in turns
            if ratio is not None
            for k in range(1, N_BACKGROUND_SIDEBANDS + 1)
            for sign in (-1, 1)
        }
        line_orders |= {k * mesh + step for k in range(1, N_BACKGROUND_HARMONICS + 1) for step in offsets}
    shaft_ratios = (1.0, rig.ratio(first.driven, to=first.driver) or 1.0)
    steps = np.array([k * ratio for ratio in shaft_ratios for k in range(-SMOOTH_SIDEBANDS, SMOOTH_SIDEBANDS + 1)])
    teeth = float(first.driver_teeth or np.inf)

    def is_own(order: float) -> bool:
        offsets = order - steps
        return bool(np.min(np.abs(offsets - teeth * np.maximum(np.round(offsets / teeth), 1.0))) < INSEPARABLE_ORDERS)

    return tuple(sorted(order for order in line_orders if order > 0.0 and not is_own(order)))


INSEPARABLE_ORDERS = 0.03
"""Distance in orders from the first pair's mesh harmonics and first sidebands below which two lines cannot be separated
in a hundred revolutions; such lines are kept."""


# --------------------
# The reduced recording: sums over blocks of revolutions, from which all features are computed.
# --------------------


ComplexArray = NDArray[np.complex128]

N_MESH_HARMONICS = 6
NOMINAL_REVOLUTIONS = 64.0
BY_CHANCE = 1e-3
SMOOTH_SIDEBANDS, SMOOTH_SHAFT_ORDERS = 2, 3
"""Sidebands on either side of mesh lines, and first shaft orders, that eccentricity causes."""
MIN_APART = 3
"""Minimum spacing of the orders that both shafts share, for these to be removed."""


@dataclass(frozen=True)
class ChannelSums:
    """Sums of one channel, with one row per block.

    Parameters
    ----------
    lines : (array, array)
        (n_blocks, n_orders) complex amplitudes (peak) of the blocks' averages, for driver and driven gear.
    counts : (array, array)
        (n_blocks,) number of revolutions in each average.
    residual_power : array, (n_blocks, n_orders)
        Power spectrum over order of the driver of the residual, which neither shaft repeats.
    envelope_power : array, (n_blocks, n_bands, n_cycles)
        Power spectrum of the residual's squared envelope in each band, over its squared mean.
    moments : array, (n_blocks, n_bands, 2)
        Mean square and mean fourth power of the residual in each band.
    tail : array, (n_blocks, 3)
        Mean square, mean fourth power and fraction of samples close to the extreme, of the raw signal.
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

    def of_blocks(self, kept: NDArray[np.bool_] | slice) -> ChannelSums:
        """Return the sums over some of the blocks."""
        (driver, driven), (n_driver, n_driven) = self.lines, self.counts
        further = (self.residual_power, self.envelope_power, self.moments, self.tail)
        return ChannelSums(
            (driver[kept], driven[kept]), (n_driver[kept], n_driven[kept]), *(rows[kept] for rows in further)
        )


@dataclass(frozen=True)
class ShaftAverage:
    """The synchronous average of one shaft in one channel.

    Parameters
    ----------
    lines : complex array, (n_orders,)
        Complex amplitudes (peak) of its orders, from 0 on.
    scatter : array, (n_orders,)
        Power in each line due to its scatter over the blocks.
    n_blocks : int
    n_revolutions : float
    teeth, other_teeth : int
        Of its gear, and of the mating gear.
    highest : int
        Highest valid order.
    """

    lines: ComplexArray
    scatter: FloatArray
    n_blocks: int
    n_revolutions: float
    teeth: int
    other_teeth: int
    highest: int

    @cached_property
    def noise(self) -> FloatArray:
        """Noise power in each line."""
        # The scatter of one line over few blocks is uncertain, so neighbouring lines are averaged.
        return np.maximum(smooth_power(self.scatter), 1e-300)

    @cached_property
    def excess(self) -> FloatArray:
        """Power of the lines in excess of noise."""
        return np.maximum(np.abs(self.lines) ** 2 - self.noise, 0.0)

    @property
    def longer(self) -> float:
        """Length of the record relative to `NOMINAL_REVOLUTIONS`; at least 1."""
        return max(1.0, self.n_revolutions / NOMINAL_REVOLUTIONS)

    @cached_property
    def power(self) -> FloatArray:
        """Power of the lines over a floor that does not depend on the record's length.

        The noise contained in |a|² is subtracted, and that of `NOMINAL_REVOLUTIONS` is added. An absent line thus has
        the same value in all records of at least that length.
        """
        return self.excess + self.longer * self.noise

    @property
    def mesh_lines(self) -> FloatArray:
        """Power of the visible ones among the first mesh harmonics."""
        return self.power[self.teeth : N_MESH_HARMONICS * self.teeth + 1 : self.teeth][: self.highest // self.teeth]

    @cached_property
    def mesh_power(self) -> float:
        """Total power of the mesh harmonics."""
        return float(self.mesh_lines.sum())

    @cached_property
    def is_synchronous(self) -> NDArray[np.bool_]:
        """Which lines keep their phase from block to block, as a shaft's own lines do and leakage does not.

        |a|² is compared with the power of the same line's scatter over the blocks, an F test with 2 and 2(B − 1)
        degrees of freedom; a fraction `BY_CHANCE` of noise lines passes.
        """
        degrees = max(self.n_blocks - 1, 1)
        # The F distribution with 2 and 2m degrees has P(F > f) = (1 + f/m)^(−m).
        threshold = degrees * (BY_CHANCE ** (-1.0 / degrees) - 1.0)
        held: NDArray[np.bool_] = np.abs(self.lines) ** 2 > threshold * self.scatter
        return held

    def residual(self, lines: ComplexArray | None = None) -> ComplexArray:
        """Return its lines, or others over the same orders, without mesh harmonics, first sidebands and shaft orders.

        Orders shared with the other shaft are removed, too, unless most are shared: they depend on which teeth meet.
        """
        source_lines = self.lines if lines is None else lines
        orders = np.arange(len(source_lines))
        near = orders_from_mesh(orders, self.teeth) <= SMOOTH_SIDEBANDS
        out = near | (orders <= SMOOTH_SHAFT_ORDERS) | (orders > self.highest)
        apart = self.teeth // gcd(self.teeth, self.other_teeth)
        if apart >= MIN_APART:
            out |= orders % apart == 0
        kept: ComplexArray = np.where(out, 0.0, source_lines)
        return kept

    @cached_property
    def pattern(self) -> ComplexArray:
        """The component in which teeth differ: the residual over the mesh harmonics' amplitude."""
        pattern: ComplexArray = self.residual() / np.sqrt(self.mesh_power)
        return pattern


def smooth_power(power: FloatArray) -> FloatArray:
    """Return the mean of each line and its four neighbours on either side."""
    smooth: FloatArray = np.convolve(np.pad(power, 4, mode="edge"), np.ones(9) / 9.0, mode="valid")
    return smooth


@dataclass(frozen=True)
class ReducedRecording:
    """One recording, reduced.

    Parameters
    ----------
    frame : GearFrame
    channels : mapping of str to ChannelSums
    order_step : float
        Spacing of the lines of `residual_power`, in orders of the driver.
    cycle_step : float
        Spacing of the lines of `envelope_power`, in orders of the driver.
    bands_hz : tuple of (float, float)
        Bands of `envelope_power` and `moments`.
    highest_order : float
        Order of the driver up to which lines are valid.
    speed_hz : float
        Mean frequency of the driver.
    speed : SpeedFigures
    hum : tuple of float
        Excess of each mains supply's lines, see `mains_lines`.
    marks : (bool, bool)
        Whether angle 0 of driver and driven shaft is a mark on that shaft.
    n_revolutions : float
        Revolutions of the driver.
    kept : dict
        Cache of derived quantities, which are used repeatedly.
    """

    frame: GearFrame
    channels: dict[str, ChannelSums]
    order_step: float
    cycle_step: float
    bands_hz: tuple[tuple[float, float], ...]
    highest_order: float
    speed_hz: float
    speed: SpeedFigures
    hum: tuple[float, ...]
    marks: tuple[bool, bool]
    n_revolutions: float
    kept: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def n_blocks(self) -> int:
        """Number of blocks."""
        return next(iter(self.channels.values())).n_blocks

    @property
    def fewest_revolutions(self) -> float:
        """Number of revolutions of the slower shaft."""
        return self.n_revolutions * min(self.frame.shaft_orders)

    def of_blocks(self, kept: NDArray[np.bool_] | slice) -> ReducedRecording:
        """Return the recording with some of its blocks of revolutions."""
        return self.with_channels({name: sums.of_blocks(kept) for name, sums in self.channels.items()})

    def leaving_one_out(self) -> Iterator[ReducedRecording]:
        """Yield the recording without each of its blocks, the jackknife's replicates."""
        return (self.of_blocks(np.arange(self.n_blocks) != block) for block in range(self.n_blocks))

    def with_channels(self, channels: dict[str, ChannelSums]) -> ReducedRecording:
        """Return the recording with other channel sums."""
        return replace(self, channels=channels, kept={})

    def turned_about(self, names: Iterable[str]) -> ReducedRecording:
        """Return the recording with some channels multiplied by −1."""
        turned = {
            name: replace(sums, lines=(-sums.lines[0], -sums.lines[1]))
            for name, sums in self.channels.items()
            if name in names
        }
        return self.with_channels(self.channels | turned)

    def of_channels(self, names: Iterable[str]) -> ReducedRecording:
        """Return the recording with some of its channels."""
        return self.with_channels({name: self.channels[name] for name in names})

    def average(self, channel: str, side: int) -> ShaftAverage:
        """Return the synchronous average of the driver's (0) or driven (1) shaft in a channel."""
        if (channel, side) not in self.kept:
            counts, blocks = self.channels[channel].counts[side], self.channels[channel].lines[side]
            lines = (counts / counts.sum()) @ blocks
            scatter = (np.abs(blocks - lines) ** 2 * counts[:, None]).sum(axis=0) / max(len(counts) - 1, 1)
            self.kept[channel, side] = ShaftAverage(
                lines,
                scatter / counts.sum(),
                len(counts),
                float(counts.sum()),
                self.frame.teeth[side],
                self.frame.teeth[1 - side],
                int(min(self.highest_order / self.frame.shaft_orders[side], len(lines) - 1)),
            )
        average: ShaftAverage = self.kept[channel, side]
        return average

    def averages(self, side: int) -> list[ShaftAverage]:
        """Return a shaft's synchronous averages in all channels."""
        return [self.average(channel, side) for channel in self.channels]


# --------------------
# Lines of the mains supply, at fixed frequencies whatever the speed.
# --------------------


N_MAINS_HARMONICS = 3
_NEIGHBOURHOOD_HZ = 8.0
_N_SHAFT_HARMONICS = 8
_APART = 20.0
"""Spacing of a shaft's orders, in line widths, from which they can be distinguished from the mains in four of five
positions."""
_N_STRONG_MULTIPLES = 3
"""Multiples of a shaft's order that unbalance, misalignment and the like raise directly, along with their harmonics."""
_N_BESIDE, _AMONG_MULTIPLES_DB = 3, 10.0
"""Multiples on either side with which hum on one of them is compared, and the excess that it must have over the
strongest."""


def mains_lines(recording: Recording, names: Sequence[str], speed_hz: float, frame: GearFrame) -> tuple[float, ...]:
    """Return the mean excess in dB of each supply's harmonics over their surroundings, on the best channel.

    The surroundings are the neighbouring lines or, for a harmonic that coincides with a higher multiple of a shaft, the
    multiples next to it, see `_excess`. Harmonics that coincide with mesh lines or with a shaft's first orders are
    omitted; the result is 0 where none is left.
    """
    return tuple(
        max(_mean_excess(recording.values(name), recording, supply, speed_hz, frame) for name in names)
        for supply in MAINS_HZ
    )


def _mean_excess(
    values: FloatArray, recording: Recording, supply_hz: float, speed_hz: float, frame: GearFrame
) -> float:
    n = len(values)
    x = np.asarray(values, dtype=np.float64)
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(n))) ** 2
    step = recording.sampling_rate_hz / n
    excesses_db = [
        _excess(power, step, supply_hz, k, speed_hz, frame)
        for k in range(1, N_MAINS_HARMONICS + 1)
        if k * supply_hz + _NEIGHBOURHOOD_HZ <= recording.sampling_rate_hz / 2
    ]
    known_db = [excess_db for excess_db in excesses_db if excess_db is not None]
    return float(np.mean(known_db)) if known_db else 0.0


def _excess(
    power: FloatArray, step_hz: float, supply_hz: float, harmonic: int, speed_hz: float, frame: GearFrame
) -> float | None:
    """Return the excess of one harmonic in dB; None where it coincides with the gears' own lines.

    On a shaft's higher multiple it must exceed the strongest of the adjacent multiples by `_AMONG_MULTIPLES_DB`: hum
    raises one of them alone, a shaft does not. The multiples of a slow shaft are everywhere, so only the first, strong
    ones count.
    """
    frequency_hz = harmonic * supply_hz
    width = max(2.0 * step_hz, MAINS_TOLERANCE * frequency_hz)
    mesh_hz = frame.teeth[0] * speed_hz
    if _to_a_multiple(frequency_hz, mesh_hz) < 2.0 * width:
        return None
    line = _strongest(power, step_hz, frequency_hz, width)
    beside: list[float] = []
    for shaft_hz in (order * speed_hz for order in frame.shaft_orders):
        multiple = round(frequency_hz / shaft_hz)
        counts = shaft_hz >= _APART * width or multiple <= _N_SHAFT_HARMONICS
        if not counts or _to_a_multiple(frequency_hz, shaft_hz) >= 2.0 * width:
            continue
        if multiple <= _N_STRONG_MULTIPLES * harmonic or shaft_hz < 4.0 * width:
            return None
        beside += [
            _strongest(power, step_hz, other * shaft_hz, width)
            for other in range(multiple - _N_BESIDE, multiple + _N_BESIDE + 1)
            if other != multiple
            and other * shaft_hz + width < step_hz * (len(power) - 1)
            and _to_a_multiple(other * shaft_hz, mesh_hz) >= 2.0 * width
        ]
    if beside:
        return max(0.0, 10.0 * float(np.log10(line / max(*beside, 1e-300))) - _AMONG_MULTIPLES_DB)
    away = np.abs(np.arange(len(power)) * step_hz - frequency_hz)
    around = power[(away <= _NEIGHBOURHOOD_HZ) & (away > 2.0 * width)]
    return 10.0 * float(np.log10(line / max(float(np.median(around)), 1e-300)))


def _strongest(power: FloatArray, step_hz: float, frequency_hz: float, width_hz: float) -> float:
    first, last = (round((frequency_hz + side * width_hz) / step_hz) for side in (-1.0, 1.0))
    return float(power[first : last + 1].max())


def _to_a_multiple(frequency_hz: float, of_hz: float) -> float:
    """Return the distance to the nearest multiple, from 1 on."""
    return abs(max(round(frequency_hz / of_hz), 1) * of_hz - frequency_hz)


# --------------------
# How the speed varies: figures from the shaft angle.
# --------------------


class SpeedFigures(NamedTuple):
    """A speed's relative linear drift; relative RMS about it; strongest line over the others; that line's frequency."""

    drift: float
    swing: float
    swing_line: float
    swing_frequency_hz: float


HIGHEST_SHAFT_ORDER = 2
"""Highest order of each other shaft that is removed from the speed: run-out modulates the speed at its shaft's
orders."""


def speed_figures(angle: ShaftAngle, other_shafts: Sequence[float] = ()) -> SpeedFigures:
    """Return figures of a shaft's speed, sampled once per revolution.

    Faster variations belong to the shaft's orders and are left to the vibration features; so are those at other shafts'
    orders, which alias to lower frequencies.

    Parameters
    ----------
    angle : ShaftAngle
    other_shafts : sequence of float
        Their revolutions per revolution of this shaft.
    """
    n = int(angle.n_revolutions)
    time = np.linspace(angle.start_s, angle.end_s, 8 * n + 1)
    revolutions = angle.revolutions_at(time)
    whole = np.interp(np.arange(np.ceil(revolutions[0]), np.floor(revolutions[-1]) + 1), revolutions, time)
    speed = 1.0 / np.diff(whole)
    middle = 0.5 * (whole[1:] + whole[:-1])
    slope, level = np.polyfit(middle - middle.mean(), speed, 1)
    deviation = (speed - level - slope * (middle - middle.mean())) / level
    deviation = _without_cycles(deviation, tuple(_cycles_per_revolution(other_shafts, len(deviation))))
    window = np.hanning(len(deviation) + 2)[1:-1]
    power = np.abs(np.fft.rfft(deviation * window, 4 * len(deviation)))[1:] ** 2
    strongest = int(np.argmax(power))
    typical = float(np.median(power)) / np.log(2.0)
    return SpeedFigures(
        float(slope * (middle[-1] - middle[0]) / level),
        float(np.std(deviation)),
        float(power[strongest] / max(typical, 1e-30)),
        float((strongest + 1) / (4 * len(deviation)) * level),
    )


def _cycles_per_revolution(other_shafts: Sequence[float], n: int) -> Iterator[float]:
    """Yield the shafts' orders aliased by one sample per revolution, 0 to 1/2, except those as slow as the record."""
    for ratio in other_shafts:
        for order in range(1, HIGHEST_SHAFT_ORDER + 1):
            cycles = abs(order * ratio - round(order * ratio))
            if cycles > 2.0 / n:
                yield cycles


MAX_RUN_OUT = 2e-3
"""Maximum relative amplitude of the speed due to run-out, e/r: a tenth of a millimetre at 50 mm. A swing of the drive
whose alias falls on another shaft's order is larger, and only this much of it is removed."""


def _without_cycles(deviation: FloatArray, cycles: Sequence[float]) -> FloatArray:
    """Return a speed without the best-fitting sine at each of some frequencies, in cycles per sample."""
    if not cycles:
        return deviation
    phase = 2.0 * np.pi * np.outer(np.arange(len(deviation)), cycles)
    waves = np.hstack([np.cos(phase), np.sin(phase)])
    coefficients = np.linalg.lstsq(waves, deviation, rcond=None)[0]
    amplitudes = np.hypot(*coefficients.reshape(2, -1))
    removed_share = np.minimum(1.0, MAX_RUN_OUT / np.maximum(amplitudes, 1e-300))
    remainder: FloatArray = deviation - waves @ (coefficients * np.tile(removed_share, 2))
    return remainder


MIN_REVOLUTIONS = 8
"""Of driver and driven gear: two per block, the minimum that separates the two shafts' orders."""

REVOLUTIONS_PER_BLOCK = 20
MIN_BLOCKS, MAX_BLOCKS = 4, 8
"""Blocks are long enough to separate bearing orders from shaft orders, and enough of them for a jackknife."""

N_BANDS = 4
LOWEST_BAND_HZ = 300.0
HIGHEST_CYCLE, BEYOND_THE_MESH = 40.0, 5.0
"""Modulation orders are evaluated up to this order of the driver, or to so many beyond the mesh order."""

NEAR_THE_EXTREME = 0.005
"""Samples within this fraction of the largest magnitude count as close to it."""


def reduce_recording(
    recording: Recording | PreparedRecording, rig: Rig | None = None, channels: Sequence[str] = ()
) -> ReducedRecording:
    """Reduce a recording to what the features require.

    Parameters
    ----------
    recording : Recording or PreparedRecording
    rig : Rig or None
        With a gear pair; None: the rig that the recording carries.
    channels : sequence of str
        Default: all vibration channels. Accelerations in a known unit are converted to m/s², as in simulations.

    Raises
    ------
    RefusalError
        If the speed is not known, there are too few revolutions, or the mesh frequency is above the sampled range.
    """
    prepared = prepare(recording) if rig is None else prepare(recording).with_rig(rig)
    recording, frame = prepared.recording, gear_frame(prepared.rig)
    angles = [prepared.angle_of(shaft, followed=True) for shaft in frame.shafts]
    for shaft, angle in zip(frame.shafts, angles, strict=True):
        if angle.n_revolutions < MIN_REVOLUTIONS:
            raise RefusalError(
                f"shaft {shaft!r} turns {angle.n_revolutions:.3g} times in the record, {MIN_REVOLUTIONS} are needed",
                remedy="record longer",
            )
    names = tuple(channels) or recording.vibration_names()
    n_blocks = int(np.clip(angles[DRIVER].n_revolutions // REVOLUTIONS_PER_BLOCK, MIN_BLOCKS, MAX_BLOCKS))
    speed_hz = angles[DRIVER].mean_speed_rpm / 60.0
    signals = [prepared.over_angle(shaft, names, followed=True) for shaft in frame.shafts]
    _check_mesh(signals[DRIVER], frame, recording, speed_hz)
    bands = _bands(recording.sampling_rate_hz, signals[DRIVER].samples_per_revolution * speed_hz)
    reduced = {
        # One channel at a time: double-precision signals of all channels, over both shafts and with the averages
        # removed, would take several times the memory of the recording.
        name: _channel_sums(
            [_one_channel(signal, i, _si_factor(recording, name)) for signal in signals],
            recording.values(name) * _si_factor(recording, name),
            frame,
            n_blocks,
            bands,
            speed_hz,
        )
        for i, name in enumerate(names)
    }
    _, order_step, cycle_step = reduced[names[-1]]
    return ReducedRecording(
        frame=frame,
        channels={name: sums for name, (sums, _, _) in reduced.items()},
        order_step=order_step,
        cycle_step=cycle_step,
        bands_hz=bands,
        highest_order=signals[DRIVER].highest_order,
        speed_hz=speed_hz,
        speed=speed_figures(angles[DRIVER], frame.shaft_orders[1:]),
        hum=mains_lines(recording, names, speed_hz, frame),
        marks=(prepared.has_mark(frame.shafts[DRIVER]), prepared.has_mark(frame.shafts[DRIVEN])),
        n_revolutions=angles[DRIVER].n_revolutions,
    )


def _si_factor(recording: Recording, channel: str) -> float:
    return metres_per_second_squared(recording.channels[recording.channel_names.index(channel)]) or 1.0


def _one_channel(signal: AngleSignal, i: int, factor: float) -> AngleSignal:
    rows = signal.samples[i : i + 1] * factor
    return replace(signal, samples=rows, channel_names=signal.channel_names[i : i + 1], units=signal.units[i : i + 1])


def _check_mesh(signal: AngleSignal, frame: GearFrame, recording: Recording, speed_hz: float) -> None:
    """Refuse a record sampled too slowly to contain the mesh and its sidebands, on which all comparisons rest."""
    if signal.highest_order < frame.teeth[0] + max(frame.shaft_orders):
        mesh_hz = frame.teeth[0] * speed_hz
        raise RefusalError(
            f"the gears mesh at {mesh_hz:.4g} Hz, too high for a sampling rate of {recording.sampling_rate_hz:.6g} Hz",
            remedy=f"sample at {4.0 * mesh_hz:.2g} Hz at least",
        )


def _bands(sampling_rate_hz: float, angle_rate_hz: float) -> tuple[tuple[float, float], ...]:
    """Return bands of equal relative width, then the whole range."""
    top = 0.42 * min(sampling_rate_hz, angle_rate_hz)
    low = min(LOWEST_BAND_HZ, top / 8.0)
    edges = [low * (top / low) ** (i / N_BANDS) for i in range(N_BANDS + 1)]
    return (*pairwise(edges), (low, top))


def _channel_sums(
    signals: Sequence[AngleSignal],
    raw: FloatArray,
    frame: GearFrame,
    n_blocks: int,
    bands: Sequence[tuple[float, float]],
    speed_hz: float,
) -> tuple[ChannelSums, float, float]:
    """Return one channel's sums, and the line spacings of residual and envelopes in orders of the driver."""
    signals = [_without_background(signal, frame, side) for side, signal in enumerate(signals)]
    separated = orders.separate_shafts(signals, frame.teeth)
    lines = []
    for signal in separated.signals:
        # All lines of the samples, with 0 at the Nyquist order: windows of one tooth rely on them.
        average = orders.average_lines(signal, n_parts=n_blocks, highest_order=np.inf)
        blocks = np.zeros((n_blocks, signal.samples_per_revolution // 2 + 1), dtype=np.complex128)
        blocks[:, : average.highest_order + 1] = average.parts[:, 0]
        blocks[:, 0] *= 2.0  # the mean counts as a peak, as it did when the floors were learned
        lines.append((blocks, average.n_revolutions))
    n = signals[DRIVER].samples_per_revolution
    residual = separated.residual.samples[0]
    power, order_step = _segment_power(residual, n, n_blocks)
    highest_cycle = min(max(HIGHEST_CYCLE, frame.teeth[0] + BEYOND_THE_MESH), 0.4 * n)
    envelopes, moments, cycle_step = _envelopes(residual, n, n_blocks, bands, speed_hz, highest_cycle)
    (driver, n_driver), (driven, n_driven) = lines
    sums = ChannelSums((driver, driven), (n_driver, n_driven), power, envelopes, moments, _tail(raw, n_blocks))
    return sums, order_step, cycle_step


def _without_background(signal: AngleSignal, frame: GearFrame, side: int) -> AngleSignal:
    """Return a signal over a shaft's angle without the machine's other pairs and shafts."""
    if not frame.background:
        return signal
    at = np.array(frame.background) / frame.shaft_orders[side]
    return replace(
        signal, samples=np.stack([_without_lines(x, at, signal.samples_per_revolution) for x in signal.samples])
    )


REACH = 2000
"""Lines on either side of an order over which its leakage is removed: −76 dB beyond."""

N_PASSES = 2
"""Passes over all orders: the second removes the leakage between their estimates."""


def _without_lines(values: FloatArray, background: FloatArray, n_per_rev: int) -> FloatArray:
    """Return a signal over angle without steady lines at given orders.

    A line a exp(2πi f n/N) has X_k = a (e^{2πi(f−k)} − 1)/(e^{2πi(f−k)/N} − 1). Its amplitude is estimated with a Hann
    window, X_k/2 − (X_{k−1} + X_{k+1})/4 at the nearest k, which suppresses the other lines; then the line is
    subtracted.
    """
    from scipy.fft import irfft, rfft

    n = len(values)
    at = background * n / n_per_rev
    at = at[(at > 2.0) & (at < n // 2 - 2)]
    if not len(at):
        return values
    lines = rfft(values)
    near = np.round(at).astype(np.intp)
    three = near[:, None] + np.array([-1, 0, 1])
    hann = np.array([-0.25, 0.5, -0.25])
    unit = _line(at[:, None] - three, n) @ hann
    for _ in range(N_PASSES):
        for f, k, neighbours, whole in zip(at, near, three, unit, strict=True):
            kept = slice(max(k - REACH, 0), min(k + REACH, len(lines)))
            away = f - np.arange(kept.start, kept.stop)
            lines[kept] -= (lines[neighbours] @ hann) / whole * _line(away, n)
    remainder: FloatArray = irfft(lines, n)
    return remainder


def _line(away: FloatArray, n: int) -> ComplexArray:
    """Return the spectrum of a line of unit amplitude at given distances from it, in bins."""
    away = np.where(np.abs(away) < 1e-9, 1e-9, away)
    return np.asarray(np.expm1(2j * np.pi * away) / np.expm1(2j * np.pi * away / n))


def _segment_power(values: FloatArray, rate: float, n_segments: int) -> tuple[FloatArray, float]:
    """Return the Hann power spectra (mean square per line) of equal segments, and the spacing of the lines."""
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
    """Return spectra of squared envelopes over their squared mean, the bands' moments, and the line spacing."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(residual)
    beyond = min(BEYOND_THE_ENDS, n - 1)
    before, after = reflected_ends(residual, beyond)
    long = np.concatenate([before, residual, after])
    lines = rfft(long)
    m = 2 * next_fast_len(int(highest_cycle * n / n_per_rev) + 1)
    powers, moments, step = [], [], 0.0
    for low, high in bands:
        first, last = (int(f / speed_hz * len(long) / n_per_rev) for f in (low, high))
        square = _squared_envelope(lines[first : min(last, len(lines) - 1)], len(long))
        square = square[round(len(square) * beyond / len(long)) :][: round(len(square) * n / len(long))]
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
    """Return |z|² of a band of lines of n samples, at the minimum rate: twice the band's width."""
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
