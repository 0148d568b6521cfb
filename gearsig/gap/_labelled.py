"""Labelled recordings of the rig under diagnosis: the changes they show, and the evidence they add."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from hashlib import sha256
from math import log
from pathlib import Path

import numpy as np

from gearsig.cache import keep, read_arrays
from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap._change import as_mounted, change_features, difference_features
from gearsig.gap._classifier import Learned, clipped_discriminant_input
from gearsig.gap._conditions import Condition, HealthyReference, facts_of, matching_reference, read_healthy, simulated
from gearsig.gap._features import Features
from gearsig.gap._reduction import reduce_recording
from gearsig.gap._report import shares_of
from gearsig.gap._simulator import OperatingCondition, Twin
from gearsig.gap._trials import features_digest
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording


@dataclass(frozen=True)
class LabelledRecording:
    """A recording of the rig, or of your own simulation of it, whose cause is known.

    Parameters
    ----------
    recording : Recording
        Carries its rig, with speed and torque.
    effect : str
        Name of an effect, "none" (healthy), or a name of your own, which becomes a separate class.
    reference : Recording or None
        The same rig when healthy; None: the diagnosis's own reference at the same speed and torque, if any.
    """

    recording: Recording
    effect: str
    reference: Recording | None = None


# --------------------
# Their changes, computed as for the diagnosed recordings, and kept on disk by content.
# --------------------


@dataclass(frozen=True)
class LabelledChange:
    """The change in a labelled recording.

    Parameters
    ----------
    label : str
    point : OperatingCondition
    changes : mapping
        Against a healthy reference (True) and against the twin (False), as far as available.
    key : str
        Key under which it is kept on disk.
    """

    label: str
    point: OperatingCondition
    changes: Mapping[bool, Features]
    key: str


MAX_BYTES = 10_000_000
"""Limit of kept changes; real ones have some thousand bytes."""


def labelled_changes(
    labelled: Sequence[LabelledRecording],
    references: Sequence[PreparedRecording],
    conditions: Sequence[Condition],
    twin: Twin,
    cache: Path | None,
    *,
    fresh: bool = False,
) -> tuple[list[LabelledChange], list[str]]:
    """Return the change of each labelled recording, and messages about those left out.

    Parameters
    ----------
    labelled : sequence of LabelledRecording
    references : sequence of PreparedRecording
        Those of the diagnosis, for labelled recordings without a reference.
    conditions : sequence of Condition
        Conditions under diagnosis: labelled recordings are compared in the same ways, on the same channels.
    twin : Twin
    cache : Path or None
        Folder that keeps results by the content of the files; None: nothing is kept.
    fresh : bool
        Compute again what the folder holds.
    """
    ways = sorted({c.has_reference for c in conditions})
    channels = tuple(conditions[0].now.channels)
    shared = [read_healthy(recording)[0] for recording in references]
    changes_of_labels, messages = list[LabelledChange](), list[str]()
    for recording in labelled:
        try:
            changes_of_labels.append(
                _change(recording, shared, ways, channels, conditions[0].learned, twin, None if fresh else cache)
            )
        except RefusalError as refusal:
            messages.append(f"{recording.recording.name}: {refusal.reason}; this labelled recording is left out.")
    if cache is not None:
        for change in changes_of_labels:
            _keep(change, cache)
    return changes_of_labels, messages


def _change(
    labelled: LabelledRecording,
    shared: Sequence[HealthyReference],
    ways: Sequence[bool],
    channels: Sequence[str],
    learned: Learned,
    twin: Twin,
    cache: Path | None,
) -> LabelledChange:
    prepared = PreparedRecording(labelled.recording)
    key = _key(labelled, shared, ways, channels, twin)
    kept = None if cache is None else _read_kept(cache, key, labelled.effect)
    if kept is not None:
        return kept
    now = reduce_recording(prepared)
    # The diagnosed recordings' channels, or all of its own where it has none of them.
    now = now.of_channels([name for name in channels if name in now.channels] or now.channels)
    facts = facts_of(prepared, now, twin)
    healthy = list(shared) if labelled.reference is None else [read_healthy(PreparedRecording(labelled.reference))[0]]
    match, why = matching_reference(now, prepared.rig, healthy)
    changes: dict[bool, Features] = {}
    if True in ways and match is not None:
        with_both = now.of_channels(match.reduced.channels)
        changes[True] = change_features(with_both, as_mounted(with_both, match.reduced)[0])
    if False in ways:
        changes[False] = difference_features(now, simulated(twin, facts, now), learned.credibility)
    if not changes:
        reason = why or "it has no healthy reference, and the diagnosis compares with one"
        raise RefusalError(reason, remedy="name its reference in the table")
    return LabelledChange(labelled.effect, facts.point, changes, key)


def _key(
    labelled: LabelledRecording,
    shared: Sequence[HealthyReference],
    ways: Sequence[bool],
    channels: Sequence[str],
    twin: Twin,
) -> str:
    digest = sha256(repr((ways, tuple(channels), features_digest(), twin.key if False in ways else "")).encode())
    healthy = [labelled.reference] if labelled.reference is not None else [s.recording.recording for s in shared]
    for recording in (labelled.recording, *healthy):
        digest.update(np.ascontiguousarray(recording.samples).tobytes())
        rig = recording.rig and recording.rig.key()
        digest.update(repr((recording.sampling_rate_hz, recording.channels, rig)).encode())
    return digest.hexdigest()[:32]


def _path(folder: Path, key: str) -> Path:
    return folder / f"labelled-{key}.npz"


def _keep(change: LabelledChange, folder: Path) -> None:
    arrays = {"point": np.array([change.point.speed_rpm, change.point.torque_nm])}
    for way, features in change.changes.items():
        arrays |= {f"names{way:d}": np.array(features.names), f"values{way:d}": features.values}
        arrays |= {f"scatter{way:d}": features.scatter}
    keep(_path(folder, change.key), lambda file: np.savez(file, allow_pickle=False, **arrays))


def _read_kept(folder: Path, key: str, label: str) -> LabelledChange | None:
    arrays = read_arrays(_path(folder, key), MAX_BYTES)
    if arrays is None:
        return None
    try:
        changes = {
            way: Features(tuple(map(str, arrays[f"names{way:d}"])), arrays[f"values{way:d}"], arrays[f"scatter{way:d}"])
            for way in (False, True)
            if f"names{way:d}" in arrays
        }
        return LabelledChange(label, OperatingCondition(*map(float, arrays["point"])), changes, key)
    except (KeyError, TypeError, ValueError, InputError):
        return None


# --------------------
# The evidence they add.
# --------------------


WEIGHT = 0.2
"""Weight of a log-likelihood ratio, whose directions are not independent. On a simulator left out, the log loss with
two labelled recordings of each effect is 0.89, 0.81 and 0.92 for weights of 0.1, 0.2 and 0.4 (58 cases), and 1.21
without them."""


def labelled_support(log_ratios: FloatArray) -> float:
    """Return ln of the mean of r^w over a label's recordings, which the nearest of them dominates.

    They are kept separate, since one effect at two places, or with two severities, resembles neither on average.
    """
    weighted_logs = WEIGHT * log_ratios
    return float(np.logaddexp.reduce(weighted_logs)) - log(len(weighted_logs))


MAX_SPEED_RATIO = 1.25
"""Ratio of speeds within which recordings of a label are preferred."""


@dataclass(frozen=True)
class LabelledEvidence:
    """The evidence from labelled recordings on those under diagnosis.

    Parameters
    ----------
    counts : mapping
        Label → number of recordings.
    ratios : mapping
        Label → `labelled_support`, mean over the operating conditions.
    alike : mapping
        Label outside the learned population → agreement of recognition between both kinds of recordings, 0 to 1.
    """

    counts: Mapping[str, int]
    ratios: Mapping[str, float]
    alike: Mapping[str, float]


def labelled_evidence(conditions: Sequence[Condition], labelled: Sequence[LabelledChange]) -> LabelledEvidence:
    """Return the evidence from labelled recordings on the conditions, see `LabelSpace`."""
    labels = list(dict.fromkeys(change.label for change in labelled))
    ratios: dict[str, list[float]] = {label: [] for label in labels}
    alike: dict[str, list[float]] = {}
    for condition in conditions:
        way, classifier, load = condition.has_reference, condition.classifier, condition.tooth_load_n_per_mm
        row = clipped_discriminant_input(classifier.input_row(condition.change, load))
        unlabelled = classifier.probabilities(condition.change, load)
        for label in labels:
            of_label = [change for change in labelled if change.label == label and way in change.changes]
            near = [change for change in of_label if _speed_ratio(change, condition) <= MAX_SPEED_RATIO] or of_label
            if not near:
                continue
            rows = np.array(
                [clipped_discriminant_input(classifier.input_row(change.changes[way], load)) for change in near]
            )
            ratios[label].append(labelled_support(classifier.labels.log_ratios(row, rows, label)))
            if label not in classifier.causes:
                near_probabilities = [classifier.probabilities(change.changes[way], load) for change in near]
                mean = {name: float(np.mean([p[name] for p in near_probabilities])) for name in unlabelled}
                alike.setdefault(label, []).append(sum(min(unlabelled[name], mean[name]) for name in unlabelled))
    counts = {label: sum(change.label == label for change in labelled) for label in labels}
    means = {label: float(np.mean(values)) for label, values in ratios.items() if values}
    return LabelledEvidence(counts, means, {label: float(np.mean(values)) for label, values in alike.items()})


def _speed_ratio(change: LabelledChange, condition: Condition) -> float:
    return float(np.exp(abs(log(change.point.speed_rpm / condition.facts.point.speed_rpm))))


def with_labelled(
    probabilities: Mapping[str, float], ratios: Mapping[str, float], alike: Mapping[str, float]
) -> dict[str, float]:
    """Return the probabilities updated with labelled recordings, most probable first: p_c ∝ p_c exp(s_c).

    A label outside the learned population enters with p = max_c p_c times the agreement of recognition's
    probabilities between the recording and those with that label.

    Parameters
    ----------
    probabilities : mapping
        Cause → probability.
    ratios : mapping
        Label → s, see `labelled_support`.
    alike : mapping
        Label outside the learned population → agreement, 0 to 1.
    """
    top = max(probabilities.values())
    prior = dict(probabilities) | {name: top * share for name, share in alike.items()}
    return shares_of({name: log(max(p, 1e-9)) + ratios.get(name, 0.0) for name, p in prior.items()})
