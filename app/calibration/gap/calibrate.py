"""Calibrate the gap's probabilities on blind cases: `python -m app.calibration.gap.calibrate --cases N --work FILE`.

Cases of the role "calibration" differ in gear geometry from those that the benchmark judges by. Each is weighed twice:
as the shipped population has it, which knows the independent rig's development gears, and without any machine of that
rig, since a user's machine may be as strange to all simulators as it is to the others then. What a case says is
kept in the work file, a line each, so that a stopped run goes on. The forests are asked about every case, which takes
some seconds; effects are tried on the twin for the first `--tried` cases only, a minute each. From what probability on
an effect is named hangs on the few cases from outside the catalogue: `--strange` further ones tell that alone.
"""

from __future__ import annotations

import argparse
import json
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import typer

from app.calibration.gap.fit import WeighedCase, fit_calibration
from app.gap.weigh import MOST_TRIED
from gearsig.errors import GearsigError
from gearsig.gap.population import INDEPENDENT, without_machines_of
from gearsig.gap.posterior import FILE
from gearsig.gap.types import NONE, UNKNOWN

SEED = 9202
LEAST_LEVEL = 0.4
"""Of effects' severities, 0 to 1: nothing can be learned from those that nobody could see."""
ROUND = 27
"""Cases of a round: each effect once, four healthy ones, four from outside the catalogue."""
FIRST_STRANGE = 10_000
"""Number of the first of the cases from outside the catalogue that only tell from what probability on to name."""


def main() -> None:
    """Make cases, weigh them, fit, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=216)
    parser.add_argument("--strange", type=int, default=64)
    parser.add_argument("--tried", type=int, default=27)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--work", type=Path, required=True, help="keeps what the cases say")
    parser.add_argument("--to", type=Path, default=FILE)
    given = parser.parse_args()
    done = _read(given.work)
    wanted = [*range(given.cases), *range(FIRST_STRANGE, FIRST_STRANGE + given.strange)]
    missing = [i for i in wanted if i not in done]
    with given.work.open("a", encoding="utf-8") as file, ProcessPoolExecutor(given.processes) as pool:
        weighed = pool.map(weigh_case, missing, [MOST_TRIED if i < given.tried else 0 for i in missing])
        for i, rows in zip(missing, weighed, strict=True):
            file.write(json.dumps({"case": i, "rows": rows}) + "\n")
            file.flush()
            typer.echo(f"case {i}: {', '.join(rows[0]['truths']) if rows else 'refused'}")
    kept = {i: found for i, found in _read(given.work).items() if i in wanted}
    values: dict[str, Any] = {
        name: fit_calibration(*(_cases(kept, flag, strange=strange) for strange in (False, True))).to_mapping()
        for name, flag in (("with_reference", True), ("without_reference", False))
    }
    values["provenance"] = {
        "made_by": "python -m app.calibration.gap.calibrate",
        "seed": SEED,
        "n_cases": len(kept),
    }
    given.to.write_text(json.dumps(values, indent=1) + "\n", encoding="utf-8")
    typer.echo(json.dumps(values, indent=1))


def weigh_case(index: int, most_tried: int) -> list[dict[str, Any]]:
    """Return what is said of a blind case with its reference and without, and the truth; less where it is refused.

    Each by all that is known, and by what is known without the machines of the rig that made the case.
    """
    from app.gap.conditions import compare
    from app.gap.prepare import conditions_of
    from app.gap.weigh import weigh
    from sims.blind import CATALOGUE, draw_case, record_case
    from sims.registry import gap_simulator

    rng = np.random.default_rng([SEED, index])
    place, names = index % ROUND, list(CATALOGUE)
    kind = "single" if place < len(names) else "none" if place < len(names) + 4 else "unknown"
    if index >= FIRST_STRANGE:
        kind = "unknown"
    wanted = {"effect": names[place], "level": float(rng.uniform(LEAST_LEVEL, 1.0))} if kind == "single" else {}
    case = draw_case(rng, "calibration", kind=kind, with_reference=True, **wanted)  # type: ignore[arg-type]  # as drawn
    truths = [wanted["effect"]] if wanted else [NONE if kind == "none" else UNKNOWN]
    recorded = record_case(case)
    rigs = [_rig(r) for r in recorded.conditions]
    simulator = gap_simulator("cracked")
    rows = []
    for references in (recorded.references, ()):
        try:
            twin = simulator.twin_of(rigs[0])
            conditions, _ = conditions_of(
                recorded.conditions, rigs, references, [_rig(r) for r in references], twin, (), lambda *_: None
            )
            for left_out in ("", INDEPENDENT):
                with without_machines_of(left_out):
                    known = [replace(c, change=compare(c.now, c.simulated, c.reference)) for c in conditions]
                    weighed = weigh(
                        known, simulator.gap_effects(), (), twin, None, lambda *_: None, most_tried=most_tried
                    )
                rows.append(
                    {
                        "truths": truths,
                        "level": wanted.get("level"),
                        "left_out": left_out,
                        "with_reference": weighed.with_reference,
                        "size": weighed.size,
                        "forest": dict(weighed.forest),
                        "scores": weighed.scores,
                    }
                )
        except GearsigError as error:
            typer.echo(f"case {index}: {error}")
    return rows


def _rig(recording: Any) -> Any:
    return recording.rig


def _read(path: Path) -> dict[int, list[dict[str, Any]]]:
    if not path.exists():
        return {}
    lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return {line["case"]: line["rows"] for line in lines}


def _cases(kept: dict[int, list[dict[str, Any]]], with_reference: bool, *, strange: bool) -> list[WeighedCase]:
    rows = [row for i, found in kept.items() if (i >= FIRST_STRANGE) == strange for row in found]
    return [
        WeighedCase(tuple(row["truths"]), row["forest"], row["scores"], row["size"])
        for row in rows
        if row["with_reference"] == with_reference
    ]


if __name__ == "__main__":
    main()
