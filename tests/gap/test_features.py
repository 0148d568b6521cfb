"""Features against signals of which they are known, and the averages and speeds that they are made of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.gap import (
    Features,
    ReducedRecording,
    change_features,
    features_of,
    gear_frame,
    mains_lines,
    reduce_recording,
    speed_figures,
)
from gearsig.orders import average_lines, separate_shafts
from gearsig.recording import Channel, Recording
from tests.gap.synthetic import MESH_AMPLITUDES, RATE_HZ, RIG, SPEED_HZ, TEETH, record, ringing

AddedEffect = Callable[[FloatArray, FloatArray], FloatArray]


def reduced(added: AddedEffect | None = None, **settings: float) -> ReducedRecording:
    return reduce_recording(record(added, **settings), RIG)  # type: ignore[arg-type]  # seed is whole


def as_dict(features: Features) -> dict[str, float]:
    return dict(zip(features.names, features.values.tolist(), strict=True))


@pytest.fixture(scope="module")
def healthy() -> ReducedRecording:
    return reduced()


def test_mesh_harmonics_and_sidebands_have_their_levels(healthy: ReducedRecording) -> None:
    found = as_dict(features_of(healthy))
    powers = np.square(MESH_AMPLITUDES)
    for k, power in enumerate(powers, 1):
        assert found[f"mesh.share.{k}"] == pytest.approx(10 * np.log10(power / powers.sum()), abs=0.05)
    # Two first sidebands of a hundredth of its amplitude at each of three harmonics; five are looked at.
    expected = 10 * np.log10(1e-4 / 5)
    assert found["sideband.driver.1"] == pytest.approx(expected, abs=0.5)
    assert found["sideband.driven.1"] == pytest.approx(expected, abs=0.5)
    assert found["sideband.driver.3to5"] < expected - 10.0


@pytest.mark.slow
def test_scatter_is_that_of_repeated_records() -> None:
    """The jackknife's standard errors agree with the scatter over recordings, in the median over the features."""
    runs = [features_of(reduced(seed=seed)) for seed in range(1, 9)]
    spread = np.std([run.values for run in runs], axis=0, ddof=1)
    stated = np.mean([run.scatter for run in runs], axis=0)
    alive = spread > 1e-3
    assert 0.6 < np.median(stated[alive] / spread[alive]) < 1.7


@pytest.mark.parametrize(
    ("family", "order"),
    [("outer", 9 / 2 * (1 - 7.94 / 39.04)), ("inner", 9 / 2 * (1 + 7.94 / 39.04))],
)
def test_a_bearings_train_raises_its_own_family(healthy: ReducedRecording, family: str, order: float) -> None:
    changes = as_dict(change_features(reduced(lambda _, r: 0.6 * ringing(0.99 * order * r), seed=1), healthy))
    families = {name: changes[f"envelope.{name}"] for name in ("outer", "inner", "ball", "cage")}
    assert families[family] > 10.0
    assert families[family] > max(v for name, v in families.items() if name != family) + 6.0
    assert abs(changes["mesh.total"]) < 0.1


def test_a_train_of_no_known_order_is_strange(healthy: ReducedRecording) -> None:
    changes = as_dict(change_features(reduced(lambda _, r: 0.6 * ringing(2.37 * r), seed=1), healthy))
    assert changes["envelope.strange"] > 10.0


@pytest.mark.slow
def test_a_knock_at_one_tooth_stands_out_on_its_own_gear(healthy: ReducedRecording) -> None:
    changes = as_dict(change_features(reduced(lambda _, r: 0.5 * ringing(r - 0.4), seed=1), healthy))
    assert changes["change.driver.prominence"] > 15.0
    assert changes["change.driver.prominence"] > changes["change.driven.prominence"] + 10.0
    assert changes["change.driver.width"] == pytest.approx(0.0, abs=2.0)  # about one pitch


@pytest.mark.slow
def test_hum_and_swing_are_told_from_the_gears(healthy: ReducedRecording) -> None:
    hum = as_dict(change_features(reduced(lambda t, _: 0.02 * np.sin(2 * np.pi * 50.0 * t), seed=1), healthy))
    assert hum["hum"] > 6.0
    assert abs(hum["shaft.driver.2"]) < 3.0
    swing = as_dict(change_features(reduced(seed=1, swing=0.01, swing_hz=1.3), healthy))
    assert swing["speed.swing"] > 20.0
    assert abs(swing["mesh.total"]) < 0.1
    assert reduced(seed=1, swing=0.01, swing_hz=1.3).speed[3] == pytest.approx(1.3, abs=0.1)


def test_nothing_changes_but_noise(healthy: ReducedRecording) -> None:
    again = change_features(reduced(seed=5), healthy)
    level = [i for i, name in enumerate(again.names) if name.startswith(("mesh.", "sideband.", "floor.band"))]
    assert np.all(np.abs(again.values[level]) < 4.0 * again.scatter[level] + 0.2)


def test_two_gears_of_equal_teeth_leave_nothing_of_their_own_in_one_average() -> None:
    pair = replace(RIG.pairs[0], driven_teeth=TEETH[0])
    rig = replace(RIG, pairs=(pair,))
    values = as_dict(change_features(*(reduce_recording(record(seed=seed), rig) for seed in (1, 0))))
    assert values["surprise.driven.level"] == pytest.approx(-10.0)
    assert -10.0 < values["surprise.driver.level"] < 3.0


def test_a_longer_record_reads_alike(healthy: ReducedRecording) -> None:
    """What is not there has a floor that does not fall with the number of revolutions."""
    whole = record(seed=2)
    half = reduce_recording(replace(whole, samples=whole.samples[:, : whole.n_samples // 2]), RIG)
    long, short = as_dict(features_of(healthy)), as_dict(features_of(half))
    for name in ("shaft.driver.1", "shaft.driven.2", "tooth.driver.level", "sideband.driver.6to12"):
        assert short[name] == pytest.approx(long[name], abs=4.0)
    assert abs(short["envelope.strange"]) < 15.0


def test_no_cycle_is_read_beyond_its_band(healthy: ReducedRecording) -> None:
    assert as_dict(features_of(healthy))["envelope.strange"] < 15.0


def test_every_feature_has_a_scatter() -> None:
    whole = record(seed=3)
    short = reduce_recording(replace(whole, samples=whole.samples[:, : round(30 * RATE_HZ / SPEED_HZ)]), RIG)
    found = features_of(short)
    still = {n for n, s in zip(found.names, found.scatter, strict=True) if s == 0.0}
    assert still <= {"mesh.share.6", "mesh.half", "tooth.driver.width", "tooth.driven.width"}  # at a limit, or in steps


def test_too_few_revolutions_are_refused() -> None:
    whole = record()
    short = replace(whole, samples=whole.samples[:, : int(RATE_HZ / SPEED_HZ * 12)])
    with pytest.raises(RefusalError, match=r"turns 7\.\d+ times"):
        reduce_recording(short, RIG)


def test_teeth_must_be_known() -> None:
    unknown = replace(RIG, pairs=(replace(RIG.pairs[0], driven_teeth=None),))
    with pytest.raises(RefusalError, match="teeth"):
        reduce_recording(record(), unknown)
    assert (RIG.pairs[0].driver_teeth, RIG.pairs[0].driven_teeth) == TEETH


@pytest.mark.parametrize(("speed_hz", "is_left_out"), [(50.0 / TEETH[0], True), (50.0 / 3, True), (7.3, False)])
def test_a_line_of_the_gears_at_the_supply_s_frequency_is_no_hum(speed_hz: float, *, is_left_out: bool) -> None:
    """The mesh at 50 Hz, a shaft's third, sixth and ninth order, and neither."""
    rng = np.random.default_rng(1)
    time = np.arange(round(RATE_HZ * 6.0)) / RATE_HZ
    lines = sum(np.sin(2 * np.pi * f * time) for f in (50.0, 100.0, 150.0)) + 0.1 * rng.standard_normal(len(time))
    recording = Recording(lines[None], RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),))
    excess = mains_lines(recording, ["a1"], speed_hz, gear_frame(RIG))[0]
    assert (excess == 0.0) is is_left_out
    assert is_left_out or excess > 30.0


@pytest.mark.parametrize(("alone", "is_hum"), [(True, True), (False, False)])
def test_hum_on_a_higher_multiple_stands_out_over_its_neighbours(*, alone: bool, is_hum: bool) -> None:
    """The sixth multiple raised alone is hum; a shaft that raises all of its multiples is none."""
    rng = np.random.default_rng(1)
    speed_hz, time = 50.0 / 6, np.arange(round(RATE_HZ * 6.0)) / RATE_HZ
    weak = 0.01 if alone else 0.7
    lines = sum((1.0 if k == 6 else weak) * np.sin(2 * np.pi * k * speed_hz * time + k) for k in range(1, 21))
    values = lines + 0.01 * rng.standard_normal(len(time))
    recording = Recording(values[None], RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),))
    excess = mains_lines(recording, ["a1"], speed_hz, gear_frame(RIG))[0]
    assert (excess > 5.0) is is_hum
    assert is_hum or excess == 0.0


def test_a_strong_slow_line_makes_no_impulses_in_the_bands(healthy: ReducedRecording) -> None:
    """Hum between the lines of the gears, which ends elsewhere than it began, leaves the bands above it as they are."""
    with_hum = reduced(lambda time, _: 10.0 * np.sin(2 * np.pi * 50.0 * time))
    quiet, found = as_dict(features_of(healthy)), as_dict(features_of(with_hum))
    for name in (f"floor.kurtosis.{i}" for i in range(2, 5)):
        assert found[name] == pytest.approx(quiet[name], abs=1.0)


def test_a_mesh_above_what_is_sampled_is_refused() -> None:
    whole = record()
    slow = replace(whole, samples=whole.samples[:, ::12], sampling_rate_hz=RATE_HZ / 12)
    with pytest.raises(RefusalError, match=r"mesh at 545\.1 Hz, too high for a sampling rate of 1066\.67 Hz"):
        reduce_recording(slow, RIG)
    reduce_recording(replace(whole, samples=whole.samples[:, ::6], sampling_rate_hz=RATE_HZ / 6), RIG)


# --------------------
# What the speed does besides standing still: hunting counts, other shafts' orders seen once a revolution do not.
# --------------------


TURNS_HZ, RATIO = 25.0, 29 / 47


def figures(hunting: float, wheel: float, ratio: float = RATIO) -> dict[str, float]:
    """Of six seconds of an angle that swings by shares of the speed: at 0.7 Hz, and with the wheel's revolutions."""
    time = np.arange(0.0, 6.0, 1e-4)
    swing = hunting / (2 * np.pi * 0.7) * np.sin(2 * np.pi * 0.7 * time)
    swing += wheel / (2 * np.pi * ratio * TURNS_HZ) * np.sin(2 * np.pi * ratio * TURNS_HZ * time)
    turns = TURNS_HZ * (time + swing)
    whole = np.arange(np.floor(turns[-1]))
    at = np.interp(whole, turns, time)
    angle = ShaftAngle("input", at, whole, np.gradient(whole, at), "pulses")
    return speed_figures(angle, (ratio,))._asdict()


def test_hunting_is_seen() -> None:
    found = figures(1e-3, 0.0)
    assert found["swing"] == pytest.approx(1e-3 / np.sqrt(2), rel=0.05)
    assert found["swing_frequency_hz"] == pytest.approx(0.7, abs=0.05)


def test_a_swing_that_no_run_out_makes_stays_where_its_alias_is_another_shafts_order() -> None:
    found = figures(0.0, 0.02)
    assert found["swing"] > 2e-3
    assert found["swing_frequency_hz"] == pytest.approx((1.0 - RATIO) * TURNS_HZ, abs=0.1)


@pytest.mark.parametrize("ratio", [RATIO, 0.5, 46 / 23, 1.7])
def test_what_another_shaft_does_every_revolution_is_no_hunting(ratio: float) -> None:
    assert figures(0.0, 1e-3, ratio)["swing"] < 1e-5
    both = figures(1e-3, 1e-3, ratio)
    assert both["swing"] == pytest.approx(1e-3 / np.sqrt(2), rel=0.05)
    assert both["swing_frequency_hz"] == pytest.approx(0.7, abs=0.05)


# --------------------
# Averages of both shafts at once: each keeps what is its own, and nothing of the other's.
# --------------------


FRAME = gear_frame(RIG)
N_REVOLUTIONS, N_ANGLES = 40, 256


def over(shaft: str, n_samples: int, wave: np.ndarray) -> AngleSignal:
    turns = n_samples / N_ANGLES
    steady = np.array([0.0, 1.0]), np.array([0.0, turns]), np.full(2, turns)
    return AngleSignal(wave[None], N_ANGLES, ShaftAngle(shaft, *steady, "given"), 0.0, ("v",), ("m/s^2",), 100.0)


def signals(driver_order: int, driven_order: int) -> tuple[AngleSignal, AngleSignal]:
    """A line of each shaft, sampled over the angle of either."""
    ratio = FRAME.shaft_orders[1]
    found = []
    for own in FRAME.shaft_orders:
        n = int(N_REVOLUTIONS * own) * N_ANGLES
        driver_turns = np.arange(n) / N_ANGLES / own
        wave = np.cos(2 * np.pi * driver_order * driver_turns) + np.cos(2 * np.pi * driven_order * ratio * driver_turns)
        found.append(over(FRAME.shafts[len(found)], n, wave))
    return found[0], found[1]


def test_neighbouring_orders_of_two_shafts_are_told_apart() -> None:
    # 8 turns of the driver are nearly 13 of the driven gear: their difference is not resolved in few revolutions.
    separated = separate_shafts(signals(8, 13), TEETH)
    driver, driven = (np.abs(average_lines(signal).whole[0]) for signal in separated.signals)
    assert driver[8] == pytest.approx(1.0, abs=0.02)
    assert driven[13] == pytest.approx(1.0, abs=0.02)
    assert np.delete(driver, 8).max() < 0.02
    assert np.delete(driven, 13).max() < 0.02
    assert np.abs(separated.residual.samples).max() < 0.1


def test_the_mesh_stays_in_both_averages() -> None:
    gathered = reduce_recording(record(), RIG)
    sums = gathered.channels[next(iter(gathered.channels))]
    first = [abs(lines.mean(axis=0)[z]) for lines, z in zip(sums.lines, TEETH, strict=True)]
    assert first[0] == pytest.approx(first[1], rel=0.02)
