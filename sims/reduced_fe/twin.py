"""The pair of finite-element gears set to a rig, for the gap diagnosis: see `gearsig.gap.simulator`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gearsig.gap.simulator import Point
from gearsig.recording.types import Recording
from sims.gear_pair.twin import PairGapSimulator, PairTwin
from sims.mesh import PairGeometry
from sims.presets import Preset
from sims.reduced_fe.parameters import PARAMETERS
from sims.reduced_fe.simulator import NAME, prepare_preset
from sims.simulator import ParameterValue

MESH_DOF, MESH_DOF_PER_TOOTH = 40_000, 900
"""Of a twin's gears: their compliance is within a few per cent of that of finer meshes, less than a rig file knows."""
STEP_S = 8.2e-6
"""Longer than that of a single simulation: six steps for a sample at 20480 Hz. Up to 10 kHz lines of acceleration miss
0.2 dB (median; 95 % of them less than 0.8 dB), those of the transmission error 0.01 dB: far less than one specimen's
housing differs from another's."""


def twin_parameters(values: Mapping[str, ParameterValue], teeth: tuple[int, int]) -> dict[str, ParameterValue]:
    """Return those parameters of the 16-DOF pair that this model has, with the mesh of a twin's gears."""
    known = {p.name for p in PARAMETERS}
    own = {name: value for name, value in values.items() if name in known}
    return own | {"mesh_dof": float(max(MESH_DOF, MESH_DOF_PER_TOOTH * max(teeth)))}


@dataclass(frozen=True)
class ReducedTwin(PairTwin):
    """A rig's twin with finite-element gears, full discs; see `sims.gear_pair.twin.PairTwin`."""

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
        from sims.reduced_fe.simulate import simulate_pair

        rng = np.random.default_rng(seed)
        ready = prepare_preset(own, {}, (), None, rng, sampling_rate_hz=sampling_rate_hz)
        recording, _ = simulate_pair(
            ready.pair,
            ready.operation,
            rng=rng,
            sampling_rate_hz=sampling_rate_hz,
            duration_s=duration_s,
            rig=self._rig_at(point),
            truth=ready.truth(),
            step_s=STEP_S,
            noise_rng=noise_rng,
        )
        return recording

    def _own_parameters(self, values: dict[str, ParameterValue]) -> dict[str, ParameterValue]:
        return twin_parameters(values, self.nominal.teeth)

    def _geometry(self, own: Preset) -> PairGeometry:
        return prepare_preset(own, {}, (), None, np.random.default_rng(0)).pair.machine.mesh.pair


def reduced_gap_simulator() -> PairGapSimulator:
    """Return the model "reduced-fe" as the gap diagnosis takes it; its twin's gears are reduced, and kept on disk."""
    return PairGapSimulator(NAME, ReducedTwin)
