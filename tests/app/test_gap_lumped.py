"""The lumped rig of the gap's studies: what a healthy one does, and that effects show where the literature says."""

from dataclasses import replace

import numpy as np
import pytest

from app.studies.gap import lumped_rig
from app.studies.gap.lumped import EFFECTS, outside
from app.studies.gap.lumped_rig import LumpedDay, LumpedFault, LumpedGeometry, LumpedRig, record
from gearsig.gap import ReducedRecording, reduce_recording
from gearsig.orders import order_spectrum
from gearsig.recording import Recording

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def rig() -> LumpedRig:
    return replace(LumpedRig.drawn(np.random.default_rng(12)), speeds_rpm=(1500.0, 1100.0))


def recorded(rig: LumpedRig, fault: LumpedFault | None = None, point: int = 0) -> Recording:
    day = LumpedDay.drawn(rig, np.random.default_rng(5))
    return record(rig, point, day, fault or LumpedFault(), np.random.default_rng(6), duration_s=3.0)


def reduced(rig: LumpedRig, fault: LumpedFault | None = None) -> ReducedRecording:
    return reduce_recording(recorded(rig, fault))


def test_a_healthy_one_turns_at_its_speed_and_is_heard_at_its_mesh(rig: LumpedRig) -> None:
    for point in range(2):
        recording = recorded(rig, point=point)
        here = reduce_recording(recording)
        assert 60.0 * here.speed_hz == pytest.approx(rig.speeds_rpm[point], rel=0.011)
        spectrum = order_spectrum(recording, "a1")
        loudest = spectrum.positions[np.argmax(spectrum.values)] / rig.teeth[0]
        assert loudest == pytest.approx(round(loudest), abs=0.01)


def test_the_default_step_has_converged(rig: LumpedRig, monkeypatch: pytest.MonkeyPatch) -> None:
    coarse = recorded(rig).samples[0]
    monkeypatch.setattr(lumped_rig, "OVERSAMPLING", {25600: 24, 20000: 32})
    fine = recorded(rig).samples[0]
    assert np.std(coarse) == pytest.approx(float(np.std(fine)), rel=0.05)


def test_unbalance_is_an_order_of_its_shaft(rig: LumpedRig) -> None:
    healthy, heavy = reduced(rig), reduced(rig, LumpedFault(unbalance_kg_m={0: 5e-3 + 0j}))
    first = [average.power[1] for run in (healthy, heavy) for average in run.averages(0)[:1]]
    assert first[1] > 100.0 * first[0]


def test_one_tooth_out_of_place_is_found_on_its_gear(rig: LumpedRig) -> None:
    shape = LumpedGeometry.of(rig)
    late = LumpedFault(gaps_m=[(1, 7, np.full(len(shape.path), 40e-6))])
    healthy, off = reduced(rig), reduced(rig, late)

    def beside_the_mesh(run: ReducedRecording, side: int) -> float:
        power = run.averages(side)[0].power
        return float(np.sum(np.delete(power, np.arange(0, len(power), rig.teeth[side]))))

    risen = [beside_the_mesh(off, side) / beside_the_mesh(healthy, side) for side in range(2)]
    assert risen[1] > 5.0
    assert risen[1] > 2.0 * risen[0]


@pytest.mark.study
def test_every_effect_and_what_is_outside_can_be_recorded(rig: LumpedRig) -> None:
    rng = np.random.default_rng(8)
    faults = [effect(rig, LumpedGeometry.of(rig), rng) for effect in EFFECTS.values()]
    for fault in [*faults, *(outside(rig, rng)[1] for _ in range(6))]:
        assert np.all(np.isfinite(recorded(rig, fault).samples))
