"""Processor time of the standard analysis per sample of a whole record, beside its spectra by SciPy alone.

Run: python tests/benchmarks/bench_analysis.py [most samples, 4e6]. One thread, recordings in memory, compiled and
imported before. A gear pair 23/47 with two bearings at 25.6 kHz, impacts at the input bearing's outer race. SciPy's
side is what a user would write for spectrum, power density, ten band envelopes with their spectra, and indicators: no
angle, no floors, no detectors.
"""

import sys

import numpy as np
from interleaved import best_of
from scipy import signal, stats

from gearsig.diagnosis import analyze
from gearsig.prepared import envelope_bands
from gearsig.recording import Channel, Recording
from gearsig.rig import Bearing, ConstantSpeed, GearPair, Rig, Shaft, TachometerChannel

RATE_HZ, SPEED_HZ = 25_600.0, 25.12
RIG = Rig(
    name="two shafts",
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage", "input", "output", 23, 47),),
    bearings=(
        Bearing("drive end", "input", bpfo_order=3.585, bpfi_order=5.415, bsf_order=2.357, ftf_order=0.398),
        Bearing("other end", "output", bpfo_order=3.572, bpfi_order=5.428, bsf_order=2.322, ftf_order=0.397),
    ),
)


def recording(n: int, n_channels: int, *, has_tachometer: bool) -> Recording:
    """Return mesh harmonics with sidebands, impacts that ring at 3.8 kHz, and noise, in single precision."""
    rng = np.random.default_rng(1)
    turns = SPEED_HZ * np.arange(n) / RATE_HZ
    since_s = (3.585 * turns % 1.0) / (3.585 * SPEED_HZ)
    clean = 1.5 * np.exp(-1200 * since_s) * np.sin(2 * np.pi * 3800 * since_s) + 0.1 * np.sin(2 * np.pi * turns)
    for k in (1, 2, 3):
        clean += (1 + 0.2 * np.cos(2 * np.pi * turns)) / k * np.sin(2 * np.pi * 23 * k * turns + k)
    rows = [(clean + 0.5 * rng.normal(size=n)).astype(np.float32) for _ in range(n_channels)]
    channels = tuple(Channel(f"a{i + 1}", "acceleration", "m/s^2") for i in range(n_channels))
    if not has_tachometer:
        return Recording(np.stack(rows), RATE_HZ, channels, ConstantSpeed(1500.0), rig=RIG)
    pulses = np.convolve(turns % 1.0 < 0.1, np.ones(5) / 5, "same").astype(np.float32)
    channels = (*channels, Channel("tacho", "tachometer", "V"))
    return Recording(np.stack([*rows, pulses]), RATE_HZ, channels, TachometerChannel("tacho", shaft="input"), rig=RIG)


def by_scipy(record: Recording) -> list[np.ndarray]:
    """Return spectra, densities, envelope spectra and indicators of all channels."""
    results = []
    for name in record.vibration_names():
        x = record.values(name).astype(np.float64)
        results += [np.abs(np.fft.rfft(x * signal.windows.hann(len(x)))), signal.welch(x, RATE_HZ, nperseg=8192)[1]]
        results.append(np.array([x.std(), np.abs(x).max(), stats.skew(x), stats.kurtosis(x)]))
        for band in envelope_bands(RATE_HZ):
            banded = signal.sosfiltfilt(signal.butter(4, band, "bandpass", fs=RATE_HZ, output="sos"), x)
            envelope = np.abs(signal.hilbert(banded))
            results.append(np.abs(np.fft.rfft(envelope * signal.windows.hann(len(x)))))
    return results


def main() -> None:
    """Print microseconds per sample and channel, and millions of samples that two processors get through a second."""
    most = float(sys.argv[1]) if len(sys.argv) > 1 else 4e6
    for has_tachometer in (True, False):
        analyze(recording(60_000, 1, has_tachometer=has_tachometer))
    print("speed       samples  channels   gearsig    SciPy   ratio   two processors")
    for has_tachometer in (True, False):
        for n, n_channels in (
            (1 << 18, 1),
            (10**6, 1),
            (10**6, 4),
            (4 * 10**6, 1),
            (4 * 10**6, 4),
            (8 * 10**6, 1),
            (2 * 10**7, 1),
        ):
            if n > most:
                continue
            record = recording(n, n_channels, has_tachometer=has_tachometer)
            (ours, analysis), (theirs, _) = best_of(2, lambda r=record: analyze(r), lambda r=record: by_scipy(r))
            assert any(f.code == "bearing-outer-race" for f in analysis.findings)
            us, scipy_us = (1e6 * s / n / n_channels for s in (ours, theirs))
            print(
                f"{'tachometer' if has_tachometer else 'stated':10s} {n:9.1e} {n_channels:6d} {us:9.2f} µs "
                f"{scipy_us:6.2f} µs {scipy_us / us:6.1f} {2 / us:8.1f} million a second"
            )


if __name__ == "__main__":
    main()
