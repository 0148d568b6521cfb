"""gearsig's own transforms beside vmdpy and ssqueezepy as engines. Run: python tests/benchmarks/bench_engines.py.

Prints a Markdown table: root mean square difference over the signal's largest value, ratio of processor times (best of
interleaved rounds), and by how much the process grew at its peak, each engine in a process of its own (Linux).
"""

import subprocess
import sys
from functools import partial

import numpy as np
from interleaved import best_of, peak_mb

from gearsig.decompose import VmdSettings, vmd
from gearsig.timefreq import Morse, UniformSignal, inverse, squeezed_cwt, squeezed_cwt_map, squeezed_stft

RATE_HZ = 10_000.0


def _signal(n: int) -> UniformSignal:
    """Return two tones, a chirp and noise."""
    t = np.arange(n) / RATE_HZ
    tones = np.cos(2 * np.pi * 200 * t) + 0.5 * np.cos(2 * np.pi * 1000 * t)
    chirp = 0.7 * np.cos(2 * np.pi * (2500 * t + 250 * t**2 / t[-1]))
    return UniformSignal(tones + chirp + 0.1 * np.random.default_rng(0).normal(size=n), RATE_HZ, unit="m/s^2")


def _waveforms(signal, engine):
    return vmd(signal, None, VmdSettings(3, tolerance=1e-4), engine=engine).waveforms


def _back(transform, signal, engine):
    return inverse(transform(signal, engine=engine))


CWT = partial(squeezed_cwt, wavelet=Morse(60.0), lowest=50, highest=4500)
STFT = partial(squeezed_stft, window_length=0.0512, step=4)
CASES = {
    "VMD, 3 modes, 2¹³ samples": (2**13, _waveforms, "vmdpy"),
    "VMD, 3 modes, 2¹⁵ samples": (2**15, _waveforms, "vmdpy"),
    "squeezed CWT, 208 lines, 2¹⁶ samples; sum over the lines": (2**16, partial(_back, CWT), "ssqueezepy"),
    "its map, 1000 columns": (
        2**16,
        lambda x, engine: squeezed_cwt_map(x, wavelet=Morse(60.0), lowest=50, highest=4500, engine=engine).values,
        "ssqueezepy",
    ),
    "squeezed STFT, 513 lines, 2¹⁶ samples, each 4th; sum": (2**16, partial(_back, STFT), "ssqueezepy"),
}


def _growth_mb(name: str, engine: str) -> float:
    command = [sys.executable, __file__, "--memory", name, engine]
    return float(subprocess.run(command, check=True, capture_output=True, text=True).stdout.split()[-1])


def _grow(name: str, engine: str) -> None:
    n, run, _ = CASES[name]
    run(_signal(512 if "VMD" in name else 4096), engine)  # compiles and loads
    before = peak_mb()
    run(_signal(n), engine)
    print(peak_mb() - before)


def main() -> None:
    """Print the table."""
    print(f"| case | engine | difference | time ratio | peak, MB | gearsig's peak, MB |\n|{'---|' * 6}")
    for name, (n, run, other) in CASES.items():
        signal = _signal(n)
        (own_s, own), (other_s, theirs) = best_of(3, partial(run, signal, "gearsig"), partial(run, signal, other))
        apart = theirs - own
        margin = 0 if "map" in name else apart.shape[-1] // 10  # beyond the ends each assumes something else
        apart = apart[..., margin : apart.shape[-1] - margin]
        difference = float(np.sqrt(np.mean(np.abs(apart) ** 2)) / np.abs(signal.values).max())
        ratio, peaks = other_s / own_s, [_growth_mb(name, e) for e in (other, "gearsig")]
        print(f"| {name} | {other} | {difference:.1e} | {ratio:.1f} | {peaks[0]:.0f} | {peaks[1]:.0f} |", flush=True)


if __name__ == "__main__":
    if "--memory" in sys.argv:
        _grow(*sys.argv[-2:])
    else:
        main()
