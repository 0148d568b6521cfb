"""Rig files: round trip, closest name for a misspelt key, errors that name file, table and key."""

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.rig import (
    Bearing,
    ConstantSpeed,
    EncoderChannel,
    GearPair,
    OperatingPoint,
    Rig,
    Sensor,
    Shaft,
    SpeedChannel,
    TachometerChannel,
    describe_rig,
    read_rig,
    rig_from_dict,
    rig_to_dict,
    write_rig,
)

NAMES = st.text(min_size=1, max_size=12)


@given(
    name=NAMES,
    channel=NAMES,
    teeth=st.tuples(st.integers(3, 300), st.integers(3, 300) | st.none()),
    module=st.floats(0.1, 50) | st.none(),
    speed=st.sampled_from(
        [
            None,
            ConstantSpeed(1500.0, "in"),
            TachometerChannel("t", 2, 0.5, 0.1, "falling", "in"),
            EncoderChannel("e", 360.0, wraps=False),
            SpeedChannel("n", 60.0),
        ]
    ),
)
def test_round_trip(name, channel, teeth, module, speed, tmp_path_factory) -> None:  # type: ignore[no-untyped-def]
    rig = Rig(
        name=name,
        shafts=(Shaft("in"), Shaft("out", "cw")),
        pairs=(GearPair("p", "in", "out", *teeth, module_mm=module),),
        bearings=(Bearing("b", "out", bpfo_order=3.1),),
        sensors=(Sensor(channel, "acceleration", "m/s^2", scale=9.81),),
        operating_point=OperatingPoint("in", 1500.0, 2.0),
        speed=speed,
        sources=("a", "b"),
        assumed=("teeth",),
    )
    assert rig_from_dict(rig_to_dict(rig)) == rig
    path = tmp_path_factory.getbasetemp() / "round_trip.toml"
    write_rig(rig, path)
    assert read_rig(path) == rig


def test_shafts_and_names_of_pairs_may_be_left_out() -> None:
    rig = rig_from_dict(
        {"pair": [{"driver": "in", "driven": "out", "driver_teeth": 23}, {"driver": "out", "driven": "x"}]}
    )
    assert rig.shaft_names == ("in", "out", "x")
    assert [pair.name for pair in rig.pairs] == ["stage 1", "stage 2"]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[[pair]\n", "rig.toml: is not valid TOML"),
        (
            '[[pair]]\nname = "p"\ndriver = "a"\ndriven = "b"\ndriver_teth = 20\n',
            r"\[\[pair\]\] 1.*did you mean driver_teeth",
        ),
        (
            '[[pair]]\nname = "p"\ndriver = "a"\ndriven = "b"\ndriver_teeth = 20.5\n',
            "driver_teeth: is 20.5.*whole number",
        ),
        ('[[pair]]\nname = "p"\ndriver = "a"\ndriven = "b"\ndriver_teeth = 0\n', "driver teeth of pair 'p' is 0"),
        ('[[pair]]\nname = "p"\n', "driver, driven must be given"),
        ("[gears]\n", "no 'gears'"),
        ("shaft = 3\n", r"write \[\[shaft\]\]"),
        ('[speed]\nsource = "tacho"\n', "did you mean tachometer"),
        ('[speed]\nsource = "pulse times"\n', "--tach-times"),
        ('[speed]\nsource = "constant"\nspeed_rpm = nan\n', "speed_rpm is nan"),
        ("[operating_point]\ntorque_nm = nan\n", r"\[operating_point\].*torque_nm is nan N m.*its size"),
        ("[operating_point]\ntorque_nm = inf\n", "torque_nm is inf N m.*a finite number"),
        ('sources = "book"\n', "a list of texts"),
    ],
)
def test_errors_name_the_place(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=expected) as caught:
        read_rig(path)
    assert "rig.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("torque_nm", [0.0, -80.0])
def test_no_load_and_either_direction_are_torques(torque_nm: float) -> None:
    assert rig_from_dict({"operating_point": {"torque_nm": torque_nm}}).operating_point.torque_nm == torque_nm


def test_not_a_text_file(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_bytes(b"\x80\x04\x95\xff")
    with pytest.raises(InputError, match="UTF-8"):
        read_rig(path)
    with pytest.raises(InputError, match="cannot be read"):
        read_rig(tmp_path / "absent.toml")


def test_description_lists_every_order() -> None:
    rig = Rig(
        shafts=(Shaft("in"), Shaft("out")),
        pairs=(GearPair("p", "in", "out", 23, 46),),
        bearings=(Bearing("b", "in", 9, 7.94, 39.04),),
        operating_point=OperatingPoint("in", 1200.0),
    )
    text = describe_rig(rig)
    for part in ("mesh order 23", "460.000 Hz", "BPFO", "BPFI", "BSF", "FTF", "hunting tooth", "1× mesh p + 1× out"):
        assert part in text
    assert "No shafts" in describe_rig(Rig())


@pytest.mark.parametrize(
    "text",
    [
        "a=" + "[" * 5000 + "]" * 5000,
        "sampling_rate_hz=" + "1" * 5000,
        "sampling_rate_hz=1" + "0" * 400,
        "a" + ".a" * 20_000 + "=1",
        "".join(f'[[shaft]]\nname="{i}"\n' for i in range(40_000)),
        "#" * 1_000_001,
    ],
)
def test_hostile_toml_is_refused_quickly(tmp_path, text):
    path = tmp_path / "x.toml"
    path.write_text(text)
    begin = time.process_time()
    with pytest.raises(InputError, match=r"x\.toml"):
        read_rig(path)
    assert time.process_time() - begin < 5


def test_rig_is_not_written_where_nothing_can_be(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        write_rig(Rig(), tmp_path / "file" / "x.toml")


def test_a_constant_speed_without_its_value_points_at_the_nominal_one(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(
        '[[shaft]]\nname = "s"\n[operating_point]\nshaft = "s"\nspeed_rpm = 3600\n[speed]\nsource = "constant"\n'
    )
    with pytest.raises(InputError, match=r'must be given; write speed_rpm = 3600 and shaft = "s" if .*operating_point'):
        read_rig(path)
