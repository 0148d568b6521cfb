"""Whether all channels changed alike: the excitation did, or one sensor's path."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from gearsig.checks import FloatArray
from gearsig.gap.frame import DRIVER
from gearsig.gap.gathered import Gathered
from gearsig.gap.gear_lines import Feature, line_power, mesh_lines, visible_orders

APART = "apart."
"""Of these features; 0 where there is one channel, which no two channels reach."""


def apart_features(now: Gathered, sound: Gathered) -> Iterator[Feature]:
    """Yield by how much the channels' changes differ from each other, rms in dB.

    What drives the gears harder is seen by every sensor, each through its own path; a sensor that was mounted anew, or
    a bearing that holds its shaft less, changes the paths, and each in its own way.
    """
    here, before = _mesh_levels(now), _mesh_levels(sound)
    n = min(here.shape[1], before.shape[1])  # the faster recording shows fewer
    yield f"{APART}mesh", _scatter(here[:, :n] - before[:, :n])
    yield f"{APART}floor", _scatter(_floor_levels(now) - _floor_levels(sound))


def _scatter(changes: FloatArray) -> float:
    """Return the rms, over all, of what the channels' mean leaves."""
    return float(np.sqrt(np.mean((changes - changes.mean(axis=0)) ** 2))) if len(changes) > 1 else 0.0


def _mesh_levels(gathered: Gathered) -> FloatArray:
    """Return the mesh harmonics' levels, (n_channels, n_harmonics), in dB."""
    teeth, rows = gathered.frame.teeth[DRIVER], []
    for sums in gathered.channels.values():
        power = line_power(sums, DRIVER)
        highest = visible_orders(gathered, DRIVER, len(power))
        rows.append(mesh_lines(power, teeth, highest))
    return _decibels(np.array(rows))


def _floor_levels(gathered: Gathered) -> FloatArray:
    """Return the residual's levels in bands, (n_channels, n_bands), in dB."""
    return _decibels(np.array([sums.moments.mean(axis=0)[:, 0] for sums in gathered.channels.values()]))


def _decibels(power: FloatArray) -> FloatArray:
    levels: FloatArray = 10.0 * np.log10(np.maximum(power, 1e-300))
    return levels
