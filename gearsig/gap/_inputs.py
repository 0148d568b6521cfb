"""Inputs of a gap diagnosis: files of one machine, recordings with their operating points, references, a rig."""

from __future__ import annotations

import csv
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from gearsig.checks import closest_match_hint
from gearsig.diagnosis import REFERENCE_OPTIONS, read_whole, rig_and_rate_of_reference
from gearsig.errors import InputError, RefusalError, options_named
from gearsig.formatting import counted
from gearsig.gap._labelled import LabelledRecording
from gearsig.gap._report import NONE, UNKNOWN
from gearsig.recording import Recording
from gearsig.rig import ConstantSpeed, Rig, read_rig, rig_file_beside


@dataclass(frozen=True)
class GapRequest:
    """Files and what the user states about them.

    Parameters
    ----------
    recordings, references : tuple of Path
    rig : Path or None
        For all files; a rig file beside a recording overrides its speed and torque. None: only those beside.
    torques_nm : tuple of float
        Empty, one for all, or one for each recording.
    sampling_rate_hz : float or None
        For files that do not state it; for references unless a rig file beside them states it.
    names, reference_names : tuple of str
        Display names of recordings and references; empty: those of the files.
    learn : Path or None
        Folder of labelled recordings of this rig, see `read_labelled`.
    stage : str
        Gear pair to diagnose, of several, see `diagnose_gap`.
    speed_rpm : float or None
        Constant speed of the reference shaft in all recordings and references, where it is not measured.
    reference_rate_hz : float or None
        Sampling rate of the references, where it differs.
    run_up : Path or None
        Run-up of the same machine when it was healthy, see `diagnose_gap`.
    """

    recordings: tuple[Path, ...]
    references: tuple[Path, ...] = ()
    rig: Path | None = None
    torques_nm: tuple[float, ...] = ()
    sampling_rate_hz: float | None = None
    names: tuple[str, ...] = ()
    reference_names: tuple[str, ...] = ()
    learn: Path | None = None
    stage: str = ""
    speed_rpm: float | None = None
    reference_rate_hz: float | None = None
    run_up: Path | None = None

    @property
    def healthy(self) -> tuple[Path, ...]:
        """References, and the run-up where there is one."""
        return (*self.references, *(() if self.run_up is None else (self.run_up,)))


@dataclass(frozen=True)
class GapInputs:
    """Recordings, references and run-up, each with its rig and display name, and the labelled recordings."""

    recordings: tuple[Recording, ...]
    references: tuple[Recording, ...] = ()
    labelled: tuple[LabelledRecording, ...] = ()
    run_up: Recording | None = None


def read_gap_inputs(request: GapRequest, on_file: Callable[[str], object] = lambda _: None) -> GapInputs:
    """Read all files, rigs first.

    Parameters
    ----------
    request : GapRequest
    on_file : callable
        Called with the name of each file before it is read.

    Raises
    ------
    InputError
        If a file cannot be read, a recording has no rig, the rigs are of different machines, a file is given twice, or
        the number of torques does not fit.
    """
    _check_files(request)
    files = (*request.recordings, *request.healthy)
    names = (*(request.names or _names(request.recordings)), *(request.reference_names or _names(request.references)))
    names = (*names, *(path.name for path in request.healthy[len(request.references) :]))
    recordings: list[Recording] = []
    n, labelled = len(request.recordings), tuple[LabelledRecording, ...]()
    speed = None if request.speed_rpm is None else ConstantSpeed(request.speed_rpm)
    for path, name, rig in zip(files, names, _rigs(request, files), strict=True):
        on_file(path.name)
        is_reference = len(recordings) >= n
        reference_hz = request.reference_rate_hz if is_reference else None
        _, rate_hz = rig_and_rate_of_reference(path, None, request.sampling_rate_hz, reference_hz)
        with options_named(REFERENCE_OPTIONS if is_reference else {}):
            stated = None if path == request.run_up else speed  # a run-up's speed is not constant
            recording = read_whole(path, rig, sampling_rate_hz=rate_hz, speed=stated)
        recordings.append(recording.with_name(name))
    if request.learn is not None:
        on_file(request.learn.name)
        labelled = read_labelled(
            request.learn, rig=recordings[0].rig, sampling_rate_hz=request.sampling_rate_hz, on_file=on_file
        )
    run_up = None if request.run_up is None else recordings.pop()
    return GapInputs(tuple(recordings[:n]), tuple(recordings[n:]), labelled, run_up)


def _check_files(request: GapRequest) -> None:
    if not request.recordings:
        raise InputError("no recording is given", remedy="give one, or better several operating conditions of one rig")
    paths: set[Path] = set()
    for path in (*request.recordings, *request.healthy):
        if not path.exists():
            raise InputError("there is no such file", where=str(path), remedy="check its name and folder")
        if path.resolve() in paths:
            healthy = path in request.healthy and path in request.recordings
            problem = "is given as a recording and as its own healthy reference" if healthy else "is given twice"
            raise InputError(problem, where=str(path), remedy="give each file once")
        paths.add(path.resolve())
    n, n_torques = len(request.recordings), len(request.torques_nm)
    if n_torques > 1 and n_torques != n:
        raise InputError(
            f"{n_torques} torques are given for {counted(n, 'recording')}",
            allowed="one for all, or one for each, in their order" if n > 1 else "one",
        )


def _rigs(request: GapRequest, files: Sequence[Path]) -> tuple[Rig, ...]:
    """Return the rig of each file, all of the same machine."""
    common = read_rig(request.rig) if request.rig is not None else None
    first = common
    rigs = []
    for place, path in enumerate(files):
        rig_file = rig_file_beside(path)
        has_rig_file = rig_file is not None and (request.rig is None or rig_file.resolve() != request.rig.resolve())
        recording_rig = read_rig(rig_file) if rig_file is not None and has_rig_file else None
        if recording_rig is None and common is None:
            raise InputError(
                "no rig file is given, and there is none beside it",
                where=str(path),
                remedy="give --rig RIG.toml with the gears' teeth and module; `gearsig rig example` prints one",
            )
        first = first or recording_rig
        if recording_rig is not None and first is not None:
            _check_same(first, recording_rig, path.name)
        rig = _merged(common, recording_rig)
        rigs.append(_with_torque(rig, request, place))
    return tuple(rigs)


def _merged(common: Rig | None, of_recording: Rig | None) -> Rig:
    """Return the common rig at the operating point of the recording's own rig, with its measurement."""
    if common is None or of_recording is None:
        rig = common or of_recording
        assert rig is not None  # noqa: S101 - the caller has made sure of one
        return rig
    point, common_point = of_recording.operating_point, common.operating_point
    if point.shaft in ("", common_point.shaft):
        point = replace(
            point,
            shaft=common_point.shaft,
            speed_rpm=common_point.speed_rpm if point.speed_rpm is None else point.speed_rpm,
            torque_nm=common_point.torque_nm if point.torque_nm is None else point.torque_nm,
        )
    return replace(common.with_measurement_of(of_recording), operating_point=point)


def _with_torque(rig: Rig, request: GapRequest, place: int) -> Rig:
    """Return the rig at the stated torque; a single torque applies to the references as well."""
    if not request.torques_nm or (len(request.torques_nm) > 1 and place >= len(request.torques_nm)):
        return rig
    torque_nm = request.torques_nm[0 if len(request.torques_nm) == 1 else place]
    return replace(rig, operating_point=replace(rig.operating_point, torque_nm=torque_nm))


def _check_same(rig: Rig, of_recording: Rig, name: str) -> None:
    """Raise if the two rig files describe different machines."""
    for quantity, stated in _identity(of_recording).items():
        expected = _identity(rig).get(quantity)
        if expected is not None and expected != stated:
            raise InputError(
                f"the rig file beside it is of another machine: {quantity} {stated}, elsewhere {expected}",
                where=name,
                remedy="diagnose recordings of one rig together, those of another on their own",
            )


def _identity(rig: Rig) -> dict[str, str]:
    """Return the known properties that distinguish one machine from another."""
    facts: dict[str, str] = {}
    if rig.pairs and all(p.driver_teeth and p.driven_teeth for p in rig.pairs):
        facts["teeth"] = ", ".join(f"{p.driver_teeth}/{p.driven_teeth}" for p in rig.pairs)
    for i, pair in enumerate(rig.pairs, 1):
        for key, unit in (("module_mm", "mm"), ("pressure_angle_deg", "°"), ("face_width_mm", "mm")):
            value = getattr(pair, key)
            if value is not None:
                facts[f"{key.rsplit('_', 1)[0].replace('_', ' ')} of pair {i}"] = f"{value:g} {unit}"
    for bearing in rig.bearings:
        orders = ", ".join(f"{key} {order:.4g}" for key, order in bearing.orders().items())
        if orders:
            facts[f"orders of bearing {bearing.name!r}"] = orders
    return facts


def _names(paths: Sequence[Path]) -> tuple[str, ...]:
    """Return the names of files, with their folders where names alone are not unique."""
    plain = [path.name for path in paths]
    return tuple(plain) if len(set(plain)) == len(plain) else tuple(f"{p.parent.name}/{p.name}" for p in paths)


# --------------------
# A folder of labelled recordings: labels.csv and the files that it names.
# --------------------


TABLE, COLUMNS = "labels.csv", ("file", "effect", "reference")
HEALTHY_LABELS = ("healthy", NONE, "no_fault", "ok")
MAX_LABELLED = 500


def read_labelled(
    folder: Path,
    *,
    rig: Rig | None = None,
    sampling_rate_hz: float | None = None,
    on_file: Callable[[str], object] = lambda _: None,
) -> tuple[LabelledRecording, ...]:
    """Read the recordings named in a folder's `labels.csv`.

    The table has a line for each recording: `file`, `effect` (a name from the catalogue, "healthy", or a name of your
    own), and optionally `reference` (a file of the same rig when it was healthy). Further columns are ignored.

    Parameters
    ----------
    folder : Path
    rig : Rig or None
        For all recordings; NAME.toml beside a recording overrides its operating point and speed source.
    sampling_rate_hz : float or None
        For files that do not state it.
    on_file : callable
        Called with the name of each file before it is read.

    Raises
    ------
    InputError
        With the table's name and line: if it cannot be read, a column is missing, or a file or a label is not valid.
    """
    references: dict[Path, Recording] = {}

    def read(path: Path) -> Recording:
        on_file(path.name)
        rig_file = rig_file_beside(path)
        recording_rig = read_rig(rig_file) if rig_file is not None else None
        if recording_rig is not None and rig is not None:
            _check_same(rig, recording_rig, path.name)
        if recording_rig is None and rig is None:
            raise InputError(
                "no rig is given, and there is none beside it", where=path.name, remedy="give --rig RIG.toml"
            )
        recording = read_whole(path, _merged(rig, recording_rig), sampling_rate_hz=sampling_rate_hz)
        return recording.with_name(f"{folder.name}/{path.name}")

    labelled = []
    for where, line in _lines(folder / TABLE):
        path = _named(folder, line["file"], where, "file")
        label = _label(line["effect"], where)
        healthy = None
        if line.get("reference"):
            reference_path = _named(folder, line["reference"], where, "reference")
            if reference_path == path:
                raise InputError("a recording is its own reference", where=where, remedy="name a healthy one, or none")
            healthy = references[reference_path] = references.get(reference_path) or read(reference_path)
        labelled.append(LabelledRecording(read(path), label, healthy))
    return tuple(labelled)


def _lines(path: Path) -> list[tuple[str, Mapping[str, str]]]:
    """Return the lines of the table, each with its location."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except OSError as error:
        example = "a line of names, file,effect,reference, and a line for each recording"
        raise InputError(
            f"cannot be read ({error.strerror})", where=str(path), remedy=f"put {TABLE} there: {example}"
        ) from None
    except UnicodeDecodeError:
        raise InputError("is not UTF-8 text", where=str(path), remedy="save it as CSV UTF-8") from None
    header = text.partition("\n")[0]
    rows = csv.reader(text.splitlines(), delimiter=";" if header.count(";") > header.count(",") else ",", strict=True)
    lines: list[tuple[str, Mapping[str, str]]] = []
    try:
        names = [name.strip().lower() for name in next(rows, [])]
        missing = [name for name in COLUMNS[:2] if name not in names]
        if missing:
            raise InputError(
                f"the column {missing[0]!r} is missing", where=f"{path.name}, line 1", allowed=", ".join(COLUMNS)
            )
        for row in rows:
            where = f"{path.name}, line {rows.line_num}"
            if not any(cell.strip() for cell in row):
                continue
            if len(row) > len(names):
                raise InputError(f"{len(row)} cells for {len(names)} column names", where=where, allowed="one each")
            lines.append((where, dict(zip(names, (cell.strip() for cell in row), strict=False))))
    except csv.Error as error:
        raise InputError(f"is not a table ({error})", where=f"{path.name}, line {rows.line_num}") from None
    if not 0 < len(lines) <= MAX_LABELLED:
        raise InputError(
            f"names {len(lines)} recordings", where=path.name, allowed=f"1 to {MAX_LABELLED}, a line for each"
        )
    return lines


def _named(folder: Path, name: str, where: str, column: str) -> Path:
    """Return a file named in the table; it must be in the table's folder or below it."""
    if not name:
        raise InputError(f"no {column} is named", where=where, allowed="the name of a file in the folder")
    path, root = (folder / name).resolve(), folder.resolve()
    if not path.is_relative_to(root):
        raise InputError(f"{name!r} is outside the folder", where=where, allowed="files in it, or in folders below")
    if not path.is_file():
        raise InputError(f"there is no file {name!r}", where=where, remedy="check its name")
    return path


def _label(text: str, where: str) -> str:
    """Return a label in the form of effect names; "none" for a healthy machine."""
    label = "_".join(text.lower().replace("-", " ").split())
    if label in HEALTHY_LABELS:
        return NONE
    if not label or label == UNKNOWN or len(label) > 60 or not label.replace("_", "").isalnum():
        raise InputError(
            f"the effect is {text!r}",
            where=where,
            allowed="a name of `gearsig gap --list-effects`, healthy, or a name of your own of letters and digits",
        )
    return label


# --------------------
# Requirements on a rig file: how it can be diagnosed, which pair, which assumptions.
# --------------------


EXAMPLE = "`gearsig rig example` prints a file to start from"


def is_gearless(rig: Rig) -> bool:
    """Return whether the rig has bearings only, so that no simulator can model it.

    Raises
    ------
    RefusalError
        If the rig's data are sufficient neither for a simulation nor for a search for bearing damage, with what is
        missing.
    """
    if rig.pairs:
        _check_teeth(rig)
        return False
    if not rig.bearings:
        raise RefusalError(
            "the rig file describes neither a gear pair nor a bearing: there is nothing to simulate and "
            "nothing to look for",
            remedy=f"describe the gear pair (teeth, module) or the bearings (geometry or orders); {EXAMPLE}",
        )
    if not any(bearing.orders() and rig.ratio(bearing.shaft) is not None for bearing in rig.bearings):
        names = ", ".join(repr(bearing.name) for bearing in rig.bearings)
        raise RefusalError(
            f"the rig has no gear pair, and for no bearing ({names}) are both orders and shaft speed known",
            remedy="give the bearings' geometry or orders, on the shaft whose speed is known",
        )
    return True


def _check_teeth(rig: Rig) -> None:
    pair = rig.pairs[0]
    gears = [name for name, teeth in (("driver", pair.driver_teeth), ("driven", pair.driven_teeth)) if teeth is None]
    if gears:
        gear_text = "both gears" if len(gears) == 2 else f"the {gears[0]} gear"
        raise RefusalError(
            f"data that a simulation needs are missing: teeth of {gear_text} of pair {pair.name!r}",
            remedy="complete the rig file; `gearsig analyze` shows what can be found without them",
        )


def with_stage(rig: Rig, stage: str = "") -> Rig:
    """Return a rig with the requested gear pair first; that one is diagnosed, the others are background.

    Parameters
    ----------
    rig : Rig
    stage : str
        Name of a pair, or of a shaft that belongs to only one pair; empty: the only pair.

    Raises
    ------
    InputError
        If there is no such pair.
    RefusalError
        If there are several pairs and none is requested.
    """
    names = [pair.name for pair in rig.pairs]
    chosen = [pair for pair in rig.pairs if pair.name == stage]
    chosen = chosen or list(rig.pairs_on(stage))
    if not stage and len(names) > 1:
        raise RefusalError(
            f"the rig has {len(names)} gear pairs ({', '.join(names)}), and one is diagnosed at a time",
            remedy="say which with --stage NAME (stage=… from Python); the others are treated as background",
        )
    if stage and len(chosen) != 1:
        problem = f"{len(chosen)} pairs sit on shaft {stage!r}" if chosen else f"there is no gear pair {stage!r}"
        raise InputError(problem, where="stage", allowed=", ".join(names), remedy=closest_match_hint(stage, names))
    return replace(rig, pairs=(*chosen, *(pair for pair in rig.pairs if pair not in chosen))) if stage else rig


USUAL_MODULE_MM, MODULES_MM = 2.5, (0.5, 12.0)
WIDTH_MODULES = 10.0
LOAD_N_PER_MM2 = 50.0
"""Used where the module is not known: the usual one of small gearboxes; its plausible range; face width in modules;
force per face width and module, from which the module follows where the torque is stated."""


def twin_rig(rig: Rig) -> tuple[Rig, list[str]]:
    """Return the rig reduced to its first pair, as required by a simulator, and the assumptions made.

    Without a module, it follows from the torque, T = F b m (m z/2) with F = 50 N/mm² and b = 10 m; otherwise it is 2.5
    mm.
    """
    pair, messages = rig.pairs[0], list[str]()
    torque_nm = rig.nominal_torque_nm(pair.driver)
    if pair.module_mm is None and pair.driver_teeth:
        module = USUAL_MODULE_MM
        if torque_nm:
            module = (1e3 * torque_nm / (0.5 * pair.driver_teeth * LOAD_N_PER_MM2 * WIDTH_MODULES)) ** (1.0 / 3.0)
        module = float(f"{np.clip(module, *MODULES_MM):.2g}")
        width = pair.face_width_mm or WIDTH_MODULES * module
        pair = replace(pair, module_mm=module, face_width_mm=width)
        why = f"as the torque of {torque_nm:.3g} N·m suggests" if torque_nm else "as usual for small gearboxes"
        messages.append(
            f"Only the gears' teeth are known: the twin has a module of {module:g} mm, {why}, and a face width of "
            f"{width:g} mm. The machine may have half or twice that: severities in mm and µm are orders of magnitude."
        )
    if len(rig.pairs) > 1:
        further_names = ", ".join(further.name for further in rig.pairs[1:])
        messages.append(f"{pair.name} is diagnosed; the orders of {further_names} are background, and removed.")
    elif not messages:
        return rig, []
    point, on = rig.operating_point, (pair.driver, pair.driven)
    speed_rpm = rig.nominal_speed_rpm(pair.driver)
    alone = replace(
        rig,
        shafts=tuple(shaft for shaft in rig.shafts if shaft.name in on),
        pairs=(pair,),
        bearings=tuple(bearing for bearing in rig.bearings if bearing.shaft in on),
        operating_point=replace(point, shaft=pair.driver, speed_rpm=speed_rpm, torque_nm=torque_nm),
        speed=None,
        contact=None,
        assumed=(*rig.assumed, *(() if rig.pairs[0].module_mm else ("module_mm", "face_width_mm"))),
    )
    return alone, messages
