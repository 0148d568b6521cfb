"""Read and write recordings in any known format, and read pulse times."""

from __future__ import annotations

import hashlib
import os
import re
import stat
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from os import PathLike
from pathlib import Path

import numpy as np

from gearsig.checks import FloatArray, count, instance_of, missing_file_hint, positive, short
from gearsig.errors import InputError, not_written
from gearsig.formatting import counted, file_label
from gearsig.recording._limits import CHUNK_BYTES, check_memory, foreign_errors, read_text_bytes
from gearsig.recording._table import (
    RawColumn,
    RawTable,
    condition_numbers,
    one_condition,
    one_measurement,
    rate_of_time,
    refuse_spectrum,
    rises,
    seconds_per_value,
    time_among,
    with_pulse_channels,
)
from gearsig.recording._types import (
    SECONDS_PER_UNIT,
    Channel,
    Provenance,
    Recording,
    check_recording,
    is_unit,
    quantity_of,
    split_unit,
)
from gearsig.recording.formats import CSV, FORMATS, FileFormat
from gearsig.recording.formats._csv import find_layout, line_of_row, parse_rows
from gearsig.rig import (
    RPM_UNITS,
    SI_FACTORS,
    ConstantSpeed,
    EncoderChannel,
    PulseTimes,
    Rig,
    SpeedChannel,
    SpeedSource,
    TachometerChannel,
    check_rig,
    check_speed_source,
    si_factor,
)


def read_recording(
    path: str | Path,
    *,
    rig: Rig | None = None,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
    part: slice | None = None,
) -> Recording:
    """Read a recording from CSV, MAT v5 or v7.3, WAV, HDF5, Parquet, TDMS, UFF58 or MF4.

    The extension and the content must agree. Nothing in a file is ever executed: pickles are refused, external links
    in HDF5 are not followed.

    Parameters
    ----------
    path : str or Path
        "runs.mat#2" is the second of several runs stored side by side in one file: column 2, not counting the time, as
        a recording with one channel, "vibration". Thus one run can be the reference of another. Where channel names
        contain the number of their measurement ("X098_DE_time", "X099_DE_time"), "#98" selects that measurement.
    rig : Rig, optional
        Its sensors give the channels quantity, unit, scale and position; its speed and sampling rate are used if the
        file has none.
    sampling_rate_hz : float, optional
        Overrides the file's. A difference of more than 0.1 % is reported in `Recording.warnings`.
    speed : SpeedSource, optional
        Overrides the file's and the rig's; but a constant speed only checks one that is measured, as the nominal speed
        of the recording's rig, and a warning says so.
    part : slice, optional
        Only these samples of each channel, for HDF5, Parquet, TDMS or WAV: nothing else is decoded, and no hash is
        computed. Pulse times in the file are limited to this part and counted from its beginning.

    Returns
    -------
    Recording
        Samples in float32 if it holds the file's numbers exactly, else in float64; what the reader noticed in
        `warnings`; file name (without folder) and SHA-256 in `provenance`.

    Raises
    ------
    InputError
        If the file is missing, empty, damaged, too large for the memory, of another kind than its extension says, or
        holds columns that do not form a recording; or if no sampling rate is known.
    """
    check_rig(rig)
    check_speed_source(speed)
    instance_of(part, slice | None, "part", remedy="write slice(first, last)")
    file, condition = without_condition(_as_path(path))
    file_format, name = identify(file), file_label(file)
    with foreign_errors(name, file_format.name):
        table = file_format.read(file) if part is None else _part_reader(file_format, name)(file, part)
        if condition is not None:
            table, name = one_condition(table, condition, file.name), f"{name}#{condition}"
        else:
            table = one_measurement(table, None, file.name)
        sha256 = sha256_of(file) if part is None else ""
        if part is None:  # a part may hold no pulses
            table = with_pulse_channels(table)
        recording = assemble(table, name, sha256, rig=rig, sampling_rate_hz=sampling_rate_hz, speed=speed)
        return recording if part is None else _with_pulses_within(recording, part.start or 0)


def _as_path(path: str | Path) -> Path:
    """Return as a path what was given as a path or as text."""
    return Path(instance_of(path, str | PathLike, "path", remedy="name one file"))


def n_samples_of(path: str | Path) -> int | None:
    """Return the number of samples per channel of a file without decoding them; None if it can only be read whole.

    Parameters
    ----------
    path : str or Path

    Raises
    ------
    InputError
        As `read_recording`.
    """
    file, condition = without_condition(_as_path(path))
    file_format = identify(file)
    if file_format.length is None or condition is not None:
        return None
    with foreign_errors(file_label(file), file_format.name):
        try:
            return file_format.length(file)
        except ValueError:  # 24-bit samples cannot be memory-mapped
            return None


def _part_reader(file_format: FileFormat, where: str) -> Callable[[Path, slice], RawTable]:
    if file_format.read_part is None:
        parted = ", ".join(f.name for f in FORMATS if f.read_part is not None)
        raise InputError(f"{file_format.name} can only be read whole", where=where, allowed=parted, remedy="convert it")
    return file_format.read_part


def _with_pulses_within(recording: Recording, first: int) -> Recording:
    """Limit the pulse times of the whole record to a part of it, and shift them."""
    speed, start_s = recording.speed, first / recording.sampling_rate_hz
    if not isinstance(speed, PulseTimes):
        return recording
    within = (speed.times_s >= start_s) & (speed.times_s <= start_s + recording.duration_s)
    return replace(recording, speed=replace(speed, times_s=speed.times_s[within] - start_s))


def without_condition(path: Path) -> tuple[Path, int | None]:
    """Return the file and run that "runs.mat#2" names; if a file has exactly that name, return it and None."""
    name, sign, number = path.name.rpartition("#")
    if not (sign and name and number.isascii() and number.isdigit()):
        return path, None
    with suppress(OSError, ValueError):
        path.lstat()
        return path, None
    return path.with_name(name), int(number)


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes in hexadecimal digits, read in chunks."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while chunk := file.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


FORMAT_OF_EXTENSION = {ending: file_format for file_format in FORMATS for ending in file_format.endings}
"""Extension → format that it promises."""

FORMAT_NAMES = f"{', '.join(f.name for f in FORMATS[:-1])} or {FORMATS[-1].name}"
"""All formats in one phrase, for messages."""

ALLOWED_EXTENSIONS = " ".join(FORMAT_OF_EXTENSION) + ", text also with .gz"


# Content that is not a recording, so that the error can name it.
_FOREIGN = (
    (b"TDSh", "a TDMS index without its data"),
    (b"\x93NUMPY", "a NumPy array file"),
    (b"PK\x03\x04", "a ZIP archive (XLSX, NPZ, …)"),
    (b"\xd0\xcf\x11\xe0", "an old Office document"),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"fLaC", "FLAC audio"),
    (b"OggS", "Ogg audio"),
    (b"\x7fELF", "a program"),
    (b"BZh", "a bzip2 archive"),
    (b"\xfd7zXZ", "an xz archive"),
    (b"\x28\xb5\x2f\xfd", "a Zstandard archive"),
    (b"7z\xbc\xaf", "a 7-Zip archive"),
)
# Pickle protocols 2 to 5 begin with a number; 0 and 1 are text: an opening mark, or a global "cmodule\nname\n".
_TEXT_PICKLE = re.compile(rb"\A(?:\((?:dp|lp|[dl]|i)\d*\n|c[\w.]+\n[\w.]+\n|[\])}]q|\(c[\w.]+\n[\w.]+\n)")
_MARKUP = re.compile(rb"\A\s*<(?:!doctype|html|\?xml|svg|script)", re.IGNORECASE)


_EXPORTS = dict.fromkeys(
    (".dxd", ".dxz", ".d7d", ".d7z"), "only Dewesoft reads its own files: export as MAT, MF4, HDF5, UFF58 or text"
)
"""Extensions of proprietary files → what to do."""


def identify(path: Path) -> FileFormat:
    """Return the format of a regular file after checking that content and extension agree.

    Raises
    ------
    InputError
        If there is no such file, it is empty or not a regular file, its extension is unknown, or its content is of
        another kind than the extension says.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:
        hint = ""
        if path.name:
            whole = path.with_name(path.name.rpartition("#")[0] or path.name)
            hint = _columns_hint(whole) if whole != path and whole.exists() else missing_file_hint(path)
        reason = getattr(error, "strerror", None) or str(error)
        raise InputError(
            f"cannot be opened ({reason})", where=path.name or str(path), allowed="a readable file", remedy=hint
        ) from None
    if not stat.S_ISREG(status.st_mode):
        what, remedy = "is no regular file", "name the file itself"
        if stat.S_ISDIR(status.st_mode):
            what, remedy = "is a folder", "name a file in it, or analyse all of them: gearsig report FOLDER -o report"
        raise InputError(what, where=path.name or str(path), allowed="one file", remedy=remedy)
    if status.st_size == 0:
        raise InputError("is empty", where=path.name, allowed="a file with data", remedy="copy or export it again")
    endings = [suffix.lower() for suffix in path.suffixes] or [""]
    packed = endings[-1] == ".gz"
    promised = FORMAT_OF_EXTENSION.get(endings[-2] if packed and len(endings) > 1 else endings[-1])
    if packed and promised is not CSV:
        raise InputError(
            "only text files are read compressed",
            where=path.name,
            allowed=ALLOWED_EXTENSIONS,
            remedy="unpack it with gunzip",
        )
    with path.open("rb") as file:
        head = file.read(4096)
    kind = content_kind(head)
    if promised is None and not is_ending(endings[-1]):
        promised = next((f for f in FORMATS if f.sniff(head) == kind), None)
    if promised is None:
        raise InputError(
            f"extension {path.suffix or '(none)'!r} is not known; the content looks like {kind}",
            where=path.name,
            allowed=ALLOWED_EXTENSIONS,
            remedy=_EXPORTS.get(endings[-1], "rename or convert the file"),
        )
    if promised.sniff(head) == kind:
        return promised
    hint = "rename it if only the extension is wrong, or export it again"
    if "zero bytes" in kind:
        hint = "the file was not written completely: copy or export it again"
    elif kind == "a Python pickle":
        hint = "pickles can run code and are never opened; export the data as CSV, MAT or HDF5"
    raise InputError(
        f"the extension says {promised.name}, but the content is {kind}",
        where=path.name,
        allowed=f"content that fits {path.suffix or 'the extension'}",
        remedy=hint,
    )


def is_ending(suffix: str) -> bool:
    """Whether a suffix indicates the format of a file: digits, as at the end of a date, do not.

    Examples
    --------
    >>> is_ending(".csv"), is_ending(Path("2004.02.12.10.32.39").suffix), is_ending("")
    (True, False, False)
    """
    return not suffix[1:].isdigit() and suffix != ""


def _columns_hint(file: Path) -> str:
    """Return a remedy that lists the runs of a file, for a name with "#" but no valid run number."""
    try:
        file_format = identify(file)
        with foreign_errors(file.name, file_format.name):
            numbers = ", ".join(condition_numbers(file_format.read(file)))
    except InputError:
        return f"name {file.name} alone, or a column of it by its number: {file.name}#1"
    return f"of {file.name} there are: {numbers}"


def content_kind(head: bytes) -> str:
    """Name the kind of content from a file's first bytes, never by trying to open it."""
    if not head.strip(b"\0"):
        return "zero bytes"
    if head[:2] in (b"\x80\x02", b"\x80\x03", b"\x80\x04", b"\x80\x05") or _TEXT_PICKLE.match(head):
        return "a Python pickle"
    if head[:4] in (b"RIFF", b"RIFX", b"RF64") and head[8:12] != b"WAVE":
        return "RIFF but not WAVE"
    if _MARKUP.match(head):
        return "HTML or XML"
    text, *binary = FORMATS
    foreign = (kind for start, kind in _FOREIGN if head.startswith(start))  # after known formats, which may be archives
    kind = next(filter(None, (*(f.sniff(head) for f in reversed(binary)), *foreign, text.sniff(head))), "")
    if not kind and b"\0" in head and b"\0" not in head.rstrip(b"\0"):
        return "text followed by zero bytes"
    return kind or "binary data of an unknown kind"


WRITERS = {ending: f.write for f in FORMATS if f.write is not None for ending in f.written_endings}
"""Extension → function that writes a recording."""


def write_recording(recording: Recording, path: str | Path) -> Path:
    """Write a recording in the format of the extension, so that `read_recording` returns it again.

    Every format keeps sampling rate, names, quantities, units, positions, the recording's own speed source, truth,
    warnings and history. What is lost:

    - All formats: the rig, which is a separate file, and with it a speed source that only the rig has; the hash and
      reader of the file that the recording came from. Sensor scales that were applied stay applied.
    - WAV: float64 becomes float32, and other software sees the rate rounded to whole hertz.
    - Other software sees samples, names and rate, but quantities, positions, speed source and truth only as JSON.

    Parameters
    ----------
    recording : Recording
    path : str or Path
        .csv, .h5, .hdf5, .parquet, .wav or .mat (version 5); an existing file is replaced.

    Returns
    -------
    Path
        The file written.

    Raises
    ------
    InputError
        If the extension is not known, the folder is missing, or the format cannot hold the recording. Nothing is
        written then: the file is written under a temporary name and renamed when complete.
    """
    check_recording(recording)
    target = recording_target(path)
    writer = WRITERS[target.suffix.lower()]
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem[:32]}-", suffix=target.suffix)
    except OSError as error:
        raise not_written(error, target.name, "choose a folder that can be written to") from error
    os.close(handle)
    unfinished = Path(name)
    try:
        writer(recording, unfinished)
        mask = os.umask(0)  # the process's mask, which temporary files ignore
        os.umask(mask)
        unfinished.chmod(0o666 & ~mask)
        unfinished.replace(target)
    except OSError as error:
        raise not_written(error, target.name, "make room on the disk, or choose another folder") from error
    finally:
        unfinished.unlink(missing_ok=True)
    return target


def recording_target(path: str | Path) -> Path:
    """Return the path of a recording to be written, after checking that `write_recording` accepts it.

    Raises
    ------
    InputError
        If the extension is not known, or the folder is missing.
    """
    target = _as_path(path)
    if target.suffix.lower() not in WRITERS:
        raise InputError(
            f"extension {target.suffix or '(none)'!r} cannot be written",
            where=target.name,
            allowed=" ".join(WRITERS),
            remedy="choose one of these",
        )
    if not target.parent.is_dir():
        raise InputError(
            f"folder {str(target.parent)!r} does not exist", where=target.name, remedy="make the folder first"
        )
    return target


def read_pulse_times(path: str | Path, pulses_per_revolution: int = 1, shaft: str = "") -> PulseTimes:
    """Read pulse times from a text file with one column, in seconds unless its header states another unit.

    Parameters
    ----------
    path : str or Path
        Text with one time per line, with or without a header ("time [ms]").
    pulses_per_revolution : int
    shaft : str
        The shaft that carries the pulse wheel.

    Returns
    -------
    PulseTimes
        On the time axis of the recording that they belong to.

    Raises
    ------
    InputError
        If there are fewer than two pulses or more than one column, or if a time is not later than the one before; the
        error names the line.
    """
    count(pulses_per_revolution, "pulses_per_revolution")
    file = _as_path(path)
    with foreign_errors(file.name, "pulse times"):
        return PulseTimes(_pulse_times_s(file), pulses_per_revolution, shaft)


def _pulse_times_s(file: Path) -> FloatArray:
    where = file.name
    if (file_format := identify(file)) is not CSV:
        raise InputError(
            f"is {file_format.name}", where=where, allowed="text with one pulse time per line", remedy="export as text"
        )
    data = read_text_bytes(file)
    if not any(c in b"0123456789" for c in data[: 1 << 20]):
        raise InputError(
            "holds no pulses",
            where=where,
            allowed="at least two pulse times",
            remedy="check the sensor and the trigger",
        )
    layout = find_layout(data, where)
    if layout.n_columns != 1:
        raise InputError(
            f"has {layout.n_columns} columns", where=where, allowed="one column of times", remedy="keep only the times"
        )
    (times,) = parse_rows(data, layout, ("time",), where)
    bad = np.flatnonzero(~np.isfinite(times))
    if len(bad):
        raise InputError(
            f"line {line_of_row(data, layout, int(bad[0]))}: the time is {times[bad[0]]}",
            where=where,
            allowed="finite numbers",
            remedy="remove the line knowingly",
        )
    if len(times) < 2:
        raise InputError(
            "holds only one pulse",
            where=where,
            allowed="at least two pulse times",
            remedy="one pulse gives no speed: check the sensor and the trigger",
        )
    back = np.flatnonzero(np.diff(times) <= 0)
    if len(back):
        i = int(back[0])
        verb = "runs backwards" if times[i + 1] < times[i] else "stands still"
        raise InputError(
            f"line {line_of_row(data, layout, i + 1)}: time {verb}, {times[i]:.9g} is followed by {times[i + 1]:.9g}",
            where=where,
            allowed="strictly increasing times",
            remedy="sort out where the counter restarted, or cut the file there",
        )
    unit = split_unit(layout.header[0])[1].casefold() if layout.header else ""
    if unit not in SECONDS_PER_UNIT:
        raise InputError(
            f"the unit of the times is {unit!r}",
            where=where,
            allowed="s, ms, us, min",
            remedy="convert them to seconds",
        )
    return times * SECONDS_PER_UNIT[unit]


# --------------------
# The one place where the columns of a file become a Recording: rate, time, names, lengths, gaps.
# --------------------


PULSE_TIMES = (
    "tachometer pulse times are given along with their recording: gearsig analyze RECORDING --tach-times FILE "
    "(in Python speed=gearsig.recording.read_pulse_times(path))"
)


def assemble(
    table: RawTable,
    source: str,
    sha256: str,
    *,
    rig: Rig | None = None,
    sampling_rate_hz: float | None = None,
    speed: SpeedSource | None = None,
) -> Recording:
    """Return the recording that a file's table describes.

    Parameters
    ----------
    table : RawTable
    source : str
        File name.
    sha256 : str
    rig, sampling_rate_hz, speed
        As in `read_recording`.

    Raises
    ------
    InputError
        If columns differ in length, names occur twice, values are text, complex, NaN or infinite, the time column is
        not uniform, or no sampling rate is known.
    """
    table = _checked(table, source)
    rate_hz, rate_warnings = _sampling_rate(table, source, rig, sampling_rate_hz)
    channels = tuple(
        Channel(c.name, c.quantity or quantity_of(c.name, c.unit), c.unit, c.position) for c in table.columns
    )
    checks: tuple[str, ...] = ()
    if isinstance(speed, ConstantSpeed) and (measured := _measured(table, channels, rig)):
        checks = (f"the speed is taken from {measured}; the stated {speed.speed_rpm:g} rpm is compared with it",)
        rig, speed = _with_nominal(rig, speed), None
    speed, speed_warnings = _speed(table, channels, rig, speed)
    if speed is None and not table.is_own_layout and (rig is None or rig.speed is None):
        speed_warnings = (*speed_warnings, *_unused_pulses(table, channels))
        if rig is None or rig.operating_point.speed_rpm is None:
            speed_warnings = (*speed_warnings, *_unused_name(source))
    recording = Recording(
        _stack(table, source),
        rate_hz,
        channels,
        speed=speed,
        provenance=Provenance(source, sha256, table.reader, table.history),
        truth=table.truth,
        warnings=(*table.warnings, *rate_warnings, *checks, *speed_warnings),
    )
    recording = recording if rig is None else recording.with_rig(rig)
    if table.is_own_layout:
        return recording
    recording = _with_quantity_of_speed(recording)
    return replace(recording, warnings=(*recording.warnings, *_unknown_units(recording)))


def _unknown_units(recording: Recording) -> Iterator[str]:
    """Warn of units that are not known, or not units of their channel's quantity."""

    def is_known(c: Channel) -> bool:
        if c.quantity in SI_FACTORS:
            return si_factor(c.quantity, c.unit) is not None
        return c.quantity != "unknown" or is_unit(c.unit)  # a tachometer's or an encoder's is their speed source's

    shown = [
        f"{short(c.unit)} of channel {c.name!r}" + f" ({c.quantity.replace('_', ' ')})" * (c.quantity != "unknown")
        for c in recording.channels
        if c.unit not in ("", "-", "1") and not is_known(c)
    ]
    if shown:
        yield (
            f"not known as a unit: {', '.join(shown[:4])}{', …' * (len(shown) > 4)}; the values are neither converted "
            "nor compared with limits: state quantity, unit and scale in a [[sensor]] table of the rig file"
        )


def _with_quantity_of_speed(recording: Recording) -> Recording:
    """Return the recording with the quantity of the speed source's channel set, if it was unknown."""
    quantities = {TachometerChannel: "tachometer", EncoderChannel: "encoder", SpeedChannel: "rotational_speed"}
    source = recording.speed_source
    quantity, name = quantities.get(type(source), ""), getattr(source, "channel", "")
    if not quantity or all((c.name, c.quantity) != (name, "unknown") for c in recording.channels):
        return recording
    channels = tuple(replace(c, quantity=quantity) if c.name == name else c for c in recording.channels)
    return replace(recording, channels=channels)


def _checked(table: RawTable, source: str) -> RawTable:
    """Return the table with a time column moved out of the channels; refuse columns that are not signals."""
    counts = Counter(c.name for c in (*table.columns, *([table.time] if table.time else [])))
    doubled = [name for name, n in counts.items() if n > 1]
    if doubled:
        raise InputError(
            f"column names occur more than once: {', '.join(map(repr, doubled))}",
            where=source,
            allowed="names that differ",
            remedy="rename the columns",
        )
    if table.time is None and not table.is_own_layout:
        time = time_among(table.columns) or _time_of_rate(table)
        if time is not None and len(table.columns) == 1:
            raise InputError(
                f"the only column, {time.name!r}, is a time",
                where=source,
                allowed="at least one channel",
                remedy=PULSE_TIMES,
            )
        if time is not None:
            table = replace(table, columns=tuple(c for c in table.columns if c is not time), time=time)
        elif table.sampling_rate_hz is None:
            refuse_spectrum(where=source, columns=table.columns)
    if not 0 < len(table.columns) <= 4096:
        raise InputError(
            f"{len(table.columns)} channels were found",
            where=source,
            allowed="1 to 4096",
            remedy="check that the file holds signals over time",
        )
    columns = table.columns if table.time is None else (table.time, *table.columns)
    for column in columns:
        if column.values.dtype.kind not in "fiub" or column.values.ndim != 1:
            dimensions = counted(column.values.ndim, "dimension")
            raise InputError(
                f"channel {column.name!r} holds {column.values.dtype} values of {dimensions}",
                where=source,
                allowed="real numbers over time",
                remedy="export the time signal",
            )
    lengths = {c.name: len(c.values) for c in columns}
    if len(set(lengths.values())) > 1:
        shown = ", ".join(f"{name!r} {n}" for name, n in list(lengths.items())[:8])
        raise InputError(
            f"the channels differ in length: {shown}",
            where=source,
            allowed="channels of equal length and rate",
            remedy="split the file into one for each length",
        )
    if not len(columns[0].values):
        raise InputError(
            "there are no samples", where=source, allowed="at least one", remedy="check that it was written completely"
        )
    return table


def _time_of_rate(table: RawTable) -> RawColumn | None:
    """Return the first column, whatever its name, if it rises by the stated sampling interval."""
    first, rate_hz = table.columns[0], table.sampling_rate_hz
    if len(table.columns) < 2 or rate_hz is None or first.unit or not rises(first.values):
        return None
    steps = np.diff(first.values.astype(np.float64))
    is_even = abs(float(steps.mean()) * rate_hz - 1.0) < 1e-3
    return first if is_even and np.ptp(steps) <= 0.5 * steps.mean() else None


RATE_GIVEN = "the sampling rate given"
"""Start of the warning that an argument goes before the sampling rate that a file or its rig file states."""


def _sampling_rate(
    table: RawTable, source: str, rig: Rig | None, explicit_hz: float | None
) -> tuple[float, tuple[str, ...]]:
    """Return the rate in Hz by precedence (argument, file, rig), and warnings."""

    def differ(a: float, b: float) -> bool:
        return abs(a - b) > 1e-3 * abs(b)

    file_hz, timed_hz, of_time = table.sampling_rate_hz, None, tuple[str, ...]()
    rig_hz = None if rig is None else rig.sampling_rate_hz
    if table.time is not None:
        scale_s = seconds_per_value(table.time)
        where = f"{source}, column {table.time.name!r}"
        timed_hz, of_time = rate_of_time(table.time.values, scale_s, where, table.row_place)
    if file_hz is None:
        file_hz = timed_hz
    else:
        positive(file_hz, f"{source}: sampling rate in the file", "Hz", remedy="correct it there")
    if file_hz is None and len(table.columns) == 1 and _looks_like_times(table.columns[0]):
        raise InputError(
            f"the only column, {table.columns[0].name!r}, rises from each value to the next, as pulse times do and "
            "vibration does not",
            where=source,
            allowed="a signal over time",
            remedy=f"{PULSE_TIMES}; if it is a signal, state its unit in a header, e.g. angle [rad], and give --fs",
        )
    if explicit_hz is not None:
        chosen_hz = positive(explicit_hz, f"{source}: sampling rate given", "Hz", remedy="give --fs above zero")
        stated = {"file": file_hz, "rig file": rig_hz}
        others = [f"the {name} states {hz:.9g} Hz" for name, hz in stated.items() if hz and differ(chosen_hz, hz)]
        return chosen_hz, (f"{RATE_GIVEN}, {chosen_hz:g} Hz, was taken; {' and '.join(others)}",) * bool(others)
    if file_hz is not None and timed_hz is not None and differ(file_hz, timed_hz):
        raise InputError(
            f"a rate of {file_hz:g} Hz is stated, the time column gives {timed_hz:.9g} Hz",
            where=source,
            allowed="statements that agree within 0.1 %",
            remedy="give the true one as --fs",
        )
    if file_hz is None and rig_hz is None:
        remedy = "give --fs or sampling_rate_hz in the rig file"
        raise InputError("states no sampling rate", where=source, allowed="above 0 Hz", remedy=remedy)
    if file_hz is not None and rig_hz is not None and differ(file_hz, rig_hz):
        text = f"the rig states a sampling rate of {rig_hz:g} Hz, the file {file_hz:.9g} Hz: the file's was taken"
        return file_hz, (*of_time, text)
    return file_hz or rig_hz or 0.0, of_time


def _looks_like_times(column: RawColumn) -> bool:
    """Whether values of no known quantity start at zero or above and always increase.

    Pulse times do so, vibration does not: of the orders of n noise values one in n! increases, one in 3.6 million for
    ten values.
    """
    values = column.values.astype(np.float64)
    unknown = (column.quantity or quantity_of(column.name, column.unit)) == "unknown"
    return unknown and len(values) >= 10 and bool(values[0] >= 0) and bool(np.all(np.diff(values) > 0))


def _stack(table: RawTable, source: str) -> FloatArray:
    """Return the samples (channel, time) in float32 if that loses nothing, else in float64."""
    kinds = {c.values.dtype for c in table.columns}
    dtype = np.float32 if all(np.can_cast(kind, np.float32, "safe") for kind in kinds) else np.float64
    n_samples = len(table.columns[0].values)
    check_memory(n_samples * len(table.columns) * np.dtype(dtype).itemsize, source)
    samples = np.empty((len(table.columns), n_samples), dtype)
    for row, column in zip(samples, table.columns, strict=True):
        with np.errstate(invalid="ignore"):  # a signalling NaN, which the next line finds
            row[:] = column.values
        bad = np.flatnonzero(~np.isfinite(row))
        if len(bad):
            place = table.row_place(int(bad[0]))
            raise InputError(
                f"channel {column.name!r} holds {counted(len(bad), 'NaN or infinite value')}, the first at {place}",
                where=source,
                allowed="finite numbers",
                remedy="cut out the gap or interpolate it before the analysis, knowingly",
            )
    return samples


def _measured(table: RawTable, channels: tuple[Channel, ...], rig: Rig | None) -> str:
    """Return in words where the file has a measured speed that it or the rig names; empty if nowhere."""
    names = {*(c.name for c in channels), *table.pulse_times_s}
    of_file = table.is_own_layout and table.speed is not None  # goes before the rig's
    for source in (table.speed, None if rig is None or of_file else rig.speed):
        if isinstance(source, PulseTimes):
            return "pulse times"
        if source is not None and not isinstance(source, ConstantSpeed) and source.channel in names:
            return f"channel {source.channel!r}"
    return ""


def _with_nominal(rig: Rig | None, stated: ConstantSpeed) -> Rig:
    """Return the rig with a stated speed as its nominal one, converted to the shaft of its operating point."""
    rig = Rig() if rig is None else rig
    point = rig.operating_point
    ratio = rig.ratio(point.shaft or rig.reference_shaft, to=stated.shaft)
    return rig if ratio is None else replace(rig, operating_point=replace(point, speed_rpm=ratio * stated.speed_rpm))


def _speed(
    table: RawTable, channels: tuple[Channel, ...], rig: Rig | None, speed: SpeedSource | None
) -> tuple[SpeedSource | None, tuple[str, ...]]:
    """Return the speed source by precedence (argument, measured, stated in the file or the rig), and warnings."""
    if speed is not None or table.is_own_layout:
        return (table.speed, ()) if speed is None else (speed, _contradicted(speed, table, rig))
    known = None if rig is None else rig.speed
    measured = known is not None and not isinstance(known, ConstantSpeed)
    given = table.speed
    if isinstance(known, TachometerChannel) and known.channel in table.pulse_times_s:
        given = PulseTimes(table.pulse_times_s[known.channel], known.pulses_per_revolution, known.shaft)
    if given is not None and not isinstance(given, ConstantSpeed):
        return given, ()
    in_rpm = [c for c in channels if c.quantity == "rotational_speed" and c.unit.casefold() in RPM_UNITS]
    if known is None and len(in_rpm) == 1:
        name = in_rpm[0].name
        return SpeedChannel(name), (f"channel {name!r} is in {in_rpm[0].unit} and was taken as the shaft speed",)
    if given is None or measured:
        return None, ()
    of_file = given.speed_rpm
    text = f"the file states {of_file:g} rpm, which was taken as the speed of the reference shaft"
    if isinstance(known, ConstantSpeed):
        if abs(of_file - known.speed_rpm) <= 1e-3 * of_file:
            return None, ()
        text = f"the rig states a speed of {known.speed_rpm:g} rpm, the file {of_file:g} rpm: the file's was taken"
    return ConstantSpeed(of_file, known.shaft if known is not None else ""), (text,)


def _unused_pulses(table: RawTable, channels: tuple[Channel, ...]) -> Iterator[str]:
    """Warn of pulses that no rig file names, and say how to use them: the pulses per revolution are not known."""
    for name in (*table.pulse_times_s, *(c.name for c in channels if c.quantity == "tachometer")):
        yield (
            f'{name!r} holds pulses like a tachometer: [speed] with source = "tachometer", channel = "{name}" and '
            "pulses_per_revolution = … in a rig file takes the speed from them"
        )


_SPEED_IN_NAME = re.compile(r"(?<![A-Za-z0-9.,])(\d{2,6}(?:[.,]\d{1,2})?)[ _-]?rpm(?![A-Za-z])", re.IGNORECASE)


def speed_in_name(name: str) -> float | None:
    """Return the speed in rpm that a file name states; None if it states none or several.

    Examples
    --------
    >>> [speed_in_name(name) for name in ("pump_1000rpm.csv", "X209RPM.mat", "from 600 rpm to 900 rpm.h5")]
    [1000.0, None, None]
    """
    stated = {float(text.replace(",", ".")) for text in _SPEED_IN_NAME.findall(name)} - {0.0}
    return stated.pop() if len(stated) == 1 else None


def _unused_name(source: str) -> Iterator[str]:
    """Suggest the speed that a file name states; it was not measured and may be that of another shaft."""
    speed_rpm = speed_in_name(source)
    if speed_rpm is not None:
        yield f"the file name says {speed_rpm:g} rpm, which is not used: give --speed-rpm {speed_rpm:g} to use it"


def _contradicted(given: SpeedSource, table: RawTable, rig: Rig | None) -> tuple[str, ...]:
    """Return a warning if the file or rig states another constant speed than the one given and used."""
    if not isinstance(given, ConstantSpeed):
        return ()
    stated = {"file": table.speed, "rig": None if rig is None else rig.speed}
    others = [
        f"the {name} states {source.speed_rpm:g} rpm"
        for name, source in stated.items()
        if isinstance(source, ConstantSpeed)
        and (source.shaft == given.shaft or "" in (source.shaft, given.shaft))
        and abs(source.speed_rpm - given.speed_rpm) > 1e-3 * source.speed_rpm
    ]
    return (f"the speed {given.speed_rpm:g} rpm was given and taken; {' and '.join(others)}",) if others else ()
