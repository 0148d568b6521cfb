"""Amplitude and phase modulation of a mesh harmonic over one revolution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gearsig.checks import FloatArray, frozen_array
from gearsig.errors import InputError, RefusalError
from gearsig.orders.separate import mesh_band
from gearsig.orders.types import SynchronousAverage


@dataclass(frozen=True)
class MeshModulation:
    """Modulation of one mesh harmonic over a revolution of the gear's shaft.

    Parameters
    ----------
    amplitude : array, (n_angles,)
        Of the harmonic at each shaft angle, peak, in `unit`.
    phase_rad : array, (n_angles,)
        Of the harmonic against its mean phase; a tooth that comes late lowers it.
    carrier_order : int
        Mesh order: harmonic times teeth.
    carrier_amplitude, carrier_phase_rad : float
        Of the unmodulated harmonic, the line at the mesh order itself.
    half_width_orders : int
        Faster modulation is not seen.
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
        for name in ("amplitude", "phase_rad"):
            object.__setattr__(self, name, frozen_array(getattr(self, name), name, ndim=1))


def mesh_modulation(
    average: SynchronousAverage, teeth: int, *, harmonic: int = 1, half_width_orders: int | None = None
) -> MeshModulation:
    """Demodulate a mesh harmonic of a synchronous average.

    The analytic signal of the band around order h·z, shifted to order zero, is a(θ) exp(iφ(θ)). A cracked tooth
    shows as a dip of a and a step of φ over the angle where it meshes.

    Parameters
    ----------
    average : SynchronousAverage
        Of kind "average".
    teeth : int
        Of the gear on the average's shaft.
    harmonic : int
    half_width_orders : int or None
        1 to teeth - 1; None is the largest below half the mesh order, which shares no line with the next harmonic.

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
    Not for a shaft with two gears whose bands overlap. Choose the harmonic that is strongest above its floor; where a
    sideband is larger than the carrier, the phase jumps by whole turns and means little.

    References
    ----------
    P. D. McFadden, "Detecting fatigue cracks in gears by amplitude and phase demodulation of the meshing vibration",
    1986.
    """
    if average.kind != "average":
        raise InputError(f"the average is of kind {average.kind!r}", allowed="average", remedy="take it before a split")
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
    """Return Σ_{k=low}^{high} (2/N) X_k exp(2πi (k - centre) m/N), m = 0 … N - 1."""
    shifted = np.zeros(n, dtype=np.complex128)
    shifted[np.arange(low, high + 1) - centre] = 2 * lines[low : high + 1]
    return np.asarray(np.fft.ifft(shifted))
