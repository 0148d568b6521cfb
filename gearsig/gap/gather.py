"""From a recording to its sums over blocks of revolutions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gearsig.angle.types import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap.averages import joint_averages
from gearsig.gap.frame import GearFrame, gear_frame
from gearsig.gap.gathered import ChannelSums, Gathered
from gearsig.gap.hum import mains_lines
from gearsig.gap.speed import speed_figures
from gearsig.recording.types import Recording
from gearsig.rig.types import Rig
from gearsig.severity.shaft_lines import has_mark

LEAST_REVOLUTIONS = 16
"""Of the driver and of the driven gear: fewer leave either shaft's orders in the other's average."""

REVOLUTIONS_PER_BLOCK = 20
FEWEST_BLOCKS, MOST_BLOCKS = 4, 8
"""Blocks long enough to tell bearing orders from shaft orders, and enough of them for a jackknife."""

N_BANDS = 4
LOWEST_BAND_HZ = 300.0
HIGHEST_CYCLE, BEYOND_THE_MESH = 40.0, 5.0
"""Modulation orders are looked at up to here, in orders of the driver, or to so many beyond the mesh order."""

NEAR_THE_EXTREME = 0.005
"""A sample within this share of the largest magnitude counts as close to it."""


def gather(recording: Recording, rig: Rig, channels: Sequence[str] = (), angle: ShaftAngle | None = None) -> Gathered:
    """Reduce a recording to what the features need.

    Parameters
    ----------
    recording : Recording
    rig : Rig
        With one gear pair.
    channels : sequence of str
        Default: all vibration channels.
    angle : ShaftAngle or None
        Of the rig's reference shaft; None: found as `analyze` finds it.

    Raises
    ------
    RefusalError
        If the speed cannot be known, there are too few revolutions, or the mesh lies above what is sampled.
    """
    frame = gear_frame(rig)
    turned = angle if angle is not None else _angle_of(recording, rig)
    shaft_angles = tuple(_of_shaft(turned, rig, shaft) for shaft in frame.shafts)
    for own in shaft_angles:
        if own.n_revolutions < LEAST_REVOLUTIONS:
            raise RefusalError(
                f"shaft {own.shaft!r} turns {own.n_revolutions:.3g} times in the record, "
                f"{LEAST_REVOLUTIONS} are needed",
                remedy="record longer",
            )
    names = tuple(channels) or recording.vibration_names()
    signals = tuple(_over_angle(recording, own, names) for own in shaft_angles)
    n_blocks = int(np.clip(shaft_angles[0].n_revolutions // REVOLUTIONS_PER_BLOCK, FEWEST_BLOCKS, MOST_BLOCKS))
    speed_hz = shaft_angles[0].mean_speed_rpm / 60.0
    _check_mesh(signals[0], frame, recording, speed_hz)
    bands = _bands(recording.sampling_rate_hz, signals[0].samples_per_revolution * speed_hz)
    sums, steps = {}, (0.0, 0.0)
    for i, name in enumerate(names):
        sums[name], steps = _channel_sums(signals, i, recording.values(name), frame, n_blocks, bands, speed_hz)
    return Gathered(
        frame=frame,
        channels=sums,
        order_step=steps[0],
        cycle_step=steps[1],
        bands_hz=bands,
        highest_order=signals[0].highest_order,
        speed_hz=speed_hz,
        speed=speed_figures(shaft_angles[0], frame.shaft_orders[1:]),
        hum=mains_lines(recording, names, speed_hz, frame),
        marks=tuple(has_mark(recording, rig, shaft) for shaft in frame.shafts),  # type: ignore[arg-type]  # two
        n_revolutions=shaft_angles[0].n_revolutions,
    )


def _check_mesh(signal: AngleSignal, frame: GearFrame, recording: Recording, speed_hz: float) -> None:
    """Refuse a record that was sampled too slowly to hold the mesh and its sidebands, which all is compared with."""
    if signal.highest_order < frame.teeth[0] + max(frame.shaft_orders):
        mesh_hz = frame.teeth[0] * speed_hz
        raise RefusalError(
            f"the gears mesh at {mesh_hz:.4g} Hz, above what {recording.sampling_rate_hz:.6g} Hz of sampling rate show",
            remedy=f"sample at {4.0 * mesh_hz:.2g} Hz at least",
        )


def _angle_of(recording: Recording, rig: Rig) -> ShaftAngle:
    from gearsig.diagnosis.speed import determine_angle, exact_angle
    from gearsig.diagnosis.types import CannotTell

    found = determine_angle(recording, rig)
    if isinstance(found, CannotTell):
        raise RefusalError(found.reason, remedy=found.remedy)
    return exact_angle(recording, rig, found).between(0.0, recording.duration_s)


def _of_shaft(angle: ShaftAngle, rig: Rig, shaft: str) -> ShaftAngle:
    ratio = rig.ratio(shaft, to=angle.shaft or rig.reference_shaft)
    if ratio is None:
        raise RefusalError(f"the speed of shaft {shaft!r} does not follow from the teeth", remedy="complete the rig")
    return angle if ratio == 1.0 else angle.of_shaft(shaft, ratio)


def _over_angle(recording: Recording, angle: ShaftAngle, names: Sequence[str]) -> AngleSignal:
    from gearsig.angle.resample import resample_to_angle

    return resample_to_angle(recording, angle, channels=names)


def _bands(sampling_rate_hz: float, angle_rate_hz: float) -> tuple[tuple[float, float], ...]:
    """Bands of equal relative width, then all of them together."""
    top = 0.42 * min(sampling_rate_hz, angle_rate_hz)
    low = min(LOWEST_BAND_HZ, top / 8.0)
    edges = [low * (top / low) ** (i / N_BANDS) for i in range(N_BANDS + 1)]
    return (*pairwise(edges), (low, top))


def _channel_sums(
    signals: tuple[AngleSignal, ...],
    channel: int,
    raw: FloatArray,
    frame: GearFrame,
    n_blocks: int,
    bands: Sequence[tuple[float, float]],
    speed_hz: float,
) -> tuple[ChannelSums, tuple[float, float]]:
    joint = joint_averages(signals, channel, frame)
    lines, counts = [], []
    for revolutions in joint.revolutions:
        edges = np.linspace(0, len(revolutions), n_blocks + 1).round().astype(np.intp)
        averages = np.stack([revolutions[i:j].mean(axis=0) for i, j in pairwise(edges)])
        lines.append(2.0 * np.fft.rfft(averages, axis=1) / averages.shape[1])
        counts.append(np.diff(edges).astype(np.float64))
    n = signals[0].samples_per_revolution
    power, order_step = _segment_power(joint.residual, n, n_blocks)
    highest_cycle = min(max(HIGHEST_CYCLE, frame.teeth[0] + BEYOND_THE_MESH), 0.4 * n)
    envelopes, moments, cycle_step = _envelopes(joint.residual, n, n_blocks, bands, speed_hz, highest_cycle)
    sums = ChannelSums((lines[0], lines[1]), (counts[0], counts[1]), power, envelopes, moments, _tail(raw, n_blocks))
    return sums, (order_step, cycle_step)


def _segment_power(values: FloatArray, rate: float, n_segments: int) -> tuple[FloatArray, float]:
    """Return the Hann power spectra (mean square per line) of equal segments and the lines' distance."""
    from scipy.fft import rfft

    length = len(values) // n_segments
    segments = values[: length * n_segments].reshape(n_segments, length)
    window = np.hanning(length + 1)[:-1]
    spectrum = rfft((segments - segments.mean(axis=1, keepdims=True)) * window, axis=1)
    power: FloatArray = 2.0 * np.abs(spectrum) ** 2 / (length * np.sum(window**2))
    return power, rate / length


def _envelopes(
    residual: FloatArray,
    n_per_rev: int,
    n_blocks: int,
    bands: Sequence[tuple[float, float]],
    speed_hz: float,
    highest_cycle: float,
) -> tuple[FloatArray, FloatArray, float]:
    """Return spectra of squared envelopes over their squared mean, the bands' moments, and the spectra's step."""
    from scipy.fft import irfft, next_fast_len, rfft

    n = len(residual)
    lines = rfft(residual)
    m = 2 * next_fast_len(int(highest_cycle * n / n_per_rev) + 1)
    powers, moments, step = [], [], 0.0
    for low, high in bands:
        first, last = (int(f / speed_hz * n / n_per_rev) for f in (low, high))
        square = _squared_envelope(lines[first : min(last, len(lines) - 1)], n)
        # |z|² is low-passed to the modulation orders of interest by keeping its first lines.
        slow_lines = np.zeros(m // 2 + 1, dtype=np.complex128)
        kept = rfft(square)[: m // 2 + 1] * (m / len(square))
        slow_lines[: len(kept)] = kept
        slow = irfft(slow_lines, m)
        power, step = _segment_power(slow / max(slow.mean(), 1e-300), m / n * n_per_rev, n_blocks)
        powers.append(power)
        edges = np.linspace(0, len(square), n_blocks + 1).astype(np.intp)
        # With z the analytic signal: E x² = E|z|²/2, E x⁴ = 3/8 E|z|⁴.
        moments.append([[square[i:j].mean() / 2.0, 0.375 * (square[i:j] ** 2).mean()] for i, j in pairwise(edges)])
    return np.stack(powers, axis=1), np.asarray(moments).transpose(1, 0, 2), step


def _squared_envelope(band: NDArray[np.complex128], n: int) -> FloatArray:
    """Return |z|² of a band of lines of n samples, at just the rate that it needs: twice the band's width."""
    from scipy.fft import ifft, next_fast_len

    m = next_fast_len(2 * len(band) + 1)
    z = ifft(2.0 * band, m) * (m / n)
    square: FloatArray = z.real**2 + z.imag**2
    return square


def _tail(raw: FloatArray, n_blocks: int) -> FloatArray:
    values = np.asarray(raw, dtype=np.float64) - float(np.mean(raw))
    top, bottom = values.max(), values.min()
    near = (values > top - NEAR_THE_EXTREME * abs(top)) | (values < bottom + NEAR_THE_EXTREME * abs(bottom))
    edges = np.linspace(0, len(values), n_blocks + 1).astype(np.intp)
    return np.array(
        [[(values[i:j] ** 2).mean(), (values[i:j] ** 4).mean(), near[i:j].mean()] for i, j in pairwise(edges)]
    )
