"""The angle of the reference shaft, with the speed refined from the vibration itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from operator import itemgetter

import numpy as np

from gearsig.angle import ShaftAngle, estimate_shaft_angle, find_shaft_angle, refine_by_phase
from gearsig.checks import ComplexArray
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import signed
from gearsig.prepared._lines import (
    CLEAR_LINE_DB,
    FOOT_LINES,
    LOG_RATIO_LIMIT,
    Comb,
    LinesOverFloor,
    best_comb,
    lines_over_noise_floor,
    over_floor_db,
    parabola_peak,
    peak_position,
)
from gearsig.recording import MAINS_HZ, Recording
from gearsig.rig import STATED_SPEED_TOLERANCE_PERCENT, ConstantSpeed, Rig, SpeedChannel

STATED_SPEED_TOLERANCE = 0.03
"""Relative tolerance of a stated speed: the slip of an induction motor from no load to full load."""

ROTOR_SPEED_TOLERANCE = STATED_SPEED_TOLERANCE_PERCENT / 100
"""The same without gears, whose sidebands would be mistaken for mesh lines over so wide a range, if two channels show
the shaft."""

LARGEST_DRIFT_REV = 0.01
"""Drift of the angle over the record that averages tolerate: a third of a tooth's pitch for thirty teeth."""

STEADY = 0.01
"""Relative range of a speed channel below which the mesh lines are sought at one speed."""

N_SHAFT_HARMONICS = 8
N_PHASE_HARMONICS = 3
"""Mesh harmonics whose phase an angle may follow."""

FASTEST_IN_HZ = 100.0
"""Usual machines turn at up to 6000 rpm: an unconfirmed speed below this number in rpm may be one in Hz."""

RULES_DB = 20.0
"""Height of a rotor's own line above the floor, and above all others within the tolerance of a stated speed."""

MAINS_TOLERANCE = 0.002
"""Largest relative drift of a supply's frequency; its harmonics, and those of motors, lie within a motor's slip.

It is 100 mHz of 50 Hz: the standard frequency range is ±50 mHz in continental Europe and ±100 mHz in the Nordic grid
(Regulation (EU) 2017/1485, annex III).

Twice the limit for hum in a recording's quality: these lines are only left out, or treated as confirming nothing."""

N_PULLS = 10
"""Multiples of twice a supply's frequency that are put down to its magnetic pull.

The tolerance grows with the multiple, the spacing does not: the tenth covers 4 % of it, the 50th a fifth."""


Transform = Callable[[str], ComplexArray]
"""Returns the `rfft` of a channel by its name."""


def refined_angle(recording: Recording, rig: Rig, transform: Transform | None = None) -> ShaftAngle:
    """Return the angle of the reference shaft, refining a stated speed if the signal shows the true one near it.

    Synchronous averages need the speed to a small fraction of a revolution over the whole record, and nameplates are
    not that accurate.

    Parameters
    ----------
    recording : Recording
    rig : Rig
        Its speed source is used if the recording has none.
    transform : callable or None

    Raises
    ------
    RefusalError
        If the speed cannot be known, the machine is at rest, or it turns faster than half the sampling rate.
    InputError
        If the speed source is malformed, or names a channel or shaft that is not there.
    """
    angle = find_shaft_angle(recording, rig)
    hertz, limit_hz = angle.mean_speed_rpm / 60, recording.sampling_rate_hz / 2
    if hertz >= limit_hz:
        raise RefusalError(
            f"{angle.mean_speed_rpm:.4g} rpm are {hertz:.4g} Hz, above half the sampling rate ({limit_hz:.4g} Hz)",
            remedy="check the speed's unit and the sampling rate",
        )
    if isinstance(recording.speed_source, ConstantSpeed):
        return _refined(recording, rig, angle, transform)
    if isinstance(recording.speed_source, SpeedChannel):
        return _rescaled(recording, rig, angle, transform)
    return angle


def phase_followed_angle(recording: Recording, rig: Rig, estimated: ShaftAngle) -> ShaftAngle:
    """Return an angle estimated from the vibration, made to follow the phase of the mesh harmonics.

    The estimate may hold the speed constant although it varies by some 10⁻⁴. Over hundreds of revolutions that is half
    a tooth, and costs the averages' mesh harmonics decibels.

    Parameters
    ----------
    recording : Recording
    rig : Rig
    estimated : ShaftAngle
        Of the reference shaft; an angle not estimated from the vibration is returned unchanged.
    """
    if estimated.method != "tachless":
        return estimated
    meshes = [order for pair in rig.pairs if (order := rig.mesh_order(pair, estimated.shaft)) is not None]
    orders = tuple(k * order for order in meshes for k in range(1, N_PHASE_HARMONICS + 1))
    followed = refine_by_phase(recording, recording.vibration_names(), estimated, orders)
    return replace(
        estimated,
        time_s=followed.time_s,
        revolutions=followed.revolutions,
        speed_rev_per_s=followed.speed_rev_per_s,
        notes=(*estimated.notes, "the angle follows the phase of the mesh harmonics"),
    )


def _refined(recording: Recording, rig: Rig, stated: ShaftAngle, transform: Transform | None) -> ShaftAngle:
    """Return the speed that mesh lines or shaft harmonics show near the stated one, else the stated one.

    Raises
    ------
    RefusalError
        If the strongest line near it varies, so that there is no single speed.
    """
    if rig.pairs:
        by_lines = _from_meshes(recording, rig, stated, transform)
    else:
        by_lines = _from_shaft_harmonics(recording, stated)
    if by_lines is None:
        if not rig.pairs:
            _refuse_a_wandering_speed(recording, stated)
        note, speed = "The stated speed could not be confirmed from the signal.", stated.mean_speed_rpm
        if speed <= FASTEST_IN_HZ:
            note += f" {speed:.4g} Hz, if these were meant, are {60 * speed:.5g} rpm."
        return replace(stated, quality=0.5, notes=(*stated.notes, note))
    difference = 100 * (by_lines.mean_speed_rpm / stated.mean_speed_rpm - 1)
    lines_say = f"the signal's own lines say {by_lines.mean_speed_rpm:.6g} rpm ({signed(difference, 2)} %)"
    note = f"Stated {stated.mean_speed_rpm:.6g} rpm; {lines_say}."
    return replace(by_lines, shaft=stated.shaft, notes=(*by_lines.notes, note))


BLOCK_REV, MIN_BLOCKS, MAX_BLOCKS = 32, 8, 64
"""Revolutions of a block in which a rotor's own line is sought, and number of blocks, overlapping by half or less."""

NEAR, CLEAR_OF_BLOCK = 0.25, 6.0
"""Relative range around the stated speed in which it is sought, and its height over the median there: in noise the
largest of so many lines reaches twice the median."""

WANDERS = 0.02
"""Relative range over the record above which a line has no single frequency; a motor's load shifts it by less."""


def _refuse_a_wandering_speed(recording: Recording, stated: ShaftAngle) -> None:
    """Refuse a constant speed if a rotor's own line runs steadily through a range of speeds from block to block.

    Lines over the angle of a constant speed would be smeared, and damage hidden by this would be reported as healthy.
    """
    from scipy.fft import rfft

    n = round(BLOCK_REV * recording.sampling_rate_hz * 60 / stated.mean_speed_rpm)
    n_blocks = min(2 * recording.n_samples // n - 1, MAX_BLOCKS)
    if n_blocks < MIN_BLOCKS:
        return
    starts = np.linspace(0, recording.n_samples - n, n_blocks).astype(np.intp)
    first, last = (round(BLOCK_REV * (1.0 + side * NEAR)) for side in (-1, 1))
    window, places = np.hanning(n).astype(np.float32), np.arange(first, last + 1) / BLOCK_REV
    for name in recording.vibration_names():
        values = recording.values(name)
        spectra = np.stack([np.abs(rfft(values[i : i + n] * window)[first : last + 1]) for i in starts])
        stands_out = spectra.max(axis=1) >= CLEAR_OF_BLOCK * np.median(spectra, axis=1)
        orders = [parabola_peak(row, places, 1.0 / BLOCK_REV, row.argmax()) for row in spectra[stands_out]]
        rpm = np.array(orders) * stated.mean_speed_rpm
        low, high = np.quantile(rpm, [0.05, 0.95]) if stands_out.mean() >= 0.8 else (0.0, 0.0)
        if high - low > WANDERS * stated.mean_speed_rpm and np.median(np.abs(np.diff(rpm))) < (high - low) / 5:
            raise RefusalError(
                f"the speed is stated as constant, {stated.mean_speed_rpm:.4g} rpm, and the strongest line of {name} "
                f"near it runs from {low:.4g} to {high:.4g} rpm",
                remedy="give a tachometer or a speed channel",
            )


def _rescaled(recording: Recording, rig: Rig, measured: ShaftAngle, transform: Transform | None) -> ShaftAngle:
    """Return a steady speed channel's angle, rescaled if the mesh lines show another speed.

    Speed channels are accurate to a part in a hundred or a thousand, which is revolutions in a long record.
    """
    if not rig.pairs or not measured.is_steady(STEADY):
        return measured
    by_lines = _from_meshes(recording, rig, measured, transform)
    if by_lines is None:
        return measured
    difference = by_lines.mean_speed_rpm / measured.mean_speed_rpm - 1
    if abs(difference) * measured.n_revolutions < LARGEST_DRIFT_REV:
        return measured
    lines_say = f"the signal's own lines say {by_lines.mean_speed_rpm:.6g} rpm ({signed(100 * difference, 2)} %)"
    note = f"The speed channel says {measured.mean_speed_rpm:.6g} rpm; {lines_say}."
    return replace(by_lines, shaft=measured.shaft, notes=(*by_lines.notes, note))


def _from_meshes(recording: Recording, rig: Rig, stated: ShaftAngle, transform: Transform | None) -> ShaftAngle | None:
    speed = stated.mean_speed_rpm
    limits = (speed * (1 - STATED_SPEED_TOLERANCE), speed * (1 + STATED_SPEED_TOLERANCE))
    try:
        by_lines = estimate_shaft_angle(recording, rig, speed_range_rpm=limits, explained=False, transform=transform)
    except RefusalError:
        return None
    # An estimate that follows a profile may leave the range, for the mesh of wrong tooth counts.
    return by_lines if limits[0] <= by_lines.mean_speed_rpm <= limits[1] else None


def _from_shaft_harmonics(recording: Recording, stated: ShaftAngle) -> ShaftAngle | None:
    """Find the shaft's harmonics in all channels and the envelopes of all bands together.

    Each shows lines of its own, above all a bearing's; the shaft's are common to them. A speed other than the stated
    one must show its first harmonic, and more clearly than any channel's own spectrum shows one at the stated speed. A
    family on multiples of the mains is inconclusive and left out: hum would be taken for the shaft of any motor with
    little slip. Speeds further away are sought only if none is near. Because common lines are clipped, they give the
    fundamental only to a fraction of their width, and a line of the mains beside a harmonic biases it: the peaks in the
    channels' own spectra decide, see `_by_peaks`.
    """
    spectra = list(_spectra_of_shaft(recording))
    channels = spectra[: len(recording.vibration_names())]
    lines = _common_lines(spectra, len(channels))
    nearby = _comb_of_shaft(channels, lines, stated, STATED_SPEED_TOLERANCE)
    near = _from_first_harmonic(channels, stated) if nearby is None else _by_comb(channels, lines, stated, *nearby)
    if near is not None:
        return near
    far = _comb_of_shaft(channels, lines, stated, ROTOR_SPEED_TOLERANCE)
    further = None if far is None else _by_comb(channels, lines, stated, *far)
    if further is None:
        return None
    first_db = [_line_db(excess, further.mean_speed_rpm / 60) for excess in channels]
    return further if sum(db > CLEAR_LINE_DB for db in first_db) >= 2 else None


def _comb_of_shaft(
    channels: list[LinesOverFloor], lines: LinesOverFloor, stated: ShaftAngle, tolerance: float
) -> tuple[Comb, int] | None:
    """Return a shaft's harmonics among the common lines, and the number examined; None if chance explains them."""
    hertz = stated.mean_speed_rpm / 60
    low, high = hertz * (1 - tolerance), hertz * (1 + tolerance)
    harmonics = np.arange(1, N_SHAFT_HARMONICS + 1)
    comb = best_comb(lines, low, high, harmonics)
    mains = [hz for hz in MAINS_HZ if comb and abs(comb.fundamental / hz - 1) <= MAINS_TOLERANCE]
    for mains_hz in mains:
        lines = lines.without_multiples(mains_hz, skirt=MAINS_TOLERANCE)
        comb = best_comb(lines, low, high, harmonics)
    n_harmonics = None if comb is None else _distinguishing_harmonic(channels, comb.fundamental, hertz)
    if comb is not None and n_harmonics is not None:
        nearer, harmonics = abs(comb.fundamental - hertz) / 2, harmonics[:n_harmonics]
        comb = best_comb(lines, hertz - nearer, hertz + nearer, harmonics)
    return None if comb is None or comb.p_value > 1e-3 else (comb, len(harmonics))


def _by_comb(
    channels: list[LinesOverFloor], lines: LinesOverFloor, stated: ShaftAngle, comb: Comb, n_harmonics: int
) -> ShaftAngle | None:
    """Return the angle at the speed of a shaft's harmonics; None if another speed's first harmonic is not clearer."""
    hertz, resolution = stated.mean_speed_rpm / 60, lines.spectrum.resolution
    fundamental_hz = _by_peaks(channels, comb.fundamental)
    if abs(fundamental_hz - hertz) > resolution:
        first_db, stated_db = (max(_line_db(excess, place) for excess in channels) for place in (fundamental_hz, hertz))
        if _line_db(lines, fundamental_hz) <= CLEAR_LINE_DB or first_db < stated_db:
            return None
    return _at(stated, fundamental_hz, resolution / (3 * n_harmonics), min(0.95, 1 - comb.p_value))


def magnetic_pull_near(hertz: float) -> tuple[float, float] | None:
    """Return a supply's frequency and its magnetic pull, the multiple of twice it at a given frequency, in Hz.

    Only the first multiples count, see `N_PULLS`.
    """
    for mains_hz in MAINS_HZ:
        n = round(hertz / (2 * mains_hz))
        if 1 <= n <= N_PULLS and abs(hertz / (2 * n * mains_hz) - 1) <= MAINS_TOLERANCE:
            return mains_hz, 2 * n * mains_hz
    return None


def _by_peaks(channels: list[LinesOverFloor], fundamental_hz: float) -> float:
    """Return the fundamental from the peaks of its harmonics far above the floor, each where it is clearest.

    It is the median of peak over number, weighted by number because precision grows with it; peaks at the magnetic pull
    of a supply are left out. Without such peaks the fundamental is returned unchanged.
    """
    fundamentals, numbers = [], []
    for k in range(1, N_SHAFT_HARMONICS + 1):
        height_db, clearest = max(
            ((_line_db(excess, k * fundamental_hz), excess) for excess in channels), key=itemgetter(0)
        )
        spectrum = clearest.spectrum
        place = spectrum.largest_near(k * fundamental_hz, spectrum.resolution)[0]
        peak_hz = peak_position(spectrum, spectrum.index_of(place))
        if height_db >= RULES_DB and magnetic_pull_near(peak_hz) is None:
            fundamentals.append(peak_hz / k)
            numbers.append(k)
    if not fundamentals:
        return fundamental_hz
    return float(np.quantile(fundamentals, 0.5, weights=numbers, method="inverted_cdf"))


def _distinguishing_harmonic(channels: list[LinesOverFloor], fundamental_hz: float, stated_hz: float) -> int | None:
    """Return the lowest harmonic that separates two speeds if it is clearly at the stated one, else None.

    Higher harmonics of a speed that is off by a line or two may be a race's lines, flanked by the shaft's sidebands.
    """
    apart = max(abs(fundamental_hz - stated_hz), 1e-12)
    h = 1 + int(2 * channels[0].spectrum.resolution / apart)
    if not 1 < h <= N_SHAFT_HARMONICS:
        return None  # the first harmonic is tested anyway, or the speeds are the same
    fundamental_db, stated_db = (
        max(_line_db(excess, h * hz) for excess in channels) for hz in (fundamental_hz, stated_hz)
    )
    return h if stated_db > max(fundamental_db, CLEAR_LINE_DB) else None


def _at(stated: ShaftAngle, hertz: float, uncertainty_hz: float, quality: float) -> ShaftAngle:
    factor = hertz / (stated.mean_speed_rpm / 60)
    return replace(
        stated,
        revolutions=stated.revolutions * factor,
        speed_rev_per_s=stated.speed_rev_per_s * factor,
        relative_speed_uncertainty=uncertainty_hz / hertz,
        quality=quality,
    )


def _from_first_harmonic(channels: list[LinesOverFloor], stated: ShaftAngle) -> ShaftAngle | None:
    """Use the line near the stated speed that dominates a channel's spectrum there, of a rotor without harmonics.

    A line at a supply's frequency leaves the speed unconfirmed.
    """
    hertz = stated.mean_speed_rpm / 60
    for excess in channels:
        values, positions = excess.spectrum.values, excess.spectrum.positions
        near = np.flatnonzero(np.abs(positions / hertz - 1) <= STATED_SPEED_TOLERANCE)
        if len(near) < 2 * FOOT_LINES + 2:
            continue
        top = int(near[np.argmax(values[near])])
        away_from_top = near[np.abs(near - top) > FOOT_LINES]
        rules = values[top] >= 10 ** (RULES_DB / 20) * max(values[away_from_top].max(initial=0.0), excess.floor[top])
        peak_hz = peak_position(excess.spectrum, top)
        if rules and near[0] < top < near[-1]:
            is_supply = any(abs(peak_hz / hz - 1) <= MAINS_TOLERANCE for hz in MAINS_HZ)
            if not is_supply:
                return _at(stated, peak_hz, excess.spectrum.resolution / 4, 0.9)
            if abs(peak_hz / hertz - 1) <= MAINS_TOLERANCE:  # a shaft's or the supply's: it confirms nothing
                return _at(stated, peak_hz, excess.spectrum.resolution / 4, 0.5)
    return None


def _common_lines(spectra: list[LinesOverFloor], n_first: int) -> LinesOverFloor:
    """Return the lines over frequency that all channels and the envelopes of their bands have in common.

    They are the mean over the spectra of ln(power/floor), each clipped so that no single one decides. The `n_first`
    spectra of the channels themselves, which come first, count half of all: unbalance and bow are lines there, and
    hardly modulate.
    """
    weights = np.full(len(spectra), 0.5 / max(len(spectra) - n_first, 1))
    weights[:n_first] = 0.5 / n_first
    n = min(len(excess.floor) for excess in spectra)
    log_ratios = [
        np.log(np.maximum(excess.spectrum.values[:n], 1e-300) / np.maximum(excess.floor[:n], 1e-300))
        for excess in spectra
    ]
    mean = np.average(np.clip(log_ratios, -1.0, 1.5 * LOG_RATIO_LIMIT / 2), axis=0, weights=weights)
    first = spectra[0].spectrum
    return lines_over_noise_floor(replace(first, values=np.exp(mean), positions=first.positions[:n], unit=""))


def _line_db(excess: LinesOverFloor, place: float) -> float:
    """Return the height over the floor of the largest line within one line of a place."""
    position, amplitude = excess.spectrum.largest_near(place, excess.spectrum.resolution)
    return over_floor_db(amplitude, float(excess.floor[excess.spectrum.index_of(position)]))


def _spectra_of_shaft(recording: Recording) -> Iterator[LinesOverFloor]:
    """Yield the spectra of all vibration channels, then those of their envelopes, all of the same resolution."""
    from gearsig.spectra import amplitude_spectrum, envelope_recording

    sources = [recording]
    for band in envelope_bands(recording.sampling_rate_hz):
        with suppress(InputError):  # the record is too short for so narrow a band
            sources.append(envelope_recording(recording, band, kind="magnitude"))
    for source in sources:
        yield from (lines_over_noise_floor(amplitude_spectrum(source, name)) for name in source.vibration_names())


# --------------------
# Bands whose envelopes are searched.
# --------------------


DIVISIONS = (1, 2, 6)
"""The spectrum as a whole, in halves and in sixths: wide bands gather weak impacts, narrow ones exclude gears."""

LOWEST_BAND_HZ = 300.0
"""Below it shaft and first mesh harmonics dominate; impacts of a bearing ring at structural resonances above."""


def envelope_bands(sampling_rate_hz: float) -> tuple[tuple[float, float], ...]:
    """Return bands of equal relative width, coarse and fine, that cover the spectrum up to 0.45 of the sampling rate.

    Several bands are searched instead of one selected by its kurtosis: in a gearbox the kurtosis is as often due to the
    gears, and the family of lines itself shows which band carries it.

    Parameters
    ----------
    sampling_rate_hz : float

    Returns
    -------
    tuple of (float, float)
        Lower and upper edge, Hz; coarse bands first.
    """
    top = 0.45 * sampling_rate_hz
    low = min(LOWEST_BAND_HZ, top / 4)
    edges = [[low * (top / low) ** (i / n) for i in range(n + 1)] for n in DIVISIONS]
    return tuple(band for division in edges for band in pairwise(division))
