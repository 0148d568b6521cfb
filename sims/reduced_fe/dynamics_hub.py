"""The elastic connection between a gear's body and its hub, where shaft, bearings and hub inertia hold it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray, positive
from sims.mesh.pair import PairGeometry
from sims.reduced_fe.contact_path import over_height, rolls_rad
from sims.reduced_fe.contact_table import FLANK, SIGNS, ContactTable
from sims.reduced_fe.reduced_gear import ReducedGear

PLANE = (0, 1, 5)
"""Of the hub's six motions those in the gear's plane: along x, along y, about z."""


@dataclass(frozen=True)
class HubSprings:
    """What is left of the elastic motion between body, hub and flanks beside the kept modes, in the frame of the gear.

    A force F on the hub and pushes N move the hub by H F + Sᵀ N against the body and its modes. With the hub's place
    given instead, F = (u_hub − u_body − ψᵀq − SᵀN)/H: springs 1/H, by which the flanks move with S/H and are stiffer by
    S Sᵀ/H. By symmetry H is diagonal, and alike along x and y.

    Parameters
    ----------
    compliance : array, (3,)
        H along x, along y (m/N) and about z (rad/(N m)).
    flank : array, (3, n_points)
        S: motion of the hub for a unit push at tooth 0.
    """

    compliance: FloatArray
    flank: FloatArray

    @classmethod
    def of(cls, gear: ReducedGear, kept: NDArray[np.int64]) -> HubSprings:
        """Return those of a gear beside the kept modes, of which none may move the hub along x or y."""
        hub = gear.hub_modes[kept][:, PLANE]
        soft = hub / gear.angular_frequencies_rad_s[kept, None] ** 2
        own = np.diag(gear.hub_compliance)[list(PLANE)] - np.sum(soft * hub, axis=0)
        for value in own:
            positive(float(value), "compliance between hub and body", remedy="lower mode_limit_hz")
        return cls(own, gear.hub_flank_compliance[list(PLANE)] - soft.T @ gear.flank_modes[kept])

    def seen_from_the_line_of_action(
        self, gear: ReducedGear, pair: PairGeometry, index: int, progress: FloatArray
    ) -> FloatArray:
        """S over ζ in the frame of the shafts, (n, n_slices, 3): along x, along the line of action, in its own sense.

        The push points into the tooth: against y for the driver, along y for the driven gear.
        """
        tau = gear.grid.roll_rad
        load = tau - gear.blank.geometry.base_half_angle_rad
        up = float(SIGNS[index])
        y = np.array([-np.sin(load), -np.cos(load)]) * up
        x = np.array([y[1], -y[0]])
        at = self.flank.reshape(3, *gear.grid.shape)[:, FLANK]
        axes = [np.einsum("ch,chs->hs", axis, at[:2]) for axis in (x, y)]
        turned = np.stack([*axes, -up * at[2]], axis=-1)
        return over_height(tau, turned, rolls_rad(pair, progress)[index])


def without_hub(
    table: ContactTable, pair: PairGeometry, gears: tuple[ReducedGear, ReducedGear], hubs: tuple[HubSprings, HubSprings]
) -> ContactTable:
    """Return the table with the hubs' places given: less what flanks move by the springs of their hubs."""
    own, cross = table.own.copy(), table.cross.copy()
    for index, (gear, hub) in enumerate(zip(gears, hubs, strict=True)):
        here = hub.seen_from_the_line_of_action(gear, pair, index, table.progress)
        own -= np.einsum("nsc,ntc,c->nst", here, here, 1.0 / hub.compliance)
        for o in range(len(cross)):
            older = hub.seen_from_the_line_of_action(gear, pair, index, table.progress + o + 1.0)
            cross[o] -= np.einsum("nsc,ntc,c->nst", here, older, 1.0 / hub.compliance)
    return replace(table, own=own, cross=cross)
