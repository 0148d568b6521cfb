"""The path to the sensors by a run-up: a known resonance is found, and what measures nothing does no harm."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.gap import SIDEBAND_OFFSETS as OFFSETS
from gearsig.gap import MeasuredPath, OperatingCondition, gear_frame, measured_path, reduce_recording
from gearsig.prepared import PreparedRecording
from gearsig.recording import Channel, Recording
from gearsig.rig import ConstantSpeed, PulseTimes, SpeedSource
from tests.gap.synthetic import RIG, TEETH

RATE_HZ, N_HARMONICS = 10240.0, 8
RESONANCE_HZ, DAMPING = 1100.0, 0.04


def housing(frequency_hz: FloatArray) -> FloatArray:
    """A sensor on a bearing, and one mode of the housing that it shakes."""
    ratio = frequency_hz / RESONANCE_HZ
    return np.asarray(1.0 + 0.3 / (1.0 - ratio**2 + 2j * DAMPING * ratio))


def run_up(
    from_hz: float, to_hz: float, *, duration_s: float = 10.0, hears: bool = True, seed: int = 0, is_passed: bool = True
) -> Recording:
    """Mesh harmonics of a shaft whose speed rises evenly, through the housing or not, each excited in its own way."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(RATE_HZ * duration_s)) / RATE_HZ
    turned = from_hz * time + 0.5 * (to_hz - from_hz) / duration_s * time**2
    speed = from_hz + (to_hz - from_hz) / duration_s * time
    excitation = rng.uniform(0.5, 2.0, N_HARMONICS) * np.exp(2j * np.pi * rng.uniform(size=N_HARMONICS))
    samples = 0.02 * rng.standard_normal(len(time))
    for k, excited in enumerate(excitation, 1):
        response = housing(k * TEETH[0] * speed) if is_passed else 1.0
        samples += hears * np.real(excited * response * np.exp(2j * np.pi * k * TEETH[0] * turned))
    pulses = np.interp(np.arange(np.floor(turned[-1]) + 1), turned, time)
    source: SpeedSource = PulseTimes(pulses, 1, shaft="in")
    channels = (Channel("a1", "acceleration", "m/s^2"),)
    return Recording(samples[None], RATE_HZ, channels, speed=source, rig=RIG).with_name("run-up")


class Rigid:
    """A twin without a housing."""

    point = OperatingCondition(1500.0, 20.0)

    def run_up(self, from_rpm: float, to_rpm: float, _torque_nm: float, **how: float) -> Recording:
        return run_up(from_rpm / 60.0, to_rpm / 60.0, duration_s=how["duration_s"], seed=1, is_passed=False)


def measured(recording: Recording) -> MeasuredPath:
    return measured_path(PreparedRecording(recording), Rigid(), seed=0)  # type: ignore[arg-type]  # all that it asks of a twin


@cache
def rising() -> MeasuredPath:
    return measured(run_up(8.0, 26.0))


def test_a_resonance_that_the_twin_lacks_is_found_and_bends_what_passes_it() -> None:
    path, frame, speed_hz = rising(), gear_frame(RIG), 16.0
    assert path.facts.credibility["a1"] > 0.9
    assert path.facts.low_hz < 8.0 * 23 * 1.2 < 0.8 * 0.4 * RATE_HZ < path.facts.high_hz
    factors = path.of_sidebands(["a1", "not there"], frame, speed_hz)
    mesh_hz = speed_hz * TEETH[0] * np.arange(1, 8 + 1)[:, None]
    expected = np.stack([housing(mesh_hz + hz * OFFSETS) / housing(mesh_hz) for hz in (16.0, 16.0 * 23 / 37)])
    assert np.abs(np.log(expected)).max() > 1.2  # about the third harmonic, at 1104 Hz
    np.testing.assert_allclose(factors[0], expected, rtol=0.2)
    np.testing.assert_array_equal(factors[1], 1.0)


def test_a_run_up_of_another_machine_is_noticed_by_the_reference() -> None:
    path = rising()
    own, other = (reduce_recording(run_up(16.0, 16.0, duration_s=1.5, seed=seed)) for seed in (0, 3))
    assert path.missed_db(own) < 0.5
    assert path.missed_db(other) > 3.0
    assert np.isnan(path.missed_db(reduce_recording(run_up(30.0, 30.0, duration_s=1.5))))  # through no such speed


def test_what_does_not_repeat_over_harmonics_is_no_path_and_does_no_harm() -> None:
    path = measured(run_up(8.0, 26.0, hears=False))
    assert path.facts.credibility["a1"] < 0.1
    factors = path.of_sidebands(["a1"], gear_frame(RIG), 16.0)
    assert np.abs(np.log(factors)).max() < 0.3


def test_a_steady_run_and_one_whose_angle_nothing_tells_are_refused() -> None:
    with pytest.raises(InputError, match="from 1202 to 1436 rpm"):
        measured(run_up(20.0, 24.0))
    recording = run_up(8.0, 26.0)
    with pytest.raises(RefusalError, match="no shaft's angle is known"):
        measured(Recording(recording.samples, RATE_HZ, recording.channels, speed=ConstantSpeed(960.0), rig=RIG))
    with pytest.raises(RefusalError, match="cannot run up"):
        measured_path(PreparedRecording(recording), object(), seed=0)  # type: ignore[arg-type]
