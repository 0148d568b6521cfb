"""Diagnosers by name: the gap diagnosis, the baselines, or any function ``module:name`` of the same form."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from gearsig.errors import InputError
from gearsig.gap import (
    INDEPENDENT,
    NONE,
    SIDES,
    UNKNOWN,
    AddedEffect,
    GapCause,
    GapOutcome,
    GapReport,
    Interval,
    ReducedRecording,
    feature_values,
    reduce_recording,
    rule_strengths,
    textbook_rules,
    without_machines_of,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording, read_recording
from gearsig.rig import Rig, read_rig
from sims.effects import as_gap_effect, effects

# --------------------
# The visible part of a case: one folder with recordings and rig files.
# --------------------


@dataclass(frozen=True)
class VisibleCase:
    """The recordings of a case, each with its rig.

    Parameters
    ----------
    recordings, references : tuple of Recording
        Reference i was recorded under the condition of recording i; empty: no reference.
    """

    recordings: tuple[Recording, ...]
    references: tuple[Recording, ...]

    @property
    def rig(self) -> Rig:
        """Rig of the first recording."""
        return self.recordings[0].rig or Rig()

    @cached_property
    def reduced(self) -> tuple[ReducedRecording, ...]:
        """The recordings, reduced."""
        return tuple(reduce_recording(recording) for recording in self.recordings)

    @cached_property
    def reduced_references(self) -> tuple[ReducedRecording, ...]:
        """The references, reduced."""
        return tuple(reduce_recording(recording) for recording in self.references)


def read_visible(folder: Path) -> VisibleCase:
    """Read condition_1.h5, reference_1.h5 … with the rig files next to them."""
    conditions, references = (
        tuple(read_recording(p, rig=read_rig(p.with_suffix(".toml"))) for p in sorted(folder.glob(f"{stem}_*.h5")))
        for stem in ("condition", "reference")
    )
    return VisibleCase(conditions, references)


Diagnoser = Callable[[VisibleCase], GapReport]

GAP, FOREST, MAJORITY, RULES = "gap", "forest", "majority", "rules"
GAP_UNSEEN, FOREST_UNSEEN = "gap-unseen", "forest-unseen"
"""The same diagnosers, without what was learned from the development gears of the independent rig."""
START_STOP = "start-stop"
"""Diagnoser of machines that start and stop, by the model forging."""
BASELINES = (MAJORITY, RULES)
MAIN = "__main__"
"""Module name that differs between processes: the diagnosing process cannot find the caller's functions there."""


def diagnoser(name: str) -> Diagnoser:
    """Return the diagnoser given by its name or by ``module:function``.

    Raises
    ------
    InputError
        If it does not exist.
    """
    if name in DIAGNOSERS:
        return DIAGNOSERS[name]
    module, sign, function = name.partition(":")
    is_shared = sign and module != MAIN
    try:
        shared = getattr(import_module(module), function) if is_shared else None
    except (ImportError, AttributeError):
        shared = None
    except (Exception, SystemExit) as error:  # a user's module may raise anything
        raise InputError(f"the module of {name!r} cannot be imported ({type(error).__name__}: {error})") from error
    if not callable(shared):
        raise InputError(f"there is no diagnoser {name!r}", allowed=f"{', '.join(DIAGNOSERS)} or MODULE:FUNCTION")
    return shared  # type: ignore[no-any-return]  # a user's function is checked only when called


def folders_of(name: str) -> tuple[Path, ...]:
    """Return the folders from which a diagnoser's module is imported; empty if it has no file."""
    top = (__name__ if name in DIAGNOSERS else name.partition(":")[0]).partition(".")[0]
    spec = None if top == MAIN else find_spec(top)
    if spec is None:
        return ()
    origin = [spec.origin] if spec.has_location and spec.origin else []
    return tuple(Path(place).absolute().parent for place in spec.submodule_search_locations or origin)


def diagnose(case: VisibleCase, model: str = "cracked") -> GapReport:
    """Diagnose a case with the gap diagnosis of gearsig; its cache lies with the case and is deleted with it."""
    from gearsig.gap import diagnose_gap
    from sims.registry import gap_simulator

    return diagnose_gap(
        case.recordings,
        gap_simulator(model),
        references=case.references,
        cache=Path.cwd() / "kept",
    )


def diagnose_drive(case: VisibleCase) -> GapReport:
    """Diagnose a start–stop case with the gap diagnosis of gearsig."""
    return diagnose(case, "forging")


# --------------------
# A gap report that holds only probabilities, for the baselines.
# --------------------


NUISANCE_GROUP = "measurement chain"
_NOTHING = Interval(0.0, 0.0, 0.0)


def bare_report(
    simulator: str,
    probabilities: Mapping[str, float],
    options: Mapping[str, Mapping[str, str]] | None = None,
    outcome: GapOutcome | None = None,
) -> GapReport:
    """Return a report that holds only probabilities.

    Parameters
    ----------
    simulator : str
        Name of the baseline, in place of the simulator.
    probabilities : mapping
        Cause → probability.
    options : mapping or None
        Cause → its location: gear, bearing.
    outcome : GapOutcome or None
        None: follows from the most probable cause.
    """
    where = options or {}
    ranked = sorted(probabilities.items(), key=lambda item: -item[1])
    of_first = {NONE: GapOutcome.NO_GAP, UNKNOWN: GapOutcome.UNKNOWN}.get(ranked[0][0], GapOutcome.EFFECT)
    causes = tuple(_cause(name, p, where.get(name, {})) for name, p in ranked)
    return GapReport(
        rig="",
        simulator=simulator,
        conditions=(),
        references=(),
        outcome=outcome or of_first,
        causes=causes,
        size=_NOTHING,
        repeatability=0.0,
    )


def _cause(name: str, probability: float, options: Mapping[str, str]) -> GapCause:
    known = effects().get(name)
    if known is None:
        return GapCause(name, "", name, "", probability)
    return GapCause(
        name,
        known.group,
        known.title,
        known.severity.unit,
        probability,
        fitted=AddedEffect(name, known.severity.typical, options),
        is_nuisance=known.group == NUISANCE_GROUP,
    )


# --------------------
# The baseline that uses only the forests: nothing is simulated on the rig's twin.
# --------------------


def diagnose_forest(case: VisibleCase) -> GapReport:
    """Return the calibrated probabilities of the forests, the verdict they allow, and the shaft that shows it."""
    from gearsig.gap import attribute, conditions_of, determined_options
    from sims.cracked import CrackedPair

    simulator = CrackedPair()
    twin = simulator.twin_of(case.rig)
    recordings, references = (
        [PreparedRecording(r) for r in given_recordings] for given_recordings in (case.recordings, case.references)
    )
    conditions, _ = conditions_of(recordings, references, twin)
    known = simulator.gap_effects()
    attribution = attribute(conditions, known, (), twin, None, lambda *_: None, max_tried=0)
    probabilities = attribution.probabilities()
    changes, teeth = [condition.over_floors for condition in conditions], conditions[0].now.frame.teeth
    shafts = {name: determined_options(name, changes, teeth) for name in probabilities}
    return bare_report("forest", probabilities, shafts, attribution.outcome(probabilities, known))


# --------------------
# The baseline that ignores the recordings: it always answers with the shares of the kinds of case.
# --------------------


SHARES = {"single": 0.60, "none": 0.15, "unknown": 0.15, "pair": 0.10}
"""Shares of all cases; "single" is divided evenly among the effects of the catalogue, "unknown" among those outside it.

They are public. They are defined here because the diagnosing process imports nothing that makes cases.
"""


def diagnose_majority(case: VisibleCase) -> GapReport:  # noqa: ARG001 - it ignores the case on purpose
    """Return the shares as probabilities; the most probable cause is "none"."""
    per_effect = (SHARES["single"] + SHARES["pair"]) / len(effects())
    return bare_report(
        "majority", {NONE: SHARES["none"], UNKNOWN: SHARES["unknown"], **dict.fromkeys(effects(), per_effect)}
    )


# --------------------
# The diagnosis of machines unlike any that it knows: its population contains nothing of the independent rig.
# --------------------


def unseen(diagnose_case: Diagnoser) -> Diagnoser:
    """Return a diagnoser without what was learned from the independent rig's development gears."""

    def diagnosed(case: VisibleCase) -> GapReport:
        with without_machines_of(INDEPENDENT):
            return diagnose_case(case)

    return diagnosed


# --------------------
# Usual values of the features in the rule table of `gearsig.gap`, for the baseline that applies it.
#
# A feature counts by its deviation from the usual value, relative to its usual spread; with a healthy reference, by
# its change, relative to the usual spread of the change. Usual values and spreads: median and spread of 24 healthy
# machines of the development cases, rounded.
# --------------------


MIN_STRENGTH = 2.0
"""Strength assigned to "none", in spreads."""

USUAL: dict[str, tuple[float, float, float]] = {
    "mesh.total": (5.0, 16.0, 1.5),
    "mesh.share.2": (-15.0, 9.0, 1.5),
    "mesh.share.3": (-28.0, 12.0, 2.0),
    "mesh.share.4": (-35.0, 12.0, 2.0),
    "mesh.half": (-60.0, 18.0, 2.0),
    "sideband.{side}.1": (-27.0, 14.0, 3.0),
    "sideband.{side}.2": (-29.0, 14.0, 2.5),
    "sideband.{side}.3to5": (-37.0, 15.0, 2.5),
    "sideband.{side}.6to12": (-38.0, 15.0, 1.5),
    "sideband.{side}.strongest": (29.0, 7.0, 2.0),
    "shaft.{side}.1": (-38.0, 16.0, 3.5),
    "shaft.{side}.1.to_mesh": (-43.0, 20.0, 4.0),
    "shaft.{side}.2": (-30.0, 18.0, 2.0),
    "shaft.{side}.3": (-44.0, 14.0, 4.0),
    "shaft.{side}.strongest": (19.0, 7.0, 2.5),
    "shaft.{side}.low": (-40.0, 21.0, 2.0),
    "tooth.driver.elsewhere": (-16.0, 15.0, 1.0),
    "tooth.{side}.elsewhere": (-15.0, 15.0, 1.0),
    "tooth.{side}.peak": (-8.0, 16.0, 1.5),
    "tooth.{side}.prominence": (6.0, 3.0, 1.5),
    "tooth.{side}.second": (0.8, 1.4, 1.0),
    "tooth.{side}.kurtosis": (4.7, 1.3, 0.7),
    "tooth.{side}.centroid": (1.2, 4.0, 0.3),
    "envelope.outer": (4.7, 4.0, 1.6),
    "envelope.inner": (5.4, 3.6, 1.8),
    "envelope.cage": (4.7, 4.4, 1.8),
    "envelope.strange": (11.0, 5.4, 2.2),
    "line.half_mesh": (0.6, 3.2, 1.4),
    "line.strange": (13.0, 6.0, 2.9),
    "floor.band.2": (-9.0, 15.0, 3.0),
    "floor.band.3": (-11.0, 14.0, 1.5),
    "floor.band.4": (-23.0, 12.0, 1.0),
    "raw.level": (8.0, 9.0, 1.4),
    "raw.kurtosis": (3.3, 2.2, 1.0),
    "raw.near_the_extreme": (-47.0, 2.3, 2.2),
    "speed.drift": (-61.0, 11.0, 11.0),
    "speed.swing": (-60.0, 8.0, 3.7),
    "hum": (8.0, 6.0, 2.0),
}
"""Feature → usual value, its spread, and the usual spread of its change against a reference, in dB."""

# --------------------
# The baseline that applies the rule table of `gearsig.gap`.
# --------------------


def diagnose_rules(case: VisibleCase) -> GapReport:
    """Return the softmax of the rules' strengths as probabilities; all conditions count equally."""
    strongest: dict[str, tuple[float, str]] = {NONE: (MIN_STRENGTH, "")}
    deviations_of = list(_deviations(case))
    for cause, signs in textbook_rules(map(as_gap_effect, effects().values())):
        by_side = [rule_strengths(signs, deviations) for deviations in deviations_of]
        for side in by_side[0]:
            strength = float(np.mean([strengths[side] for strengths in by_side]))
            if strength > strongest.get(cause, (-np.inf, ""))[0]:
                strongest[cause] = strength, side
    weights = {cause: float(np.exp(strength)) for cause, (strength, _) in strongest.items()}
    total = sum(weights.values())
    options = {cause: {"gear": side} for cause, (_, side) in strongest.items() if side}
    return bare_report("rules", {cause: weight / total for cause, weight in weights.items()}, options)


def _deviations(case: VisibleCase) -> Iterator[dict[str, float]]:
    """Yield, for each condition, the deviation of every feature of the table from its usual value, in spreads."""
    for i, recording in enumerate(case.reduced):
        values = dict(zip(*feature_values(recording), strict=True))
        before = (
            dict(zip(*feature_values(case.reduced_references[i]), strict=True)) if case.reduced_references else None
        )
        deviations = dict.fromkeys(values, 0.0)  # usual values are known only for features of the table
        for name, (usual, spread, change) in USUAL.items():
            for side in SIDES:
                feature = name.format(side=side)
                value = values[feature]
                deviations[feature] = (value - usual) / spread if before is None else (value - before[feature]) / change
        yield deviations


DIAGNOSERS: dict[str, Diagnoser] = {
    GAP: diagnose,
    FOREST: diagnose_forest,
    MAJORITY: diagnose_majority,
    RULES: diagnose_rules,
    GAP_UNSEEN: unseen(diagnose),
    FOREST_UNSEEN: unseen(diagnose_forest),
    START_STOP: diagnose_drive,
}
"""Diagnosers that `gearsig benchmark gap` knows by name."""
