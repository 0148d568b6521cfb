"""The strongest unexplained line is the strongest, and where the speed varies it has no single frequency."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import analyze
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, Rig, Shaft
from tests.diagnosis.machines import GOOD, SAMPLING_RATE_HZ, finding, record, teeth
from tests.kinematic.speed import LinearRamp

BEARINGS = (Bearing("drive end", "in", 9, 7.94, 39.04), Bearing("fan end", "in", 8, 6.746, 28.5))


def test_a_line_on_a_high_multiple_of_a_bearings_order_is_not_left_out() -> None:
    rng, order = np.random.default_rng(0), 28 * BEARINGS[1].orders()["BPFI"] + 0.05
    t = np.arange(round(8 * SAMPLING_RATE_HZ)) / SAMPLING_RATE_HZ
    lines = ((1.0, 1.0), (order, 0.5), (order - 4.0, 0.3))
    x = 0.1 * rng.normal(size=len(t)) + sum(a * np.cos(2 * np.pi * o * 22.0 * t) for o, a in lines)
    rig = Rig(shafts=(Shaft("in"),), bearings=BEARINGS)
    recording = Recording(x[None], SAMPLING_RATE_HZ, (Channel("a1"),), ConstantSpeed(1320.0, "in"), rig=rig)
    found = finding(analyze(recording), "unexplained-line")
    assert found.where.order == pytest.approx(order, abs=0.01)
    assert any("first 6 multiples of the bearings' orders" in text for text in found.evidence)


@pytest.mark.parametrize(
    ("seconds", "n_teeth", "order", "origin"),
    [
        (8.0, (27, 43), 4 * 27 + 1 - 27 / 43, ": 4× mesh stage + 1× in − 1× out."),
        (8.0, (27, 43), 4 * 27 + 2 + 27 / 43, ": 4× mesh stage + 2× in + 1× out."),
        (8.0, (27, 43), 4 * 27 + 7.2, ""),
        (1.0, (9, 14), 4 * 9 + 1 - 9 / 14, ""),  # at this resolution a quarter of all places are such sidebands
    ],
)
def test_a_sideband_of_both_shafts_of_a_mesh_is_known(
    seconds: float, n_teeth: tuple[int, int], order: float, origin: str
) -> None:
    rng, mesh = np.random.default_rng(0), n_teeth[0]
    t = np.arange(round(seconds * SAMPLING_RATE_HZ)) / SAMPLING_RATE_HZ
    x = 0.1 * rng.normal(size=len(t))
    x += sum(a * np.cos(2 * np.pi * o * 22.0 * t) for o, a in ((1, 1.0), (mesh, 3.0), (order, 1.0)))
    recording = Recording(x[None], SAMPLING_RATE_HZ, (Channel("a1"),), ConstantSpeed(1320.0, "in"), rig=teeth(*n_teeth))
    found = finding(analyze(recording), "unexplained-line")
    assert found.where.order == pytest.approx(order, abs=0.05)
    assert found.title.endswith(origin or " Hz).")


def test_a_run_up_has_ranges_of_speed_and_frequency() -> None:
    analysis = analyze(record(replace(GOOD, speed=LinearRamp(600.0, 1800.0, 6.0)), seconds=6.0))
    mesh = finding(analysis, "mesh-found")
    assert " to " in mesh.title
    assert mesh.where.frequency_hz is None
    speed = finding(analysis, "speed").title
    assert "rpm on average" in speed
    assert "±" not in speed


def test_a_steady_speed_has_its_frequency_and_uncertainty() -> None:
    analysis = analyze(record())
    mesh = finding(analysis, "mesh-found")
    assert mesh.where.frequency_hz == pytest.approx(mesh.where.order * 22.0, rel=0.01)  # type: ignore[operator]
    assert " ± " in finding(analysis, "speed").title
