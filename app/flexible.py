"""A study of a flexible pair: maps over angle and torque, sweeps up and down, spectra over speed."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from gearsig import plot
from gearsig.angle import find_shaft_angle, resample_to_angle
from gearsig.checks import FloatArray, positive
from gearsig.formatting import csv_rows
from gearsig.orders import OrderMap, order_map
from gearsig.report import write_folder
from sims import reduced_fe
from sims.gear_pair import MeasuredRun, build_rig
from sims.machine import Operation, Profile
from sims.reduced_fe import (
    FlexiblePair,
    MeshMaps,
    SpeedSweep,
    SpreadingCheck,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure


SPECTRUM_RPM = (1000.0, 2000.0, 3000.0, 4000.0, 5000.0)
SETTLED_S, SPECTRUM_S = 0.4, 0.4
"""Transient left out before a spectrum, and length of the spectrum, in s; the latter gives bins of 2.5 Hz."""
HIGHEST_HZ = 12000.0
RUN_UP_S, RUN_UP_RATE_HZ, HIGHEST_ORDER = 6.0, 40960.0, 260.0
STRIDE = 4
N_ANGLES = 160
"""Number of mesh angles at which natural frequencies are computed."""

Progress = Callable[[str, float], object]


@dataclass(frozen=True)
class Study:
    """Results of a study; see `flexible_study`.

    Parameters
    ----------
    torque_nm : float
        Torque of spectra and eigenfrequencies.
    n_teeth : int
        Tooth count of the driver.
    maps : MeshMaps
    sweeps : mapping of torque in N m to (up, down)
    spectra_hz : array, (n,)
    spectra_m : mapping of speed in rpm to peak amplitudes, (n,)
    natural_hz : mapping of torque in N m to the frequency of the torsional mode
    angle_hz : array, (n_c, n_modes)
        Eigenfrequencies over the mesh cycles `angle_cycles`, at `torque_nm`.
    uncoupled_hz : array, (n,)
        Eigenfrequencies of both sides without contact, ascending.
    spreading : SpreadingCheck or None
    run_up : OrderMap
        Order map of the acceleration at the first sensor in a run-up through the speeds of the sweeps.
    """

    torque_nm: float
    n_teeth: int
    maps: MeshMaps
    sweeps: dict[float, tuple[SpeedSweep, SpeedSweep]]
    spectra_hz: FloatArray
    spectra_m: dict[float, FloatArray]
    natural_hz: dict[float, float]
    angle_cycles: FloatArray
    angle_hz: FloatArray
    uncoupled_hz: FloatArray
    spreading: SpreadingCheck | None
    run_up: OrderMap


def flexible_study(
    pair: FlexiblePair,
    torque_nm: float,
    torques_nm: tuple[float, ...],
    *,
    sweep_s: float,
    first_rpm: float = 900.0,
    last_rpm: float = 4100.0,
    step_s: float = reduced_fe.STEP_S,
    check_spreading: bool = False,
    on_progress: Progress = lambda *_: None,
) -> Study:
    """Compute maps, sweeps, spectra and eigenfrequencies of a flexible pair.

    Parameters
    ----------
    pair : FlexiblePair
    torque_nm : float
        Torque of spectra and eigenfrequencies.
    torques_nm : tuple of float
        Torques of the sweeps.
    sweep_s : float
        Length of one sweep; up and down of 15 s each are six million steps of 5 µs.
    first_rpm, last_rpm, step_s : float
    check_spreading : bool
        Also reduce the gears with contact at single nodes and at patches, see `sims.reduced_fe`.
    on_progress : callable
        Takes the current stage and the fraction completed.
    """
    positive(sweep_s, "sweep_s", "s")
    for torque in torques_nm:
        reduced_fe.check_depth(pair, Operation.steady(last_rpm, torque))
    on_progress("maps", 0.0)
    maps = pair.maps()
    sweeps, n = {}, 2 * len(torques_nm) + 1
    for i, torque in enumerate(torques_nm):
        both = []
        for j, ends in enumerate(((first_rpm, last_rpm), (last_rpm, first_rpm))):
            on_progress(f"sweep {'up' if j == 0 else 'down'} at {torque:g} N·m", (2 * i + j) / n)
            both.append(reduced_fe.speed_sweep(pair, torque, *ends, sweep_s, step_s=step_s))
        sweeps[torque] = (both[0], both[1])
    on_progress("spectra", (n - 1) / n)
    spectra = {speed: _spectrum(pair, speed, torque_nm, step_s) for speed in SPECTRUM_RPM}
    natural = {
        t: reduced_fe.torsional_mode(pair, Operation.steady(last_rpm, t)).frequency_hz for t in (*torques_nm, torque_nm)
    }
    cycles = (np.arange(N_ANGLES) + 0.5) / N_ANGLES
    loaded = Operation.steady(last_rpm, torque_nm)
    ready = reduced_fe.constants(pair, loaded)
    at_angle = reduced_fe.eigenfrequencies_hz(pair, loaded, cycles, ready=ready)
    uncoupled = np.sort(np.concatenate([side.omega_rad_s[side.moving] for side in ready.sides])) / (2.0 * np.pi)
    spreading = None
    if check_spreading:
        on_progress("contact at nodes and patches", (n - 1) / n)
        spreading = reduced_fe.spreading_check(pair, loaded, cycles)
    axis = spectra[SPECTRUM_RPM[0]][0]
    lines = {speed: values for speed, (_, values) in spectra.items()}
    run_up = _run_up(pair, torque_nm, (first_rpm, last_rpm), min(RUN_UP_S, 2.0 * sweep_s + 0.5), step_s)
    return Study(
        torque_nm,
        pair.machine.mesh.pair.driver.teeth,
        maps,
        sweeps,
        axis,
        lines,
        natural,
        cycles,
        at_angle,
        uncoupled,
        spreading,
        run_up,
    )


def _run_up(
    pair: FlexiblePair, torque_nm: float, speeds_rpm: tuple[float, float], duration_s: float, step_s: float
) -> OrderMap:
    """Simulate a run-up and return the levels of its first channel over order and time."""
    operation = Operation(Profile.of([0.0, duration_s], speeds_rpm), Profile.constant(torque_nm))
    rig = build_rig(pair.machine, operation, name="run-up")
    recording, _ = reduced_fe.simulate_pair(
        pair, operation, MeasuredRun(np.random.default_rng(0), RUN_UP_RATE_HZ, duration_s, rig, step_s=step_s)
    )
    signal = resample_to_angle(recording, find_shaft_angle(recording))
    return order_map(signal, recording.vibration_names()[0], highest_order=HIGHEST_ORDER)


def _spectrum(pair: FlexiblePair, speed_rpm: float, torque_nm: float, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Return frequencies and peak amplitudes of the dynamic transmission error (flat-top window), constant speed."""
    from scipy import fft
    from scipy.signal.windows import flattop

    operation = Operation.steady(speed_rpm, torque_nm)
    run = reduced_fe.respond(
        pair,
        operation,
        duration_s=SETTLED_S + SPECTRUM_S,
        signals=(reduced_fe.TRANSMISSION_ERROR,),
        step_s=step_s,
        stride=STRIDE,
        ready=reduced_fe.constants(pair, operation),
    )
    x = run[reduced_fe.TRANSMISSION_ERROR][-round(SPECTRUM_S / run.interval_s) :]
    window = flattop(len(x), sym=False)
    amplitude = 2.0 * np.abs(fft.rfft((x - x.mean()) * window)) / window.sum()
    axis = fft.rfftfreq(len(x), run.interval_s)
    inside = axis <= HIGHEST_HZ
    return axis[inside], amplitude[inside]


NAMES = {"node": "line of nodes", "patch": "RBE3 patch", "section": "tooth section"}
RANGE = (0.52, 1.25)
"""Range, relative to the torsional mode's frequency, in which its jumps are sought."""


def write_study(study: Study, folder: Path, title: str) -> tuple[Path, ...]:
    """Write all figures as PNG, the sweeps as CSV and a summary as JSON; return the paths."""
    drawn = {f"{name}.png": figure for name, figure in figures(study, title).items()}
    text = json.dumps(summary(study), indent=2, ensure_ascii=False) + "\n"
    tables = {"sweeps.csv": sweeps_csv(study), "maps.csv": maps_csv(study.maps)}
    return write_folder(folder, drawn, {**tables, "study.json": text})


def figures(study: Study, title: str) -> dict[str, Figure]:
    """Return every figure by its file name."""
    maps = study.maps
    twice = np.concatenate((maps.mesh_cycles, maps.mesh_cycles + 1.0))
    stiffness = {
        "tangent mesh stiffness (10⁸ N/m)": np.tile(maps.tangent_stiffness_n_per_m, (2, 1)) / 1e8,
        "secant mesh stiffness (10⁸ N/m)": np.tile(maps.secant_stiffness_n_per_m, (2, 1)) / 1e8,
    }
    error = {"static transmission error (µm)": np.tile(maps.transmission_error_m, (2, 1)) * 1e6}
    drawn = {
        "stiffness_map": plot.mesh_maps_figure(twice, maps.torque_nm, stiffness, title=f"Mesh stiffness, {title}"),
        "pair_stiffness_map": _pair_stiffness(study, title),
        "transmission_error_map": plot.mesh_maps_figure(
            twice, maps.torque_nm, error, title=f"Static transmission error, {title}"
        ),
        "load_sharing": _sharing(study, title),
        "spectra": plot.speed_spectra_figure(
            study.spectra_hz,
            {f"{speed:g} rpm": values for speed, values in study.spectra_m.items()},
            mesh_hz=[speed / 60.0 * study.n_teeth for speed in study.spectra_m],
            natural_hz=study.natural_hz[study.torque_nm],
            title=f"Spectra of the dynamic transmission error at {study.torque_nm:g} N·m, {title}; dashed: ωₙ",
        ),
    }
    low = study.angle_hz[:, study.angle_hz[0] < HIGHEST_HZ]
    words = f"Natural frequencies over the mesh angle at {study.torque_nm:g} N·m, {title}"
    uncoupled = study.uncoupled_hz[study.uncoupled_hz < HIGHEST_HZ]
    drawn["natural_frequencies"] = plot.frequency_curves_figure(study.angle_cycles, low, uncoupled, title=words)
    if study.spreading is not None:
        check = study.spreading
        curves = {
            f"{NAMES[spread]}: ripple {100.0 * check.ripple[spread]:.2g} %": values
            for spread, values in check.frequency_hz.items()
        }
        words = f"Contact spread over nodes at {study.torque_nm:g} N·m, {title}; ripple: of a tooth's compliance"
        panel = plot.curve_panel(check.mesh_cycles, curves, "mesh cycles (tooth passages)", "torsional mode (Hz)")
        drawn["contact_spreading"] = plot.panels_figure([panel], title=words)
    words = f"Run-up at {study.torque_nm:g} N·m, {title}: acceleration (m/s²) at sensor {study.run_up.source}"
    drawn["run_up"] = plot.order_map_figure(replace(study.run_up, source=words), height_in=4.6)
    if study.sweeps:
        rows = [
            (f"{torque:g} N·m", up.mesh_hz, up.rms_m, down.rms_m[::-1]) for torque, (up, down) in study.sweeps.items()
        ]
        natural = float(np.mean([study.natural_hz[torque] for torque in study.sweeps]))
        drawn["sweeps"] = plot.speed_sweep_figure(rows, natural_hz=natural, title=f"Speed sweeps, {title}")
    return drawn


def sweeps_csv(study: Study) -> str:
    """Return the sweeps as CSV, with one line for each segment of each sweep."""
    header = ["torque_nm", "direction", "speed_rpm", "mesh_hz", "rms_um", "least_force_n", "lost_part"]
    rows: list[list[str]] = []
    for torque, pair in study.sweeps.items():
        for direction, sweep in zip(("up", "down"), pair, strict=True):
            columns = (sweep.speed_rpm, sweep.mesh_hz, sweep.rms_m * 1e6, sweep.minimum_force_n, sweep.lost_part)
            rows += [[f"{torque:g}", direction, *(f"{v:.6g}" for v in row)] for row in zip(*columns, strict=True)]
    return csv_rows(header, rows)


def maps_csv(maps: MeshMaps) -> str:
    """Return the maps as CSV, one line per angle and torque: the whole mesh, then each pair, newest first."""
    n_slots = maps.pair_forces_n.shape[2]
    names = ["torque_nm", "mesh_cycles", "transmission_error_um", "tangent_n_per_m", "secant_n_per_m"]
    whole = (1e6 * maps.transmission_error_m, maps.tangent_stiffness_n_per_m, maps.secant_stiffness_n_per_m)
    columns = [*np.broadcast_arrays(maps.torque_nm, maps.mesh_cycles[:, None]), *whole]
    for j in range(n_slots):
        names += [f"pair_{j}_force_n", f"pair_{j}_load_part", f"pair_{j}_tangent_n_per_m", f"pair_{j}_secant_n_per_m"]
        pair = (maps.pair_forces_n, maps.load_sharing, maps.contact_tangent_n_per_m, maps.contact_secant_n_per_m)
        columns += [values[:, :, j] for values in pair]
    rows = np.column_stack([values.T.ravel() for values in columns])
    return csv_rows(names, ([f"{v:.6g}" for v in row] for row in rows))


def summary(study: Study) -> dict[str, object]:
    """Return the main numbers of a study."""
    rows = []
    for torque, (up, down) in study.sweeps.items():
        natural = study.natural_hz[torque]
        low, highest = (part * natural for part in RANGE)
        rows.append(
            {
                "torque_nm": torque,
                "torsional_mode_hz": natural,
                "peak_up_hz": up.peak_hz(low, highest),
                "peak_down_hz": down.peak_hz(low, highest),
                "jump_up_hz": up.jump_hz(low, highest),
                "jump_down_hz": down.jump_hz(low, highest),
                "largest_rms_um": [float(up.rms_m.max() * 1e6), float(down.rms_m.max() * 1e6)],
                "largest_part_without_contact": [float(up.lost_part.max()), float(down.lost_part.max())],
                "n_steps": up.n_steps + down.n_steps,
                "step_s": up.step_s,
            }
        )
    maps = study.maps
    static = [
        {
            "torque_nm": float(t),
            "mean_tangent_n_per_m": float(maps.tangent_stiffness_n_per_m[:, i].mean()),
            "mean_secant_n_per_m": float(maps.secant_stiffness_n_per_m[:, i].mean()),
            "transmission_error_um": [
                float(maps.transmission_error_m[:, i].min() * 1e6),
                float(maps.transmission_error_m[:, i].max() * 1e6),
            ],
        }
        for i, t in enumerate(maps.torque_nm)
    ]
    return {"sweeps": rows, "static": static}


def _pair_stiffness(study: Study, title: str) -> Figure:
    """Draw the contact stiffness of one pair along its path, over torque; the pair enters at 1."""
    maps = study.maps
    twice = np.concatenate((maps.mesh_cycles, maps.mesh_cycles + 1.0, maps.mesh_cycles + 2.0))
    slot = np.floor(twice + reduced_fe.MARGIN).astype(np.int64) - 1
    place = np.tile(np.arange(len(maps.mesh_cycles)), 3)
    in_mesh = (slot >= 0) & (slot < maps.pair_forces_n.shape[2])

    def of_pair(values: FloatArray) -> FloatArray:
        of_slot = values[place, :, np.clip(slot, 0, values.shape[2] - 1)]
        return np.where(in_mesh[:, None], of_slot, 0.0) / 1e8

    kinds = {
        "tangent contact stiffness (10⁸ N/m)": of_pair(maps.contact_tangent_n_per_m),
        "secant contact stiffness (10⁸ N/m)": of_pair(maps.contact_secant_n_per_m),
    }
    return plot.mesh_maps_figure(
        twice, maps.torque_nm, kinds, title=f"Contact stiffness of the pair that enters at 1, {title}"
    )


def _sharing(study: Study, title: str) -> Figure:
    maps = study.maps
    place = int(np.argmin(np.abs(maps.torque_nm - 170.0)))
    n_slots = maps.force_n.shape[2]
    # Each pair keeps its name over two cycles: slot j of cycle c holds pair ⌊c − start⌋ − j.
    cycles = np.concatenate((maps.mesh_cycles, maps.mesh_cycles + 1.0))
    newest = np.floor(cycles + reduced_fe.MARGIN).astype(int)
    forces = np.tile(maps.pair_forces_n[:, place], (2, 1))
    pairs = range(int(newest.min()) - n_slots + 1, int(newest.max()) + 1)
    curves = {
        f"pair {k + 2}": np.array(
            [f[m - k] if 0 <= m - k < n_slots else 0.0 for f, m in zip(forces, newest, strict=True)]
        )
        for k in pairs
    }
    carried = {name: force for name, force in curves.items() if force.any()}
    few = np.unique(np.linspace(0, len(maps.torque_nm) - 1, 5).round()).astype(int)
    errors = {f"{maps.torque_nm[i]:.3g} N·m": np.tile(maps.transmission_error_m[:, i], 2) for i in few}
    words = f"Load sharing at {maps.torque_nm[place]:.3g} N·m, and static transmission error, {title}"
    return plot.load_sharing_figure(cycles, carried, errors, title=words)
