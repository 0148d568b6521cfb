"""Labelled recordings of a rig: the likelihood ratio against scipy's, the table, and what they change."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import t as student

from gearsig.errors import InputError
from gearsig.gap import (
    NONE,
    UNKNOWN,
    LabelledRecording,
    LabelSpace,
    attribute,
    conditions_of,
    fit_label_space,
    labelled_changes,
    labelled_support,
    read_labelled,
    with_labelled,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording, write_recording
from gearsig.rig import Rig
from sims.registry import gap_simulator
from tests.gap.synthetic import RIG, record, ringing

SPACE = LabelSpace(
    np.eye(2), ("crack", "none", UNKNOWN), np.zeros((3, 2)), np.array([4.0, 1.0]), np.array([[0.5, 0.0], [9.0, 9.0]])
)


def test_the_ratio_is_that_of_students_densities_about_what_the_label_lets_expect() -> None:
    rng = np.random.default_rng(0)
    rows, row = 3.0 * rng.normal(size=(4, 2)), 3.0 * rng.normal(size=2)
    found = SPACE.log_ratios(row, rows, "crack")
    for labelled, ratio in zip(rows, found, strict=True):
        expected = 0.0
        for k, between in enumerate(SPACE.between):
            joint = np.array([[between + 1.0, between], [between, between + 1.0]])  # of both, by the common place
            centre = joint[0, 1] / joint[1, 1] * labelled[k]
            variance = joint[0, 0] - joint[0, 1] ** 2 / joint[1, 1]
            expected += student.logpdf(row[k], 3.0, centre, variance**0.5)
            expected -= student.logpdf(row[k], 3.0, 0.0, (between + 1.0) ** 0.5)
        assert ratio == pytest.approx(expected)


def test_the_nearest_of_a_labels_recordings_speaks_loudest() -> None:
    near, far = labelled_support(np.array([10.0])), labelled_support(np.array([-50.0]))
    assert near > labelled_support(np.array([10.0, -50.0])) > near - np.log(2.0) - 1e-9 > far
    assert labelled_support(np.array([10.0, 10.0])) == pytest.approx(near)


def test_a_label_that_is_unheard_of_may_lie_anywhere() -> None:
    rows = np.full((1, 2), 5.0)
    assert SPACE.log_ratios(np.full(2, 5.0), rows, "mine")[0] > 0.5
    assert SPACE.log_ratios(np.full(2, -5.0), rows, "mine")[0] < 0.0


def test_directions_are_those_in_which_machines_differ_and_recordings_do_not() -> None:
    rng = np.random.default_rng(0)
    machines, causes = np.repeat(np.arange(60), 6), np.tile(["a", "a", "a", "b", "b", "b"], 60)
    rows = rng.normal(size=(360, 5)) * [1.0, 5.0, 1.0, 1.0, 1.0]
    rows[:, 0] += np.repeat(rng.normal(size=120) * 6.0, 3)
    space = fit_label_space(rows, causes, machines)
    assert abs(space.directions[0, 0]) > 10.0 * np.abs(space.directions[1:, 0]).max()
    scatter = rows @ space.directions[:, 0]
    within = np.mean([scatter[i : i + 3].var(ddof=1) for i in range(0, 360, 3)])
    assert within == pytest.approx(1.0, abs=0.25)
    assert space.between[0] == pytest.approx(36.0, rel=0.5)


def test_what_says_nothing_changes_nothing_and_sums_stay() -> None:
    given = {"crack": 0.6, NONE: 0.3, UNKNOWN: 0.1}
    assert with_labelled(given, {}, {}) == pytest.approx(given)
    assert with_labelled(given, dict.fromkeys(given, 7.0), {}) == pytest.approx(given)
    found = with_labelled(given, {NONE: 2.0, "mine": 4.0}, {"mine": 0.5})
    assert sum(found.values()) == pytest.approx(1.0)
    assert next(iter(found)) == "mine"
    assert found[NONE] > found["crack"]


# --------------------
# The table.
# --------------------


HEAD = "file,effect,reference,note\n"


def write(folder: Path, text: str) -> Path:
    for name in ("a.wav", "h.wav"):
        write_recording(replace(record(seed=len(list(folder.iterdir()))), rig=None), folder / name)
    (folder / "labels.csv").write_text(text, encoding="utf-8")
    return folder


@pytest.mark.parametrize("separator", [",", ";"])
def test_a_table_is_read(tmp_path: Path, separator: str) -> None:
    text = (HEAD + "a.wav,Root crack,h.wav,2.5\n\nh.wav,Healthy,,\n").replace(",", separator)
    crack, healthy = read_labelled(write(tmp_path, text), rig=RIG, sampling_rate_hz=12800.0)
    assert (crack.effect, healthy.effect) == ("root_crack", NONE)
    assert crack.reference is not None
    assert np.array_equal(crack.reference.samples, healthy.recording.samples)
    assert healthy.reference is None
    assert crack.recording.rig is not None


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("file,note\na.wav,1\n", "line 1"),
        (HEAD, "labels.csv"),
        (HEAD + "a.wav,crack,h.wav,1\nb.wav,crack,,\n", "line 3"),
        (HEAD + "../a.wav,crack,,\n", "line 2"),
        (HEAD + "/etc/passwd,crack,,\n", "line 2"),
        (HEAD + ",crack,,\n", "line 2"),
        (HEAD + "a.wav,,,\n", "line 2"),
        (HEAD + "a.wav,unknown,,\n", "line 2"),
        (HEAD + "a.wav,<b>x</b>,,\n", "line 2"),
        (HEAD + "a.wav,crack,a.wav,\n", "line 2"),
        (HEAD + "a.wav,crack,,1,2\n", "line 2"),
    ],
)
def test_a_wrong_table_is_an_error_with_its_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(InputError) as error:
        read_labelled(write(tmp_path, text), rig=RIG)
    assert line in error.value.where


def test_a_folder_without_a_table_says_what_belongs_there(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"labels\.csv"):
        read_labelled(tmp_path, rig=RIG)


# --------------------
# What they change.
# --------------------


def impact(order: float, size: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda _time, revolutions: size * ringing(order * revolutions)


@pytest.mark.slow
def test_a_fault_of_ones_own_is_a_class_and_what_was_read_is_kept(tmp_path: Path) -> None:
    simulator = gap_simulator("cracked")
    twin, effects = simulator.twin_of(RIG), simulator.gap_effects()

    def named(recording: Recording, name: str, rig: Rig = RIG) -> Recording:
        return recording.with_rig(rig).with_name(name)

    healthy = [PreparedRecording(named(record(seed=9), "healthy"))]
    now = [PreparedRecording(named(record(impact(3.37, 4.0), seed=1), "now"))]
    conditions, _ = conditions_of(now, healthy, twin)
    labelled = [
        *(
            LabelledRecording(named(record(impact(3.37, s), seed=i), f"{i}"), "loose_cover")
            for i, s in ((2, 3.0), (3, 6.0))
        ),
        *(LabelledRecording(named(record(seed=i), f"{i}"), NONE) for i in (4, 5)),
    ]
    read = partial(labelled_changes, labelled, healthy, conditions, twin, tmp_path)
    changes, notes = read()
    assert notes == []
    again, _ = read()
    assert len(list(tmp_path.glob("labelled-*.npz"))) == 4
    for one, other in zip(changes, again, strict=True):
        assert np.array_equal(one.changes[True].values, other.changes[True].values)
    found = attribute(conditions, effects, (), twin, None, lambda *_: None, max_tried=0, labelled=changes)
    p = found.probabilities()
    assert next(iter(p)) == "loose_cover"
    without = replace(found, labelled=None).probabilities()
    assert "loose_cover" not in without
    assert sum(p.values()) == pytest.approx(1.0)
    assert found.labelled is not None
    assert found.labelled.counts == {"loose_cover": 2, NONE: 2}
