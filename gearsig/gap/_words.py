"""What features, shafts and bands are called in sentences."""

from __future__ import annotations

from gearsig.gap._features import ECHO_LAGS_PITCHES, N_QUARTERS
from gearsig.gap._reduction import GearFrame
from gearsig.rig import SIDES


def shaft_words(frame: GearFrame, side: int) -> str:
    """Return "the input shaft" or "shaft 2"."""
    name = frame.shafts[side]
    if "shaft" in name.lower():
        return name
    return f"the {name} shaft" if name.replace(" ", "").isalpha() else f"shaft {name}"


def by_decibels(change_db: float) -> str:
    """Return "up by 14 dB" or "down by 3 dB"."""
    return f"{'up' if change_db >= 0 else 'down'} by {abs(change_db):.2g} dB"


def hertz(frequency_hz: float) -> str:
    """Return "850 Hz" or "2.1 kHz"."""
    return f"{frequency_hz / 1e3:.2g} kHz" if frequency_hz >= 999.5 else f"{frequency_hz:.3g} Hz"


def band_words(band_hz: tuple[float, float]) -> str:
    """Return "300 Hz to 2.1 kHz"."""
    low, high = (hertz(edge) for edge in band_hz)
    if low[-3:] == high[-3:]:
        low = low.rpartition(" ")[0]
    return f"{low} to {high}"


_SIDEBANDS = {
    "1": "first sidebands",
    "2": "second sidebands",
    "3to5": "sidebands 3 to 5",
    "6to12": "sidebands 6 to 12",
    "own": "first sidebands over their own mesh harmonic",
    "strongest": "strongest sideband over the others",
}
_SHAFT = {
    "1": "order 1",
    "2": "order 2",
    "3": "order 3",
    "1.to_mesh": "order 1 over the mesh",
    "2.to_mesh": "order 2 over the mesh",
    "3.to_mesh": "order 3 over the mesh",
    "strongest": "strongest of the orders above 3 over the others",
    "strongest.to_mesh": "strongest of the orders above 3 over the mesh",
    "low": "orders above 3",
}
_TOOTH = {
    "level": "level besides the mesh",
    "elsewhere": "level at the median tooth",
    "peak": "level of the burst at the strongest tooth",
    "prominence": "burst over the median tooth",
    "second": "burst over the next strongest tooth",
    "kurtosis": "kurtosis",
    "width": "number of teeth within 3 dB of the strongest",
    "below_mesh": "part below the mesh order",
    "centroid": "middle of the spectrum",
    "agreement": "agreement with the reference",
}
_OF_A_SHAFT = {
    "sideband": ("", _SIDEBANDS),
    "shaft": ("", _SHAFT),
    "tooth": ("average, ", _TOOTH),
    "change": ("change of the average, ", _TOOTH),
    "surprise": ("change of the average over its noise, ", _TOOTH),
}
_CYCLIC = {
    "outer": "outer races",
    "inner": "inner races",
    "ball": "rolling elements",
    "cage": "cages",
    "mesh": "mesh order",
    "strange": "an order that belongs to nothing known",
    "depth": "depth of modulation",
    "half_mesh": "half the mesh order",
}
_ALIKE_PARTS = {"mesh": "harmonics", "repeated": "what either gear repeats", "noise": "what nothing repeats"}
_ALIKE = {
    f"{key}{suffix}": f"{words}{', ' if said else ''}{said}"
    for key, words in _ALIKE_PARTS.items()
    for suffix, said in (("", ""), (".spread", "spread"), (".rise", "rise from one to the next"))
} | {
    f"{a}_{b}.{suffix}": f"{_ALIKE_PARTS[a]} and {_ALIKE_PARTS[b]}, {said}"
    for a, b in (("mesh", "repeated"), ("repeated", "noise"), ("mesh", "noise"))
    for suffix, said in (("less", "the former over the latter"), ("apart", "apart"), ("together", "changed alike"))
}
_BURST_WAYS = {"plain": "as it is", "even": "magnitudes made even"}
_BURST = (
    {f"course.{i}": f"share of quarter pitch {i}" for i in range(N_QUARTERS)}
    | {f"echo.{i}": f"autocorrelation at lag {lag:.2f} pitches" for i, lag in enumerate(ECHO_LAGS_PITCHES)}
    | {"elsewhere": "share further away"}
)
_OTHER = {
    "mesh.total": "mesh harmonics together",
    "mesh.half": "half mesh orders",
    "apart.mesh": "mesh harmonics, difference between sensors",
    "apart.floor": "floor, difference between sensors",
    **{f"alike.{key}": f"about the mesh harmonics: {words}" for key, words in _ALIKE.items()},
    **{
        f"burst.{way}.{key}": f"burst of a tooth, {said}: {words}"
        for way, said in _BURST_WAYS.items()
        for key, words in _BURST.items()
    },
    "floor.total": "floor, all bands",
    "floor.to_signal": "floor over the whole signal",
    "raw.level": "level of the whole signal",
    "raw.kurtosis": "kurtosis of the whole signal",
    "raw.near_the_extreme": "samples close to the extreme",
    "speed.drift": "drift of the speed",
    "speed.swing": "swing of the speed",
    "speed.swing_line": "strongest line of the speed's swing",
    "hum": "mains lines",
}


def feature_words(name: str, frame: GearFrame) -> str:
    """Return a feature's name in words, e.g. "input shaft: sidebands 6 to 12"."""
    if name in _OTHER:
        return _OTHER[name]
    first, _, remainder = name.partition(".")
    side, _, detail = remainder.partition(".")
    if first == "mesh":
        return f"mesh harmonic {detail} over all"
    if first in _OF_A_SHAFT and side in SIDES:
        kind, table = _OF_A_SHAFT[first]
        return f"{shaft_words(frame, SIDES.index(side))}: {kind}{table[detail]}"
    if first == "floor":
        return f"floor, band {detail}" if side == "band" else f"kurtosis of the floor, band {detail}"
    where = "envelope" if first == "envelope" else "lines"
    if remainder.endswith("_shaft"):
        return f"{where}: orders of {shaft_words(frame, SIDES.index(remainder.removesuffix('_shaft')))}"
    return f"{where}: {_CYCLIC[remainder]}"
