"""Run times of methods and of their usual alternatives, in one run: growth, agreement, distance to a limit.

All runs of one case are interleaved on one thread, and the shortest counts, in processor time of the process, which
reduces the influence of other work on the machine. A limit is the work that no method of its kind can avoid, measured
in the same rounds: moving its samples through memory, or the Fourier transforms that define it.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.compiled import njit
from gearsig.formatting import markdown_table
from sims.cracked import derivative

Run = Callable[[], Any]
RATE_HZ = 25_600.0
N_LINES = 64
SHORTEST_RUNS_S = 1.0
"""Minimum total time for which each case is repeated; there are at least three runs."""


@dataclass(frozen=True)
class TimedCase:
    """One method on a signal of one length.

    Parameters
    ----------
    run : callable
        The method of gearsig.
    rivals : mapping of str to callable
        Alternatives by name; the first word is the package.
    limit : callable
        Does only the work that the method cannot avoid.
    alike : callable
        Takes the results of gearsig and of an alternative, and returns the arrays that should be equal; None: there are
        none, because the two are different estimates of the same quantity.
    """

    run: Run
    rivals: Mapping[str, Run]
    limit: Run
    alike: Callable[[Any, Any], tuple[Any, Any]] | None = lambda own, other: (own, other)


@dataclass(frozen=True)
class TimedMethod:
    """A method, its lengths, and its cases."""

    name: str
    lengths: Sequence[int]
    case: Callable[[int], TimedCase]
    limit: str


@dataclass
class Timing:
    """Run times of one program for one method.

    Parameters
    ----------
    name : str
        "gearsig" or the alternative.
    seconds : dict of int to float
        Processor time by signal length.
    difference : float
        RMS difference from gearsig's result at the greatest length, relative to the rms of that result; nan for
        gearsig itself.
    reason : str
        Why there are no times.
    """

    name: str
    seconds: dict[int, float] = field(default_factory=dict)
    difference: float = float("nan")
    reason: str = ""

    @property
    def exponent(self) -> float:
        """Slope of log time over log length; nan for a single length."""
        if len(self.seconds) < 2:
            return float("nan")
        return float(np.polyfit(np.log(list(self.seconds)), np.log(list(self.seconds.values())), 1)[0])


@dataclass(frozen=True)
class TimedMethodResult:
    """All timings of a method: gearsig first, the limit last."""

    method: TimedMethod
    timings: tuple[Timing, ...]


def measure(
    methods: Sequence[TimedMethod], *, longest_s: float = 20.0, on_progress: Callable[[int], object] | None = None
) -> list[TimedMethodResult]:
    """Time methods one after the other.

    Parameters
    ----------
    methods : sequence of TimedMethod
    longest_s : float
        A program that takes longer than this for one run is not given a longer signal.
    on_progress : callable or None
        Takes the number of completed methods.
    """
    from numba import get_num_threads, set_num_threads
    from threadpoolctl import threadpool_limits

    os.environ.setdefault("SSQ_PARALLEL", "0")  # ssqueezepy's own switch
    results, n_threads = [], get_num_threads()
    set_num_threads(1)
    with threadpool_limits(1):
        for number, method in enumerate(methods):
            results.append(TimedMethodResult(method, _timed(method, longest_s)))
            if on_progress is not None:
                on_progress(number + 1)
    set_num_threads(n_threads)
    return results


def _timed(method: TimedMethod, longest_s: float) -> tuple[Timing, ...]:
    gearsig, limit, alternatives = Timing("gearsig"), Timing(method.limit), dict[str, Timing]()
    for n in method.lengths:
        case = method.case(n)
        runs = {gearsig.name: case.run}
        for name, rival in case.rivals.items():
            timing = alternatives.setdefault(name, Timing(name))
            if find_spec(name.split(".")[0]) is None:
                timing.reason = "not installed"
            elif max(timing.seconds.values(), default=0.0) <= longest_s:
                runs[name] = rival
        best = _best({**runs, limit.name: case.limit})
        for timing in (gearsig, limit, *(alternatives[name] for name in runs if name in alternatives)):
            timing.seconds[n], result = best[timing.name]
            if timing.name in alternatives and case.alike is not None:
                timing.difference = _difference(*case.alike(best[gearsig.name][1], result))
    return gearsig, *alternatives.values(), limit


def _best(runs: Mapping[str, Run]) -> dict[str, tuple[float, Any]]:
    """Return the minimum processor time of each and its first result; the first run of each compiles and plans."""
    first = {}
    for name, run in runs.items():
        start = time.process_time()
        result = run()
        first[name] = time.process_time() - start, result
    best = dict.fromkeys(runs, float("inf"))
    spent = dict.fromkeys(runs, 0.0)
    n_rounds = 0
    while n_rounds < 3 or (min(spent.values()) < SHORTEST_RUNS_S and sum(spent.values()) < 4 * SHORTEST_RUNS_S):
        for name, run in runs.items():
            start = time.process_time()
            run()
            passed_s = time.process_time() - start
            best[name], spent[name] = min(best[name], passed_s), spent[name] + passed_s
        n_rounds += 1
    return {name: (seconds, first[name][1]) for name, seconds in best.items()}


def _difference(ours: Any, theirs: Any) -> float:
    """Return the relative rms difference of the middle parts of two results, after scaling by the best common factor.

    Programs scale differently and make different assumptions beyond the ends.
    """
    a, b = np.asarray(ours), np.asarray(theirs)
    n = min(a.shape[-1], b.shape[-1])
    a, b = (x[..., n // 5 : n - n // 5].ravel() for x in (a, b))
    factor = np.vdot(b, a) / np.vdot(b, b).real
    return float(np.linalg.norm(a - factor * b) / np.linalg.norm(a))


# --------------------
# The methods. Signals are tones, a chirp and noise.
# --------------------


def trial_signal(n: int) -> FloatArray:
    """Return two tones, a chirp and noise, all below 0.4 of the sampling rate."""
    i = np.arange(n)
    tones = np.cos(2 * pi * 0.02 * i) + 0.5 * np.cos(2 * pi * 0.11 * i)
    chirp = 0.7 * np.cos(2 * pi * (0.2 * i + 0.05 * i**2 / n))
    noise: FloatArray = tones + chirp + 0.2 * np.random.default_rng(0).normal(size=n)
    return noise


def _copies(n_values: float, kind: type = np.float64) -> Run:
    """Return a run that reads and writes `n_values` values; many values are moved in pieces larger than any cache."""
    source: NDArray[Any] = np.ones(max(1, int(min(n_values, 2**22))), dtype=kind)
    target, times = np.empty_like(source), max(1, round(n_values / len(source)))

    def run() -> None:
        for _ in range(times):
            np.copyto(target, source)

    return run


def _power_density(n: int) -> TimedCase:
    from scipy import fft, signal

    from gearsig.spectra import power_density

    x, n_block = trial_signal(n), 8192
    blocks = np.lib.stride_tricks.sliding_window_view(x, n_block)[:: n_block // 2]
    return TimedCase(
        lambda: power_density(x, RATE_HZ, n_per_block=n_block).values,
        {"scipy.signal.welch": lambda: signal.welch(x, RATE_HZ, "hann", n_block, detrend=False)[1]},
        lambda: fft.rfft(blocks, axis=1),
    )


def _envelope(n: int) -> TimedCase:
    from scipy import fft, signal

    from gearsig.spectra import band_envelope

    x, band = trial_signal(n), (4000.0, 8500.0)

    def filtered() -> FloatArray:
        sections = signal.butter(4, band, "bandpass", fs=RATE_HZ, output="sos")
        squared: FloatArray = np.abs(signal.hilbert(signal.sosfiltfilt(sections, x))) ** 2
        return squared

    def alike(ours: Any, theirs: FloatArray) -> tuple[FloatArray, FloatArray]:
        return ours.values, signal.resample(theirs, len(ours.values))

    return TimedCase(
        lambda: band_envelope(x, RATE_HZ, band),
        {"scipy.signal.sosfiltfilt and hilbert": filtered},
        lambda: fft.irfft(fft.rfft(x)),
        alike,
    )


def _resampling(n: int) -> TimedCase:
    from scipy.interpolate import CubicHermiteSpline, CubicSpline

    from gearsig.angle import ShaftAngle, resample_to_angle
    from gearsig.recording import Channel, Recording

    recording = Recording(trial_signal(n)[None], RATE_HZ, (Channel("a", "acceleration", "m/s^2"),))
    t = np.linspace(0.0, n / RATE_HZ, 400)
    speed = 45.0 + 5.0 * t / t[-1]
    angle = ShaftAngle("shaft", t, 45.0 * t + 2.5 * t**2 / t[-1], speed, "pulses")
    first = resample_to_angle(recording, angle)
    at = first.start_revolution + np.arange(first.samples.shape[1]) / first.samples_per_revolution
    times = recording.time_s()

    def splines() -> FloatArray:
        theta = CubicHermiteSpline(angle.time_s, angle.revolutions, angle.speed_rev_per_s)(times)
        values: FloatArray = CubicSpline(times, recording.samples[0])(CubicSpline(theta, times)(at))
        return values

    return TimedCase(
        lambda: resample_to_angle(recording, angle).samples[0],
        {"scipy.interpolate.CubicSpline": splines},
        _copies(n + len(at)),
    )


def _stft(n: int) -> TimedCase:
    from scipy import fft
    from scipy.signal import ShortTimeFFT

    from gearsig.timefreq import stft

    x, n_window, step = trial_signal(n), 1024, 64
    transform = ShortTimeFFT(np.hanning(n_window + 1)[:-1], step, RATE_HZ, scale_to="magnitude")
    blocks = np.lib.stride_tricks.sliding_window_view(x, n_window)[::step]

    def alike(ours: Any, theirs: NDArray[np.complex128]) -> tuple[Any, Any]:
        # Moduli, because the phase references differ. Both have frames at whole steps.
        return np.abs(ours.values), np.abs(theirs)[:, -transform.p_min :]

    return TimedCase(
        lambda: stft(x, RATE_HZ, window_length=n_window / RATE_HZ, step=step),
        {"scipy.signal.ShortTimeFFT": lambda: transform.stft(x)},
        lambda: fft.rfft(blocks, axis=1),
        alike,
    )


def _lines() -> FloatArray:
    return np.geomspace(0.005, 0.35, N_LINES)


def _morlet(n: int) -> TimedCase:
    from gearsig.timefreq import Morlet, cwt

    x, lines, omega0 = trial_signal(n), _lines(), 2 * pi * sqrt(0.75)

    def by_pywavelets() -> Any:
        import pywt

        return pywt.cwt(x, 1.0 / lines, "cmor1.5-1.0", method="fft")[0]

    kept: list[Any] = []

    def by_pyfcwt() -> Any:
        from pyfcwt import Frequencies, PyFCWT, Wavelet

        if not kept:  # its plans are kept, as its manual advises
            wavelet = Wavelet(fs=1.0, n_cycles=omega0)
            grid = Frequencies(wavelet, f0=lines[0], f1=lines[-1], fn=N_LINES, fs=1.0)
            kept.append(PyFCWT(wavelet, grid, threads=1, dtype="complex128"))
        return kept[0].cwt(x)[::-1]

    return TimedCase(
        lambda: cwt(x, 1.0, positions=lines, wavelet=Morlet(omega0)).values,
        {"pywt.cwt": by_pywavelets, "pyfcwt": by_pyfcwt},
        _copies(n * N_LINES, np.complex128),
        _moduli,
    )


def _moduli(ours: Any, theirs: Any) -> tuple[Any, Any]:
    """Return the moduli of two transforms, each line of the other scaled to our mean because the scalings differ."""
    a, b = np.abs(ours), np.abs(theirs)
    return a, b * (a.mean(axis=1) / b.mean(axis=1))[:, None]


def _morse(n: int) -> TimedCase:
    from gearsig.timefreq import Morse, cwt

    x, lines = trial_signal(n), _lines()
    scales = (20.0 ** (1 / 3) / (2 * pi * lines))[::-1].copy()

    def by_ssqueezepy() -> Any:
        import ssqueezepy

        wavelet = ssqueezepy.Wavelet(("gmw", {"beta": 60, "gamma": 3}))
        return ssqueezepy.cwt(x, wavelet, scales=scales.copy())[0][::-1]

    return TimedCase(
        lambda: cwt(x, 1.0, positions=lines, wavelet=Morse(60.0)).values,
        {"ssqueezepy.cwt": by_ssqueezepy},
        _copies(n * N_LINES, np.complex128),
        _moduli,
    )


def _squeezed(n: int) -> TimedCase:
    from gearsig.timefreq import Morse, inverse, squeezed_cwt

    x, settings = trial_signal(n), {"lowest": 0.005, "highest": 0.35, "n_per_octave": 16}

    def run(engine: Any) -> Any:
        return squeezed_cwt(x, 1.0, wavelet=Morse(60.0), engine=engine, **settings)  # type: ignore[arg-type]

    return TimedCase(
        lambda: run("gearsig"),
        {"ssqueezepy.ssq_cwt": lambda: run("ssqueezepy")},
        _copies(2 * n * 16 * np.log2(70), np.complex128),
        lambda ours, theirs: (inverse(ours), inverse(theirs)),
    )


def _modes(n: int) -> TimedCase:
    from gearsig.decompose import VmdSettings, vmd

    x, settings = trial_signal(n), VmdSettings(3, tolerance=1e-4)

    def by_vmdpy() -> Any:
        from vmdpy import VMD

        return VMD(x, settings.penalty, settings.dual_step, 3, DC=False, init=1, tol=1e-4)[0]

    def by_pysdkit() -> Any:
        from pysdkit import VMD

        method = VMD(settings.penalty, 3, settings.dual_step, tol=1e-4, store_history=False)
        return method.fit_transform(x)

    def by_rate(modes: Any) -> Any:
        return modes[np.argsort(np.abs(np.diff(modes, axis=1)).sum(axis=1) / np.abs(modes).sum(axis=1))]

    n_iterations = vmd(x, RATE_HZ, settings).n_iterations
    return TimedCase(
        lambda: vmd(x, RATE_HZ, settings).waveforms,
        {"vmdpy": by_vmdpy, "pysdkit.VMD": by_pysdkit},
        _copies(n_iterations * 3 * n, np.complex128),
        lambda ours, theirs: (by_rate(ours), by_rate(np.asarray(theirs))),
    )


def _packets(n: int) -> TimedCase:
    from gearsig.timefreq import wavelet_packets

    x = trial_signal(n)

    def by_pywavelets() -> Any:
        import pywt

        tree = pywt.WaveletPacket(x, "sym12", "periodization", maxlevel=6)
        return np.array([node.data for node in tree.get_level(6, "freq")])

    return TimedCase(
        lambda: wavelet_packets(x, RATE_HZ, level=6).values,
        {"pywt.WaveletPacket": by_pywavelets},
        _copies(6 * n),
    )


def _kurtogram(n: int) -> TimedCase:
    from gearsig.spectra import kurtogram

    x = trial_signal(n)
    x[:: n // 64] += 5.0

    def by_pysdkit() -> Any:
        from pysdkit.utils._kurtogram import fast_kurtogram

        return fast_kurtogram(x, 6, 1.0)

    return TimedCase(
        lambda: kurtogram(x, 1.0, n_levels=6), {"pysdkit": by_pysdkit}, _copies(2 * 6 * n, np.complex128), None
    )


def _vold_kalman(n: int) -> TimedCase:
    from scipy import sparse
    from scipy.sparse.linalg import spsolve

    from gearsig.orders import track_vold_kalman
    from gearsig.orders.vold_kalman import envelope_weight

    t = np.arange(n) / RATE_HZ
    cycles = 50 * t + 10 * t**2 * RATE_HZ / n
    y = (1 + 0.3 * np.cos(2 * pi * 3.0 * t)) * np.cos(2 * pi * cycles) + trial_signal(n)
    track = [50 + 20 * t * RATE_HZ / n]
    weight = float(envelope_weight(np.array([20.0 / RATE_HZ]), 2)[0])

    def by_sparse_solve() -> Any:
        second = sparse.diags([1.0, -2.0, 1.0], [0, 1, 2], shape=(n - 2, n))
        return spsolve((sparse.eye(n) + weight**2 * (second.T @ second)).tocsc(), y * np.exp(-2j * pi * cycles))

    return TimedCase(
        lambda: track_vold_kalman(y, RATE_HZ, track, bandwidth_hz=20.0, mirror=False).orders[0].envelope,
        {"scipy.sparse.linalg.spsolve": by_sparse_solve},
        _copies(2 * n, np.complex128),
        lambda ours, theirs: (np.abs(ours), np.abs(theirs)),
    )


def _motion(n: int) -> TimedCase:
    """Time n steps of the cracked pair; DOP853 solves the same compiled equations to the same error."""
    from scipy.integrate import solve_ivp

    from sims.cracked import default_step_s, prepare, respond
    from sims.gear_pair import PARAMETERS, build_machine
    from sims.machine import Operation
    from sims.simulator import complete_values

    machine, operation = build_machine(complete_values(PARAMETERS)), Operation.steady(500.0, 110.0)
    step_s, stride = default_step_s(machine, operation), 16
    ready = prepare(machine, operation, np.random.default_rng(1))
    surface, first, rate = ready.roughness.surface, float(ready.q[0]), np.empty(32)
    rough = (surface.amplitudes_m, 2 * pi * ready.roughness.frequencies_hz, ready.roughness.phases_rad)
    state, times = np.concatenate((ready.q, ready.v)), np.arange(n // stride) * stride * step_s
    # Displacements are of the order of 1e-5 m, angles 1 rad: each coordinate has its own absolute tolerance.
    scale = np.r_[np.ones(4), np.full(12, 1e-5), np.full(4, 50.0), np.full(12, 1e-2)]

    def fixed(refined: int = 1) -> FloatArray:
        options = {"step_s": step_s / refined, "stride": stride * refined, "signals": ("driver y",)}
        rng = np.random.default_rng(1)
        run = respond(machine, operation, duration_s=n * step_s, rng=rng, **options)  # type: ignore[arg-type]
        values: FloatArray = run["driver y"][: len(times)]
        return values

    def slope(t: float, at: FloatArray) -> FloatArray:
        derivative(*ready.constants.arguments, t, at, ready.speed, ready.torque, first, rough, rate)
        return rate.copy()  # SciPy keeps a reference

    def adaptive(tolerance: float) -> FloatArray:
        done: Any = solve_ivp(
            slope, (0.0, times[-1]), state, "DOP853", t_eval=times, rtol=tolerance, atol=tolerance * scale
        )
        values: FloatArray = done.y[5]
        return values

    exact = fixed(16)
    error = np.linalg.norm(fixed() - exact)
    tolerance = next(
        (10.0**-e for e in range(3, 12) if np.linalg.norm(adaptive(10.0**-e) - exact) <= error), 1e-12
    )  # the loosest that is as exact
    at = (ready.speed, ready.torque, first, rough, rate)
    return TimedCase(
        fixed,
        {"scipy.integrate.solve_ivp": lambda: adaptive(tolerance)},
        lambda: _slopes(4 * n, *ready.constants.arguments, state, *at),
    )


@njit()
def _slopes(n, k, curves, rows, pitch, state, speed, torque, first, rough, rate):  # type: ignore[no-untyped-def]
    for i in range(n):
        derivative(k, curves, rows, pitch, 1e-6 * i, state, speed, torque, first, rough, rate)


MEMORY = "samples and results moved once through memory"
TRANSFORMS = "the Fourier transforms alone"
METHODS = (
    TimedMethod("power density", [2**16, 2**18, 2**20, 2**22], _power_density, TRANSFORMS),
    TimedMethod("envelope of a band", [2**16, 2**18, 2**20, 2**22], _envelope, "one Fourier transform forth and back"),
    TimedMethod("resampling over angle", [2**16, 2**18, 2**20, 2**22], _resampling, MEMORY),
    TimedMethod("kurtogram, 6 levels", [2**16, 2**18, 2**20], _kurtogram, "each level moved once through memory"),
    TimedMethod("short-time transform", [2**16, 2**18, 2**20], _stft, TRANSFORMS),
    TimedMethod(
        f"wavelet transform, {N_LINES} Morlets", [2**14, 2**16, 2**18], _morlet, "its matrix moved through memory"
    ),
    TimedMethod(
        f"wavelet transform, {N_LINES} Morses", [2**14, 2**16, 2**18], _morse, "its matrix moved through memory"
    ),
    TimedMethod("squeezed wavelet transform", [2**13, 2**15, 2**17], _squeezed, "two matrices moved through memory"),
    TimedMethod("wavelet packets, level 6", [2**16, 2**18, 2**20], _packets, "each level moved once through memory"),
    TimedMethod("variational modes, 3", [2**11, 2**13, 2**15], _modes, "each iteration's modes moved through memory"),
    TimedMethod("Vold–Kalman, one order", [2**14, 2**16, 2**18, 2**20], _vold_kalman, MEMORY),
    TimedMethod("cracked pair, steps", [2**13, 2**15, 2**17], _motion, "four evaluations of the equations a step"),
)
"""ROSS is not compared: its rotors have no teeth in contact, so no method here computes the same thing."""


# --------------------
# The table.
# --------------------


def rows(results: Sequence[TimedMethodResult]) -> Iterator[dict[str, str | float | int]]:
    """Yield a row for each alternative, at the greatest length that it and gearsig completed."""
    for result in results:
        gearsig, *alternatives, limit = result.timings
        for alternative in alternatives:
            n = max(alternative.seconds, default=max(gearsig.seconds))
            theirs = alternative.seconds.get(n, float("nan"))
            yield {
                "method": result.method.name,
                "instead": alternative.name,
                "n": n,
                "gearsig_s": gearsig.seconds[n],
                "instead_s": theirs,
                "ratio": theirs / gearsig.seconds[n],
                "difference": alternative.difference,
                "exponent": gearsig.exponent,
                "instead_exponent": alternative.exponent,
                "over_limit": gearsig.seconds[n] / limit.seconds[n],
                "limit": limit.name,
                "reason": alternative.reason,
            }


def table(results: Sequence[TimedMethodResult], date: datetime | None = None) -> str:
    """Return the table in Markdown, with machine, programs and date above it."""
    day = f"{(date or datetime.now().astimezone()):%d %B %Y}"
    names = ("method", "samples N", "gearsig", "instead", "takes", "times as long", "results differ by")
    header = (*names, "grows as N to the power of; instead", "gearsig over its limit")
    lines = []
    for row in rows(results):
        n = int(row["n"])
        took = [_ms(row["instead_s"]), f"{row['ratio']:.3g}", _or_dash(row["difference"], ".1e")]
        if row["reason"]:
            took = [str(row["reason"]), "–", "–"]
        growth = f"{row['exponent']:.2f}; {_or_dash(row['instead_exponent'], '.2f')}"
        length = f"2^{n.bit_length() - 1}" if n == 1 << (n.bit_length() - 1) else str(n)
        limit = f"{row['over_limit']:.2g} × {row['limit']}"
        lines.append([str(row["method"]), length, _ms(row["gearsig_s"]), str(row["instead"]), *took, growth, limit])
    head = f"{day}; {machine()}; {programs()}. One thread, best of interleaved runs, processor time."
    return f"{head}\n\n{markdown_table(header, lines)}"


def machine() -> str:
    """Return processor, number of cores, system and Python version as text."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as file:  # noqa: PTH123 - no file of ours
            name = next((line.partition(":")[2].strip() for line in file if line.startswith("model name")), name)
    except OSError:
        pass
    return f"{name}, {os.cpu_count()} cores, {platform.system()}, Python {platform.python_version()}"


def programs() -> str:
    """Return the versions of the compared packages that are installed."""
    versions = []
    for name in ("numpy", "scipy", "numba", "PyWavelets", "ssqueezepy", "vmdpy", "pyfcwt", "PySDKit"):
        try:
            versions.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(versions)


def _ms(seconds: Any) -> str:
    return f"{1e3 * seconds:.3g} ms"


def _or_dash(value: Any, form: str) -> str:
    return "–" if np.isnan(value) else format(value, form)
