"""Modulation of the mesh: what is one, what is not, and whose; teeth that the lines contradict."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from math import log10, pi

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.checks import FloatArray
from gearsig.diagnosis import Analysis, Finding, Kind, Outcome, analyze, modulation_of, with_known_angle
from gearsig.diagnosis import Modulation as Found
from gearsig.orders import order_spectrum
from gearsig.prepared import LinesOverFloor, lines_over_noise_floor, neighbour_level, neighbour_levels
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, GearPair, Rig, Shaft, TachometerChannel
from sims.measure import ColouredNoise, Tachometer
from tests.kinematic.model import (
    KinematicModel,
    MeshHarmonics,
    MeshModulation,
    PathResonance,
    SensorChannel,
    TransferPath,
)
from tests.kinematic.simulate import simulate_kinematic
from tests.kinematic.speed import ConstantProfile, LinearRamp

RATE_HZ = 5120.0
MODEL = KinematicModel(
    speed=ConstantProfile(1320.0),
    meshes=(MeshHarmonics("stage", (4.0, 2.0, 1.0)),),
    channels=(SensorChannel("a1", noise=ColouredNoise(0.5)),),
    tachometer=Tachometer("in"),
)
TWO_STAGES = (Shaft("a"), Shaft("b"), Shaft("c"))
ALL_K = tuple(range(1, 9))
N_REV, PER_REV, MESH = 128, 256, 27


def rig(driver: int = 27, driven: int | None = 43) -> Rig:
    return Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("stage", "in", "out", driver, driven),))


def record(
    model: KinematicModel = MODEL,
    machine: Rig | None = None,
    seconds: float = 6.0,
    *,
    seed: int = 0,
    rate_hz: float = RATE_HZ,
) -> Recording:
    rng = np.random.default_rng(seed)
    return simulate_kinematic(machine or rig(), model, sampling_rate_hz=rate_hz, duration_s=seconds, rng=rng)


def with_noise(level: float) -> tuple[SensorChannel, ...]:
    return (SensorChannel("a1", noise=ColouredNoise(level)),)


def with_tone(recording: Recording, amplitude: float, hertz: float) -> Recording:
    samples = np.array(recording.samples)
    samples[0] += amplitude * np.cos(2 * pi * hertz * np.arange(samples.shape[1]) / RATE_HZ)
    return replace(recording, samples=samples)


def found(analysis: Analysis, code: str) -> list[Finding]:
    return [f for f in analysis.findings if f.code == code]


def test_products_of_known_orders_are_no_third_shafts_sidebands() -> None:
    """Four times one shaft less the other: teeth that differ on a gear that an eccentric one modulates.

    An angle that was found from the vibration at some points a turn has images of what it follows.
    """
    points = np.linspace(0.0, 4.0, 1 + 115)  # 1.3 a turn
    angle = ShaftAngle("in", points, 22.0 * points, np.full(len(points), 22.0), "tachless")
    for product in (4 - 27 / 43, 115 / 88 - 27 / 43):
        recording = record(seconds=4.0)
        for order in (-4.0, -27 / 43, 27 / 43, 4.0):  # no product is stronger than its factors
            recording = with_tone(recording, 0.2, 22.0 * (27 + order))
        for order in (-product, product):
            for h in (1, 2, 3):
                recording = with_tone(recording, 0.15, 22.0 * (27 * h + order))
        assert not found(analyze(with_known_angle(recording, angle)), "sidebands-of-unknown-shaft")


@cache
def excess_of(am: float, pm: float, k: int, noise: float = 1e-3, tone_order: float = 0.0) -> LinesOverFloor:
    angle_rev = np.arange(N_REV * PER_REV) / PER_REV
    x = noise * np.random.default_rng(5).normal(size=len(angle_rev))
    for h in (1, 2, 3):
        phase = 2 * pi * h * MESH * angle_rev + h * pm * np.sin(2 * pi * k * angle_rev)
        x += (1 + am * np.cos(2 * pi * k * angle_rev)) * np.cos(phase) / h
    x += np.cos(2 * pi * tone_order * angle_rev) if tone_order else 0.0
    turns = np.array([0.0, float(N_REV)])
    angle = ShaftAngle("in", turns, turns, np.array([1.0, 1.0]), "constant")
    signal = AngleSignal(x[None, :], PER_REV, angle, 0.0, ("a",), ("g",), PER_REV / 2)
    return lines_over_noise_floor(order_spectrum(signal, "a"))


def measured(excess: LinesOverFloor) -> Found:
    modulation = modulation_of(excess, MESH, 1.0, (), ALL_K)
    assert modulation is not None
    return modulation


@given(st.floats(0.05, 1.0), st.sampled_from(ALL_K))
@settings(max_examples=15, deadline=None)
def test_amplitude_modulation_has_its_level_and_rate(m: float, k: int) -> None:
    # Two sidebands of m/2 each: m²/2 of the carrier's power.
    modulation = measured(excess_of(m, 0.0, k))
    assert (modulation.times, modulation.spacing) == (k, float(k))
    assert modulation.level_db == pytest.approx(10 * log10(m**2 / 2), abs=0.1)


def test_amplitude_and_phase_modulation_together_lose_no_sideband() -> None:
    # The lower sideband of the first harmonic all but vanishes; (m ± hb)²/4 of the carriers, b small.
    m = b = 0.1
    a = 1 / np.arange(1, 4)
    expected = np.sum(a**2 * (m**2 + (b / a) ** 2) / 2) / np.sum(a**2)
    assert measured(excess_of(m, b, 1)).level_db == pytest.approx(10 * log10(expected), abs=0.4)


def test_a_tone_beside_a_modulated_mesh_adds_nothing() -> None:
    alone, with_it = (measured(excess_of(0.1, 0.0, 1, tone_order=order)) for order in (0.0, 55.0))
    assert with_it.level_db == pytest.approx(alone.level_db, abs=0.5)


def test_without_modulation_the_level_is_what_noise_would_hide() -> None:
    excess = excess_of(0.0, 0.0, 1)
    floor = max(float(excess.floor[excess.spectrum.index_of(h * MESH)]) for h in (1, 2, 3))
    expected = 10 * log10(2 * 10**1.2 * floor**2 / (1 + 1 / 4 + 1 / 9))
    assert measured(excess).level_db == pytest.approx(expected, abs=0.2)


def test_no_statement_where_noise_would_hide_a_notable_modulation() -> None:
    assert modulation_of(excess_of(0.0, 0.0, 1, noise=8.0), MESH, 1.0, (), ALL_K) is None


def test_lines_of_other_elements_are_not_counted() -> None:
    places = tuple(float(h * MESH + side) for h in (1, 2, 3) for side in (-1, 1))
    modulation = modulation_of(excess_of(0.6, 0.0, 1), MESH, 1.0, places, ALL_K)
    assert modulation is not None
    assert modulation.level_db < -30


@pytest.mark.parametrize("noise", [4.0, 8.0, 12.0, 16.0])
def test_a_weak_mesh_in_noise_is_not_modulated(noise: float) -> None:
    weak = replace(MODEL, meshes=(MeshHarmonics("stage", (1.0,)),), channels=with_noise(noise))
    for seed in range(2):
        assert not found(analyze(record(weak, seed=seed)), "mesh-modulated")


@pytest.mark.parametrize("amplitude", [2.0, 10.0, 40.0])
def test_a_lone_tone_beside_the_mesh_is_no_modulation(amplitude: float) -> None:
    # Beside the second harmonic, where the upper sideband of the output shaft is.
    hertz = 22.0 * (2 * 27 + 27 / 43)
    model = replace(MODEL, modulations=(MeshModulation("stage", "out", 0.05),))
    assert not found(analyze(with_tone(record(model), amplitude, hertz)), "mesh-modulated")


@pytest.mark.parametrize(
    ("pairs", "seconds"),
    [
        ((GearPair("p1", "a", "b", 27, 43), GearPair("p2", "a", "c", 28, 51)), 6.0),  # one above the other by 1x a
        ((GearPair("p1", "a", "b", 20, 60), GearPair("p2", "b", "c", 61, 97)), 6.0),  # and by 1x b
        ((GearPair("p1", "a", "b", 20, 80), GearPair("p2", "b", "c", 21, 84)), 1.0),  # sidebands of c not resolved
    ],
)
def test_lines_of_another_pair_or_of_the_carrier_are_no_sidebands(pairs: tuple[GearPair, ...], seconds: float) -> None:
    model = KinematicModel(
        speed=ConstantProfile(1500.0),
        meshes=(MeshHarmonics("p1", (4.0, 2.0, 1.0)), MeshHarmonics("p2", (4.0, 2.0, 1.0))),
        channels=with_noise(0.3),
        tachometer=Tachometer("a"),
    )
    analysis = analyze(record(model, Rig(shafts=TWO_STAGES, pairs=pairs), seconds))
    assert not found(analysis, "mesh-modulated") + found(analysis, "teeth-disagree")


def test_three_modulations_per_revolution_are_told() -> None:
    model = replace(MODEL, modulations=(MeshModulation("stage", "in", 0.9, order=3),))
    (finding,) = found(analyze(record(model)), "mesh-modulated")
    assert finding.kind is Kind.NOTICE
    assert "3 times per revolution of shaft in" in finding.title
    assert finding.where.order == pytest.approx(3.0)


def test_a_simple_cause_goes_before_a_multiple_of_a_slower_shaft() -> None:
    machine = rig(20, 40)  # the output shaft's second sidebands are the input shaft's first
    model = replace(MODEL, modulations=(MeshModulation("stage", "in", 0.6),))
    (finding,) = found(analyze(record(model, machine)), "mesh-modulated")
    assert finding.where.shaft == "in"


def test_shafts_of_one_speed_are_not_told_apart() -> None:
    model = replace(MODEL, modulations=(MeshModulation("stage", "in", 0.6),))
    findings = found(analyze(record(model, rig(27, 27))), "mesh-modulated")
    assert findings
    assert all(any("cannot be told" in text for text in finding.evidence) for finding in findings)


@pytest.mark.parametrize("stated", [24, 25, 26, 28, 29, 30])
def test_teeth_that_the_lines_contradict(stated: int) -> None:
    model = replace(MODEL, modulations=(MeshModulation("stage", "in", 0.1), MeshModulation("stage", "out", 0.1)))
    analysis = analyze(replace(record(model), rig=rig(stated)))
    (finding,) = found(analysis, "teeth-disagree")
    assert finding.where.order == pytest.approx(27.0)
    assert f"order 27, the rig says {stated}" in finding.title
    assert analysis.outcome is Outcome.CANNOT_TELL
    assert not found(analysis, "mesh-modulated") + found(analysis, "sidebands-of-unknown-shaft")
    assert not found(analysis, "mesh-found")


def test_wrong_teeth_of_the_driven_gear_where_the_speed_is_its_own() -> None:
    recording = record(replace(MODEL, tachometer=Tachometer("out")))
    wrong = replace(rig(27, 44), speed=TachometerChannel("tacho", shaft="out"))
    (finding,) = found(analyze(replace(recording, rig=wrong)), "teeth-disagree")
    assert finding.where.order == pytest.approx(43.0)


@pytest.mark.parametrize("am", [0.0, 0.9])
@pytest.mark.parametrize("pm", [0.5, 1.5, 2.4])
def test_strong_modulation_does_not_contradict_the_teeth(am: float, pm: float) -> None:
    analysis = analyze(record(replace(MODEL, modulations=(MeshModulation("stage", "in", am, pm),))))
    assert not found(analysis, "teeth-disagree")
    assert "once per revolution of shaft in" in found(analysis, "mesh-modulated")[0].title


def test_another_pair_explains_lines_one_tooth_away() -> None:
    machine = Rig(shafts=TWO_STAGES, pairs=(GearPair("p1", "a", "b", 27, 43), GearPair("p2", "a", "c", 28, 51)))
    model = replace(
        MODEL,
        meshes=(MeshHarmonics("p1", (0.4, 0.2, 0.1)), MeshHarmonics("p2", (8.0, 4.0, 2.0))),
        tachometer=Tachometer("a"),
    )
    assert not found(analyze(record(model, machine)), "teeth-disagree")


def test_the_foot_of_a_mesh_line_in_a_run_up_is_no_family() -> None:
    path = TransferPath(1.0, (PathResonance(700.0, 0.01, 30.0),))
    for seed in range(3):
        model = replace(
            MODEL, speed=LinearRamp(600.0, 1800.0, 6.0), channels=(SensorChannel("a1", path, ColouredNoise(0.3)),)
        )
        analysis = analyze(record(model, rig(27, 143), seed=seed))
        assert not found(analysis, "sidebands-of-unknown-shaft") + found(analysis, "unexplained-line")
        assert not found(analysis, "mesh-modulated")


def with_mesh(seconds: float, teeth: int, modulation: Callable[[FloatArray], FloatArray], seed: int = 0) -> Recording:
    """Return a mesh at 22 Hz of the input shaft, modulated in amplitude as a function of time, in little noise."""
    t = np.arange(round(seconds * RATE_HZ)) / RATE_HZ
    x = 0.02 * np.random.default_rng(seed).normal(size=len(t))
    x += 30.0 * (1 + modulation(t)) * sum(np.cos(2 * pi * h * teeth * 22.0 * t) / h for h in (1, 2, 3))
    speed = ConstantSpeed(1320.0, "in")
    channel = Channel("a1", "acceleration", "m/s^2")
    return Recording(x[None], RATE_HZ, (channel,), speed, rig=rig(teeth, 47))


def wander(t: FloatArray, seed: int = 0) -> FloatArray:
    """Return a load that wanders, of rms 1: it makes a skirt about the lines of the mesh, and no lines."""
    lines = np.fft.rfft(np.random.default_rng(seed).normal(size=len(t)))
    slow: FloatArray = np.fft.irfft(lines / (1 + (np.fft.rfftfreq(len(t), 1 / RATE_HZ) / 3.0) ** 2), len(t))
    return slow / np.std(slow)


@pytest.mark.parametrize("seed", range(4))
def test_the_skirt_of_a_mesh_line_is_no_family(seed: int) -> None:
    analysis = analyze(with_mesh(2.0, 27, lambda t: 0.05 * wander(t, seed), seed))
    assert not found(analysis, "sidebands-of-unknown-shaft")


def test_a_family_of_an_unknown_shaft_stands_out_of_the_skirt() -> None:
    def modulation(t: FloatArray) -> FloatArray:
        turns = 2 * pi * 0.3 * 22.0 * t
        return 0.02 * wander(t) + 0.1 * np.cos(turns) + 0.05 * np.cos(2 * turns)

    (finding,) = found(analyze(with_mesh(6.0, 27, modulation)), "sidebands-of-unknown-shaft")
    assert finding.where.order == pytest.approx(0.3, abs=0.002)


def test_ball_passing_and_second_multiples_alone_are_no_unknown_shafts() -> None:
    """Elements that pass under the load shift the gears of a sound machine, too."""

    def modulated(order: float) -> Recording:
        return with_mesh(6.0, 27, lambda t: 0.1 * np.cos(2 * pi * order * 22.0 * t))

    once, twice = modulated(1.27), modulated(2.54)
    (finding,) = found(analyze(once), "sidebands-of-unknown-shaft")
    assert finding.where.order == pytest.approx(1.27, abs=0.002)
    assert not found(analyze(twice), "sidebands-of-unknown-shaft")
    assert once.rig is not None
    slow = Bearing("slow", "in", bpfo_order=1.26, bpfi_order=1.74)
    with_bearing = replace(once, rig=replace(once.rig, bearings=(slow,)))
    assert not found(analyze(with_bearing), "sidebands-of-unknown-shaft")


def test_sidebands_of_both_shafts_together_are_no_unknown_shafts() -> None:
    def modulation(t: FloatArray) -> FloatArray:
        driver, driven = 2 * pi * 22.0 * t, 2 * pi * 22.0 * 29 / 47 * t
        return (1 + 0.4 * np.cos(driver)) * (1 + 0.4 * np.cos(driven) + 0.1 * np.cos(2 * driven)) - 1

    assert not found(analyze(with_mesh(8.0, 29, modulation)), "sidebands-of-unknown-shaft")


def test_sidebands_of_a_shaft_and_of_the_next_but_one_are_no_unknown_shafts() -> None:
    def modulation(t: FloatArray) -> FloatArray:
        driver, end = 2 * pi * 22.0 * t, 2 * pi * 22.0 * 29 / 47 * 31 / 53 * t
        return (1 + 0.4 * np.cos(driver)) * (1 + 0.4 * np.cos(end) + 0.1 * np.cos(2 * end)) - 1

    stages = (GearPair("second", "out", "third", 31, 53), GearPair("last", "third", "end", 17, 60))
    one = rig(29, 47)
    train = replace(one, shafts=(*one.shafts, Shaft("third"), Shaft("end")), pairs=(*one.pairs, *stages))
    analysis = analyze(replace(with_mesh(8.0, 29, modulation), rig=train))
    assert not found(analysis, "sidebands-of-unknown-shaft")


def test_pulses_of_which_there_are_twice_as_many_are_doubted() -> None:
    model = replace(
        MODEL,
        tachometer=Tachometer("in", pulses_per_revolution=2),
        meshes=(MeshHarmonics("stage", (4.0, 3.0, 2.0, 2.0)),),
        modulations=(MeshModulation("stage", "in", 0.2, 0.2),),
    )
    recording = record(model, rate_hz=2 * RATE_HZ)
    once = TachometerChannel("tacho", shaft="in")
    (finding,) = found(analyze(replace(recording, speed=once)), "sidebands-of-unknown-shaft")
    assert finding.where.order == pytest.approx(0.5, abs=0.01)
    assert any("pulses_per_revolution may be wrong" in text for text in finding.evidence)


def test_the_neighbour_level_a_line_is_that_of_the_noise() -> None:
    spectrum = excess_of(0.0, 0.0, 1).spectrum
    everywhere = neighbour_levels(spectrum)
    for order in (5.0, 27.0, 40.3):
        i = spectrum.index_of(order)
        beside = neighbour_level(spectrum, order)
        assert beside == pytest.approx(everywhere[i])
        assert beside == pytest.approx(float(excess_of(0.0, 0.0, 1).floor[i]), rel=0.7)
    assert neighbour_level(spectrum, 27.0, outer_lines=4) is None


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_line_is_called_a_multiple_of_the_hunting_tooth_order_only_among_others_of_them(seed: int) -> None:
    """27 and 45 teeth meet again after five turns: a tone at a multiple is alone, teeth that differ make many lines."""
    rng, rate_hz, turns_hz, hunting = np.random.default_rng(seed), 4096.0, 20.0, 0.2
    turns = turns_hz * np.arange(round(20.0 * rate_hz)) / rate_hz
    mesh, noise = np.cos(2 * pi * 27 * turns), rng.normal(size=len(turns))
    strange = 4.0 * np.cos(2 * pi * 284 * hunting * turns)  # no sideband of the mesh
    phases = rng.uniform(0, 2 * pi, 40)
    differing = sum(np.cos(2 * pi * (k + 1) * hunting * turns + phase) for k, phase in enumerate(phases))
    machine = replace(rig(27, 45), speed=ConstantSpeed(60 * turns_hz, "in"))
    lines = []
    for x in (20 * mesh + strange + noise, 20 * mesh * (1 + 0.1 * differing) + noise):
        recording = Recording(x[None, :], rate_hz, (Channel("a1", "acceleration", "m/s^2"),), rig=machine)
        lines += found(analyze(recording), "unexplained-line")
    alone, among = (line.title for line in lines)
    assert "no known shaft" in alone
    assert "hunting-tooth order" in among
