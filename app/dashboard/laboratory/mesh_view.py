"""Mesh stiffness and mesh force over mesh cycles, where the faulty tooth passes."""

from __future__ import annotations

import numpy as np
import streamlit as st

from app.dashboard.laboratory.expected import faulty_teeth
from app.dashboard.laboratory.run import Run
from app.dashboard.widgets.line_chart import Axes, Line, show_lines
from gearsig.checks import FloatArray
from gearsig.plot.cursors import Cursor
from gearsig.plot.thin import thin

BEFORE, AFTER = 1.5, 5.5
POINTS_PER_CYCLE = 250
HEIGHT_PX = 300


def show_mesh(healthy: Run, faulty: Run | None) -> None:
    """Show stiffness and dynamic force of both machines over the same mesh cycles."""
    runs = [healthy] if faulty is None else [healthy, faulty]
    shown, marks = _stretch(runs[-1])
    cycles = np.linspace(*shown, round((shown[1] - shown[0]) * POINTS_PER_CYCLE) + 1)
    x = "mesh cycles (tooth k of the driver enters at k − 1)"
    st.markdown("**Mesh stiffness** of the tooth pairs in contact")
    if runs[0].setup.torque_nm > 0:
        curves = [stiffness(run, cycles) * 1e-8 for run in runs]
        axes = Axes(x, "mesh stiffness (10⁸ N/m)", shown, _limits(curves))
        show_lines(_lines(cycles, curves), axes, "stiffness of the laboratory", cursors=marks, height_px=HEIGHT_PX)
        if len(curves) > 1 and np.allclose(curves[0], curves[1], rtol=1e-6):
            st.caption("What is switched on leaves the stiffness as it is.")
    else:
        st.info("Without a load no tooth is pressed on another: there is no stiffness to show.")
    st.markdown("**Dynamic mesh force** over the same teeth")
    forces = [_force_kn(run, cycles) for run in runs]
    axes = Axes(x, "mesh force (kN)", shown, _limits([f for f in forces if np.isfinite(f).any()]))
    show_lines(_lines(cycles, forces), axes, "force of the laboratory", cursors=marks, height_px=HEIGHT_PX)


def stiffness(run: Run, cycles: FloatArray) -> FloatArray:
    """Tangent stiffness at the static mesh force, N/m."""
    from sims.mesh import mesh_stiffness

    if run.pair is not None:
        return run.pair.maps(np.array([run.setup.torque_nm]), cycles).tangent_stiffness_n_per_m[:, 0]
    mesh = run.machine.mesh
    force_n = run.setup.torque_nm / (mesh.pair.driver.base_radius_mm * 1e-3)
    return mesh_stiffness(mesh, cycles, force_n).total_n_per_m


def _stretch(run: Run) -> tuple[tuple[float, float], list[Cursor]]:
    """Return the mesh cycles about the first faulty tooth that passes in the run; without one, the run's first."""
    teeth, cycles = faulty_teeth(run.setup), run.mesh_cycles
    pair = run.machine.mesh.pair
    first = float(np.ceil(cycles[0])) + BEFORE
    if not teeth:
        return (first - BEFORE, first + AFTER), []
    side, tooth = teeth[0]
    n_teeth = pair.driver.teeth if side == "driver" else pair.driven.teeth
    enters = tooth - 1 + float(np.ceil((first - tooth + 1) / n_teeth)) * n_teeth
    return (enters - BEFORE, enters + AFTER), [Cursor(enters, "finding", f"{side} tooth {tooth} enters")]


def _force_kn(run: Run, cycles: FloatArray) -> FloatArray:
    force: FloatArray = np.interp(
        cycles, run.mesh_cycles, 1e-3 * run.response["mesh_force_n"], left=np.nan, right=np.nan
    )
    return force


def _lines(x: FloatArray, curves: list[FloatArray]) -> list[Line]:
    """The faulty line lies above: where both coincide, nothing changed."""
    lines = []
    for place, values in enumerate(curves):
        known = np.isfinite(values)
        if known.any():
            name, colour = (("healthy", "measured"), ("faulty", "fault"))[place]
            lines.append(Line(*thin(x[known], values[known]), name, colour=colour))  # type: ignore[arg-type]
    return lines


def _limits(curves: list[FloatArray]) -> tuple[float, float]:
    low = min((float(np.nanmin(c)) for c in curves), default=0.0)
    high = max((float(np.nanmax(c)) for c in curves), default=1.0)
    margin = 0.06 * (high - low) or 0.1
    return low - margin, high + margin
