"""Find recordings and the machine, measuring point and date of each."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from functools import cache
from pathlib import Path

from gearsig.checks import missing_file_hint
from gearsig.errors import InputError
from gearsig.formatting import counted, file_label
from gearsig.rig import Rig, read_rig, rig_file_beside

FIELDS = ("machine", "point", "date", "number", "speed")
"""Fields that a pattern may name, besides `{}` for parts to be ignored."""

NUMBERS_BEGIN = datetime(2000, 1, 1)  # noqa: DTZ001 - as all dates here
"""Date from which running numbers count if none is stated."""

LONGEST_NAME = 200

_FIELD = re.compile(r"\{(?P<name>\w*)(?::(?P<form>[^{}]*))?\}")
_FORMS = {
    "%Y": r"\d{4}",
    "%y": r"\d\d",
    "%m": r"\d\d",
    "%d": r"\d\d",
    "%H": r"\d\d",
    "%I": r"\d\d",
    "%M": r"\d\d",
    "%S": r"\d\d",
    "%j": r"\d{3}",
    "%f": r"\d{1,6}",
    "%b": r"[A-Za-z]{3}",
    "%p": r"[AaPp][Mm]",
    "%%": "%",
}
_DATE_IN_NAME = re.compile(
    r"(?<!\d)(?P<day>(?:19|20)\d\d[-_.]?[01]\d[-_.]?[0-3]\d)"
    r"(?:[-_.T ]?(?P<time>[0-2]\d[-_.:h]?[0-5]\d(?:[-_.:m]?[0-5]\d)?)"
    r"(?:[-_ ]?(?P<half>[AaPp][Mm])(?![A-Za-z]))?)?(?!\d)"
)


@dataclass(frozen=True)
class Origin:
    """File of a recording, and the machine, point and date it belongs to.

    Parameters
    ----------
    path : Path
        Absolute.
    machine, point : str
        The point is empty if nothing names one; the channels then distinguish the places.
    date : datetime
        Without time zone, as stated by a name or folder; file times are in UTC.
    machine_from, point_from, date_from : str
        Source of each: "pattern", "folder", "rig file", "file name", "time of the file", "stated", "none".
    n_bytes, mtime_ns : int
        Of the file, when it was found.
    speed_rpm : float or None
        Stated by the name or an argument: nominal, as in a rig file's operating point.
    speed_from : str
        Source of the speed.
    """

    path: Path
    machine: str
    point: str
    date: datetime
    machine_from: str
    point_from: str
    date_from: str
    n_bytes: int
    mtime_ns: int
    speed_rpm: float | None = None
    speed_from: str = "none"


@dataclass(frozen=True)
class ExcludedFile:
    """File of a recording that a pattern leaves out.

    Parameters
    ----------
    path : Path
        Absolute.
    reason : str
        "does not match the pattern", or which part of its name is not a date.
    """

    path: Path
    reason: str


@dataclass(frozen=True)
class FilePattern:
    """A pattern of paths such as "{machine}/{point}_{date:%Y%m%d}.csv", matched from a path's end.

    `{machine}` and `{point}` are text without "/", `{date:…}` has the fields of `strptime`, `{number:10min}` is a
    running number of recordings at this interval, `{speed}` is a speed in rpm, `{}` and `*` match anything but "/",
    and `**` also matches "/".
    """

    text: str

    def __post_init__(self) -> None:
        self._compiled()

    def match(
        self, path: Path, root: Path | None = None
    ) -> dict[str, str | float | datetime | timedelta] | ExcludedFile:
        """Return the values of the pattern's fields in a path, or why the path does not match.

        The pattern is tried first on the whole path below `root`.

        Examples
        --------
        >>> found = FilePattern("{machine}/{point}_{date:%Y%m%d}.csv").match(Path("/data/pump 3/DE_20260131.csv"))
        >>> found["machine"], found["point"], found["date"].isoformat()
        ('pump 3', 'DE', '2026-01-31T00:00:00')
        >>> FilePattern("{point}_{date:%Y%m%d}.csv").match(Path("/data/DE_20261301.csv")).reason
        '20261301 is no date in the form %Y%m%d'
        """
        expression, form = self._compiled()
        match = None
        if root is not None and path.is_relative_to(root):
            match = expression.fullmatch(path.relative_to(root).as_posix())
        match = match or expression.search(path.absolute().as_posix())
        if match is None:
            return ExcludedFile(path.absolute(), "does not match the pattern")
        result: dict[str, str | float | datetime | timedelta] = {
            k: v for k, v in match.groupdict().items() if k != "date"
        }
        if "speed" in result:
            result["speed"] = float(match["speed"].replace(",", "."))
        if isinstance(form, timedelta):
            result["number"] = int(match["number"]) * form
        elif form:
            try:
                result["date"] = datetime.strptime(match["date"], form)  # noqa: DTZ007 - as the name states it
            except ValueError:  # the 31st of February
                return ExcludedFile(path.absolute(), f"{match['date']} is no date in the form {form}")
        return result

    def _compiled(self) -> tuple[re.Pattern[str], str | timedelta]:
        return _compile(self.text)


@cache
def _compile(text: str) -> tuple[re.Pattern[str], str | timedelta]:
    where, parts, end = "--pattern", ["(?:^|/)"], 0
    form: str | timedelta = ""
    names: set[str] = set()
    for field in _FIELD.finditer(text):
        parts.append(_literal(text[end : field.start()]))
        name, end = field["name"], field.end()
        if name and name not in FIELDS:
            raise InputError(f"{{{name}}} is not known", where=where, allowed=", ".join(f"{{{n}}}" for n in FIELDS))
        if name in names:
            raise InputError(f"{{{name}}} occurs twice", where=where)
        if bool(field["form"]) != (name in ("date", "number")):
            remedy = "write for example {date:%Y%m%d}, {number:10min} or {machine}"
            raise InputError(f"{field[0]} is not understood", where=where, remedy=remedy)
        names.add(name)
        if {"date", "number"} <= names:
            raise InputError("date and number both occur", where=where, remedy="keep the date")
        if name == "date":
            form = field["form"]
            parts.append(f"(?P<date>{_of_form(form)})")
        elif name == "number":
            form = _interval(field["form"])
            parts.append(r"(?P<number>\d{1,9})")
        elif name == "speed":
            parts.append(r"(?P<speed>\d{1,6}(?:[.,]\d{1,3})?)")
        else:
            parts.append(f"(?P<{name}>[^/]+?)" if name else "[^/]*?")
    parts.append(_literal(text[end:]))
    if "{" in text[end:] or "}" in text[end:]:
        raise InputError(f"{text!r} has an unmatched bracket", where=where)
    return re.compile("".join(parts) + "$"), form


def _literal(text: str) -> str:
    parts = re.split(r"(\*\*/?|\*)", text.lstrip("/") if text.startswith("./") else text)
    return "".join({"**": ".*", "**/": "(?:.*/)?", "*": "[^/]*"}.get(part, re.escape(part)) for part in parts)


def _of_form(form: str) -> str:
    parts = re.split(r"(%.)", form)
    unknown = [part for part in parts if part.startswith("%") and part not in _FORMS]
    if unknown:
        raise InputError(f"{unknown[0]} of {{date:{form}}} is not known", where="--pattern", allowed=" ".join(_FORMS))
    return "".join(_FORMS.get(part, re.escape(part)) for part in parts)


def _interval(text: str) -> timedelta:
    """Return the time that a text such as "10min" states."""
    match = re.fullmatch(r"(\d{1,6}(?:\.\d{1,3})?)\s?(s|min|h|d)", text)
    if match is None or not float(match[1]):
        allowed = "seconds, minutes, hours or days above 0: 10s, 1min, 2h, 1d"
        raise InputError(f"{{number:{text}}} states no time between recordings", where="--pattern", allowed=allowed)
    return float(match[1]) * timedelta(**{{"s": "seconds", "min": "minutes", "h": "hours", "d": "days"}[match[2]]: 1})


def date_in_name(name: str) -> datetime | None:
    """Return the date that a name states, year first, with its time if there is one; None without a date.

    Examples
    --------
    >>> [str(date_in_name(name)) for name in ("pump_2026-01-31T1405.csv", "2026.01.31.14.05.12", "run_1234.h5")]
    ['2026-01-31 14:05:00', '2026-01-31 14:05:12', 'None']
    >>> str(date_in_name("2026-01-31 02-05-12 PM.csv"))
    '2026-01-31 14:05:12'
    """
    for match in _DATE_IN_NAME.finditer(name):
        digits = re.sub(r"\D", "", match["day"])
        time = re.sub(r"\D", "", match["time"] or "").ljust(6, "0")
        forms = {"%Y%m%d%H%M%S": time, "%Y%m%d": ""}
        if match["half"]:
            forms = {"%Y%m%d%I%M%S%p": time + match["half"], **forms}
        for form, clock in forms.items():
            try:
                return datetime.strptime(digits + clock, form)  # noqa: DTZ007
            except ValueError:
                continue
    return None


def find_recordings(places: Iterable[str | Path]) -> list[tuple[Path, Path]]:
    """Return the recordings in files, folders and their sub-folders, each with the folder where the search began.

    In a folder, files with the ending of a format count; hidden files and links to folders are left out. A file that
    is named is always included.

    Raises
    ------
    InputError
        If a place does not exist.
    """
    root_of: dict[Path, Path] = {}
    for place in places:
        root = Path(place)
        if root.is_dir():
            for path in _walk(root):
                if _is_recording(path):
                    root_of.setdefault(path, root)
        elif any(letter in root.name for letter in "*?[") and not root.exists():
            matches = sorted(root.parent.glob(root.name)) if root.parent.is_dir() else []
            if not matches:
                raise InputError("no file matches", where=str(root), remedy="check the folder and the pattern")
            root_of |= {path: path.parent for path in matches if path.is_file()}
        else:
            _check_is_there(root)
            root_of.setdefault(root, root.parent)
    return list(root_of.items())


def _check_is_there(path: Path) -> None:
    """Raise unless a named file exists; "runs.mat#2" names a run in a file."""
    from gearsig.recording import without_condition

    try:
        without_condition(path)[0].stat()
    except (OSError, ValueError) as error:
        problem = getattr(error, "strerror", None) or "the name is not possible"
        raise InputError(
            f"cannot be read ({problem})", where=file_label(path, whole=True), remedy=missing_file_hint(path)
        ) from None


def no_recordings(places: Iterable[str | Path], *, complaint: str = "") -> InputError:
    """Return the error that places hold no recordings; the complaint is added to its text."""
    from gearsig.recording import FORMAT_OF_EXTENSION

    return InputError(
        f"there are no recordings{complaint}",
        where=", ".join(file_label(place, whole=True) for place in places),
        allowed=" ".join(FORMAT_OF_EXTENSION),
        remedy="check the folder and the pattern",
    )


def _walk(root: Path) -> Iterable[Path]:
    import os

    for folder, subfolders, names in os.walk(root):  # links to folders are not followed
        # Tables of a report and of a sweep, which are beside pages and recordings.
        tables = {"batch.csv"} if ".results" in subfolders else {"index.csv"} if "sweep.json" in names else set()
        subfolders[:] = sorted(name for name in subfolders if not name.startswith("."))
        if "store.json" in names and "new" in subfolders:  # a fleet's own store
            subfolders.clear()
            continue
        for name in sorted(set(names) - tables):
            if not name.startswith("."):
                yield Path(folder) / name


def _is_recording(path: Path) -> bool:
    """Whether a file in a folder has the ending of a format, or none and a date in its name."""
    from gearsig.recording import FORMAT_OF_EXTENSION, is_ending

    name = path.name.lower()
    if not is_ending(path.suffix):
        return date_in_name(name) is not None
    return any(name.endswith((ending, f"{ending}.gz")) for ending in FORMAT_OF_EXTENSION)


def origins(
    places: Iterable[str | Path],
    *,
    pattern: str = "",
    machine: str = "",
    point: str = "",
    date: datetime | None = None,
    rig: Rig | None = None,
    speed_rpm: float | None = None,
    on_excluded: Callable[[ExcludedFile], object] | None = None,
    may_be_none: bool = False,
) -> list[Origin]:
    """Find recordings and the machine, point, date and speed of each.

    The machine is the one stated, or else from the pattern, the first sub-folder below the place searched, the name in
    the rig file, or the folder. The point is the one stated, or else from the pattern or the second sub-folder. The
    date is the one stated, or else from the pattern, the file name, or when the file was written; running numbers count
    from the stated date. The speed is the one stated, or else from the pattern or the file name ("1000rpm").

    Parameters
    ----------
    places : iterable of str or Path
        Files, folders with their sub-folders, "folder/*.csv".
    pattern : str
        See `FilePattern`; files that do not match are skipped.
    machine, point : str
    date : datetime or None
    rig : Rig or None
        For all recordings; None: the rig file of the same name beside each.
    speed_rpm : float or None
        For all recordings.
    on_excluded : callable or None
        Called with an `ExcludedFile` for each recording that does not match the pattern.
    may_be_none : bool
        Whether finding nothing is allowed, as in a watched folder.

    Raises
    ------
    InputError
        If a file is missing, the pattern is invalid, or nothing is found.
    """
    from gearsig.recording import speed_in_name

    searched, excluded = list(places), list[ExcludedFile]()
    file_pattern = FilePattern(pattern) if pattern else None
    recordings = find_recordings(searched)
    rigs = _rig_names(rig)
    result = []
    for path, root in recordings:
        named = file_pattern.match(path, root) if file_pattern is not None else {}
        if isinstance(named, ExcludedFile):
            excluded.append(named)
            if on_excluded is not None:
                on_excluded(named)
            continue
        try:
            stat = path.stat()
        except OSError as error:
            raise InputError(f"cannot be read ({error.strerror})", where=str(path), remedy="check the name") from None
        written = datetime.fromtimestamp(stat.st_mtime, UTC).replace(tzinfo=None, microsecond=0)
        below = path.relative_to(root).parts[:-1] if path.is_relative_to(root) else ()
        folder = path.absolute().parent.name
        of_machine = _first(
            ("stated", machine),
            ("pattern", named.get("machine", "")),
            ("folder", below[0] if below else ""),
            ("rig file", rigs(path)),
            ("folder", folder),
        )
        of_point = _first(
            ("stated", point), ("pattern", named.get("point", "")), ("folder", below[1] if len(below) > 1 else "")
        )
        since = named.get("number")
        of_date = _first(
            ("pattern", (date or NUMBERS_BEGIN) + since if isinstance(since, timedelta) else None),
            ("stated", date),
            ("pattern", named.get("date")),
            ("file name", date_in_name(path.name)),
            ("time of the file", written),
        )
        of_speed = _first(
            ("stated", speed_rpm),
            ("pattern", named.get("speed")),
            ("file name", speed_in_name(path.name)),
        )
        moment = of_date[1]
        assert isinstance(moment, datetime)  # noqa: S101 - the file's time is always there
        result.append(
            Origin(
                path.absolute(),
                _printable_name(of_machine[1]),
                _printable_name(of_point[1]),
                moment,
                of_machine[0],
                of_point[0],
                of_date[0],
                stat.st_size,
                stat.st_mtime_ns,
                float(of_speed[1]) if isinstance(of_speed[1], int | float) else None,
                of_speed[0],
            )
        )
    if not result and not may_be_none:
        complaint = f" that match {pattern!r}" if pattern else ""
        complaint += f"; {excluded_text(excluded)}" if excluded else ""
        raise no_recordings(searched, complaint=complaint)
    return sorted(result, key=lambda o: (o.machine, o.point, o.date, o.path))


N_NAMED = 3


def excluded_text(files: Sequence[ExcludedFile]) -> str:
    """Return how many recordings a pattern leaves out, with names and reasons of the first ones, as text.

    Examples
    --------
    >>> excluded_text([ExcludedFile(Path("/data/pump/DE_1.csv"), "does not match the pattern")])
    '1 recording is passed over: pump/DE_1.csv (does not match the pattern)'
    """
    first = [f"{_printable_name(Path(*file.path.parts[-2:]).as_posix())} ({file.reason})" for file in files[:N_NAMED]]
    n_more = len(files) - len(first)
    more = f"; and {n_more} more" if n_more else ""
    verb = "is" if len(files) == 1 else "are"
    return f"{counted(len(files), 'recording')} {verb} passed over: {'; '.join(first)}{more}"


def _rig_names(rig: Rig | None) -> Callable[[Path], str]:
    @cache
    def of_file(path: Path) -> str:
        try:
            return read_rig(path).name
        except InputError:
            return ""

    def name(path: Path) -> str:
        if rig is not None:
            return rig.name
        rig_file = rig_file_beside(path)
        return of_file(rig_file) if rig_file is not None else ""

    return name


def _first(*choices: tuple[str, object]) -> tuple[str, object]:
    return next(((source, value) for source, value in choices if value), ("none", ""))


def _printable_name(text: object) -> str:
    """Return a name as one printable line, at most `LONGEST_NAME` characters."""
    line = "".join(c if c.isprintable() else " " for c in str(text).encode("utf-8", "replace").decode("utf-8"))
    return " ".join(line.split())[:LONGEST_NAME]


def origin_rows(recordings: Sequence[Origin]) -> list[tuple[str, str, str, str, str]]:
    """Return file, machine, point, date and speed of each recording with their sources, as texts to be checked."""
    return [
        (
            o.path.name,
            f"{o.machine} ({o.machine_from})",
            f"{o.point} ({o.point_from})" if o.point else "–",
            f"{o.date:%Y-%m-%d %H:%M} ({o.date_from})",
            f"{o.speed_rpm:g} rpm ({o.speed_from})" if o.speed_rpm else "–",
        )
        for o in recordings
    ]
