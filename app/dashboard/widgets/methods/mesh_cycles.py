"""How much of a waveform is drawn at first: a few mesh cycles, in which its shape is seen."""

from __future__ import annotations

from app.dashboard.widgets.methods.stretch import Stretch
from gearsig.diagnosis.types import Analysis

N_CYCLES = 5.0
"""Of the mesh, or of whatever else is looked at."""
N_REVOLUTIONS = 3.0
"""Of the reference shaft, where no mesh is known or an envelope is drawn."""


def length_shown(analysis: Analysis, stretch: Stretch, *, over_angle: bool, of_mesh: bool = True) -> float | None:
    """Return the length of a waveform's first view in s, or in revolutions; None where the speed is not known."""
    if stretch.angle is None:
        return None
    revolutions = N_REVOLUTIONS
    if of_mesh and analysis.rig is not None and analysis.rig.shafts:
        orders = [analysis.rig.mesh_order(pair, stretch.angle.shaft) for pair in analysis.rig.pairs]
        revolutions = next((N_CYCLES / order for order in orders if order), N_REVOLUTIONS)
    return revolutions if over_angle else revolutions * 60.0 / max(stretch.angle.mean_speed_rpm, 1e-9)
