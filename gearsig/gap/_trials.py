"""Simulate the most probable effects on the rig's twin and fit them to what was observed."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from gearsig.cache import keep, made_folder, modules_digest, read_arrays
from gearsig.checks import FloatArray, positive
from gearsig.errors import GearsigError, RefusalError
from gearsig.gap._change import change_feature_values
from gearsig.gap._conditions import SEED, Condition, observed, trial_length_s
from gearsig.gap._evidence import SIGNS, determined_options
from gearsig.gap._features import feature_values, whole_and_parts
from gearsig.gap._floors import UNPREDICTED, gap_size, shown_in
from gearsig.gap._places import RACES, SAME_ORDER
from gearsig.gap._prediction import (
    INTERVAL_COST,
    WAYS_DB,
    EffectPath,
    Fit,
    Fold,
    ObservedChange,
    closed_shares,
    fit_effect,
    paths_of,
    predicted_on_baseline,
    shrinkage,
)
from gearsig.gap._reduction import ComplexArray, GearFrame, ReducedRecording, reduce_recording, shaft_text
from gearsig.gap._report import ConditionFacts, GapCause, GapPlace, GapStep, Interval, PlaceKind, Shrinkage
from gearsig.gap._simulator import AddedEffect, GapEffect, HasFurtherSettings, OperatingCondition, Twin, as_tried
from gearsig.gap._waveform import (
    BETWEEN,
    PROFILE_SCATTER,
    WaveformMatch,
    compare_waveform,
    joined_waveforms,
    mesh_sidebands,
    sideband_noise,
    waveform_match,
    with_profiles_between,
)
from gearsig.processes import active_cluster, can_be_sent, killed_text, run_jobs, start_early
from gearsig.rig import SIDES
from gearsig.severity import SINGLE_TOOTH_FAULTS, TOOTH_FAULTS

# --------------------
# The simulations of a bank, in separate processes or in this one.
# --------------------


RunKey = tuple[str, OperatingCondition, float, float]


@dataclass(frozen=True)
class TwinRun:
    """Point and length of a twin's run, with noise and start as in its healthy run, so that only an effect differs."""

    twin: Twin
    point: OperatingCondition
    duration_s: float
    sampling_rate_hz: float

    @property
    def key(self) -> RunKey:
        """Everything a run depends on; twins need not be hashable."""
        return self.twin.key, self.point, self.duration_s, self.sampling_rate_hz

    def reduced(self, added: AddedEffect | None) -> ReducedRecording:
        """Return the reduced features of a run, with an effect or healthy."""
        recording = self.twin.run(
            self.point,
            () if added is None else (added,),
            seed=SEED,
            duration_s=self.duration_s,
            sampling_rate_hz=self.sampling_rate_hz,
        )
        assert recording.rig is not None  # noqa: S101  part of the protocol
        return reduce_recording(recording, recording.rig)


@dataclass(frozen=True)
class Task:
    """One simulation, with an effect or healthy; each of the `further` channels is evaluated by itself."""

    run: TwinRun
    added: AddedEffect | None
    further: tuple[str, ...] = ()


@dataclass(frozen=True)
class Reduced:
    """One simulation's features (for a healthy run only) and its change against the healthy run.

    `sidebands` are those of the change, see `mesh_sidebands`. Where there are further channels, `alone` has each
    channel's own change; the further channels do not count in `change`.
    """

    names: tuple[str, ...]
    values: FloatArray
    change_names: tuple[str, ...]
    change: FloatArray
    sidebands: ComplexArray
    alone: Mapping[str, FloatArray] = field(default_factory=dict)


def finished_runs(
    tasks: Sequence[Task], processes: int, on_progress: Callable[[int, int], object], *, n_together: int = 1
) -> list[Reduced | str]:
    """Return the result of each task, or why it could not be simulated, in the order of the tasks.

    `n_together` consecutive tasks go to one process, so that tasks with a common healthy run simulate it once. A twin
    that cannot be sent to other processes, because it is defined in the caller's script, runs in this one.
    """
    answers: list[Reduced | str] = [""] * len(tasks)
    if (processes == 1 and active_cluster() is None) or not can_be_sent(tasks[:1]):
        known: Known = {}
        for i, task in enumerate(tasks):
            answers[i] = _reduced(task, known)
            on_progress(i + 1, len(tasks))
        return answers
    batches = [tasks[i : i + n_together] for i in range(0, len(tasks), n_together)]
    # A cluster's workers outlive a twin: they forget its healthy runs after each batch.
    work = reduced_in_worker if active_cluster() is None else reduce_in_worker
    done = 0
    for number, rows in run_jobs(work, batches, n_workers=processes, if_killed=_killed_batch):
        answers[number * n_together : number * n_together + len(rows)] = rows
        done += len(rows)
        on_progress(done, len(tasks))
    return answers


def _killed_batch(tasks: Sequence[Task]) -> list[Reduced | str]:
    return [killed_text("simulated it") for _ in tasks]


def run_for_a_moment(twin: Twin, added: Sequence[AddedEffect] = ()) -> None:
    """Run a twin just long enough to see that it works, and to load what it needs."""
    twin.run(twin.point, added, seed=SEED, duration_s=0.05, sampling_rate_hz=20480.0)


Known = dict[RunKey, ReducedRecording]
_KNOWN: Known = {}
"""Healthy runs by twin, point and length, of the one diagnosis for which a worker lives."""


def reduced_in_worker(tasks: Sequence[Task]) -> list[Reduced | str]:
    """Return the results of tasks, in a process that lives for one diagnosis only."""
    return [_reduced(task, _KNOWN) for task in tasks]


def reduce_in_worker(tasks: Sequence[Task]) -> list[Reduced | str]:
    """Return the results of tasks, in a process that serves several diagnoses."""
    known: Known = {}
    return [_reduced(task, known) for task in tasks]


def _reduced(task: Task, known: Known) -> Reduced | str:
    key = task.run.key
    try:
        if key not in known:
            known[key] = task.run.reduced(None)
        healthy = known[key]
        now = healthy if task.added is None else task.run.reduced(task.added)
        alone = {}
        if task.further:
            alone = {
                name: change_feature_values(now.of_channels([name]), healthy.of_channels([name]))[1]
                for name in healthy.channels
            }
            of_the_rig = [name for name in healthy.channels if name not in task.further]
            now, healthy = now.of_channels(of_the_rig), healthy.of_channels(of_the_rig)
        names, values = feature_values(healthy) if task.added is None else ((), np.empty(0))
        sidebands = mesh_sidebands(now, healthy, is_turned=False)
        return Reduced(names, values, *change_feature_values(now, healthy), sidebands, alone)
    except GearsigError as error:
        return str(error)


# --------------------
# The changes that each effect causes on one rig at one operating point: simulated once, kept on disk.
# --------------------


Progress = Callable[[int, int], object]
POINT_DIGITS = 3
"""Digits to which speed and torque are rounded: recordings of one set point share a bank."""

_MODULES = (
    *(f"gearsig.gap.{name}" for name in ("_reduction", "_features", "_change", "_waveform")),
    *(f"gearsig.{name}" for name in ("severity._features", "orders._average", "prepared._angle")),
    *(f"gearsig.angle.{name}" for name in ("_source", "_resample", "_tachless")),
)
"""Modules whose code determines the features."""


@cache
def features_digest() -> str:
    """Return a short hash of the code that computes features from a recording."""
    return modules_digest(_MODULES)


@dataclass(frozen=True)
class Bank:
    """Simulated features of the healthy machine, and the changes that each candidate of one effect causes in them.

    Parameters
    ----------
    feature_names : tuple of str
        Names of `healthy`; see `feature_values`.
    change_names : tuple of str
        Names of the changes, those of the features first; see `change_feature_values`.
    healthy : array, (n_features,)
    added : tuple of AddedEffect
        Candidates that could be simulated.
    changes : array, (n_added, n_changes)
        Change of each candidate's run against the healthy run.
    sidebands : complex array, (n_added, n_channels, 2, n_harmonics, n_offsets)
        The same change in the sidebands of the mesh harmonics, see `mesh_sidebands`.
    """

    feature_names: tuple[str, ...]
    change_names: tuple[str, ...]
    healthy: FloatArray
    added: tuple[AddedEffect, ...]
    changes: FloatArray
    sidebands: ComplexArray


def banks_of(
    runs: Sequence[TwinRun],
    candidates: Mapping[str, Sequence[AddedEffect]],
    *,
    folder: Path | None,
    processes: int = 2,
    fresh: bool = False,
    on_progress: Progress = lambda _done, _all: None,
) -> list[dict[str, Bank]]:
    """Return the effects' banks for each operating point, read from disk or simulated and kept.

    Parameters
    ----------
    runs : sequence of TwinRun
        Twin, point and length of each simulation; the point is rounded to `POINT_DIGITS` digits.
    candidates : mapping
        Effect → its settings to simulate; each effect has its own file.
    folder : Path or None
        Where banks are kept; None: nowhere.
    processes : int
        1: in this process. Otherwise the twins must be picklable.
    fresh : bool
        Simulate again what is on disk, and replace it.
    on_progress : callable
        Called with the numbers of finished and of all runs; an exception raised in it stops the work, and nothing is
        kept.

    Raises
    ------
    InputError
        If the folder cannot be made.
    RefusalError
        If the healthy machine cannot be simulated or its recording is too short for the features.
    """
    folder = None if folder is None else made_folder(folder, "choose another with --cache")
    requests: dict[str, tuple[TwinRun, list[Task]]] = {}
    keys = []
    for run in runs:
        positive(run.duration_s, "duration_s", "s")
        at = replace(run, point=rounded(run.point))
        for added in candidates.values():
            keys.append(bank_key(at, added))
            requests[keys[-1]] = at, [Task(at, setting) for setting in added]
    banks = {key: None if folder is None or fresh else read_bank(_bank_path(folder, key), key) for key in requests}
    missing = {key: requests[key] for key, bank in banks.items() if bank is None}
    healthy = {run.key: run for run, _ in missing.values()}
    every = [*(Task(run, None) for run in healthy.values()), *(task for _, tasks in missing.values() for task in tasks)]
    rows = iter(finished_runs(every, processes, on_progress) if every else ())
    healthy_rows = {key: next(rows) for key in healthy}
    for key, (run, tasks) in missing.items():
        settings = [task.added for task in tasks if task.added is not None]
        banks[key] = bank = _assembled(settings, healthy_rows[run.key], list(islice(rows, len(tasks))))
        if folder is not None:
            write_bank(_bank_path(folder, key), key, bank)
    in_order = iter(banks[key] for key in keys)
    return [{name: bank for name, bank in zip(candidates, in_order, strict=False) if bank is not None} for _ in runs]


def rounded(point: OperatingCondition, n_digits: int = POINT_DIGITS) -> OperatingCondition:
    """Return the point rounded to so many digits, as used for a bank or easy to set on the machine."""
    return OperatingCondition(*(float(f"{value:.{n_digits}g}") for value in (point.speed_rpm, point.torque_nm)))


def bank_key(run: TwinRun, candidates: Sequence[AddedEffect]) -> str:
    """Return everything that a bank's numbers depend on, as text."""
    settings = [_plain(added) for added in candidates]
    lengths = [run.duration_s, run.sampling_rate_hz]
    known = [run.twin.key, features_digest(), [run.point.speed_rpm, run.point.torque_nm], settings, lengths]
    return json.dumps(known, sort_keys=True)


def _assembled(candidates: Sequence[AddedEffect], healthy: Reduced | str, rows: Sequence[Reduced | str]) -> Bank:
    """Return a bank of the candidates that could be simulated."""
    if isinstance(healthy, str):
        raise RefusalError(f"the healthy machine cannot be simulated: {healthy}", remedy="check the rig file")
    names = healthy.change_names
    kept = [
        (added, row)
        for added, row in zip(candidates, rows, strict=True)
        if isinstance(row, Reduced) and row.change_names == names
    ]
    sidebands = np.array([row.sidebands for _, row in kept], dtype=np.complex128)
    return Bank(
        healthy.names,
        names,
        healthy.values,
        tuple(added for added, _ in kept),
        np.array([row.change for _, row in kept]).reshape(len(kept), len(names)),
        sidebands.reshape(len(kept), *healthy.sidebands.shape),
    )


# A bank on disk: arrays without pickles, written atomically; a file that does not match is replaced.

_ARRAYS = ("healthy", "changes", "sidebands")
MAX_BYTES = 100_000_000
"""Limit of a bank's arrays; a real bank has less than one megabyte."""


def _bank_path(folder: Path, key: str) -> Path:
    return folder / f"bank-{sha256(key.encode()).hexdigest()[:24]}.npz"


def write_bank(path: Path, key: str, bank: Bank) -> None:
    """Keep a bank for the next diagnosis of its rig, if the folder is writable."""
    names, added = [bank.feature_names, bank.change_names], [_plain(added) for added in bank.added]
    about = np.array(json.dumps({"key": key, "names": names, "added": added}))
    arrays: dict[str, Any] = {name: getattr(bank, name) for name in _ARRAYS}
    keep(path, lambda file: np.savez_compressed(file, about=about, **arrays))


def read_bank(path: Path, key: str) -> Bank | None:
    """Return the bank that a file holds for this key, None where the file is missing, damaged or foreign."""
    data = read_arrays(path, MAX_BYTES)
    if data is None:
        return None
    try:
        about = json.loads(str(data["about"]))
        if about["key"] != key:
            return None
        names, changes = map(tuple, about["names"])
        added = tuple(AddedEffect(name, float(severity), options) for name, severity, options in about["added"])
        return Bank(names, changes, data["healthy"], added, data["changes"], data["sidebands"])
    except (ValueError, KeyError, TypeError, IndexError):
        return None


def _plain(added: AddedEffect) -> list[Any]:
    return [added.name, added.severity, dict(added.options)]


PROCESSES = 2
"""Number of processes for one diagnosis."""


@dataclass(frozen=True)
class TriedEffect:
    """The trial of one effect.

    Parameters
    ----------
    name : str
    paths : tuple of EffectPath
        On the shaft that the recordings identify by themselves, where they do.
    fit : Fit
        Fit to all conditions.
    shrinkage : Shrinkage
        On held-out data.
    match : WaveformMatch or None
        For a tooth fault, with a reference: how well the twin reproduces its profile, and at which severity.
    """

    name: str
    paths: tuple[EffectPath, ...]
    fit: Fit
    shrinkage: Shrinkage
    match: WaveformMatch | None = None

    @property
    def is_shown(self) -> bool:
        """Whether the twin reproduces the profile of a tooth fault well."""
        return self.match is not None and self.match.is_good

    @property
    def added(self) -> AddedEffect:
        """The best setting: by waveform where the twin reproduces it well, else by the fit."""
        return self.match.added if self.match is not None and self.match.is_good else self.fit.added

    @property
    def severity(self) -> Interval:
        """Its severity as an interval."""
        return self.match.severity if self.match is not None and self.match.is_good else self.fit.severity

    @property
    def explains(self) -> bool:
        """Whether the effect shows in the twin and brings it nearer; otherwise severity and place mean nothing."""
        return self.is_shown or (self.shrinkage.is_predicted and self.shrinkage.shrink.value > 0.0)


def try_effects(
    effects: Sequence[GapEffect],
    twin: Twin,
    conditions: Sequence[Condition],
    cache: Path | None,
    on_progress: Callable[[str, float], object],
    *,
    fresh: bool = False,
) -> dict[str, TriedEffect]:
    """Simulate each effect at every condition, fit it, and score it on data that it was not fitted to.

    Effects that the rig cannot have, for example because it has no bearing, are omitted.

    Parameters
    ----------
    effects : sequence of GapEffect
    twin : Twin
        The simulator, set to the rig.
    conditions : sequence of Condition
        Operating points of one machine.
    cache : path or None
        Folder of simulated banks; None: nothing is kept.
    on_progress : callable
        Called with the current step in words and the fraction completed, 0 to 1.
    fresh : bool
        Whether to simulate kept banks again.

    Returns
    -------
    dict
        Effect → its trial: fit, shrinkage on held-out data and, for a tooth fault, waveform match.

    Raises
    ------
    RefusalError
        If the rig has a place for some of the effects, but none of them can be simulated there.
    """
    if not effects:
        return {}
    changes, teeth = [condition.over_floors for condition in conditions], conditions[0].now.frame.teeth
    determined = {effect.name: determined_options(effect.name, changes, teeth) for effect in effects}
    folds = folds_of(conditions)
    where = " and ".join(c.facts.name for c in conditions)
    candidates = {name: candidates_to_simulate(twin.candidates(name), determined[name]) for name in determined}
    settings = candidates
    if isinstance(twin, HasFurtherSettings) and any(condition.has_reference for condition in conditions):
        settings = {
            n: [*some, *(a for a in twin.further_settings(n) if determined[n].items() <= a.options.items())]
            for n, some in candidates.items()
        }
    banks = banks_of(
        [trial_run(twin, condition.facts, condition.now) for condition in conditions],
        settings,
        folder=cache,
        processes=PROCESSES,
        fresh=fresh,
        on_progress=lambda done, of: on_progress(
            f"simulating {len(determined)} effects at the point of {where}", done / of
        ),
    )
    tried_effects, fits = {}, {}
    for effect in effects:
        name = effect.name
        every = _paths([at[name] for at in banks], candidates[name], conditions, effect.shows_in)
        if every:
            paths, excluded = on_shaft(every, determined[name])
            fits[name] = [fit_effect(paths, fold.fitted) for fold in folds]
            shrink = shrinkage(paths, folds, excluded, fits[name])
            match = _match([at[name] for at in banks], conditions, effect) if name in TOOTH_FAULTS else None
            tried_effects[name] = TriedEffect(
                name, paths, fit_effect(paths, observed_changes(conditions)), shrink, match
            )
    placed = [name for name, some in candidates.items() if some]
    if placed and not tried_effects:
        raise RefusalError(
            f"none of {', '.join(placed)} can be simulated on this rig", remedy="describe the rig more fully"
        )
    shares = closed_shares(fits, folds)
    return {
        name: replace(tried, shrinkage=replace(tried.shrinkage, of_all=shares.get(name)))
        for name, tried in tried_effects.items()
    }


def candidates_to_simulate(candidates: Sequence[AddedEffect], determined: Mapping[str, str]) -> list[AddedEffect]:
    """Return the candidates on the shaft that the recordings identify, and the strongest candidate on the other shaft.

    The latter serves as a placebo. Return all candidates where no shaft is identified or none of them is on it.
    """
    placed = [added for added in candidates if determined.items() <= added.options.items()]
    if not placed:
        return list(candidates)
    others = sorted((added for added in candidates if added not in placed), key=lambda added: added.severity)
    return [*placed, *{added.place: added for added in others}.values()]


def _match(banks: Sequence[Bank], conditions: Sequence[Condition], effect: GapEffect) -> WaveformMatch | None:
    """Return the match of an effect's waveforms at the conditions that have a reference."""
    waveforms = []
    for bank, condition in zip(banks, conditions, strict=True):
        if condition.reference is None:
            continue
        names, simulated = list(condition.now.channels), list(condition.simulated.channels)
        if not set(names) <= set(simulated) or len(simulated) != bank.sidebands.shape[1]:
            continue
        channels = [simulated.index(name) for name in names]
        observed = mesh_sidebands(condition.now, condition.reference, is_turned=True)
        noise = sideband_noise(condition.now, condition.reference)
        scatter = condition.gain_scatter
        passed: ComplexArray = np.ones((len(names), len(SIDES), 1, 1), dtype=np.complex128)
        if condition.path is not None:
            passed = condition.path.of_sidebands(names, condition.now.frame, condition.now.speed_hz)
        compared = [
            compare_waveform(
                setting,
                sidebands[channels] * passed[:, side],
                observed[:, side],
                noise[:, side],
                moves_pitches=effect.moves_pitches / (BETWEEN + 1 if effect.profile_varies_with else 1),
                n_teeth=n_teeth,
                gain_scatter=scatter,
            )
            for setting, side, sidebands, n_teeth in _settings(bank, effect, condition.now.frame.teeth)
        ]
        waveforms.append([waveform for waveform in compared if waveform is not None])
    severities = [added.severity for bank in banks for added in bank.added]
    if not severities:
        return None
    scatter = PROFILE_SCATTER if effect.profile_varies_with == effect.severity_name else 0.0
    joined = joined_waveforms(waveforms)
    return waveform_match(joined, min(severities), max(severities), severity_scatter=scatter)


def _settings(
    bank: Bank, effect: GapEffect, teeth: Sequence[int]
) -> Iterator[tuple[AddedEffect, int, ComplexArray, int]]:
    """Yield what to compare waveforms with: setting, gear, its sidebands, and number of teeth that have the effect.

    An effect that may affect every tooth individually was simulated on one tooth. The simulation represents that tooth
    and, the first one of each gear, also all teeth. 0 teeth: the effect is on one tooth.
    """
    for side in range(len(SIDES)):
        simulated = [
            (added, sidebands[:, side])
            for added, sidebands in zip(bank.added, bank.sidebands, strict=True)
            if added.options.get("gear") == SIDES[side] and (not effect.is_on_every_tooth or "tooth" in added.options)
        ]
        for added, sidebands in with_profiles_between(simulated, effect, teeth[side]):
            yield added, side, sidebands, 0
        if effect.is_on_every_tooth and simulated:
            first, sidebands = simulated[0]
            yield AddedEffect(first.name, first.severity, {"gear": SIDES[side]}), side, sidebands, teeth[side]


def on_shaft(
    paths: Sequence[EffectPath], determined: Mapping[str, str]
) -> tuple[tuple[EffectPath, ...], tuple[EffectPath, ...]]:
    """Return the paths on the shaft that the recordings identify, and the others; all where they identify none."""
    kept = tuple(path for path in paths if determined.items() <= path.options.items())
    remaining = tuple(path for path in paths if not determined.items() <= path.options.items())
    return (kept, remaining) if kept else (remaining, ())


def n_compared(conditions: Sequence[Condition]) -> int:
    """Return how many features all conditions share and a simulation can predict; pattern features need references."""
    return min(sum(not name.startswith(UNPREDICTED) for name in c.change.names) for c in conditions)


def observed_changes(conditions: Sequence[Condition]) -> list[ObservedChange]:
    """Return each condition's observed distances and floors, of the features compared at all of them."""
    n = n_compared(conditions)
    return [observed(condition, k, n) for k, condition in enumerate(conditions)]


def trial_run(twin: Twin, facts: ConditionFacts, now: ReducedRecording) -> TwinRun:
    """Return the run in which an effect is simulated, without the noise that would mask it, if the twin allows that.

    It starts as the healthy run does, so that only the effect differs. The machine's own baseline is substituted later,
    see `_distances`.
    """
    return TwinRun(as_tried(twin), facts.point, float(f"{trial_length_s(now):.3g}"), facts.sampling_rate_hz)


def start_healthy_trial(twin: Twin, facts: ConditionFacts, now: ReducedRecording) -> None:
    """Let workers simulate the healthy baseline of the trials before it is known which trials are made."""
    run = trial_run(twin, facts, now)
    start_early(reduced_in_worker, [Task(replace(run, point=rounded(run.point)), None)])


def _paths(
    banks: Sequence[Bank], candidates: Sequence[AddedEffect], conditions: Sequence[Condition], shows_in: tuple[str, ...]
) -> tuple[EffectPath, ...]:
    """Return an effect's paths over the candidates that could be simulated at every condition."""
    n = n_compared(conditions)
    kept = [a for a in candidates if all(a in bank.added for bank in banks)]
    tables = [
        _distances(bank, kept, condition, shows_in)[:, :, :n] for bank, condition in zip(banks, conditions, strict=True)
    ]
    return paths_of(banks[0].change_names[:n], kept, tables, tuple(level for level, _ in WAYS_DB))


def _distances(bank: Bank, kept: Sequence[AddedEffect], condition: Condition, shows_in: tuple[str, ...]) -> FloatArray:
    """Return the changes by candidates on the healthy machine's own baseline, (n_ways, n_candidates, n).

    Zero where theory expects no change: changes simulated there are artefacts of the simulator.

    The reference shows the baseline. Without one, the baseline is what the twin, as far as it is credible, predicts for
    healthy machines. The bank's own healthy machine is not used, as it may be a quiet one.
    """
    floor, names = condition.floor, bank.feature_names
    usual = -floor.from_centre(floor.names, np.zeros(len(floor.names)))
    simulated = dict(zip(names, bank.healthy.tolist(), strict=True))
    base_names, base = whole_and_parts(condition.baseline)
    if condition.has_reference:
        compared, baseline = bank.change_names, base[0]
    else:
        compared, baseline = names, condition.learned.credibility * base[0] + usual
    real = dict(zip(base_names, baseline.tolist(), strict=True))
    repeated = dict(zip(floor.names, usual.tolist(), strict=True))
    changes = bank.changes[[bank.added.index(a) for a in kept], : len(compared)]
    table = np.array([predicted_on_baseline(compared, changes, simulated, real, repeated, *way) for way in WAYS_DB])
    return np.where(shown_in(compared, shows_in), table, 0.0)


def folds_of(conditions: Sequence[Condition]) -> list[Fold]:
    """Return the folds: half of a condition's revolutions to score on, all the rest to fit to."""
    n, whole = n_compared(conditions), observed_changes(conditions)
    folds = []
    for k, condition in enumerate(conditions):
        fitted, again = (
            [observation for observation in whole if observation.condition != k],
            _left_out_changes(condition, k, n),
        )
        halves = [condition.now.of_blocks(slice(first, None, 2)) for first in (0, 1)]
        first, second = (observed(condition, k, n, condition.change_of(half)) for half in halves)
        folds += [Fold((*fitted, first), second, again), Fold((*fitted, second), first, again)]
    return folds


def _left_out_changes(condition: Condition, index: int, n: int) -> tuple[tuple[ObservedChange, ...], ...]:
    """Return the condition with each block left out in turn: those of the recording, then those of its baseline."""
    base, values = observed(condition, index, n), condition.change.values[:n]
    return tuple(
        tuple(replace(base, distances=base.distances + row[:n] - values) for row in rows)
        for rows in condition.change.left_out
    )


# --------------------
# What remains of a gap as effects are added one after another, on data that they were not fitted to.
# --------------------


MIN_CLOSED = 0.05
"""Share of the gap that a further effect must remove to be shown."""

MUCH_LEFT = 1.0
"""Structural floors of the whole gap that one effect must leave before a second one is tried."""


def steps_of(
    conditions: Sequence[Condition],
    tried: Mapping[str, TriedEffect],
    causes: Sequence[GapCause],
    beside: GapCause | None,
    try_further: Callable[[str], TriedEffect | None],
) -> tuple[GapStep, ...]:
    """Return the whole gap before, what remains with the likeliest effect, and with another effect beside it.

    Parameters
    ----------
    conditions : sequence of Condition
    tried : mapping
        Effect → its trial.
    causes : sequence of GapCause
        In the order of the report.
    beside : GapCause or None
        Effect that may accompany the most probable one, where that leaves much of the gap.
    try_further : callable
        Effect → its trial, None where it cannot be tried; called if `beside` was not tried.
    """
    folds = folds_of(conditions)
    before = GapStep("before", _remaining_gap(conditions, folds, []))
    first = next((cause for cause in causes if cause.name in tried), None)
    if first is None:
        return (before,)
    effect = tried[first.name]
    alone = GapStep(first.title, _remaining_gap(conditions, folds, [effect]))
    further = None
    if beside is not None and alone.remaining.value > MUCH_LEFT:
        further = tried.get(beside.name) or try_further(beside.name)
    if beside is None or further is None:
        return before, alone
    both = GapStep(beside.title, _remaining_gap(conditions, folds, [effect, further]))
    closes = both.remaining.value <= (1.0 - MIN_CLOSED) * alone.remaining.value
    return (before, alone, both) if closes else (before, alone)


def _remaining_gap(conditions: Sequence[Condition], folds: Sequence[Fold], added: Sequence[TriedEffect]) -> Interval:
    """Return the size of the whole gap, mean over folds; each effect is fitted to what the previous ones leave."""
    sizes = []
    for fold in folds:
        condition = conditions[fold.scored.condition]
        total: FloatArray = np.zeros(len(condition.change.names))
        fits: list[Fit] = []
        for effect in added:
            fits.append(fit_effect(effect.paths, [_without(o, fits) for o in fold.fitted]))
            total[: n_compared(conditions)] += fits[-1].at(fold.scored.condition)
        sizes.append(_size(condition, fold.scored, total, n_compared(conditions)))
    low, value, high = np.mean([[s.low, s.value, s.high] for s in sizes], axis=0)
    return Interval(float(value), float(low), float(high))


def _without(change: ObservedChange, fits: Sequence[Fit]) -> ObservedChange:
    distances = change.distances.copy()
    for fit in fits:
        distances = distances - fit.at(change.condition)
    return replace(change, distances=distances)


def _size(condition: Condition, scored: ObservedChange, explained: FloatArray, n: int) -> Interval:
    """Return the size of what remains of a condition's change, with the distances of the scored part."""
    change = condition.change
    structural = condition.floor
    whole = structural.from_centre(change.names, change.values)
    shift = np.zeros(len(change.names))
    shift[:n] = scored.distances - whole[:n]
    moved = replace(
        change,
        values=change.values + shift - explained,
        left_out=tuple(rows + shift - explained for rows in change.left_out),
    )
    return gap_size(moved, structural).structural


# --------------------
# The place of a fitted effect on the machine, in words.
# --------------------


def place_of(added: AddedEffect, frame: GearFrame, places: Sequence[GapPlace]) -> str:
    """Return "tooth 7 of the gear on the input shaft", "bearing 2", "order 6"; empty where the effect has no place.

    The tooth is that of the recording; the simulated tooth represents any of them.
    """
    options = added.options
    if "bearing" in options:
        return " or ".join(_bearings(added.name, str(options["bearing"]), frame, places))
    if "order" in options:
        return _order(frame, places, float(options["order"]))
    side = options.get("gear", options.get("shaft"))
    if side not in SIDES:
        return ""
    shaft = frame.shafts[SIDES.index(str(side))]
    words = shaft_text(frame, SIDES.index(str(side)))
    if "tooth" not in options and "gear" not in options:
        return words
    if frame.teeth[0] == frame.teeth[1]:  # the same teeth mesh at every revolution
        words += " or its mate"
    tooth_place = _tooth_place(shaft, places) if "tooth" in options else None
    if tooth_place is None or (tooth_place.tooth is None and tooth_place.angle_deg is None):
        return f"{'one tooth of ' if 'tooth' in options else ''}the gear on {words}"
    tooth = f"tooth {tooth_place.tooth} of the gear on"
    return f"{tooth} {words}" if tooth_place.tooth is not None else f"{tooth_place.angle_deg:.0f}° of {words}"


def _bearings(name: str, fitted: str, frame: GearFrame, places: Sequence[GapPlace]) -> list[str]:
    """Return the bearings whose race stands out in the recording, otherwise those that match the fitted one."""
    race = RACES.get(name)
    if race is None:
        return [fitted]
    orders = {bearing.name: float(getattr(bearing, race)) for bearing in frame.bearings}
    envelope_orders = [place.orders[0] for place in places if place.kind is PlaceKind.ENVELOPE and place.orders]
    for observed_order in (*envelope_orders, orders.get(fitted, np.nan)):
        if alike := [
            alternative for alternative, order in orders.items() if abs(observed_order / order - 1.0) < SAME_ORDER
        ]:
            return alike
    return [fitted]


def cause_place(
    name: str, tried: TriedEffect | None, conditions: Sequence[Condition], places: Sequence[GapPlace]
) -> str:
    """Return where a cause is, in words; empty where it has no place or the place is not known.

    The recordings themselves may identify the shaft. Otherwise it is taken from a fit that is clearly better on one
    shaft than on the other; then, for a tooth fault, from a single shaft on which a tooth stands out, since on the
    other shaft's average its bursts are smeared. If none of this decides, the text says so. Pitch errors are attributed
    to one tooth where one stands out, else to all.
    """
    frame = conditions[0].now.frame
    changes = [condition.over_floors for condition in conditions]
    options: dict[str, float | str] = {**determined_options(name, changes, frame.teeth)}
    if tried is not None and tried.match is not None and tried.is_shown:
        options["gear"] = tried.match.added.options["gear"]
    bursts = [place for place in places if place.kind is PlaceKind.TOOTH and place.angle_deg is not None]
    gears = {SIDES[frame.shafts.index(place.shaft)] for place in bursts}
    if options or name not in SIGNS:
        is_of_one = name in SINGLE_TOOTH_FAULTS or (name in TOOTH_FAULTS and options["gear"] in gears)
        a_tooth = {"tooth": 1.0} if is_of_one else {}
        return place_of(AddedEffect(name, 0.0, {**options, **a_tooth}) if tried is None else tried.added, frame, places)
    if tried is not None and _is_clear(tried, conditions):
        return place_of(tried.fit.added, frame, places)
    if name in TOOTH_FAULTS and len(gears) == 1:
        return place_of(AddedEffect(name, 0.0, {"gear": gears.pop(), "tooth": 1.0}), frame, places)
    either = " or ".join(shaft_text(frame, side) for side in range(len(SIDES)))
    return f"{either} (which one is not known)"


def _is_clear(tried: TriedEffect, conditions: Sequence[Condition]) -> bool:
    """Whether the fit on the other shaft is worse by more than chance."""
    observations = observed_changes(conditions)
    by_shaft = [
        [path for path in tried.paths if path.options.get("gear", path.options.get("shaft")) == side] for side in SIDES
    ]
    costs = [fit_effect(paths, observations).cost for paths in by_shaft if paths]
    return len(costs) < len(SIDES) or max(costs) - min(costs) > INTERVAL_COST


def at_recorded_tooth(added: AddedEffect, frame: GearFrame, places: Sequence[GapPlace]) -> AddedEffect:
    """Return the setting with the recording's tooth instead of the simulated one, where a mark gives it a number."""
    if "tooth" not in added.options:
        return added
    tooth_place = _tooth_place(frame.shafts[SIDES.index(str(added.options["gear"]))], places)
    if tooth_place is None or tooth_place.tooth is None:
        return added
    return replace(added, options={**added.options, "tooth": float(tooth_place.tooth)})


def _tooth_place(shaft: str, places: Sequence[GapPlace]) -> GapPlace | None:
    return next((p for p in places if p.kind is PlaceKind.TOOTH and p.shaft == shaft), None)


def _order(frame: GearFrame, places: Sequence[GapPlace], fitted: float) -> str:
    """Return the order that the recording shows, otherwise the fitted one."""
    for place in places:
        if place.kind is PlaceKind.SHAFT and place.shaft == frame.shafts[0] and place.orders:
            return f"order {place.orders[0]:.3g}"
    return f"order {fitted:.3g}"
