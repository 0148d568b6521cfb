"""Make the calibration of crack severity: `python -m app.calibration.crack_severity [--cases N] [--to FILE]`.

Draws and simulates gearboxes (some 2.5 s each on one core), each with its crack, sound, and with a chip or spall; fits
the models, and writes the JSON file that the library reads. Errors on cases that were left out of a fit make the
intervals.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.calibration import rigs
from app.calibration.cases import (
    CHIP_HEIGHT_MODULES,
    OTHER_FLANKS_SHARE,
    RELIEF_ERROR,
    SPALL_LENGTH_MODULES,
    SPALL_WIDTH_PERCENT,
    SPEED_DIFFERENCE,
    TORQUE_DIFFERENCE,
    Observed,
    draw_case,
    draw_other_fault,
    observe,
)
from app.calibration.fit import FALSE_ALARMS, Cases, fit_model
from app.calibration.fit_kind import fit_kind
from gearsig.errors import RefusalError
from gearsig.severity.calibration import ALONE, FILE, RELIEF_KNOWN, WITH_REFERENCE
from gearsig.severity.features import FEATURES
from gearsig.severity.kind import CRACKED, KindModel, kind_vector
from gearsig.severity.model import DepthModel
from gearsig.severity.shape import SHAPE

SEED = 2611
N_CASES = 540
EVEN_EVERY = 6
"""The last of so many cases has teeth that hardly differ."""

BATCH = 20
_DIGITS = 7


def main() -> None:
    """Simulate, fit, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=N_CASES)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--to", type=Path, default=FILE)
    parser.add_argument("--state", default="", help="the simulator's commit, for the provenance")
    given = parser.parse_args()
    observed = observe_all(given.cases, given.processes)
    text = json.dumps(calibration_of(observed, given.cases, given.state), indent=1)
    given.to.write_text(text + "\n", encoding="utf-8")
    typer.echo(f"{len(observed)} of {given.cases} cases; written to {given.to}")


def observe_all(n_cases: int, n_processes: int) -> list[tuple[int, Observed]]:
    """Return what the drawn cases show, by their index; some cannot be made, or show too few mesh harmonics."""
    found: list[tuple[int, Observed]] = []
    with ProcessPoolExecutor(n_processes) as pool:
        for first in range(0, n_cases, BATCH):
            indices = range(first, min(first + BATCH, n_cases))
            answers = zip(indices, pool.map(observe_one, indices), strict=True)
            found += [(index, answer) for index, answer in answers if isinstance(answer, Observed)]
            typer.echo(f"{indices.stop} of {n_cases} cases drawn")
    return found


def observe_one(index: int) -> Observed | str:
    """Return what one case shows, or why it shows nothing."""
    case = draw_case(SEED, index, for_the_check=False, even=index % EVEN_EVERY == EVEN_EVERY - 1)
    if case is None:
        return ""
    rng = np.random.default_rng([SEED, index, 0, 1])
    relief_error = float(rng.uniform(-RELIEF_ERROR, RELIEF_ERROR))
    try:
        return observe(case, draw_other_fault(case.drawn, rng), relief_error)
    except RefusalError as refusal:
        return str(refusal)


def calibration_of(observed: Sequence[tuple[int, Observed]], n_drawn: int, simulator_state: str) -> dict[str, Any]:
    """Return the calibration as JSON-like values."""
    models = {
        name + ending: fit_model(cases_of(observed, name), relief_known=bool(ending))
        for name in (WITH_REFERENCE, ALONE)
        for ending in ("", RELIEF_KNOWN)
    }
    return {
        "features": list(FEATURES),
        "shape": list(SHAPE),
        "lag_pitches": round(_median_lag(observed, models[WITH_REFERENCE]), 3),
        "reach": _reach([o for _, o in observed]),
        "models": {name: _plain(model) for name, model in models.items()},
        "kinds": {name: _plain(kind_of(observed, name, models[name])) for name in (WITH_REFERENCE, ALONE)},
        "provenance": _provenance(observed, n_drawn, simulator_state),
    }


def cases_of(observed: Sequence[tuple[int, Observed]], kind: str) -> Cases:
    """Return the cases of one model; each machine is there sound, too."""
    cracked = [(i, o) for i, o in observed if o.percent > 0]
    sound = [o.sound if kind == ALONE else o.sound_with_reference for _, o in observed]
    return Cases(
        np.array([getattr(o, kind)[o.gear] for _, o in cracked]),
        np.array([o.percent for _, o in cracked]),
        np.array([o.drawn.depth_mm for _, o in cracked]),
        np.array(sound),
    )


def kind_of(observed: Sequence[tuple[int, Observed]], way: str, model: DepthModel) -> KindModel:
    """Return the model of the kind, from the events that are seen."""
    seen = [
        (kind, kind_vector(looks.features, looks.shape))
        for _, o in observed
        for (kind, name), looks in o.looks.items()
        if name == way and (kind != CRACKED or o.percent > 0) and model.score(looks.features) >= model.threshold
    ]
    return fit_kind(np.array([vector for _, vector in seen]), [kind for kind, _ in seen])


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


def _plain(model: DepthModel | KindModel) -> dict[str, Any]:
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
        "even_every": EVEN_EVERY,
        "false_alarms": FALSE_ALARMS,
        "depths_mm": list(rigs.DEPTHS_MM),
        "modules_mm": list(rigs.CALIBRATION_MODULES_MM),
        "speed_difference": SPEED_DIFFERENCE,
        "torque_difference": TORQUE_DIFFERENCE,
        "other_flanks_share": OTHER_FLANKS_SHARE,
        "tip_relief_error": RELIEF_ERROR,
        "chip_height_modules": list(CHIP_HEIGHT_MODULES),
        "spall_width_percent": list(SPALL_WIDTH_PERCENT),
        "spall_length_modules": list(SPALL_LENGTH_MODULES),
        "crack": "straight, 45 degrees, through the whole face width",
        "teeth": "18 to 100, no pair whose teeth add up to a multiple of three",
        "least_revolutions": rigs.LEAST_REVOLUTIONS,
    }


if __name__ == "__main__":
    main()
