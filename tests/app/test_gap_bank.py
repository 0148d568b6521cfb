"""Bank of the gap diagnosis: what is in it; it is kept whole or not at all; damaged and foreign files do no harm."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.gap import (
    AddedEffect,
    Bank,
    OperatingCondition,
    TriedEffect,
    TwinRun,
    banks_of,
    change_features,
    conditions_of,
    feature_values,
    reduce_recording,
    rounded,
    try_effects,
)
from gearsig.prepared import PreparedRecording
from gearsig.recording import Channel, Recording
from gearsig.rig import GearPair, Rig, Shaft, TachometerChannel
from sims.registry import gap_simulator

FS, DURATION_S, TEETH = 4096.0, 2.0, (20, 31)
POINT = OperatingCondition(1800.0, 40.0)
RIG = Rig("r", (Shaft("a"), Shaft("b")), (GearPair("p", "a", "b", *TEETH),))
STRONG, WEAK, IMPOSSIBLE = AddedEffect("louder", 2.0), AddedEffect("louder", 1.1), AddedEffect("louder", 1000.0)


@dataclass(frozen=True)
class Sines:
    """A twin made of mesh harmonics; "louder" multiplies them, a thousand times is too much."""

    key: str = "sines 1"
    broken: bool = False

    def run(
        self,
        point: OperatingCondition,
        added: Sequence[AddedEffect] = (),
        *,
        seed: int,
        duration_s: float,
        sampling_rate_hz: float,
        noise: int = 0,
    ) -> Recording:
        """Return mesh harmonics with a tachometer."""
        if self.broken or IMPOSSIBLE in added:
            raise RefusalError("it cannot be")
        rng = np.random.default_rng([seed, noise])
        turned = np.arange(round(duration_s * sampling_rate_hz)) / sampling_rate_hz * point.speed_rpm / 60.0
        gain = np.prod([a.severity for a in added if a.name == "louder"])
        mesh = sum(np.cos(2 * np.pi * k * TEETH[0] * turned + seed) / k for k in (1, 2))
        samples = np.vstack([gain * mesh + 0.01 * rng.standard_normal(len(turned)), (turned % 1.0 < 0.2) * 5.0])
        channels = (Channel("v", "acceleration", "m/s^2"), Channel("t", "tachometer", "V"))
        return Recording(samples, sampling_rate_hz, channels, speed=TachometerChannel("t", 1, shaft="a"), rig=RIG)

    def candidates(self, effect: str) -> Sequence[AddedEffect]:
        """Two strengths, and one that cannot be simulated; "louder 2" has the strong one only."""
        return {"louder": (WEAK, STRONG, IMPOSSIBLE), "louder 2": (STRONG,)}[effect]

    def preset_toml(self, point: OperatingCondition, added: Sequence[AddedEffect], notes: Sequence[str]) -> str:
        """No use here."""
        raise NotImplementedError


def bank(
    folder: Path | None = None,
    twin: Sines | None = None,
    duration_s: float = DURATION_S,
    **changed: object,
) -> Bank:
    settings: Mapping[str, object] = {"folder": folder, "processes": 1, **changed}
    run = TwinRun(twin or Sines(), POINT, duration_s, FS)
    return banks_of([run], {"louder": run.twin.candidates("louder")}, **settings)[0]["louder"]  # type: ignore[arg-type]


def same(one: Bank, other: Bank) -> bool:
    arrays = ("healthy", "changes")
    texts = ("feature_names", "change_names", "added")
    return all(np.array_equal(getattr(one, a), getattr(other, a)) for a in arrays) and all(
        getattr(one, t) == getattr(other, t) for t in texts
    )


def test_changes_are_those_of_the_features_against_the_healthy_run() -> None:
    found = bank()
    assert found.added == (WEAK, STRONG)
    assert found.changes.shape == (2, len(found.change_names))
    assert found.change_names[: len(found.feature_names)] == found.feature_names

    def gathered(*added: AddedEffect):  # type: ignore[no-untyped-def]  # of the features' room
        run = Sines().run(rounded(POINT), added, seed=0, duration_s=DURATION_S, sampling_rate_hz=FS)
        return reduce_recording(run, RIG)

    np.testing.assert_array_equal(found.healthy, feature_values(gathered())[1])
    np.testing.assert_array_equal(found.changes[1], change_features(gathered(STRONG), gathered()).values)


def test_what_cannot_be_simulated_is_left_out() -> None:
    assert IMPOSSIBLE not in bank().added
    with pytest.raises(RefusalError, match="healthy machine cannot be simulated: it cannot be"):
        bank(twin=Sines(broken=True))


def test_stronger_candidates_change_more() -> None:
    found = bank()
    weak, strong = np.sqrt(np.mean(found.changes[:, : len(found.feature_names)] ** 2, axis=1))
    assert strong > 3.0 * weak > 0.0


def test_it_is_kept_and_found_again(tmp_path: Path) -> None:
    first = bank(tmp_path)
    assert [p.suffix for p in tmp_path.iterdir()] == [".npz"]
    assert same(bank(tmp_path, on_progress=_never), first)


def _never(done: int, n: int) -> None:
    raise AssertionError(f"{done} of {n} runs were made again")


def test_fresh_simulates_again_and_keeps_that(tmp_path: Path) -> None:
    first = bank(tmp_path)
    (kept,) = tmp_path.iterdir()
    kept.write_bytes(b"an earlier one")
    done: list[int] = []
    assert same(bank(tmp_path, fresh=True, on_progress=lambda n, _: done.append(n)), first)
    assert done
    assert same(bank(tmp_path, on_progress=_never), first)


@pytest.mark.parametrize("changed", [{"duration_s": 2.5}, {"twin": Sines("sines 2")}])
def test_other_settings_have_another_bank(tmp_path: Path, changed: dict[str, object]) -> None:
    bank(tmp_path)
    bank(tmp_path, **changed)  # type: ignore[arg-type]  # one of them is the twin
    assert len(list(tmp_path.iterdir())) == 2


def test_points_that_hardly_differ_share_a_bank() -> None:
    assert (
        rounded(OperatingCondition(1486.3, 40.02))
        == OperatingCondition(1490.0, 40.0)
        == rounded(OperatingCondition(1491.9, 39.98))
    )


@pytest.mark.parametrize("damage", ["cut", "text", "empty", "foreign key", "pickle"])
def test_a_damaged_or_foreign_file_is_made_again(tmp_path: Path, damage: str) -> None:
    first = bank(tmp_path)
    (path,) = tmp_path.iterdir()
    whole = path.read_bytes()
    with np.load(path) as data:
        arrays = dict(data)
    if damage == "cut":
        path.write_bytes(whole[: len(whole) // 2])
    elif damage == "text":
        path.write_text("not a bank", encoding="utf-8")
    elif damage == "empty":
        path.write_bytes(b"")
    elif damage == "foreign key":
        np.savez(path, **{**arrays, "about": np.array(str(arrays["about"]).replace("sines 1", "sines 9"))})
    else:
        np.savez(path, **{**arrays, "healthy": np.array([{}], dtype=object)})
    made = []
    assert same(bank(tmp_path, on_progress=lambda done, _n: made.append(done)), first)
    assert made
    assert same(bank(tmp_path, on_progress=_never), first)


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_a_stop_ends_it_and_leaves_nothing(tmp_path: Path, processes: int) -> None:
    def stop(done: int, n: int) -> None:
        raise InterruptedError(f"after {done} of {n}")

    with pytest.raises(InterruptedError, match="after 1 of 4"):
        bank(tmp_path, processes=processes, on_progress=stop)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_processes_give_the_same_bank() -> None:
    assert same(bank(processes=2), bank(processes=1))


def test_each_effect_at_each_point_has_a_file_and_what_is_there_is_not_made_again(tmp_path: Path) -> None:
    runs = [TwinRun(Sines(), OperatingCondition(speed, 40.0), DURATION_S, FS) for speed in (1800.0, 1500.0)]
    banks_of(runs[:1], {"louder": Sines().candidates("louder")}, folder=tmp_path, processes=1)
    made = []
    candidates = {name: Sines().candidates(name) for name in ("louder", "louder 2")}
    both = banks_of(runs, candidates, folder=tmp_path, processes=1, on_progress=lambda *n: made.append(n))
    assert len(list(tmp_path.iterdir())) == 4
    assert len(made) == 2 + 1 + 4  # the healthy machine at both points; one candidate at the first, four at the other
    assert [set(at) for at in both] == [{"louder", "louder 2"}] * 2
    np.testing.assert_array_equal(both[1]["louder"].changes[1], both[1]["louder 2"].changes[0])


def test_a_folder_that_cannot_be_made_is_named_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="--cache"):
        bank(tmp_path / "file" / "folder", on_progress=_never)


def tried(effect: str, twin: Sines) -> dict[str, TriedEffect]:
    today, healthy = (
        PreparedRecording(
            Sines().run(POINT, added, seed=5, duration_s=4.0, sampling_rate_hz=FS, noise=noise).with_name(name)
        )
        for added, noise, name in (((STRONG,), 1, "today"), ((), 2, "healthy"))
    )
    conditions, _ = conditions_of([today], [healthy], twin)
    known = replace(gap_simulator("cracked").gap_effects()["unbalance"], name=effect)
    return try_effects([known], twin, conditions, None, lambda _what, _done: None)


def test_effects_that_the_rig_has_no_place_for_are_no_reason_to_refuse() -> None:
    class OnlyImpossible(Sines):
        point = POINT

        def candidates(self, effect: str) -> Sequence[AddedEffect]:
            return (IMPOSSIBLE,) if effect == "louder" else ()

    assert tried("bearing", OnlyImpossible()) == {}
    with pytest.raises(RefusalError, match="none of louder can be simulated"):
        tried("louder", OnlyImpossible())


def test_a_trial_differs_from_the_healthy_run_by_its_effect_only() -> None:
    """Another start or noise would be taken for what the effect changes."""
    runs: list[tuple[tuple[AddedEffect, ...], int, int, float]] = []

    class Noted(Sines):  # local: it cannot be sent to another process
        point = POINT

        def run(self, point: OperatingCondition, added: Sequence[AddedEffect] = (), **how: Any) -> Recording:
            runs.append((tuple(added), how["seed"], how.get("noise", 0), how["duration_s"]))
            return super().run(point, added, **how)

    assert "louder" in tried("louder", Noted())
    with_effect = [run for run in runs if run[0]]
    assert [added for added, *_ in with_effect] == [(WEAK,), (STRONG,), (IMPOSSIBLE,)]
    compared_with = [run[1:] for run in runs if not run[0] and run[2] == 0]
    assert all(run[1:] in compared_with for run in with_effect)
