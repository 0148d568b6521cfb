"""Where theory expects what is switched on: lines of the spectra, and the moments a faulty tooth enters the mesh."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from app.dashboard.laboratory.run import Run, times_of
from app.dashboard.laboratory.setup import Setup
from gearsig.plot.cursors import Cursor, order_cursors
from gearsig.rig.orders import order_lines
from sims.effects import completed, effect

N_MESH_HARMONICS, N_SIDEBANDS, N_BEARING_HARMONICS, N_SHAFT_HARMONICS = 5, 3, 4, 8
SIDES = ("driver", "driven")


def affected_sides(setup: Setup) -> tuple[str, ...]:
    """Sides whose shaft modulates the mesh: those of the effects; both, where none says so."""
    named = {str(s.options.get("gear") or s.options.get("shaft") or "") for s in setup.effects}
    return tuple(side for side in SIDES if side in named) or SIDES


def spectrum_cursors(run: Run) -> tuple[Cursor, ...]:
    """Return mesh harmonics, sidebands of the shafts concerned, and shaft lines, in Hz."""
    rig, setup = run.rig, run.setup
    shafts = dict(zip(SIDES, run.machine.shaft_names, strict=True))
    concerned = {shafts[side] for side in affected_sides(setup)}
    lines = order_lines(rig, n_mesh_harmonics=N_MESH_HARMONICS, n_sidebands=N_SIDEBANDS)
    kept = [
        line
        for line in lines
        if line.kind in ("mesh", "shaft") or (line.kind == "sideband" and line.modulating_shaft in concerned)
    ]
    return (*order_cursors(kept, setup.revolutions_per_s), *_hum_cursors(setup))


def _hum_cursors(setup: Setup) -> tuple[Cursor, ...]:
    hum = next((s for s in setup.effects if s.name == "mains_hum"), None)
    if hum is None:
        return ()
    mains = float(hum.options["frequency_hz"])
    return tuple(Cursor(k * mains, "finding", f"{k}× mains" if k > 1 else "mains", k) for k in (1, 2, 3))


def envelope_cursors(run: Run) -> tuple[Cursor, ...]:
    """Return the lines of shafts concerned, and harmonics of the lines of bearings with a defect, in Hz."""
    concerned = {run.machine.shaft_names[SIDES.index(side)] for side in affected_sides(run.setup)}
    lines = order_lines(run.rig, n_shaft_harmonics=N_SHAFT_HARMONICS, n_sidebands=0)
    shaft_lines = [line for line in lines if line.kind == "shaft" and line.element in concerned]
    cursors = [*order_cursors(shaft_lines, run.setup.revolutions_per_s)]
    for name, frequency in bearing_lines_hz(run).items():
        cursors += [
            Cursor(k * frequency, "bearing", name if k == 1 else f"{k}× {name}", k)
            for k in range(1, N_BEARING_HARMONICS + 1)
        ]
    return tuple(cursors)


def shaft_lines_hz(run: Run) -> list[float]:
    """Return the first orders of the shafts concerned, in Hz."""
    shafts = dict(zip(SIDES, run.machine.shaft_names, strict=True))
    turns = [(run.rig.ratio(shafts[side]) or 0.0) * run.setup.revolutions_per_s for side in affected_sides(run.setup)]
    return [k * f for f in turns if f > 0 for k in range(1, N_BEARING_HARMONICS + 1)]


def bearing_lines_hz(run: Run) -> dict[str, float]:
    """Return the frequencies at which rolling elements strike defects, less slip: name → Hz."""
    found = {}
    for support in run.machine.bearings:
        if support.defect is None:
            continue
        name = {"outer": "BPFO", "inner": "BPFI"}[support.defect.race]
        orders, turns = support.bearing.orders(), run.rig.ratio(support.bearing.shaft) or 1.0
        # A cage that slips falls behind: fewer elements pass the standing race, and as many more the turning one.
        slip = support.defect.slip * orders["BPFO"]
        order = orders[name] + (slip if name == "BPFI" else -slip)
        found[f"{name} {support.bearing.name}"] = order * turns * run.setup.revolutions_per_s
    return found


def faulty_teeth(setup: Setup) -> tuple[tuple[str, int], ...]:
    """Return (side, tooth from 1) of the effects that concern one tooth; tooth k of the driver enters at k - 1."""
    local = [s for s in setup.effects if effect(s.name).group == "tooth-local" and s.severity > 0]
    return tuple(dict.fromkeys((str(s.options["gear"]), round(float(s.options["tooth"]))) for s in local))


def entries(run: Run) -> tuple[Cursor, ...]:
    """Return the times at which faulty teeth enter the mesh, in s."""
    pair, cycles = run.machine.mesh.pair, run.mesh_cycles
    found = []
    for side, tooth in faulty_teeth(run.setup):
        n_teeth = pair.driver.teeth if side == "driver" else pair.driven.teeth
        first = np.ceil((cycles[0] - (tooth - 1)) / n_teeth) * n_teeth + tooth - 1
        times = times_of(run, cycles, np.arange(first, cycles[-1], n_teeth))
        found += [Cursor(float(t), "finding", f"{side} tooth {tooth} enters", i) for i, t in enumerate(times)]
    return tuple(found)


def with_complete_effects(setup: Setup) -> Setup:
    """Return the setup with every option of its effects that has a default."""
    return replace(setup, effects=completed(setup.effects))
