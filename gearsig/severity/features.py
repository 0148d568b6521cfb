"""The numbers that the depth of a crack is read from: ratios in which gains and smooth paths cancel."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gearsig.checks import FloatArray
from gearsig.severity.event import ToothEvent, without_regular_lines
from gearsig.severity.shaft_lines import ShaftLines

FEATURES = (
    "band_excess",
    "line_excess",
    "prominence",
    "pattern_excess",
    "event_slope",
    "mesh_slope",
    "event_spread",
    "mesh_spread",
    "log_load",
    "log_teeth",
    "log_other_teeth",
    "log_mesh_hz",
    "log_module",
    "relief_share",
    "relief_share_squared",
)
"""Order of the entries of a feature vector; see `feature_vector`."""

SHAPED = ("band_excess", "line_excess", "prominence")
"""Features that the depth is read from, by curves that never fall."""

RISING = (*SHAPED, "pattern_excess")
"""Features that a deeper crack raises, all else the same. The last one serves to detect only: how much teeth differ
from birth must not decide on a depth."""

RELIEF = ("relief_share", "relief_share_squared")
"""Of the models that know the tip relief only; 0 where it is not known."""

MOST_RELIEF_SHARE = 2.0
"""Beyond, the tips never touch: more relief changes nothing."""

STIFFNESS_N_PER_MM_UM = 14.0
"""Usual stiffness of a pair of steel gears per face width: by this, teeth yield load × module / 14."""

GATE_PITCHES = 4.0
_SUB_BANDS = 4
"""Per mesh harmonic."""
_LEAST_SHARE = 0.1
"""What is left of an energy at least when the background's is taken off: a logarithm follows."""
_N_OTHER_GATES = 6
_MESH_WEIGHT = 0.25


@dataclass(frozen=True)
class Conditions:
    """What the rig file says of the gear with the event.

    Parameters
    ----------
    module_mm : float
    load_mpa : float
        Tangential force per face width and module.
    mesh_hz : float
    tip_relief_um : float or None
        Metal taken off at the tips of either gear; None: not known.
    """

    module_mm: float
    load_mpa: float
    mesh_hz: float
    tip_relief_um: float | None = None

    @property
    def relief_share(self) -> float:
        """Tip relief over what the teeth yield under the load, at most 2; 0 where the relief is not known."""
        yield_um = self.load_mpa * self.module_mm / STIFFNESS_N_PER_MM_UM
        return min((self.tip_relief_um or 0.0) / yield_um, MOST_RELIEF_SHARE)


def feature_vector(
    shaft: ShaftLines, sound: ShaftLines, mesh: FloatArray, event: ToothEvent, conditions: Conditions
) -> FloatArray:
    """Return the features in the order of `FEATURES`.

    - band_excess: ln of the event's energy in the band about a mesh harmonic over that harmonic's energy; mean over
      bands and channels, strong harmonics weighing more.
    - line_excess: ln of the spectrum of the event by itself (gated, four pitches) over mesh energies interpolated
      between harmonics; mean over quarter bands. A resonance counts in few of them.
    - prominence: ln of the event's energy over that at the other teeth.
    - pattern_excess: ln of the event's energy over that by which all teeth differ (on the sound gear, where there is a
      reference); mean over bands and channels. What resonances multiply cancels entirely.
    - event_slope, mesh_slope: change of the logarithms per mesh harmonic; event_spread, mesh_spread: their standard
      deviations over the bands.
    - relief_share: tip relief over the teeth's deflection, see `Conditions`; it decides how strong the mesh is that the
      event is compared with.
    - the rest are logarithms of what the rig file and the speed say.

    Parameters
    ----------
    shaft : ShaftLines
        Whose event it is: the average itself, or its difference from a sound gear's.
    sound : ShaftLines
        The reference's average, or the average itself.
    mesh : array, (n_harmonics, n_channels)
        Energies of the mesh lines.
    event : ToothEvent
    conditions : Conditions
    """
    excess, weights = _band_excess(event, mesh)
    positions, event_levels = _gated_levels(shaft, event, len(mesh))
    mesh_levels = np.log(mesh)
    harmonics = np.arange(1, len(mesh) + 1)
    between = np.stack([np.interp(positions, harmonics, column) for column in mesh_levels.T], axis=1)
    return np.array(
        [
            float(np.sum(weights * excess) / np.sum(weights)),
            float(np.mean(event_levels - between)),
            np.log(event.prominence),
            float(np.mean(np.log(_event_energy(event) / _pattern_energies(sound, len(mesh))))),
            np.polyfit(positions, event_levels.mean(axis=1), 1)[0],
            np.polyfit(harmonics, mesh_levels.mean(axis=1), 1)[0],
            event_levels.std(axis=0).mean(),
            mesh_levels.std(axis=0).mean(),
            np.log(conditions.load_mpa),
            np.log(shaft.teeth),
            np.log(shaft.other_teeth),
            np.log(conditions.mesh_hz),
            np.log(conditions.module_mm),
            conditions.relief_share,
            conditions.relief_share**2,
        ]
    )


def mesh_energies(shaft: ShaftLines, n_harmonics: int) -> FloatArray:
    """Return |x[kz]|² for k = 1 …, (n_harmonics, n_channels)."""
    energies: FloatArray = np.abs(shaft.lines[:, shaft.teeth * np.arange(1, n_harmonics + 1)].T) ** 2
    return energies


def _band_excess(event: ToothEvent, mesh: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return ln(event/mesh) of each band and channel, and weights that no gain of a channel changes."""
    return np.log(_event_energy(event) / mesh), (mesh / mesh.max(axis=0)) ** _MESH_WEIGHT


def _event_energy(event: ToothEvent) -> FloatArray:
    """Return the mean square in the window that is the event's, (n_harmonics, n_channels)."""
    energy: FloatArray = _less_background(event.window[1:], event.background[1:])
    return energy


def _pattern_energies(sound: ShaftLines, n_harmonics: int) -> FloatArray:
    """Return the mean square envelope over all teeth of each band, (n_harmonics, n_channels)."""
    z, lines = sound.teeth, without_regular_lines(sound)
    bands = [lines[:, k * z - z // 2 : k * z + z // 2 + 1] for k in range(1, n_harmonics + 1)]
    return np.array([np.sum(np.abs(band) ** 2, axis=1) for band in bands])


def _gated_levels(shaft: ShaftLines, event: ToothEvent, n_harmonics: int) -> tuple[FloatArray, FloatArray]:
    """Return (position in mesh harmonics, ln of mean energy per line) of quarter bands, (n,) and (n, n_channels)."""
    z = shaft.teeth
    highest = min(shaft.highest_order, round((n_harmonics + 0.5) * z))
    n = 1 << int(np.ceil(np.log2(2.2 * highest + 8)))
    lines = np.zeros((shaft.lines.shape[0], n // 2 + 1), dtype=complex)
    lines[:, : highest + 1] = without_regular_lines(shaft)[:, : highest + 1]
    signal = np.fft.irfft(lines, n, axis=1) * n / 2
    angle = (np.arange(n) / n - event.centre_rev + 0.5) % 1.0 - 0.5
    inside = np.abs(angle) * z < GATE_PITCHES / 2
    gate = np.where(inside, np.cos(np.pi * angle * z / GATE_PITCHES) ** 2, 0.0)
    energy = _energy_spectrum(signal * gate)
    elsewhere = [np.roll(gate, round((0.2 + 0.1 * i) * n)) for i in range(_N_OTHER_GATES)]
    background = np.median([_energy_spectrum(signal * g) for g in elsewhere], axis=0)
    edges = np.arange(_SUB_BANDS // 2, round((n_harmonics + 0.5) * _SUB_BANDS) + 1)
    positions = (edges[:-1] + 0.5) / _SUB_BANDS
    limits = (edges * z) // _SUB_BANDS
    means = [
        _less_background(energy[:, i:j].mean(axis=1), background[:, i:j].mean(axis=1)) for i, j in pairwise(limits)
    ]
    return positions, np.log(np.array(means) * z)


def _energy_spectrum(signal: FloatArray) -> FloatArray:
    energy: FloatArray = np.abs(np.fft.rfft(signal, axis=1)) ** 2 * (2.0 / signal.shape[1]) ** 2
    return energy


def _less_background(energy: FloatArray, background: FloatArray) -> FloatArray:
    left: FloatArray = np.maximum(energy - background, _LEAST_SHARE * energy)
    return left
