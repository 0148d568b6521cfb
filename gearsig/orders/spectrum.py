"""Order spectra: spectra over cycles per revolution of a shaft."""

from __future__ import annotations

import numpy as np

from gearsig.angle.types import AngleSignal
from gearsig.checks import count, one_of
from gearsig.errors import InputError
from gearsig.orders.revolutions import unit_of, whole_revolutions
from gearsig.spectra.blocks import mean_power, plan_blocks, scaled, scaled_unit
from gearsig.spectra.types import Scaling, Spectrum

ORDER_SCALINGS = ("amplitude peak", "amplitude rms", "power", "power density")


def order_spectrum(
    signal: AngleSignal,
    channel: str,
    *,
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    revolutions_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return the order spectrum of one channel, over whole revolutions of the shaft.

    The discrete Fourier transform over angle: A(o) = 2 |Σ x[n] w[n] exp(-2πi o n/S)| / Σ w[n] with S samples per
    revolution. Whole orders of the shaft fall on lines, whatever the window.

    Parameters
    ----------
    signal : AngleSignal
        Partial revolutions at either end are left out.
    channel : str
    window : str
        See `make_window`. "hann" for spectra that hold other shafts' orders as well; "rectangular" has the finest
        resolution, but whatever is not a whole number of cycles per block leaks.
    scaling : str
        "amplitude peak", "amplitude rms", "power", or "power density" (per order, averaged over blocks).
    revolutions_per_block : int or None
        Rms mean over blocks of so many revolutions; None takes all revolutions as one block.
    overlap : float
        0 to 0.95.

    Returns
    -------
    Spectrum
        Over order, up to the signal's highest valid order, in steps of 1/revolutions per block.

    Raises
    ------
    RefusalError
        If the signal holds no whole revolution.
    InputError
        On an unknown channel, window or scaling, or blocks longer than the signal.

    Notes
    -----
    Fixed-frequency components (resonances, mains) smear when the speed changes: look at those over frequency.

    Examples
    --------
    >>> from gearsig.angle.types import ShaftAngle
    >>> angle = ShaftAngle("s", np.array([0.0, 1.0]), np.array([0.0, 8.0]), np.array([8.0, 8.0]), "constant")
    >>> x = 2 * np.cos(2 * np.pi * 3 * np.arange(8 * 64) / 64)
    >>> spectrum = order_spectrum(AngleSignal(x[None, :], 64, angle, 0.0, ("a",), ("g",), 32.0), "a")
    >>> round(float(spectrum.values[spectrum.index_of(3.0)]), 9)
    2.0
    """
    one_of(scaling, "scaling", ORDER_SCALINGS)
    revolutions = whole_revolutions(signal, channel)
    n_rev, per_rev = revolutions.shape
    if revolutions_per_block is not None:
        count(revolutions_per_block, "revolutions_per_block")
        if revolutions_per_block > n_rev:
            raise InputError(f"revolutions_per_block is {revolutions_per_block}", allowed=f"1 to {n_rev}")
        n_rev = revolutions_per_block
    plan = plan_blocks(revolutions.size, n_rev * per_rev, overlap, window)
    bandwidth = plan.window.noise_bandwidth_bins / n_rev
    lines = scaled(mean_power(revolutions.reshape(-1), plan), scaling, bandwidth, plan.n_per_block)
    orders = np.arange(len(lines)) / n_rev
    n_valid = int(np.searchsorted(orders, signal.highest_order * (1 + 1e-12), side="right"))
    return Spectrum(
        values=lines[:n_valid],
        positions=orders[:n_valid],
        axis="order",
        scaling=scaling,
        unit=scaled_unit(unit_of(signal, channel), scaling, per="order"),
        resolution=1.0 / n_rev,
        noise_bandwidth=bandwidth,
        window=plan.window.name,
        n_averages=plan.n_averages,
        source=channel,
        shaft=signal.shaft_angle.shaft,
    )
