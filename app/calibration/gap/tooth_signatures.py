"""Signatures of one damaged tooth, see `app.calibration.gap.signatures`."""

from __future__ import annotations

import numpy as np

from app.calibration.gap.chance import LARGEST_ADVANCE, balance, draw_side, sign
from app.calibration.gap.scene import Scene, passings, ring, struck
from app.calibration.gap.vibration import Signature
from gearsig.checks import FloatArray


def _tooth_window(scene: Scene, side: int, width_teeth: float, rng: np.random.Generator) -> tuple[FloatArray, float]:
    """Return 1 in the middle of one tooth's mesh, 0 away from it, and that tooth's place in revolutions."""
    place, teeth = float(rng.uniform()), scene.teeth[side]
    off = (scene.revolutions * scene.shaft_orders[side] - place + 0.5) % 1.0 - 0.5
    reach = np.clip(off * teeth / width_teeth, -1.0, 1.0)
    window: FloatArray = 0.5 + 0.5 * np.cos(np.pi * reach)
    return window, place


def _tooth_knocks(
    scene: Scene, side: int, place: float, scatter: float, rng: np.random.Generator, of: int = 1
) -> FloatArray:
    """Return knocks when a tooth meshes, `of` of them a fraction of a pitch apart, in standard deviations at most 1."""
    answer, order, total = ring(scene, rng), scene.shaft_orders[side], np.zeros(len(scene.time_s))
    for _ in range(of):
        at = passings(scene, order, -place - float(rng.uniform(0.0, 0.7)) / scene.teeth[side])
        total += struck(at, np.maximum(rng.normal(1.0, scatter, len(at)), 0.0) * sign(rng), scene, answer)
    return total / max(float(np.abs(total).max()), 1e-12)


def root_crack(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A softer tooth: it comes late and gives way while it carries, slower than the mesh; the mesh swings on.

    A deep crack lets the next tooth strike.
    """
    side = draw_side(rng)
    window, place = _tooth_window(scene, side, float(rng.uniform(0.8, 2.0)), rng)
    gain, late = rng.uniform(0.0, 1.0, 2)
    blow, slow = balance(rng, 2) * (4.0, 2.0)
    knock = _tooth_knocks(scene, side, place, 0.03, rng)
    giving_way = np.gradient(np.gradient(window))
    giving_way /= max(float(np.abs(giving_way).max()), 1e-12)
    return Signature(
        _swollen(sign(rng) * gain * size, window),
        _late(scene, late * size, window, rng),
        (blow * size * knock, slow * size * giving_way),
    )


def _swollen(share: float, window: FloatArray) -> FloatArray:
    swollen: FloatArray = np.maximum(1.0 + share * window, 0.0)
    return swollen


def _late(scene: Scene, share: float, window: FloatArray, rng: np.random.Generator) -> FloatArray:
    late: FloatArray = sign(rng) * LARGEST_ADVANCE * min(share, 1.0) / scene.teeth[0] * window
    return late


def tooth_spall(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A pit: short blows when the flank enters and leaves it, different each time; the mesh hardly notices."""
    side = draw_side(rng)
    window, place = _tooth_window(scene, side, float(rng.uniform(0.3, 0.8)), rng)
    blows = _tooth_knocks(scene, side, place, float(rng.uniform(0.05, 0.4)), rng, of=2)
    return Signature(_swollen(sign(rng) * 0.4 * size * rng.uniform(), window), None, (4.0 * size * blows,))


def chipped_tooth(scene: Scene, size: float, rng: np.random.Generator) -> Signature:
    """A missing corner: load is lost, the next tooth takes it with a blow."""
    side = draw_side(rng)
    window, place = _tooth_window(scene, side, float(rng.uniform(0.5, 1.2)), rng)
    blow = _tooth_knocks(scene, side, place, 0.08, rng)
    return Signature(
        _swollen(sign(rng) * size * rng.uniform(0.3, 1.2), window),
        _late(scene, size * rng.uniform(0.3, 1.2), window, rng),
        (4.0 * size * 10.0 ** -rng.uniform(0.0, 0.7) * blow,),
    )
