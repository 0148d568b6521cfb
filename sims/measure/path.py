"""Modal transfer path: from accelerations at bearings to the place where a sensor sits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from gearsig.checks import FloatArray, closest_match_hint, positive, within
from gearsig.errors import InputError
from sims.measure.hold import apply_bank, low_pass


@dataclass(frozen=True)
class PathMode:
    """One mode of the housing as a sensor sees it.

    Parameters
    ----------
    frequency_hz : float
    damping_ratio : float
        ζ, 1e-4 to 1.
    gains : mapping
        Position → static gain g: well below its frequency the mode adds g times that position's acceleration, at its
        frequency g/(2ζ) times, a quarter of a period late.
    """

    frequency_hz: float
    damping_ratio: float
    gains: Mapping[str, float]

    def __post_init__(self) -> None:
        positive(self.frequency_hz, "frequency_hz of a path mode", "Hz")
        within(self.damping_ratio, "damping_ratio of a path mode", 1e-4, 1.0)
        object.__setattr__(self, "gains", _gains(self.gains))


@dataclass(frozen=True)
class ModalPath:
    """a(s) = Σ_p (d_p + Σ_m g_mp ω_m²/(s² + 2ζ_m ω_m s + ω_m²)) a_p(s), over positions p and modes m.

    Parameters
    ----------
    direct : mapping
        Position → d, the part that arrives unfiltered. {"bearing 1": 1.0} alone is a sensor on that bearing.
    modes : tuple of PathMode
    """

    direct: Mapping[str, float] = field(default_factory=dict)
    modes: tuple[PathMode, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "direct", _gains(self.direct))
        object.__setattr__(self, "modes", tuple(self.modes))
        if not self.direct and not any(mode.gains for mode in self.modes):
            raise InputError("the path leads from nowhere", remedy='give direct={"position": 1.0} or a mode with gains')

    @property
    def settling_s(self) -> float:
        """Time until a start has rung down to 1e-4 in the slowest mode."""
        return max((np.log(1e4) / (m.damping_ratio * 2 * np.pi * m.frequency_hz) for m in self.modes), default=0.0)

    def apply(self, accelerations: FloatArray, positions: tuple[str, ...], step_s: float) -> FloatArray:
        """Acceleration at the sensor, (n_steps, n_positions) → (n_steps,).

        Exact for accelerations that run straight between steps; for a sine see `sims.measure.hold.hold_error`. Modes
        begin settled on the mean: a first value may be the middle of a blow, from which a slow mode would ring long.
        """
        settled = np.mean(accelerations, axis=0, keepdims=True)
        return apply_bank(
            [low_pass(mode.frequency_hz, mode.damping_ratio, step_s) for mode in self.modes],
            np.array([_weights(mode.gains, positions) for mode in self.modes]).reshape(-1, len(positions)),
            np.concatenate((settled, accelerations)),
            _weights(self.direct, positions),
        )[1:]

    def response(self, frequency_hz: FloatArray, position: str) -> FloatArray:
        """Complex frequency response from a position, analytic."""
        f = np.asarray(frequency_hz, dtype=np.float64)
        total = np.full(f.shape, self.direct.get(position, 0.0), dtype=complex)
        for mode in self.modes:
            r = f / mode.frequency_hz
            total += mode.gains.get(position, 0.0) / (1 - r**2 + 2j * mode.damping_ratio * r)
        result: FloatArray = total
        return result


def _weights(gains: Mapping[str, float], positions: tuple[str, ...]) -> FloatArray:
    unknown = [name for name in gains if name not in positions]
    if unknown:
        raise InputError(
            f"the path starts at {unknown[0]!r}, which the simulation does not give",
            allowed=", ".join(positions),
            remedy=closest_match_hint(unknown[0], positions),
        )
    return np.array([gains.get(name, 0.0) for name in positions])


def _gains(gains: Mapping[str, float]) -> dict[str, float]:
    for name, gain in gains.items():
        if not np.isfinite(gain):
            raise InputError(f"the gain from {name!r} is {gain}", allowed="a finite number")
    return dict(gains)
