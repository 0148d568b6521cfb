"""One simulation of the laboratory: the recording, and the motion behind it that no sensor shows."""

from __future__ import annotations

import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TypeVar

import numpy as np
import streamlit as st

from app.dashboard import state
from app.dashboard.laboratory.setup import MODEL, Setup, preset_number
from app.dashboard.state import AnalysisRequest, Chosen
from app.dashboard.widgets.charts import download
from app.dashboard.widgets.texts import show_error
from app.dashboard.work import kept
from gearsig.checks import FloatArray
from gearsig.errors import GearsigError
from gearsig.plot import Cursor, order_cursors
from gearsig.recording import Recording
from gearsig.rig import SIDES, Rig, order_lines
from sims.cracked import Response, simulate_with_motion
from sims.effects import completed, effect
from sims.gear_pair import MeasuredRun, build_rig
from sims.machine import Machine, Operation
from sims.presets import preset
from sims.reduced_fe import FlexiblePair, FlexResponse
from sims.simulator import SimulationSetup

R = TypeVar("R")
MOTION = (
    "driver angle",
    "driven angle",
    "driver y",
    "driver y velocity",
    "driven y",
    "driven y velocity",
    "transmission_error_m",
    "mesh_force_n",
)
MOTION_HZ = 80_000.0
"""Minimum number of points of the motion kept per second."""


@dataclass(frozen=True)
class LaboratoryRun:
    """A setup and its results.

    Parameters
    ----------
    setup : Setup
    machine : Machine
        With its effects.
    recording : Recording
        With rig and truth.
    response : Response
        Motion from the recording's start on; see `MOTION` for its signals.
    pair : FlexiblePair or None
        Of the model with finite-element gears.
    """

    setup: Setup
    machine: Machine
    recording: Recording
    response: Response
    pair: FlexiblePair | None = None

    @property
    def rig(self) -> Rig:
        """Rig of the recording; a simulated one always has one."""
        assert self.recording.rig is not None  # noqa: S101 - for the type checker
        return self.recording.rig

    @property
    def vibration_channels(self) -> tuple[str, ...]:
        """Names of the acceleration channels."""
        return tuple(c.name for c in self.recording.channels if c.quantity == "acceleration")

    @cached_property
    def mesh_cycles(self) -> FloatArray:
        """Mesh cycles at each point of the motion: tooth k of the driver enters at k - 1 and every revolution."""
        cycles: FloatArray = self.response["driver angle"] * self.machine.mesh.pair.driver.teeth / (2.0 * np.pi)
        return cycles


def run_setup(setup: Setup) -> LaboratoryRun:
    """Simulate once, for both the recording, sample by sample that of `sims.simulate`, and the motion.

    Raises
    ------
    InputError
        If a value is out of range, or exceeds what the machine allows.
    """
    from sims.cracked import CrackedPair
    from sims.reduced_fe import ReducedPair, simulate_pair

    operation, rng = Operation.steady(setup.speed_rpm, setup.torque_nm), np.random.default_rng(setup.seed)
    rate_hz, duration_s = setup.sampling_rate_hz, setup.duration_s
    simulated_setup = SimulationSetup(setup.preset, dict(setup.parameters), setup.effects, operation)
    rig_name = f"simulated: {setup.preset}"
    if setup.model == MODEL:
        ready = CrackedPair().prepare(simulated_setup, rng, sampling_rate_hz=rate_hz)
        rig = build_rig(ready.machine, operation, name=rig_name)
        recording, response = simulate_with_motion(
            ready.machine, operation, MeasuredRun(rng, rate_hz, duration_s, rig, ready.truth(), also=MOTION)
        )
        return LaboratoryRun(setup, ready.machine, recording, _shown_part(response, duration_s))
    flexible = ReducedPair().prepare(simulated_setup, rng, sampling_rate_hz=rate_hz)
    pair, machine = flexible.pair, flexible.pair.machine
    rig = build_rig(machine, operation, name=rig_name)
    recording, bent = simulate_pair(
        pair, operation, MeasuredRun(rng, rate_hz, duration_s, rig, flexible.truth(), flexible.step_s, MOTION)
    )
    return LaboratoryRun(setup, machine, recording, _shown_part(bent, duration_s), pair)


def _shown_part(response: Response | FlexResponse, duration_s: float) -> Response:
    """Keep the signals that are shown, thinned to what that needs, from the recording's start to its end."""
    every = max(int(1.0 / (MOTION_HZ * response.interval_s)), 1)
    time = response.time_s
    first, last = (int(i) for i in np.searchsorted(time, (0.0, duration_s)))
    signals = {name: response[name][first:last:every].copy() for name in MOTION}
    return Response(float(time[first]), response.interval_s * every, signals, response.step_s, response.energy_j)


def lines_per_period(run: LaboratoryRun, n_per_revolution: float) -> FloatArray:
    """Return the times (s) at which the driver has turned another 1/n of a revolution: a Poincaré section's strobe."""
    turned = run.response["driver angle"] * n_per_revolution / (2.0 * np.pi)
    return times_of(run, turned, np.arange(np.ceil(turned[0]), np.floor(turned[-1]) + 1.0))


def times_of(run: LaboratoryRun, phase: FloatArray, values: FloatArray | Sequence[float]) -> FloatArray:
    """Return the times (s) at which a rising phase takes given values."""
    result: FloatArray = np.interp(values, phase, run.response.time_s)
    return result


# Each holds some MB: a recording and eight signals of the motion at 80 kHz. Older settings of a slider are of no use.
simulated = kept(24, "Simulating …", grace_s=0.0)(run_setup)
PREVIEW_REVOLUTIONS, PREVIEW_S = 2.0, 0.1
"""Length of a preview: revolutions of the slower shaft, and at least so many seconds."""


def preview_of(setup: Setup) -> Setup | None:
    """Return the setup with a recording short enough to follow a slider; None if it already is."""
    teeth = [preset_number(preset(setup.model, setup.preset), name) for name in ("teeth_driver", "teeth_driven")]
    slower_per_s = setup.revolutions_per_s * min(teeth[0] / teeth[1], 1.0)
    if slower_per_s <= 0.0:
        return None
    length_s = round(max(PREVIEW_REVOLUTIONS / slower_per_s, PREVIEW_S), 3)
    return replace(setup, duration_s=length_s) if length_s < 0.6 * setup.duration_s else None


def all_simulated(setup: Setup) -> bool:
    """Whether healthy and faulty machine are available at full length, or it is known why not."""
    try:
        return all(simulated.is_answered(s) for s in (setup.healthy, with_all_options(setup)))
    except GearsigError:
        return True


def with_all_options(setup: Setup) -> Setup:
    """Return the setup with every option of its effects stated."""
    return setup.healthy if setup.is_healthy else replace(setup, effects=completed(setup.effects))


def faulty_of(setup: Setup, simulate: Callable[[Setup], R]) -> R | None:
    """Return the run with every effect complete; None without effects or, with the reason shown, without a result."""
    try:
        return None if setup.is_healthy else simulate(with_all_options(setup))
    except GearsigError as error:
        show_error(error)
        return None


N_MESH_HARMONICS, N_SIDEBANDS, N_BEARING_HARMONICS, N_SHAFT_HARMONICS = 5, 3, 4, 8


def affected_sides(setup: Setup) -> tuple[str, ...]:
    """Return the sides whose shafts modulate the mesh: those that the effects name, or both if none is named."""
    named = {str(s.options.get("gear") or s.options.get("shaft") or "") for s in setup.effects}
    return tuple(side for side in SIDES if side in named) or SIDES


def spectrum_cursors(run: LaboratoryRun) -> tuple[Cursor, ...]:
    """Return mesh harmonics, sidebands of the affected shafts, and shaft lines, in Hz."""
    rig, setup = run.rig, run.setup
    shafts = dict(zip(SIDES, run.machine.shaft_names, strict=True))
    concerned = {shafts[side] for side in affected_sides(setup)}
    lines = order_lines(rig, n_mesh_harmonics=N_MESH_HARMONICS, n_sidebands=N_SIDEBANDS)
    kept = [
        line
        for line in lines
        if line.kind in ("mesh", "shaft") or (line.kind == "sideband" and line.modulating_shaft in concerned)
    ]
    return (*order_cursors(kept, setup.revolutions_per_s), *_hum_cursors(setup))


def _hum_cursors(setup: Setup) -> tuple[Cursor, ...]:
    hum = next((s for s in setup.effects if s.name == "mains_hum"), None)
    if hum is None:
        return ()
    mains = float(hum.options["frequency_hz"])
    return tuple(Cursor(k * mains, "finding", f"{k}× mains" if k > 1 else "mains", k) for k in (1, 2, 3))


def envelope_cursors(run: LaboratoryRun) -> tuple[Cursor, ...]:
    """Return the lines of the affected shafts, and harmonics of the lines of defective bearings, in Hz."""
    concerned = {run.machine.shaft_names[SIDES.index(side)] for side in affected_sides(run.setup)}
    lines = order_lines(run.rig, n_shaft_harmonics=N_SHAFT_HARMONICS, n_sidebands=0)
    shaft_lines = [line for line in lines if line.kind == "shaft" and line.element in concerned]
    cursors = [*order_cursors(shaft_lines, run.setup.revolutions_per_s)]
    for name, frequency in bearing_lines_hz(run).items():
        cursors += [
            Cursor(k * frequency, "bearing", name if k == 1 else f"{k}× {name}", k)
            for k in range(1, N_BEARING_HARMONICS + 1)
        ]
    return tuple(cursors)


def shaft_lines_hz(run: LaboratoryRun) -> list[float]:
    """Return the first orders of the affected shafts, in Hz."""
    shafts = dict(zip(SIDES, run.machine.shaft_names, strict=True))
    turns = [(run.rig.ratio(shafts[side]) or 0.0) * run.setup.revolutions_per_s for side in affected_sides(run.setup)]
    return [k * f for f in turns if f > 0 for k in range(1, N_BEARING_HARMONICS + 1)]


def bearing_lines_hz(run: LaboratoryRun) -> dict[str, float]:
    """Return the frequencies at which rolling elements strike defects, corrected for slip: name → Hz."""
    lines_hz = {}
    for support in run.machine.bearings:
        if support.defect is None:
            continue
        name = {"outer": "BPFO", "inner": "BPFI"}[support.defect.race]
        orders, turns = support.bearing.orders(), run.rig.ratio(support.bearing.shaft) or 1.0
        # A slipping cage falls behind: fewer elements pass the stationary race, and as many more the rotating one.
        slip = support.defect.slip * orders["BPFO"]
        order = orders[name] + (slip if name == "BPFI" else -slip)
        lines_hz[f"{name} {support.bearing.name}"] = order * turns * run.setup.revolutions_per_s
    return lines_hz


def faulty_teeth(setup: Setup) -> tuple[tuple[str, int], ...]:
    """Return (side, tooth from 1) of the effects that concern one tooth; tooth k of the driver enters at k - 1."""
    local = [s for s in setup.effects if effect(s.name).group == "tooth-local" and s.severity > 0]
    return tuple(dict.fromkeys((str(s.options["gear"]), round(float(s.options["tooth"]))) for s in local))


def entries(run: LaboratoryRun) -> tuple[Cursor, ...]:
    """Return the times at which faulty teeth enter the mesh, in s."""
    pair, cycles = run.machine.mesh.pair, run.mesh_cycles
    cursors = []
    for side, tooth in faulty_teeth(run.setup):
        n_teeth = pair.driver.teeth if side == "driver" else pair.driven.teeth
        first = np.ceil((cycles[0] - (tooth - 1)) / n_teeth) * n_teeth + tooth - 1
        times = times_of(run, cycles, np.arange(first, cycles[-1], n_teeth))
        cursors += [Cursor(float(t), "finding", f"{side} tooth {tooth} enters", i) for i, t in enumerate(times)]
    return tuple(cursors)


ENDINGS = (".h5", ".csv", ".parquet", ".mat", ".wav")


def show_saving(setup: Setup, lengths_s: Sequence[float] = ()) -> None:
    """Offer the simulated recording as files, and to be opened on the analysis page.

    Parameters
    ----------
    setup : Setup
    lengths_s : sequence of float
        Lengths to choose from; empty: the setup's own.
    """
    with st.container(horizontal=True, horizontal_alignment="right"):
        with st.popover("Save as recording", icon=":material/save:"):
            if lengths_s:
                length = st.segmented_control(
                    "Length (s)", lengths_s, default=5.0, key="length of the saved recording", persist_state="session"
                )
                setup = replace(setup, duration_s=float(length or 5.0))
            ending = st.selectbox("Format", ENDINGS, key="ending of the saved recording", persist_state="session")
            twin = st.toggle("With its healthy twin", key="twin of the saved recording", persist_state="session")
            made = partial(zipped, (setup, setup.healthy) if twin else (setup,), ending)
            download("Download", made, f"{setup.file_stem}.zip", type="primary")
            st.caption("A zip file with the recording, its rig file, and the truth: what was put in.")
        if st.button("Open in Analysis", icon=":material/troubleshoot:"):
            with st.spinner("Simulating the recording …"):
                state.open_simulated(chosen_of(setup))
            state.go_to("analysis")


def zipped(setups: tuple[Setup, ...], ending: str) -> bytes:
    """Return a zip file with recording, rig file and truth of each setup."""
    buffer = BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for place, setup in enumerate(setups):
            for name, content in files(setup, ending).items() if setup not in setups[:place] else ():
                archive.writestr(name, content)
    return buffer.getvalue()


def files(setup: Setup, ending: str) -> dict[str, bytes]:
    """Return recording, rig file and truth, in this order, by file name."""
    from sims.files import file_set, write_set

    with TemporaryDirectory(prefix="gearsig-") as folder:
        names = file_set(Path(folder) / f"{setup.file_stem}{ending}")
        write_set(setup.record(), names)
        return {path.name: path.read_bytes() for path in names}


def chosen_of(setup: Setup) -> Chosen:
    """Return the recording and its rig file as the analysis page takes an upload."""
    (name, content), (rig_name, rig), _ = files(setup, ".h5").items()
    request = AnalysisRequest(name, sha256(content).hexdigest(), rig_name, rig.decode("utf-8"))
    return Chosen(request, memoryview(content))
