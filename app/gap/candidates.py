"""The likeliest effects, simulated on the rig's twin and fitted to what was observed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.gap.bank import Bank, banks_of
from app.gap.bank_runs import Run
from app.gap.conditions import SEED, Condition, compare, halves, observed
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap.families import UNFORETOLD, shown_in
from gearsig.gap.features import whole_and_parts
from gearsig.gap.population import load_population
from gearsig.gap.prediction import WAYS_DB, EffectPath, Fit, Observed, fit_effect, paths_of
from gearsig.gap.shrinkage import Fold, shrinkage
from gearsig.gap.simulator import Added, CanBeQuiet, GapEffect, Twin
from gearsig.gap.transplant import transplanted
from gearsig.gap.types import Shrinkage
from gearsig.gap.which_shaft import told_options

PROCESSES = 2
HELD_OUT = "other revolutions of the same recordings"


@dataclass(frozen=True)
class Tried:
    """One effect as it was tried.

    Parameters
    ----------
    name : str
    paths : tuple of EffectPath
        On the shaft that the recordings tell by themselves, where they do.
    fit : Fit
        To all conditions.
    shrinkage : Shrinkage
        On held-out data.
    """

    name: str
    paths: tuple[EffectPath, ...]
    fit: Fit
    shrinkage: Shrinkage

    @property
    def explains(self) -> bool:
        """Whether the twin shows the effect and comes nearer with it: else severity and place mean nothing."""
        return self.shrinkage.is_foretold and self.shrinkage.shrink.value > 0.0


def try_effects(
    effects: Sequence[GapEffect],
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
    if not effects:
        return {}
    names = [effect.name for effect in effects]
    folds = folds_of(conditions)
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
    for effect in effects:
        name = effect.name
        every = _paths([at[name] for at in banks], conditions, effect.shows_in)
        if every:
            paths, excluded = on_shaft(every, told_options(name, changes, conditions[0].now.frame.teeth))
            shrink = shrinkage(paths, folds, HELD_OUT, excluded)
            found[name] = Tried(name, paths, fit_effect(paths, everything), shrink)
    return found


def on_shaft(
    paths: Sequence[EffectPath], told: Mapping[str, str]
) -> tuple[tuple[EffectPath, ...], tuple[EffectPath, ...]]:
    """Return the paths on the shaft that the recordings tell by themselves, and the others; all where they do not."""
    kept = tuple(path for path in paths if told.items() <= path.options.items())
    others = tuple(path for path in paths if not told.items() <= path.options.items())
    return (kept, others) if kept else (others, ())


def n_compared(conditions: Sequence[Condition]) -> int:
    """Return how many features all conditions have and a simulation can foretell; those of patterns need references."""
    return min(sum(not name.startswith(UNFORETOLD) for name in c.change.names) for c in conditions)


def _run(twin: Twin, condition: Condition) -> Run:
    """Return where an effect is simulated: without noise, if the twin can, in which what it adds would drown.

    The machine's own baseline is put under it, see `_distances`.
    """
    still = twin.quiet() if isinstance(twin, CanBeQuiet) else twin
    return Run(
        still, condition.facts.point, float(f"{condition.trial_s:.3g}"), condition.facts.sampling_rate_hz, noise=1
    )


def _paths(banks: Sequence[Bank], conditions: Sequence[Condition], shows_in: tuple[str, ...]) -> tuple[EffectPath, ...]:
    """Return an effect's paths over the candidates that could be simulated at every condition."""
    n = n_compared(conditions)
    kept = [a for a in banks[0].added if all(a in bank.added for bank in banks)]
    tables = [
        _distances(bank, kept, condition, shows_in)[:, :, :n] for bank, condition in zip(banks, conditions, strict=True)
    ]
    return paths_of(banks[0].change_names[:n], kept, tables, tuple(level for level, _ in WAYS_DB))


def _distances(bank: Bank, kept: Sequence[Added], condition: Condition, shows_in: tuple[str, ...]) -> FloatArray:
    """Return what candidates would change on the sound machine's own baseline, (n_ways, n_candidates, n).

    Nothing where theory does not expect it: a simulation changes more, and that is its own.

    The reference shows the baseline; without one it is what the twin, as far as it is credible, lets expect of sound
    machines. The bank's own sound machine may be a quiet one, and is not asked.
    """
    floor, names = condition.floor, bank.feature_names
    usual = -floor.from_centre(floor.names, np.zeros(len(floor.names)))
    simulated = dict(zip(names, bank.sound.mean(axis=0).tolist(), strict=True))
    own_names, own = whole_and_parts(condition.other)
    if condition.reference is not None:
        compared, baseline = bank.change_names, own[0]
    else:
        compared, baseline = names, load_population().credibility * own[0] + usual
    real = dict(zip(own_names, baseline.tolist(), strict=True))
    repeated = dict(zip(floor.names, usual.tolist(), strict=True))
    again = np.zeros(len(bank.change_names))  # a mere second run changes something, too
    again[: len(names)] = bank.sound_changes.mean(axis=0)[: len(names)]
    given = [(bank.changes[bank.added.index(a)].mean(axis=0) - again)[: len(compared)] for a in kept]
    rows = [[transplanted(compared, one, simulated, real, repeated, *way) for one in given] for way in WAYS_DB]
    table = np.array(rows).reshape(len(WAYS_DB), len(kept), len(compared))
    return np.where(shown_in(compared, shows_in), table, 0.0)


def folds_of(conditions: Sequence[Condition]) -> list[Fold]:
    """Return what to fit to and what to score on: half of the revolutions at a condition, and all but that half."""
    n = n_compared(conditions)
    whole = [observed(c, k, n) for k, c in enumerate(conditions)]
    found = []
    for k, condition in enumerate(conditions):
        others, again = [one for one in whole if one.condition != k], _again(condition, k, n)
        changes = [compare(part, condition.simulated, condition.reference) for part in halves(condition.now)]
        first, second = (observed(condition, k, n, change) for change in changes)
        found += [Fold((*others, first), second, again), Fold((*others, second), first, again)]
    return found


def _again(condition: Condition, index: int, n: int) -> tuple[tuple[Observed, ...], ...]:
    """Return the condition with each block left out: blocks of the recording, then of what it is compared with."""
    base, values = observed(condition, index, n), condition.change.values[:n]
    return tuple(
        tuple(replace(base, distances=base.distances + row[:n] - values) for row in rows)
        for rows in condition.change.left_out
    )


def refuse_where_none_ran(tried: dict[str, Tried], names: Sequence[str], twin: Twin) -> None:
    """Refuse where the rig has a place for some of the effects, and none of them could be simulated there."""
    placed = [name for name in names if twin.candidates(name)]
    if placed and not tried:
        raise RefusalError(
            f"none of {', '.join(placed)} can be simulated on this rig", remedy="describe the rig more fully"
        )
