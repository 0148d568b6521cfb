"""Ball counts of bearings from their published load ratings: `python -m app.studies.bearing_geometry`.

Makers do not publish the number of balls, but ratings computed from it: C0r by ISO 76, Cr by ISO 281, often with the
factor f0 of C0r. Of all numbers of balls Z and standard diameters Dw, on the pitch diameter (d + D)/2, the combination
that reproduces all ratings is taken if none with another Z comes close. Prints rows for `gearsig/rig/bearings.csv`, and
to the standard error stream the bearings that the ratings leave undecided.

This does not work for rollers: with number Z and length L, their ratings are C0r ∝ Z L and Cr ∝ Z^(3/4) L^(7/9), so
that both together depend only on Z^(1/36).
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from math import cos, pi, radians, sin
from pathlib import Path

import numpy as np

RATINGS = Path(__file__).with_name("bearing_ratings.csv")

# fmt: off
# ISO 76:2006, table 1: f0 over Dw cos(a)/Dpw, every 0.01 from 0; deep groove and self-aligning ball bearings.
F0_GROOVE = np.array([
    14.7, 14.9, 15.1, 15.3, 15.5, 15.7, 15.9, 16.1, 16.3, 16.5,
    16.4, 16.1, 15.9, 15.6, 15.4, 15.2, 14.9, 14.7, 14.4, 14.2,
    14.0, 13.7, 13.5, 13.2, 13.0, 12.8, 12.5, 12.3, 12.1, 11.8,
    11.6, 11.4, 11.2, 10.9, 10.7, 10.5, 10.3, 10.0, 9.8, 9.6,
])
F0_SELF_ALIGNING = np.array([
    1.9, 2.0, 2.0, 2.1, 2.1, 2.1, 2.2, 2.2, 2.3, 2.3, 2.4, 2.4, 2.4, 2.5, 2.5, 2.6, 2.6, 2.7, 2.7, 2.8,
    2.8, 2.8, 2.9, 2.9, 3.0, 3.0, 3.1, 3.1, 3.2, 3.2, 3.3, 3.3, 3.4, 3.4, 3.5, 3.5, 3.6, 3.6, 3.7, 3.8,
])
# ISO 281:2007, table 2: fc over the same ratio.
FC_RATIO = np.array([5, 6, 7, 8, 9, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30, 32, 34, 36, 38, 40]) / 100
FC_GROOVE = np.array([
    46.7, 49.1, 51.1, 52.8, 54.3, 55.5, 57.5, 58.8, 59.6, 59.9, 59.9,
    59.6, 59.0, 58.2, 57.1, 56.0, 54.6, 53.2, 51.7, 50.0, 48.4,
])
FC_SELF_ALIGNING = np.array([
    17.3, 18.6, 19.9, 21.1, 22.3, 23.4, 25.6, 27.7, 29.7, 31.7, 33.5,
    35.2, 36.8, 38.2, 39.4, 40.3, 40.9, 41.2, 41.3, 41.0, 40.4,
])
# fmt: on
BM = 1.3
"""Factor bm of ISO 281, table 1, for all ball bearings considered here."""

SMALLEST_TABLED = 0.09
"""Ratio Dw/Dpw below which makers' f0 of thin sections keeps rising while the table's falls."""

INCH_MM = 25.4
DIAMETERS_MM = (
    *(k * INCH_MM / 64 for k in range(4, 24)),
    *(k * INCH_MM / 32 for k in range(12, 90)),
    *(k / 2 for k in range(4, 15)),
)
"""Diameters of standard balls."""


@dataclass(frozen=True)
class PublishedRatings:
    """Data that a maker publishes about a bearing; f0 is 0 if not published."""

    name: str
    source: str
    bore_mm: float
    outside_mm: float
    contact_angle_deg: float
    n_rows: int
    is_self_aligning: bool
    cr_kn: float
    c0r_kn: float
    f0: float

    @property
    def pitch_mm(self) -> float:
        """Pitch diameter in mm, the mean of bore and outside diameter."""
        return (self.bore_mm + self.outside_mm) / 2


@dataclass(frozen=True)
class BallFit:
    """Balls of one row, and the largest relative deviation of the ratings from those published."""

    n_balls: int
    diameter_mm: float
    off: float


def read_ratings() -> list[PublishedRatings]:
    """Read the published ratings."""
    lines = (line for line in RATINGS.read_text(encoding="utf-8").splitlines() if not line.startswith("#"))
    return [
        PublishedRatings(
            row["name"],
            row["source"],
            float(row["bore_mm"]),
            float(row["outside_mm"]),
            float(row["contact_angle_deg"] or 0.0),
            2 if row["rows"] else 1,
            row["rows"] == "2 self-aligning",
            float(row["cr_kn"]),
            float(row["c0r_kn"]),
            float(row["f0"] or 0.0),
        )
        for row in csv.DictReader(lines)
    ]


def fits(of: PublishedRatings) -> list[BallFit]:
    """Return every number of balls with the diameter that fits the ratings best, in order of fit."""
    best: dict[int, BallFit] = {}
    for diameter_mm in DIAMETERS_MM:
        for n_balls in range(5, 40):
            chord = sin(pi / n_balls) * of.pitch_mm / diameter_mm  # balls touch each other at 1
            if 1.02 < chord < 2.2 and diameter_mm * 2 < of.outside_mm - of.bore_mm:
                off = max(_deviations(of, n_balls, diameter_mm))
                if n_balls not in best or off < best[n_balls].off:
                    best[n_balls] = BallFit(n_balls, diameter_mm, off)
    return sorted(best.values(), key=lambda fit: fit.off)


def _deviations(of: PublishedRatings, n_balls: int, diameter_mm: float) -> Iterator[float]:
    """Yield the relative errors of C0r = f0 i Z Dw² cos(a), Cr = bm fc (i cos a)^0.7 Z^(2/3) Dw^1.8, and f0.

    Above one inch Dw^1.8 is 3.647 Dw^1.4.
    """
    cosine = cos(radians(of.contact_angle_deg))
    ratio = diameter_mm * cosine / of.pitch_mm
    f0_table, fc_table = (F0_SELF_ALIGNING, FC_SELF_ALIGNING) if of.is_self_aligning else (F0_GROOVE, FC_GROOVE)
    f0 = float(np.interp(ratio, np.arange(len(f0_table)) / 100, f0_table))
    fc = float(np.interp(ratio, FC_RATIO, fc_table))
    size = diameter_mm**1.8 if diameter_mm <= INCH_MM else 3.647 * diameter_mm**1.4
    cr = BM * fc * (of.n_rows * cosine) ** 0.7 * n_balls ** (2 / 3) * size / 1000
    yield abs(cr / of.cr_kn - 1)
    yield abs((of.f0 or f0) * of.n_rows * n_balls * diameter_mm**2 * cosine / 1000 / of.c0r_kn - 1)
    if of.f0 and ratio >= SMALLEST_TABLED:
        yield abs(f0 / of.f0 - 1)


def decided(of: PublishedRatings) -> BallFit | None:
    """Return the balls if the ratings determine their number; else None.

    Ratings are published with two and a half digits, within 0.5 %; f0 of self-aligning bearings has two digits.
    """
    first, second, *_ = fits(of)
    near, far = (0.016, 0.03) if of.is_self_aligning else (0.014, 0.012)
    return first if first.off <= near and second.off >= max(far, 2 * first.off) else None


def main() -> None:
    """Print the rows of all bearings that are decided."""
    for of in read_ratings():
        fit = decided(of)
        if fit is None:
            tries = "; ".join(f"{f.n_balls} of {f.diameter_mm:.3f} mm ({100 * f.off:.1f} %)" for f in fits(of)[:2])
            sys.stderr.write(f"{of.name}: not decided: {tries}\n")
            continue
        angle = f"{of.contact_angle_deg:g}" if of.contact_angle_deg else ""
        diameter_mm = round(fit.diameter_mm, 3)
        sys.stdout.write(f"{of.name},{fit.n_balls},{diameter_mm:g},{of.pitch_mm:g},{angle},{of.source} ratings\n")


if __name__ == "__main__":
    main()
