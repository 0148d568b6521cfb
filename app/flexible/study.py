"""What a study of a flexible pair computes: maps over angle and torque, sweeps up and down, spectra over speed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from gearsig.angle.resample import resample_to_angle
from gearsig.angle.shaft import find_shaft_angle
from gearsig.checks import FloatArray, positive
from gearsig.orders.map import order_map
from gearsig.orders.types import OrderMap
from sims.gear_pair.build import build_rig
from sims.machine.operation import Course, Operation
from sims.reduced_fe.contact_spreading import SpreadingCheck, spreading_check
from sims.reduced_fe.dynamics_constants import FlexiblePair, constants
from sims.reduced_fe.dynamics_linear import eigenfrequencies_hz, torsional_mode
from sims.reduced_fe.dynamics_respond import STEP_S, TRANSMISSION_ERROR, respond
from sims.reduced_fe.dynamics_sweep import SpeedSweep, speed_sweep
from sims.reduced_fe.maps_static import MeshMaps
from sims.reduced_fe.simulate import check_depth, simulate_pair

SPECTRUM_RPM = (1000.0, 2000.0, 3000.0, 4000.0, 5000.0)
SETTLED_S, SPECTRUM_S = 0.4, 0.4
"""Left out ahead of a spectrum, and its length: bins of 2.5 Hz."""
HIGHEST_HZ = 12000.0
RUN_UP_S, RUN_UP_RATE_HZ, HIGHEST_ORDER = 6.0, 40960.0, 260.0
STRIDE = 4
N_ANGLES = 160
"""Mesh angles of natural frequencies."""

Progress = Callable[[str, float], object]


@dataclass(frozen=True)
class Study:
    """Results of a study; see `flexible_study`.

    Parameters
    ----------
    maps : MeshMaps
    sweeps : mapping of torque in N m to (up, down)
    spectra_hz : array, (n,)
    spectra_m : mapping of speed in rpm to peak amplitudes, (n,)
    natural_hz : mapping of torque to the torsional mode's frequency
    angle_hz : array, (n_c, n_modes)
        Eigenfrequencies over the mesh cycles `angle_cycles`, at the pair's own torque.
    uncoupled_hz : array, (n,)
        Of both sides without contact, rising.
    spreading : SpreadingCheck or None
    run_up : OrderMap
        Of the acceleration that the first sensor reads in a run-up through the sweeps' speeds.
    """

    torque_nm: float
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
    step_s: float = STEP_S,
    check_spreading: bool = False,
    on_progress: Progress = lambda *_: None,
) -> Study:
    """Run everything.

    Parameters
    ----------
    pair : FlexiblePair
    torque_nm : float
        Of spectra and eigenfrequencies.
    torques_nm : tuple of float
        Of the sweeps.
    sweep_s : float
        Length of one sweep; up and down of 15 s each are six million steps of 5 µs.
    first_rpm, last_rpm, step_s : float
    check_spreading : bool
        Also reduce the gears with contact at single nodes and at patches, see `sims.reduced_fe.contact_spreading`.
    on_progress : callable
        Told what is done, and which part of the whole.
    """
    positive(sweep_s, "sweep_s", "s")
    for torque in torques_nm:
        check_depth(pair, Operation.steady(last_rpm, torque))
    on_progress("maps", 0.0)
    maps = pair.maps()
    sweeps, n = {}, 2 * len(torques_nm) + 1
    for i, torque in enumerate(torques_nm):
        both = []
        for j, ends in enumerate(((first_rpm, last_rpm), (last_rpm, first_rpm))):
            on_progress(f"sweep {'up' if j == 0 else 'down'} at {torque:g} N·m", (2 * i + j) / n)
            both.append(speed_sweep(pair, torque, *ends, sweep_s, step_s=step_s))
        sweeps[torque] = (both[0], both[1])
    on_progress("spectra", (n - 1) / n)
    spectra = {speed: _spectrum(pair, speed, torque_nm, step_s) for speed in SPECTRUM_RPM}
    natural = {t: torsional_mode(pair, Operation.steady(last_rpm, t)).frequency_hz for t in (*torques_nm, torque_nm)}
    cycles = (np.arange(N_ANGLES) + 0.5) / N_ANGLES
    loaded = Operation.steady(last_rpm, torque_nm)
    own = constants(pair, loaded)
    at_angle = eigenfrequencies_hz(pair, loaded, cycles, ready=own)
    uncoupled = np.sort(np.concatenate([side.omega_rad_s[side.moving] for side in own.sides])) / (2.0 * np.pi)
    spreading = None
    if check_spreading:
        on_progress("contact at nodes and patches", (n - 1) / n)
        spreading = spreading_check(pair, loaded, cycles)
    axis = spectra[SPECTRUM_RPM[0]][0]
    lines = {speed: values for speed, (_, values) in spectra.items()}
    run_up = _run_up(pair, torque_nm, (first_rpm, last_rpm), min(RUN_UP_S, 2.0 * sweep_s + 0.5), step_s)
    return Study(torque_nm, maps, sweeps, axis, lines, natural, cycles, at_angle, uncoupled, spreading, run_up)


def _run_up(
    pair: FlexiblePair, torque_nm: float, speeds_rpm: tuple[float, float], duration_s: float, step_s: float
) -> OrderMap:
    """Measure a run-up and return its first channel's levels over order and time."""
    operation = Operation(Course.of([0.0, duration_s], speeds_rpm), Course.constant(torque_nm))
    recording, _ = simulate_pair(
        pair,
        operation,
        rng=np.random.default_rng(0),
        sampling_rate_hz=RUN_UP_RATE_HZ,
        duration_s=duration_s,
        rig=build_rig(pair.machine, operation, name="run-up"),
        step_s=step_s,
    )
    signal = resample_to_angle(recording, find_shaft_angle(recording))
    return order_map(signal, recording.vibration_names()[0], highest_order=HIGHEST_ORDER)


def _spectrum(pair: FlexiblePair, speed_rpm: float, torque_nm: float, step_s: float) -> tuple[FloatArray, FloatArray]:
    """Peak amplitudes of the dynamic transmission error at constant speed, by a flat-top window."""
    from scipy import fft
    from scipy.signal.windows import flattop

    operation = Operation.steady(speed_rpm, torque_nm)
    run = respond(
        pair,
        operation,
        duration_s=SETTLED_S + SPECTRUM_S,
        signals=(TRANSMISSION_ERROR,),
        step_s=step_s,
        stride=STRIDE,
        ready=constants(pair, operation),
    )
    x = run[TRANSMISSION_ERROR][-round(SPECTRUM_S / run.interval_s) :]
    window = flattop(len(x), sym=False)
    amplitude = 2.0 * np.abs(fft.rfft((x - x.mean()) * window)) / window.sum()
    axis = fft.rfftfreq(len(x), run.interval_s)
    inside = axis <= HIGHEST_HZ
    return axis[inside], amplitude[inside]
