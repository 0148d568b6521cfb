"""What the timing of methods makes of times that are known."""

import numpy as np
import pytest

from app.benchmark.speed import TimedCase, TimedMethod, Timing, measure, rows, table


class Clock:
    """A processor whose time passes where a method says so."""

    def __init__(self, monkeypatch):
        self.now_s = 0.0
        monkeypatch.setattr("app.benchmark.speed.time.process_time", lambda: self.now_s)

    def busy(self, seconds):
        self.now_s += seconds
        return np.arange(10.0)

    def case(self, n):
        rivals = {"numpy.slow": lambda: 2.0 * self.busy(4e-6 * n), "no_such_package.method": lambda: None}
        return TimedCase(lambda: self.busy(1e-6 * n), rivals, lambda: self.busy(5e-7 * n))


@pytest.fixture
def clock(monkeypatch):
    monkeypatch.setattr("app.benchmark.speed.SHORTEST_RUNS_S", 0.0)
    return Clock(monkeypatch)


def test_ratio_growth_limit_and_agreement(clock):
    (result,) = measure([TimedMethod("busy", [1000, 4000, 16000], clock.case, "half of it")])
    slow, absent = rows([result])
    assert slow["ratio"] == pytest.approx(4.0)
    assert slow["over_limit"] == pytest.approx(2.0)
    assert slow["exponent"] == pytest.approx(1.0)
    assert slow["difference"] < 1e-12  # up to a common factor
    assert absent["reason"] == "not installed"
    assert len([line for line in table([result]).splitlines() if line.startswith("| busy")]) == 2


def test_what_takes_too_long_is_given_no_longer_signal(clock):
    (result,) = measure([TimedMethod("busy", [1000, 4000], clock.case, "half of it")], longest_s=1e-3)
    assert [list(timing.seconds) for timing in result.timings[:2]] == [[1000, 4000], [1000]]
    assert next(rows([result]))["n"] == 1000


def test_an_exponent_needs_two_lengths():
    assert np.isnan(Timing("one", {1000: 1.0}).exponent)
    assert Timing("two", {10: 1.0, 1000: 1e4}).exponent == pytest.approx(2.0)
