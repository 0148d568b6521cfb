"""Motion of a pair from channels: roles, units, derivatives of stated bandwidth, faults that are told."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError, RefusalError
from gearsig.motion import LocalPolynomial, check_angle, find_roles, local_polynomial, measure_motion
from gearsig.recording import Channel, Recording
from gearsig.rig import EncoderChannel
from tests.motion.recordings import changed, start_stop, without


def test_channels_find_their_roles_by_quantity_position_and_name() -> None:
    recording = start_stop()
    assert recording.rig is not None
    roles = find_roles(recording, recording.rig.pairs[0])
    assert roles["driver angle"] == "pinion angle"
    assert roles["driven acceleration"] == "wheel acceleration"
    assert roles["torque"] == "torque"
    assert roles["force"] == "interaction force"
    assert "force" not in find_roles(recording, recording.rig.pairs[0], {"force": ""})


def test_what_is_measured_is_taken_and_what_is_missing_is_derived_and_said() -> None:
    full = measure_motion(start_stop(quiet=True))
    assert full.methods["driven speed"] == "channel 'wheel speed'"
    bare = measure_motion(without(start_stop(quiet=True), "pinion speed", "wheel speed", "pinion acceleration",
                                  "wheel acceleration"))  # fmt: skip
    assert bare.methods["driver speed"].startswith("derivative of the angle: Savitzky–Golay, cubic over 7 samples")
    assert bare.methods["driven acceleration"].startswith("second derivative of the angle")
    smooth = (full.time_s > 0.3) & (full.time_s < 0.9)
    assert bare.driven_speed_rad_s[smooth] == pytest.approx(full.driven_speed_rad_s[smooth], abs=2e-3)
    from_speed = measure_motion(without(start_stop(quiet=True), "pinion acceleration"))
    assert from_speed.methods["driver acceleration"].startswith("derivative of the speed")


def test_a_missing_angle_is_the_sum_of_the_speed() -> None:
    full = measure_motion(start_stop(quiet=True))
    summed = measure_motion(without(start_stop(quiet=True), "wheel angle"))
    assert summed.driven_angle_rad == pytest.approx(full.driven_angle_rad, abs=2e-3)
    assert any("offset" in note for note in summed.notes)


@pytest.mark.parametrize("bandwidth_hz", [150.0, 60.0, 12.0])
def test_the_stated_bandwidth_halves_the_power_of_a_sine(bandwidth_hz: float) -> None:
    smoother = local_polynomial(1000.0, bandwidth_hz)
    assert 0.75 * bandwidth_hz < smoother.bandwidth_hz <= bandwidth_hz
    t = np.arange(4000) / 1000.0
    wave = np.sin(2.0 * np.pi * smoother.bandwidth_hz * t)
    inner = slice(500, -500)
    assert np.std(smoother.apply(wave)[inner]) / np.std(wave[inner]) == pytest.approx(np.sqrt(0.5), abs=2e-3)


@given(st.lists(st.floats(-3.0, 3.0), min_size=4, max_size=4), st.integers(3, 12))
def test_derivatives_of_cubics_are_exact(coefficients: list[float], half: int) -> None:
    t = np.arange(60) / 50.0
    curve = np.polynomial.Polynomial(coefficients)
    smoother = LocalPolynomial(2 * half + 1, 50.0)
    for order in (0, 1, 2):
        expected = curve.deriv(order)(t) if order else curve(t)
        assert smoother.apply(curve(t), order) == pytest.approx(expected, abs=1e-7)


def test_degrees_and_rpm_are_understood() -> None:
    full = start_stop(quiet=True)
    samples = np.array(full.samples)
    samples[full.index("wheel angle")] *= 180.0 / np.pi
    samples[full.index("wheel speed")] *= 30.0 / np.pi
    units = {"wheel angle": "deg", "wheel speed": "rpm"}
    channels = tuple(replace(c, unit=units.get(c.name, c.unit)) for c in full.channels)
    other = measure_motion(replace(full, samples=samples, channels=channels))
    motion = measure_motion(full)
    assert other.driven_angle_rad == pytest.approx(motion.driven_angle_rad)
    assert other.driven_speed_rad_s == pytest.approx(motion.driven_speed_rad_s)


def test_an_encoder_that_wraps_is_an_error_until_it_is_said() -> None:
    recording = start_stop()
    wrapped = changed(recording, "pinion angle", np.mod(recording.values("pinion angle"), 2.0 * np.pi))
    with pytest.raises(InputError, match=r"pinion angle.*starts again.*--unwrap"):
        measure_motion(wrapped)
    plain = measure_motion(recording)
    turned = plain.driver_angle_rad - plain.driver_angle_rad[0]
    for motion in (
        measure_motion(wrapped, unwrap=True),
        measure_motion(replace(wrapped, speed=EncoderChannel("pinion angle", 2.0 * np.pi, wraps=True, shaft="pinion"))),
    ):
        assert motion.driver_angle_rad - motion.driver_angle_rad[0] == pytest.approx(turned, abs=1e-9)
        assert any("unwrapped" in note for note in motion.notes)


@pytest.mark.parametrize("jump_rad", [0.02, -0.3, 2.0])
@pytest.mark.parametrize("at", [700, 2700])
def test_an_angle_that_jumps_is_an_error_with_its_time(jump_rad: float, at: int) -> None:
    recording = start_stop()
    values = np.array(recording.values("wheel angle"))
    values[at:] += jump_rad
    with pytest.raises(InputError, match=f"wheel angle.*jumps.*{at / 1000.0:g} s"):
        measure_motion(changed(recording, "wheel angle", values))


@pytest.mark.parametrize("counts", [360, 4096, 2**20])
def test_a_coarse_encoder_does_not_jump(counts: int) -> None:
    for rate_hz in (1000.0, 10_000.0):
        angle = start_stop(rate_hz=rate_hz, quiet=True).values("pinion angle")
        step = 2.0 * np.pi / counts
        check_angle(np.floor(angle / step) * step, rate_hz, "enc")


def test_a_wheel_that_counts_the_other_way_is_told() -> None:
    recording = start_stop()
    with pytest.raises(InputError, match=r"in the opposite direction.*scale = -1"):
        measure_motion(changed(recording, "wheel angle", -recording.values("wheel angle")))
    with pytest.raises(InputError, match="20 and 100 teeth"):
        measure_motion(changed(recording, "wheel angle", 1.2 * recording.values("wheel angle")))


def test_what_cannot_be_known_is_refused() -> None:
    recording = start_stop()
    with pytest.raises(RefusalError, match="neither angle nor speed of the driven gear"):
        measure_motion(without(recording, "wheel angle", "wheel speed"))
    with pytest.raises(RefusalError, match=r"no \[contact\]"):
        measure_motion(replace(recording, rig=replace(recording.rig, contact=None)))
    with pytest.raises(RefusalError, match="no rig"):
        measure_motion(replace(recording, rig=None))


def test_unclear_roles_are_asked_for() -> None:
    recording = start_stop()
    twice = Recording(
        np.vstack([recording.samples, recording.values("wheel angle")]),
        1000.0,
        (*recording.channels, Channel("wheel angle 2", "angle", "rad", "wheel")),
        rig=recording.rig,
    )
    with pytest.raises(InputError, match="could each be the driven angle"):
        measure_motion(twice)
    assert (
        measure_motion(twice, use={"driven angle": "wheel angle 2"}).methods["driven angle"]
        == "channel 'wheel angle 2'"
    )
    with pytest.raises(InputError, match="did you mean driven angle"):
        measure_motion(recording, use={"driven angel": "wheel angle"})
    with pytest.raises(InputError, match="unit"):
        measure_motion(recording, use={"driven angle": "torque"})
