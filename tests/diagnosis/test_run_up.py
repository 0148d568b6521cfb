"""Run-ups: levels of orders over speed, and the resonances at which several orders peak."""

import json
from dataclasses import replace

import numpy as np
import pytest

from gearsig.diagnosis import Analysis, OrderLevel, analyze, detect_resonances
from gearsig.report import analysis_to_json, page_html
from gearsig.rig import GearPair, Rig, Shaft
from sims.measure import ColouredNoise, Tachometer
from tests.diagnosis.machines import codes, finding, good_analysis, teeth
from tests.kinematic.model import (
    KinematicModel,
    MeshHarmonics,
    MeshModulation,
    PathResonance,
    SensorChannel,
    TransferPath,
)
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import LinearRamp

AMPLITUDES = (4.0, 2.0, 1.0)
MESH = 27


def run_up(*resonances: PathResonance, rpm: tuple[float, float] = (600.0, 2700.0), seed: int = 0) -> Analysis:
    """Analyse a run-up of the test gearbox, its path with the given resonances."""
    model = KinematicModel(
        speed=LinearRamp(*rpm, 8.0),
        meshes=(MeshHarmonics("stage", AMPLITUDES),),
        modulations=(MeshModulation("stage", "in", 0.1),),
        channels=(SensorChannel("a1", TransferPath(1.0, resonances), ColouredNoise(0.5)),),
        tachometer=Tachometer("in"),
    )
    rng = np.random.default_rng(seed)
    rig = teeth(MESH, 43)
    return analyze(simulate_kinematic(rig, model, sampling_rate_hz=10240.0, duration_s=8.0, rng=rng))


@pytest.fixture(scope="module")
def resonant() -> Analysis:
    return run_up(PathResonance(1000.0, 0.02, 6.0))


@pytest.fixture(scope="module")
def flat() -> Analysis:
    return run_up()


def test_levels_are_the_amplitudes_put_in(flat: Analysis) -> None:
    levels = [level for level in flat.channels[0].order_levels if level.pair]
    assert [level.harmonic for level in levels] == [1, 2, 3, 4]
    for level, amplitude in zip(levels, AMPLITUDES, strict=False):
        assert level.order == pytest.approx(MESH * level.harmonic)
        assert np.median(level.amplitude) == pytest.approx(amplitude, rel=0.03)
        assert np.all(np.diff(level.speed_rpm) > 0)


def test_a_resonance_is_named_by_the_orders_that_peak_at_it(resonant: Analysis) -> None:
    found = finding(resonant, "resonance")
    assert found.where.frequency_hz == pytest.approx(1000.0, rel=0.02)
    assert "1× mesh of stage at 22" in found.title  # 1000 Hz is passed at 2222 rpm, and by the second at half of it
    assert "2× mesh of stage at 11" in found.title
    assert codes(resonant).count("resonance") == 1


def test_largest_levels_lie_at_the_resonance(resonant: Analysis) -> None:
    for level in resonant.channels[0].order_levels[:3]:
        amplitude, rpm, hertz = level.largest
        assert hertz == pytest.approx(1000.0, rel=0.03)
        assert rpm * MESH * level.harmonic / 60 == pytest.approx(hertz)
        assert amplitude > 4.0 * AMPLITUDES[level.harmonic - 1]


@pytest.mark.slow
def test_a_flat_path_has_no_resonance(flat: Analysis) -> None:
    assert "resonance" not in codes(flat)
    assert "resonance" not in codes(run_up(seed=1))


def test_peaks_of_one_order_alone_are_no_resonance() -> None:
    rpm = np.linspace(600.0, 3000.0, 160)
    peaked = 1.0 + 9.0 / (1.0 + ((rpm - 1800.0) / 60.0) ** 2)
    levels = [
        OrderLevel(f"order {k}", float(k), rpm, peaked, "m/s^2", 0.3) for k in (10, 17, 31)
    ]  # one speed, three frequencies: the drive, not the structure
    assert detect_resonances({"a1": levels}) == []


def test_steady_speed_has_no_levels_over_speed() -> None:
    analysis = good_analysis()
    assert analysis.channels[0].order_levels == ()
    assert "resonance" not in codes(analysis)


def test_report_and_json_carry_the_levels(resonant: Analysis) -> None:
    level = json.loads(analysis_to_json(resonant))["channels"][0]["order_levels"][0]
    assert len(level["speed_rpm"]) == len(level["amplitude"]) <= 160
    assert level["largest_at_hz"] == pytest.approx(1000.0, rel=0.03)
    page = page_html(resonant)
    assert "over speed" in page
    assert "1× mesh of stage" in page


def test_of_two_stages_both_meshes_are_followed_and_nothing_else() -> None:
    rig = Rig(
        shafts=(Shaft("in"), Shaft("middle"), Shaft("out")),
        pairs=(GearPair("first", "in", "middle", 27, 43), GearPair("second", "middle", "out", 17, 61)),
    )
    model = KinematicModel(
        speed=LinearRamp(600.0, 1800.0, 8.0),
        meshes=(MeshHarmonics("first", AMPLITUDES), MeshHarmonics("second", AMPLITUDES)),
        channels=(SensorChannel("a1", noise=ColouredNoise(0.5)),),
        tachometer=Tachometer("in"),
    )
    rng = np.random.default_rng(0)
    analysis = analyze(simulate_kinematic(rig, model, sampling_rate_hz=10240.0, duration_s=8.0, rng=rng))
    levels = analysis.channels[0].order_levels
    assert [(level.pair, level.harmonic) for level in levels] == [
        (p, h) for p in ("first", "second") for h in (1, 2, 3, 4)
    ]


def test_a_run_up_too_short_for_the_filter_is_analysed_all_the_same(flat: Analysis) -> None:
    recording = flat.recording
    short = replace(recording, samples=recording.samples[:, :4096])
    assert analyze(short).verdict
