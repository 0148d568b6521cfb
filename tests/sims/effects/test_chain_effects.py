"""Effects on the measurement chain: a mode of the promised height, hum, clipping of the promised share."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.errors import InputError
from sims.effects import effect
from sims.machine import Machine
from sims.measure import Accelerometer, MainsHum, MeasuredChannel, ModalPath, Motion, PathMode
from tests.sims.machines import spur_pair_machine


def apply(machine: Machine, name: str, severity: float, seed: int = 0, **options: float | str) -> Machine:
    return effect(name).apply(machine, severity, options, np.random.default_rng(seed))


def with_channel(**fields: object) -> Machine:
    machine = spur_pair_machine()
    channel = replace(machine.chain.channels[0], **fields)  # type: ignore[arg-type]
    return replace(machine, chain=replace(machine.chain, channels=(channel,)))


def only_channel(machine: Machine) -> MeasuredChannel:
    (channel,) = machine.chain.channels
    return channel


@given(st.floats(0.5, 50.0), st.floats(0.005, 0.2))
def test_a_mode_adds_the_severity_at_its_frequency(severity: float, damping: float) -> None:
    before = only_channel(spur_pair_machine()).path
    after = only_channel(
        apply(spur_pair_machine(), "transfer_path", severity, frequency_hz=2500.0, damping_ratio=damping)
    ).path
    for position, gain in before.direct.items():
        added = after.response(np.array([2500.0]), position) - before.response(np.array([2500.0]), position)
        assert abs(added[0]) == pytest.approx(severity * gain)
        far_above = after.response(np.array([250e3]), position)
        assert abs(far_above[0]) == pytest.approx(gain, rel=1e-2)


def test_a_path_of_modes_alone_is_scaled_by_its_gain_far_below() -> None:
    machine = with_channel(path=ModalPath(modes=(PathMode(800.0, 0.05, {"bearing 1 y": 0.5}),)))
    added = only_channel(apply(machine, "transfer_path", 10.0, damping_ratio=0.05)).path.modes[1]
    assert added.gains == pytest.approx({"bearing 1 y": 0.5})


def test_hum_adds_to_the_hum_there_is() -> None:
    machine = with_channel(hum=MainsHum((0.5,), 50.0, 1.0))
    hum = only_channel(apply(machine, "mains_hum", 2.0, harmonics_percent=10.0)).hum
    assert hum.amplitudes_mps2 == pytest.approx((2.5, 0.2, 0.2))
    assert (hum.frequency_hz, hum.phase_rad) == (50.0, 1.0)


def test_two_mains_frequencies_are_refused() -> None:
    with pytest.raises(InputError, match=r"already has hum of 50 Hz.*give frequency_hz=50"):
        apply(with_channel(hum=MainsHum((0.5,), 50.0)), "mains_hum", 2.0, frequency_hz=60.0)
    sixty = only_channel(apply(spur_pair_machine(), "mains_hum", 2.0, frequency_hz=60.0)).hum
    assert sixty.frequency_hz == 60.0


@given(st.floats(0.1, 50.0), st.integers(0, 100))
def test_the_promised_share_of_the_time_is_clipped(percent: float, seed: int) -> None:
    x = np.random.default_rng(seed).standard_normal(20_000)
    sensor = only_channel(apply(spur_pair_machine(), "clipping", percent)).accelerometer
    out = sensor.read(x, np.arange(len(x)) * 1e-4, np.random.default_rng(0))
    held = np.abs(out) >= np.abs(out).max() * (1 - 1e-12)
    assert 100 * held.mean() == pytest.approx(percent, abs=0.02)
    np.testing.assert_array_equal(out[~held], x[~held])


def test_the_share_is_that_of_the_recording_not_of_its_lead_in() -> None:
    time_s = np.arange(-10_000, 10_000) * 1e-4
    x = np.where(time_s < 0, 100.0, 1.0) * np.sin(2 * np.pi * 7.3 * time_s)
    out = Accelerometer(clip_percent=10.0).read(x, time_s, np.random.default_rng(0))
    assert np.abs(out).max() == pytest.approx(np.sin(0.9 * np.pi / 2), rel=1e-3)  # |sin| is below that for 90 %


def test_a_range_of_its_own_stays_a_limit() -> None:
    machine = with_channel(accelerometer=Accelerometer(range_mps2=0.2))
    x = np.linspace(-1.0, 1.0, 1001)
    sensor = only_channel(apply(machine, "clipping", 10.0)).accelerometer
    assert np.abs(sensor.read(x, np.arange(1001.0), np.random.default_rng(0))).max() == 0.2
    wide = replace(sensor, range_mps2=5.0)
    assert np.abs(wide.read(x, np.arange(1001.0), np.random.default_rng(0))).max() == pytest.approx(0.9, abs=2e-3)


def test_clipping_clipped_signals_keeps_the_lower_limit() -> None:
    machine = apply(apply(spur_pair_machine(), "clipping", 10.0), "clipping", 4.0)
    assert only_channel(machine).accelerometer.clip_percent == 10.0


def test_a_share_beyond_the_range_is_refused() -> None:
    with pytest.raises(InputError, match="clip_percent"):
        Accelerometer(clip_percent=51.0)


def test_the_chain_records_with_all_of_them() -> None:
    """Hum stands in the recording at its amplitude, and clipping cuts the machine's part, not the hum's."""
    machine = spur_pair_machine(sampling_rate_hz=10240.0)
    for name, severity in (("mains_hum", 2.0), ("clipping", 20.0)):
        machine = apply(machine, name, severity)
    step_s = 1 / 102400.0
    t = np.arange(round(1.2 / step_s)) * step_s
    vibration = np.sin(2 * np.pi * 320.0 * t)
    motion = Motion(
        step_s,
        ("bearing 1 x", "bearing 1 y"),
        np.column_stack((np.zeros_like(t), vibration / np.cos(np.radians(20.0)))),
        {"input": 2 * np.pi * 10.0 * t},
    )
    recording = machine.chain.record(motion, rng=np.random.default_rng(0), duration_s=1.0)
    lines = 2 * np.abs(np.fft.rfft(recording.samples[0])) / recording.n_samples
    assert lines[[50, 100, 150]] == pytest.approx([2.0, 0.5, 0.5], rel=1e-3)
    # A sine cut at sin(α): first harmonic (2/π)(α + sin α cos α), third below it but clearly there.
    alpha = 0.8 * np.pi / 2
    assert lines[320] == pytest.approx(2 / np.pi * (alpha + np.sin(alpha) * np.cos(alpha)), rel=1e-3)
    assert lines[960] > 0.01
