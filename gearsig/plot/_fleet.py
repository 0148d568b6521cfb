"""An indicator over months with its limits, as a small SVG: a fleet's report holds many."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from math import ceil, floor, log10

import numpy as np

from gearsig.checks import FloatArray
from gearsig.fleet import Trend
from gearsig.formatting import readable
from gearsig.plot import _style as style
from gearsig.plot._embed import Picture
from gearsig.plot._style import unit_text

WIDTH, HEIGHT = 900, 190
LEFT, RIGHT, TOP, BOTTOM = 64, 12, 10, 26
N_SHOWN = 1500
"""Recordings that are drawn, the latest: more than there are columns."""

LEVEL_COLOURS = {"ok": style.MEASURED, "warning": style.SIMULATED, "alarm": style.FAULT}


def fleet_trend_picture(trend: Trend) -> Picture:
    """Draw values, expected value, limits and baseline of a trend over its dates.

    On a logarithmic axis where all values are above zero: a rise is then as high wherever it begins.
    """
    table = trend.table.tail(N_SHOWN)
    days = table["date"].to_numpy("datetime64[s]").astype(np.float64) / 86400.0
    values, expected, high, alarm = (
        table[name].to_numpy(np.float64) for name in ("value", "expected", "high", "alarm")
    )
    shown = np.concatenate([values, *(part[np.isfinite(part)] for part in (expected, high))])
    is_log = bool(values.min() > 0)
    low_y, high_y = _range(shown[shown > 0] if is_log else shown, is_log=is_log)
    low_x, high_x = days.min(), max(days.max(), days.min() + 1e-3)

    def across(x: FloatArray | float) -> FloatArray:
        return np.asarray(LEFT + (np.asarray(x) - low_x) / (high_x - low_x) * (WIDTH - LEFT - RIGHT))

    def up(y: FloatArray | float) -> FloatArray:
        at, low, high = np.asarray(y, dtype=np.float64), low_y, high_y
        if is_log:
            at, low, high = np.log10(np.maximum(at, 1e-300)), log10(low), log10(high)
        return np.asarray(HEIGHT - BOTTOM - np.clip((at - low) / (high - low), 0, 1) * (HEIGHT - TOP - BOTTOM))

    def line(y: FloatArray, colour: str, more: str = "") -> str:
        known = np.isfinite(y)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across(days)[known], up(y)[known], strict=True))
        return f'<polyline points="{points}" fill="none" stroke="{colour}" {more}/>' if points else ""

    parts = []
    baseline = days[table["in_baseline"].to_numpy(np.bool_)]
    if len(baseline):
        a, b = float(across(baseline[0])), float(across(baseline[-1]))
        parts.append(
            f'<rect x="{a:.1f}" y="{TOP}" width="{max(b - a, 2):.1f}" height="{HEIGHT - TOP - BOTTOM}" '
            f'fill="{style.RULE}" fill-opacity="0.5"/>'
        )
    for tick in _ticks(low_y, high_y, is_log=is_log):
        y = float(up(tick))
        parts.append(f'<path d="M{LEFT} {y:.1f}H{WIDTH - RIGHT}" stroke="{style.RULE}"/>')
        parts.append(_text(LEFT - 6, y + 4, readable(tick, 3), "end"))
    parts += [
        line(expected, style.QUIET, 'stroke-dasharray="2 4"'),
        line(high, style.SIMULATED, 'stroke-dasharray="6 3"'),
        line(alarm, style.FAULT, 'stroke-dasharray="6 3"') if np.nanmin(alarm, initial=np.inf) <= high_y else "",
        line(values, style.MEASURED, 'stroke-width="1.2"'),
    ]
    for x, y, level in zip(across(days), up(values), table["level"], strict=True):
        if level != "ok":
            parts.append(f'<circle cx="{x:.1f}" cy="{y:.1f}" r="3" fill="{LEVEL_COLOURS[level]}"/>')
    if trend.changed is not None:
        moment = np.datetime64(trend.changed, "s").astype(np.float64) / 86400.0
        if low_x <= moment <= high_x:
            x = float(across(moment))
            parts.append(f'<path d="M{x:.1f} {TOP}V{HEIGHT - BOTTOM}" stroke="{style.INK}" stroke-dasharray="1 3"/>')
    first, last = (f"{date:%Y-%m-%d}" for date in (table["date"].iloc[0], table["date"].iloc[-1]))
    parts += [_text(LEFT, HEIGHT - 8, first, "start"), _text(WIDTH - RIGHT, HEIGHT - 8, last, "end")]
    drawing = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'font-family="sans-serif" font-size="12"><rect width="100%" height="100%" fill="#fff"/>{"".join(parts)}</svg>'
    )
    unit = f" in {unit_text(trend.unit)}" if trend.unit else ""
    of = ", ".join(part for part in (trend.place, trend.channel, trend.computed_on, trend.band) if part)
    return Picture(
        "data:image/svg+xml;base64," + b64encode(drawing.encode()).decode("ascii"),
        WIDTH,
        HEIGHT,
        f"{trend.name}{unit} ({of}). Dotted: expected; dashed: limits ({trend.basis}); grey: baseline.",
        f"{trend.name} of {trend.machine} {trend.point} from {first} to {last}: {trend.level}.",
    )


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="{style.QUIET}">{escape(text)}</text>'


def _range(shown: FloatArray, *, is_log: bool) -> tuple[float, float]:
    low, high = float(shown.min()), float(shown.max())
    if is_log:
        return low / 1.15, high * 1.15
    margin = 0.08 * (high - low) or 0.1 * abs(high) or 1.0
    return low - margin, high + margin


def _ticks(low: float, high: float, *, is_log: bool) -> list[float]:
    """Return three to six round numbers."""
    if is_log and high > 8 * low:
        decades = range(floor(log10(low)), ceil(log10(high)) + 1)
        ticks = [m * 10.0**d for d in decades for m in ((1, 2, 5) if high < 300 * low else (1,))]
    else:
        step = 10.0 ** floor(log10((high - low) / 3))
        step *= next((m for m in (5, 2) if (high - low) / (m * step) >= 3), 1)
        ticks = [step * i for i in range(ceil(low / step), floor(high / step) + 1)]
    return [tick for tick in ticks if low <= tick <= high]
