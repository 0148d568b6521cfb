"""Time–frequency transforms beside ssqueezepy and PyWavelets. Run: python tests/benchmarks/bench_timefreq.py.

All on one core: no transform here starts threads, and ssqueezepy is told not to. Best of interleaved rounds. `--memory`
adds peak memories: of Python's and NumPy's allocations, and for 10⁷ samples of a process of its own.
"""

import os
import subprocess
import sys
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from interleaved import best_of, peak_mb

from gearsig.timefreq import (
    Morlet,
    Morse,
    UniformSignal,
    cwt,
    cwt_map,
    squeezed_cwt,
    squeezed_cwt_map,
    squeezed_stft_map,
    stft_map,
)

N = 1 << 18
N_LINES = 100
LOWEST, HIGHEST = 0.002, 0.35
MORSE = Morse(60.0)
MORLET = Morlet(2 * np.pi * np.sqrt(0.75))  # cmor1.5-1.0
Case = Callable[[], Any]


def _report(title: str, cases: dict[str, Case], n_rounds: int) -> None:
    before = os.getloadavg()[0]
    best_of(1, *cases.values())  # compile, plan
    seconds = dict(zip(cases, (s for s, _ in best_of(n_rounds, *cases.values())), strict=True))
    ours, *others = seconds
    print(f"{title} (load {before:.1f} to {os.getloadavg()[0]:.1f})")
    for name in others:
        print(f"    {seconds[name] / seconds[ours]:6.1f} times as fast as {name}")


def _peak_mb(run: Case) -> float:
    tracemalloc.start()
    run()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def _cases() -> list[tuple[str, dict[str, Case], int]]:
    os.environ["SSQ_PARALLEL"] = "0"  # its parallel kernels abort the process when called from several threads
    import pywt
    import ssqueezepy

    x = np.random.default_rng(0).normal(size=N)
    signal = UniformSignal(x, 1.0)
    lines = np.geomspace(LOWEST, HIGHEST, N_LINES)
    theirs = ssqueezepy.Wavelet(("gmw", {"beta": 60, "gamma": 3}))
    scales = (20.0 ** (1 / 3) / (2 * np.pi * lines))[::-1].copy()
    n_per_octave = 32
    n_squeezed = int(np.log2(HIGHEST / LOWEST) * n_per_octave) + 1
    fine = HIGHEST * 2.0 ** (np.arange(1 - n_squeezed, 1) / n_per_octave)
    fine_scales = (20.0 ** (1 / 3) / (2 * np.pi * fine))[::-1].copy()

    def ssq_squeezed() -> object:
        return ssqueezepy.ssq_cwt(x, theirs, scales=fine_scales.copy(), ssq_freqs=fine.copy())

    wide = {"lowest": LOWEST, "highest": HIGHEST, "wavelet": MORSE, "n_per_octave": n_per_octave}
    return [
        (
            f"CWT, 2^18 × {N_LINES}, Morse β 60 γ 3, whole matrix",
            {
                "ours": lambda: cwt(signal, positions=lines, wavelet=MORSE),
                "ssqueezepy": lambda: ssqueezepy.cwt(x, theirs, scales=scales.copy()),
            },
            5,
        ),
        (
            f"CWT, 2^18 × {N_LINES}, complex Morlet 1.5-1.0, whole matrix",
            {
                "ours": lambda: cwt(signal, positions=lines, wavelet=MORLET),
                "pywt (fft)": lambda: pywt.cwt(x, 1.0 / lines, "cmor1.5-1.0", method="fft"),
            },
            2,
        ),
        (
            f"CWT for display, 2^18 × {N_LINES}",
            {
                "ours": lambda: cwt_map(signal, positions=lines, wavelet=MORSE),
                "ssqueezepy's matrix": lambda: ssqueezepy.cwt(x, theirs, scales=scales.copy()),
            },
            3,
        ),
        (
            f"synchrosqueezed CWT, 2^18 × {n_squeezed}, whole matrix",
            {"ours": lambda: squeezed_cwt(signal, **wide), "ssqueezepy": ssq_squeezed},
            2,
        ),
        (
            f"synchrosqueezed CWT for display, 2^18 × {n_squeezed}",
            {"ours": lambda: squeezed_cwt_map(signal, **wide), "ssqueezepy's matrix": ssq_squeezed},
            2,
        ),
    ]


def _long(kind: str) -> None:
    """Map ten million samples and print how much the process grew."""
    before = peak_mb() / 1e3
    x = np.random.default_rng(0).normal(size=10_000_000)
    signal = UniformSignal(x, 25_600.0)
    run = {"squeezed CWT": squeezed_cwt_map, "squeezed STFT": squeezed_stft_map, "CWT": cwt_map, "STFT": stft_map}[kind]
    found = run(signal)
    peak = peak_mb() / 1e3
    shape = " × ".join(str(n) for n in found.values.shape)
    print(f"{kind} for display ({shape}), 10^7 samples: peak {peak:.2f} GB, of it {before:.2f} GB before the signal")


def main() -> None:
    """Print the ratios."""
    for title, cases, n_rounds in _cases():
        _report(title, cases, n_rounds)
        if "--memory" in sys.argv and "whole matrix" in title:
            peaks = {name: _peak_mb(run) for name, run in cases.items()}
            print("    peak memory: " + ", ".join(f"{name} {peak:.0f} MB" for name, peak in peaks.items()))
    if "--memory" in sys.argv:
        for kind in ("squeezed CWT", "squeezed STFT", "CWT", "STFT"):
            subprocess.run([sys.executable, __file__, "--long", kind], check=True)


if __name__ == "__main__":
    if "--long" in sys.argv:
        _long(sys.argv[-1])
    else:
        main()
