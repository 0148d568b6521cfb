"""Band envelopes against closed forms and scipy's Hilbert transform."""

import numpy as np
import pytest
from scipy import signal as scipy_signal

from gearsig.errors import InputError
from gearsig.prepared import PreparedRecording
from gearsig.recording import Channel, Provenance, Recording
from gearsig.spectra import band_envelope, edged_band, envelope_recording, envelope_spectrum

FS, N = 10_000.0, 20_000
T = np.arange(N) / FS
MODULATED = 2.0 * (1 + 0.5 * np.cos(2 * np.pi * 20 * T)) * np.cos(2 * np.pi * 3000 * T + 0.4)


def test_magnitude_of_an_amplitude_modulated_tone_is_its_amplitude():
    envelope = band_envelope(MODULATED, FS, (2800, 3200), kind="magnitude")
    t = np.arange(len(envelope.values)) / envelope.sampling_rate_hz
    assert envelope.values == pytest.approx(2.0 * (1 + 0.5 * np.cos(2 * np.pi * 20 * t)), abs=1e-9)
    assert envelope.sampling_rate_hz < FS / 5


@pytest.mark.parametrize("highest_hz", [None, 1500.0])
def test_a_drift_whose_ends_do_not_meet_makes_no_click(highest_hz):
    x = np.sin(2 * np.pi * 5000.0 * np.arange(1 << 18) / 25_600.0) + np.linspace(0.0, 1e3, 1 << 18)
    envelope = band_envelope(x, 25_600.0, (1859, 11_520), kind="magnitude", highest_hz=highest_hz)
    assert envelope.values == pytest.approx(1.0, abs=1.0)  # what is cut of the sine itself
    assert envelope.values[200:-200] == pytest.approx(1.0, abs=0.02)
    assert (envelope.sampling_rate_hz < 5000.0) == (highest_hz is not None)  # by blocks, or all at once


def test_squared_envelope_spectrum_has_the_closed_form_lines():
    spectrum = envelope_spectrum(band_envelope(MODULATED, FS, (2800, 3200), unit="m/s^2"), highest_hz=100.0)
    # 4 (1 + cos/2)² = 4.5 + 4 cos(20 Hz) + 0.5 cos(40 Hz)
    at = [spectrum.values[spectrum.index_of(f)] for f in (0.0, 20.0, 40.0, 60.0)]
    assert at == pytest.approx([0.0, 4.0, 0.5, 0.0], abs=1e-9)
    assert spectrum.unit == "(m/s^2)^2"
    assert spectrum.positions[-1] <= 100.0


@pytest.mark.parametrize("n", [4096, 4097])
def test_brick_wall_over_everything_is_the_hilbert_envelope(n):
    x = np.random.default_rng(0).normal(size=n)
    lines = np.fft.rfft(x)
    lines[0] = 0
    if n % 2 == 0:
        lines[-1] = 0  # neither DC nor Nyquist has an envelope
    x = np.fft.irfft(lines, n)
    envelope = band_envelope(x, 1.0, (0.0, 0.5), kind="squared", edge_fraction=0.0)
    exact = np.abs(scipy_signal.hilbert(x)) ** 2
    assert envelope.values.mean() == pytest.approx(exact.mean(), rel=1e-12)
    # The new grid holds every line of |z|², so that both agree line by line.
    ours, theirs = np.fft.rfft(envelope.values) / len(envelope.values), np.fft.rfft(exact) / n
    assert np.abs(ours[: n // 4] - theirs[: n // 4]).max() < 1e-10 * exact.mean()


def test_tone_outside_the_band_is_gone():
    x = MODULATED + 5.0 * np.sin(2 * np.pi * 1000 * T)
    a, b = (band_envelope(v, FS, (2800, 3200)).values for v in (x, MODULATED))
    assert a == pytest.approx(b, abs=1e-9)


def test_envelope_recording_keeps_names_and_says_what_was_done():
    recording = Recording(
        np.stack([MODULATED, np.zeros(N)]),
        FS,
        (Channel("a", "acceleration", "g", "top"), Channel("tach", "tachometer", "V")),
        provenance=Provenance(source="x.csv"),
    )
    envelope = envelope_recording(recording, (2800, 3200))
    assert envelope.channel_names == ("a",)
    assert envelope.channels[0].unit == "g^2"
    assert envelope.duration_s == pytest.approx(recording.duration_s)
    assert "2800" in envelope.provenance.history[-1]


@pytest.mark.parametrize("band", [(3000, 2000), (0, 6000), (-5, 100), (100.0, 100.5)])
def test_impossible_bands_are_refused(band):
    with pytest.raises(InputError, match="band"):
        band_envelope(MODULATED, FS, band)


def test_slow_modulations_are_the_same_by_overlapping_blocks_and_all_at_once():
    rate_hz, n = 25_600.0, 1 << 20
    time_s = np.arange(n) / rate_hz
    x = np.random.default_rng(2).normal(size=n) * (1 + 0.5 * np.cos(2 * np.pi * 87.5 * time_s))
    band_hz, highest_hz = (1859.0, 11520.0), 1500.0
    whole = band_envelope(x, rate_hz, band_hz, kind="magnitude")
    blocks = band_envelope(x, rate_hz, band_hz, kind="magnitude", highest_hz=highest_hz)
    assert 3 * highest_hz <= blocks.sampling_rate_hz < whole.sampling_rate_hz / 4
    assert len(blocks.values) == round(n * blocks.sampling_rate_hz / rate_hz)
    ours, theirs = (np.fft.rfft(e.values)[: int(highest_hz * n / rate_hz)] / len(e.values) for e in (blocks, whole))
    # A magnitude's spectrum has no end: what lies beyond half the rate of either is mirrored, 49 dB lower.
    assert np.linalg.norm(ours - theirs) < 0.007 * np.linalg.norm(theirs[1:])
    assert ours[0] == pytest.approx(theirs[0], rel=1e-5)


def test_short_records_and_narrow_bands_keep_all_of_the_envelope():
    x = np.random.default_rng(2).normal(size=40_000)
    whole, asked = (
        band_envelope(x, FS, (1000.0, 4000.0), kind="magnitude", highest_hz=highest) for highest in (None, 100.0)
    )
    assert np.array_equal(whole.values, asked.values)


def test_edges_of_a_band_lie_inside_it_and_add_up_to_one_with_their_mirror_image():
    frequency_hz = np.arange(1001.0)
    lines, response = edged_band(frequency_hz, (200.0, 800.0), 100.0)
    assert lines[0] == 201
    assert lines[-1] == 799
    assert np.all(response[(lines >= 300) & (lines <= 700)] == 1.0)
    rise = response[lines < 300]
    assert rise + rise[::-1] == pytest.approx(1.0)
    assert response == pytest.approx(response[::-1])


def test_blocks_for_modulations_slower_than_the_record_are_never_made():
    """As of a machine whose speed is stated a million times too low: they would not fit into any memory."""
    envelopes = [band_envelope(MODULATED, FS, (2800, 3200), kind="magnitude", highest_hz=hz) for hz in (None, 1e-6)]
    assert np.array_equal(envelopes[0].values, envelopes[1].values)


def test_channels_of_which_one_drifts_have_envelopes_of_one_length() -> None:
    rng, t = np.random.default_rng(5), np.arange(10_007) / 10_000.0
    quiet = rng.standard_normal(len(t))
    both = np.stack([quiet, quiet + 1000.0 * t])
    recording = Recording(both, 10_000.0, (Channel("a"), Channel("b")))
    envelopes = envelope_recording(recording, (1000.0, 3000.0))
    assert envelopes.values("b") == pytest.approx(envelopes.values("a"), abs=0.05 * np.std(envelopes.values("a")))
    together = PreparedRecording(recording)
    transforms = {name: together.joined_transform(name) for name in ("a", "b")}
    again = envelope_recording(recording, (1000.0, 3000.0), transforms=transforms)
    assert again.samples == pytest.approx(envelopes.samples, rel=1e-6, abs=1e-6)
