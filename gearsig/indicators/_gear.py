"""Gear indicators of a synchronous average and its parts.

Input signals, here and in MATLAB's `gearConditionMetrics`:

============================ ====================================== =====================================
indicator                    signal here                            MATLAB
============================ ====================================== =====================================
FM0                          average                                average; mesh lines from regular
FM4, M6A, M8A                difference                             difference
energy ratio                 difference and regular                 difference and regular
energy operator              average, and band-passed mesh          not there
sideband index, level factor average                                not there
NA4                          residual, with history                 residual, with history
NA4*, NB4, NB4*              residual; envelope of band-passed mesh not there
============================ ====================================== =====================================

The last column follows MATLAB's documentation of the function's inputs (average, difference, regular and residual,
earlier records for NA4) and outputs (RMS, kurtosis and crest factor of the average, FM4, M6A, M8A, FM0, energy ratio,
NA4); the two have not been run side by side. `tsaregular` and `tsadifference` leave a selectable number of shaft
harmonics and sidebands in the regular signal; `gearsig.orders.separate` states its own choice. Values agree only if
these choices agree.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import isnan

import numpy as np

from gearsig.checks import FloatArray, count
from gearsig.errors import InputError
from gearsig.formatting import counted
from gearsig.indicators._signal import Indicator, is_constant, standardised_moment
from gearsig.orders import SynchronousAverage, check_average

# Gear indicators that compare with earlier records of the same gear.
#
# Each is a fourth moment of the present record over a variance that includes earlier records, so that it keeps rising
# as damage grows, whereas a plain kurtosis would fall again. Without history, NA4 is the kurtosis of the residual.


def na4(residual: SynchronousAverage, history: Sequence[SynchronousAverage] = (), *, star: bool = False) -> float:
    """Return the fourth moment of the residual over the squared mean variance of all records so far, NA4.

    NA4 = (1/N) Σ_i (r_i - r̄)⁴ / ( (1/M) Σ_{j=1}^{M} v_j )², with v_j the variance of record j's residual and M
    including the present record. NA4* uses the mean variance of healthy records only.

    Parameters
    ----------
    residual : SynchronousAverage
        Residual of the present record, of kind "residual".
    history : sequence of SynchronousAverage
        Residuals of earlier records of the same gear at the same speed and load, in any order; for NA4* only healthy
        ones, which `healthy_records` finds.
    star : bool
        Whether to return NA4*, for which only the history counts.

    Returns
    -------
    float
        3 for Gaussian noise at an unchanged level; nan for a constant residual without history, and for NA4* without
        a healthy record.

    Raises
    ------
    InputError
        On averages of another kind, shaft or channel.

    Notes
    -----
    MATLAB's `gearConditionMetrics` also takes the residual, with the records up to the present one as history; it has
    no NA4*. Not for records at different loads, as the variance then follows the load.

    References
    ----------
    J. J. Zakrajsek, D. P. Townsend, H. J. Decker, "An analysis of gear fault detection methods as applied to pitting
    fatigue failure data", NASA TM-105950, 1993. H. J. Decker, R. F. Handschuh, J. J. Zakrajsek, "An enhancement to the
    NA4 gear vibration diagnostic parameter", NASA TM-106553, 1994.
    """
    _check(residual, history, "residual")
    return _trend_value(residual.values, [h.values for h in history], star=star)


def nb4(
    band_passed_mesh: SynchronousAverage, history: Sequence[SynchronousAverage] = (), *, star: bool = False
) -> float:
    """Return NA4 of the envelope of the mesh band, which shows a fluctuating load on few teeth.

    s(θ) = |b(θ) + i H[b](θ)|, with b the average band-passed around a mesh harmonic and H the Hilbert transform.

    Parameters
    ----------
    band_passed_mesh : SynchronousAverage
        Of kind "band-passed mesh".
    history : sequence of SynchronousAverage
        The same for earlier records; for NB4* only healthy ones.
    star : bool
        Whether to return NB4*, for which only the history counts.

    Returns
    -------
    float
        nan for an unmodulated mesh without history, and for NB4* without a healthy record.

    References
    ----------
    J. J. Zakrajsek, R. F. Handschuh, H. J. Decker, "Application of fault detection techniques to spiral bevel gear
    fatigue data", NASA TM-106467, 1994. Not in MATLAB's `gearConditionMetrics`.
    """
    _check(band_passed_mesh, history, "band-passed mesh")
    return _trend_value(envelope(band_passed_mesh.values), [envelope(h.values) for h in history], star=star)


def _trend_value(x: FloatArray, history: Sequence[FloatArray], *, star: bool) -> float:
    records = [*history] if star else [*history, x]
    variance = float(np.mean([0.0 if is_constant(r) else float(np.var(r)) for r in records])) if records else 0.0
    return float(np.mean(((x - x.mean()) / np.sqrt(variance)) ** 4)) if variance > 0.0 else float("nan")


def healthy_records(variances: Sequence[float], *, z: float = 2.33, n_first: int = 5) -> tuple[bool, ...]:
    """Return which records count as healthy for NA4* and NB4*: those before the variance leaves its scatter.

    The first `n_first` records are assumed healthy. After them, the first record whose variance exceeds mean + z s of
    all previous ones ends the healthy period: later records never change the reference again.

    Parameters
    ----------
    variances : sequence of float
        Of the residuals (or envelopes), oldest first.
    z : float
        Number of standard deviations; 1 % of normal records exceed 2.33.
    n_first : int
        At least 2.

    Returns
    -------
    tuple of bool

    Raises
    ------
    InputError
        If `n_first` is below 2: one record has no scatter.

    Notes
    -----
    Each record is tested by itself; Decker et al. (1994) fix the reference by a test of the same kind.
    """
    if n_first < 2:
        raise InputError(f"n_first is {n_first}", allowed="at least 2")
    v = np.asarray(variances, dtype=np.float64)
    for k in range(n_first, len(v)):
        if v[k] > v[:k].mean() + z * v[:k].std(ddof=1):
            return (True,) * k + (False,) * (len(v) - k)
    return (True,) * len(v)


def envelope(values: FloatArray) -> FloatArray:
    """Return the envelope |x + i H[x]| of a periodic signal, (n_angles,), computed from its Fourier lines."""
    from scipy.signal import hilbert

    return np.abs(hilbert(values))


def _check(present: SynchronousAverage, history: Sequence[SynchronousAverage], *kinds: str) -> None:
    for a in (present, *history):
        check_average(a, "a signal")
        if a.kind not in kinds:
            raise InputError(
                f"a signal of kind {a.kind!r} was given", allowed=", ".join(kinds), remedy="see gearsig.orders"
            )
        if (a.shaft, a.channel, a.unit) != (present.shaft, present.channel, present.unit):
            raise InputError(
                f"history of shaft {a.shaft!r}, channel {a.channel!r} [{a.unit}] for a record of shaft"
                f" {present.shaft!r}, channel {present.channel!r} [{present.unit}]",
                remedy="give earlier records of the same gear, channel and unit",
            )


def fm0(average: SynchronousAverage, teeth: int, *, n_harmonics: int | None = None) -> float:
    """Return the zero-order figure of merit FM0, the peak-to-peak value over the sum of mesh harmonic amplitudes.

    FM0 = (max x - min x) / Σ_h A(h z). It rises with heavy wear (mesh harmonics fall) and with breakage (peaks rise).

    Parameters
    ----------
    average : SynchronousAverage
        Of kind "average".
    teeth : int
        z.
    n_harmonics : int or None
        None: all up to the average's highest order.

    Returns
    -------
    float
        2 for one unmodulated mesh harmonic; nan if no mesh harmonic is in the average.

    References
    ----------
    R. M. Stewart, "Some useful data analysis techniques for gearbox diagnostics", ISVR, Southampton, 1977.
    """
    _check(average, (), "average")
    amplitudes = mesh_amplitudes(average, teeth, n_harmonics)
    total = float(np.sum(amplitudes))
    span = float(average.values.max() - average.values.min())
    return span / total if total > 1e-12 * span and total > 0 else float("nan")


def fm4(difference: SynchronousAverage, *, size: float | None = None) -> float:
    """Return the kurtosis of the difference signal, FM4: 3 for Gaussian noise, more if one or two teeth stand out.

    FM4 = N Σ (d - d̄)⁴ / (Σ (d - d̄)²)². `size` is the magnitude relative to which a difference may be only rounding.
    FM4 falls again when damage spreads to many teeth. Source: Stewart 1977, see `fm0`.
    """
    _check(difference, (), "difference")
    return standardised_moment(difference.values, 4, size)


def m6a(difference: SynchronousAverage, *, size: float | None = None) -> float:
    """Return the sixth standardised moment of the difference signal, M6A: 15 for Gaussian noise.

    M6A = N² Σ (d - d̄)⁶ / (Σ (d - d̄)²)³. More sensitive to single peaks than FM4.

    Source: H. R. Martin, "Statistical moment analysis as a means of surface damage detection", 7th International Modal
    Analysis Conference, 1989.
    """
    _check(difference, (), "difference")
    return standardised_moment(difference.values, 6, size)


def m8a(difference: SynchronousAverage, *, size: float | None = None) -> float:
    """Return the eighth standardised moment of the difference signal, M8A: 105 for Gaussian noise.

    M8A = N³ Σ (d - d̄)⁸ / (Σ (d - d̄)²)⁴. Source: Martin 1989, see `m6a`.
    """
    _check(difference, (), "difference")
    return standardised_moment(difference.values, 8, size)


def energy_ratio(difference: SynchronousAverage, regular: SynchronousAverage | FloatArray) -> float:
    """Return the standard deviation of the difference over that of the regular signal; rises with wear on many teeth.

    ER = σ(d)/σ(y), with y the regular signal, or average minus difference as an array. nan for a constant regular
    signal.

    Source: N. S. Swansson, "Application of vibration signal analysis techniques to signal monitoring", 1980.
    """
    _check(difference, (), "difference")
    if isinstance(regular, SynchronousAverage):
        _check(regular, (), "regular")
        regular = regular.values
    size = float(np.abs(regular).max())
    if is_constant(regular, max(size, float(np.abs(difference.values).max()))):
        return float("nan")
    return float(np.std(difference.values) / np.std(regular))


def energy_operator(signal: SynchronousAverage) -> float:
    """Return the kurtosis of the Teager–Kaiser energy ψ_i = x_i² - x_{i-1} x_{i+1}, with the ends joined.

    ψ is about (amplitude × frequency)²: a tooth that changes amplitude or phase locally causes a peak in it.

    Parameters
    ----------
    signal : SynchronousAverage
        The average, as in reviews, or the band-passed mesh, for which ψ is that of a single modulated carrier.

    Returns
    -------
    float
        nan for a pure sine, whose ψ is constant.

    Notes
    -----
    It emphasises high orders, depending on the number of samples per revolution: compare only at the same number.

    References
    ----------
    J. Ma, "Energy operator and other demodulation approaches to gear defect detection", 1995.
    """
    _check(signal, (), "average", "band-passed mesh", "residual", "difference")
    scale = float(np.abs(signal.values).max())
    if scale == 0.0:
        return float("nan")
    x = signal.values / scale
    return standardised_moment(x * x - np.roll(x, 1) * np.roll(x, -1), 4, size=1.0)


def sideband_index(average: SynchronousAverage, teeth: int) -> float:
    """Return the mean amplitude of the two first-order sidebands of the mesh fundamental, in the average's unit.

    SI = (A(z-1) + A(z+1))/2; A m/2 for a carrier A with amplitude modulation m at shaft order 1. nan if a sideband lies
    above the average's highest order.

    Source: P. Večeř, M. Kreidl, R. Šmíd, "Condition indicators for gearbox condition monitoring systems", Acta
    Polytechnica 45 (2005).
    """
    _check(average, (), "average")
    z = count(teeth, "teeth", minimum=3)
    return 0.5 * (line_amplitude(average, z - 1) + line_amplitude(average, z + 1))


def sideband_level_factor(average: SynchronousAverage, teeth: int) -> float:
    """Return the sum of the two first-order sidebands of the mesh fundamental over the average's standard deviation.

    SLF = (A(z-1) + A(z+1))/σ(x). Source: Večeř et al. 2005, see `sideband_index`.
    """
    _check(average, (), "average")
    if is_constant(average.values):
        return float("nan")
    return 2 * sideband_index(average, teeth) / float(np.std(average.values))


def gear_indicators(
    average: SynchronousAverage,
    residual: SynchronousAverage,
    difference: SynchronousAverage,
    band_passed_mesh: SynchronousAverage | None = None,
    *,
    teeth: int,
    gear: str = "",
    history: Sequence[SynchronousAverage] = (),
    band_history: Sequence[SynchronousAverage] = (),
    healthy: Sequence[bool] | None = None,
) -> tuple[Indicator, ...]:
    """Return all indicators of one gear in one record.

    Parameters
    ----------
    average, residual, difference, band_passed_mesh : SynchronousAverage
        Of these kinds, from `gearsig.orders`. Without the mesh band, its indicators are left out.
    teeth : int
    gear : str
        "pair/shaft".
    history : sequence of SynchronousAverage
        Residuals of earlier records, oldest first, for NA4 and NA4*.
    band_history : sequence of SynchronousAverage
        Mesh bands of the same records, for NB4 and NB4*.
    healthy : sequence of bool or None
        Which records of `history` (and `band_history`) were healthy; None: all, see `healthy_records`.

    Returns
    -------
    tuple of Indicator
        Undefined ones are nan, with a note.

    Raises
    ------
    InputError
        On signals of another kind, or of a different shaft, channel or length.
    """
    check_average(average)
    for part in (residual, difference, *([band_passed_mesh] if band_passed_mesh else [])):
        check_average(part, "a part of the average")
        if (part.shaft, part.channel, len(part.values)) != (average.shaft, average.channel, len(average.values)):
            raise InputError(
                f"the {part.kind} belongs to shaft {part.shaft!r}, channel {part.channel!r}",
                allowed=f"shaft {average.shaft!r}, channel {average.channel!r}, the same number of angles",
            )
    size = float(np.abs(average.values).max())
    regular = average.values - difference.values
    rounding = "undefined: the difference contains only rounding"
    no_modulation = "undefined: the signal is one unmodulated order"
    beyond = f"undefined: order {teeth + 1} lies above the average's highest order {average.highest_order:g}"
    # Name, value, unit, signal, and note; a note that begins with "undefined" applies only to an undefined value.
    rows: list[_Row] = [
        ("FM0", fm0(average, teeth), "", _AVERAGE, "undefined: no mesh harmonic is in the average"),
        ("FM4", fm4(difference, size=size), "", "difference", rounding),
        ("M6A", m6a(difference, size=size), "", "difference", rounding),
        ("M8A", m8a(difference, size=size), "", "difference", rounding),
        ("energy ratio", energy_ratio(difference, regular), "", "difference", "undefined: no regular signal"),
        ("energy operator", energy_operator(average), "", _AVERAGE, no_modulation),
        ("sideband index", sideband_index(average, teeth), average.unit, _AVERAGE, beyond),
        ("sideband level factor", sideband_level_factor(average, teeth), "", _AVERAGE, beyond),
        *_trend(na4, residual, history, healthy, "NA4", "the residual", size),
    ]
    if band_passed_mesh is not None:
        rows.append(("energy operator", energy_operator(band_passed_mesh), "", band_passed_mesh.kind, no_modulation))
        rows += _trend(nb4, band_passed_mesh, band_history, healthy, "NB4", "the mesh band's envelope", size)
    return tuple(
        Indicator(name, value, unit, average.channel, on, average.shaft, gear, note=_note(value, note))
        for name, value, unit, on, note in rows
    )


_Row = tuple[str, float, str, str, str]
_AVERAGE = "synchronous average"


def _trend(
    function: Callable[..., float],
    signal: SynchronousAverage,
    history: Sequence[SynchronousAverage],
    healthy: Sequence[bool] | None,
    name: str,
    of: str,
    size: float,
) -> list[_Row]:
    if is_constant(signal.values, size):
        empty = f"undefined: {signal.kind} contains only rounding"
        return [(n, float("nan"), "", signal.kind, empty) for n in (name, f"{name}*")]
    good = list(history) if healthy is None else [h for h, ok in zip(history, healthy, strict=True) if ok]
    alone = f"trend indicator without earlier records: the kurtosis of {of}"
    note = f"trend indicator over {counted(len(history), 'earlier record')}" if history else alone
    star = (
        f"over the variance of {counted(len(good), 'healthy record')}" if good else "undefined: needs healthy records"
    )
    return [
        (name, function(signal, history), "", signal.kind, note),
        (f"{name}*", function(signal, good, star=True), "", signal.kind, star),
    ]


def _note(value: float, note: str) -> str:
    if not isnan(value):
        return "" if note.startswith("undefined") else note
    return note if note.startswith("undefined") else f"undefined: the signal is constant; {note}"


def line_amplitude(average: SynchronousAverage, order: int) -> float:
    """Return the peak amplitude of a whole order of the average; nan above its highest order."""
    n = len(average.values)
    if order > average.highest_order or 2 * order > n:
        return float("nan")
    angle = 2 * np.pi * ((order * np.arange(n)) % n) / n
    line = np.sum(average.values * np.cos(angle)) - 1j * np.sum(average.values * np.sin(angle))
    return float(abs(line)) * (1.0 if order == 0 or 2 * order == n else 2.0) / n


def mesh_amplitudes(average: SynchronousAverage, teeth: int, n_harmonics: int | None = None) -> FloatArray:
    """Return the peak amplitudes of the mesh harmonics in the average, (n_harmonics,)."""
    check_average(average)
    z = count(teeth, "teeth", minimum=3)
    highest = min(average.highest_order, len(average.values) / 2)
    n = int(highest // z) if n_harmonics is None else min(count(n_harmonics, "n_harmonics"), int(highest // z))
    return np.array([line_amplitude(average, h * z) for h in range(1, n + 1)])
