"""Modes of channels, of signals over angle, of envelopes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.decompose import Modes, VmdSettings, vmd
from gearsig.recording import Channel, Recording, read_recording
from gearsig.spectra import Envelope, band_envelope

FS = 10_000.0
TIME = np.arange(20_000) / FS
MODULATION = 1 + 0.5 * np.cos(2 * np.pi * 20 * TIME) + 0.3 * np.cos(2 * np.pi * 90 * TIME)
MODULATED = 2.0 * MODULATION * np.cos(2 * np.pi * 3000 * TIME)
DATA = Path(__file__).parents[3] / "shared" / "data" / "bearing_races"


def _recording(*rows: np.ndarray) -> Recording:
    names = [Channel(f"a{i + 1}", "acceleration", "g") for i in range(len(rows))]
    return Recording(np.stack(rows), FS, tuple(names))


def test_a_channels_modes_carry_its_name_and_unit():
    x = np.cos(2 * np.pi * 200 * TIME) + 0.5 * np.cos(2 * np.pi * 2000 * TIME)
    modes = vmd(_recording(MODULATED, x), "a2", 2)
    assert modes.centres == pytest.approx([200.0, 2000.0], abs=1.0)
    assert (modes.source, modes.unit, modes.sampling_rate) == ("a2", "g", FS)
    assert modes.rms == pytest.approx([0.707, 0.354], abs=0.01)
    assert modes.positions[-1] == pytest.approx(TIME[-1])


def test_over_angle_the_centres_are_orders():
    n = 256 * 80
    revolutions = np.arange(n) / 256
    x = np.cos(2 * np.pi * 23 * revolutions) + 0.5 * np.cos(2 * np.pi * 4 * revolutions)
    angle = ShaftAngle("input", np.array([0.0, 10.0]), np.array([0.0, 80.0]), np.array([4.0, 12.0]), "constant")
    signal = AngleSignal(x[None, :], 256, angle, 0.0, ("a1",), ("m/s^2",), 100.0)
    modes = vmd(signal, "a1", VmdSettings(2, start=(4.0, 23.0)))
    assert modes.centres == pytest.approx([4.0, 23.0], abs=0.05)
    assert (modes.axis, modes.shaft, modes.unit) == ("order", "input", "m/s^2")


def envelope_modes(envelope: Envelope, settings: VmdSettings) -> Modes:
    return vmd(envelope.values - envelope.values.mean(), envelope.sampling_rate_hz, settings)


def test_modes_of_the_envelope_are_its_modulations():
    envelope = band_envelope(MODULATED, FS, (2700, 3300), kind="magnitude", unit="g", source="a1")
    modes = envelope_modes(envelope, VmdSettings(2, start="peaks"))
    assert modes.centres == pytest.approx([20.0, 90.0], abs=0.5)
    assert modes.rms * np.sqrt(2) == pytest.approx([1.0, 0.6], abs=0.02)


@pytest.mark.skipif(not DATA.exists(), reason="no measured data beside the checkout")
def test_the_outer_race_shows_in_a_mode_of_the_measured_envelope():
    path = next(p for p in sorted(DATA.iterdir()) if "outer" in p.name.lower())
    recording = read_recording(path)
    name = recording.vibration_names()[0]
    settings = VmdSettings(4, penalty=20_000.0, start="peaks")
    envelope = band_envelope(recording.values(name), recording.sampling_rate_hz, (2000, 2600), kind="magnitude")
    modes = envelope_modes(envelope, settings)
    assert np.abs(modes.centres - 81.125).min() < 4.0
