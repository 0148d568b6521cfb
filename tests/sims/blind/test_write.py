"""Cases on disk: whole, readable, and silent about what is wrong."""

import json
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from gearsig.recording import read_recording
from gearsig.rig import read_rig
from sims.blind import CATALOGUE, OUTSIDE_CATALOGUE, BlindCase, draw_case, labels, record_case, write_visible

WORDS = [*CATALOGUE, *OUTSIDE_CATALOGUE, "severity", "seed", "twin", "sims", "blind", "none\"", "single",
         "unknown_effect",
         "development", "calibration", "evaluation", "fault", "healthy", "level"]  # fmt: skip


def short_case(seed: int, **wishes: object) -> BlindCase:
    case = draw_case(np.random.default_rng(seed), "calibration", n_conditions=2, with_reference=True, **wishes)
    return replace(
        case,
        conditions=tuple(replace(c, duration_s=0.4) for c in case.conditions),
        references=tuple(replace(c, duration_s=0.4) for c in case.references),
    )


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[BlindCase, Path, dict]]:
    made = []
    for wishes in ({"kind": "none"}, {"effect": "root_crack"}, {"effect": "coupling_knock"}, {"effect": "clipping"}):
        case = short_case(5, **wishes)
        recorded, seen = record_case(case), tmp_path_factory.mktemp("seen")
        write_visible(recorded, seen)
        made.append((case, seen, labels(case, recorded)))
    return made


@pytest.mark.slow
def test_the_folder_holds_what_the_page_says(written: list) -> None:
    for _, seen, _ in written:
        stems = ("condition_1", "condition_2", "reference_1", "reference_2")
        assert {p.name for p in seen.iterdir()} == {f"{s}{e}" for s in stems for e in (".h5", ".toml")} | {"rig.toml"}


def test_recordings_and_rig_read_back(written: list) -> None:
    for case, seen, _ in written:
        rig = read_rig(seen / "rig.toml")
        assert rig == read_rig(seen / "condition_1.toml")
        pair = rig.pairs[0]
        assert (pair.driver_teeth, pair.driven_teeth) == (case.rig.pair.z1, case.rig.pair.z2)
        for i, c in enumerate(case.conditions, 1):
            recording = read_recording(seen / f"condition_{i}.h5", rig=read_rig(seen / f"condition_{i}.toml"))
            assert recording.sampling_rate_hz == case.rig.sampling_rate_hz
            assert recording.truth is None
            assert recording.channel_names[-1] == "tacho"
            assert recording.rig is not None
            assert recording.rig.operating_point.speed_rpm == c.stated_rpm
            assert recording.rig.operating_point.torque_nm == pytest.approx(c.stated_nm, abs=0.005)


def test_nothing_tells_what_is_wrong(written: list) -> None:
    """No word of the answers in any byte that is not a sample; no name, time or size that differs by the case."""
    shapes = []
    for _, seen, _ in written:
        facts = {}
        for path in sorted(seen.iterdir()):
            if path.suffix == ".h5":
                with h5py.File(path) as file:
                    assert set(file) == {"samples", "gearsig_recording"}
                    assert not dict(file.attrs)
                    n_sample_bytes = file["samples"].size * file["samples"].dtype.itemsize
                    described = json.loads(file["gearsig_recording"][()])
                    text = json.dumps(described) + str(dict(file["samples"].attrs))
                assert described["truth"] is None
                assert described["history"] == described["warnings"] == []
                facts[path.name] = path.stat().st_size - n_sample_bytes
            else:
                text = path.read_text(encoding="utf-8")
                facts[path.name] = path.stat().st_size
            assert not [w for w in WORDS if w in text.lower()]
            facts[path.name + " time"] = path.stat().st_mtime
        shapes.append(facts)
    assert all(facts == shapes[0] for facts in shapes)


def test_the_raw_bytes_hold_no_label(written: list) -> None:
    for case, seen, _ in written:
        names = [f.name for f in case.faults]
        for path in seen.iterdir():
            raw = path.read_bytes()
            assert not [n for n in (*names, "labels", "twin") if n.encode() in raw]
            assert not re.search(rb"\d{12,}", raw) or path.suffix == ".h5"


def test_labels_tell_everything(written: list) -> None:
    for case, _, label in written:
        assert label["kind"] == case.kind
        assert label["role"] == "calibration"
        assert [e["name"] for e in label["effects"]] == [f.name for f in case.faults]
        assert label["has_reference"] is True
        assert len(label["conditions"]) == 2
        for effect in label["effects"]:
            assert {"name", "group", "severity", "unit", "level", "resembles", "place"} == set(effect)
