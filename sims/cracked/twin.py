"""The cracked pair set to a rig, for the gap diagnosis: see `gearsig.gap.simulator`."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from gearsig.gap.simulator import Point
from gearsig.recording.types import Recording
from sims.cracked.simulator import NAME, prepare_preset
from sims.gear_pair.twin import PairGapSimulator, PairTwin
from sims.mesh import PairGeometry
from sims.presets import Preset

STEP_ANGLE_RAD = 0.9
"""Step times the greatest angular eigenfrequency: three times that of a single simulation, see `_step_s`."""


@dataclass(frozen=True)
class CrackedTwin(PairTwin):
    """A rig's twin with 16 degrees of freedom; see `sims.gear_pair.twin.PairTwin`."""

    @property
    def model(self) -> str:
        """Name of the model whose preset the twin is."""
        return NAME

    def _simulated(
        self,
        own: Preset,
        point: Point,
        seed: int,
        *,
        sampling_rate_hz: float,
        duration_s: float,
        noise_rng: np.random.Generator | None,
    ) -> Recording:
        """Run a specimen and measure it."""
        from sims.cracked.simulate import simulate_machine

        rng = np.random.default_rng(seed)
        ready = prepare_preset(own, {}, (), None, rng, sampling_rate_hz=sampling_rate_hz)
        return simulate_machine(
            ready.machine,
            ready.operation,
            rng=rng,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s,
            rig=self._rig_at(point),
            truth=ready.truth(),
            step_s=self._step_s(own),
            noise_rng=noise_rng,
        )

    def _geometry(self, own: Preset) -> PairGeometry:
        """Return the geometry of a specimen's pair."""
        return prepare_preset(own, {}, (), None, np.random.default_rng(0)).machine.mesh.pair

    def _step_s(self, own: Preset) -> float:
        """Step of the integrator: that of the sound machine, so that effects leave the drawn noise as it is.

        It is longer than that of a single simulation; the accelerations miss 2 to 4 parts in a thousand.
        """
        from sims.cracked.linear import default_step_s

        sound = prepare_preset(replace(own, effects=()), {}, (), None, np.random.default_rng(0))
        return default_step_s(sound.machine, sound.operation, STEP_ANGLE_RAD)


def cracked_gap_simulator() -> PairGapSimulator:
    """Return the model "cracked" as the gap diagnosis takes it."""
    return PairGapSimulator(NAME, CrackedTwin)
