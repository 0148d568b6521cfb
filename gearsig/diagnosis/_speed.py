"""The shaft angle of an analysis: found, checked against the signal, or refused with a reason."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import isfinite

from gearsig.angle import ShaftAngle
from gearsig.diagnosis._lines import LineExcess, over_floor_db
from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._types import CannotTell, Finding, Kind, Where
from gearsig.errors import RefusalError
from gearsig.recording import Recording
from gearsig.rig import ConstantSpeed, GearPair, Rig, SpeedChannel

STATED_SPEED_TOLERANCE = 0.03
"""How far the true speed may be from a stated one: the slip of an induction motor from no load to full load."""

LARGEST_DRIFT_REV = 0.01
"""Drift of the angle over the record that averages bear: a third of a tooth's pitch of thirty teeth."""

STEADY = 0.01
"""Relative range of a speed channel below which the mesh lines are sought at one speed."""

N_SHAFT_HARMONICS = 8
N_PHASE_HARMONICS = 3
"""Of the mesh, whose phase an angle may follow."""

MAINS_HZ = (50.0, 60.0)
"""Supplies put their own harmonics, and those of motors, within the slip of a motor's speed."""

MAINS_TOLERANCE = 0.002
"""How far a supply's frequency wanders."""


def determine_angle(recording: Recording, rig: Rig) -> ShaftAngle | CannotTell:
    """Return the angle of the reference shaft, or why it cannot be known.

    A stated constant speed is refined where the signal shows the true one near it: synchronous averages need it to a
    small part of a revolution over the whole record, and nameplates are not as good as that.
    """
    from gearsig.angle import find_shaft_angle

    question = "What is the speed of the shafts?"
    try:
        angle = find_shaft_angle(recording, rig)
    except RefusalError as refusal:
        return CannotTell(question, refusal.reason, refusal.remedy)
    hertz, limit_hz = angle.mean_speed_rpm / 60, recording.sampling_rate_hz / 2
    if hertz >= limit_hz:
        reason = f"{angle.mean_speed_rpm:.4g} rpm are {hertz:.4g} Hz, above half the sampling rate ({limit_hz:.4g} Hz)"
        return CannotTell(question, reason, "check the speed's unit and the sampling rate")
    if isinstance(recording.speed_source, ConstantSpeed):
        return _refined(recording, rig, angle)
    if isinstance(recording.speed_source, SpeedChannel):
        return _rescaled(recording, rig, angle)
    return angle


def exact_angle(recording: Recording, rig: Rig, found: ShaftAngle) -> ShaftAngle:
    """Let an angle that was estimated from the vibration follow the phase of the mesh harmonics.

    The estimate may hold the speed constant where it wanders by some 10⁻⁴. Over hundreds of revolutions that is half
    a tooth, and takes decibels from the averages' mesh harmonics.
    """
    from gearsig.angle import refine_by_phase

    if found.method != "tachless":
        return found
    meshes = [order for pair in rig.pairs if (order := rig.mesh_order(pair, found.shaft)) is not None]
    orders = tuple(k * order for order in meshes for k in range(1, N_PHASE_HARMONICS + 1))
    refined = refine_by_phase(recording, recording.vibration_names(), found, orders)
    return replace(
        found,
        time_s=refined.time_s,
        revolutions=refined.revolutions,
        speed_rev_per_s=refined.speed_rev_per_s,
        notes=(*found.notes, "the course of the angle follows the phase of the mesh harmonics"),
    )


def speed_finding(angle: ShaftAngle | CannotTell) -> Finding:
    """State the speed and how it was found, or that it is not known."""
    if isinstance(angle, CannotTell):
        return Finding(
            "speed-unknown",
            Kind.CANNOT_TELL,
            "The speed is not known: orders, synchronous averages and everything that rests on them are left out.",
            evidence=(angle.reason,),
            surer=angle.remedy,
        )
    low, high = angle.speed_range_rpm
    uncertainty = angle.relative_speed_uncertainty
    plus_minus = f" ± {uncertainty * angle.mean_speed_rpm:.2g}" if isfinite(uncertainty) else ""
    text = f"Shaft {angle.shaft or 'of reference'} turns at {angle.mean_speed_rpm:.6g}{plus_minus} rpm"
    if high - low > 0.001 * angle.mean_speed_rpm:
        text += f", between {low:.5g} and {high:.5g} rpm"
    return Finding(
        "speed",
        Kind.INFORMATION,
        f"{text} ({angle.method}, {angle.n_revolutions:.5g} revolutions).",
        Where(shaft=angle.shaft, time_s=(angle.start_s, angle.end_s)),
        confidence=angle.quality,
        confidence_basis=f"quality figure of the method '{angle.method}'",
        evidence=angle.notes,
        surer="" if angle.method in ("pulses", "encoder") else "A tachometer: it also fixes the zero of the angle.",
    )


def _refined(recording: Recording, rig: Rig, stated: ShaftAngle) -> ShaftAngle:
    """Return the speed that mesh lines or shaft harmonics show near the stated one, else the stated one."""
    found = _from_meshes(recording, rig, stated) if rig.pairs else _from_shaft_harmonics(recording, stated)
    if found is None:
        return replace(
            stated, quality=0.5, notes=(*stated.notes, "The stated speed could not be confirmed from the signal.")
        )
    difference = 100 * (found.mean_speed_rpm / stated.mean_speed_rpm - 1)
    lines_say = f"the signal's own lines say {found.mean_speed_rpm:.6g} rpm ({difference:+.2f} %)"
    note = f"Stated {stated.mean_speed_rpm:.6g} rpm; {lines_say}."
    return replace(found, shaft=stated.shaft, notes=(*found.notes, note))


def _rescaled(recording: Recording, rig: Rig, measured: ShaftAngle) -> ShaftAngle:
    """Return a steady speed channel's angle at the scale the mesh lines show, if they show another.

    Speed channels are right to a part in a hundred or a thousand, which is revolutions in a long record.
    """
    low, high = measured.speed_range_rpm
    if not rig.pairs or high - low > STEADY * measured.mean_speed_rpm:
        return measured
    found = _from_meshes(recording, rig, measured)
    if found is None:
        return measured
    difference = found.mean_speed_rpm / measured.mean_speed_rpm - 1
    if abs(difference) * measured.n_revolutions < LARGEST_DRIFT_REV:
        return measured
    lines_say = f"the signal's own lines say {found.mean_speed_rpm:.6g} rpm ({100 * difference:+.2f} %)"
    note = f"The speed channel says {measured.mean_speed_rpm:.6g} rpm; {lines_say}."
    return replace(found, shaft=measured.shaft, notes=(*found.notes, note))


def _from_meshes(recording: Recording, rig: Rig, stated: ShaftAngle) -> ShaftAngle | None:
    from gearsig.angle import estimate_shaft_angle

    speed = stated.mean_speed_rpm
    limits = (speed * (1 - STATED_SPEED_TOLERANCE), speed * (1 + STATED_SPEED_TOLERANCE))
    try:
        return estimate_shaft_angle(recording, rig, speed_range_rpm=limits)
    except RefusalError:
        return None


def _from_shaft_harmonics(recording: Recording, stated: ShaftAngle) -> ShaftAngle | None:
    """Find the shaft's harmonics in the envelopes, where a bearing's modulation shows them better than the spectrum.

    Multiples of the mains are left out: a hum's would be taken for the shaft of any motor of little slip.
    """
    import numpy as np

    from gearsig.diagnosis._lines import best_comb
    from gearsig.diagnosis._signals import bands, floor_of
    from gearsig.errors import InputError
    from gearsig.spectra import channel_spectrum, envelope_recording

    hertz = stated.mean_speed_rpm / 60
    low, high = hertz * (1 - STATED_SPEED_TOLERANCE), hertz * (1 + STATED_SPEED_TOLERANCE)
    combs = []
    for band in bands(recording.sampling_rate_hz):
        try:
            envelopes = envelope_recording(recording, band, kind="magnitude")
        except InputError:
            continue
        for name in envelopes.channel_names:
            spectrum = channel_spectrum(envelopes, name)
            excess = floor_of(spectrum)
            for mains_hz in MAINS_HZ:
                excess = excess.without_multiples(mains_hz, skirt=MAINS_TOLERANCE)
            comb = best_comb(excess, low, high, offsets=np.arange(1, N_SHAFT_HARMONICS + 1))
            if comb is not None:
                combs.append((comb.p_value, comb.fundamental, spectrum.resolution))
    if not combs:
        return None
    p_value, found, resolution = min(combs)
    p_value = min(1.0, p_value * len(combs))
    if p_value > 1e-3:
        return None
    return replace(
        stated,
        revolutions=stated.revolutions * (found / hertz),
        speed_rev_per_s=stated.speed_rev_per_s * (found / hertz),
        relative_speed_uncertainty=resolution / (3 * N_SHAFT_HARMONICS) / found,
        quality=min(0.95, 1 - p_value),
    )


# --------------------
# Whether the vibration itself confirms the speed and the teeth: only then does "nothing shows" mean anything.
# --------------------


N_HARMONICS = 3
CLEAR_DB = 12.0
"""A line that noise alone exceeds once in 10⁷: power over mean floor is exponential, exp(-15.8) (12 dB)."""

ON_PLACE_LINES = 1.5
AROUND_LINES = 6.0
"""A line is where it should be if it is the highest of its surroundings; a speed a little off moves it away."""


@dataclass(frozen=True)
class ConfirmingLine:
    """The clearest line at a multiple of an expected order."""

    channel: str
    harmonic: int
    order: float
    amplitude: float
    floor: float
    ratio_db: float
    unit: str
    on_place: bool

    @property
    def is_clear(self) -> bool:
        """Whether the line stands out, where it is expected."""
        return self.on_place and self.ratio_db >= CLEAR_DB


def clearest_line(signals: AnalysisSignals, order: float) -> ConfirmingLine | None:
    """Return the clearest of the first multiples of `order` over all channels; None if none is within the spectra."""
    best: ConfirmingLine | None = None
    for channel, excess in signals.order_excess.items():
        for h in range(1, N_HARMONICS + 1):
            line = _line_at(excess, channel, h, h * order)
            if line is not None and (best is None or (line.is_clear, line.ratio_db) > (best.is_clear, best.ratio_db)):
                best = line
    return best


def mesh_is_confirmed(signals: AnalysisSignals, pair: GearPair) -> bool:
    """Whether a mesh line of `pair` stands where speed and teeth put it."""
    mesh = signals.rig.mesh_order(pair)
    line = clearest_line(signals, mesh) if mesh is not None else None
    return line is not None and line.is_clear


def speed_is_confirmed(signals: AnalysisSignals) -> bool:
    """Whether any mesh line, or where no mesh is known any shaft's line, stands where the speed puts it."""
    if signals.angle is None:
        return False
    if any(signals.rig.mesh_order(pair) is not None for pair in signals.rig.pairs):
        return any(mesh_is_confirmed(signals, pair) for pair in signals.rig.pairs)
    lines = [clearest_line(signals, order) for order in signals.known_shaft_orders.values()]
    return any(line is not None and line.is_clear for line in lines)


def _line_at(excess: LineExcess, channel: str, harmonic: int, order: float) -> ConfirmingLine | None:
    spectrum = excess.spectrum
    if order > spectrum.positions[-1]:
        return None
    found, amplitude = spectrum.largest_near(order, ON_PLACE_LINES * spectrum.resolution)
    around = spectrum.largest_near(order, AROUND_LINES * spectrum.resolution)[1]
    floor = float(excess.floor[spectrum.index_of(found)])
    ratio = over_floor_db(amplitude, floor)
    return ConfirmingLine(channel, harmonic, found, amplitude, floor, ratio, spectrum.unit, amplitude >= around)
