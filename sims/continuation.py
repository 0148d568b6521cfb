"""Steady runs at successive parameter values, each starting where the last one ended: branches of a bifurcation."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint, count, one_of
from gearsig.errors import InputError
from gearsig.recording import Recording
from sims.cracked import (
    NAME,
    SIGNALS,
    CrackedPair,
    PairState,
    Response,
    default_step_s,
    respond,
    simulate_with_motion,
    slowest_decay_s,
)
from sims.gear_pair import COORDINATES, MIN_MOTION_HZ, MeasuredRun, ReadyPair
from sims.machine import Machine, Operation, Profile
from sims.sweep import Sweep

SECTIONS = ("mesh", "shaft")
TRANSMISSION_ERROR = "transmission_error_m"
DECAYS = 8.0
"""Time constants of the slowest decay that are discarded at each value: 0.03 % of the transient remains."""
RAMP_S = 0.1
"""Duration of the ramp of speed and torque between values; a step could throw the motion off its branch."""
SPARE_CYCLES = 2
MIN_PER_CYCLE = 16
"""Minimum number of points kept per cycle, so that the section can be interpolated."""
_ANGLE = ("driver angle", "driver angle velocity")


@dataclass(frozen=True)
class End:
    """Where a run ended: its state, and its steady speed and torque."""

    state: PairState
    speed_rpm: float
    torque_nm: float


@dataclass(frozen=True)
class SteadyRun:
    """The machine at one value, with its transient discarded.

    Parameters
    ----------
    value : float
        Of the varied quantity.
    machine : Machine
        With its effects.
    response : Response
        From time 0 on: driver angle, transmission error, mesh force and the requested signals.
    recording : Recording or None
        Given where a channel of the measurement chain was requested; on the same time axis.
    settled_s : float
        Duration of the discarded transient.
    end : End
        Starting point of the next run.
    """

    value: float
    machine: Machine
    response: Response
    recording: Recording | None
    settled_s: float
    end: End

    @property
    def rate_of_transmission_error_mps(self) -> FloatArray:
        """Rate of r_b1 θ1 − r_b2 θ2."""
        pair, response = self.machine.mesh.pair, self.response
        driver_mps = pair.driver.base_radius_mm * response["driver angle velocity"]
        return 1e-3 * (driver_mps - pair.driven.base_radius_mm * response["driven angle velocity"])

    @property
    def separated_share(self) -> float:
        """Fraction of the time without a tooth in contact."""
        return float(np.mean(self.response["mesh_force_n"] == 0.0))


@dataclass(frozen=True)
class Branch:
    """A branch: what is run at each value.

    Parameters
    ----------
    sweep : Sweep
        With one axis; the same roughness and tolerances are drawn at every value. Its duration is not used.
    signal : str
        One of `sims.cracked.SIGNALS`, or a channel of the measurement chain (noise included), e.g. "a1".
    section : str
        Whether cycles are those of the "mesh" or of the input "shaft".
    n_cycles : int
        Cycles kept at each value.
    """

    sweep: Sweep
    signal: str = TRANSMISSION_ERROR
    section: str = "mesh"
    n_cycles: int = 200

    def __post_init__(self) -> None:
        one_of(self.section, "section", SECTIONS)
        count(self.n_cycles, "n_cycles", minimum=4, maximum=100_000)
        if self.sweep.model != NAME:
            raise InputError(f"model {self.sweep.model} cannot continue from a state", allowed=NAME)
        if len(self.sweep.axes) != 1:
            raise InputError(f"{len(self.sweep.axes)} quantities are varied", allowed="one", remedy="give --vary once")
        for profile, name in ((self.sweep.speed_rpm, "speed_rpm"), (self.sweep.torque_nm, "torque_nm")):
            if profile is not None and np.ptp(profile.values) > 0.0:
                raise InputError(f"{name} changes with time", allowed="constant: the motion must become steady")

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the varied quantity, ascending."""
        return tuple(sorted(self.sweep.axes[0].values))

    def check_signal(self) -> None:
        """Reject a signal that neither the model nor its measurement chain has."""
        if self.signal in SIGNALS:
            return
        machine = self._prepared(self.values[0], np.random.default_rng(self.sweep.seed)).machine
        names = [channel.name for channel in machine.chain.channels]
        if self.signal not in names:
            raise InputError(
                f"there is no signal or channel {self.signal!r}",
                allowed=f"{', '.join((*names, TRANSMISSION_ERROR, 'driver y'))} and more, see sims.cracked",
                remedy=closest_match_hint(self.signal, (*names, *SIGNALS)),
            )

    def run(self, value: float, before: End | None = None) -> SteadyRun:
        """Run one value, from the end of another run or from static equilibrium.

        The first `DECAYS` time constants of the machine's slowest decay are discarded.
        """
        rng = np.random.default_rng(self.sweep.seed)
        ready = self._prepared(value, rng)
        machine, operation = ready.machine, ready.operation
        speed = operation.speed_rpm.largest
        if speed <= 0.0:
            raise InputError("speed_rpm is 0", allowed="> 0 rpm: a shaft at rest has no cycles")
        cycle_s = 60.0 / speed / (machine.mesh.pair.driver.teeth if self.section == "mesh" else 1)
        duration_s = (self.n_cycles + 2 * SPARE_CYCLES) * cycle_s
        settle_s = DECAYS * slowest_decay_s(machine, operation)
        first, recording = _ramped(ready, before, self.sweep.seed), None
        if self.signal in SIGNALS:
            response = self._settled(ready, rng, first, settle_s, duration_s, cycle_s)
        else:
            state = self._settled(ready, np.random.default_rng(self.sweep.seed), first, settle_s, cycle_s, cycle_s).last
            measured = MeasuredRun(
                rng, self.sweep.sampling_rate_hz, duration_s, also=self._signals_needed(), first=state
            )
            recording, response = simulate_with_motion(machine, operation, measured)
        assert response.last is not None  # noqa: S101 - for the type checker: `respond` always sets it
        end = End(response.last, speed, operation.torque_nm.largest)
        return SteadyRun(value, machine, _from_zero(response), recording, settle_s, end)

    def _prepared(self, value: float, rng: np.random.Generator) -> ReadyPair:
        point = self.sweep.points()[self.sweep.axes[0].values.index(value)]
        settings = self.sweep.at(point)
        return CrackedPair().prepare(settings.setup, rng, sampling_rate_hz=settings.sampling_rate_hz)

    def _signals_needed(self) -> tuple[str, ...]:
        signals = [self.signal] if self.signal in SIGNALS else []
        rates = [f"{name} velocity" for name in signals if name in COORDINATES]
        return tuple(
            dict.fromkeys((*_ANGLE, "driven angle velocity", TRANSMISSION_ERROR, "mesh_force_n", *signals, *rates))
        )

    def _settled(
        self,
        ready: ReadyPair,
        rng: np.random.Generator,
        first: PairState | None,
        settle_s: float,
        duration_s: float,
        cycle_s: float,
    ) -> Response:
        step = default_step_s(ready.machine, ready.operation)
        machine_rng, _ = rng.spawn(2)  # as in `simulate_with_motion`: the same seed gives the same flanks
        return respond(
            ready.machine,
            ready.operation,
            duration_s=settle_s + duration_s,
            rng=machine_rng,
            signals=self._signals_needed(),
            start_s=-settle_s,
            step_s=step,
            stride=max(int(min(1.0 / MIN_MOTION_HZ, cycle_s / MIN_PER_CYCLE) / step), 1),
            first=first,
        )


def _ramped(ready: ReadyPair, before: End | None, seed: int) -> PairState | None:
    """Return the state after a slow ramp from the previous operation to this one."""
    if before is None:
        return None
    now = ready.operation
    pairs = ((before.speed_rpm, now.speed_rpm.largest), (before.torque_nm, now.torque_nm.largest))
    if all(a == b for a, b in pairs):
        return before.state
    speed, torque = (Profile.of((0.0, RAMP_S), pair) for pair in pairs)
    response = respond(
        ready.machine,
        Operation(speed, torque),
        duration_s=RAMP_S,
        rng=np.random.default_rng(seed).spawn(2)[0],
        signals=("driver angle",),
        stride=1000,
        first=before.state,
    )
    return response.last


def _from_zero(response: Response) -> Response:
    """Keep time 0 and later; whole revolutions are subtracted from the angle to preserve its precision."""
    start = int(np.searchsorted(response.time_s, -1e-12))
    signals = {name: values[start:].copy() for name, values in response.signals.items()}
    turn = 2.0 * pi
    signals["driver angle"] -= turn * np.floor(signals["driver angle"][0] / turn)
    return Response(
        float(response.time_s[start]), response.interval_s, signals, response.step_s, response.energy_j, response.last
    )
