"""The features from which the depth of a crack is estimated: ratios in which gains and smooth paths cancel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.formatting import enumerated, percent
from gearsig.prepared import PreparedRecording, best_shift, shift_scores, sliding_mean, strongest_window, turned_lines
from gearsig.rig import GearPair

MIN_REVOLUTIONS = 13
"""Of each shaft: fewer leave the other shaft's orders in the average, and the calibration has no fewer."""


@dataclass(frozen=True)
class ShaftLines:
    """The lines of a shaft's synchronous average.

    Parameters
    ----------
    shaft : str
    teeth, other_teeth : int
        Of the gear on the shaft, and of its mate.
    lines : complex array, (n_channels, n_orders)
        lines[c, n] is the complex amplitude (peak) of order n of this shaft; the mean at order 0.
    n_revolutions : int
    highest_order : int
    order_hz : float
        Mean frequency of the shaft.
    channels : tuple of str
    has_mark : bool
        Whether order phases count from a mark on this shaft.
    """

    shaft: str
    teeth: int
    other_teeth: int
    lines: NDArray[np.complex128]
    n_revolutions: int
    highest_order: int
    order_hz: float
    channels: tuple[str, ...]
    has_mark: bool = False

    def turned_about(self, names: Sequence[str]) -> ShaftLines:
        """Return the lines with those of some channels multiplied by −1."""
        return replace(self, lines=np.where(np.isin(self.channels, names)[:, None], -self.lines, self.lines))


def shaft_lines(prepared: PreparedRecording, pair: GearPair, shaft: str, channels: Sequence[str]) -> ShaftLines:
    """Return the lines of the shaft's average for each channel.

    Raises
    ------
    RefusalError
        If there are too few revolutions.
    """
    ratio = prepared.rig.ratio(shaft)
    teeth, other_teeth = pair.teeth(shaft), pair.teeth(pair.driven if shaft == pair.driver else pair.driver)
    if ratio is None or teeth is None or other_teeth is None:
        raise RefusalError("the teeth of both gears are not known", remedy="state them in the rig file")
    angle = prepared.angle_of(shaft)
    if angle.n_revolutions < MIN_REVOLUTIONS:
        raise RefusalError(
            f"the record holds {angle.n_revolutions:.3g} revolutions of shaft {shaft!r}, {MIN_REVOLUTIONS} are needed",
            remedy="record longer",
        )
    average = prepared.average_lines(shaft, channels, followed=True)  # averages of two records are compared
    return ShaftLines(
        shaft,
        teeth,
        other_teeth,
        np.asarray(average.whole, dtype=np.complex128),
        int(average.n_revolutions.sum()),
        average.highest_order,
        angle.mean_speed_rpm / 60.0,
        tuple(channels),
        prepared.has_mark(shaft),
    )


def orders_from_mesh(orders: NDArray[np.intp], teeth: int) -> NDArray[np.intp]:
    """Return the distance in shaft orders from each order to the nearest mesh harmonic, min_k |n − k z|.

    Parameters
    ----------
    orders : array of int
        n, per revolution of the shaft.
    teeth : int
        z, of the shaft's gear.
    """
    distance: NDArray[np.intp] = np.abs((orders + teeth // 2) % teeth - teeth // 2)
    return distance


MAX_BANDS = 10
"""One band about each mesh harmonic. A band's ratio to its mesh line scatters by some 8 dB, because the line is a
single number that depends on tip relief and resonances: many bands average this out."""

WINDOW_PITCHES = 1.5
"""A tooth is in mesh for as long as the contact ratio says, and the response rings on a little."""

_SIDEBANDS = 2
"""Lines this close to a mesh harmonic are run-out, not a tooth."""

_LOWEST_ORDER = 4
"""Orders below are unbalance, misalignment and run-out."""

_STEPS_PER_TOOTH = 32


@dataclass(frozen=True)
class ToothEvent:
    """The window with the most energy.

    Parameters
    ----------
    centre_rev : float
        Middle of the window, 0 to 1.
    prominence : float
        Its energy over the median window's, averaged over bands and channels; 1: nothing stands out.
    window, background : arrays, (n_bands, n_channels)
        Mean square envelope of each band in the window and in the median window. Band 0 lies below the first mesh
        harmonic, band k about the k-th.
    """

    centre_rev: float
    prominence: float
    window: FloatArray
    background: FloatArray


def n_bands(shaft: ShaftLines) -> int:
    """Return the number of mesh harmonics with a whole band below the highest order, at most 10."""
    return min(MAX_BANDS, int((shaft.highest_order - shaft.teeth // 2) / shaft.teeth))


def find_event(shaft: ShaftLines) -> ToothEvent:
    """Find the window of 1.5 tooth pitches with the most energy.

    Each band's mean square envelope is divided by its median over the revolution before bands and channels are added,
    since a resonance or a gain multiplies all teeth alike.

    Parameters
    ----------
    shaft : ShaftLines
        Of a recording, or of its difference from the healthy machine.

    Returns
    -------
    ToothEvent
        Its centre in revolutions from angle zero, 0 to 1; its prominence, a ratio of energies.
    """
    energy, median, width = _window_energies(shaft)
    start, prominence = strongest_window(_over_bands(energy, median))
    return ToothEvent(
        centre_rev=float((start + width / 2) / energy.shape[-1] % 1.0),
        prominence=prominence,
        window=energy[:, :, start],
        background=median,
    )


def event_windows(shaft: ShaftLines, event: ToothEvent) -> tuple[FloatArray, FloatArray]:
    """Return each band's mean square envelope in the event's and in the median window, (n_bands + 1, n_channels)."""
    energy, median, width = _window_energies(shaft)
    n = energy.shape[-1]
    return energy[:, :, round(event.centre_rev * n - width / 2) % n], median


def search_levels(shaft: ShaftLines) -> tuple[FloatArray, FloatArray]:
    """Return what `find_event` searches: centres of the windows in revolutions, 0 to 1, ascending, and levels in dB.

    A level is the window's energy over the median window's, where energies are relative to their band's median and
    averaged over bands and channels. The highest level is the event's prominence.
    """
    energy, median, width = _window_energies(shaft)
    level = _over_bands(energy, median)
    middles = (np.arange(len(level)) + width / 2.0) / len(level) % 1.0
    order = np.argsort(middles, kind="stable")
    return middles[order], 10.0 * np.log10(level[order] / np.median(level))


def _window_energies(shaft: ShaftLines) -> tuple[FloatArray, FloatArray, int]:
    """Return the mean square envelope in the window that starts at each angle, its median, and the window's width."""
    envelopes = band_envelopes(shaft)
    width = round(WINDOW_PITCHES * envelopes.shape[-1] / shaft.teeth)
    energy = sliding_mean(envelopes, width)
    return energy, np.median(energy, axis=-1), width


def _over_bands(energy: FloatArray, median: FloatArray) -> FloatArray:
    """Return the energy at each angle relative to its band's median, averaged over bands and channels."""
    relative = np.divide(energy, median[..., None], out=np.ones_like(energy), where=median[..., None] > 0)
    mean: FloatArray = relative.mean(axis=(0, 1))
    return mean


def band_envelopes(shaft: ShaftLines) -> FloatArray:
    """Return squared envelopes over one revolution, in bands one mesh order wide.

    e_k(θ) = |Σ_n x[kz + n] e^{2πi nθ}|², |n| <= z/2, without mesh lines, their nearest sidebands and the lowest orders.

    Parameters
    ----------
    shaft : ShaftLines
        x, and z teeth.

    Returns
    -------
    array, (n_bands + 1, n_channels, 32 z)
        In the square of the lines' unit, at equal steps of the shaft's angle; band 0 lies below half the mesh order.
    """
    z = shaft.teeth
    n = _STEPS_PER_TOOTH * z
    lines = without_regular_lines(shaft)
    bands = []
    for k in range(n_bands(shaft) + 1):
        orders = np.arange(max(_LOWEST_ORDER, k * z - z // 2), k * z + z // 2 + 1)
        shifted = np.zeros((len(lines), n), dtype=complex)
        shifted[:, (orders - k * z) % n] = lines[:, orders]
        bands.append(np.abs(np.fft.ifft(shifted, axis=1) * n) ** 2)
    return np.stack(bands)


def without_regular_lines(shaft: ShaftLines) -> np.ndarray:
    """Return the lines with those common to all teeth set to 0: shaft orders, mesh lines and nearest sidebands."""
    lines = shaft.lines.copy()
    orders = np.arange(lines.shape[1])
    z = shaft.teeth
    near_mesh = orders_from_mesh(orders, z) <= _SIDEBANDS
    lines[:, (orders < _LOWEST_ORDER) | near_mesh] = 0.0
    return lines


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

DB_OF_LOG_ENERGY = 10.0 / np.log(10.0)
IN_WORDS = {
    "band_excess": ("the event over the mesh", "dB", DB_OF_LOG_ENERGY),
    "line_excess": ("the event's spectrum over that of the mesh", "dB", DB_OF_LOG_ENERGY),
    "prominence": ("the event over the other teeth", "dB", DB_OF_LOG_ENERGY),
    "pattern_excess": ("the event over the differences between teeth", "dB", DB_OF_LOG_ENERGY),
    "event_slope": ("the event's change from one mesh harmonic to the next", "dB", DB_OF_LOG_ENERGY),
    "mesh_slope": ("the mesh's change from one harmonic to the next", "dB", DB_OF_LOG_ENERGY),
    "event_spread": ("the event's scatter about that change", "dB", DB_OF_LOG_ENERGY),
    "mesh_spread": ("the mesh's scatter about that change", "dB", DB_OF_LOG_ENERGY),
}
"""Phrase, unit, and units per one of the feature; the others come from the rig and are checked before."""

SHAPED = ("band_excess", "line_excess", "prominence")
"""Features that the depth is estimated from, by curves that never fall."""

RISING = (*SHAPED, "pattern_excess")
"""Features that a deeper crack raises, all else the same. The last one serves detection only: how much teeth differ
when new must not affect the depth."""

RELIEF = ("relief_share", "relief_share_squared")
"""Used only by the models that know the tip relief; 0 where it is unknown."""

MAX_RELIEF_SHARE = 2.0
"""Beyond this the tips never touch: more relief changes nothing."""

STIFFNESS_N_PER_MM_UM = 14.0
"""Usual stiffness of a pair of steel gears per face width: teeth deflect by load × module / 14."""

GATE_PITCHES = 4.0
_SUB_BANDS = 4
"""Per mesh harmonic."""
_MIN_SHARE = 0.1
"""Smallest share of an energy that remains after subtracting the background, because its logarithm is taken."""
_N_FURTHER_GATES = 6


@dataclass(frozen=True)
class Conditions:
    """What the rig file and the speed say of the gear with the event.

    Parameters
    ----------
    module_mm : float
    load_mpa : float
        Tangential force per face width and module.
    mesh_hz : float
    tip_relief_um : float or None
        Metal removed at the tips of each gear; None: unknown.
    """

    module_mm: float
    load_mpa: float
    mesh_hz: float
    tip_relief_um: float | None = None

    @property
    def relief_share(self) -> float:
        """Tip relief over the teeth's deflection under load, at most 2; 0 where the relief is unknown."""
        yield_um = self.load_mpa * self.module_mm / STIFFNESS_N_PER_MM_UM
        return min((self.tip_relief_um or 0.0) / yield_um, MAX_RELIEF_SHARE)


def feature_vector(
    shaft: ShaftLines, healthy: ShaftLines, mesh: FloatArray, event: ToothEvent, conditions: Conditions
) -> FloatArray:
    """Return the features in the order of `FEATURES`.

    - band_excess: ln of the event's energy in the band about a mesh harmonic over that harmonic's energy; mean over
      bands and channels, weighted towards strong harmonics.
    - line_excess: ln of the spectrum of the event alone (gated, four pitches) over mesh energies interpolated between
      harmonics; mean over quarter bands. A resonance affects few of them.
    - prominence: ln of the event's energy over that at the other teeth.
    - pattern_excess: ln of the event's energy over that by which all teeth differ (on the healthy gear, where there is
      a reference); mean over bands and channels. The effect of resonances cancels entirely.
    - event_slope, mesh_slope: change of the logarithms per mesh harmonic; event_spread, mesh_spread: their standard
      deviations over the bands.
    - relief_share: tip relief over the teeth's deflection, see `Conditions`; it sets the strength of the mesh that the
      event is compared with.
    - the rest are logarithms of data from the rig file and of the speed.

    Parameters
    ----------
    shaft : ShaftLines
        With the event: the average itself, or its difference from a healthy gear's.
    healthy : ShaftLines
        The reference's average, or the average itself.
    mesh : array, (n_harmonics, n_channels)
        Energies of the mesh lines.
    event : ToothEvent
    conditions : Conditions
    """
    energy = _less_background(event.window[1:], event.background[1:])  # (n_harmonics, n_channels)
    excess, weights = np.log(energy / mesh), (mesh / mesh.max(axis=0)) ** 0.25  # independent of a channel's gain
    positions, event_levels = _gated_levels(shaft, event, len(mesh))
    mesh_levels = np.log(mesh)
    harmonics = np.arange(1, len(mesh) + 1)
    between = np.stack([np.interp(positions, harmonics, column) for column in mesh_levels.T], axis=1)
    return np.array(
        [
            float(np.sum(weights * excess) / np.sum(weights)),
            float(np.mean(event_levels - between)),
            np.log(event.prominence),
            float(np.mean(np.log(energy / _pattern_energies(healthy, len(mesh))))),
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
    """Return the energies of the mesh harmonics, |x[kz]|² for k from 1.

    Parameters
    ----------
    shaft : ShaftLines
        x, and z teeth.
    n_harmonics : int
        Largest k.

    Returns
    -------
    array, (n_harmonics, n_channels)
        In the square of the lines' unit.
    """
    energies: FloatArray = np.abs(shaft.lines[:, shaft.teeth * np.arange(1, n_harmonics + 1)].T) ** 2
    return energies


def _pattern_energies(healthy: ShaftLines, n_harmonics: int) -> FloatArray:
    """Return the mean square envelope of each band over all teeth, (n_harmonics, n_channels)."""
    z, lines = healthy.teeth, without_regular_lines(healthy)
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
    elsewhere = [np.roll(gate, round((0.2 + 0.1 * i) * n)) for i in range(_N_FURTHER_GATES)]
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
    residual: FloatArray = np.maximum(energy - background, _MIN_SHARE * energy)
    return residual


LARGEST_SPEED_DIFFERENCE = 0.02
"""Relative, as in the calibration; beyond this, resonances amplify the two recordings differently."""

LARGEST_GAIN_CHANGE = 0.15

LARGEST_MARK_SHIFT = 0.25
"""Fraction of a tooth by which a remounted mark sensor, its trigger and the shafts' twist may shift the mesh. Ignored,
a shift of one degree, 0.1 tooth of 36, leaves more about the fourth mesh harmonic in the difference than was there."""

SLOW_ORDERS = 4
"""Shaft orders up to this one carry no information about the teeth."""


def difference_lines(now: ShaftLines, healthy: ShaftLines, *, whole_teeth: bool) -> tuple[ShaftLines, float]:
    """Return the lines of `now` minus those of the healthy gear, turned so that the same teeth coincide.

    d[n] = x[n] − r[n] e^{−2πi n s}, with the shift s that gives the largest Σ w[n] Re(x[n] r*[n] e^{2πi n s}).

    Parameters
    ----------
    now, healthy : ShaftLines
        Of the same shaft and channels.
    whole_teeth : bool
        Whether the shift is a whole number of teeth, to within `LARGEST_MARK_SHIFT`, because the mate's mark fixes the
        phase of the mesh. If both have a mark on this shaft, it is 0 to within that. Without a mark any shift is
        allowed.

    Returns
    -------
    ShaftLines
    agreement : float
        Σ w Re(…)/Σ w |…| at the shift, over the orders that distinguish teeth: 1 where the tooth patterns are the same.
        A deep crack lowers it, too.

    Raises
    ------
    RefusalError
        If the speeds differ too much.
    """
    check_same_speed(now, healthy)
    highest = min(now.highest_order, healthy.highest_order)
    x, r = now.lines[:, : highest + 1], healthy.lines[:, : highest + 1]
    orders, cross = np.arange(highest + 1), _cross_lines(now, healthy).sum(axis=0)  # over channels
    shift = best_shift(cross, _allowed_shifts(now, healthy, whole_teeth=whole_teeth))
    pattern = np.where(tooth_distinguishing_orders(orders, now.teeth), cross, 0.0)
    agreement = float(shift_scores(pattern, np.array([shift]))[0] / np.abs(pattern).sum()) if np.any(pattern) else 0.0
    turned = turned_lines(r, shift)
    return replace(now, lines=x - _matched(turned, x, now.teeth), highest_order=highest), agreement


REVERSED, NOT_REVERSED = 0.6, 0.9
"""Smallest agreement of a channel taken with reversed sign, and the largest share of it that the channel may reach with
its own sign: a fraction of a tooth reverses some mesh harmonics as well."""


def reversed_channels(now: ShaftLines, healthy: ShaftLines, *, whole_teeth: bool) -> tuple[str, ...]:
    r"""Return the channels with reversed sign: a sensor mounted on the other side, or crossed wires.

    .. math:: a_\pm = \max_s \sum_n \pm w_n \mathrm{Re}(x_n r_n^* e^{2 \pi i n s}) / \sum_n w_n |x_n r_n|

    for each channel and sign, each at its best shift s. A channel is reversed if a₋ is at least `REVERSED` and a₊ at
    most `NOT_REVERSED` times that.

    Parameters
    ----------
    now, healthy : ShaftLines
        Of the same shaft and channels.
    whole_teeth : bool
        See `difference_lines`.

    Returns
    -------
    tuple of str
        Their names. A channel dominated by one harmonic, which a fraction of a tooth reverses as well, is not included.
    """
    cross, marks = _cross_lines(now, healthy), _allowed_shifts(now, healthy, whole_teeth=whole_teeth)
    names = []
    for name, of_channel in zip(now.channels, cross, strict=True):
        size = float(np.abs(of_channel).sum())
        if not size:
            continue
        as_is, turned = (
            float(shift_scores(lines, np.array([best_shift(lines, marks)]))[0]) / size
            for lines in (of_channel, -of_channel)
        )
        if turned >= REVERSED and as_is <= NOT_REVERSED * turned:
            names.append(name)
    return tuple(names)


def reversed_text(channels: Sequence[str]) -> str:
    """Report which channels have the opposite sign to the reference, and what was done about it."""
    verb, them = ("reads", "it was") if len(channels) == 1 else ("read", "they were")
    return (
        f"{enumerated(channels)} {verb} the other way round than in the reference, as a sensor does that is mounted on "
        f"the other side or wired the other way: {them} turned about for the comparison."
    )


def _cross_lines(now: ShaftLines, healthy: ShaftLines) -> NDArray[np.complexfloating]:
    """Return x r* of each channel, strong lines by their root, at the orders that resolve parts of a tooth."""
    highest = min(now.highest_order, healthy.highest_order)
    x, r = now.lines[:, : highest + 1], healthy.lines[:, : highest + 1]
    orders = np.arange(highest + 1)
    used = (orders > SLOW_ORDERS) & (orders <= 6 * now.teeth)
    size = np.sqrt(np.abs(x) * np.abs(r))
    cross: NDArray[np.complexfloating] = np.divide(x * np.conj(r), size, out=np.zeros_like(x), where=(size > 0) & used)
    return cross


def _allowed_shifts(
    now: ShaftLines, healthy: ShaftLines, *, whole_teeth: bool
) -> Callable[[FloatArray], NDArray[np.bool_]]:
    is_marked = now.has_mark and healthy.has_mark
    return partial(_is_allowed_shift, teeth=now.teeth, whole_teeth=whole_teeth, is_marked=is_marked)


def _is_allowed_shift(shifts_rev: FloatArray, teeth: int, *, whole_teeth: bool, is_marked: bool) -> NDArray[np.bool_]:
    """Return which shifts the marks allow."""
    moved = shifts_rev * teeth
    if is_marked:
        return np.abs(moved) <= LARGEST_MARK_SHIFT
    if whole_teeth:
        return np.abs(moved - np.round(moved)) <= LARGEST_MARK_SHIFT
    return np.ones(len(moved), dtype=bool)


class ReferenceRefusalError(RefusalError):
    """The reference does not fit the recording, whatever is measured in them."""


def check_same_speed(now: ShaftLines, healthy: ShaftLines) -> None:
    """Refuse a reference at another speed.

    Raises
    ------
    ReferenceRefusalError
    """
    change = abs(now.order_hz / healthy.order_hz - 1.0)
    if change > LARGEST_SPEED_DIFFERENCE:
        rpm = tuple(60.0 * shaft.order_hz for shaft in (healthy, now))
        raise ReferenceRefusalError(
            f"the reference was taken at a speed {100 * change:.1f} % off: shaft {now.shaft!r} turns at {rpm[0]:.5g} "
            f"rpm there, at {rpm[1]:.5g} rpm in the recording",
            remedy=f"take it within {percent(LARGEST_SPEED_DIFFERENCE)} of the same speed, at the same load",
        )


def _matched(reference: np.ndarray, x: np.ndarray, teeth: int) -> np.ndarray:
    """Return the reference, each mesh harmonic's band of each channel scaled by the complex gain that best fits `x`.

    A slightly different speed or load changes amplitude and phase of the tooth pattern a little, alike within a band.
    g = Σ x r*/Σ|r|², held within `LARGEST_GAIN_CHANGE` of 1: beyond this the crack would be taken for a gain.
    """
    orders = np.arange(x.shape[1])
    used = tooth_distinguishing_orders(orders, teeth)
    fitted = reference.copy()
    for k in range(x.shape[1] // teeth + 1):
        band = (orders + teeth // 2) // teeth == k
        fit = band & used
        power = np.sum(np.abs(reference[:, fit]) ** 2, axis=1)
        product = np.sum(x[:, fit] * np.conj(reference[:, fit]), axis=1)
        change = np.divide(product, power, out=np.ones_like(product), where=power > 0) - 1.0
        change *= np.minimum(1.0, LARGEST_GAIN_CHANGE / np.maximum(np.abs(change), 1e-12))
        fitted[:, band] *= (1.0 + change)[:, None]
    return fitted


def tooth_distinguishing_orders(orders: np.ndarray, teeth: int) -> np.ndarray:
    """Return which orders distinguish teeth; shaft orders, mesh lines and their sidebands hardly do."""
    used: np.ndarray = (orders > SLOW_ORDERS) & (orders_from_mesh(orders, teeth) > 1)
    return used


SHAPE = ("lead", "tail", "duration", "kurtosis", "peak", "window_slope")
"""Order of the entries of `event_shape`."""

REACH_LEVEL = 4.0
"""An event lasts while its energy over the median tooth's exceeds this; healthy teeth reach it now and then."""

_SHAPE_STEPS_PER_TOOTH = 64
_NEAR_PITCHES = 2.5
_MAX_HARMONICS = 8
_TINY = 1e-12


def event_shape(searched: ShaftLines, event: ToothEvent) -> FloatArray:
    """Return the numbers in the order of `SHAPE`.

    - lead, tail: ln of the energy one to three pitches before and after the event over its largest.
    - duration: ln of the energy's standard deviation about its centre, in pitches; kurtosis: its ln; peak: ln of the
      largest energy density. A spall is short; a crack lasts as long as its tooth is in mesh.
    - window_slope: change of the window's ln energy per mesh harmonic.

    The event's phase relative to the mesh is left out: it identifies chips on machines like those of the calibration,
    but misleads where the mesh harmonics pass a resonance.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the healthy gear's.
    event : ToothEvent
    """
    levels = np.log(np.maximum(event.window, _TINY * event.window.max())).mean(axis=1)
    slope = float(np.polyfit(np.arange(len(levels)), levels, 1)[0])
    energy = _relative_energy(searched, event)
    middle, pitch = len(energy) // 2, round(len(energy) / searched.teeth)
    largest = energy[middle - 3 * pitch // 4 : middle + 3 * pitch // 4].max()
    before, after = energy[middle - 3 * pitch : middle - pitch], energy[middle + pitch : middle + 3 * pitch]
    around = [float(np.log(part.mean() / largest)) for part in (before, after)]
    return np.array([*around, *_log_durations(searched, event), slope])


def reach_cycles(searched: ShaftLines, event: ToothEvent) -> float:
    """Return for how many mesh cycles after its centre the event has four times the energy of a median other tooth.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the healthy gear's.
    event : ToothEvent
    """
    energy = _relative_energy(searched, event)
    after = energy[len(energy) // 2 :]
    below = np.flatnonzero(after < REACH_LEVEL)
    steps = len(energy) / searched.teeth
    return float((below[0] if len(below) else len(after)) / steps)


def _relative_energy(searched: ShaftLines, event: ToothEvent) -> FloatArray:
    """Return the energy in windows of one pitch over the median one, with the event in the middle."""
    envelopes = band_envelopes(searched)
    relative = _over_bands(envelopes, np.median(envelopes, axis=-1))
    width = round(len(relative) / searched.teeth)
    energy = sliding_mean(relative, width)
    shift = len(energy) // 2 - round(event.centre_rev * len(energy)) + width // 2
    relative_energy: FloatArray = np.roll(energy, shift) / np.median(energy)
    return relative_energy


def _log_durations(searched: ShaftLines, event: ToothEvent) -> tuple[float, float, float]:
    """Return the logarithms of width, kurtosis and peak of the energy near the event."""
    z, highest = searched.teeth, min(n_bands(searched), _MAX_HARMONICS) + 0.5
    energy = band_signal(searched, 0.5, highest, event.centre_rev) ** 2
    level = np.median(sliding_mean(energy, _SHAPE_STEPS_PER_TOOTH), axis=1)
    relative = np.divide(energy, level[:, None], out=np.zeros_like(energy), where=level[:, None] > 0).mean(axis=0)
    pitches = (np.arange(len(relative)) - len(relative) // 2) / _SHAPE_STEPS_PER_TOOTH
    near = np.abs(pitches) < min(_NEAR_PITCHES, z / 4)
    density = np.maximum(relative[near] - np.median(relative[~near]), 0.0) + _TINY
    density /= density.sum()
    off = pitches[near] - density @ pitches[near]
    variance = max(float(density @ off**2), _TINY)
    kurtosis = max(float(density @ off**4) / variance**2, _TINY)
    return 0.5 * float(np.log(variance)), float(np.log(kurtosis)), float(np.log(density.max() * _SHAPE_STEPS_PER_TOOTH))


def band_signal(searched: ShaftLines, lowest: float, highest: float, centre_rev: float) -> FloatArray:
    """Return one revolution of the signal that distinguishes teeth, between two mesh harmonics, about `centre_rev`.

    Returns
    -------
    array, (n_channels, 64 z)
    """
    z, n = searched.teeth, _SHAPE_STEPS_PER_TOOTH * searched.teeth
    lines = without_regular_lines(searched)
    orders = np.arange(lines.shape[1])
    spectrum = np.zeros((len(lines), n // 2 + 1), dtype=complex)
    used = orders[(orders >= lowest * z) & (orders <= highest * z) & (orders < n // 2)]
    spectrum[:, used] = lines[:, used]
    signal: FloatArray = np.roll(np.fft.irfft(spectrum, n, axis=1) * n / 2, n // 2 - round(centre_rev * n), axis=1)
    return signal


LOWEST_HARMONIC = 3.5
"""High orders start between the third and fourth mesh harmonics."""

SQUEEZED_WINDOW_PITCHES = 2.0
_STEP = 4


def squeezed_rise_db(searched: ShaftLines, healthy: ShaftLines, event: ToothEvent) -> float:
    """Return 10 log₁₀ of the squeezed energy near the tooth over a median healthy tooth's, averaged over channels.

    E = Σ |T(o, θ)|² over orders o above 3.5 mesh harmonics and the two pitches about the event. On one machine it grows
    with a crack's depth. Between machines it adds nothing to the energies in `features`: squeezing moves energy between
    orders, not between angles.

    Parameters
    ----------
    searched : ShaftLines
        The average, or its difference from the healthy gear's.
    healthy : ShaftLines
        The healthy gear's average, or the average itself: supplies the median tooth.
    event : ToothEvent
    """
    highest = min(n_bands(searched), n_bands(healthy)) + 0.5
    near = [windows[len(windows) // 2] for windows in _windows(searched, highest, event)]
    usual = [np.median(windows) for windows in _windows(healthy, highest, event)]
    return 10.0 * float(np.mean(np.log10(np.divide(near, usual))))


def _windows(shaft: ShaftLines, highest: float, event: ToothEvent) -> list[FloatArray]:
    """Return the mean energy in the window about each angle, with the event in the middle, one array per channel."""
    from gearsig.timefreq import UniformSignal, squeezed_cwt

    energies = []
    for values in band_signal(shaft, LOWEST_HARMONIC, highest, event.centre_rev):
        largest = float(np.abs(values).max())
        signal = UniformSignal(values / largest, len(values), "order", highest=highest * shaft.teeth)
        lowest = LOWEST_HARMONIC * shaft.teeth
        plane = squeezed_cwt(signal, lowest=lowest, highest=highest * shaft.teeth, step=_STEP).values
        energy = largest**2 * np.sum(np.abs(plane).astype(np.float64) ** 2, axis=0)
        width = round(SQUEEZED_WINDOW_PITCHES * len(energy) / shaft.teeth)
        energies.append(np.roll(sliding_mean(energy, width), width // 2))
    return energies
