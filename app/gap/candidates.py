"""The likeliest effects, simulated on the rig's twin and fitted to what was observed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.gap.bank import Bank, banks_of
from app.gap.bank_runs import Run
from app.gap.conditions import LEAST_BLOCKS, SEED, Condition, compare, halves, observed
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap.families import UNFORETOLD
from gearsig.gap.features import once as feature_values
from gearsig.gap.population import load_population
from gearsig.gap.prediction import EffectPath, Fit, Observed, fit_effect, paths_of
from gearsig.gap.shrinkage import Fold, shrinkage
from gearsig.gap.simulator import Twin
from gearsig.gap.transplant import transplanted
from gearsig.gap.types import Shrinkage
from gearsig.gap.which_shaft import told_options

PROCESSES = 2
OTHER_POINT, OTHER_REVOLUTIONS = "another operating condition", "other revolutions of the same recordings"
SAME_REVOLUTIONS = "the same revolutions, as there are too few to hold some out"


@dataclass(frozen=True)
class Tried:
    """One effect as it was tried.

    Parameters
    ----------
    name : str
    paths : tuple of EffectPath
    fit : Fit
        To all conditions; on the shaft that the recordings tell by themselves, where they do.
    shrinkage : Shrinkage
        On held-out data.
    """

    name: str
    paths: tuple[EffectPath, ...]
    fit: Fit
    shrinkage: Shrinkage


def try_effects(
    names: Sequence[str],
    twin: Twin,
    conditions: Sequence[Condition],
    cache: Path | None,
    on_progress: Callable[[str, float], object],
    *,
    fresh: bool = False,
) -> dict[str, Tried]:
    """Simulate each effect at every condition, fit it, and score it on data that it was not fitted to.

    Effects that the rig cannot have, for it lacks a bearing, say, are left out.
    """
    if not names:
        return {}
    folds, held_out = folds_of(conditions)
    where = " and ".join(c.facts.name for c in conditions)
    banks = banks_of(
        [_run(twin, condition) for condition in conditions],
        names,
        seeds=[SEED],
        folder=cache,
        processes=PROCESSES,
        fresh=fresh,
        on_progress=lambda done, of: on_progress(f"simulating {len(names)} effects at the point of {where}", done / of),
    )
    everything = [observed(c, k, n_compared(conditions)) for k, c in enumerate(conditions)]
    changes = [condition.over_floors for condition in conditions]
    found = {}
    for name in names:
        paths = _paths([at[name] for at in banks], conditions)
        if paths:
            fit = fit_effect(on_shaft(paths, told_options(name, changes, conditions[0].now.frame.teeth)), everything)
            found[name] = Tried(name, paths, fit, shrinkage(paths, folds, held_out))
    return found


def on_shaft(paths: Sequence[EffectPath], told: Mapping[str, str]) -> Sequence[EffectPath]:
    """Return the paths on the shaft that the recordings tell by themselves; all where they do not."""
    return [path for path in paths if told.items() <= path.options.items()] or paths


def n_compared(conditions: Sequence[Condition]) -> int:
    """Return how many features all conditions have and a simulation can foretell; those of patterns need references."""
    return min(sum(not name.startswith(UNFORETOLD) for name in c.change.names) for c in conditions)


def _run(twin: Twin, condition: Condition) -> Run:
    return Run(twin, condition.facts.point, float(f"{condition.run_s:.3g}"), condition.facts.sampling_rate_hz, noise=1)


def _paths(banks: Sequence[Bank], conditions: Sequence[Condition]) -> tuple[EffectPath, ...]:
    """Return an effect's paths over the candidates that could be simulated at every condition."""
    n = n_compared(conditions)
    kept = [a for a in banks[0].added if all(a in bank.added for bank in banks)]
    tables = [
        np.array([_distances(bank, bank.added.index(a), condition)[:n] for a in kept]).reshape(len(kept), n)
        for bank, condition in zip(banks, conditions, strict=True)
    ]
    return paths_of(banks[0].change_names[:n], kept, tables)


def _distances(bank: Bank, row: int, condition: Condition) -> FloatArray:
    """Return what a candidate would change: on the sound machine's own baseline, where a reference shows it."""
    n = len(bank.feature_names)
    change: FloatArray = bank.changes[row].mean(axis=0)
    change[:n] -= bank.sound_changes.mean(axis=0)[:n]  # a mere second run changes something, too
    if condition.reference is None:
        alone: FloatArray = change[:n]
        return alone
    floor = load_population().reference_floor
    centres = -floor.from_centre(floor.names, np.zeros(len(floor.names)))
    usual = dict(zip(floor.names, centres.tolist(), strict=True))
    simulated = dict(zip(bank.feature_names, bank.sound.mean(axis=0).tolist(), strict=True))
    real = dict(zip(*feature_values(condition.reference), strict=True))
    return transplanted(bank.change_names, change, simulated, real, usual)


def folds_of(conditions: Sequence[Condition]) -> tuple[list[Fold], str]:
    """Return what to fit to and what to score on: each condition in turn, or both halves of the only one."""
    n = n_compared(conditions)
    if len(conditions) > 1:
        all_of_them = [observed(c, k, n) for k, c in enumerate(conditions)]
        return [
            Fold(
                tuple(o for o in all_of_them if o is not one), one, _again(conditions[one.condition], one.condition, n)
            )
            for one in all_of_them
        ], OTHER_POINT
    only = conditions[0]
    if only.now.n_blocks < LEAST_BLOCKS:
        whole = observed(only, 0, n)
        return [Fold((whole,), whole, _again(only, 0, n))], SAME_REVOLUTIONS
    parts = halves(only.now)
    changes = [compare(part, only.simulated, only.reference) for part in parts]
    first, second = (observed(only, 0, n, change) for change in changes)
    again = _again(only, 0, n)
    return [Fold((first,), second, again), Fold((second,), first, again)], OTHER_REVOLUTIONS


def _again(condition: Condition, index: int, n: int) -> tuple[tuple[Observed, ...], ...]:
    """Return the condition with each block left out: blocks of the recording, then of what it is compared with."""
    base, values = observed(condition, index, n), condition.change.values[:n]
    return tuple(
        tuple(replace(base, distances=base.distances + row[:n] - values) for row in rows)
        for rows in condition.change.left_out
    )


def refuse_without_candidates(tried: dict[str, Tried], names: Sequence[str]) -> None:
    """Refuse where none of the effects could be simulated."""
    if names and not tried:
        raise RefusalError(
            f"none of {', '.join(names)} can be simulated on this rig", remedy="describe the rig more fully"
        )
