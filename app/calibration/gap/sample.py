"""One recording of the population, reduced and compared, and how all of them are written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.calibration.gap.scene import rig_of
from gearsig.checks import FloatArray
from gearsig.gap.change import change_features
from gearsig.gap.features import features_of
from gearsig.gap.gather import gather
from gearsig.gap.gathered import Gathered
from gearsig.gap.tooth_load import tooth_load_n_per_mm
from gearsig.recording.types import Recording

SEED = 4107

ONE_SENSOR_SHARE = 0.4
"""Machines of which one sensor's signal is known."""

_COLUMNS = ("simulator", "rig", "label", "detail", "severity", "torque_nm", "load_n_per_mm")
_TABLES = ("change", "change_scatter", "features", "feature_scatter", "simulated", "simulated_scatter")


Names = tuple[tuple[str, ...], tuple[str, ...]]


@dataclass(frozen=True)
class Sample:
    """One recording, reduced.

    Parameters
    ----------
    simulator : str
        Of the machine.
    rig : int
    label, detail : str
        Effect, "none" or "unknown"; `BY_HAND`, options, or the foreign vibration's name.
    severity : float
    torque_nm : float
    load_n_per_mm : float
        Of the teeth.
    names : (tuple of str, tuple of str)
        Of the changes and of the features.
    change, change_scatter : arrays, (n_changes,)
        Against the sound reference.
    features, feature_scatter : arrays, (n_features,)
        Of the recording itself.
    simulated, simulated_scatter : arrays, (n_features,)
        Of the twin that knows the rig file only.
    """

    simulator: str
    rig: int
    label: str
    detail: str
    severity: float
    torque_nm: float
    load_n_per_mm: float
    names: Names
    change: FloatArray
    change_scatter: FloatArray
    features: FloatArray
    feature_scatter: FloatArray
    simulated: FloatArray
    simulated_scatter: FloatArray


@dataclass(frozen=True)
class Compared:
    """What a machine's recordings are compared with.

    Parameters
    ----------
    simulator : str
        Of the machine.
    rig : int
    sound, simulated : Gathered
        The reference, and the twin that knows the rig file only.
    """

    simulator: str
    rig: int
    sound: Gathered
    simulated: Gathered

    def sample(self, label: str, detail: str, severity: float, recording: Recording, torque_nm: float) -> Sample:
        """Return a recording's row."""
        now = reduced(recording, self.rig)
        change, own, twin = change_features(now, self.sound), features_of(now), features_of(self.simulated)
        return Sample(
            self.simulator,
            self.rig,
            label,
            detail,
            severity,
            torque_nm,
            tooth_load_n_per_mm(now.frame.pair, torque_nm),
            (change.names, own.names),
            change.values,
            change.scatter,
            own.values,
            own.scatter,
            twin.values,
            twin.scatter,
        )


def reduced(recording: Recording, rig: int) -> Gathered:
    """Return a recording's sums, with the channels that are known of its machine."""
    found = gather(recording, rig_of(recording))
    draw = np.random.default_rng([SEED, rig, 1])
    if draw.uniform() >= ONE_SENSOR_SHARE:
        return found
    name = str(draw.choice(sorted(found.channels)))
    return found.with_channels({name: found.channels[name]})


def write(path: Path, samples: Sequence[Sample]) -> None:
    """Write the table as arrays of numbers and text."""
    rows = {key: np.array([getattr(s, key) for s in samples]) for key in _COLUMNS}
    tables = {key: np.array([getattr(s, key) for s in samples], dtype=np.float32) for key in _TABLES}
    changes, features = samples[0].names
    part = path.with_suffix(".part.npz")
    np.savez_compressed(
        part,
        allow_pickle=False,
        change_names=np.array(changes),
        feature_names=np.array(features),
        **rows,
        **tables,
    )
    part.replace(path)
