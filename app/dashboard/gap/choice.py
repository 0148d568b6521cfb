"""What is to be diagnosed, as it was chosen on the page, and how it becomes files that the diagnosis reads."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

from app.dashboard.state import Upload
from app.dashboard.uploads import safe_file_name
from app.gap.inputs import Asked
from gearsig.errors import InputError
from gearsig.rig.toml import recording_stem

Source = Path | Upload


@dataclass(frozen=True)
class Choice:
    """Recordings, references and rig files, on this machine (samples) or in memory (uploads).

    Parameters
    ----------
    recordings, references : tuple of Path or Upload
    rigs : tuple of Upload
        Rig files; one named as a recording is that recording's own, the other one is everybody's.
    model : str
    torque_nm, sampling_rate_hz : float or None
        What the files do not state.
    """

    recordings: tuple[Source, ...]
    references: tuple[Source, ...] = ()
    rigs: tuple[Upload, ...] = ()
    model: str = "cracked"
    torque_nm: float | None = None
    sampling_rate_hz: float | None = None

    @property
    def key(self) -> str:
        """Equal for choices with equal answers."""
        sources = [[_key(one) for one in group] for group in (self.recordings, self.references, self.rigs)]
        return repr((sources, self.model, self.torque_nm, self.sampling_rate_hz))

    @property
    def command(self) -> str:
        """The command that gives the same answer outside the dashboard."""
        words = ["gearsig", "gap", *(name_of(one) for one in self.recordings)]
        common = common_rig(self)
        words += ["--rig", common.name] if common is not None else []
        for one in self.references:
            words += ["--reference", name_of(one)]
        words += ["--torque", f"{self.torque_nm:.15g}Nm"] if self.torque_nm is not None else []
        words += ["--fs", f"{self.sampling_rate_hz:.15g}"] if self.sampling_rate_hz is not None else []
        return shlex.join([*words, "--model", self.model, "-o", "gap"])


def name_of(source: Source) -> str:
    """Return the name of a file as the user knows it."""
    return source.name


def common_rig(choice: Choice) -> Upload | None:
    """Return the rig file that is no recording's own, or the only one there is; None where there is none.

    Raises
    ------
    InputError
        If there are several, or several that are one recording's own.
    """
    if len(choice.rigs) == 1:  # all recordings are of one rig, whatever its file is called
        return choice.rigs[0]
    own = [own_rig(one, choice.rigs) for one in (*choice.recordings, *choice.references)]
    others = [rig for rig in choice.rigs if rig not in own]
    if len(others) > 1:
        raise InputError(
            f"{len(others)} rig files are named as no recording: {', '.join(rig.name for rig in others)}",
            allowed="one for all recordings, and one named as each recording",
        )
    return others[0] if others else None


def own_rig(source: Source, rigs: tuple[Upload, ...]) -> Upload | None:
    """Return the rig file that is named as a recording (`run.5Nm.csv.gz`: `run.5Nm.toml`), None if there is none.

    Raises
    ------
    InputError
        If there are several.
    """
    found = [rig for rig in rigs if recording_stem(rig.name) == recording_stem(name_of(source))]
    if len(found) > 1:
        raise InputError(
            f"{len(found)} rig files are named as this recording: {', '.join(rig.name for rig in found)}",
            where=name_of(source),
            allowed="one",
            remedy="remove all but one of them",
        )
    return found[0] if found else None


def files_of(choice: Choice, folder: Path) -> Asked:
    """Write the uploads into a folder and return what the diagnosis is asked.

    Raises
    ------
    InputError
        If there is more than one rig file for all, or for one recording.
    """
    common = common_rig(choice)
    rig = None
    if common is not None:
        rig = folder / "rig.toml"
        rig.write_text(common.rig_text, encoding="utf-8")
    numbered = enumerate((*choice.recordings, *choice.references), 1)
    paths = [_written(one, folder / str(i), choice.rigs) for i, one in numbered]
    n = len(choice.recordings)
    return Asked(
        tuple(paths[:n]),
        tuple(paths[n:]),
        rig,
        () if choice.torque_nm is None else (choice.torque_nm,),
        choice.sampling_rate_hz,
        tuple(name_of(one) for one in choice.recordings),
        tuple(name_of(one) for one in choice.references),
    )


def _written(source: Source, folder: Path, rigs: tuple[Upload, ...]) -> Path:
    """Return the file of a source; an upload gets a folder of its own, with its own rig file beside it."""
    if isinstance(source, Path):
        return source
    folder.mkdir()
    path = folder / safe_file_name(source.name)
    path.write_bytes(source.content)
    rig = own_rig(source, rigs)
    if rig is not None:
        path.with_name(f"{recording_stem(path.name)}.toml").write_text(rig.rig_text, encoding="utf-8")
    return path


def _key(source: Source) -> str:
    return str(source) if isinstance(source, Path) else f"{source.name} {source.sha256}"
