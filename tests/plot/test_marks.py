from gearsig.diagnosis import Finding, Kind, Where
from gearsig.plot import AngleMark, marks_of


def _finding(kind=Kind.FAULT, **where):
    return Finding("code", kind, "title", Where(**where))


def test_angle_wins_and_is_brought_into_one_revolution():
    assert marks_of([_finding(shaft="in", angle_deg=370.0, tooth=1)], "in", 20) == (AngleMark(10.0, "tooth 1, 10°"),)


def test_tooth_without_angle_is_marked_in_its_middle():
    assert marks_of([_finding(gear="p/in", tooth=3)], "in", 36)[0].angle_deg == 25.0
    assert marks_of([_finding(gear="p/in", tooth=3)], "in") == ()


def test_other_shafts_and_harmless_kinds_are_not_marked():
    assert marks_of([_finding(shaft="out", angle_deg=1.0)], "in") == ()
    assert marks_of([_finding(Kind.NOTICE, shaft="in", angle_deg=1.0)], "in") == ()
