"""Rolling bearings: geometry, the orders that follow from it, and a catalogue to look them up by name."""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from math import cos, radians
from types import MappingProxyType

from gearsig.checks import check_texts, count, positive, within
from gearsig.errors import InputError

_MAKERS = re.compile(r"^(?:SKF|FAG|INA|NSK|NTN|SNR|NACHI|KOYO|JTEKT|NKE|TIMKEN|FAFNIR|ZVL|ZKL|C&U|HRB|RHP|FBJ)")
# Seals, shields, cages, clearance, tolerance and grease: none affects the geometry of the rolling elements.
_SUFFIX = re.compile(
    r"(?:[-/]*(?:2?RS(?:R|H|1|2|L|H2)?|2?ZR?|ZZ[12]?|DDU|DD|LL[UBHM]|VV|2?NS[EL]|N|NR|TN9?|TNH?|TVH|MA?|J|"
    r"C[1-5N]|CM|P[2456]3?|W\d+|HT|GJN|JEM))*"
)
_OTHER_NAMES = (
    (re.compile(r"^61([89]\d\d)$"), r"6\1"),  # ISO 15 and the numbering of NSK and NTN
    # Wider rings around the balls of the common series.
    (re.compile(r"^62([23]\d\d)$"), r"6\1"),
    (re.compile(r"^630(\d\d)$"), r"60\1"),
    # Inserts of pillow blocks share balls and outer raceway with the deep groove bearing of their size.
    (re.compile(r"^UC[PFTC]?[LC]?([23](?:0[4-9]|1\d|20))$"), r"6\1"),
)


@dataclass(frozen=True)
class CatalogueBearing:
    """Published geometry of a bearing.

    Parameters
    ----------
    name : str
    n_rolling_elements : int
    rolling_element_diameter_mm, pitch_diameter_mm : float
    contact_angle_deg : float
    source : str
        Key of a source listed at the top of `bearings.csv`.
    """

    name: str
    n_rolling_elements: int
    rolling_element_diameter_mm: float
    pitch_diameter_mm: float
    contact_angle_deg: float
    source: str


@cache
def bearing_catalogue() -> Mapping[str, CatalogueBearing]:
    """Return the bearings of known geometry, by name.

    Deep groove ball bearings of the series 60, 62, 63, 64, 160, 68 (618) and 69 (619), angular contact ball bearings
    72 and 73 (A: 30°, B: 40°, C: 15°), 52 and 53, self-aligning ball bearings, inserts, and bearings of public test
    rigs. Most geometry is computed from published ratings. Makers change the number and size of balls; where their
    ratings differ, the name is listed by maker only. For roller bearings the ratings do not determine the number of
    rollers. Where the orders matter, take them from the maker of the bearing fitted.
    """
    text = files("gearsig.rig").joinpath("bearings.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    bearings = (
        CatalogueBearing(
            row["name"],
            int(row["n_rolling_elements"]),
            float(row["rolling_element_diameter_mm"]),
            float(row["pitch_diameter_mm"]),
            float(row["contact_angle_deg"] or 0.0),
            row["source"],
        )
        for row in rows
    )
    return MappingProxyType({bearing.name: bearing for bearing in bearings})


def catalogue_bearing(name: str) -> CatalogueBearing:
    """Look up a bearing in the catalogue.

    Suffixes for seals, shields, cage and clearance are ignored, and so is the maker where makers agree.

    Examples
    --------
    >>> catalogue_bearing("SKF 6205-2RS/C3").n_rolling_elements, catalogue_bearing("61904 ZZ").name
    (9, '6904')

    Raises
    ------
    InputError
        If the name is not in the catalogue, or makers build that bearing with different numbers of balls.
    """
    known = {bearing.name.replace(" ", ""): bearing for bearing in bearing_catalogue().values()}
    full = re.sub(r"\s+", "", name.upper())
    basic = _MAKERS.sub("", full)
    for text in (full, basic):
        start = max((n for n in known if text.startswith(n) and _SUFFIX.fullmatch(text[len(n) :])), key=len, default="")
        if start:
            return known[start]
    size = re.match(r"[A-Z]*\d+", basic)
    if size is not None and _SUFFIX.fullmatch(basic[size.end() :]):
        basic = size[0]
        for pattern, replacement in _OTHER_NAMES:
            basic = pattern.sub(replacement, basic)
        if basic in known:
            return known[basic]
    makers = [bearing.name for key, bearing in known.items() if _MAKERS.sub("", key) == basic]
    if makers:
        raise InputError(
            f"bearing {name!r} is known by maker only: their balls differ",
            allowed=", ".join(makers),
            remedy="name the maker, or give the geometry or the orders from its catalogue",
        )
    raise InputError(
        f"bearing {name!r} is not in the catalogue",
        allowed="ball bearings 60.., 62.., 63.., 69.., 72.., 73.. and others: `gearsig rig bearings` lists them",
        remedy="give n_rolling_elements, rolling_element_diameter_mm and pitch_diameter_mm, or the orders, which the "
        "makers publish",
    )


# --------------------
# A bearing of a rig.
# --------------------


@dataclass(frozen=True)
class Bearing:
    """A rolling-element bearing with a rotating inner ring and a stationary outer ring.

    Give a catalogue name (`bearing = "6205"`), the geometry (`n_rolling_elements`, both diameters, contact angle) or
    the orders from its maker. Orders take precedence over the geometry, and the geometry over the name. Orders are
    cycles per revolution of the bearing's own shaft.
    """

    name: str
    shaft: str
    n_rolling_elements: int | None = None
    rolling_element_diameter_mm: float | None = None
    pitch_diameter_mm: float | None = None
    contact_angle_deg: float = 0.0
    bpfo_order: float | None = None
    bpfi_order: float | None = None
    bsf_order: float | None = None
    ftf_order: float | None = None
    bearing: str = ""

    def __post_init__(self) -> None:
        check_texts(self, "name", "shaft", "bearing")
        where = f"of bearing {self.name!r}"
        if self.bearing and self.n_rolling_elements is None and not any((self.bpfo_order, self.bpfi_order)):
            known = catalogue_bearing(self.bearing)
            for key in ("n_rolling_elements", "rolling_element_diameter_mm", "pitch_diameter_mm", "contact_angle_deg"):
                object.__setattr__(self, key, getattr(known, key))
        geometry = (self.n_rolling_elements, self.rolling_element_diameter_mm, self.pitch_diameter_mm)
        if any(v is not None for v in geometry) and not all(v is not None for v in geometry):
            raise InputError(
                f"the geometry {where} is incomplete",
                allowed="all three or none: n_rolling_elements, rolling_element_diameter_mm, pitch_diameter_mm",
            )
        if self.n_rolling_elements is not None:
            count(self.n_rolling_elements, f"n_rolling_elements {where}", minimum=3)
            ball = positive(self.rolling_element_diameter_mm or 0.0, f"rolling_element_diameter_mm {where}", "mm")
            pitch = positive(self.pitch_diameter_mm or 0.0, f"pitch_diameter_mm {where}", "mm")
            if ball >= pitch:
                raise InputError(
                    f"rolling elements {where} are not smaller than the pitch diameter ({ball:g} >= {pitch:g} mm)"
                )
        within(self.contact_angle_deg, f"contact_angle_deg {where}", 0, 89, "deg")
        for key in ("bpfo_order", "bpfi_order", "bsf_order", "ftf_order"):
            value = getattr(self, key)
            if value is not None:
                positive(value, f"{key} {where}")

    def orders(self) -> dict[str, float]:
        """Return the known orders by name: BPFO, BPFI, BSF, FTF.

        With n elements of diameter d on pitch diameter D and contact angle a, and g = d cos(a)/D:
        BPFO = n(1 - g)/2, BPFI = n(1 + g)/2, BSF = (D/2d)(1 - g²), FTF = (1 - g)/2.
        BSF is the rolling element's spin order; a defect on it strikes both races, so twice per spin.

        Source: T. A. Harris, *Rolling Bearing Analysis*, 4th ed., ch. 2 (kinematics without slip).
        """
        orders: dict[str, float] = {}
        if self.n_rolling_elements is not None:
            ball, pitch = self.rolling_element_diameter_mm or 0.0, self.pitch_diameter_mm or 0.0
            g = ball * cos(radians(self.contact_angle_deg)) / pitch
            n = self.n_rolling_elements
            orders = {
                "BPFO": n * (1 - g) / 2,
                "BPFI": n * (1 + g) / 2,
                "BSF": pitch / (2 * ball) * (1 - g * g),
                "FTF": (1 - g) / 2,
            }
        stated = {"BPFO": self.bpfo_order, "BPFI": self.bpfi_order, "BSF": self.bsf_order, "FTF": self.ftf_order}
        return orders | {name: order for name, order in stated.items() if order is not None}
