"""Whether what was seen is a crack, or a chipped or spalled tooth."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError
from gearsig.severity.features import FEATURES, RELIEF
from gearsig.severity.shape import SHAPE

CRACKED, CHIPPED, SPALLED = KINDS = ("cracked", "chipped", "spalled")

_OF_SIZE = ("band_excess", "line_excess", "prominence", "pattern_excess")
"""How large the event is and how far it stands out: a deep crack is no chip for being large."""

_USED = [i for i, name in enumerate(FEATURES) if name not in (*RELIEF, *_OF_SIZE)]
KIND_FEATURES = (*(FEATURES[i] for i in _USED), *SHAPE)


def kind_vector(features: FloatArray, shape: FloatArray) -> FloatArray:
    """Return what the kind is read from, in the order of `KIND_FEATURES`."""
    vector: FloatArray = np.concatenate([np.asarray(features)[_USED], shape])
    return vector


@dataclass(frozen=True)
class KindModel:
    """p_k = exp(b_k + Σ w_ki z_i)/Σ_j exp(b_j + …), z = (f − m)/s held within ±4: what is further says no more.

    Parameters
    ----------
    mean, scale : arrays, (n_features,)
        m and s.
    weights : array, (3, n_features + 1)
        b_k before w_ki, in the order of `KINDS`. As many cracks as chips and spalls together, whatever the depths.
    """

    mean: FloatArray
    scale: FloatArray
    weights: FloatArray

    def __post_init__(self) -> None:
        n = len(KIND_FEATURES)
        for name, shape in (("mean", (n,)), ("scale", (n,)), ("weights", (len(KINDS), n + 1))):
            array = frozen_array(getattr(self, name), f"{name} of the kind's model", ndim=len(shape))
            if array.shape != shape:
                raise InputError(f"{name} of the kind's model has shape {array.shape}", allowed=str(shape))
            object.__setattr__(self, name, array)

    @classmethod
    def from_mapping(cls, values: Mapping[str, Any]) -> KindModel:
        """Build it from what a JSON file holds."""
        return cls(*(np.asarray(values[name], dtype=np.float64) for name in ("mean", "scale", "weights")))

    def probabilities(self, vector: FloatArray) -> dict[str, float]:
        """Return kind → probability."""
        z = np.clip((vector - self.mean) / self.scale, -4.0, 4.0)
        levels = self.weights[:, 0] + self.weights[:, 1:] @ z
        shares = np.exp(levels - levels.max())
        return dict(zip(KINDS, (shares / shares.sum()).tolist(), strict=True))
