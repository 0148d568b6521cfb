"""The pair of finite-element gears set to a rig, for the gap diagnosis: see `gearsig.gap.simulator`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from gearsig.errors import InputError, RefusalError
from gearsig.gap.simulator import GapEffect, Point
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from sims.cracked.twin import CrackedTwin, gap_effects_of
from sims.cracked.usual import nominal_of
from sims.effects import effects
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


@dataclass(frozen=True)
class ReducedTwin(CrackedTwin):
    """A rig's twin with finite-element gears, full discs; the rest as of `sims.cracked.twin.CrackedTwin`."""

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
        known = {p.name for p in PARAMETERS}
        n_dof = max(MESH_DOF, MESH_DOF_PER_TOOTH * max(self.nominal.teeth))
        return {name: value for name, value in values.items() if name in known} | {"mesh_dof": float(n_dof)}

    def _geometry(self, own: Preset) -> PairGeometry:
        return prepare_preset(own, {}, (), None, np.random.default_rng(0)).pair.machine.mesh.pair


@dataclass(frozen=True)
class ReducedGapSimulator:
    """The model "reduced-fe" as the gap diagnosis takes it."""

    @property
    def name(self) -> str:
        """As on the command line."""
        return NAME

    def gap_effects(self) -> Mapping[str, GapEffect]:
        """Return the effects of the catalogue."""
        return gap_effects_of(effects())

    def twin_of(self, rig: Rig) -> ReducedTwin:
        """Return a twin of the rig; its gears are meshed and reduced, and kept on disk.

        Raises
        ------
        RefusalError
            If there is not exactly one pair, its teeth or module are not known, or the model cannot have such gears.
        """
        twin = ReducedTwin(rig, nominal_of(rig))
        try:
            prepare_preset(twin.preset(twin.point), {}, (), None, np.random.default_rng(0))
        except InputError as error:
            raise RefusalError(f"the model {NAME!r} cannot be set to this rig: {error}") from None
        return twin
