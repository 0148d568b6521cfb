"""Numbers with units: what they are worth, and which units are refused."""

from contextlib import suppress
from math import isfinite, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.cli.quantities import quantity, span
from gearsig.errors import InputError


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("2", "mm", 2.0),
        ("2mm", "mm", 2.0),
        (" 2 mm ", "mm", 2.0),
        ("0.002 m", "mm", 2.0),
        ("500µm", "mm", 0.5),  # micro sign
        ("500μm", "mm", 0.5),  # Greek mu
        ("500um", "µm", 500.0),
        ("0.02mm", "um", 20.0),
        ("1e3rpm", "rpm", 1000.0),
        ("10 rad/s", "rpm", 10 * 30 / pi),
        ("25 1/s", "rpm", 1500.0),
        ("110Nm", "N m", 110.0),
        ("110 N·m", "N m", 110.0),
        ("0.11 kN m", "N m", 110.0),
        ("20.48kHz", "Hz", 20480.0),
        ("250ms", "s", 0.25),
        ("5 %", "%", 5.0),
        ("30 g mm", "g mm", 30.0),
        ("0.03 kg mm", "g mm", 30.0),
        ("45°", "deg", 45.0),
        ("1.5707963267948966rad", "°", 90.0),
        ("2 kN/mm", "N/m", 2e6),
        ("1 g", "m/s^2", 9.80665),
        ("1 g", "kg", 1e-3),
        ("1g/sqrt Hz", "m/s^2/√Hz", 9.80665),
        ("7.85 g/cm³", "kg/m^3", 7850.0),
        ("-3", "", -3.0),
        (".5", "", 0.5),
        ("2.", "", 2.0),
    ],
)
def test_worth(text: str, unit: str, value: float) -> None:
    assert quantity(text, unit, "x") == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "unit", "named"),
    [
        ("2Nm", "mm", "give it in mm"),
        ("2 nm", "N m", "give it in N m"),  # nanometres are no torque
        ("20Hz", "rpm", "give it in rpm"),
        ("5rpm", "s", "give it in s"),
        ("3mm", "", "without a unit"),
        ("3 furlongs", "mm", "'furlongs'"),
        ("mm", "mm", "a number in mm"),
        ("", "mm", "a number in mm"),
        ("1,5mm", "mm", "',5mm'"),
        ("nan", "mm", "a number"),
        ("inf", "mm", "a number"),
        ("1e999", "mm", "a number"),
        ("--2", "mm", "a number"),
        ("0x10", "mm", "'x10'"),
    ],
)
def test_refused(text: str, unit: str, named: str) -> None:
    with pytest.raises(InputError) as caught:
        quantity(text, unit, "depth")
    assert named in str(caught.value)
    assert "depth" in str(caught.value)


@given(st.floats(-1e6, 1e6), st.sampled_from(["nm", "um", "mm", "cm", "m"]), st.sampled_from(["um", "mm", "m"]))
def test_a_length_survives_a_change_of_units(value: float, given_in: str, wanted: str) -> None:
    there = quantity(f"{value!r}{given_in}", wanted, "x")
    assert quantity(f"{there!r}{wanted}", given_in, "x") == pytest.approx(value, rel=1e-12, abs=1e-300)


@given(st.text(max_size=12))
def test_any_text_is_a_number_or_refused(text: str) -> None:
    with suppress(InputError):
        assert isfinite(quantity(text, "mm", "x"))


@pytest.mark.parametrize(
    ("text", "unit", "ends"),
    [
        ("300..1500rpm", "rpm", (300.0, 1500.0)),
        ("0.5..1.5m", "mm", (500.0, 1500.0)),
        ("5mm .. 0.01m", "mm", (5.0, 10.0)),
        ("-1..1", "", (-1.0, 1.0)),
        ("1e2..1e3", "Hz", (100.0, 1000.0)),
        ("2...5", "mm", (2.0, 0.5)),
    ],
)
def test_span(text: str, unit: str, ends: tuple[float, float]) -> None:
    assert span(text, unit, "x") == pytest.approx(ends, rel=1e-12)


@pytest.mark.parametrize("text", ["..5", "5..", "a..b", "1..2..3"])
def test_half_a_span_is_refused(text: str) -> None:
    with pytest.raises(InputError):
        span(text, "rpm", "speed")
