"""Drawing: roles apart, reproducible, the rig not knowing its fault; twins."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.errors import InputError
from sims.blind import (
    CATALOGUE,
    MECHANICAL,
    MODULES_MM,
    OUTSIDE_CATALOGUE,
    ROLES,
    BlindCase,
    draw_case,
    record_case,
    teeth_of,
)

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
