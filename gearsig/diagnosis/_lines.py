"""Lines at or away from where speed and teeth put them: speed, meshes, mains, and the strongest unexplained line."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from math import gcd, isfinite

import numpy as np
from numpy.typing import NDArray

from gearsig.angle import ShaftAngle
from gearsig.checks import FloatArray
from gearsig.diagnosis._signals import AnalysisSignals, PlacedLine, line_at
from gearsig.diagnosis._types import CannotTell, Finding, Kind, Where, cannot_tell
from gearsig.prepared import (
    RUN_UP_FOOT_ORDERS,
    LinesOverFloor,
    lines_over_noise_floor,
    magnetic_pull_near,
    neighbour_levels,
    peak_position,
)
from gearsig.recording import MAINS_HZ, MAINS_WANDER
from gearsig.rig import GearPair, hunting_tooth_order
from gearsig.spectra import Spectrum

N_HARMONICS = 3
"""Multiples of a mesh or shaft order that are examined."""

N_COUNTED = 12
"""Multiples whose common divisor is sought: half of them would lie between those of a shaft twice as fast."""

CLEAR_DB = 12.0
"""A line that noise alone exceeds once in 10⁷: power over mean floor is exponential, exp(-15.8) (12 dB)."""

CONTRADICTED_DB, CONTRADICTED_BY_ONE_DB = 10.0, 20.0
"""Excess of true mesh lines over the stated ones: more than sidebands exceed their carriers in several harmonics at
once, always on the same side; the second value applies if only the first harmonic shows."""

UNEXPLAINED_DB = 15.0
"""Power over mean floor that noise exceeds in one line of 10¹³: a probability of 10⁻⁷ even over a million lines."""

MESH_ELSEWHERE = "mesh-elsewhere"
"""Code of the finding that mesh lines lie at another multiple of the stated speed."""

_OVER_FLOOR = "height over the noise floor"
_UNKNOWN_CAUSE = f"{_OVER_FLOOR}; what causes it is not known"

SPEED_UNKNOWN = "speed-unknown"
"""Code of the finding that the speed is not known."""

NEAR_ZERO = "speed-near-zero"
"""Code of the finding that the shaft comes near standstill within the record."""

SURER_BEYOND_ZERO = "An encoder, which shows the direction; or analyse the parts before and after separately."


def speed_finding(angle: ShaftAngle | CannotTell) -> Finding:
    """Return the finding on the speed and how it was found, or that it is not known."""
    if isinstance(angle, CannotTell):
        why = "The machine is at rest" if "at rest" in angle.reason else "The speed is not known"
        title = f"{why}: orders, synchronous averages and everything based on them are left out."
        surer = f"{angle.remedy[:1].upper()}{angle.remedy[1:].rstrip('.')}." if angle.remedy else ""
        return cannot_tell(SPEED_UNKNOWN, title, evidence=(angle.reason,), surer=surer)
    uncertainty = angle.relative_speed_uncertainty
    plus_minus = f" ± {uncertainty * angle.mean_speed_rpm:.2g}" if isfinite(uncertainty) else ""
    named = f"Shaft {angle.shaft}" if angle.shaft else "The shaft"
    text = f"{named} turns at {angle.mean_speed_rpm:.6g}{plus_minus} rpm"
    low, high = angle.speed_range_rpm
    if not angle.is_steady():  # the mean's uncertainty would be mistaken for the speed's
        text = f"{named} turns at {low:.5g} to {high:.5g} rpm, {angle.mean_speed_rpm:.5g} rpm on average"
    elif not angle.is_steady(0.001):
        text += f", between {low:.5g} and {high:.5g} rpm"
    return Finding(
        "speed",
        Kind.INFORMATION,
        f"{text} ({angle.method}, {angle.n_revolutions:.5g} revolutions).",
        Where(shaft=angle.shaft, time_s=(angle.start_s, angle.end_s)),
        confidence=angle.quality,
        confidence_basis="quality of the speed as found",
        evidence=angle.notes,
        surer="" if angle.method in ("pulses", "encoder") else "A tachometer: it also fixes the zero of the angle.",
    )


# Whether the vibration itself confirms the speed and the teeth: only then is "nothing shows" meaningful.


def clearest_line(signals: AnalysisSignals, order: float) -> tuple[PlacedLine, str, int] | None:
    """Return the clearest of the first multiples of `order` over all channels, its channel, and its harmonic.

    None if no multiple is within the spectra.
    """
    lines = [
        (line, channel, h)
        for channel, excess in signals.order_excess.items()
        for h in range(1, N_HARMONICS + 1)
        if (line := line_at(excess, h * order)) is not None
    ]
    return max(lines, key=lambda place: (_is_clear(place[0]), place[0].ratio_db), default=None)


def _is_clear(line: PlacedLine) -> bool:
    """Whether a line stands out at its expected place; a slightly wrong speed moves it away."""
    return line.is_highest and line.ratio_db >= CLEAR_DB


def _is_confirmed(signals: AnalysisSignals, order: float | None) -> bool:
    clearest = clearest_line(signals, order) if order is not None else None
    return clearest is not None and _is_clear(clearest[0])


def mesh_is_confirmed(signals: AnalysisSignals, pair: GearPair) -> bool:
    """Whether a mesh line of `pair` stands where speed and teeth put it."""
    return _is_confirmed(signals, signals.rig.mesh_order(pair))


def speed_is_confirmed(signals: AnalysisSignals) -> bool:
    """Whether any mesh line, or any shaft's line if no mesh is known, stands where the speed puts it.

    False if all of these lines would also be there with shafts turning a whole number of times as fast.
    """
    orders = signals.known_mesh_orders.values() or signals.known_shaft_orders.values()
    seen = signals.angle is not None and any(_is_confirmed(signals, order) for order in orders)
    return seen and possible_speed_factor(signals) == 1


def possible_speed_factor(signals: AnalysisSignals) -> int:
    r"""Return the factor of speed or sampling rate that the lines of shafts and meshes do not rule out; 1: none.

    If the rate is m times too high, or the speed stated m times too low, the lines stand at the orders m, 2m, ... and a
    part identified by its order is the wrong one. The lines rule this out if the greatest common divisor of the
    multiples h at which a line stands, over all shafts, meshes and channels, is 1: the first alone is enough, or the
    second and the third.

    Parameters
    ----------
    signals : AnalysisSignals

    Returns
    -------
    int
        Also 1 if no line stands out, or only a single high one, and for a measured speed, whose orders a wrong rate
        does not move.
    """
    if signals.angle is None or signals.angle.method != "constant":
        return 1
    orders = {*signals.known_mesh_orders.values(), *signals.known_shaft_orders.values()}
    seen = {
        h
        for excess in signals.order_excess.values()
        for order in orders
        for h in range(1, N_COUNTED + 1)
        if (line := line_at(excess, h * order)) is not None and _is_clear(line)
    }
    if len(seen) == 1 and not seen & set(range(1, N_HARMONICS + 1)):
        return 1  # a single line this high may have any cause
    return gcd(*seen) or 1


SPREAD_OF_STATED = 0.01
"""Relative half width over which a shaft's lines spread if its speed is taken as constant: a speed that varies by as
much is called steady."""

STANDING_OUT_DB, GONE_DB = 24.0, 12.0
"""Height at which a line can be followed over blocks of a few revolutions, and level below its usual one at which it is
gone: with noise alone it falls by 24 dB, and two beating lines do not vanish together."""


def detect_standstill(signals: AnalysisSignals) -> list[Finding]:
    """Report that the lines of shafts and meshes vanish for a while, if no tachometer gives the speed.

    A stated speed, or one estimated from the lines of most of the record, does not reveal a stop or a reversal.
    """
    angle = signals.angle
    if angle is None or angle.method not in ("constant", "tachless") or not angle.is_steady():
        return []
    gone = _without_lines(signals)
    if gone is None:
        return []
    start_s, end_s = (angle.start_s + turns / angle.n_revolutions * (angle.end_s - angle.start_s) for turns in gone)
    title = (
        f"The lines of shafts and meshes are gone between {start_s:.3g} and {end_s:.3g} s: the machine is at rest, "
        "reverses or runs at another speed."
    )
    where = Where(shaft=angle.shaft, time_s=(start_s, end_s))
    return [Finding(NEAR_ZERO, Kind.DATA_PROBLEM, title, where, surer=SURER_BEYOND_ZERO)]


def _without_lines(signals: AnalysisSignals) -> tuple[float, float] | None:
    """Return the first and last revolution without any line of a shaft or mesh, None if some line is always there.

    Blocks of a few revolutions overlap by half and are as short as lines of two orders allow to stand out.
    """
    signal = signals.over_angle
    if signal is None:
        return None
    orders = {h * order for order in signals.known_mesh_orders.values() for h in range(1, N_HARMONICS + 1)}
    orders |= {h * order for order in signals.known_shaft_orders.values() for h in range(1, N_COUNTED + 1)}
    for n_turns in (4, 8, 16):
        n_block, beside = n_turns * signal.samples_per_revolution, n_turns // 2  # half an order, between the sidebands
        if signal.samples.shape[1] < 4.5 * n_block:  # eight blocks at half overlap
            break
        above = {round(order * n_turns) for order in orders if order > 0.5}
        places = sorted(place for place in above if place + beside <= n_block // 2)
        bins = np.array(places, np.int64)[:, None] + np.array([-beside, -1, 0, 1, beside])
        profiles: dict[int, list[FloatArray]] = {}
        for values in signal.samples:
            for place, levels in zip(places, _levels_over_blocks(values, n_block, bins), strict=True):
                profile = levels[:, 1:4].max(axis=1)
                usual = float(np.percentile(profile, 75))
                noise = float(np.median(levels[:, [0, 4]]))
                if usual > noise * 10 ** (STANDING_OUT_DB / 20):
                    profiles.setdefault(place, []).append(profile / usual)
        if len(profiles) < 2:
            continue
        highest = np.max([profile for every in profiles.values() for profile in every], axis=0)
        gone = np.flatnonzero(highest < 10 ** (-GONE_DB / 20))
        if not len(gone):
            return None
        return float(gone[0] * n_turns / 2), float(gone[-1] * n_turns / 2 + n_turns)
    return None


def _levels_over_blocks(values: FloatArray, n_block: int, bins: NDArray[np.int64]) -> FloatArray:
    """Return the Hann-windowed spectrum's moduli at some bins, (n_lines, n_blocks, n_bins), of half overlapping blocks.

    The blocks are a view and are transformed a few at a time, so that a long signal is not copied.
    """
    blocks = np.lib.stride_tricks.sliding_window_view(values, n_block)[:: n_block // 2]
    window, n_at_once = np.hanning(n_block), max(1, 2**20 // n_block)
    parts = [
        np.abs(np.fft.rfft(blocks[start : start + n_at_once] * window, axis=1)[:, bins])
        for start in range(0, len(blocks), n_at_once)
    ]
    return np.concatenate(parts).transpose(1, 0, 2)


def detect_mesh(signals: AnalysisSignals) -> list[Finding]:
    """Report each pair's mesh, or that it is not where it should be."""
    if signals.angle is None:
        return []
    return [finding for pair in signals.rig.pairs if (finding := _mesh_finding(signals, pair)) is not None]


def _mesh_finding(signals: AnalysisSignals, pair: GearPair) -> Finding | None:
    mesh = signals.rig.mesh_order(pair)
    if mesh is None:
        surer = "Give the teeth of one of its gears and of all gears between it and the speed's shaft."
        title = f"The mesh order of {pair.name} is not known."
        return cannot_tell("mesh-order-unknown", title, Where(gear=pair.name), surer=surer)
    where = signals.where(mesh, gear=pair.name)
    hertz, nyquist = mesh * signals.frequency_per_order_hz, signals.recording.sampling_rate_hz / 2
    if hertz >= nyquist:
        return cannot_tell(
            "mesh-above-sampling",
            f"The mesh of {pair.name} would be at {hertz:.5g} Hz, above half the sampling rate ({nyquist:.5g} Hz).",
            where,
            evidence=("Sampling rate, speed and teeth cannot all be right, or the recording was made too slowly.",),
            surer="Check the sampling rate and the teeth; record at three times the mesh frequency or more.",
        )
    order = teeth_are_contradicted(signals, pair)
    if order is not None:
        way, above = "lower" if order < mesh else "higher", f"{CONTRADICTED_DB:.0f} dB or more above"
        return cannot_tell(
            "teeth-disagree",
            f"The mesh lines of {pair.name} are at order {order:.6g}, the rig says {mesh:.6g}: check the teeth.",
            signals.where(order, gear=pair.name),
            evidence=(
                f"The lines there are {above} those at {mesh:.6g}, at every harmonic that shows.",
                f"A speed that is {100 * abs(order / mesh - 1):.2f} % {way} would do the same.",
            ),
            surer="Count the teeth, and check pulses per revolution and the shaft that the speed belongs to.",
        )
    clearest = clearest_line(signals, mesh)
    if clearest is None:
        return None
    line, channel, harmonic = clearest
    strength = line.strength("noise floor of the order spectrum")
    if _is_clear(line):
        where = signals.where(line.position, channel, gear=pair.name)
        title = f"The mesh of {pair.name} shows at order {line.position:.6g} ({signals.hertz_text(line.position, 6)}, "
        title += f"harmonic {harmonic})."
        return Finding("mesh-found", Kind.INFORMATION, title, where, strength, 0.99, _OVER_FLOOR)
    near = f"The best of {N_HARMONICS} harmonics is {line.ratio_db:.1f} dB over the floor."
    if not line.is_highest:
        near = f"Near harmonic {harmonic} a line is beside its expected place: the speed may be slightly wrong, and "
        near += "small errors smear all averages."
    # The multiple of the stated speed at which the mesh lines do lie; none if another pair's are at their place.
    others = (clearest_line(signals, order) for p in signals.rig.pairs if (order := signals.rig.mesh_order(p)))
    elsewhere = None if any(other and _is_clear(other[0]) for other in others) else signals.offset_comb
    title = (
        f"No mesh line of {pair.name} where speed and teeth put it (order {mesh:.6g}, {signals.hertz_text(mesh, 6)})"
    )
    if elsewhere is not None:
        title += f", but at {elsewhere.factor:.4g} times: sampling rate, speed or teeth are wrong"
    return Finding(
        "mesh-absent" if elsewhere is None else MESH_ELSEWHERE,
        Kind.CANNOT_TELL if elsewhere is None else Kind.DATA_PROBLEM,
        f"{title}.",
        where,
        strength,
        evidence=(near,) if elsewhere is None else (elsewhere.text, near),
        surer="Check sampling rate, speed source (pulses per revolution, shaft) and teeth; or the gears carry no load.",
    )


def teeth_are_contradicted(signals: AnalysisSignals, pair: GearPair) -> float | None:
    """Return the order at which the mesh lines of `pair` really are, None if nothing contradicts the stated teeth.

    With d teeth more than stated (up to three either way) on the gear from whose shaft the mesh order is computed, the
    lines stand at h·(mesh + d·shaft) instead of h·mesh. Lines at the stated place are then only sidebands, and
    everything attributed to teeth is wrong.

    Parameters
    ----------
    signals : AnalysisSignals
    pair : GearPair

    Returns
    -------
    float or None
        In cycles per revolution of the reference shaft.
    """
    mesh = signals.rig.mesh_order(pair)
    if mesh is None or not signals.order_excess:
        return None
    # The pair's shafts, as far as their orders are known without its teeth; the contact may be this pair's. The pair
    # itself stays: without a middle stage the gear train would fall apart.
    toothless = replace(pair, driver_teeth=None, driven_teeth=None)
    pairs = tuple(toothless if p is pair else p for p in signals.rig.pairs)
    without = replace(signals.rig, pairs=pairs, contact=None)
    steps = [without.ratio(shaft, to=signals.rig.reference_shaft) for shaft in (pair.driver, pair.driven)]
    near = max(3.0 * excess.spectrum.resolution for excess in signals.order_excess.values())
    meshes = [other for other in signals.known_mesh_orders.values() if abs(other - mesh) > near]
    others = [h * other for other in meshes for h in range(1, N_HARMONICS + 1)]
    # Once-per-turn impacts on a shaft beside the pair raise all its multiples; those of slower shafts lie everywhere.
    faster = [
        turns
        for shaft, turns in signals.known_shaft_orders.items()
        if shaft not in (pair.driver, pair.driven) and all(step is None or turns > step for step in steps)
    ]
    margins: dict[float, float] = {}
    for step in (step for step in steps if step is not None):
        for order in (mesh + d * step for d in (-3, -2, -1, 1, 2, 3)):
            beside = [*others, *(round(order / turns) * turns for turns in faster)]
            if order > step and all(abs(other - order) > near for other in beside):
                by_channel = [_margin_db(excess, mesh, order) for excess in signals.order_excess.values()]
                seen = [margin for margin in by_channel if margin is not None]
                if seen:
                    margins[order] = max(float(np.median(seen)), margins.get(order, -np.inf))
    best = max(margins, key=lambda order: margins[order], default=None)
    return best if best is not None and margins[best] > 0 else None


def _margin_db(excess: LinesOverFloor, mesh: float, order: float) -> float | None:
    """Return by how many dB the lines at multiples of `order` contradict those of `mesh` in the worst harmonic.

    Positive: they do. Each is compared with the stated line and with its mirror image about it, as modulation has
    sidebands on both sides. None if no harmonic shows in either place, or only a higher one.
    """
    margins: dict[int, float] = {}
    for h in range(1, N_HARMONICS + 1):
        # The true place, the stated one, and the mirror image of the true one.
        lines = [line_at(excess, h * place) for place in (order, mesh, 2 * mesh - order)]
        true, stated, mirrored = lines
        if true is None or stated is None or mirrored is None:
            break
        if _is_clear(true):
            margins[h] = true.level_db - max(stated.level_db, mirrored.level_db)
        elif _is_clear(stated):
            margins[h] = -CONTRADICTED_DB
    if not margins or set(margins) in ({2}, {3}):
        return None  # a wrong speed can put any mesh on a single higher line by chance
    return min(margins.values()) - (CONTRADICTED_DB if len(margins) > 1 else CONTRADICTED_BY_ONE_DB)


# Single lines: the mains', and the strongest line that belongs to nothing known.


def detect_lines(signals: AnalysisSignals, trains: Sequence[float] = (), named: Sequence[float] = ()) -> list[Finding]:
    """Report mains hum and the strongest unexplained line; without a speed, the strongest line as a start.

    Parameters
    ----------
    signals : AnalysisSignals
    trains : sequence of float
        Orders of impacts in the envelopes, which also appear beside the meshes.
    named : sequence of float
        Those among them that are a bearing's, which explains their multiples.
    """
    strongest = _unexplained(signals, trains, named) if signals.order_excess else _strongest(signals)
    return [finding for finding in (_mains(signals), strongest) if finding is not None]


def _mains(signals: AnalysisSignals) -> Finding | None:
    """Search for lines at the mains frequency and its first multiples that no shaft explains.

    Without a speed, a shaft may still cause them: that of a two-pole motor, or one not driven by the mains at all.
    """
    lines = mains_lines(signals)
    if lines is None:
        return None
    name, mains, line = lines
    times = max(1, round(line.position / mains))
    title = f"Lines of the {mains:.0f} Hz mains stand in channel {name}."
    confidence, surer = 0.8, "Switch the machine off and record again: hum stays."
    if signals.angle is None:
        hertz = line.position / times
        title = f"Lines at {hertz:.4g} Hz and multiples stand in channel {name}: the {mains:.0f} Hz mains, or a shaft "
        title += f"at {60 * hertz:.4g} rpm."
        confidence, surer = 0.5, f"Give the speed; or {surer[:1].lower()}{surer[1:]}"
    return Finding(
        "mains-hum",
        Kind.NOTICE,
        title,
        Where((name,), frequency_hz=mains),
        line.strength("noise floor of the spectrum"),
        confidence=confidence,
        confidence_basis=f"two of the first three multiples within {100 * MAINS_WANDER:g} %",
        surer=surer,
    )


def mains_lines(
    signals: AnalysisSignals, scale: float = 1.0, slower: Sequence[float] = (1.0,)
) -> tuple[str, float, PlacedLine] | None:
    """Return the channel, the frequency and the first line of the mains, None where they do not stand out.

    Parameters
    ----------
    signals : AnalysisSignals
    scale : float
        True sampling rate over the stated one: the lines are sought at 1/scale of their frequency.
    slower : sequence of float
        Stated speed over speeds at which the shafts may turn: a multiple of one of these is not a mains line.
    """
    for name, spectrum in signals.spectra.items():
        if spectrum.resolution * scale > 0.5:
            continue  # mains and shaft lines cannot be distinguished
        excess = lines_over_noise_floor(spectrum, 4.0 * max(MAINS_HZ) / scale)
        for mains in MAINS_HZ:
            lines = [_peak_at(excess, k * mains / scale, MAINS_WANDER) for k in (1, 2, 3)]
            clear = [line for line in lines if line is not None and line.ratio_db > UNEXPLAINED_DB]
            if len(clear) >= 2 and not any(_is_synchronous(signals, mains / scale, times) for times in slower):
                return name, mains, clear[0]
    return None


def _peak_at(excess: LinesOverFloor, place: float, within: float) -> PlacedLine | None:
    """Return the interpolated peak within a relative distance of a place, or a sixth of a line; None without one."""
    spectrum = excess.spectrum
    reach = max(within * place, spectrum.resolution / 6)
    line = line_at(excess, place, reach + spectrum.resolution / 2)
    if line is None:
        return None
    i = spectrum.index_of(line.position)
    position = peak_position(spectrum, i)
    is_peak = bool(spectrum.values[i] >= spectrum.values[max(i - 1, 0) : i + 2].max())
    return replace(line, position=position) if is_peak and abs(position - place) <= reach else None


def _is_synchronous(signals: AnalysisSignals, hertz: float, slower: float) -> bool:
    if signals.angle is None:
        return False
    order = slower * hertz / signals.frequency_per_order_hz
    # Also a half and a third of each: shafts that are not described often turn at those.
    candidates = [o / part for o in signals.known_shaft_orders.values() for part in (1, 2, 3)]
    return any(abs(order / o - round(order / o)) * o < 0.01 for o in candidates)


def magnetic_pull_at(hertz: float) -> str:
    """Return the multiple of twice the mains frequency at a frequency, in words; empty if there is none."""
    pull = magnetic_pull_near(hertz)
    if pull is None:
        return ""
    mains_hz, pull_hz = pull
    return f"the magnetic pull of a {mains_hz:g} Hz supply ({pull_hz:g} Hz)"


def _unexplained(signals: AnalysisSignals, trains: Sequence[float], named: Sequence[float]) -> Finding | None:
    """Return the strongest order line that is not a multiple of a known shaft's order, nor a low one of a bearing's."""
    best: tuple[float, str, int, LinesOverFloor] | None = None
    foot = RUN_UP_FOOT_ORDERS if signals.speed_varies else 0.0
    for name, excess in signals.order_excess.items():
        for order in signals.known_shaft_orders.values():
            wide = foot if order >= 4 * foot else 0.0  # of closer lines, mask at least the lines themselves
            # The skirt is the foot of a line if the speed varies by only this much.
            excess = excess.without_multiples(order, half_width=wide, skirt=5e-4)  # noqa: PLW2901
            if signals.angle is not None and signals.angle.method == "constant":
                spread = excess.without_multiples(order, skirt=SPREAD_OF_STATED).masked
                is_low = excess.spectrum.positions <= (N_COUNTED + 0.5) * order
                excess = replace(excess, masked=excess.masked | (spread & is_low))  # noqa: PLW2901
        for bearing in signals.rig.bearings:
            ratio = signals.rig.ratio(bearing.shaft)
            for order in bearing.orders().values() if ratio is not None else ():
                excess = _without_bearing(excess, order * (ratio or 1.0))  # noqa: PLW2901
        for train in named:
            excess = _without_low_multiples(excess, train, skirt=SPREAD_OF_FOUND)  # noqa: PLW2901
        spectrum = excess.spectrum
        with np.errstate(divide="ignore", invalid="ignore"):
            clear = 20 * np.log10(spectrum.values / excess.floor) > UNEXPLAINED_DB
        if signals.speed_varies:
            # Skirts of lines that pass a resonance are far above the floor, but not above their neighbours.
            clear &= spectrum.values > neighbour_levels(spectrum) * 10 ** (UNEXPLAINED_DB / 20)
        height = np.where(clear & ~excess.masked & (spectrum.positions > 0.2), spectrum.values, 0.0)
        i = int(np.argmax(height))
        if height[i] > 0 and (best is None or height[i] > best[0]):
            best = (float(height[i]), name, i, excess)
    if best is None:
        return None
    _, channel, i, excess = best
    line, where = PlacedLine.at(excess, i), signals.where(float(excess.spectrum.positions[i]), channel)
    hunting = hunting_multiple(signals, line.position, 1.5 * excess.spectrum.resolution)
    origin = combination(_of_trains(signals, trains), line.position, excess.spectrum)
    if not origin and hunting is not None and _is_among_multiples(excess, line.position, hunting[0]):
        origin = hunting[1]  # teeth that differ explain more lines than the sidebands of both shafts
    if not origin:
        highest = float(excess.spectrum.positions[-1])
        origin = combination(_of_both_shafts(signals, highest), line.position, excess.spectrum)
    known = "shaft or mesh" if signals.rig.pairs else "shaft"
    title = f"The strongest line that belongs to no {'single' if origin else 'known'} {known}"
    evidence = [] if origin or hunting is None else [f"It is near {hunting[1]}, perhaps by chance."]
    pull = "" if signals.speed_varies else magnetic_pull_at(line.position * signals.frequency_per_order_hz)
    if signals.rig.bearings:
        evidence.append(f"The first {BEARING_MULTIPLES} multiples of the bearings' orders are left out.")
    title += f" is at order {line.position:.4f} ({signals.hertz_text(line.position)})"
    return Finding(
        "unexplained-line",
        Kind.NOTICE,
        f"{title}: {origin or pull}." if origin or pull else f"{title}.",
        replace(where, order_shaft=excess.spectrum.shaft),
        line.strength("noise floor"),
        0.95,
        _UNKNOWN_CAUSE,
        evidence=tuple(evidence),
        surer="A run-up: a line of fixed frequency is a resonance or electrical, one of fixed order is a shaft's.",
    )


BEARING_MULTIPLES = 6
"""Multiples of a bearing's order that are excluded: those by which its families are sought. With two bearings, all
multiples with their slip would cover a large part of any spectrum, and hide stronger lines."""


def _without_bearing(excess: LinesOverFloor, order: float) -> LinesOverFloor:
    """Mask the first multiples of an order of a bearing, with 2 % of the order on either side for its slip."""
    return _without_low_multiples(excess, order, half_width=0.02 * order)


SPREAD_OF_FOUND = 2e-3
"""Relative width of the multiples of a family that was found: how well its order is known, and how far it varies."""


def _without_low_multiples(
    excess: LinesOverFloor, order: float, *, half_width: float = 0.0, skirt: float = 0.0
) -> LinesOverFloor:
    every = excess.without_multiples(order, half_width=half_width, skirt=skirt).masked
    is_low = excess.spectrum.positions <= (BEARING_MULTIPLES + 0.5) * order
    return replace(excess, masked=excess.masked | (every & is_low))


BY_CHANCE = 0.1
"""Share of all places that combinations may cover for a match to be significant."""


def combination(places: Mapping[str, float], order: float, spectrum: Spectrum) -> str:
    """Return the combination of known orders that a line is; empty if it is none, or if a match is likely by chance.

    Parameters
    ----------
    places : mapping of str to float
        Combinations in words, and their orders.
    order : float
        Of the reference shaft.
    spectrum : Spectrum
        The spectrum that shows the line.
    """
    near, highest = 1.5 * spectrum.resolution, float(spectrum.positions[-1])
    inside = {text: place for text, place in places.items() if 0 < place < highest}
    if len(inside) * 2 * near <= BY_CHANCE * highest:
        text = min(inside, key=lambda label: abs(inside[label] - order), default="")
        if text and abs(inside[text] - order) <= near:
            return text
    return ""


def _of_both_shafts(signals: AnalysisSignals, highest: float) -> dict[str, float]:
    """Return the orders h·mesh ± i·driver ± j·driven, i and j up to 2, of meshes that both their shafts modulate."""
    places: dict[str, float] = {}
    for name, mesh in signals.known_mesh_orders.items():
        pair = signals.rig.pair(name)
        driver, driven = (signals.known_shaft_orders.get(shaft) for shaft in (pair.driver, pair.driven))
        if driver is None or driven is None:
            continue
        for h, i, j in product(range(1, int(highest / mesh) + 2), (1, -1, 2, -2), (1, -1, 2, -2)):
            sides = (f"{'+' if k > 0 else '−'} {abs(k)}× {shaft}" for k, shaft in ((i, pair.driver), (j, pair.driven)))
            places[" ".join([f"{h}× mesh {name}", *sides])] = h * mesh + i * driver + j * driven
    return places


def _of_trains(signals: AnalysisSignals, trains: Sequence[float]) -> dict[str, float]:
    """Return the orders h·mesh ± k·q of impacts of order q that modulate a mesh or are modulated by it.

    Beside each, once or twice a shaft's order away, there may be another.
    """
    places: dict[str, float] = {}
    for train in trains:
        for h in range(N_COMBINED + 1):
            for name, mesh in signals.known_mesh_orders.items() if h else (("", 0.0),):
                start = f"{h}× mesh {name} {{}} " if h else ""
                for k in range(1, N_COMBINED + 1):
                    text = f"{start}{k if k > 1 else ''}{'×' if k > 1 else ''}{train:.4f}, the order of impacts"
                    places |= {text.format(sign): h * mesh + (k if sign == "+" else -k) * train for sign in "+−"}
    for train_text, place in list(places.items()):
        for shaft, turns in signals.known_shaft_orders.items():
            for j in (1, 2):
                places |= {
                    f"{train_text}, {sign} {j}× {shaft}": place + (j if sign == "+" else -j) * turns for sign in "+−"
                }
    return places


def hunting_multiple(signals: AnalysisSignals, order: float, near: float) -> tuple[float, str] | None:
    """Return the hunting-tooth order that has a multiple near an order, and that multiple in words.

    It belongs to both gears together: each pair of teeth meets at its own times.
    """
    for pair in signals.rig.pairs:
        hunting = hunting_tooth_order(signals.rig, pair)
        if hunting is not None and abs(order - (n := round(order / hunting)) * hunting) <= near:
            return hunting, f"{n}× the hunting-tooth order of {pair.name}, of both its gears together"
    return None


def _is_among_multiples(excess: LinesOverFloor, order: float, fundamental: float) -> bool:
    """Whether a line is a multiple of an order beyond chance: its neighbours among the multiples stand out, too.

    Multiples of a low order are dense, and one is near any line. Ten of them on either side must together stand higher
    over the floor than the same comb does anywhere between, which happens by chance at most once in twenty times.

    Parameters
    ----------
    excess : LinesOverFloor
        Lines explained already are masked.
    order : float
        Of the line.
    fundamental : float
    """
    resolution, n = excess.spectrum.resolution, round(order / fundamental)
    if 3 * resolution > BY_CHANCE * fundamental:
        return False
    beside = fundamental * np.array([k for k in range(max(1, n - 10), n + 11) if k != n])
    offsets = np.arange(round(fundamental / resolution)) * resolution
    sums = np.array([excess.scores()[excess.lines_at(beside + offset)].sum() for offset in offsets])
    is_between = np.minimum(offsets, fundamental - offsets) > 4 * resolution
    return bool(sums[~is_between].max() > sums[is_between].max())


N_COMBINED = 3
"""Harmonics of a mesh and of a train of impacts that are combined."""


def _strongest(signals: AnalysisSignals) -> Finding | None:
    lines = []
    for name, spectrum in signals.spectra.items():
        start = spectrum.index_of(2.0) + 1
        lines.append(
            (PlacedLine.at(lines_over_noise_floor(spectrum), start + int(np.argmax(spectrum.values[start:]))), name)
        )
    clear = [(line, name) for line, name in lines if line.amplitude > line.floor * 10 ** (UNEXPLAINED_DB / 20)]
    if not clear:
        return None
    line, name = max(clear, key=lambda place: place[0].amplitude)
    return Finding(
        "strongest-line",
        Kind.INFORMATION,
        f"The strongest line of the spectrum is at {line.position:.6g} Hz in channel {name}.",
        Where((name,), frequency_hz=line.position),
        line.strength("noise floor of the spectrum"),
        0.95,
        _UNKNOWN_CAUSE,
    )
