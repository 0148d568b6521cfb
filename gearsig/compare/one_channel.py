"""One channel of the simulation beside one of the recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gearsig.angle.types import AngleSignal
from gearsig.checks import FloatArray
from gearsig.compare.agreement import agreement, correlation, reliability, repeated, tooth_levels
from gearsig.compare.averages import HalvedLines, waveform
from gearsig.compare.bands import band_powers, order_band_limits, order_bands, third_octaves
from gearsig.compare.channels import ChannelPair
from gearsig.compare.levels import power_levels
from gearsig.compare.lines import line_levels, other_lines
from gearsig.compare.machine import teeth_on
from gearsig.compare.side import Side, time_halves
from gearsig.compare.types import ChannelComparison, Locked, Repeated, ShaftComparison
from gearsig.orders.spectrum import order_spectrum
from gearsig.orders.types import SynchronousAverage
from gearsig.rig.types import Rig
from gearsig.spectra.types import Spectrum

ERROR_WINDOW_REV = 1.0 / 64.0
"""Angle over which the scatter of an average is taken from its two halves."""

HalvedSpectra = Mapping[str, tuple[Spectrum, Spectrum]]
"""Mean square per line over order, by channel: of the first and of the second half."""


@dataclass(frozen=True)
class Material:
    """What all channels share.

    Parameters
    ----------
    rig : Rig
    reference : str
    ratios : dict
        Shaft → revolutions per revolution of the reference shaft, which comes first.
    lines : dict
        Shaft → aligned lines of the simulation and of the recording.
    revolutions_per_block : int
    highest_order : float
    """

    rig: Rig
    reference: str
    ratios: dict[str, float]
    lines: dict[str, tuple[HalvedLines, HalvedLines]]
    revolutions_per_block: int
    highest_order: float

    @property
    def mesh(self) -> tuple[float | None, str]:
        """Order and name of the first pair whose teeth are known and whose mesh both records hold."""
        for pair in self.rig.pairs:
            order = self.rig.mesh_order(pair, self.reference)
            if order is not None and 1.5 * order <= self.highest_order:
                return order, pair.name if len(self.rig.pairs) > 1 else ""
        return None, ""


def halved_spectra(halves: tuple[AngleSignal, AngleSignal], material: Material) -> HalvedSpectra:
    """Return the order spectra of both halves, by channel, up to the order that both records hold."""
    found = {}
    for name in halves[0].channel_names:
        spectra = [
            order_spectrum(half, name, scaling="power", revolutions_per_block=material.revolutions_per_block)
            for half in halves
        ]
        n = int(material.highest_order * material.revolutions_per_block) + 1
        first, second = (replace(s, values=s.values[:n], positions=s.positions[:n]) for s in spectra)
        found[name] = (first, second)
    return found


def compare_channel(
    i: int, pair: ChannelPair, own: Side, other: Side, spectra: Sequence[HalvedSpectra], material: Material
) -> ChannelComparison:
    """Compare one pair of channels, the i-th of both sides."""
    simulated, recorded = spectra[0][pair.simulated], spectra[1][pair.recorded]
    densities = [tuple(_density(half) for half in halves) for halves in (simulated, recorded)]
    mesh, mesh_name = material.mesh
    limits = order_band_limits(mesh, mesh_name, material.highest_order)
    whole = [(0.5, material.highest_order)]
    totals = [np.stack([band_powers(half, whole) for half in halves]) for halves in densities]
    averages = material.lines
    return ChannelComparison(
        simulated_name=pair.simulated,
        recorded_name=pair.recorded,
        quantity=pair.quantity,
        unit=pair.unit,
        levels_compare=pair.levels_compare,
        simulated_spectrum=_amplitudes(simulated, pair.simulated, pair.unit),
        recorded_spectrum=_amplitudes(recorded, pair.recorded, pair.unit),
        lines=line_levels(
            material.rig,
            material.reference,
            {shaft: lines[0] for shaft, lines in averages.items()},
            {shaft: lines[1] for shaft, lines in averages.items()},
            i,
        ),
        other_lines=other_lines(
            simulated, recorded, tuple(material.ratios.values()), _meshes(material), material.highest_order
        ),
        order_bands=order_bands(limits, densities[0], densities[1], averages[material.reference], i),
        third_octaves=third_octaves(
            time_halves(own.recording, i),
            own.recording.sampling_rate_hz,
            time_halves(other.recording, i),
            other.recording.sampling_rate_hz,
        ),
        shafts=tuple(_shaft(shaft, i, pair, material) for shaft in averages),
        overall=power_levels(totals[0], totals[1])[0],
        locked=Locked(*(_locked(side, i, totals[side][:, 0], material) for side in (0, 1))),
    )


def _meshes(material: Material) -> tuple[float, ...]:
    orders = (material.rig.mesh_order(pair, material.reference) for pair in material.rig.pairs)
    return tuple(order for order in orders if order is not None)


def _density(power: Spectrum) -> Spectrum:
    """Return mean squares per line as a density over order, whose integral is the mean square."""
    return replace(power, values=power.values / power.noise_bandwidth, scaling="power density")


def _amplitudes(halves: tuple[Spectrum, Spectrum], name: str, unit: str) -> Spectrum:
    mean = 0.5 * (halves[0].values + halves[1].values)
    return replace(halves[0], values=np.sqrt(mean), scaling="amplitude rms", unit=unit, source=name)


def _shaft(shaft: str, i: int, pair: ChannelPair, material: Material) -> ShaftComparison:
    own, other = material.lines[shaft]
    every = slice(1, own.first.shape[1])
    teeth = teeth_on(material.rig, shaft)
    n_angles = _n_angles(own.first.shape[1])
    resolved = teeth is not None and own.first.shape[1] > teeth
    return ShaftComparison(
        shaft=shaft,
        n_teeth=teeth,
        simulated=_average(own, i, n_angles, shaft, pair.simulated, pair.unit),
        recorded=_average(other, i, n_angles, shaft, pair.recorded, pair.unit),
        correlation=repeated(correlation, own, other, i, every),
        simulated_reliability=reliability(own, i),
        recorded_reliability=reliability(other, i),
        agreement=agreement(own, other, i, every),
        tooth_levels=tooth_levels(own, other, i, teeth, n_angles) if teeth is not None and resolved else (),
    )


def _n_angles(n_lines: int) -> int:
    """Angles of an average: enough for its highest order, and some more, so that its peaks are drawn as they are."""
    from scipy.fft import next_fast_len

    return int(next_fast_len(max(4 * n_lines, 360), real=True) // 2 * 2)


def _average(lines: HalvedLines, i: int, n_angles: int, shaft: str, channel: str, unit: str) -> SynchronousAverage:
    difference = waveform(0.5 * (lines.first[i] - lines.second[i]), n_angles)
    return SynchronousAverage(
        values=waveform(lines.whole[i], n_angles),
        standard_error=_running_rms(difference, max(1, round(ERROR_WINDOW_REV * n_angles))),
        n_revolutions=lines.n_revolutions,
        shaft=shaft,
        channel=channel,
        unit=unit,
        kind="average",
        highest_order=float(lines.first.shape[1] - 1),
    )


def _running_rms(values: FloatArray, n: int) -> FloatArray:
    """Rms over n neighbours around the circle."""
    around = np.concatenate([values[-n:], values, values[:n]]) ** 2
    smooth = np.convolve(around, np.ones(n) / n, mode="same")[n : n + len(values)]
    result: FloatArray = np.sqrt(np.maximum(smooth, 0.0))
    return result


def _locked(side: int, i: int, totals: FloatArray, material: Material) -> Repeated:
    """Return the share of energy that both halves have in common, line by line: Σ Re(a b*) over the mean square.

    The noise of one half has nothing to do with that of the other, and adds nothing. An order of several shafts
    counts once.
    """
    counted: set[float] = set()
    powers = np.zeros(3)
    for shaft, pair in material.lines.items():
        lines, ratio = pair[side], material.ratios[shaft]
        n = np.arange(1, lines.first.shape[1])
        orders = np.round(n * ratio, 6)
        fresh = n[[order not in counted and order <= material.highest_order for order in orders]]
        counted |= set(orders.tolist())
        a, b = lines.first[i, fresh], lines.second[i, fresh]
        powers += [np.sum(np.real(a * np.conj(b))), np.sum(np.abs(a) ** 2), np.sum(np.abs(b) ** 2)]
    mean = float(totals.mean())
    if mean <= 0:
        return Repeated(0.0, 0.0)
    shares = np.clip(powers[1:] / np.maximum(totals, 1e-300), 0.0, 1.0)
    return Repeated(float(np.clip(powers[0] / mean, 0.0, 1.0)), float(abs(shares[0] - shares[1])) / 2.0)
