"""The gap diagnosis end to end, on recordings of the twin itself: a small check of the machinery, not of its worth."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.gap import (
    AddedEffect,
    GapOutcome,
    GapReport,
    HealthyReference,
    Interval,
    OperatingCondition,
    SpeedFigures,
    TriedEffect,
    check_steady,
    conditions_of,
    diagnose_gap,
    effects_without_setting,
    feature_values,
    reduce_recording,
    with_channels_of,
    with_common_channels,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Recording
from gearsig.rig import Rig
from sims import simulate
from sims.presets import preset
from sims.registry import gap_simulator

POINT = OperatingCondition(1500.0, 60.0)
SEVERITY_UM = 90.0


@cache
def rig() -> Rig:
    recording = simulate("cracked", preset="workshop_29_47", duration_s=0.2)
    assert recording.rig is not None
    return recording.rig


@cache
def run(*added: AddedEffect, noise: int) -> Recording:
    twin = gap_simulator("cracked").twin_of(rig())
    return twin.run(POINT, added, seed=5, duration_s=4.0, sampling_rate_hz=20480.0, noise=noise)


class Eccentric(AddedEffect):
    """An effect that can be a key."""

    def __hash__(self) -> int:
        return hash((self.name, self.severity))


@cache
def run_up() -> Recording:
    twin = gap_simulator("cracked").twin_of(rig())
    rising = twin.run_up(900.0, 1600.0, POINT.torque_nm, seed=5, duration_s=4.0, sampling_rate_hz=20480.0)
    return rising.with_name("run-up")


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> GapReport:
    return diagnose_gap(
        [run(Eccentric("eccentricity", SEVERITY_UM, {"gear": "driven"}), noise=2).with_name("now")],
        gap_simulator("cracked"),
        references=[run(noise=1)],
        run_up=run_up(),
        effects=["eccentricity"],
        cache=tmp_path_factory.mktemp("cache"),
    )


def test_the_effect_is_named_placed_and_sized(report: GapReport) -> None:
    cause = report.causes[0]
    assert (report.outcome, cause.name) == (GapOutcome.EFFECT, "eccentricity")
    assert cause.place == "the gear on the output shaft"
    assert cause.severity is not None
    assert cause.severity.value == pytest.approx(SEVERITY_UM, rel=0.4)
    assert sum(c.probability for c in report.causes) == pytest.approx(1.0)
    assert sum(report.groups.values()) == pytest.approx(1.0)


def test_the_gap_shrinks_on_held_out_revolutions(report: GapReport) -> None:
    shrinkage = report.causes[0].shrinkage
    assert shrinkage is not None
    assert shrinkage.shrink.value > 0.6
    assert shrinkage.placebo < 0.3
    before, after = (step.remaining.value for step in report.steps[:2])
    assert after < before


def test_it_keeps_the_twin(report: GapReport, tmp_path: Path) -> None:
    file = tmp_path / "twin.toml"
    file.write_text(report.twin_toml, encoding="utf-8")
    assert [s.name for s in preset("cracked", str(file)).effects] == ["eccentricity"]


def test_a_healthy_run_up_measures_the_path_and_that_is_said(report: GapReport) -> None:
    assert report.path is not None
    assert min(report.path.credibility.values()) > 0.5
    assert report.path.low_hz < 900.0 / 60.0 * 29.0 * 1.1 < 1600.0 / 60.0 * 29.0 < report.path.high_hz
    assert report.path.text in report.notes
    with pytest.raises(InputError, match="a run-up is given, but no healthy reference"):
        diagnose_gap([run(noise=1)], gap_simulator("cracked"), run_up=run_up())


def test_lists_that_do_not_fit_are_errors() -> None:
    simulator, recording = gap_simulator("cracked"), run(noise=1)
    with pytest.raises(InputError, match="no recording"):
        diagnose_gap([], simulator)
    with pytest.raises(InputError, match=r"no effect 'backlsh'.*did you mean backlash"):
        diagnose_gap([recording], simulator, effects=["backlsh"])
    with pytest.raises(InputError, match="carries no rig"):
        diagnose_gap([replace(recording, rig=None)], simulator)
    with pytest.raises(InputError, match=r"old\.h5: holds the same samples as new\.h5"):
        diagnose_gap([recording.with_name("new.h5")], simulator, references=[recording.with_name("old.h5")])


def test_a_run_up_is_refused_but_beside_the_same_one() -> None:
    steady, rising = (
        replace(reduce_recording(run(noise=1), rig()), speed=SpeedFigures(drift, 0.0, 0.0, 0.0))
        for drift in (0.02, 0.9)
    )
    check_steady(steady, None)
    check_steady(rising, rising)
    for reference in (None, steady):
        with pytest.raises(RefusalError, match="the speed goes from about 825 to 2175 rpm"):
            check_steady(rising, reference)


@pytest.mark.slow
def test_accelerations_in_g_are_compared_in_si_units_and_unknown_units_are_told() -> None:
    recording = run(noise=1)
    names = recording.vibration_names()
    scale = np.array([9.80665 if c.name in names else 1.0 for c in recording.channels])
    channels = tuple(replace(c, unit="g") if c.name in names else c for c in recording.channels)
    in_g = replace(recording, samples=recording.samples / scale[:, None], channels=channels)
    expected, seen = (feature_values(reduce_recording(given, rig()))[1] for given in (recording, in_g))
    assert seen == pytest.approx(expected, abs=1e-6)
    bare = replace(recording, channels=tuple(replace(c, unit="") for c in recording.channels))
    _, notes = conditions_of([PreparedRecording(bare)], (), gap_simulator("cracked").twin_of(rig()))
    assert any("is not an acceleration in a known unit" in notice for notice in notes)


def test_a_channel_that_the_reference_lacks_is_left_out_and_told() -> None:
    now, notes = reduce_recording(run(noise=1), rig()), list[str]()
    first, *others = now.channels
    reference = now.with_channels({first: now.channels[first]})
    healthy = [HealthyReference(reference, PreparedRecording(run(noise=1)))]
    assert list(with_common_channels(now, reference, healthy, "now", notes).channels) == [first]
    assert notes == [f"now: {', '.join(others)} is left out, because the reference has no such channel."]


def test_what_does_not_bring_the_twin_nearer_says_neither_place_nor_severity(report: GapReport) -> None:
    told = report.causes[0].shrinkage
    assert told is not None
    tried = TriedEffect("eccentricity", (), None, told)  # type: ignore[arg-type]  # its fit is not asked for
    assert tried.explains
    assert not replace(tried, shrinkage=replace(told, shrink=Interval(-0.1, -0.3, 0.1))).explains
    assert not replace(tried, shrinkage=replace(told, predicted=0.1)).explains


def test_a_recording_whose_channels_have_other_names_can_be_simulated() -> None:
    recording = run(noise=1)
    gathered = reduce_recording(recording, rig())
    first, *_ = gathered.channels.values()
    renamed = replace(gathered, channels={"Data1": first, "Data2": first, "Data3": first})
    assert list(with_channels_of(gathered, renamed).channels) == ["Data1", "Data2", "Data3"]
    assert list(with_channels_of(gathered, gathered).channels) == list(gathered.channels)


def test_an_effect_that_the_rig_has_no_place_for_is_told() -> None:
    simulator, bare = gap_simulator("cracked"), replace(rig(), bearings=())
    known = {name: simulator.gap_effects()[name] for name in ("bearing_outer_race", "backlash")}
    (text,) = effects_without_setting(simulator.twin_of(bare), known)
    assert text.startswith("The rig file names nothing that spall on an outer race could be in")
    assert effects_without_setting(simulator.twin_of(rig()), known) == []
