"""Recordings that are larger than memory: simple figures for the whole record, a full analysis of a few selected parts.

The whole record is read in blocks: level, peak, crest factor and kurtosis over time, and the mean power density, which
equals that of the whole record at once. The detectors, which are expensive, look at up to three parts: the usual level,
the highest, and the most impulsive. Each result states why its part was chosen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from os import PathLike
from pathlib import Path

import numpy as np

from gearsig.checks import FloatArray, freeze, instance_of, positive
from gearsig.diagnosis._analyze import analyze
from gearsig.diagnosis._blocks import RecordBlocks, record_blocks
from gearsig.diagnosis._reference import REFERENCE_OPTIONS, rig_and_rate_of_reference
from gearsig.diagnosis._types import Analysis, Finding, Kind, Outcome
from gearsig.diagnosis._verdict import ranked
from gearsig.errors import InputError, options_named
from gearsig.formatting import file_label
from gearsig.prepared import PreparedRecording, prepare
from gearsig.recording import Recording, check_memory
from gearsig.rig import PulseTimes, Rig, SpeedSource, check_rig
from gearsig.spectra import Spectrum, power_density

MEMORY_BYTES = 2e9
BYTES_PER_SAMPLE, BYTES_PER_CHANNEL = 330.0, 100.0
"""Most memory that `analyze` takes per sample in time, and in addition per channel: 3.36 GB were measured for 8.2
million samples of one channel whose speed no line confirms, 1.47 GB for 2.05 million of four."""

PART_SAMPLES = 1 << 19
"""Of a part, per channel: 400 revolutions at 25.6 kHz and 1200 rpm."""

BLOCK_SAMPLES = 1 << 22
"""Read at a time, over all channels together."""

N_PER_SPECTRUM = 8192
INTERVAL_S = 1.0


@dataclass(frozen=True)
class LongOverview:
    """Figures of a whole record over time.

    Parameters
    ----------
    channel_names, units : tuple of str
        Vibration channels.
    time_s : array, (n,)
        Starts of intervals of one second; a remainder of half an interval or more counts as an interval.
    rms, peak, crest_factor, kurtosis : array, (n_channels, n)
        About each interval's mean; rms and peak in the channel's unit, the others dimensionless.
    densities : tuple of Spectrum
        Mean power density of each channel over all of the record (Hann, 8192 samples, half overlapping).
    """

    channel_names: tuple[str, ...]
    units: tuple[str, ...]
    time_s: FloatArray
    rms: FloatArray
    peak: FloatArray
    crest_factor: FloatArray
    kurtosis: FloatArray
    densities: tuple[Spectrum, ...]

    def __post_init__(self) -> None:
        freeze(self, "time_s")
        freeze(self, "rms", "peak", "crest_factor", "kurtosis", ndim=2)


@dataclass(frozen=True)
class AnalysedPart:
    """A part of a long record with its whole analysis.

    Parameters
    ----------
    start_s, end_s : float
    reason : str
        Why it was chosen.
    analysis : Analysis
    """

    start_s: float
    end_s: float
    reason: str
    analysis: Analysis


@dataclass(frozen=True)
class LongAnalysis:
    """The analysis of a record that is larger than memory.

    Parameters
    ----------
    name : str
    duration_s : float
    overview : LongOverview
    parts : tuple of AnalysedPart
        In the order of time.
    """

    name: str
    duration_s: float
    overview: LongOverview
    parts: tuple[AnalysedPart, ...]

    @property
    def outcome(self) -> Outcome:
        """The most severe outcome of the parts."""
        order = list(Outcome)
        return min((part.analysis.outcome for part in self.parts), key=order.index)

    @property
    def verdict(self) -> str:
        """The verdict on the most severe part, and how much of the record was examined as closely."""
        part = self.most_severe
        looked_s = sum(p.end_s - p.start_s for p in self.parts)
        return (
            f"{part.analysis.verdict} Seen from {part.start_s:.4g} to {part.end_s:.4g} s ({part.reason}); "
            f"the detectors looked at {looked_s:.4g} of {self.duration_s:.4g} s, levels and spectra at all of it."
        )

    @property
    def most_severe(self) -> AnalysedPart:
        """The first part that has the overall outcome."""
        return next(part for part in self.parts if part.analysis.outcome is self.outcome)

    def as_one(self) -> Analysis:
        """Return the most severe part's analysis for callers that show only one; verdict and a finding cover all parts.

        Its indicators are those of the part with the usual level, so that recordings can be compared over time.
        """
        shown, overview = self.most_severe, self.overview
        usual = next((part for part in self.parts if part.reason == USUAL), shown)
        evidence = [
            f"From {part.start_s:.4g} to {part.end_s:.4g} s ({part.reason}): {part.analysis.verdict}"
            for part in self.parts
            if part is not shown
        ]
        for name, unit, rms in zip(overview.channel_names, overview.units, overview.rms, strict=True):
            at_s = float(overview.time_s[int(np.argmax(rms))])
            evidence.append(
                f"{name}: rms {rms.min():.4g} to {rms.max():.4g} {unit} over all of it, highest at {at_s:.4g} s."
            )
        note = Finding(
            "part-of-long-record",
            Kind.NOTICE,
            f"The recording lasts {self.duration_s:.5g} s, longer than memory; shown are {shown.start_s:.5g} to "
            f"{shown.end_s:.5g} s ({shown.reason}), indicators of {usual.start_s:.5g} to {usual.end_s:.5g} s.",
            evidence=tuple(evidence),
            surer="gearsig analyze reports each part in full; with more --memory the recording is analysed whole.",
        )
        return replace(
            shown.analysis,
            findings=ranked([*shown.analysis.findings, note]),
            verdict=self.verdict,
            indicators=usual.analysis.indicators,
        )


def analysis_bytes(n_samples: int, n_channels: int) -> float:
    """Return an upper estimate of the memory in bytes that `analyze` needs for a recording."""
    return (BYTES_PER_SAMPLE + BYTES_PER_CHANNEL * n_channels) * n_samples


def analyze_file(
    path: str | Path,
    rig: Rig | None = None,
    *,
    memory_bytes: float = MEMORY_BYTES,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
    reference: Recording | PreparedRecording | None = None,
    torque_nm: float | None = None,
    on_stage: Callable[[str], object] | None = None,
) -> Analysis | LongAnalysis:
    """Diagnose a recording in bounded memory: whole where it fits, else by an overview and the analysis of parts.

    Parameters
    ----------
    path : str or Path
    rig : Rig or None
    memory_bytes : float
        Memory that may be used, more than 0.2 GB.
    sampling_rate_hz, speed
        As in `read_recording`.
    reference, torque_nm
        As in `analyze`; for a reference in a file see `read_reference`.
    on_stage : callable or None
        Called with a few words as each stage begins.

    Returns
    -------
    Analysis or LongAnalysis

    Raises
    ------
    InputError
        As `read_recording` and `analyze`; and if the record does not fit and its format can only be read whole.
    """
    positive(memory_bytes - 2e8, "memory less 0.2 GB", "bytes", remedy="allow more than 0.2 GB")
    announce = on_stage or (lambda _: None)
    healthy = None if reference is None else prepare(reference, name="reference")
    left_bytes = memory_bytes if healthy is None else memory_bytes - _needed_bytes(healthy.recording)
    record = record_blocks(path, rig, sampling_rate_hz=sampling_rate_hz, speed=speed)
    if _fits(record, left_bytes):
        return analyze(record.whole(), reference=healthy, torque_nm=torque_nm, on_stage=on_stage)
    announce("levels over time")
    overview = long_overview(record.head, record.n_samples, record.read)
    parts, rate = [], record.head.sampling_rate_hz
    for part, reason in _chosen(record, overview, left_bytes):
        announce(reason)
        recording = record.read(part)
        analysis = analyze(recording, reference=healthy, torque_nm=torque_nm)
        parts.append(AnalysedPart(part.start / rate, part.start / rate + recording.duration_s, reason, analysis))
    return LongAnalysis(record.head.name, record.n_samples / rate, overview, tuple(parts))


def read_reference(
    path: str | Path,
    rig: Rig | None = None,
    *,
    memory_bytes: float = MEMORY_BYTES,
    sampling_rate_hz: float | None = None,
    reference_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
) -> PreparedRecording:
    """Read the recording of a healthy machine once, also for many comparisons; of a long one, a part.

    The part has the usual level. Results computed from it are kept with it, for later comparisons in this process.

    Parameters
    ----------
    path : str or Path
    rig : Rig or None
        Of the recording to be compared; see `rig_and_rate_of_reference`.
    memory_bytes : float
        Memory for the analysis of both; the reference may take half of it.
    sampling_rate_hz, speed
        Stated for the recording to be compared, as in `read_recording`; pulse times apply to it alone.
    reference_rate_hz : float or None
        Sampling rate of the reference, where it differs.
    """
    check_rig(rig)
    file = Path(instance_of(path, str | PathLike, "path", remedy="of a recording in memory, analyze takes it itself"))
    modified_ns = file.stat().st_mtime_ns if file.is_file() else 0
    own_speed = None if isinstance(speed, PulseTimes) else speed
    its_rig, rate_hz = rig_and_rate_of_reference(file, rig, sampling_rate_hz, reference_rate_hz)
    with options_named(REFERENCE_OPTIONS):
        return _read_reference(file, its_rig, memory_bytes / 2, rate_hz, own_speed, modified_ns)


@lru_cache(maxsize=1)
def _read_reference(
    path: Path,
    rig: Rig | None,
    memory_bytes: float,
    sampling_rate_hz: float | None,
    speed: SpeedSource | None,
    modified_ns: int,
) -> PreparedRecording:
    del modified_ns  # part of the cache's key: a changed file is another one
    return prepare(
        read_typical_part(path, rig, memory_bytes=memory_bytes, sampling_rate_hz=sampling_rate_hz, speed=speed)
    )


def read_typical_part(
    path: str | Path,
    rig: Rig | None = None,
    *,
    memory_bytes: float = MEMORY_BYTES,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
) -> Recording:
    """Return a recording whole if its analysis fits into memory, else a part of usual level."""
    record = record_blocks(path, rig, sampling_rate_hz=sampling_rate_hz, speed=speed)
    if _fits(record, memory_bytes):
        return record.whole()
    overview = long_overview(record.head, record.n_samples, record.read)
    return record.read(_chosen(record, overview, memory_bytes, (USUAL,))[0][0])


def read_whole(
    path: str | Path, rig: Rig | None = None, *, sampling_rate_hz: float | None = None, speed: SpeedSource | None = None
) -> Recording:
    """Read a whole recording, for callers that need all of it at once; refuse one that needs over half the free memory.

    Raises
    ------
    InputError
        As `read_recording`, and if `analysis_bytes` is more than half of the free memory.
    """
    record = record_blocks(path, rig, sampling_rate_hz=sampling_rate_hz, speed=speed)
    if record.is_parted:
        check_memory(int(_needed_bytes(record.head, record.n_samples)), file_label(path))
    return record.whole()


def _needed_bytes(recording: Recording, n_samples: int | None = None) -> float:
    return analysis_bytes(recording.n_samples if n_samples is None else n_samples, len(recording.channels))


def _fits(record: RecordBlocks, memory_bytes: float) -> bool:
    """Whether a record can be analysed at once; refuse one that cannot and can only be read whole."""
    needed_bytes = _needed_bytes(record.head, record.n_samples)
    if needed_bytes > memory_bytes and not record.is_parted:
        n_channels = len(record.head.channels)
        raise InputError(
            f"{record.n_samples} samples × {n_channels} channels take {needed_bytes / 1e9:.3g} GB to analyse",
            where=record.head.name,
            allowed=f"up to {memory_bytes / 1e9:.3g} GB",
            remedy="give more with --memory, or convert it to HDF5, Parquet, TDMS or WAV, which are read in parts",
        )
    return needed_bytes <= memory_bytes


def long_overview(head: Recording, n_samples: int, read: Callable[[slice], Recording]) -> LongOverview:
    """Return figures of a whole record, read in blocks.

    Parameters
    ----------
    head : Recording
        Its beginning, for channels and rate.
    n_samples : int
        Of the whole record.
    read : callable
        A slice of samples → Recording.
    """
    names = head.vibration_names()
    interval = max(16, round(INTERVAL_S * head.sampling_rate_hz))
    hop = N_PER_SPECTRUM // 2
    figures: list[FloatArray] = []
    sums: list[FloatArray] = []
    n_spectra = 0
    spectra: tuple[Spectrum, ...] = ()
    for first, block in _blocks(head, n_samples, read, interval):
        samples = block.samples[[block.index(name) for name in names]]
        figures += list(
            _figures(samples[:, : _step(head, interval)], interval, last=first + samples.shape[1] >= n_samples)
        )
        # Spectra begin at multiples of half their length in the whole record, as those of the whole record do.
        skip = -first % hop
        n_here = max(0, (min(samples.shape[1], _step(head, interval) + hop) - skip - N_PER_SPECTRUM) // hop + 1)
        if first + samples.shape[1] < n_samples:
            n_here = len(range(first + skip, first + _step(head, interval), hop))
        if n_here:
            end = skip + (n_here - 1) * hop + N_PER_SPECTRUM
            spectra = tuple(
                power_density(row[skip:end], head.sampling_rate_hz, n_per_block=N_PER_SPECTRUM, unit=unit, source=name)
                for row, name, unit in zip(samples, names, _units(head), strict=True)
            )
            new = [spectrum.values * n_here for spectrum in spectra]
            sums = [a + b for a, b in zip(sums, new, strict=True)] if sums else new
            n_spectra += n_here
    rms, peak, crest_factor, kurtosis = np.stack(figures, axis=2)
    return LongOverview(
        names,
        _units(head),
        np.arange(len(figures)) * interval / head.sampling_rate_hz,
        rms,
        peak,
        crest_factor,
        kurtosis,
        tuple(replace(spectrum, values=total / n_spectra) for spectrum, total in zip(spectra, sums, strict=True)),
    )


def _units(recording: Recording) -> tuple[str, ...]:
    return tuple(channel.unit for channel in recording.channels if channel.is_vibration)


def _step(head: Recording, interval: int) -> int:
    """Return the distance between blocks: whole intervals."""
    return max(1, BLOCK_SAMPLES // len(head.channels) // interval) * interval


def _blocks(
    head: Recording, n_samples: int, read: Callable[[slice], Recording], interval: int
) -> Iterator[tuple[int, Recording]]:
    """Yield blocks with their first sample; each reaches a spectrum's length into the next."""
    step = _step(head, interval)
    for first in range(0, n_samples, step):
        yield first, read(slice(first, min(first + step + N_PER_SPECTRUM, n_samples)))


def _figures(x: FloatArray, interval: int, *, last: bool) -> Iterator[FloatArray]:
    """Yield rms, peak, crest factor and kurtosis of each interval, (4, n_channels)."""
    for first in range(0, x.shape[1], interval):
        part = x[:, first : first + interval]
        if part.shape[1] < interval and not (last and part.shape[1] >= interval // 2):
            return
        part = part - part.mean(axis=1, dtype=np.float64, keepdims=True).astype(part.dtype)
        square = part * part
        power = square.mean(axis=1, dtype=np.float64)
        fourth = np.einsum("ij,ij->i", square, square, dtype=np.float64) / part.shape[1]
        rms, peak = np.sqrt(power), np.sqrt(square.max(axis=1).astype(np.float64))
        # For a channel that is dead for an interval both are 0, not 0/0.
        crest_factor, kurtosis = peak / np.maximum(rms, 1e-150), fourth / np.maximum(power**2, 1e-300)
        yield np.stack([rms, peak, crest_factor, kurtosis])


USUAL = "the usual level"


def _chosen(
    record: RecordBlocks, overview: LongOverview, memory_bytes: float, reasons: tuple[str, ...] = ()
) -> list[tuple[slice, str]]:
    """Return the parts to analyse, in order of time, with the reason; only for these reasons, if any."""
    n_part = max(1, int(min(PART_SAMPLES, memory_bytes / _needed_bytes(record.head, 1))))
    level = np.log(np.maximum(overview.rms, 1e-300)).mean(axis=0)
    impulsive = overview.kurtosis.max(axis=0)
    usual = int(np.argmin(np.abs(level - np.median(level))))
    candidates = [
        (usual, USUAL),
        (int(np.argmax(level)), "the highest level"),
        (int(np.argmax(impulsive)), f"the most impulsive second, kurtosis {impulsive.max():.3g}"),
    ]
    chosen: list[tuple[int, str]] = []
    for second, reason in candidates:
        if reasons and reason not in reasons:
            continue
        middle = round((overview.time_s[second] + INTERVAL_S / 2) * record.head.sampling_rate_hz)
        first = min(max(0, middle - n_part // 2), max(0, record.n_samples - n_part))
        if all(abs(first - other) >= n_part // 2 for other, _ in chosen):
            chosen.append((first, reason))
    return [(slice(first, first + n_part), reason) for first, reason in sorted(chosen)]
