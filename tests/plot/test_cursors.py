"""Marks at known orders and angles."""

from hypothesis import given
from hypothesis import strategies as st

from gearsig.diagnosis import Finding, Kind, Where
from gearsig.plot import PRIORITY, AngleMark, Cursor, marks_of, n_rows, order_cursors, place
from gearsig.rig import GearPair, Rig, Shaft, order_lines

cursors = st.lists(
    st.builds(
        Cursor,
        st.floats(-5, 105),
        st.sampled_from(PRIORITY),
        st.sampled_from(["", "1× mesh", "BPFO long bearing name"]),
    ),
    max_size=60,
)


@given(cursors, st.floats(2.0, 9.0))
def test_labels_never_overlap_and_stay_in_the_figure(cursors, width_in):
    labels = [label for _, label in place(cursors, (0.0, 100.0), width_in) if label is not None]
    for i, one in enumerate(labels):
        assert one.low_in >= -0.45
        for other in labels[:i]:
            if one.row == other.row:
                assert one.high_in <= other.low_in or other.high_in <= one.low_in
            lower, higher = sorted((one, other), key=lambda label: label.row)
            if lower.row < higher.row:
                assert not lower.low_in < higher.line_in < lower.high_in


@given(cursors)
def test_only_cursors_inside_the_limits_are_drawn(cursors):
    placed = [cursor for cursor, _ in place(cursors, (0.0, 100.0), 8.0)]
    assert all(0 <= cursor.position <= 100 for cursor in placed)
    assert set(placed) <= set(cursors)


def test_mesh_keeps_its_place_against_a_sideband():
    mesh, sideband = Cursor(23.0, "mesh", "1× mesh"), Cursor(23.0, "sideband", "+1× input")
    ((cursor, label),) = place([sideband, mesh], (0.0, 100.0), 8.0)
    assert cursor == mesh
    assert label is not None


def test_a_label_stands_aside_for_a_line_that_waits_for_its_own():
    lines = ("bearing", "BPFO", 3.245), ("bearing", "BPFI", 4.755), *(("shaft", f"{k}× shaft", k) for k in (1, 2, 3))
    cursors = [Cursor(float(at), kind, label, at if kind == "shaft" else 1) for kind, label, at in lines]
    assert all(label is not None for _, label in place(cursors, (0.0, 15.7), 7.95))


def test_no_row_of_labels_is_empty():
    sides = [Cursor(50.0 + k * 0.5, "sideband", "+1× input", abs(k)) for k in (-2, -1, 1, 2)]
    placed = place([Cursor(50.0, "mesh", "1× mesh"), *sides], (0.0, 100.0), 7.95)
    assert {label.row for _, label in placed if label is not None} == set(range(n_rows(placed)))


def test_no_cursors_use_no_rows():
    assert n_rows(place([], (0.0, 1.0), 8.0)) == 0


def test_labels_are_short_where_there_is_one_pair():
    rig = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 20, 41),))
    found = {round(c.position, 6): c for c in order_cursors(order_lines(rig, n_mesh_harmonics=1, n_sidebands=2))}
    assert found[20].label == "1× mesh"
    assert found[18].label == "−2× in"
    assert found[18].number == 2


def test_cursors_over_frequency_are_orders_times_speed():
    rig = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 20, 41),))
    mesh = [c for c in order_cursors(order_lines(rig), 25.0) if c.kind == "mesh"]
    assert [c.position for c in mesh] == [500.0, 1000.0, 1500.0]


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
