"""Sweeps: the grid and its seeds, resuming, failures, processes."""

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.errors import InputError
from gearsig.recording import Channel, Recording, read_recording
from gearsig.rig import Rig, read_rig
from sims.effects import EffectSetting
from sims.machine import Profile
from sims.sweep import Axis, Sweep, SweepOutcome, SweepPoint, n_complete, run_sweep

SPEEDS, DEPTHS = (300.0, 600.0, 900.0), (0.0, 1.0)


def small(**changes: object) -> Sweep:
    given: dict[str, object] = {"preset": "workshop_29_47", "duration_s": 0.02, "extension": ".h5", **changes}
    return Sweep("cracked", (Axis("speed_rpm", SPEEDS), Axis("root_crack", DEPTHS)), **given)  # type: ignore[arg-type]  # a test's shorthand


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> list[SweepPoint]:
    """Replace the simulation by noise of the point's seed; points that are asked for are collected."""
    asked: list[SweepPoint] = []

    class Noise:
        def __init__(self, point: SweepPoint) -> None:
            self.point = point

        def run(self) -> Recording:
            asked.append(self.point)
            if self.point.values[0] == 666.0:
                raise InputError("the crack goes past the tooth")
            samples = np.random.default_rng(self.point.seed).normal(size=(1, 16))
            truth = {"seed": self.point.seed, "values": np.array(self.point.values)}
            return Recording(samples, 1000.0, (Channel("a1", "acceleration", "m/s^2"),), rig=Rig(name="x"), truth=truth)

    monkeypatch.setattr(Sweep, "at", lambda _sweep, point: Noise(point))
    return asked


def table(folder: Path) -> list[dict[str, str]]:
    with (folder / "index.csv").open(newline="") as file:
        return list(csv.DictReader(file))


@given(st.lists(st.integers(1, 4), min_size=1, max_size=3), st.integers(0, 10**6))
@settings(deadline=None)
def test_the_grid_holds_every_combination_once(sizes: list[int], seed: int) -> None:
    names = ("speed_rpm", "torque_nm", "crack_depth_mm")
    axes = tuple(Axis(names[i], tuple(float(v) for v in range(1, n + 1))) for i, n in enumerate(sizes))
    sweep = Sweep("cracked", axes, seed=seed)
    points = sweep.points()
    assert len(points) == sweep.n_points == np.prod(sizes) == len({p.values for p in points})
    assert [p.index for p in points] == list(range(len(points)))
    assert points[-1].values == tuple(float(n) for n in sizes)
    assert len({p.seed for p in points}) == len(points)
    assert {p.seed for p in Sweep("cracked", axes, seed=seed, common_seed=True).points()} == {seed}


def test_a_point_puts_its_values_in_place() -> None:
    axes = (
        Axis("torque_nm", (20.0,)),
        Axis("root_crack", (1.0,), {"gear": "driven"}),
        Axis("half_backlash_um", (60.0,)),
    )
    ramp = Profile.of([0, 1], [300, 900])
    sweep = Sweep(
        "cracked", axes, parameters={"friction": "off"}, effects=(EffectSetting("mains_hum", 1.0),), speed_rpm=ramp
    )
    point = sweep.points()[0]
    simulation = sweep.at(point)
    assert simulation.seed == point.seed
    assert simulation.parameters == {"friction": "off", "half_backlash_um": 60.0}
    assert [(s.name, s.severity, dict(s.options)) for s in simulation.effects] == [
        ("mains_hum", 1.0, {}),
        ("root_crack", 1.0, {"gear": "driven"}),
    ]
    assert simulation.speed_rpm is ramp
    assert simulation.torque_nm is not None
    assert simulation.torque_nm.values.tolist() == [20.0]


def test_every_point_stands_in_the_folder_with_rig_and_truth(quick: list[SweepPoint], tmp_path: Path) -> None:
    sweep, folder = small(), tmp_path / "grid"
    counts = []
    result = run_sweep(sweep, folder, n_processes=1, on_progress=lambda n, total, _: counts.append((n, total)))
    assert counts == [(i, 6) for i in range(1, 7)]
    assert (result.n_points, result.n_found, len(result.outcomes), result.failures) == (6, 0, 6, ())
    rows = table(folder)
    assert [(float(r["speed_rpm"]), float(r["root_crack"])) for r in rows] == [(s, d) for s in SPEEDS for d in DEPTHS]
    for row, point in zip(rows, quick, strict=True):
        recording = read_recording(folder / row["file"])
        assert recording.truth is not None
        assert recording.truth["seed"] == int(row["seed"]) == point.seed
        stem = row["file"].removesuffix(".h5")
        assert json.loads((folder / f"{stem}.truth.json").read_text())["values"] == list(point.values)
        assert read_rig(folder / f"{stem}.toml") == Rig(name="x")
    expected = 3 * 6 + len(["index.csv", "sweep.json"])
    assert len(list(folder.iterdir())) == expected


def test_a_stopped_sweep_goes_on_and_ends_with_the_same_files(quick: list[SweepPoint], tmp_path: Path) -> None:
    sweep, folder, straight = small(extension=".csv"), tmp_path / "grid", tmp_path / "straight"

    def stop(n_done: int, _total: int, _outcome: SweepOutcome) -> None:
        if n_done == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_sweep(sweep, folder, n_processes=1, on_progress=stop)
    assert n_complete(sweep, folder) == 4
    assert [r["reason"] for r in table(folder)] == [""] * 4 + ["not yet simulated"] * 2
    result = run_sweep(sweep, folder, n_processes=1)
    assert (result.n_found, [o.point.index for o in result.outcomes]) == (4, [4, 5])
    assert [p.index for p in quick] == [0, 1, 2, 3, 4, 5]
    run_sweep(sweep, straight, n_processes=1)
    names = sorted(p.name for p in straight.iterdir())
    assert names == sorted(p.name for p in folder.iterdir())
    assert all((straight / n).read_bytes() == (folder / n).read_bytes() for n in names)
    assert run_sweep(sweep, folder, n_processes=1).outcomes == ()


@pytest.mark.parametrize(
    ("ending", "damage"),
    [
        (".h5", None),
        (".h5", lambda content: content[: len(content) // 2]),
        (".toml", lambda content: content + b"["),
        (".truth.json", lambda content: content.replace(b'"seed"', b'"sead"')),
        (".truth.json", lambda content: b"\xff" + content),
    ],
)
def test_a_point_that_is_lost_or_damaged_is_made_again(
    quick: list[SweepPoint], tmp_path: Path, ending: str, damage: Callable[[bytes], bytes] | None
) -> None:
    sweep = small()
    run_sweep(sweep, tmp_path / "grid", n_processes=1)
    file = tmp_path / "grid" / f"point_3{ending}"
    whole = file.read_bytes()
    file.unlink()
    if damage is not None:
        file.write_bytes(damage(whole))
    assert [o.point.index for o in run_sweep(sweep, tmp_path / "grid", n_processes=1).outcomes] == [3]
    assert file.read_bytes() == whole
    assert len(quick) == 7


def test_a_point_that_fails_does_not_stop_the_others(quick: list[SweepPoint], tmp_path: Path) -> None:
    sweep = Sweep("cracked", (Axis("speed_rpm", (300.0, 666.0, 900.0)),))
    result = run_sweep(sweep, tmp_path / "grid", n_processes=1)
    assert [o.recording is None for o in result.outcomes] == [False, True, False]
    assert "past the tooth" in result.failures[0].reason
    assert [bool(r["file"]) for r in table(tmp_path / "grid")] == [True, False, True]
    assert "past the tooth" in table(tmp_path / "grid")[1]["reason"]
    assert len(quick) == 3


def test_a_folder_of_another_sweep_is_refused(quick: list[SweepPoint], tmp_path: Path) -> None:
    run_sweep(small(), tmp_path / "grid", n_processes=1)
    with pytest.raises(InputError, match="seed differs"):
        run_sweep(small(seed=1), tmp_path / "grid", n_processes=1)
    assert len(quick) == 6


@pytest.mark.parametrize("occupant", ["notes.txt", "sweep.json"])
def test_a_folder_with_other_things_is_refused_and_left_alone(tmp_path: Path, occupant: str) -> None:
    (tmp_path / occupant).write_text("mine")
    with pytest.raises(InputError):
        run_sweep(small(), tmp_path)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [(occupant, "mine")]


@pytest.mark.parametrize(
    ("axes", "named"),
    [
        ((), "at least one"),
        ((Axis("speed_rpm", (1.0,)), Axis("speed_rpm", (2.0,))), "none twice"),
        ((Axis("root_crak", (1.0,)),), "root_crak"),
        ((Axis("root_crack", (1.0, 99.0)),), "0 to 10 mm"),
        ((Axis("root_crack", (1.0,), {"side": "left"}),), "no option 'side'"),
        ((Axis("speed_rpm", (-300.0,)),), "at least 0 rpm"),
        ((Axis("module_mm", (2.0, 0.01)),), "0.3 to 30 mm"),
        ((Axis("speed_rpm", tuple(range(2000))), Axis("torque_nm", tuple(range(2000)))), "up to 100000"),
    ],
)
def test_nonsense_is_refused_before_anything_runs(axes: tuple[Axis, ...], named: str) -> None:
    with pytest.raises(InputError) as caught:
        Sweep("cracked", axes)
    assert named in str(caught.value)


@pytest.mark.parametrize("values", [(), (1.0, 1.0), (float("nan"),)])
def test_an_axis_needs_different_finite_values(values: tuple[float, ...]) -> None:
    with pytest.raises(InputError, match="axis speed_rpm"):
        Axis("speed_rpm", values)


@pytest.mark.slow
def test_processes_give_what_one_process_gives(tmp_path: Path) -> None:
    """The whole way with the model itself: spawned processes, and the seeds of the grid."""
    sweep = Sweep(
        "cracked",
        (Axis("root_crack", (0.0, 1.0)),),
        preset="workshop_29_47",
        duration_s=0.02,
        common_seed=True,
    )
    run_sweep(sweep, tmp_path / "two", n_processes=2)
    healthy, cracked = (read_recording(tmp_path / "two" / f"point_{i}.h5") for i in (0, 1))
    alone = sweep.at(sweep.points()[1]).run()
    assert np.array_equal(alone.samples, cracked.samples)
    assert not np.array_equal(healthy.samples, cracked.samples)
    assert cracked.truth is not None
    assert cracked.truth["effects"][0]["severity"] == 1.0
