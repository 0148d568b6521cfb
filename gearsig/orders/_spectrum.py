"""Order spectra: spectra over cycles per revolution of a shaft."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from gearsig.angle import AngleSignal, ShaftAngle, check_shaft_angle
from gearsig.checks import FloatArray, count, freeze, not_negative, one_of, positive
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import axis_label
from gearsig.orders._average import block_times, first_whole_sample, over_angle, unit_of, whole_revolutions
from gearsig.recording import Recording
from gearsig.results import Result
from gearsig.spectra import (
    BlockPlan,
    Scaling,
    Spectrum,
    block_powers,
    checked_signal,
    fast_length,
    plan_blocks,
    scaled,
    scaled_unit,
    spectrum_of_blocks,
)


@dataclass(frozen=True)
class OrderMap(Result, matrix=("values", "time_s", "positions")):
    """Spectra of consecutive blocks, over time and speed.

    Parameters
    ----------
    values : array, (n_blocks, n_lines)
    positions : array, (n_lines,)
        Orders or frequencies (Hz), see `axis`.
    time_s, speed_rpm : arrays, (n_blocks,)
        Middle of each block, and mean speed within it.
    axis : str
        "order" or "frequency".
    scaling, unit, resolution, source, shaft
        As in `Spectrum`.
    """

    values: FloatArray
    positions: FloatArray
    time_s: FloatArray
    speed_rpm: FloatArray
    axis: Literal["order", "frequency"]
    scaling: Scaling
    unit: str
    resolution: float
    source: str
    shaft: str

    def __post_init__(self) -> None:
        freeze(self, "values", ndim=2)
        freeze(self, "positions", "time_s", "speed_rpm")
        if self.values.shape != (len(self.time_s), len(self.positions)):
            raise InputError(
                f"values of shape {self.values.shape} for {len(self.time_s)} blocks × {len(self.positions)} lines"
            )

    @property
    def axis_label(self) -> str:
        """Label of the axis of lines, with its unit."""
        return axis_label(self.axis, self.shaft)


MANY_REVOLUTIONS = 500
"""From this number on, some revolutions at the end are left out for a fast transform."""

ORDER_SCALINGS = ("amplitude peak", "amplitude rms", "power", "power density")


def order_spectrum(
    signal: AngleSignal | Recording | FloatArray,
    channel: str | float,
    *,
    shaft: str = "",
    shaft_angle: ShaftAngle | None = None,
    speed_rpm: float | FloatArray | None = None,
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    revolutions_per_block: int | None = None,
    overlap: float = 0.5,
) -> Spectrum:
    """Return the order spectrum of one channel, over whole revolutions of the shaft.

    Discrete Fourier transform over angle: A(o) = 2 |Σ x[n] w[n] exp(-2πi o n/S)| / Σ w[n] with S samples per
    revolution. Whole orders of the shaft fall on lines with any window.

    Parameters
    ----------
    signal : AngleSignal, Recording or array, (n_samples,)
        Partial revolutions at either end are left out.
    channel : str or float
        The channel's name, or an array's sampling rate in Hz.
    shaft, shaft_angle, speed_rpm
        For a recording or an array, as in `synchronous_average`.
    window : str
        See `make_window`. Use "hann" if the spectrum contains other shafts' orders; "rectangular" has the finest
        resolution, but any component without a whole number of cycles per block leaks.
    scaling : str
        "amplitude peak", "amplitude rms", "power", or "power density" (per order, averaged over blocks).
    revolutions_per_block : int or None
        Revolutions per block of an rms mean over blocks. None takes all revolutions as one block; from 500 on, up to
        1.2 % at the end are left out for a fast transform.
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
    Fixed-frequency components (resonances, mains) smear when the speed changes: view them over frequency.

    Examples
    --------
    >>> from gearsig.angle import ShaftAngle
    >>> angle = ShaftAngle("s", np.array([0.0, 1.0]), np.array([0.0, 8.0]), np.array([8.0, 8.0]), "constant")
    >>> x = 2 * np.cos(2 * np.pi * 3 * np.arange(8 * 64) / 64)
    >>> spectrum = order_spectrum(AngleSignal(x[None, :], 64, angle, 0.0, ("a",), ("g",), 32.0), "a")
    >>> round(float(spectrum.values[spectrum.index_of(3.0)]), 9)
    2.0
    """
    from scipy.fft import rfft

    one_of(scaling, "scaling", ORDER_SCALINGS)
    signal, channel = over_angle(signal, channel, shaft, shaft_angle, speed_rpm)
    revolutions, transform = whole_revolutions(signal, channel), None
    n_rev, per_rev = revolutions.shape
    if revolutions_per_block is not None:
        count(revolutions_per_block, "revolutions_per_block")
        if revolutions_per_block > n_rev:
            raise InputError(f"revolutions_per_block is {revolutions_per_block}", allowed=f"1 to {n_rev}")
        n_rev = revolutions_per_block
    else:
        n_rev = fast_length(n_rev) if n_rev >= MANY_REVOLUTIONS else n_rev
        revolutions = revolutions[:n_rev]
        transform = rfft(revolutions.reshape(-1))  # in the samples' precision
    plan = plan_blocks(revolutions.size, n_rev * per_rev, overlap, window)
    return spectrum_of_blocks(
        revolutions.reshape(-1),
        per_rev,
        plan,
        scaling,
        unit_of(signal, channel),
        channel,
        axis="order",
        highest=signal.highest_order,
        shaft=signal.shaft_angle.shaft,
        transform=transform,
    )


def order_map(
    signal: AngleSignal | Recording | FloatArray,
    channel: str | float,
    *,
    shaft: str = "",
    shaft_angle: ShaftAngle | None = None,
    speed_rpm: float | FloatArray | None = None,
    revolutions_per_block: int = 10,
    overlap: float = 0.5,
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    highest_order: float | None = None,
    n_blocks_max: int = 1000,
) -> OrderMap:
    """Return the order spectra of consecutive blocks of whole revolutions, with the time and speed of each.

    Parameters
    ----------
    signal, channel, shaft, shaft_angle, speed_rpm
        As in `order_spectrum`.
    revolutions_per_block : int
        Lines are 1/revolutions_per_block orders apart.
    overlap : float
        0 to 0.95.
    window, scaling : str
        As in `order_spectrum`.
    highest_order : float or None
        Lines above it are left out; None keeps all up to the signal's highest valid order.
    n_blocks_max : int
        Limits the memory: if the overlap would give more blocks, this many are spread evenly.

    Returns
    -------
    OrderMap
        Over order.

    Raises
    ------
    RefusalError
        If the signal is shorter than one block.
    InputError
        On an unknown channel, window or scaling.

    Notes
    -----
    Not for resonances, as a block of revolutions lasts longer at low speed: use `frequency_map`.
    """
    one_of(scaling, "scaling", ORDER_SCALINGS)
    count(revolutions_per_block, "revolutions_per_block")
    signal, channel = over_angle(signal, channel, shaft, shaft_angle, speed_rpm)
    start, _ = first_whole_sample(signal)
    x = signal.values(channel)[start:]
    n_per_block = revolutions_per_block * signal.samples_per_revolution
    plan = _plan(len(x), n_per_block, overlap, window, n_blocks_max, "revolutions_per_block")
    resolution = 1.0 / revolutions_per_block
    highest = signal.highest_order
    if highest_order is not None:
        highest = min(not_negative(highest_order, "highest_order"), highest)
    values = _block_spectra(x, plan, scaling, resolution, highest)
    time_s, speed_rpm = block_times(signal, start, plan.n_per_block, plan.step, plan.n_blocks)
    return OrderMap(
        values=values,
        positions=np.arange(values.shape[1]) * resolution,
        time_s=time_s,
        speed_rpm=speed_rpm,
        axis="order",
        scaling=scaling,
        unit=scaled_unit(unit_of(signal, channel), scaling, per="order"),
        resolution=resolution,
        source=channel,
        shaft=signal.shaft_angle.shaft,
    )


def frequency_map(
    values: FloatArray,
    sampling_rate_hz: float,
    shaft_angle: ShaftAngle,
    *,
    n_per_block: int = 4096,
    overlap: float = 0.5,
    window: str = "hann",
    scaling: Scaling = "amplitude peak",
    highest_hz: float | None = None,
    n_blocks_max: int = 1000,
    unit: str = "",
    source: str = "",
) -> OrderMap:
    """Return the frequency spectra of consecutive blocks in time, with the shaft's speed in each.

    Parameters
    ----------
    values : array, (n_samples,)
        From time 0 of the shaft angle. Blocks beyond its knots get the speed at which it continues there.
    sampling_rate_hz : float
    shaft_angle : ShaftAngle
    n_per_block : int
    overlap : float
        0 to 0.95.
    window, scaling : str
        As in `amplitude_spectrum`; also "power density".
    highest_hz : float or None
        Lines above it are left out.
    n_blocks_max : int
        Limits the memory: if the overlap would give more blocks, this many are spread evenly.
    unit, source : str

    Returns
    -------
    OrderMap
        Over frequency.

    Raises
    ------
    RefusalError
        If the signal is shorter than one block.
    InputError
        On a wrong shape, rate, window or scaling.
    """
    one_of(scaling, "scaling", ORDER_SCALINGS)
    check_shaft_angle(shaft_angle)
    x = checked_signal(values)
    fs = positive(sampling_rate_hz, "sampling_rate_hz", "Hz")
    plan = _plan(len(x), n_per_block, overlap, window, n_blocks_max, "n_per_block")
    resolution = fs / plan.n_per_block
    highest = fs / 2 if highest_hz is None else positive(highest_hz, "highest_hz", "Hz")
    lines = _block_spectra(x, plan, scaling, resolution, highest)
    begin = np.arange(plan.n_blocks) * plan.step / fs
    length = plan.n_per_block / fs
    turned = shaft_angle.revolutions_at(begin + length) - shaft_angle.revolutions_at(begin)
    return OrderMap(
        values=lines,
        positions=np.arange(lines.shape[1]) * resolution,
        time_s=begin + length / 2,
        speed_rpm=60.0 * turned / length,
        axis="frequency",
        scaling=scaling,
        unit=scaled_unit(unit, scaling),
        resolution=resolution,
        source=source,
        shaft=shaft_angle.shaft,
    )


def _plan(
    n_samples: int, n_per_block: int, overlap: float, window: str, n_blocks_max: int, block_parameter: str
) -> BlockPlan:
    if count(n_per_block, block_parameter, minimum=2) > n_samples:
        raise RefusalError(
            f"the signal of {n_samples} samples is shorter than one block of {n_per_block}",
            remedy=f"reduce {block_parameter} or record longer",
        )
    plan = plan_blocks(n_samples, n_per_block, overlap, window)
    if plan.n_blocks <= count(n_blocks_max, "n_blocks_max", minimum=2):
        return plan
    step = -(-(n_samples - n_per_block) // (n_blocks_max - 1))
    return replace(plan, step=step, n_blocks=1 + (n_samples - n_per_block) // step)


def _block_spectra(x: FloatArray, plan: BlockPlan, scaling: Scaling, resolution: float, highest: float) -> FloatArray:
    if highest < 0:
        raise InputError(f"highest position is {highest:g}", allowed="not negative")
    n_lines = min(plan.n_per_block // 2 + 1, int(highest / resolution * (1 + 1e-12)) + 1)
    result = np.empty((plan.n_blocks, n_lines))
    row = 0
    for power in block_powers(x, plan, n_lines):
        result[row : row + len(power)] = power
        row += len(power)
    return scaled(result, scaling, plan.window.noise_bandwidth_bins * resolution, plan.n_per_block)
