"""Angular resampling of a million samples against scipy's CubicSpline: error and time, side by side."""

from __future__ import annotations

import time

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from gearsig.angle.resample import resample_to_angle
from gearsig.angle.types import ShaftAngle
from gearsig.recording.types import Channel, Recording

N, RATE = 1_000_000, 50_000.0
DURATION = N / RATE
ORDER, START, RATE_OF_SPEED = 200.0, 20.0, 1.5  # order 200: 4 kHz to 10 kHz, i.e. 0.08 to 0.2 of the sampling rate


def chirp_angle(t: np.ndarray) -> np.ndarray:
    return START * t + 0.5 * RATE_OF_SPEED * t**2


def make() -> tuple[Recording, ShaftAngle]:
    t = np.arange(N) / RATE
    x = np.sin(2 * np.pi * ORDER * chirp_angle(t))
    knots = np.linspace(0.0, DURATION, 400)
    angle = ShaftAngle("shaft", knots, chirp_angle(knots), START + RATE_OF_SPEED * knots, "pulses")
    return Recording(x[None, :], RATE, (Channel("a", "acceleration", "m/s^2"),)), angle


def by_cubic_spline(recording: Recording, angle: ShaftAngle, revolutions: np.ndarray) -> np.ndarray:
    """The same job the usual way: angle at every sample, time over angle, value over time, each a spline."""
    t = recording.time_s()
    theta = CubicHermiteSpline(angle.time_s, angle.revolutions, angle.speed_rev_per_s)(t)
    return CubicSpline(t, recording.samples[0])(CubicSpline(theta, t)(revolutions))


def values_only(recording: Recording, times: np.ndarray) -> np.ndarray:
    """Nothing but values over time by a spline, the times being known."""
    return CubicSpline(recording.time_s(), recording.samples[0])(times)


def kernel_only(recording: Recording, positions: np.ndarray, out: np.ndarray) -> None:
    from gearsig.angle.interpolation import delay_table, doubling_filter, interpolate

    side, table = doubling_filter(), delay_table()
    for i in range(0, len(out), 1 << 15):
        interpolate(recording.samples[0], positions[i : i + (1 << 15)], side, table, out[i : i + (1 << 15)])


def main() -> None:
    recording, angle = make()
    n_per_rev = N // int(chirp_angle(np.array(DURATION)))
    signal = resample_to_angle(recording, angle, samples_per_revolution=n_per_rev)
    n = signal.samples.shape[1]
    revolutions = signal.start_revolution + np.arange(n) / n_per_rev
    truth = np.sin(2 * np.pi * ORDER * revolutions)
    times = (np.sqrt(START**2 + 2 * RATE_OF_SPEED * revolutions) - START) / RATE_OF_SPEED
    fine = resample_to_angle(recording, angle)
    fine_truth = np.sin(
        2 * np.pi * ORDER * (fine.start_revolution + np.arange(fine.samples.shape[1]) / fine.samples_per_revolution)
    )
    out = np.empty(n)
    positions = np.clip(times * RATE, 24, N - 25)
    jobs = {
        "public call": lambda: resample_to_angle(recording, angle, samples_per_revolution=n_per_rev),
        "public call, default grid": lambda: resample_to_angle(recording, angle),
        "kernel": lambda: kernel_only(recording, positions, out),
        "CubicSpline, whole job": lambda: by_cubic_spline(recording, angle, revolutions),
        "CubicSpline, values only": lambda: values_only(recording, times),
    }
    best = dict.fromkeys(jobs, np.inf)
    for _ in range(7):
        for name, job in jobs.items():
            start = time.perf_counter()
            job()
            best[name] = min(best[name], time.perf_counter() - start)
    print(f"{N} samples in, {n} out ({n_per_rev} per revolution); default grid {fine.samples.shape[1]} out")
    print(f"largest error, same number of samples: {np.abs(signal.samples[0] - truth).max():.2e}")
    print(f"largest error, default grid:           {np.abs(fine.samples[0] - fine_truth).max():.2e}")
    spline_error = np.abs(by_cubic_spline(recording, angle, revolutions) - truth).max()
    print(f"largest error, CubicSpline:            {spline_error:.2e}")
    for name, seconds in best.items():
        print(f"{name:28s} {1e3 * seconds:8.1f} ms")
    print(f"whole job: {best['CubicSpline, whole job'] / best['public call']:.1f} times faster than CubicSpline")
    print(f"           {best['CubicSpline, whole job'] / best['public call, default grid']:.1f} times on the default grid")
    print(f"kernel:    {best['CubicSpline, values only'] / best['kernel']:.1f} times faster than CubicSpline (one thread)")
    print(f"public call against CubicSpline's values only: {best['CubicSpline, values only'] / best['public call']:.1f}")


if __name__ == "__main__":
    main()
