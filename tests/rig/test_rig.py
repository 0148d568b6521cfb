"""Rigs: orders by hand, contradictions, gear trains, bearings against catalogue and closed form."""

from math import isclose, lcm

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.rig import (
    Bearing,
    GearPair,
    MachineSize,
    OperatingPoint,
    Rig,
    Sensor,
    Shaft,
    TachometerChannel,
    hunting_tooth_order,
    known_ratio,
    order_lines,
)

TEETH = st.integers(3, 200)


def two_stages(z1: int, z2: int, z3: int, z4: int) -> Rig:
    return Rig(
        shafts=(Shaft("in"), Shaft("mid"), Shaft("out")),
        pairs=(GearPair("first", "in", "mid", z1, z2), GearPair("second", "mid", "out", z3, z4)),
    )


@given(TEETH, TEETH, TEETH, TEETH)
def test_orders_of_a_two_stage_train(z1: int, z2: int, z3: int, z4: int) -> None:
    rig = two_stages(z1, z2, z3, z4)
    assert isclose(rig.ratio("out") or 0, z1 * z3 / (z2 * z4))
    assert isclose(rig.mesh_order(rig.pair("second")) or 0, z3 * z1 / z2)
    assert isclose(rig.mesh_order(rig.pair("first"), "out") or 0, z1 / (z1 * z3 / (z2 * z4)))
    # The same two teeth meet again after lcm(z1, z2) tooth engagements.
    assert isclose(hunting_tooth_order(rig, rig.pair("first")) or 0, z1 / lcm(z1, z2))


@given(TEETH, TEETH, TEETH)
def test_a_loop_of_pairs_must_agree(z1: int, z2: int, z3: int) -> None:
    shafts = (Shaft("a"), Shaft("b"))
    pairs = (GearPair("one", "a", "b", z1, z2), GearPair("two", "a", "b", z1, z3))
    if z2 == z3:
        Rig(shafts=shafts, pairs=pairs)
    else:
        with pytest.raises(InputError, match="contradicts"):
            Rig(shafts=shafts, pairs=pairs)


def test_sidebands_lie_at_mesh_plus_minus_shaft() -> None:
    rig = two_stages(23, 46, 19, 57)
    lines = [x for x in order_lines(rig) if x.kind == "sideband" and x.element == "first" and x.harmonic == 1]
    assert sorted(round(x.order, 9) for x in lines) == [21, 22, 22, 22.5, 23.5, 24, 24, 25]


def test_unknown_teeth_leave_out_what_rests_on_them() -> None:
    rig = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 23),))
    assert rig.mesh_order(rig.pairs[0]) == 23
    assert rig.ratio("out") is None
    assert {line.element for line in order_lines(rig)} == {"in", "p"}


def test_pairs_are_found_by_their_shafts_and_told_by_their_teeth() -> None:
    first, second = GearPair("a", "in", "mid", 20, 31), GearPair("b", "mid", "out", None, 47)
    rig = Rig(shafts=(Shaft("in"), Shaft("mid"), Shaft("out")), pairs=(first, second))
    assert [rig.pairs_on(shaft) for shaft in ("in", "mid", "none")] == [(first,), (first, second), ()]
    assert (rig.teeth_text, Rig().teeth_text) == ("20/31, ?/47", "")


def test_a_ratio_that_must_be_known_is_refused_without_the_teeth_or_the_rig() -> None:
    rig = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("pair", "in", "out", 20, None),))
    for known in (rig, None):
        with pytest.raises(RefusalError, match="shaft 'out' does not follow from the teeth"):
            known_ratio(known, "out", to="in")
    assert known_ratio(two_stages(20, 40, 10, 30), "out") == pytest.approx(1 / 6)


def test_speed_follows_the_ratio() -> None:
    rig = Rig(
        shafts=(Shaft("in"), Shaft("out")),
        pairs=(GearPair("p", "in", "out", 20, 80),),
        operating_point=OperatingPoint("out", 300.0),
    )
    assert rig.reference_shaft == "out"
    assert rig.nominal_speed_rpm("in") == 1200
    assert rig.nominal_torque_nm("in") is None


def test_torque_falls_as_speed_rises() -> None:
    rig = Rig(
        shafts=(Shaft("in"), Shaft("out")),
        pairs=(GearPair("p", "in", "out", 20, 80),),
        operating_point=OperatingPoint("out", 300.0, torque_nm=-80.0),
    )
    assert rig.nominal_torque_nm() == 80.0
    assert rig.nominal_torque_nm("in") == 20.0


def test_bearing_orders_of_6205() -> None:
    """Deep-groove ball bearing 6205-2RS JEM SKF: 9 balls of 7.94 mm on 39.04 mm.

    Orders as published by the Case Western Reserve University Bearing Data Center:
    BPFI 5.4152, BPFO 3.5848, FTF 0.39828, ball 4.7135 (impacts per revolution: twice the spin).
    """
    orders = Bearing("b", "s", 9, 7.94, 39.04).orders()
    assert orders["BPFI"] == pytest.approx(5.4152, abs=1.5e-3)
    assert orders["BPFO"] == pytest.approx(3.5848, abs=1.5e-3)
    assert orders["FTF"] == pytest.approx(0.39828, abs=2e-4)
    assert 2 * orders["BSF"] == pytest.approx(4.7135, abs=2e-3)


@given(st.integers(3, 40), st.floats(1, 30), st.floats(31, 200), st.floats(0, 60))
def test_bearing_identities(n: int, ball: float, pitch: float, angle: float) -> None:
    orders = Bearing("b", "s", n, ball, pitch, angle).orders()
    assert isclose(orders["BPFO"] + orders["BPFI"], n)
    assert isclose(orders["BPFO"], n * orders["FTF"])
    assert orders["FTF"] < 0.5


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: GearPair("p", "a", "b", 0, 20), "driver teeth of pair 'p' is 0"),
        (lambda: GearPair("p", "a", "a", 20, 20), "with itself"),
        (lambda: GearPair("p", "a", "b", 20, 20, module_mm=-1.0), "module_mm of pair 'p' is -1"),
        (lambda: GearPair("p", "a", "b", 20, 20, pressure_angle_deg=80.0), "10 to 35"),
        (lambda: Bearing("b", "s", 9, 40.0, 30.0), "not smaller than the pitch diameter"),
        (lambda: Bearing("b", "s", 9), "incomplete"),
        (lambda: Rig(shafts=(Shaft("a"), Shaft("a"))), "more than once"),
        (lambda: Rig(shafts=(Shaft("input"),), bearings=(Bearing("b", "inptu"),)), "did you mean input"),
        (lambda: Rig(shafts=(Shaft("a"),), sampling_rate_hz=0.0), "sampling_rate_hz is 0"),
        (
            lambda: Rig(
                shafts=tuple(Shaft(n) for n in "abcd"),
                pairs=(GearPair("p", "a", "b", 20, 30), GearPair("q", "c", "d", 20, 30)),
            ),
            "share no shaft",
        ),
    ],
)
def test_nonsense_is_refused_by_name(make, text: str) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError, match=text):
        make()


def test_a_rig_is_shown_as_a_person_would_write_it() -> None:
    rig = Rig(
        "pump <4>",
        (Shaft("in"), Shaft("out")),
        (GearPair("stage 1", "in", "out", 23, 46),),
        (Bearing("b1", "in", bearing="6205"),),
        operating_point=OperatingPoint("in", 1480.0),
        speed=TachometerChannel("tacho", 60),
        machine=MachineSize(55.0, mounting="rigid"),
    )
    head, *lines = repr(rig).splitlines()
    assert head == "Rig 'pump <4>'"
    facts = dict(line.strip().split(": ", 1) for line in lines)
    assert facts["gear pair stage 1"] == "23 teeth on in drive 46 on out"
    assert facts["bearing b1"].startswith("6205 on in; orders BPFO 3.58")
    assert facts["nominal speed"] == "1480 rpm of in"
    assert facts["speed from"] == "tachometer, channel tacho, 60 pulses per revolution"
    assert facts["size"] == "55 kW, rigid mounting"
    assert "pump &lt;4&gt;" in rig._repr_html_()
    assert all(text in rig._repr_html_() for text in facts.values())
    assert repr(Rig()) == "Rig ''"


@pytest.mark.parametrize(("quantity", "unit"), [("acceleration", "mm"), ("acceleration", "m/s2rms"), ("angle", "V")])
def test_a_sensor_s_unit_is_one_of_its_quantity(quantity: str, unit: str) -> None:
    with pytest.raises(InputError, match=rf"unit of sensor 'a1' is '{unit}' \(allowed: for {quantity}: "):
        Sensor("a1", quantity, unit)
    assert Sensor("a1", "encoder", "counts").unit == "counts"
