"""Maps, averages and envelope spectra of records larger than memory, in overlapping blocks.

Each equals the result for the whole record at once: spectra are at the same places, a revolution counts in the block
where it begins, and a band's filter is the same function of frequency for any block length, with enough of the
neighbouring blocks for its response to die away.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from math import ceil, floor
from pathlib import Path

import numpy as np

from gearsig.angle import REACH, ShaftAngle, find_shaft_angle, resample_to_angle, tachometer_edges
from gearsig.checks import FloatArray, count, within
from gearsig.errors import InputError, RefusalError
from gearsig.orders import OrderMap, SynchronousAverage
from gearsig.recording import Recording, n_samples_of, read_recording
from gearsig.rig import ConstantSpeed, PulseTimes, Rig, SpeedSource, TachometerChannel
from gearsig.spectra import (
    PERIODS_OF_EDGE,
    Scaling,
    Spectrum,
    edged_band,
    plan_blocks,
    power_density,
    spectrum_of_blocks,
    squared_unit,
)

BLOCK_SAMPLES = 1 << 20
"""Of a block, per channel: some 100 MB of work at a time."""
EDGE_FRACTION = 0.1
KERNEL_SAMPLES = 64
"""More than the resampling reaches on either side."""


@dataclass(frozen=True)
class RecordBlocks:
    """A record that is read block by block.

    Parameters
    ----------
    head : Recording
        Its beginning: channels, rate, rig and source of speed; the whole record if it can only be read whole.
    n_samples : int
        Per channel.
    read : callable
        A slice of samples → Recording; None → all of it.
    is_parted : bool
        Whether the format can be read in parts.
    """

    head: Recording
    n_samples: int
    read: Callable[[slice | None], Recording]
    is_parted: bool = True

    def whole(self) -> Recording:
        """Return the whole record."""
        return self.read(None) if self.is_parted else self.head

    def power_density(self, channel: str, *, n_per_block: int = 8192) -> Spectrum:
        """Return the power density of the whole record: the mean of all half overlapping spectra (Hann)."""
        levels = self.frequency_map(channel, n_per_block=n_per_block)
        hop = n_per_block // 2
        n_spectra = (self.n_samples - n_per_block) // hop + 1
        # All columns but the last are means of equally many spectra.
        n_each = np.full(len(levels.time_s), ceil(n_spectra / len(levels.time_s)))
        n_each[-1] = n_spectra - n_each[:-1].sum()
        head = np.zeros(n_per_block)
        empty = power_density(head, self.head.sampling_rate_hz, n_per_block=n_per_block, unit=self._unit(channel))
        return replace(empty, values=n_each @ levels.values / n_spectra, n_averages=n_spectra, source=channel)

    def frequency_map(
        self,
        channel: str,
        *,
        n_per_block: int = 8192,
        n_columns_max: int = 1000,
        scaling: Scaling = "power density",
        shaft_angle: ShaftAngle | None = None,
    ) -> OrderMap:
        """Return spectra over time, each column the mean power of all half overlapping spectra that begin in it.

        Parameters
        ----------
        channel : str
        n_per_block : int
            Samples per spectrum (Hann).
        n_columns_max : int
            Bounds the memory: spectra are averaged if there are more.
        scaling : str
            As in `amplitude_spectrum`, or "power density".
        shaft_angle : ShaftAngle or None
            For the speed of each column; None: given as 0.

        Returns
        -------
        OrderMap
            Over frequency.
        """
        hop, rate = count(n_per_block, "n_per_block", minimum=16) // 2, self.head.sampling_rate_hz
        n_spectra = (self.n_samples - n_per_block) // hop + 1
        if n_spectra < 1:
            raise RefusalError(f"{self.n_samples} samples are less than one spectrum of {n_per_block}")
        per_column = ceil(n_spectra / count(n_columns_max, "n_columns_max"))
        at_once = per_column * max(1, BLOCK_SAMPLES // (per_column * hop))
        rows: list[FloatArray] = []
        spectrum: Spectrum | None = None
        for first in range(0, n_spectra, at_once):
            last = min(first + at_once, n_spectra)
            x = self.read(slice(first * hop, (last - 1) * hop + n_per_block)).values(channel)
            for begin in range(0, last - first, per_column):
                end = min(begin + per_column, last - first)
                piece = x[begin * hop : (end - 1) * hop + n_per_block]
                plan = plan_blocks(len(piece), n_per_block, 0.5, "hann")
                spectrum = spectrum_of_blocks(piece, rate, plan, scaling, self._unit(channel), channel)
                rows.append(spectrum.values)
        assert spectrum is not None  # noqa: S101 - said to the type checker: there is at least one
        begins = np.arange(len(rows)) * per_column
        ends = np.minimum(begins + per_column, n_spectra)
        time_s = ((begins + ends - 1) * hop + n_per_block) / 2.0 / rate
        return OrderMap(
            values=np.stack(rows),
            positions=spectrum.positions,
            time_s=time_s,
            speed_rpm=np.zeros(len(rows)) if shaft_angle is None else shaft_angle.speed_rpm_at(time_s),
            axis="frequency",
            scaling=scaling,
            unit=spectrum.unit,
            resolution=spectrum.resolution,
            source=channel,
            shaft="" if shaft_angle is None else shaft_angle.shaft,
        )

    def order_map(
        self,
        channel: str,
        shaft_angle: ShaftAngle | None = None,
        *,
        revolutions_per_block: int = 10,
        n_columns_max: int = 1000,
        samples_per_revolution: int | None = None,
    ) -> OrderMap:
        """Return amplitudes over order along the record, each column the rms of all spectra that begin in it.

        Spectra (Hann) span `revolutions_per_block` revolutions and overlap by half, rounded down.

        Parameters
        ----------
        channel, shaft_angle, samples_per_revolution
            As in `average`.
        revolutions_per_block, n_columns_max : int
            As in `gearsig.orders.order_map`, and `frequency_map`.
        """
        turns = self._turns(channel, shaft_angle, samples_per_revolution)
        hop = max(1, count(revolutions_per_block, "revolutions_per_block") // 2)
        n_spectra = (turns.last - turns.first - revolutions_per_block) // hop + 1
        if n_spectra < 1:
            raise RefusalError(f"{self.head.name} holds fewer than {revolutions_per_block} whole revolutions")
        per_column = ceil(n_spectra / count(n_columns_max, "n_columns_max"))
        columns: list[Spectrum] = []
        ends: list[tuple[int, int]] = []
        for first in range(0, n_spectra, per_column):
            n_here = min(per_column, n_spectra - first)
            begin = turns.first + first * hop
            end = begin + (n_here - 1) * hop + revolutions_per_block
            x = np.concatenate([rows.reshape(-1) for _, rows in turns.between(begin, end)])
            plan = plan_blocks(
                len(x), revolutions_per_block * turns.n_per_revolution, 1.0 - hop / revolutions_per_block, "hann"
            )
            columns.append(
                spectrum_of_blocks(
                    x, turns.n_per_revolution, plan, "amplitude peak", self._unit(channel), channel,
                    axis="order", highest=turns.highest_order, shaft=turns.angle.shaft,
                )
            )  # fmt: skip
            ends.append((begin, end))
        n_lines = min(len(column.values) for column in columns)
        begin_s, end_s = np.interp(np.array(ends).T, turns.angle.revolutions, turns.angle.time_s)
        return OrderMap(
            values=np.stack([column.values[:n_lines] for column in columns]),
            positions=columns[0].positions[:n_lines],
            time_s=(begin_s + end_s) / 2.0,
            speed_rpm=60.0 * np.diff(np.array(ends), axis=1)[:, 0] / (end_s - begin_s),
            axis="order",
            scaling="amplitude peak",
            unit=columns[0].unit,
            resolution=columns[0].resolution,
            source=channel,
            shaft=turns.angle.shaft,
        )

    def envelope_density(self, channel: str, band_hz: tuple[float, float], *, n_per_block: int = 8192) -> Spectrum:
        """Return the power density of a band's squared envelope |z|², averaged over the record.

        The band's edges are raised cosines of a tenth of its width; |z|² is sampled at a whole fraction of the rate, at
        least four times the bandwidth where the record allows it. The signal is zero beyond the record's ends.

        Parameters
        ----------
        channel : str
        band_hz : (float, float)
        n_per_block : int
            Samples per spectrum of the envelope (Hann, half overlapping).
        """
        rate, hop = self.head.sampling_rate_hz, n_per_block // 2
        total, n_spectra, held = np.zeros(n_per_block // 2 + 1), 0, np.zeros(0)
        spectrum: Spectrum | None = None
        for values, rate_hz in self._envelopes(channel, *band_hz):
            held = np.concatenate([held, values])
            n = (len(held) - n_per_block) // hop + 1
            if n > 0:
                piece = held[: (n - 1) * hop + n_per_block]
                spectrum = power_density(
                    piece, rate_hz, n_per_block=n_per_block, unit=squared_unit(self._unit(channel)), source=channel
                )
                total, n_spectra, held = total + n * spectrum.values, n_spectra + n, held[n * hop :]
        if spectrum is None:
            raise RefusalError(f"the envelope of {self.n_samples / rate:.4g} s is shorter than {n_per_block} samples")
        return replace(spectrum, values=total / n_spectra)

    def _envelopes(self, channel: str, low_hz: float, high_hz: float) -> Iterator[tuple[FloatArray, float]]:
        """Yield the squared envelope piece by piece with its rate."""
        from scipy.fft import ifft, next_fast_len, rfft

        rate = self.head.sampling_rate_hz
        within(high_hz, "upper end of the band", low_hz, rate / 2, "Hz")
        edge_hz = EDGE_FRACTION * (high_hz - low_hz)
        thinned = max(1, floor(rate / (4.0 * (high_hz - low_hz))))
        side = ceil(PERIODS_OF_EDGE * rate / edge_hz / thinned) * thinned
        n = thinned * next_fast_len(ceil(max(BLOCK_SAMPLES, 4 * side) / thinned))
        frequency = np.arange(n // 2 + 1) * rate / n
        lines, response = edged_band(frequency, (low_hz, high_hz), edge_hz)
        response *= 2.0 / thinned
        step = n - 2 * side
        for first in range(0, self.n_samples, step):
            begin, end = max(0, first - side), min(self.n_samples, first + step + side)
            x = np.zeros(n)
            x[begin - first + side : end - first + side] = self.read(slice(begin, end)).values(channel)
            folded = np.zeros(n // thinned, dtype=np.complex128)
            folded[lines % len(folded)] = rfft(x)[lines] * response
            z = ifft(folded, overwrite_x=True)
            inner = z[side // thinned : (side + min(step, self.n_samples - first) - 1) // thinned + 1]
            yield inner.real**2 + inner.imag**2, rate / thinned

    def shaft_angle(self) -> ShaftAngle:
        """Return the reference shaft's angle over the whole record, from a constant speed or tachometer pulses.

        Raises
        ------
        InputError
            If the speed comes from something else: an encoder, or the vibration itself.
        """
        speed, rate = self.head.speed, self.head.sampling_rate_hz
        if isinstance(speed, ConstantSpeed):
            # Knots at both ends of the whole record, of which only the length matters.
            still = np.broadcast_to(np.zeros((1, 1), np.float32), (len(self.head.channels), self.n_samples))
            return find_shaft_angle(replace(self.head, samples=still))
        if not isinstance(speed, PulseTimes | TachometerChannel):
            raise InputError(
                "the speed of a record longer than memory comes from a constant speed or tachometer pulses",
                where=self.head.name,
                remedy="give --speed-rpm or --tach-times, or a rig file with a tachometer channel",
            )
        times: list[FloatArray] = []
        reach = KERNEL_SAMPLES
        for first in range(0, self.n_samples, BLOCK_SAMPLES):
            begin = max(0, first - reach)
            part = self.read(slice(begin, min(self.n_samples, first + BLOCK_SAMPLES + reach)))
            if isinstance(speed, TachometerChannel):
                edges = tachometer_edges(part, speed)
                times_s = edges.times_s
                # By the levels of the first block, if they are not given.
                speed = replace(speed, threshold=edges.threshold, hysteresis=edges.hysteresis)
            else:
                assert isinstance(part.speed, PulseTimes)  # noqa: S101 - said to the type checker: of the same file
                times_s = part.speed.times_s
            at = times_s + begin / rate
            times.append(at[(at >= first / rate) & (at < (first + BLOCK_SAMPLES) / rate)])
        pulses = PulseTimes(np.concatenate(times), speed.pulses_per_revolution, speed.shaft)
        return find_shaft_angle(replace(self.head, speed=pulses))

    def average(
        self,
        channel: str,
        shaft_angle: ShaftAngle | None = None,
        *,
        samples_per_revolution: int | None = None,
        n_jackknife_blocks: int = 32,
    ) -> SynchronousAverage:
        """Return the mean revolution over all whole revolutions of the record.

        Parameters
        ----------
        channel : str
        shaft_angle : ShaftAngle or None
            None: `shaft_angle()`.
        samples_per_revolution : int or None
            None: as the first block requires, see `resample_to_angle`.
        n_jackknife_blocks : int
            For the standard error, as in `synchronous_average`.
        """
        turns = self._turns(channel, shaft_angle, samples_per_revolution)
        n, first, last = turns.n_per_revolution, turns.first, turns.last
        edges = first + np.linspace(0, last - first, min(last - first, n_jackknife_blocks) + 1).round().astype(int)
        sums = np.zeros((len(edges) - 1, n))
        for begin, rows in turns.between(first, last):
            for i in range(len(edges) - 1):
                a, b = max(begin, edges[i]) - begin, min(begin + len(rows), edges[i + 1]) - begin
                if b > a:
                    sums[i] += rows[a:b].sum(axis=0, dtype=np.float64)
        total, n_revolutions = sums.sum(axis=0), last - first
        without = (total - sums) / (n_revolutions - np.diff(edges))[:, None]
        error = np.sqrt((len(sums) - 1.0) * without.var(axis=0))
        return SynchronousAverage(
            total / n_revolutions, error, n_revolutions, turns.angle.shaft, channel, self._unit(channel), "average",
            turns.highest_order,
        )  # fmt: skip

    def _turns(self, channel: str, shaft_angle: ShaftAngle | None, samples_per_revolution: int | None) -> _Turns:
        angle, rate = shaft_angle or self.shaft_angle(), self.head.sampling_rate_hz
        ends_s = np.array([REACH, self.n_samples - 1 - REACH]) / rate
        begin, end = angle.revolutions_at(np.clip(ends_s, angle.start_s, angle.end_s))
        n = samples_per_revolution or self._grid(channel, angle)
        first, last = ceil(begin - 1e-9), floor(end + 1.0 / n + 1e-9)  # the last sample lies a step before its end
        if last - first < 2:
            raise RefusalError(f"{self.head.name} holds fewer than two whole revolutions")
        return _Turns(self, channel, angle, n, first, last)

    def _grid(self, channel: str, angle: ShaftAngle) -> int:
        """Return the samples per revolution that the first block requires."""
        n = min(BLOCK_SAMPLES, self.n_samples)
        covered = angle.between(0.0, n / self.head.sampling_rate_hz)
        return resample_to_angle(self.read(slice(0, n)), covered, channels=(channel,)).samples_per_revolution

    def _unit(self, channel: str) -> str:
        return self.head.channels[self.head.index(channel)].unit


@dataclass
class _Turns:
    """Whole revolutions of one channel of a record, `first` to `last`; `highest_order` of those read so far."""

    blocks: RecordBlocks
    channel: str
    angle: ShaftAngle
    n_per_revolution: int
    first: int
    last: int
    highest_order: float = np.inf

    def between(self, first: int, last: int) -> Iterator[tuple[int, FloatArray]]:
        """Yield the number of a revolution, and it and the following ones as rows, (n, n_per_revolution)."""
        angle, rate, n = self.angle, self.blocks.head.sampling_rate_hz, self.n_per_revolution
        # Approximate: they only determine what is read, with a twentieth of a revolution to spare.
        starts_s = np.interp(np.arange(first, last + 1), angle.revolutions, angle.time_s)
        spare = KERNEL_SAMPLES + ceil(0.05 * rate * float(np.diff(starts_s).max()))
        n_at_once = max(1, floor(BLOCK_SAMPLES / rate / float(np.median(np.diff(starts_s)))))
        for begin in range(first, last, n_at_once):
            end = min(begin + n_at_once, last)
            left = max(0, floor(starts_s[begin - first] * rate) - spare)
            right = min(self.blocks.n_samples, ceil(starts_s[end - first] * rate) + spare)
            signal = resample_to_angle(
                self.blocks.read(slice(left, right)),
                _moved(angle, left / rate, right / rate, begin),
                channels=(self.channel,),
                samples_per_revolution=n,
            )
            skip = round(-signal.start_revolution * n)
            self.highest_order = min(self.highest_order, signal.highest_order)
            yield begin, signal.samples[0, skip : skip + (end - begin) * n].reshape(end - begin, n)


def record_blocks(
    path: str | Path,
    rig: Rig | None = None,
    *,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
    part: slice | None = None,
) -> RecordBlocks:
    """Open a recording for reading block by block: HDF5, TDMS, Parquet or WAV; other formats are read whole.

    Parameters
    ----------
    path : str or Path
    rig, sampling_rate_hz, speed
        As in `read_recording`.
    part : slice or None
        Only these samples, as if there were no others.

    Raises
    ------
    InputError
        As `read_recording`, and for a part of a format that can only be read whole.
    """
    n_samples = n_samples_of(path)
    first, last, _ = (part or slice(None)).indices(n_samples or 0)

    def read(block: slice | None) -> Recording:
        inside = part if block is None else slice(first + block.start, first + block.stop)
        return read_recording(path, rig=rig, sampling_rate_hz=sampling_rate_hz, speed=speed, part=inside)

    if n_samples is None:
        whole = read(None)
        return RecordBlocks(whole, whole.n_samples, read, is_parted=False)
    return RecordBlocks(read(slice(0, min(KERNEL_SAMPLES, last - first) or 1)), last - first, read)


def _moved(angle: ShaftAngle, start_s: float, end_s: float, revolution: int) -> ShaftAngle:
    """Return the angle of a part of the record, on the part's own time, counted from `revolution`."""
    between = angle.between(start_s, end_s)
    return replace(between, time_s=between.time_s - start_s, revolutions=between.revolutions - revolution)
