"""Averages with a known event at a known tooth, made from their lines."""

from dataclasses import replace

import numpy as np

from gearsig.severity import ShaftLines

TEETH = 23
N_ORDERS = 8 * TEETH


def flat_pulse(centre_rev: float, size: float) -> np.ndarray:
    """Lines of a short pulse: all of the same size, in phase at its angle."""
    lines: np.ndarray = size * np.exp(-2j * np.pi * np.arange(N_ORDERS + 1) * centre_rev)
    return lines


def mesh_lines(levels: tuple[float, ...] = (3.0, 2.0, 1.5, 1.0, 0.8, 0.6, 0.5)) -> np.ndarray:
    """Lines of a mesh alike at all teeth."""
    lines = np.zeros(N_ORDERS + 1, dtype=complex)
    lines[TEETH * np.arange(1, len(levels) + 1)] = levels
    return lines


def teeth_pattern(seed: int, size: float = 0.02) -> np.ndarray:
    """Lines of teeth that differ by chance."""
    rng = np.random.default_rng(seed)
    return size * (rng.standard_normal(N_ORDERS + 1) + 1j * rng.standard_normal(N_ORDERS + 1))


def shaft(*lines: np.ndarray, has_mark: bool = True, order_hz: float = 25.0) -> ShaftLines:
    """Wrap the lines of each channel."""
    return ShaftLines("input", TEETH, 31, np.stack(lines), 40, N_ORDERS, order_hz, ("a1", "a2")[: len(lines)], has_mark)


def turned(average: ShaftLines, revolutions: float) -> ShaftLines:
    """Return the average as a recording would give it whose angle starts elsewhere."""
    phase = np.exp(-2j * np.pi * np.arange(N_ORDERS + 1) * revolutions)
    return replace(average, lines=average.lines * phase)
