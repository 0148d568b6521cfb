"""Contact of the teeth in a rig: round trip, text, errors that name the table."""

from pathlib import Path

import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.rig import (
    GearPair,
    Rig,
    Shaft,
    ToothContact,
    describe_rig,
    hertz_stiffness_n_per_m1p5,
    path_of_contact,
    read_rig,
    rig_from_dict,
    rig_to_dict,
)

PAIR = GearPair("p", "in", "out", 20, 100, 5.0, 20.0)
CONTACT = ToothContact(1.8e10, "p", half_backlash_um=150.0, driven_inertia_kg_m2=45.0, motor_inertia_kg_m2=0.05)
RIG = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(PAIR,), contact=CONTACT)


def test_round_trip_and_text() -> None:
    assert rig_from_dict(rig_to_dict(RIG)) == RIG
    text = describe_rig(RIG)
    assert "backlash 300 um" in text
    assert "contact ratio 1.705" in text
    assert "Contact" not in describe_rig(Rig(shafts=RIG.shafts, pairs=RIG.pairs))


def test_a_contact_without_geometry_says_so() -> None:
    bare = Rig(shafts=RIG.shafts, pairs=(GearPair("p", "in", "out", 20),), contact=CONTACT)
    assert "lacks teeth, module or pressure angle" in describe_rig(bare)
    with pytest.raises(RefusalError, match="lacks teeth"):
        path_of_contact(bare)


def test_a_contact_of_a_pair_that_is_not_there() -> None:
    with pytest.raises(InputError, match="there is no pair 'q'"):
        Rig(shafts=RIG.shafts, pairs=(PAIR,), contact=ToothContact(1e10, "q"))


@pytest.mark.parametrize(
    ("line", "named"),
    [
        ("driven_inertia_kg_m2 = -1", "driven_inertia_kg_m2"),
        ("restitution = 1.2", "restitution"),
        ('damping_law = "flore"', "did you mean flores"),
        ("stifness = 2", "there is no key 'stifness'"),
        ("speed_rpm = 2", r"it belongs in \[operating_point\]"),
        ("exponent = 'x'", "a number"),
    ],
)
def test_errors_name_file_and_table(tmp_path: Path, line: str, named: str) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(
        '[[pair]]\nname = "p"\ndriver = "in"\ndriven = "out"\n[contact]\nstiffness_n_per_m_lambda = 1e10\n'
        + line
        + "\n"
    )
    with pytest.raises(InputError, match=named) as caught:
        read_rig(path)
    assert "rig.toml: [contact]" in str(caught.value)


def test_formula_of_the_stiffness() -> None:
    """k = 4/3 √ρ E*, ρ = u d1 sin α/(2(1 + u)): four times the radius, twice the stiffness; linear in E."""
    base = hertz_stiffness_n_per_m1p5(5.0, 0.05, 0.349)
    assert hertz_stiffness_n_per_m1p5(5.0, 0.2, 0.349) == pytest.approx(2.0 * base)
    assert hertz_stiffness_n_per_m1p5(5.0, 0.05, 0.349, youngs_modulus_pa=105e9) == pytest.approx(0.5 * base)
