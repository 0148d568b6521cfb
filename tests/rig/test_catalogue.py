"""The bearings that are known by name: against published frequency factors and load ratings."""

from dataclasses import replace

import numpy as np
import pytest

from app.studies.bearing_geometry import decided, read_ratings
from gearsig.errors import InputError
from gearsig.rig import Bearing, bearing_catalogue, catalogue_bearing, from_table, to_table

# ISO 76:2006, table 1: f0 of radial ball bearings over Dw·cos(a)/Dpw, every 0.02 from 0.08.
RATIO = np.arange(0.08, 0.34, 0.02)
F0 = np.array([16.3, 16.4, 15.9, 15.4, 14.9, 14.4, 14.0, 13.5, 13.0, 12.5, 12.1, 11.6, 11.2])

# Static load ratings C0r in kN, as published.
C0R_KN = {
    "6000": 1.97,
    "6004": 5.05,
    "6008": 11.5,
    "6012": 23.2,
    "6016": 40.0,
    "6020": 54.0,
    "608": 1.37,
    "629": 1.97,
    "6201": 3.05,
    "6204": 6.6,
    "6207": 15.3,
    "6210": 23.2,
    "6213": 40.0,
    "6216": 53.0,
    "6220": 93.0,
    "6403": 10.8,
    "6304": 7.9,
    "6307": 19.3,
    "6310": 38.5,
    "6314": 68.0,
    "6318": 107.0,
    "NSK 6900": 1.27,
    "NSK 6906": 5.0,
    "6910": 11.7,
    "NSK 6305": 11.2,
    "NTN 6305": 10.9,
    "SKF 6305": 11.6,
    "NTN 6217": 64.0,
    "6409": 45.0,
    "6915": 22.6,
    "6324": 185.0,
    "SKF 61912": 14.3,
}

# BPFO and BPFI as others publish them: SKF 6205 and 6203 of CWRU, Timken's table, test rigs.
PUBLISHED = {
    "6205-2RS": (3.5848, 5.4152),
    "6203": (3.0530, 4.9469),
    "6204": (3.052, 4.948),
    "6206": (3.568, 5.432),
    "6207": (3.565, 5.435),
    "6210": (4.093, 5.907),
    "6214": (4.104, 5.896),
    "6310": (3.047, 4.953),
    "6316": (3.086, 4.914),
    "Timken 208K": (3.547, 5.453),
    "ER16K": (3.572, 5.428),
    "LDK UER204": (3.083, 4.917),
    "NICE MFPT": (3.245, 4.755),
    "Rexnord ZA-2115": (7.092, 8.908),
}


@pytest.mark.parametrize("name", C0R_KN)
def test_balls_carry_the_published_load(name: str) -> None:
    b = catalogue_bearing(name)
    f0 = np.interp(b.rolling_element_diameter_mm / b.pitch_diameter_mm, RATIO, F0)
    c0r_kn = f0 * b.n_rolling_elements * b.rolling_element_diameter_mm**2 / 1000
    assert c0r_kn == pytest.approx(C0R_KN[name], rel=0.025)


@pytest.mark.parametrize("name", PUBLISHED)
def test_orders_are_the_published_ones(name: str) -> None:
    orders = Bearing("b", "s", bearing=name).orders()
    assert (orders["BPFO"], orders["BPFI"]) == pytest.approx(PUBLISHED[name], rel=5e-4)


def test_ratings_tell_the_balls_that_are_published_by_others() -> None:
    """Timken's own orders of 24 sizes: another number of balls in 6209 only, and larger balls in three."""
    ratings = {of.name: of for of in read_ratings()}
    off = []
    for timken in (b for b in bearing_catalogue().values() if b.source == "Timken"):
        of = ratings["6" + timken.name.split()[1].removesuffix("K")]
        fit = decided(of)
        if fit is not None and fit.n_balls == timken.n_rolling_elements:
            theirs = 1 - timken.rolling_element_diameter_mm / timken.pitch_diameter_mm
            off.append(abs((1 - fit.diameter_mm / of.pitch_mm) / theirs - 1))
    assert len(off) == 23
    assert np.median(off) < 1e-3
    assert max(off) < 0.02


def test_the_catalogue_has_what_ratings_decide() -> None:
    ratings = [of for of in read_ratings() if of.name in bearing_catalogue()][::10]
    for of in ratings:
        fit, listed = decided(of), catalogue_bearing(of.name)
        assert fit is None or listed.n_rolling_elements == fit.n_balls
    assert decided(replace(ratings[0], cr_kn=1.05 * ratings[0].cr_kn)) is None  # ratings that no balls have


def test_every_bearing_can_be_built() -> None:
    for b in bearing_catalogue().values():
        # Balls do not overlap, and leave room for a cage.
        chord_mm = b.pitch_diameter_mm * np.sin(np.pi / b.n_rolling_elements)
        assert 1.02 * b.rolling_element_diameter_mm < chord_mm < 2.1 * b.rolling_element_diameter_mm, b.name


@pytest.mark.parametrize(
    ("name", "same"),
    [
        ("skf 6205-2RS1/C3", "6205"),
        ("6205ZZ", "6205"),
        ("61904-2Z", "6904"),
        ("UCP 206", "6206"),
        ("UC310", "6310"),
        ("62304-2RS", "6304"),
        ("63006", "6006"),
        ("NSK 7208B", "7208B"),
        ("SKF 1210 ETN9", "SKF 1210E"),
    ],
)
def test_names_of_one_bearing(name: str, same: str) -> None:
    assert catalogue_bearing(name).name == same


@pytest.mark.parametrize(
    ("name", "says"),
    [
        ("6305", "SKF 6305"),
        ("UC305", "balls differ"),
        ("22220", "not in"),
        ("61907", "NSK 6907"),
        ("7208 BEP", "not in"),
        ("6205E", "not in"),
        ("NU 205", "not in"),
    ],
)
def test_names_that_tell_no_geometry(name: str, says: str) -> None:
    with pytest.raises(InputError, match=says):
        catalogue_bearing(name)


def test_in_a_rig_file() -> None:
    b = from_table(Bearing, {"name": "drive end", "shaft": "motor", "bearing": "6205"}, "rig")
    assert b.n_rolling_elements == 9
    assert from_table(Bearing, to_table(b), "rig") == b
    stated = Bearing("b", "s", bearing="22220", bpfo_order=8.2, bpfi_order=10.8)  # the maker's orders need no catalogue
    assert stated.orders() == {"BPFO": 8.2, "BPFI": 10.8}
