"""The choice on the gap page: recordings, references and rig files, and how they reach the diagnosis as files."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import streamlit as st

from app.dashboard import address
from app.dashboard.cached import read_rig_text, safe_file_name
from app.dashboard.state import ChosenFile
from app.dashboard.widgets.chooser import (
    SIMULATED,
    choose_file,
    choose_files,
    choose_reference_rate,
    sample_file,
)
from app.samples import samples
from gearsig.errors import InputError
from gearsig.gap import GapRequest
from gearsig.rig import recording_stem


@dataclass(frozen=True)
class Choice:
    """Recordings, references and rig files, on this computer (samples) or in memory (uploads).

    Parameters
    ----------
    recordings, references : tuple of ChosenFile
    rigs : tuple of ChosenFile
        Rig files; one named like a recording is that recording's own, the other one applies to all.
    model : str
    torque_nm, sampling_rate_hz : float or None
        Stated by the user where the files do not.
    reference_rate_hz : float or None
        Sampling rate of the references, if it differs.
    run_up : ChosenFile or None
        Run-up of the healthy machine, in addition to a reference.
    """

    recordings: tuple[ChosenFile, ...]
    references: tuple[ChosenFile, ...] = ()
    rigs: tuple[ChosenFile, ...] = ()
    model: str = "cracked"
    torque_nm: float | None = None
    sampling_rate_hz: float | None = None
    reference_rate_hz: float | None = None
    run_up: ChosenFile | None = None

    @property
    def _run_ups(self) -> tuple[ChosenFile, ...]:
        return () if self.run_up is None else (self.run_up,)

    @property
    def key(self) -> str:
        """Equal for choices with equal answers."""
        groups = self.recordings, self.references, self.rigs, self._run_ups
        files = [[(file.name, file.sha256) for file in group] for group in groups]
        return repr((files, self.model, self.torque_nm, self.sampling_rate_hz, self.reference_rate_hz))

    @property
    def recorded(self) -> tuple[ChosenFile, ...]:
        """Everything that was recorded, in the order of the diagnosis."""
        return (*self.recordings, *self.references, *self._run_ups)

    @property
    def command(self) -> str:
        """The command that gives the same answer outside the dashboard."""
        words = ["gearsig", "gap", *(file.name for file in self.recordings)]
        common = common_rig(self)
        words += ["--rig", common.name] if common is not None else []
        words += [word for file in self.references for word in ("--reference", file.name)]
        words += [word for file in self._run_ups for word in ("--run-up", file.name)]
        words += ["--torque", f"{self.torque_nm:.15g}Nm"] if self.torque_nm is not None else []
        rates = {"--fs": self.sampling_rate_hz, "--reference-fs": self.reference_rate_hz}
        words += [word for name, hz in rates.items() if hz is not None for word in (name, f"{hz:.15g}")]
        return shlex.join([*words, "--model", self.model, "-o", "gap"])


def common_rig(choice: Choice) -> ChosenFile | None:
    """Return the rig file that applies to all recordings, or the only one; None if there is none.

    Raises
    ------
    InputError
        If there are several, or several for one recording.
    """
    if len(choice.rigs) == 1:  # all recordings are of one rig, whatever its file is called
        return choice.rigs[0]
    named = [own_rig(file, choice.rigs) for file in choice.recorded]
    common = [rig for rig in choice.rigs if rig not in named]
    if len(common) > 1:
        raise InputError(
            f"{len(common)} rig files are not named like a recording: {', '.join(rig.name for rig in common)}",
            allowed="one for all recordings, and one named like each recording",
        )
    return common[0] if common else None


def set_alike(choice: Choice) -> tuple[str, ...]:
    """Return sentences on how the simulator is set, so that teeth, speeds and angles are the same on both sides.

    Raises
    ------
    InputError
        If a rig file cannot be read.
    """
    common = common_rig(choice)
    text = (common or choice.recordings[0]).rig_text
    rig = read_rig_text(text, (common or choice.recordings[0]).rig_name)
    if rig is None:
        return ()
    pairs = ", ".join(f"{pair.driver_teeth}/{pair.driven_teeth}" for pair in rig.pairs)
    facts = [f"Teeth: {pairs}, as in the rig file"] if pairs else []
    facts.append("Speed: each recording's own, from its revolutions")
    facts.append("Angle: rotated until the same teeth meet, using marks where there are any")
    if choice.references:
        facts.append("Compared with the same machine when it was healthy: only changes since then count")
    return tuple(facts)


def own_rig(source: ChosenFile, rigs: tuple[ChosenFile, ...]) -> ChosenFile | None:
    """Return the rig file that is named like a recording (`run.5Nm.csv.gz`: `run.5Nm.toml`), None if there is none.

    Raises
    ------
    InputError
        If there are several.
    """
    named = [rig for rig in rigs if recording_stem(rig.name) == recording_stem(source.name)]
    if len(named) > 1:
        raise InputError(
            f"{len(named)} rig files are named like this recording: {', '.join(rig.name for rig in named)}",
            where=source.name,
            allowed="one",
            remedy="remove all but one of them",
        )
    return named[0] if named else None


def files_of(choice: Choice, folder: Path) -> GapRequest:
    """Write the uploads into a folder and return the request for the diagnosis.

    Raises
    ------
    InputError
        If there is more than one rig file for all, or for one recording, or none.
    """
    common = common_rig(choice)
    rig = None
    if common is not None:
        rig = folder / "rig.toml"
        rig.write_text(common.rig_text, encoding="utf-8")
    for file in choice.recorded if common is None else ():
        if not isinstance(file.content, Path) and own_rig(file, choice.rigs) is None:
            raise InputError(
                "no rig file is given",
                where=file.name,
                remedy="upload one for all recordings, or one with the recording's name; the Analysis page can make it",
            )
    paths = [_written(file, folder / str(i), choice.rigs) for i, file in enumerate(choice.recorded, 1)]
    n, n_compared = len(choice.recordings), len(choice.recordings) + len(choice.references)
    return GapRequest(
        tuple(paths[:n]),
        tuple(paths[n:n_compared]),
        rig,
        () if choice.torque_nm is None else (choice.torque_nm,),
        choice.sampling_rate_hz,
        tuple(file.name for file in choice.recordings),
        tuple(file.name for file in choice.references),
        reference_rate_hz=choice.reference_rate_hz,
        run_up=paths[-1] if choice.run_up is not None else None,
    )


def _written(source: ChosenFile, folder: Path, rigs: tuple[ChosenFile, ...]) -> Path:
    """Return the path of a source; an upload gets a separate folder, with its own rig file next to it."""
    if isinstance(source.content, Path):
        return source.content
    folder.mkdir()
    path = folder / safe_file_name(source.name)
    path.write_bytes(source.content)
    rig = own_rig(source, rigs)
    if rig is not None:
        path.with_name(f"{recording_stem(path.name)}.toml").write_text(rig.rig_text, encoding="utf-8")
    return path


# --------------------
# Choose recordings, healthy references, rig and simulator in the sidebar.
# --------------------


SAMPLES, FILES = "Samples", "Your files"
FIRST_SAMPLE, FIRST_REFERENCE = "root_crack_3mm", "root_crack_0mm"
ChosenFiles = tuple[tuple[ChosenFile, ...], tuple[ChosenFile, ...], tuple[ChosenFile, ...]]
"""Recordings, references, rig files."""


TITLES = {"cracked": "rigid gears", "reduced-fe": "flexible gears", "forging": "drive that starts and stops"}


def simulator_title(name: str) -> str:
    """Return what the page calls a simulator."""
    return TITLES.get(name, name)


def choose() -> Choice:
    """Return what the user chose; there may be no recording in it yet."""
    from sims.registry import gap_simulators

    with st.sidebar:
        origin = address.ask_one(st.radio, "Recordings", (SAMPLES, FILES), name="of", horizontal=True)
        recordings, references, rigs = _choose_samples() if origin == SAMPLES else _choose_files()
        run_up = _choose_run_up() if references and origin == FILES else None
        names = tuple(gap_simulators())
        model = address.ask_one(st.selectbox, "Simulator", names, name="simulator", format_func=simulator_title)
        with st.expander("Not in the files?", icon=":material/tune:"):
            looks: dict[str, Any] = {"placeholder": "from the rig", "help": "Of the input shaft, for all recordings."}
            torque = address.ask_number(st, "Torque (N·m)", 0.0, name="torque", **looks)
            looks = {"placeholder": "from the files or the rig"}
            rate = address.ask_number(st, "Sampling rate (Hz)", 0.0, name="rate", **looks)
            of_files = bool(references) and origin == FILES
            reference_rate = choose_reference_rate(of_several=True) if of_files else None
    return Choice(recordings, references, rigs, model, torque or None, rate or None, reference_rate, run_up)


def _choose_samples() -> ChosenFiles:
    known = {sample.rig.stem: sample for sample in samples()}

    def choose(label: str, without: list[str], first: str, about: str, name: str) -> list[str]:
        names = [stem for stem in known if stem not in without]
        chosen: list[str] = address.ask(
            st.multiselect,
            label,
            names,
            format_func=lambda stem: known[stem].title,
            name=name,
            first=[first] if first in names else [],
            read=address.some_of(names),
            help=about,
        )
        return chosen

    about = "Several operating conditions (speeds, loads) of one rig reveal more than one does."
    recordings = choose("Recordings of one rig", [], FIRST_SAMPLE, about, "recordings")
    about = "The same rig when it was healthy. It makes the answer much more certain."
    references = choose("Healthy references", recordings, FIRST_REFERENCE, about, "references")
    st.caption(SIMULATED)
    chosen, healthy = (tuple(sample_file(known[name]) for name in names) for names in (recordings, references))
    return chosen, healthy, ()


def _choose_files() -> ChosenFiles:
    about = "Several operating conditions (speeds, loads) reveal more than one does."
    recordings = choose_files("Recordings of one rig", "gap recordings", about=about, name="recordings")
    about = (
        "What is known about the machine: teeth, bearings, speed source. A rig file named like a recording overrides "
        "the speed and torque of that recording."
    )
    rigs = choose_files("Rig file (TOML)", "gap rigs", about=about, of_rigs=True, name="rigs")
    about = "The same rig when it was healthy. It makes the answer much more certain."
    return recordings, choose_files("Healthy references", "gap references", about=about, name="references"), rigs


def _choose_run_up() -> ChosenFile | None:
    about = (
        "The same rig run up or down when it was healthy, with a tachometer: it measures the path to the sensors, "
        "which distinguishes tooth faults."
    )
    return choose_file("Healthy run-up", "gap run-up", about=about, name="run-up")
