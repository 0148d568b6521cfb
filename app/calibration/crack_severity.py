"""Make the calibration of crack severity: `python -m app.calibration.crack_severity [--cases N] [--to FILE]`.

Draws and simulates gearboxes one after the other (some 1.5 s each on one core), fits the two models, and writes the
JSON file that the library reads. Three fifths of the cases are fitted; the rest makes the intervals.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.calibration import rigs
from app.calibration.cases import Observed, draw_case, observe
from app.calibration.fit import FALSE_ALARMS, Cases, fit_model
from gearsig.errors import RefusalError
from gearsig.severity.calibration import ALONE, FILE, WITH_REFERENCE
from gearsig.severity.features import FEATURES
from gearsig.severity.model import DepthModel

SEED = 2611
N_CASES = 520
FIRST_EVEN = 420
"""Cases from here on have teeth that hardly differ."""

HELD_OUT = (3, 4)
"""Cases whose index leaves one of these, divided by 5, are not fitted but make the intervals."""

_DIGITS = 7


def main() -> None:
    """Simulate, fit, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=N_CASES)
    parser.add_argument("--to", type=Path, default=FILE)
    parser.add_argument("--state", default="", help="the simulator's commit, for the provenance")
    given = parser.parse_args()
    observed = observe_all(range(given.cases))
    text = json.dumps(calibration_of(observed, given.cases, given.state), indent=1)
    given.to.write_text(text + "\n", encoding="utf-8")
    typer.echo(f"{len(observed)} of {given.cases} cases; written to {given.to}")


def observe_all(indices: Sequence[int]) -> list[tuple[int, Observed]]:
    """Return what the drawn cases show, by their index; some cannot be made, or show too few mesh harmonics."""
    found = []
    for index in indices:
        case = draw_case(SEED, index, for_the_check=False, even=index >= FIRST_EVEN)
        if case is not None:
            try:
                found.append((index, observe(case)))
            except RefusalError as refusal:
                typer.echo(f"case {index}: {refusal}")
        if index % 25 == 24:
            typer.echo(f"{index + 1} cases drawn")
    return found


def calibration_of(observed: Sequence[tuple[int, Observed]], n_drawn: int, simulator_state: str) -> dict[str, Any]:
    """Return the calibration as JSON-like values."""
    models = {name: fit_model(cases_of(observed, name)) for name in ("with_reference", "alone")}
    return {
        "features": list(FEATURES),
        "lag_pitches": round(_median_lag(observed, models[WITH_REFERENCE]), 3),
        "reach": _reach([o for _, o in observed]),
        "models": {WITH_REFERENCE: _plain(models["with_reference"]), ALONE: _plain(models["alone"])},
        "provenance": _provenance(observed, n_drawn, simulator_state),
    }


def cases_of(observed: Sequence[tuple[int, Observed]], kind: str) -> Cases:
    """Return the cases of one model; sound gears by themselves are in each reference, too."""
    cracked = [(i, o) for i, o in observed if o.percent > 0]
    sound = [getattr(o, kind) for _, o in observed if o.percent == 0]
    if kind == "alone":
        sound += [o.sound for _, o in observed]
    return Cases(
        np.array([getattr(o, kind)[o.gear] for _, o in cracked]),
        np.array([o.percent for _, o in cracked]),
        np.array([o.drawn.depth_mm for _, o in cracked]),
        np.array(sound),
        np.array([i % 5 in HELD_OUT for i, _ in cracked]),
    )


def _median_lag(observed: Sequence[tuple[int, Observed]], model: DepthModel) -> float:
    seen = [
        o.lag_pitches
        for _, o in observed
        if o.percent > 0 and model.score(o.with_reference[o.gear]) >= model.threshold and np.isfinite(o.lag_pitches)
    ]
    return float(np.median(seen))


def _reach(observed: Sequence[Observed]) -> dict[str, list[float]]:
    return {
        name: [float(f"{min(values):.4g}"), float(f"{max(values):.4g}")]
        for name in observed[0].reach
        if (values := [o.reach[name] for o in observed])
    }


def _plain(model: DepthModel) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for name, value in vars(model).items():
        array = np.asarray(value, dtype=np.float64)
        rounded = np.vectorize(lambda v: float(f"{v:.{_DIGITS}g}"))(array)
        values[name] = rounded.tolist()
    return values


def _provenance(observed: Sequence[tuple[int, Observed]], n_drawn: int, simulator_state: str) -> dict[str, Any]:
    from importlib.metadata import version

    cracked = [o for _, o in observed if o.percent > 0]
    return {
        "made_by": "python -m app.calibration.crack_severity",
        "version": version("gearsig"),
        "simulator": "sims.cracked: spur gear pair, 16 degrees of freedom",
        "simulator_state": simulator_state,
        "seed": SEED,
        "n_drawn": n_drawn,
        "n_used": len(observed),
        "n_cracked": len(cracked),
        "first_even": FIRST_EVEN,
        "held_out_remainders_of_5": list(HELD_OUT),
        "false_alarms": FALSE_ALARMS,
        "depths_mm": list(rigs.DEPTHS_MM),
        "modules_mm": list(rigs.CALIBRATION_MODULES_MM),
        "crack": "straight, 45 degrees, through the whole face width",
        "teeth": "18 to 100, no pair whose teeth add up to a multiple of three",
        "least_revolutions": rigs.LEAST_REVOLUTIONS,
    }


if __name__ == "__main__":
    main()
