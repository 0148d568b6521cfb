"""What stands out of a recording by itself, as places of a gap."""

from __future__ import annotations

from app.gap.standing_out import LINE, PARTS, Standing, bearings_text, shafts_of_unknown_speed
from gearsig.formatting import signed
from gearsig.gap.spots import band_words, hertz
from gearsig.gap.types import GapPlace, PlaceKind
from gearsig.rig.types import Rig

NAN = float("nan")


def standing_place(one: Standing, rig: Rig, *, name: str = "") -> GapPlace:
    """Return the place of what stands out, without sizes in floors, for nothing is simulated to find it.

    Parameters
    ----------
    one : Standing
    rig : Rig
    name : str
        The recording's where there are several.
    """
    where = one.finding.where
    order, frequency = where.order or NAN, where.frequency_hz or NAN
    over = f"{one.over_floor_db:.0f} dB over their floor" + (
        f" in {band_words(where.band_hz)}" if where.band_hz else ""
    )
    since = "" if one.rise_db is None else f", {signed(one.rise_db)} dB over the reference"
    seen = f", in {name}" if name else ""
    driver = rig.ratio(rig.pairs[0].driver) if rig.pairs else 1.0
    return GapPlace(
        PlaceKind.LINE if one.finding.code == LINE else PlaceKind.ENVELOPE,
        f"{_what(one, rig)} (order {order:.4g}, {hertz(frequency)}), {over}{since}{seen}",
        one.over_floor_db if one.rise_db is None else one.rise_db,
        repeatability=NAN,
        structural=NAN,
        share=NAN,
        shaft=where.shaft,
        orders=(order / (driver or 1.0),),
        band_hz=where.band_hz,
        channel=where.channels[0] if where.channels else "",
    )


def _what(one: Standing, rig: Rig) -> str:
    code = one.finding.code
    if code in PARTS:
        return f"envelope lines of the {PARTS[code][0]} of {bearings_text(one.finding, rig)}"
    if code == LINE:
        return "the strongest line of no known shaft or bearing"
    loose = shafts_of_unknown_speed(rig)
    parts = [*(["no gear"] if rig.pairs else []), "no shaft", *(["no bearing"] if rig.bearings else [])]
    unknown = "" if rig.bearings else ", the rig file naming no bearing"
    known = f" of known speed explains, perhaps {loose}" if loose else " explains"
    return f"envelope lines of impacts that {', '.join(parts[:-1])} and {parts[-1]}{known}{unknown}"
