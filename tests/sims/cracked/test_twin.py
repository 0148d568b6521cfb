"""Twin of a rig: what the rig states is in it; what seed and noise change; an effect alone makes the difference."""

import pickle
from dataclasses import replace
from functools import cache
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from gearsig.errors import InputError, RefusalError
from gearsig.gap import AddedEffect, OperatingCondition, Twin, reduce_recording
from gearsig.recording import Recording
from gearsig.rig import Bearing, EncoderChannel, GearPair, OperatingPoint, Rig, Sensor, Shaft, TachometerChannel
from sims import simulate
from sims.cracked import CrackedPair, CrackedTwin
from sims.effects import effect, effects
from sims.gear_pair import BODY_KG, PairTwin, completed_bearing
from sims.machine import nominal_of
from sims.registry import gap_simulator
from sims.simulator import SimulationSetup

FS = 20480.0
POINT = OperatingCondition(1800.0, 40.0)
RIG = Rig(
    "bench",
    (Shaft("pinion"), Shaft("wheel")),
    (GearPair("pair", "pinion", "wheel", 21, 50, 2.0, 20.0, 18.0),),
    (Bearing("P1", "pinion", 9, 7.94, 39.04), Bearing("W1", "wheel", bpfo_order=3.05, bpfi_order=4.95)),
    (
        Sensor("acc wheel", "acceleration", "m/s^2", "wheel bearing, horizontal"),
        Sensor("acc pinion", "acceleration", "m/s^2", "over P1, vertical"),
        Sensor("oil", "temperature"),
    ),
    OperatingPoint("wheel", 756.0, torque_nm=100.0),
    TachometerChannel("mark", 1, shaft="wheel"),
)


@cache
def twin(rig: Rig = RIG) -> CrackedTwin:
    made = gap_simulator("cracked").twin_of(rig)
    assert isinstance(made, CrackedTwin)
    return made


def run(added: tuple[AddedEffect, ...] = (), *, seed: int = 0, noise: int = 0, duration_s: float = 0.3) -> Recording:
    return twin().run(POINT, added, seed=seed, noise=noise, duration_s=duration_s, sampling_rate_hz=FS)


@pytest.mark.slow
def test_a_tooth_breaks_while_the_healthy_machine_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is recorded then is what a machine records that was broken from its static balance on."""
    made, crack = twin().quiet(), (AddedEffect("root_crack", 2.0, {"gear": "driver", "tooth": 3.0}),)
    healthy, going_on = (made.run(POINT, a, seed=1, duration_s=0.3, sampling_rate_hz=FS) for a in ((), crack))

    def from_the_static_balance(self: CrackedTwin, *asked: Any) -> tuple[Any, Any]:
        ready, plan = PairTwin._planned(self, *asked)
        return ready, replace(plan, min_motion_hz=0.0)

    monkeypatch.setattr(CrackedTwin, "_planned", from_the_static_balance)
    broken = made.run(POINT, crack, seed=1, duration_s=0.3, sampling_rate_hz=FS)
    assert difference(going_on, broken) < 0.01 * difference(healthy, broken)


def difference(one: Recording, other: Recording) -> float:
    """Rms of the difference over the rms, of the first channel."""
    a, b = one.samples[0], other.samples[0]
    return float(np.std(a - b) / np.std(a))


def test_the_nominal_point_counts_on_the_driver() -> None:
    """Speed rises by the ratio from the wheel to the pinion, torque falls by it."""
    nominal = nominal_of(RIG)
    assert nominal.speed_rpm == pytest.approx(756.0 * 50 / 21)
    assert nominal.torque_nm == pytest.approx(100.0 * 21 / 50)
    assert nominal.mesh_force_n == pytest.approx(42.0 / 0.021)
    assert nominal.assumed == ()


def test_what_the_rig_does_not_state_is_usual() -> None:
    bare = replace(RIG, pairs=(replace(RIG.pairs[0], face_width_mm=None, pressure_angle_deg=None),))
    nominal = nominal_of(replace(bare, operating_point=OperatingPoint()))
    assert nominal.face_width_mm == 20.0
    assert nominal.pressure_angle_deg == 20.0
    assert set(nominal.assumed) == {"face_width_mm", "pressure_angle_deg", "speed_rpm", "torque_nm"}
    assert nominal.mesh_force_n / (20.0 * 2.0) == pytest.approx(50.0)


@pytest.mark.parametrize(
    ("rig", "named"),
    [
        (replace(RIG, pairs=()), "no gear pair"),
        (replace(RIG, pairs=(replace(RIG.pairs[0], module_mm=None),)), "module_mm"),
        (replace(RIG, pairs=(replace(RIG.pairs[0], driven_teeth=None),), operating_point=OperatingPoint()), "teeth"),
        (replace(RIG, pairs=(replace(RIG.pairs[0], driver_teeth=5),)), "cannot be adapted to this rig"),
        (replace(RIG, operating_point=replace(RIG.operating_point, torque_nm=5e6)), "would break teeth of module 2 mm"),
    ],
)
def test_a_rig_that_does_not_suffice_is_refused(rig: Rig, named: str) -> None:
    with pytest.raises(RefusalError, match=named):
        gap_simulator("cracked").twin_of(rig)


@pytest.mark.parametrize("teeth", [(14, 60), (60, 14), (17, 17), (25, 180), (40, 20)])
@pytest.mark.parametrize("angle_deg", [14.5, 20.0, 25.0, 30.0])
def test_ordinary_gears_can_be_made(teeth: tuple[int, int], angle_deg: float) -> None:
    pair = GearPair("pair", "pinion", "wheel", *teeth, 3.0, angle_deg)
    mesh = machine_of(twin(replace(RIG, pairs=(pair,)))).mesh
    assert (mesh.pair.driver.teeth, mesh.pair.driven.teeth) == teeth
    assert mesh.pair.contact_ratio > 1.1


def machine_of(made: CrackedTwin, *added: AddedEffect):  # type: ignore[no-untyped-def]  # of the machine's room
    return CrackedPair().prepare(SimulationSetup(made.preset(POINT, added)), np.random.default_rng(0)).machine


def test_recordings_have_the_rigs_channels_and_can_be_gathered_with_it() -> None:
    recording = run(duration_s=1.5)
    assert recording.channel_names == ("acc wheel", "acc pinion", "mark")
    positions = [c.position for c in recording.channels[:2]]
    assert positions == ["wheel bearing, horizontal", "over P1, vertical"]
    gathered = reduce_recording(recording, RIG)
    assert gathered.speed_hz == pytest.approx(30.0, rel=1e-3)
    assert gathered.marks == (False, True)
    assert recording.rig is not None
    assert (recording.rig.pairs, recording.rig.bearings) == (RIG.pairs, RIG.bearings)


def test_sensors_sit_where_their_position_says() -> None:
    seats = {s.channel: (s["bearing"], s.get("direction", "vertical")) for s in _sensors(twin())}
    assert seats["acc pinion"] == (1, "vertical")
    assert seats["acc wheel"] == (3, "horizontal")


def _sensors(made: CrackedTwin):  # type: ignore[no-untyped-def]  # rows of a table
    class Row(dict):  # type: ignore[type-arg]
        @property
        def channel(self) -> str:
            return str(self["channel"])

    return [Row(row) for row in made.preset(POINT).installed["sensors"]]


def test_an_encoder_gives_the_speed_without_a_mark() -> None:
    rig = replace(RIG, speed=EncoderChannel("angle", shaft="pinion"))
    recording = twin(rig).run(POINT, seed=0, duration_s=1.5, sampling_rate_hz=FS)
    gathered = reduce_recording(recording, rig)
    assert gathered.marks == (False, False)
    assert gathered.speed_hz == pytest.approx(30.0, rel=1e-3)


@pytest.mark.parametrize(
    "bearing",
    [
        Bearing("b", "s", bpfo_order=3.05, bpfi_order=4.95),
        Bearing("b", "s", bpfo_order=3.58),
        Bearing("b", "s", bpfi_order=5.4),
        Bearing("b", "s"),
    ],
)
def test_a_bearing_gets_a_geometry_with_its_orders(bearing: Bearing) -> None:
    whole = completed_bearing(bearing, 1.5)
    from_geometry = replace(whole, bpfo_order=None, bpfi_order=None).orders()
    for name, order in bearing.orders().items():
        assert whole.orders()[name] == order
        assert from_geometry[name] == pytest.approx(order, rel=0.02)


def test_a_third_bearing_of_a_shaft_takes_part_when_it_is_wanted() -> None:
    more = (*RIG.bearings, Bearing("P2", "pinion", 9, 7.94, 39.04), Bearing("P3", "pinion", 8, 7.94, 39.04))
    made = twin(replace(RIG, bearings=more))
    assert [b.bearing.name for b in machine_of(made).bearings][:3] == ["P1", "P2", "W1"]
    hurt = machine_of(made, AddedEffect("bearing_outer_race", 0.3, {"bearing": "P3"}))
    assert hurt.bearings[0].bearing.name == "P3"
    assert hurt.bearings[0].defect is not None


@pytest.mark.slow
def test_the_same_seed_is_the_same_machine_and_another_noise_another_run() -> None:
    first, again, other = run(), run(), run(seed=1)
    np.testing.assert_array_equal(first.samples, again.samples)
    assert difference(first, other) > 0.1
    made = twin()
    assert made.preset(POINT, seed=1).parameters != made.preset(POINT, seed=0).parameters
    later, later_again = run(noise=1), run(noise=1)
    np.testing.assert_array_equal(later.samples, later_again.samples)
    assert later.n_samples == first.n_samples
    assert difference(first, later) > 1e-3


@cache
def healthy_run() -> Recording:
    return run(noise=2, duration_s=0.1)


@pytest.mark.parametrize("name", list(effects()))
def test_an_effect_that_vanishes_leaves_nothing(name: str) -> None:
    """Common random numbers: what is not the effect is the same to rounding."""
    (first, *_) = twin().candidates(name)
    tiny = replace(first, severity=1e-9 * first.severity)
    assert difference(healthy_run(), run((tiny,), noise=2, duration_s=0.1)) < 1e-5


@pytest.mark.parametrize("name", list(effects()))
def test_candidates_and_draws_lie_in_one_range_and_fit_the_machine(name: str) -> None:
    made, rng = twin(), np.random.default_rng(3)
    candidates = made.candidates(name)
    low, high = min(a.severity for a in candidates), max(a.severity for a in candidates)
    assert high > 4 * low > 0
    drawn = [made.draw(name, rng) for _ in range(8)]
    for added in (*candidates, *drawn):
        machine_of(made, added)
    if name != "root_crack":  # its deepest depends on the drawn angle
        assert all(0.3 * low <= a.severity <= 3.0 * high for a in drawn)
    one = [a.severity for a in candidates if a.options == candidates[0].options]
    np.testing.assert_allclose(np.diff(np.log(one)), np.log(one[1] / one[0]), rtol=2e-3)
    assert len(one) <= 4


@pytest.mark.parametrize(
    ("name", "option", "values"),
    [("tooth_spall", "length_mm", 8), ("chipped_tooth", "width_percent", 3), ("pitch_error", "tooth", 1)],
)
def test_faults_of_teeth_are_tried_with_further_settings_beside_the_candidates(
    name: str, option: str, values: int
) -> None:
    made = twin()
    settings, candidates = made.further_settings(name), made.candidates(name)
    assert len({a.options[option] for a in settings}) == values
    assert {a.options["gear"] for a in settings} == {"driver", "driven"}
    assert min(a.severity for a in settings) >= min(a.severity for a in candidates)
    assert max(a.severity for a in settings) <= max(a.severity for a in candidates)
    assert not any(a in candidates for a in settings)
    for added in settings:
        machine_of(made, added)


def test_chips_are_tried_at_even_steps_of_height() -> None:
    settings = [*twin().candidates("chipped_tooth"), *twin().further_settings("chipped_tooth")]
    for width in (35.0, 85.0, 100.0):
        heights = sorted(
            a.severity for a in settings if (a.options["width_percent"], a.options["gear"]) == (width, "driver")
        )
        step = (heights[-1] - heights[0]) / 7
        np.testing.assert_allclose(np.diff(heights), step, rtol=2e-3 if width != 85.0 else 0.25)


def test_effects_but_faults_of_teeth_have_no_further_settings() -> None:
    assert {name for name in effects() if twin().further_settings(name)} == {
        "tooth_spall",
        "chipped_tooth",
        "pitch_error",
    }
    pitch = {(added.options["gear"], added.options["stands"]) for added in twin().further_settings("pitch_error")}
    assert pitch == {(gear, way) for gear in ("driven", "driver") for way in ("ahead", "behind")}


def test_every_effect_is_offered_to_the_gap_diagnosis() -> None:
    assert set(effects()) == set(gap_simulator("cracked").gap_effects())


def test_candidates_name_the_rigs_bearings_only() -> None:
    names = {a.options["bearing"] for a in twin().candidates("bearing_inner_race")}
    assert names == {"P1", "W1"}
    none = twin(replace(RIG, bearings=()))
    assert list(none.candidates("bearing_inner_race")) == []
    with pytest.raises(RefusalError, match="bearings"):
        none.draw("bearing_clearance", np.random.default_rng(0))


def test_drawn_pitch_errors_are_of_all_teeth_or_of_one_either_way() -> None:
    rng, made = np.random.default_rng(3), twin()
    drawn = [dict(made.draw("pitch_error", rng).options) for _ in range(300)]
    assert len([one for one in drawn if "tooth" in one]) == pytest.approx(100, abs=25)
    assert {one["stands"] for one in drawn if "tooth" in one} == {"behind", "ahead"}
    assert {one["gear"] for one in drawn} == {"driver", "driven"}


def test_cracks_scale_with_the_tooth() -> None:
    large = twin(replace(RIG, pairs=(replace(RIG.pairs[0], module_mm=3.0, face_width_mm=27.0),)))
    small = [a.severity for a in twin().candidates("root_crack")]
    np.testing.assert_allclose([a.severity for a in large.candidates("root_crack")], 1.5 * np.array(small), rtol=1e-3)


def test_an_effect_that_does_not_exist_is_named() -> None:
    with pytest.raises(InputError, match="did you mean root_crack"):
        twin().candidates("root_crak")
    with pytest.raises(InputError, match="did you mean cracked"):
        gap_simulator("craked")


def test_a_twin_pickles_and_its_key_follows_what_is_known_of_the_rig() -> None:
    made: Twin = twin()
    made.candidates("mains_hum")
    assert pickle.loads(pickle.dumps(made)).key == made.key  # noqa: S301  just made
    assert twin(replace(RIG, name="other", sources=("page 3",))).key == made.key
    assert twin(replace(RIG, bearings=())).key != made.key


ADDED = (
    AddedEffect("root_crack", 2.0, {"gear": "driven", "tooth": 7.0}),
    AddedEffect("pitch_error", 4.0, {"gear": "driver"}),
    AddedEffect("bearing_outer_race", 0.4, {"bearing": "W1"}),
)


@pytest.mark.slow
def test_the_preset_gives_the_twins_mesh_levels(tmp_path: Path) -> None:
    """The twin's step is longer than that of a single simulation; nothing else differs."""
    file = tmp_path / "twin.toml"
    file.write_text(twin().preset_toml(POINT, ADDED, ["fitted to a.h5"], seed=3), encoding="utf-8")
    assert "seed 3" in file.read_text(encoding="utf-8")
    again = simulate("cracked", preset=str(file), seed=3, duration_s=1.0)
    own = run(ADDED, seed=3, duration_s=1.0)
    assert again.channel_names == own.channel_names
    assert difference(own, again) < 0.02
    for channel in range(2):
        np.testing.assert_allclose(_mesh_db(own, channel), _mesh_db(again, channel), atol=0.05)
    assert again.truth is not None
    assert [e["name"] for e in again.truth["effects"]] == [a.name for a in ADDED]


def _mesh_db(recording: Recording, channel: int) -> np.ndarray:
    """Levels of the first four mesh harmonics."""
    lines = np.abs(np.fft.rfft(recording.samples[channel] * np.hanning(recording.n_samples)))
    mesh = POINT.speed_rpm / 60.0 * 21 * recording.duration_s
    levels = [20 * np.log10(lines[round(k * mesh) - 8 : round(k * mesh) + 9].max()) for k in range(1, 5)]
    assert all(isfinite(level) for level in levels)
    return np.array(levels)


def test_severities_of_the_protocol_are_those_of_the_effects() -> None:
    for name, seen in gap_simulator("cracked").gap_effects().items():
        own = effect(name)
        assert (seen.severity_name, seen.unit, seen.group) == (own.severity.name, own.severity.unit, own.group)
        assert seen.is_nuisance == (own.group == "measurement chain")


def test_further_sensors_sit_over_the_bearings_that_have_none_and_leave_the_machine_as_it_is() -> None:
    more, places = twin().with_further_sensors()
    assert list(places.values()) == [
        "the free end of the pinion shaft, vertical",
        "the free end of the wheel shaft, vertical",
    ]
    recording = more.run(POINT, seed=0, duration_s=0.3, sampling_rate_hz=FS)
    assert recording.vibration_names() == ("acc wheel", "acc pinion", *places)
    assert {c.name: c.position for c in recording.channels if c.name in places} == places
    assert difference(recording, run()) < 0.1  # the noise is another one
    assert more.key != twin().key
    assert more.with_further_sensors()[1] == places


def driver_orders(added: AddedEffect, machine: CrackedTwin) -> np.ndarray:
    """Peak accelerations of the driver's orders on the sensor over it, in m/s²."""
    recording = machine.run(POINT, (added,), seed=0, noise=1, duration_s=2.0, sampling_rate_hz=FS)
    return np.abs(reduce_recording(recording, machine.rig, ["acc pinion"]).channels["acc pinion"].lines[0].mean(axis=0))


def order_one(unbalance_g_mm: float, machine: CrackedTwin) -> float:
    """Of the driver, in m/s²."""
    return float(driver_orders(AddedEffect("unbalance", unbalance_g_mm, {"gear": "driver"}), machine)[1])


def test_a_quiet_machine_has_no_resonances_that_were_drawn() -> None:
    highest_hz = [
        max(mode["frequency_hz"] for mode in made.preset(POINT).installed["modes"]) for made in (twin(), twin().quiet())
    ]
    assert highest_hz[0] > 600.0
    assert highest_hz[1] < 10.0  # that of its mounts


@pytest.mark.slow
def test_on_its_mounts_a_quiet_machine_shakes_as_force_over_mass_and_in_proportion_to_an_unbalance() -> None:
    quiet = twin().quiet()
    little, much = (order_one(u, quiet) for u in (80.0, 320.0))
    assert much / little == pytest.approx(4.0, rel=0.05)  # its own unbalance does not weigh against it
    force_n = 320e-6 * (2.0 * np.pi * POINT.speed_rpm / 60.0) ** 2
    body_kg = BODY_KG * quiet.nominal.size**2
    assert force_n / body_kg / 3.0 < much < 3.0 * force_n / body_kg
    assert order_one(320.0, twin()) < 0.05 * much  # on rigid ground


@pytest.mark.slow
def test_on_its_mounts_a_quiet_machine_pitches_under_a_coupling_s_moment_twice_a_turn() -> None:
    quiet = twin().quiet()
    slight, strong = (
        driver_orders(AddedEffect("misalignment", beta, {"shaft": "driver"}), quiet) for beta in (1.0, 4.0)
    )
    assert strong[2] / slight[2] == pytest.approx(4.0, rel=0.05)
    # β T/(2 l) on either bearing of the driver, turning as 1 + cos 2θ; a = F l/2/(M (l/2)²) · l/2 for both together.
    distance_m = 1e-3 * float(quiet.preset(POINT).parameters["bearing_distance_mm"])
    force_n = np.radians(4.0) * POINT.torque_nm / (2.0 * distance_m)
    expected = 2.0 * force_n / (BODY_KG * quiet.nominal.size**2)
    assert expected / 3.0 < strong[2] < 3.0 * expected
    assert max(strong[1], strong[3]) < 0.02 * strong[2]  # nor does the start leave anything on other orders
    assert driver_orders(AddedEffect("misalignment", 4.0, {"shaft": "driver"}), twin())[2] < 0.05 * strong[2]


def test_a_quiet_machine_s_gears_are_nearly_even() -> None:
    quiet, usual = (machine.preset(POINT).parameters for machine in (twin().quiet(), twin()))
    assert quiet["noise_mps2"] == quiet["sensor_noise_mps2_per_sqrt_hz"] == 0.0
    for name in ("pitch_deviation_um", "runout_driver_um", "unbalance_driven_g_mm"):
        assert 0.0 < quiet[name] < 0.02 * usual[name]
    assert quiet["tip_relief_um"] == usual["tip_relief_um"]
