"""Tolerances of the population's machines: the same on every day, at the driven gear's own place, and no more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from app.studies.gap.gearboxes import Ordinary
from gearsig.gap import change_once, once, reduce_recording
from tests.gap.synthetic import RATE_HZ, RIG, SPEED_HZ, TEETH, record

HEALTHY = record()


def test_a_day_repeats_the_machine_and_not_the_noise() -> None:
    ordinary = Ordinary.of(HEALTHY, 3)
    first, again = (ordinary.on(HEALTHY, 0, np.random.default_rng(5)) for _ in range(2))
    other = ordinary.on(HEALTHY, 0, np.random.default_rng(6))
    np.testing.assert_array_equal(first.samples, again.samples)
    assert 0.0 < np.std(first.samples - other.samples) < 0.2 * np.std(first.samples)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_machines_get_sidebands_and_shaft_lines_that_last(seed: int) -> None:
    ordinary = Ordinary.of(HEALTHY, seed)
    days = [reduce_recording(ordinary.on(record(seed=day), 0, np.random.default_rng(day)), RIG) for day in (1, 2)]
    names, before = once(reduce_recording(HEALTHY, RIG))
    _, after = once(days[0])
    raised = dict(zip(names, after - before, strict=True))
    assert max(raised[f"shaft.{side}.{n}.to_mesh"] for side in ("driver", "driven") for n in (1, 2, 3)) > 6.0
    change = dict(zip(*change_once(days[1], days[0]), strict=True))
    assert abs(change["sideband.driver.1"]) < 1.0
    assert max(change["change.driver.agreement"], change["change.driven.agreement"]) > 7.0


def test_a_later_beginning_keeps_the_driven_gears_place() -> None:
    """After as many turns as the driven gear has teeth all is as before; after one it is not."""
    ordinary = Ordinary.of(HEALTHY, 1)
    rows = [ordinary.on(HEALTHY, turns, np.random.default_rng(0)).samples for turns in (0, 1, TEETH[1])]
    assert np.abs(rows[2] - rows[0]).max() < 1e-6 * np.abs(rows[0]).max()
    assert np.abs(rows[1] - rows[0]).max() > 1e-3 * np.abs(rows[0]).max()


def test_pulses_move_by_less_than_a_hundredth_of_a_turn() -> None:
    time = np.arange(round(RATE_HZ * 2.0)) / RATE_HZ
    pulses = (np.mod(SPEED_HZ * time, 1.0) < 0.1).astype(np.float64)
    channel = replace(HEALTHY.channels[0], name="tacho", quantity="tachometer", unit="V")
    n = len(time)
    with_mark = replace(
        HEALTHY,
        samples=np.vstack([HEALTHY.samples[:, :n], pulses]),
        channels=(*HEALTHY.channels, channel),
        speed=replace(HEALTHY.speed, times_s=HEALTHY.speed.times_s[HEALTHY.speed.times_s < 2.0]),
    )
    found = Ordinary.of(with_mark, 2).on(with_mark, 0, np.random.default_rng(1)).samples[-1]
    before, after = (np.flatnonzero(np.diff(row) > 0.5) for row in (pulses, np.round(found)))
    assert len(before) == len(after)
    assert np.abs(after - before).max() <= 0.01 * RATE_HZ / SPEED_HZ
