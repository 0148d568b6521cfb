"""The zero of the compression: encoders start anywhere, and a loaded flank gives way by hundredths of a millimetre."""

from __future__ import annotations

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.motion.types import Datum, PairMotion

LOADED = 0.2
"""Part of the load of one sample in twenty from which on a sample counts as loaded: no single blow decides."""
LEAST_SAMPLES = 20
AGREEMENT = 0.35
"""How far the width between both flanks may be from the rig's backlash, as a part of it, for a datum without torque."""


def find_datum(motion: PairMotion, wanted: str | float = "auto") -> Datum:
    """Return the compression at which the teeth stand in the middle of the backlash.

    Parameters
    ----------
    motion : PairMotion
    wanted : str or float
        "auto": from the torque where there is one, else midway between the two flanks; "zero": the angles count from
        the middle of the backlash; a number: that compression in m.

    Raises
    ------
    RefusalError
        If there is no torque and the teeth did not touch both flanks.
    """
    if isinstance(wanted, str):
        if wanted == "zero":
            return Datum(0.0, float("nan"), "the angles' own zero")
        if wanted != "auto":
            raise InputError(f"datum is {wanted!r}", allowed="auto, zero, or a compression")
        return _from_torque(motion) if motion.torque_nm is not None else _between_flanks(motion)
    return Datum(float(wanted), float("nan"), "given")


def elastic_depth(motion: PairMotion, force_n: FloatArray) -> FloatArray:
    """Depth with sign at which the pairs that touch carry a force at rest."""
    contact, path = motion.contact, motion.path
    n = path.n_pairs(motion.driver_angle_rad, np.sign(force_n))
    yielding: FloatArray = np.sign(force_n) * (np.abs(force_n) / (n * contact.stiffness_n_per_m_lambda)) ** (
        1.0 / contact.exponent
    )
    return yielding


def _from_torque(motion: PairMotion) -> Datum:
    """Median of q − sgn(F) a − g(F) over loaded samples: the mean depth then carries the measured torque."""
    force = motion.tooth_force_from_torque_n
    assert force is not None  # noqa: S101  the caller has looked
    loaded = np.abs(force) > LOADED * np.quantile(np.abs(force), 0.95)
    if np.count_nonzero(loaded) < LEAST_SAMPLES or not np.any(force):
        raise RefusalError(
            f"{np.count_nonzero(loaded)} samples carry a load: the zero of the compression cannot be found",
            remedy="record while the machine drives, or tell the zero to gearsig force by --datum",
        )
    a = motion.contact.half_backlash_um * 1e-6
    zero = (motion.compression_m - np.sign(force) * a - elastic_depth(motion, force))[loaded]
    middle = float(np.median(zero))
    spread = 1.4826 * float(np.median(np.abs(zero - middle)))
    return Datum(middle, 1.25 * spread / np.sqrt(len(zero)), f"from the torque, {len(zero)} loaded samples")


def _between_flanks(motion: PairMotion) -> Datum:
    low, high = np.quantile(motion.compression_m, [0.01, 0.99])
    play = 2e-6 * motion.contact.half_backlash_um
    if not play or abs(high - low - play) > AGREEMENT * play:
        raise RefusalError(
            f"there is no torque, and the distance between the flanks spans {1e6 * (high - low):.4g} µm where the "
            f"backlash is {1e6 * play:.4g} µm: which flank touches cannot be told",
            remedy="record the torque, or a start and stop that touches both flanks, or tell the zero to gearsig force "
            "by --datum",
        )
    return Datum(
        float(low + high) / 2.0,
        float(high - low - play) / 2.0,
        "midway between both flanks; they may yield differently",
    )
