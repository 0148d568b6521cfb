"""A machine that only stands: nothing of its motion can be told."""

from __future__ import annotations

from math import pi

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import RefusalError
from gearsig.motion.types import PairMotion
from gearsig.rig.contact import ToothContact
from gearsig.rig.tooth_pairs import PathOfContact

LEAST_PITCHES = 0.25
"""Of the driver's teeth: a machine that turns by less than that beyond its play stands, though a blow may rattle it."""


def stands(driver_angle_rad: FloatArray, path: PathOfContact, contact: ToothContact) -> bool:
    """Say whether the driver turns by less than its play and a quarter of a tooth pitch."""
    return float(np.ptp(driver_angle_rad)) < _play_rad(path, contact) + 2.0 * pi / path.teeth[0] * LEAST_PITCHES


def check_turns(motion: PairMotion) -> None:
    """Refuse a record in which the driver turns by less than its play and a quarter of a tooth pitch.

    Raises
    ------
    RefusalError
        If the machine stands.
    """
    refuse_standing(motion.driver_angle_rad, motion.path, motion.contact, motion.sampling_rate_hz, motion.source)


def refuse_standing(
    driver_angle_rad: FloatArray, path: PathOfContact, contact: ToothContact, sampling_rate_hz: float, source: str
) -> None:
    """Refuse the angle of a driver that stands; see `check_turns`."""
    if not stands(driver_angle_rad, path, contact):
        return
    turned, duration_s = float(np.ptp(driver_angle_rad)), len(driver_angle_rad) / sampling_rate_hz
    raise RefusalError(
        f"{source or 'the recording'}: the driver turns by {1e3 * turned:.3g} mrad in {duration_s:.4g} s, against a "
        f"play of {1e3 * _play_rad(path, contact):.3g} mrad: the machine stands, its stop is longer than the record",
        remedy="record a start and a braked stop",
    )


def _play_rad(path: PathOfContact, contact: ToothContact) -> float:
    return 2e-6 * contact.half_backlash_um / path.base_radii_m[0]
