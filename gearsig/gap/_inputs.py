"""What a gap diagnosis is given: files of one machine, each recording with its own operating point, and references."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from gearsig.errors import InputError
from gearsig.recording import Recording, read_recording
from gearsig.rig import Rig, read_rig, rig_file_beside


@dataclass(frozen=True)
class GapRequest:
    """Files and what the user states of them.

    Parameters
    ----------
    recordings, references : tuple of Path
    rig : Path or None
        For all of them; a rig file beside a recording overrides its speed and torque. None: only those beside.
    torques_nm : tuple of float
        None, one for all, or one for each recording.
    sampling_rate_hz : float or None
        Of files that do not state it.
    names, reference_names : tuple of str
        Of recordings and references, for people; empty: those of the files.
    """

    recordings: tuple[Path, ...]
    references: tuple[Path, ...] = ()
    rig: Path | None = None
    torques_nm: tuple[float, ...] = ()
    sampling_rate_hz: float | None = None
    names: tuple[str, ...] = ()
    reference_names: tuple[str, ...] = ()


@dataclass(frozen=True)
class GapInputs:
    """Recordings and references, each with its rig and its name for people."""

    recordings: tuple[Recording, ...]
    references: tuple[Recording, ...] = ()


def read_gap_inputs(asked: GapRequest, on_file: Callable[[str], object] = lambda _: None) -> GapInputs:
    """Read everything, rigs first.

    Parameters
    ----------
    asked : GapRequest
    on_file : callable
        Is told the name of each file before it is read.

    Raises
    ------
    InputError
        If a file cannot be read, a recording has no rig, the rigs are of different machines, a file is given twice, or
        the number of torques fits none.
    """
    _check_files(asked)
    files = (*asked.recordings, *asked.references)
    names = (
        *(asked.names or _names(asked.recordings)),
        *(asked.reference_names or _names(asked.references)),
    )
    recordings = []
    for path, name, rig in zip(files, names, _rigs(asked, files), strict=True):
        on_file(path.name)
        recordings.append(read_recording(path, rig=rig, sampling_rate_hz=asked.sampling_rate_hz).with_name(name))
    n = len(asked.recordings)
    return GapInputs(tuple(recordings[:n]), tuple(recordings[n:]))


def _check_files(asked: GapRequest) -> None:
    if not asked.recordings:
        raise InputError("no recording is given", remedy="give one, or better several operating conditions of one rig")
    seen: set[Path] = set()
    for path in (*asked.recordings, *asked.references):
        if not path.exists():
            raise InputError("there is no such file", where=str(path), remedy="check its name and folder")
        if path.resolve() in seen:
            healthy = path in asked.references and path in asked.recordings
            what = "is given as a recording and as its own healthy reference" if healthy else "is given twice"
            raise InputError(what, where=str(path), remedy="give each file once")
        seen.add(path.resolve())
    n, n_torques = len(asked.recordings), len(asked.torques_nm)
    if n_torques > 1 and n_torques != n:
        raise InputError(
            f"{n_torques} torques are given for {n} recording{'s' if n > 1 else ''}",
            allowed="one for all, or one for each, in their order" if n > 1 else "one",
        )


def _rigs(asked: GapRequest, files: Sequence[Path]) -> tuple[Rig, ...]:
    """Return the rig of each file, all of the same machine."""
    common = read_rig(asked.rig) if asked.rig is not None else None
    first = common
    found = []
    for place, path in enumerate(files):
        beside = rig_file_beside(path)
        is_own = beside is not None and (asked.rig is None or beside.resolve() != asked.rig.resolve())
        own = read_rig(beside) if beside is not None and is_own else None
        if own is None and common is None:
            raise InputError(
                "no rig file is given, and none lies beside it",
                where=str(path),
                remedy="give --rig RIG.toml with the gears' teeth and module; `gearsig rig example` prints one",
            )
        first = first or own
        if own is not None and first is not None:
            _check_same(first, own, path.name)
        rig = _merged(common, own)
        found.append(_with_torque(rig, asked, place))
    return tuple(found)


def _merged(common: Rig | None, own: Rig | None) -> Rig:
    """Return the common rig at the operating point and with the speed source of the recording's own."""
    if common is None or own is None:
        rig = common or own
        assert rig is not None  # noqa: S101 - the caller has made sure of one
        return rig
    point, there = own.operating_point, common.operating_point
    if point.shaft in ("", there.shaft):
        point = replace(
            point,
            shaft=there.shaft,
            speed_rpm=there.speed_rpm if point.speed_rpm is None else point.speed_rpm,
            torque_nm=there.torque_nm if point.torque_nm is None else point.torque_nm,
        )
    return replace(common, operating_point=point, speed=own.speed or common.speed)


def _with_torque(rig: Rig, asked: GapRequest, place: int) -> Rig:
    """Return the rig at the torque that was stated: a single one is the references' as well."""
    if not asked.torques_nm or (len(asked.torques_nm) > 1 and place >= len(asked.torques_nm)):
        return rig
    torque_nm = asked.torques_nm[0 if len(asked.torques_nm) == 1 else place]
    return replace(rig, operating_point=replace(rig.operating_point, torque_nm=torque_nm))


def _check_same(rig: Rig, own: Rig, name: str) -> None:
    """Compare what both rig files state of the machine."""
    for what, stated in _identity(own).items():
        expected = _identity(rig).get(what)
        if expected is not None and expected != stated:
            raise InputError(
                f"the rig file beside it is of another machine: {what} {stated}, elsewhere {expected}",
                where=name,
                remedy="diagnose recordings of one rig together, those of another on their own",
            )


def _identity(rig: Rig) -> dict[str, str]:
    """Return what makes a machine another one, as far as it is known."""
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
    """Return the names of files; with their folders where names alone are not unique."""
    plain = [path.name for path in paths]
    return tuple(plain) if len(set(plain)) == len(plain) else tuple(f"{p.parent.name}/{p.name}" for p in paths)
