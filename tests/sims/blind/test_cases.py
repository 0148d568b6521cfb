"""Cases: drawn with roles apart, reproducible; on disk, whole and silent about what is wrong."""

import json
import re
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import Recording, read_recording
from gearsig.rig import read_rig
from sims.blind import (
    CATALOGUE,
    MECHANICAL,
    MODULES_MM,
    OUTSIDE_CATALOGUE,
    ROLES,
    BlindCase,
    draw_case,
    labels,
    record_case,
    teeth_of,
    write_visible,
)
from tests.sims.blind.order_domain import distance_db

NAMES = {
    "root_crack", "tooth_spall", "chipped_tooth", "tooth_wear", "pitch_error", "surface_roughness", "sliding_friction",
    "eccentricity", "unbalance", "misalignment", "torque_ripple", "speed_fluctuation", "backlash",
    "bearing_outer_race", "bearing_inner_race", "bearing_clearance", "transfer_path", "mains_hum", "clipping",
}  # fmt: skip


def draw(seed: int, role: str = "development", **wishes: object) -> BlindCase:
    return draw_case(np.random.default_rng(seed), role, **wishes)


def short(case: BlindCase) -> BlindCase:
    """The same case with recordings of one second."""

    def cut(conditions: tuple) -> tuple:
        return tuple(replace(c, duration_s=1.0) for c in conditions)

    return replace(case, conditions=cut(case.conditions), references=cut(case.references))


def test_the_catalogue_is_whole() -> None:
    assert set(CATALOGUE) == NAMES
    assert len(MECHANICAL) == 16
    assert not set(OUTSIDE_CATALOGUE) & NAMES
    alike = [c.resembles for c in OUTSIDE_CATALOGUE.values() if c.resembles]
    assert set(alike) <= NAMES
    assert 2 * len(alike) >= len(OUTSIDE_CATALOGUE)


def test_roles_share_no_gear() -> None:
    teeth = [set(teeth_of(role)) for role in ROLES]
    modules = [set(MODULES_MM[role]) for role in ROLES]
    for sets in (teeth, modules):
        assert not (sets[0] & sets[1] | sets[0] & sets[2] | sets[1] & sets[2])
    assert set.union(*teeth) == set(range(17, 71))
    for role in ROLES:
        for seed in range(30):
            pair = draw(seed, role).rig.pair
            assert {pair.z1, pair.z2} <= set(teeth_of(role))
            assert pair.module_mm in MODULES_MM[role]


def test_cases_cover_what_is_asked() -> None:
    cases = [draw(seed) for seed in range(400)]
    kinds = [c.kind for c in cases]
    for kind, share in (("none", 0.2), ("single", 0.5), ("unknown", 0.2), ("pair", 0.1)):
        assert kinds.count(kind) / len(kinds) == pytest.approx(share, abs=0.08)
    assert {f.name for c in cases for f in c.faults} == NAMES | set(OUTSIDE_CATALOGUE)
    for case in cases:
        assert len(case.faults) == {"none": 0, "single": 1, "unknown": 1, "pair": 2}[case.kind]
        assert len(case.references) in (0, len(case.conditions))
        for c in case.conditions:
            assert 590 < c.true_rpm < 3050
            assert 4 <= c.duration_s <= 8
            assert 0.7 < c.true_nm / c.stated_nm < 1.3
            assert c.true_rpm / 60 * case.rig.pair.z1 < 0.16 * case.rig.sampling_rate_hz
    unknown = [OUTSIDE_CATALOGUE[f.name].resembles != "" for c in cases if c.kind == "unknown" for f in c.faults]
    assert np.mean(unknown) == pytest.approx(0.5, abs=0.15)
    for case in (c for c in cases if c.kind == "pair"):
        assert len({CATALOGUE[f.name].group for f in case.faults}) == 2


def test_rig_and_conditions_do_not_know_the_fault() -> None:
    for seed in range(5):
        plain = draw(seed, kind="none", n_conditions=2, with_reference=True)
        for name in (NAMES | set(OUTSIDE_CATALOGUE)) - {"backlash"}:
            other = draw(seed, effect=name, n_conditions=2, with_reference=True)
            assert other.conditions == plain.conditions
            assert other.references == plain.references
            assert other.rig.description(1000, 10) == plain.rig.description(1000, 10)
            assert other.rig.parts == plain.rig.parts
            assert other.rig.chains == plain.rig.chains


def test_backlash_runs_light_first() -> None:
    for seed in range(10):
        case = draw(seed, effect="backlash", n_conditions=2)
        assert case.conditions[0].stated_nm < 0.02 * case.rig.rated_nm
        assert case.conditions[1].stated_nm > 0.1 * case.rig.rated_nm


def test_severity_rises_with_level() -> None:
    for name in NAMES | set(OUTSIDE_CATALOGUE):
        low, mid, high = (draw(1, effect=name, level=x).faults[0].severity for x in (0.0, 0.5, 1.0))
        assert 0 < low < mid < high
        assert mid == pytest.approx(np.sqrt(low * high))


@pytest.mark.slow
def test_two_runs_are_the_same_and_two_draws_are_not() -> None:
    case = short(draw(7, effect="bearing_outer_race", level=0.7, n_conditions=1, with_reference=True))
    first, second = record_case(case), record_case(case)
    for name in ("conditions", "references", "twins"):
        np.testing.assert_array_equal(getattr(first, name)[0].samples, getattr(second, name)[0].samples)
    other = record_case(short(draw(8, kind="none", n_conditions=1)))
    assert other.conditions[0].samples[0, :100].tolist() != first.conditions[0].samples[0, :100].tolist()


def test_a_twin_differs_by_the_fault_alone() -> None:
    """Without the fault's force the recording is its twin's, sample by sample, noise included."""
    case = short(draw(3, effect="mains_hum", level=0.5, n_conditions=1, with_reference=False))
    silent = replace(case, faults=(replace(case.faults[0], severity=0.0),))
    made = record_case(silent)
    np.testing.assert_array_equal(made.conditions[0].samples, made.twins[0].samples)
    none = record_case(replace(case, faults=(), kind="none"))
    np.testing.assert_array_equal(none.conditions[0].samples, made.twins[0].samples)
    assert none.twins == none.conditions


def test_a_reference_is_the_same_rig_on_another_day() -> None:
    case = draw(4, kind="none", n_conditions=1, with_reference=True)
    now, then = case.conditions[0], case.references[0]
    assert (now.stated_rpm, now.stated_nm) == (then.stated_rpm, then.stated_nm)
    assert now.seed != then.seed
    assert then.true_rpm == pytest.approx(now.true_rpm, rel=0.02)
    assert then.true_nm == pytest.approx(now.true_nm, rel=0.15)


@pytest.mark.parametrize(
    ("wishes", "match"),
    [
        ({"effect": "root_crak"}, "did you mean root_crack"),
        ({"kind": "double"}, "kind"),
        ({"kind": "none", "effect": "unbalance"}, "kind 'none'"),
        ({"kind": "single", "effect": "belt_line"}, "kind 'single'"),
        ({"effect": "unbalance", "level": 1.5}, "level"),
        ({"n_conditions": 3}, "n_conditions"),
        ({"role": "training"}, "role"),
    ],
)
def test_bad_wishes_are_refused(wishes: dict, match: str) -> None:
    with pytest.raises(InputError, match=match):
        draw_case(np.random.default_rng(0), **wishes)


# From weak to strong: the distance of each recording from its twin grows with the level.

SEED = {"backlash": 6}
"""Backlash shows where the brake's pull turns the torque round: not on every rig."""
MIN_DB = {"unbalance": 0.5, "mains_hum": 0.5, "clipping": 0.5, "speed_fluctuation": 0.5, "eccentricity": 0.5}
"""Some touch only a few lines of the whole spectrum."""


def twins(name: str, level: float) -> tuple[Recording, Recording]:
    rng = np.random.default_rng(SEED.get(name, 12))
    case = draw_case(rng, "development", effect=name, level=level, n_conditions=1, with_reference=False)
    case = replace(case, conditions=(replace(case.conditions[0], duration_s=1.2),))
    made = record_case(case)
    return made.conditions[0], made.twins[0]


@pytest.mark.study
@pytest.mark.parametrize("name", [*CATALOGUE, *OUTSIDE_CATALOGUE])
def test_the_change_grows_with_the_level(name: str) -> None:
    weak, strong = (distance_db(*twins(name, level)) for level in (0.15, 1.0))
    assert strong > weak
    assert strong > MIN_DB.get(name, 1.0)


# Cases on disk: whole, readable, and silent about what is wrong.

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
