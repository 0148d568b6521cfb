"""A drawn gearbox, sound or with its crack, as a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import cos, radians, sin
from typing import Any

import numpy as np

from app.calibration.rigs import DrawnRig, HousingMode
from gearsig.recording.types import Recording
from sims.cracked.linear import default_step_s
from sims.cracked.simulate import simulate_machine
from sims.cracked.simulator import NAME as CRACKED
from sims.cracked.simulator import CrackedPair, Prepared
from sims.effects import EffectSetting, with_effects
from sims.gear_pair.build import build_rig
from sims.gear_pair.roughness import draw_roughness
from sims.machine import Machine
from sims.machine.operation import Operation
from sims.measure import MeasuredChannel, ModalPath, PathMode
from sims.reduced_fe.simulate import simulate_pair
from sims.reduced_fe.simulator import PreparedPair, ReducedPair
from sims.reduced_fe.twin import STEP_S, twin_parameters

SAMPLING_RATE_HZ = 20480.0
MOST_LEAD_REV = 8


def simulate_rig(
    drawn: DrawnRig,
    *,
    effect: str = "root_crack",
    severity: float | None = None,
    run: int = 0,
    speed_factor: float = 1.0,
    torque_factor: float = 1.0,
    flanks: int = 0,
    options: Mapping[str, float | str] | None = None,
    further: Sequence[EffectSetting] = (),
    step_angle_rad: float | None = None,
    model: str = CRACKED,
) -> Recording:
    """Simulate one recording.

    Parameters
    ----------
    drawn : DrawnRig
    effect : str
    severity : float or None
        None: the drawn depth of the crack; 0: a sound gearbox.
    run : int
        Another run has other noise and begins at another place of the driven shaft; the flanks stay the same.
    speed_factor, torque_factor : float
    flanks : int
        Another number draws other profiles of the flanks.
    options : mapping or None
        Of the effect, besides or instead of the drawn gear and tooth.
    further : sequence of EffectSetting
        Effects that are switched on as well.
    step_angle_rad : float or None
        Of "cracked": step times the greatest angular eigenfrequency; None: the simulator's own, finer than floors
        need.
    model : str
        "cracked" or "reduced-fe".
    """
    operation = Operation.steady(drawn.speed_rpm * speed_factor, drawn.torque_nm * torque_factor)
    size = drawn.depth_mm if severity is None else severity
    chosen = {"gear": drawn.gear, "tooth": drawn.tooth + 1.0, **(options or {})}
    settings = [EffectSetting(effect, size, chosen)] if size > 0 else []
    draws = np.random.default_rng(drawn.seed)
    ready = _prepared(model, drawn, operation, draws)
    machine = with_effects(_with_path(ready.machine, drawn), [*settings, *further], draws)
    machine = _with_fixed_flanks(machine, [drawn.seed, 77 + flanks])
    rng, lead_rev = _beginning(drawn, run)
    lead_s = lead_rev * 60.0 / drawn.speed_rpm
    asked: dict[str, Any] = {
        "rng": rng,
        "sampling_rate_hz": SAMPLING_RATE_HZ,
        "duration_s": drawn.duration_s + (lead_s if run else 0.0),
        "rig": build_rig(machine, operation, name="drawn"),
        "truth": {"depth_mm": size, "effect": effect if size else "", **chosen},
    }
    if isinstance(ready, PreparedPair):
        recording, _ = simulate_pair(replace(ready.pair, machine=machine), operation, step_s=STEP_S, **asked)
    else:
        step_s = None if step_angle_rad is None else default_step_s(machine, operation, step_angle_rad)
        recording = simulate_machine(machine, operation, step_s=step_s, **asked)
    return _cut(recording, round(lead_s * SAMPLING_RATE_HZ)) if run else recording


def _prepared(model: str, drawn: DrawnRig, operation: Operation, rng: np.random.Generator) -> Prepared | PreparedPair:
    """Return the sound machine; finite-element gears are of full discs, with the mesh of a twin's."""
    if model == CRACKED:
        return CrackedPair().prepare(drawn.parameters, [], operation, rng, sampling_rate_hz=SAMPLING_RATE_HZ)
    values = twin_parameters(drawn.parameters, drawn.teeth) | {"roughness_locked_to": "flank"}
    return ReducedPair().prepare(values, [], operation, rng, sampling_rate_hz=SAMPLING_RATE_HZ)


def turns_before(drawn: DrawnRig, run: int) -> int:
    """Return the whole turns of the driver that a run's recording leaves out at its beginning."""
    return _beginning(drawn, run)[1] if run else 0


def _beginning(drawn: DrawnRig, run: int) -> tuple[np.random.Generator, int]:
    """Return a run's generator and the first it draws: whole turns before the recording."""
    rng = np.random.default_rng([drawn.seed, run])
    return rng, int(rng.integers(0, MOST_LEAD_REV))


def _with_fixed_flanks(machine: Machine, seed: list[int]) -> Machine:
    """Draw the flanks' profiles now: they belong to the gears, and are the same in each run."""
    if machine.roughness.locked_to != "flank":
        return machine
    machine, _ = draw_roughness(machine, np.random.default_rng(seed))
    return replace(machine, roughness=replace(machine.roughness, locked_to="none"))


def _with_path(machine: Machine, drawn: DrawnRig) -> Machine:
    """Replace the housing's modes by the drawn ones; the sensors stay at bearings 1 and 3."""
    channels = tuple(
        _with_modes(channel, bearing, drawn) for channel, bearing in zip(machine.chain.channels, (1, 3), strict=True)
    )
    return replace(machine, chain=replace(machine.chain, channels=channels))


def _with_modes(channel: MeasuredChannel, bearing: int, drawn: DrawnRig) -> MeasuredChannel:
    gain = drawn.sensor_gain
    own = tuple(channel.path.direct[f"bearing {bearing} {axis}"] for axis in "xy")
    modes = tuple(
        PathMode(
            mode.frequency_hz,
            mode.damping_ratio,
            {
                f"bearing {i + 1} {axis}": gain * mode.gain * mode.shape[bearing - 1] * mode.shape[i] * direction
                for i in range(4)
                for axis, direction in zip("xy", _direction(mode, own), strict=True)
            },
        )
        for mode in drawn.modes
    )
    direct = {name: gain * value for name, value in channel.path.direct.items()}
    return replace(channel, path=ModalPath(direct, modes))


def _direction(mode: HousingMode, of_the_sensor: tuple[float, ...]) -> tuple[float, ...]:
    """Return the parts of a bearing's x and y that move a mode."""
    if mode.direction_deg is None:
        return of_the_sensor
    phi = radians(mode.direction_deg)
    return cos(phi), sin(phi)


def _cut(recording: Recording, first: int) -> Recording:
    return replace(recording, samples=recording.samples[:, first:])
