"""What an analysis says of the speed, and whether the vibration confirms it."""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite

from gearsig.angle import ShaftAngle
from gearsig.diagnosis._signals import AnalysisSignals
from gearsig.diagnosis._types import CannotTell, Finding, Kind, Where
from gearsig.prepared import LineExcess, over_floor_db
from gearsig.rig import GearPair


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
