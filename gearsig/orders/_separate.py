"""Residual, difference, regular and band-passed mesh signals of a synchronous average."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from gearsig.checks import FloatArray, count, freeze, instance_of, listed
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.orders._average import SynchronousAverage
from gearsig.results import Result

PartKind = Literal["residual", "difference", "regular", "band-passed mesh"]


@dataclass(frozen=True)
class SeparatedAverage(Result):
    """A synchronous average and its parts: average = regular + difference, exactly."""

    average: SynchronousAverage
    residual: SynchronousAverage
    difference: SynchronousAverage
    regular: SynchronousAverage


def separate(
    average: SynchronousAverage,
    teeth: int | Iterable[int],
    *,
    n_sidebands: int = 1,
    shaft_orders: tuple[int, ...] = (0, 1, 2),
    n_harmonics: int | None = None,
) -> SeparatedAverage:
    """Split a synchronous average into its regular part and the part that local tooth faults cause.

    Convention, using whole lines of the average's Fourier transform (exact, as the average is periodic):

    - residual: the average without mesh harmonics k·z of the shaft's gears and without `shaft_orders`;
    - difference: the residual also without the first `n_sidebands` sidebands k·z ± 1 … of each mesh harmonic;
    - regular: everything removed for the difference.

    Parameters
    ----------
    average : SynchronousAverage
        Of kind "average", for the shaft that carries the gears.
    teeth : int or ints
        Teeth of each gear on the shaft. Mesh orders of other shafts' gears are not whole and are not in the average.
    n_sidebands : int
        Sidebands on each side that count as regular.
    shaft_orders : ints
        Shaft orders removed from both: the mean (0), unbalance and misalignment (1, 2). Sources differ here: Večeř et
        al. remove "shaft components along with their harmonics"; removing all of them would leave nothing, since
        every line of the average is a shaft harmonic. Pass () to keep them.
    n_harmonics : int or None
        Mesh harmonics per gear; None takes all in the average, including those above its highest order.

    Returns
    -------
    SeparatedAverage
        Standard errors are the average's times the square root of the share of lines that is left.

    Raises
    ------
    RefusalError
        If the mesh order lies above the average's highest order, or nothing would be left for the difference.
    InputError
        On teeth below 3 or an average of another kind.

    Notes
    -----
    Other contents of the average, e.g. an eccentricity with many sidebands, stay in the difference: a large FM4 is a
    reason to inspect it, not proof of a fault.

    References
    ----------
    P. D. McFadden, "Detecting fatigue cracks in gears by amplitude and phase demodulation of the meshing vibration",
    1986. P. D. McFadden, "Examination of a technique for the early detection of failure in gears by signal processing
    of the time domain average of the meshing vibration", 1987.
    P. Večeř, M. Kreidl, R. Šmíd, "Condition indicators for gearbox condition monitoring systems", 2005.
    """
    _check_kind(average)
    gears = checked_teeth(average, teeth)
    count(n_sidebands, "n_sidebands", minimum=0)
    highest = average.highest_line
    # Above the highest order, strong mesh harmonics still pass the filter's skirt: they are removed, too.
    last = (len(average.values) - 1) // 2
    mesh = [k * z for z in gears for k in range(1, (n_harmonics or last) + 1) if k * z <= last]
    bare = _line_mask(len(average.values), [*shaft_orders, *mesh])
    sidebands = [m + s for m in mesh for s in range(-n_sidebands, n_sidebands + 1)]
    full = _line_mask(len(average.values), [*shaft_orders, *sidebands])
    if full[: highest + 1].all():
        raise RefusalError(
            f"mesh harmonics of {gears} teeth with {counted(n_sidebands, 'sideband')} cover all {highest} orders of "
            "the average",
            remedy="take fewer sidebands or harmonics, or a higher sampling rate",
        )
    lines = np.fft.rfft(average.values)
    regular = np.fft.irfft(np.where(full, lines, 0), len(average.values))
    residual = np.fft.irfft(np.where(bare, 0, lines), len(average.values))
    return SeparatedAverage(
        average=average,
        residual=_part(average, residual, "residual", 1 - bare[: highest + 1].mean()),
        difference=_part(average, average.values - regular, "difference", 1 - full[: highest + 1].mean()),
        regular=_part(average, regular, "regular", full[: highest + 1].mean()),
    )


def band_passed_mesh(
    average: SynchronousAverage, teeth: int, *, harmonic: int = 1, half_width_orders: int | None = None
) -> SynchronousAverage:
    """Return the average's content around one mesh harmonic: the lines from harmonic·z - h to harmonic·z + h.

    Parameters
    ----------
    average : SynchronousAverage
    teeth : int
    harmonic : int
    half_width_orders : int or None
        h, 1 to teeth - 1; None is the largest below half the mesh order.

    Returns
    -------
    SynchronousAverage
        Of kind "band-passed mesh": the signal on which NB4 and the amplitude and phase modulation are based.

    Raises
    ------
    RefusalError, InputError
        As `separate`.
    """
    _check_kind(average)
    low, high = mesh_band(average, teeth, harmonic, half_width_orders)
    lines = np.fft.rfft(average.values)
    lines[:low] = 0
    lines[high + 1 :] = 0
    values = np.fft.irfft(lines, len(average.values))
    return _part(average, values, "band-passed mesh", (high - low + 1) / (average.highest_line + 1))


def mesh_band(average: SynchronousAverage, teeth: int, harmonic: int, half_width_orders: int | None) -> tuple[int, int]:
    """Return the first and last whole order of the band around a mesh harmonic."""
    z = checked_teeth(average, teeth)[0]
    centre = z * count(harmonic, "harmonic")
    half = (z - 1) // 2 if half_width_orders is None else count(half_width_orders, "half_width_orders")
    if half >= z:
        raise InputError(f"half_width_orders is {half}", allowed=f"1 to {z - 1}", remedy="leave the next harmonic out")
    if centre + half > average.highest_line:
        raise RefusalError(
            f"the band {centre} ± {half} orders reaches above the average's highest order {average.highest_line}",
            remedy="take a lower harmonic, a narrower band or a higher sampling rate",
        )
    return centre - half, centre + half


def checked_teeth(average: SynchronousAverage, teeth: int | Iterable[int]) -> tuple[int, ...]:
    """Return the numbers of teeth as a tuple; each is at least 3 and its mesh order is within the average."""
    numbers_of_teeth: Any = teeth
    is_single = isinstance(numbers_of_teeth, int | float | np.number | str)  # `count` reports what is wrong
    numbers = (numbers_of_teeth,) if is_single else listed(numbers_of_teeth, "teeth", object)
    if not numbers:
        raise InputError("no teeth are given", remedy="give the teeth of each gear on the shaft")
    for z in numbers:
        count(z, "teeth", minimum=3)
        if z > average.highest_line:
            raise RefusalError(
                f"mesh order {z} lies above the average's highest order {average.highest_line}",
                remedy="a higher sampling rate or a lower speed would show the mesh",
            )
    return tuple(int(z) for z in numbers)


def _check_kind(average: SynchronousAverage) -> None:
    check_average(average)
    if average.kind != "average":
        raise InputError(f"the average is of kind {average.kind!r}", allowed="average", remedy="take it before a split")


def check_average(value: object, name: str = "average") -> None:
    """Raise unless the value is a synchronous average."""
    instance_of(value, SynchronousAverage, name, remedy="gearsig.synchronous_average(recording, channel) makes one")


def _line_mask(n_angles: int, orders: Iterable[int]) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    mask = np.zeros(n_angles // 2 + 1, dtype=np.bool_)
    mask[[o for o in orders if 0 <= o < len(mask)]] = True
    return mask


def _part(average: SynchronousAverage, values: FloatArray, kind: PartKind, share: float) -> SynchronousAverage:
    return replace(average, values=values, standard_error=average.standard_error * np.sqrt(share), kind=kind)


@dataclass(frozen=True)
class MeshModulation(Result):
    """Modulation of one mesh harmonic over a revolution of the gear's shaft.

    Parameters
    ----------
    amplitude : array, (n_angles,)
        Peak amplitude of the harmonic at each shaft angle, in `unit`.
    phase_rad : array, (n_angles,)
        Phase of the harmonic relative to the carrier's; a tooth that meshes late lowers it.
    carrier_order : int
        Mesh order: harmonic times teeth.
    carrier_amplitude, carrier_phase_rad : float
        Of the unmodulated harmonic, the line at the mesh order itself.
    half_width_orders : int
        Highest modulation order in the band; faster modulation is not visible.
    shaft, channel, unit : str
    """

    amplitude: FloatArray
    phase_rad: FloatArray
    carrier_order: int
    carrier_amplitude: float
    carrier_phase_rad: float
    half_width_orders: int
    shaft: str
    channel: str
    unit: str

    def __post_init__(self) -> None:
        freeze(self, "amplitude", "phase_rad")


def mesh_modulation(
    average: SynchronousAverage, teeth: int, *, harmonic: int = 1, half_width_orders: int | None = None
) -> MeshModulation:
    """Demodulate a mesh harmonic of a synchronous average.

    The analytic signal of the band around order h·z, shifted to order zero, is a(θ) exp(iφ(θ)). A cracked tooth
    appears as a dip in a and a step in φ over the angle where it meshes.

    Parameters
    ----------
    average : SynchronousAverage
        Of kind "average".
    teeth : int
        Of the gear on the average's shaft.
    harmonic : int
    half_width_orders : int or None
        1 to teeth - 1; None is the largest below half the mesh order, so that no line is shared with the next harmonic.

    Returns
    -------
    MeshModulation

    Raises
    ------
    RefusalError
        If the band reaches above the average's highest order, or the harmonic is absent.
    InputError
        On teeth below 3, a band too wide or an average of another kind.

    Notes
    -----
    Not for a shaft with two gears whose bands overlap. Choose the harmonic that is strongest above its floor. If a
    sideband is larger than the carrier, the phase jumps by whole turns and means little.

    References
    ----------
    P. D. McFadden, "Detecting fatigue cracks in gears by amplitude and phase demodulation of the meshing vibration",
    1986.
    """
    _check_kind(average)
    low, high = mesh_band(average, teeth, harmonic, half_width_orders)
    centre = (low + high) // 2
    lines = np.fft.rfft(average.values)
    z = analytic_around(lines, low, high, centre, len(average.values))
    carrier = 2 * lines[centre] / len(average.values)
    if abs(carrier) <= 1e-12 * np.abs(average.values).max():
        raise RefusalError(
            f"there is no line at mesh order {centre}", remedy="check the teeth or take another harmonic"
        )
    return MeshModulation(
        amplitude=np.abs(z),
        phase_rad=np.unwrap(np.angle(z * np.conj(carrier))),
        carrier_order=centre,
        carrier_amplitude=float(abs(carrier)),
        carrier_phase_rad=float(np.angle(carrier)),
        half_width_orders=centre - low,
        shaft=average.shaft,
        channel=average.channel,
        unit=average.unit,
    )


def analytic_around(
    lines: np.ndarray[tuple[int], np.dtype[np.complex128]], low: int, high: int, centre: int, n: int
) -> np.ndarray[tuple[int], np.dtype[np.complex128]]:
    """Return a band's analytic signal shifted to zero, Σ_{k=low}^{high} (2/N) X_k exp(2πi (k - centre) m/N), (n,)."""
    shifted = np.zeros(n, dtype=np.complex128)
    shifted[np.arange(low, high + 1) - centre] = 2 * lines[low : high + 1]
    return np.asarray(np.fft.ifft(shifted))
