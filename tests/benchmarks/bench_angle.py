"""Angular resampling of a million samples against scipy's CubicSpline: error and time, side by side."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline, CubicSpline

from gearsig.angle import AngleSignal, ShaftAngle, delay_table, doubling_filter, interpolate, resample_to_angle
from gearsig.recording import Channel, Recording

N, RATE = 1_000_000, 50_000.0
DURATION = N / RATE
N_ROUNDS = 9


@dataclass(frozen=True)
class Case:
    """A closed-form chirp: one order that reaches 0.2 of the sampling rate at the highest speed."""

    name: str
    start: float
    end: float
    n_per_rev: int | None

    @property
    def order(self) -> float:
        return 0.2 * RATE / self.end

    def revolutions(self, t: np.ndarray) -> np.ndarray:
        return self.start * t + 0.5 * (self.end - self.start) / DURATION * t**2

    def recording(self) -> Recording:
        x = np.sin(2 * np.pi * self.order * self.revolutions(np.arange(N) / RATE))
        return Recording(x[None, :], RATE, (Channel("a", "acceleration", "m/s^2"),))

    def angle(self) -> ShaftAngle:
        t = np.linspace(0.0, DURATION, 400)
        speed = self.start + (self.end - self.start) / DURATION * t
        return ShaftAngle("shaft", t, self.revolutions(t), speed, "pulses")

    def truth(self, revolutions: np.ndarray) -> np.ndarray:
        return np.sin(2 * np.pi * self.order * revolutions)


CASES = (
    Case("default grid, 45 to 50 rev/s", 45.0, 50.0, None),
    Case("as many samples out as in, 20 to 50 rev/s, half of it with anti-aliasing", 20.0, 50.0, 1428),
)


def by_cubic_spline(recording: Recording, angle: ShaftAngle, revolutions: np.ndarray) -> np.ndarray:
    """Do the same job the usual way: angle at every sample, time over angle, value over time, each a spline."""
    t = recording.time_s()
    theta = CubicHermiteSpline(angle.time_s, angle.revolutions, angle.speed_rev_per_s)(t)
    values: np.ndarray = CubicSpline(t, recording.samples[0])(CubicSpline(theta, t)(revolutions))
    return values


def kernel_only(x: np.ndarray, positions: np.ndarray, out: np.ndarray) -> None:
    side, table = doubling_filter(), delay_table()
    for i in range(0, len(out), 1 << 15):
        interpolate(x, positions[i : i + (1 << 15)], side, table, out[i : i + (1 << 15)])


def revolutions_of(signal: AngleSignal) -> np.ndarray:
    return signal.start_revolution + np.arange(signal.samples.shape[1]) / signal.samples_per_revolution


def main() -> None:
    for case in CASES:
        recording, angle = case.recording(), case.angle()
        signal = resample_to_angle(recording, angle, samples_per_revolution=case.n_per_rev)
        at = revolutions_of(signal)
        times = CubicSpline(case.revolutions(recording.time_s()), recording.time_s())(at)
        positions, out = np.clip(times * RATE, 24, N - 25), np.empty(len(at))
        jobs = {
            "public call": lambda r=recording, a=angle, n=case.n_per_rev: resample_to_angle(
                r, a, samples_per_revolution=n
            ),
            "CubicSpline": lambda r=recording, a=angle, at=at: by_cubic_spline(r, a, at),
            "kernel, one thread": lambda x=recording.samples[0], p=positions, o=out: kernel_only(x, p, o),
            "CubicSpline, times known": lambda r=recording, s=times: CubicSpline(r.time_s(), r.samples[0])(s),
        }
        seconds = {name: [] for name in jobs}
        for _ in range(N_ROUNDS):
            for name, job in jobs.items():
                start = time.perf_counter()
                job()
                seconds[name].append(time.perf_counter() - start)
        error = np.abs(signal.samples[0] - case.truth(at)).max()
        spline_error = np.abs(by_cubic_spline(recording, angle, at) - case.truth(at)).max()
        print(f"{case.name}: {N} samples in, {len(at)} out")
        print(f"  largest error {error:.1e}, CubicSpline {spline_error:.1e}")
        for name, taken in seconds.items():
            print(f"  {name:26s} best {1e3 * min(taken):6.1f} ms, median {1e3 * np.median(taken):6.1f} ms")
        whole = min(seconds["CubicSpline"]) / min(seconds["public call"])
        kernel = min(seconds["CubicSpline, times known"]) / min(seconds["kernel, one thread"])
        print(f"  {whole:.1f} times faster than CubicSpline; kernel alone, on one thread {kernel:.1f} times")


if __name__ == "__main__":
    main()
