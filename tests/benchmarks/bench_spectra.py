"""Times for 10 s at 25.6 kHz, some beside scipy. Run: python tests/benchmarks/bench_spectra.py."""

from collections.abc import Callable
from typing import Any

import numpy as np
from interleaved import best_of
from scipy import ndimage, signal

from gearsig.angle import AngleSignal, ShaftAngle
from gearsig.orders import (
    frequency_map,
    order_map,
    order_spectrum,
    separate,
    synchronous_average,
    track_order_bands,
    track_orders,
)
from gearsig.spectra import (
    amplitude_spectrum,
    band_envelope,
    cepstrum,
    envelope_spectrum,
    find_lines,
    lifter_families,
    noise_floor,
    power_density,
)

FS = 25_600.0
N = 256_000


def main() -> None:
    """Print one line per function."""
    x = np.random.default_rng(0).normal(size=N)
    angle = ShaftAngle("s", np.array([0.0, 10.0]), np.array([0.0, 1000.0]), np.array([100.0, 100.0]), "constant")
    turned = AngleSignal(x[None, :], 256, angle, 0.0, ("a",), ("g",), 128.0)
    spectrum = amplitude_spectrum(x, FS)
    floor = noise_floor(spectrum)
    average = synchronous_average(turned, "a")

    def welch() -> object:
        return signal.welch(x, FS, "hann", 8192, detrend=False)

    def hilbert() -> object:
        b = signal.butter(4, [3000, 5000], "bandpass", fs=FS, output="sos")
        return np.fft.rfft(np.abs(signal.hilbert(signal.sosfiltfilt(b, x))) ** 2)

    def running_median() -> object:
        return ndimage.median_filter(spectrum.values, 641)

    cases: list[tuple[str, Callable[[], Any], Callable[[], Any] | None]] = [
        ("amplitude spectrum", lambda: amplitude_spectrum(x, FS), None),
        ("power density | scipy welch", lambda: power_density(x, FS), welch),
        (
            "envelope spectrum | scipy filter, hilbert",
            lambda: envelope_spectrum(band_envelope(x, FS, (3000, 5000))),
            hilbert,
        ),
        ("noise floor | scipy median filter", lambda: noise_floor(spectrum), running_median),
        ("find lines", lambda: find_lines(spectrum, floor), None),
        ("cepstrum", lambda: cepstrum(x, FS), None),
        ("lifter families", lambda: lifter_families(x, FS, 25.0, keep=False), None),
        ("order spectrum", lambda: order_spectrum(turned, "a"), None),
        ("order map", lambda: order_map(turned, "a"), None),
        ("frequency map", lambda: frequency_map(x, FS, angle), None),
        ("track 4 orders", lambda: track_orders(turned, "a", [1, 2, 23, 46]), None),
        ("track 4 order bands", lambda: track_order_bands(turned, "a", [1, 2, 23, 46]), None),
        ("synchronous average", lambda: synchronous_average(turned, "a"), None),
        ("separate", lambda: separate(average, 23), None),
    ]
    for name, ours, others in cases:
        (a, _), *rest = best_of(7, ours, *([others] if others else []))
        print(f"{name:45s} {1e3 * a:8.2f} ms" + "".join(f"  {1e3 * b:8.2f} ms  {b / a:6.1f} times" for b, _ in rest))


if __name__ == "__main__":
    main()
