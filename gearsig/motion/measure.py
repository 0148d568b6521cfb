"""From a recording to the motion of a gear pair: channels, units, derivatives, checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi

import numpy as np

from gearsig.checks import FloatArray
from gearsig.errors import InputError, RefusalError
from gearsig.motion.angle_faults import check_angle
from gearsig.motion.channel_gains import check_scale
from gearsig.motion.derivatives import LocalPolynomial, local_polynomial
from gearsig.motion.roles import SIDES, find_roles, role_values
from gearsig.motion.standing import stands
from gearsig.motion.types import PairMotion
from gearsig.recording.types import Recording
from gearsig.rig.speed import EncoderChannel
from gearsig.rig.tooth_pairs import PathOfContact, contact_pair, path_of_contact
from gearsig.rig.types import Rig

RATIO_TOLERANCE = 0.02
LEAST_TURN_RAD = 0.2
"""Turn of the driver below which the ratio of both angles says nothing."""
MOST_PLAY_TEETH = 0.5
"""Of a tooth pitch: both angles may differ by the backlash."""


def measure_motion(
    recording: Recording,
    rig: Rig | None = None,
    *,
    use: Mapping[str, str] | None = None,
    bandwidth_hz: float | None = None,
    unwrap: bool = False,
) -> PairMotion:
    """Return the motion of the gear pair whose contact the rig describes.

    What is measured is taken as it is. A missing speed is the slope of the angle, a missing acceleration that of the
    speed (else the second derivative of the angle), by a Savitzky–Golay filter. A missing angle is the sum of the
    speed, which drifts.

    Parameters
    ----------
    recording : Recording
    rig : Rig or None
        With a contact; default: the recording's own.
    use : mapping or None
        Role → channel, see `gearsig.motion.roles.ROLES`; the others are found by name.
    bandwidth_hz : float or None
        Everything is smoothed to it. None: what is measured stays as it is, derivatives come from seven samples.
    unwrap : bool
        Whether angles start again after each revolution.

    Raises
    ------
    InputError
        If an angle jumps or wraps, both angles do not go together as the teeth want, a speed or acceleration does not
        go with its angle, or a unit is not known.
    RefusalError
        If the rig has no contact, or neither angle nor speed of a gear was measured.
    """
    known = rig or recording.rig
    if known is None:
        raise RefusalError("no rig is known", remedy="give a rig file with [[pair]] and [contact]")
    path = path_of_contact(known)
    roles = find_roles(recording, contact_pair(known), use)
    smoother = local_polynomial(recording.sampling_rate_hz, bandwidth_hz)
    reader = _Reader(recording, known, roles, smoother, bandwidth_hz is not None, unwrap)
    driver, driven = (reader.side(side) for side in SIDES)
    _check_ratio(driver[0], driven[0], path, recording.provenance.source or "recording")
    contact = known.contact
    assert contact is not None  # noqa: S101  path_of_contact has seen to it
    if not stands(driver[0], path, contact):
        for side, motion in zip(SIDES, (driver, driven), strict=True):
            reader.check_scales(side, motion)
    torque, force = (reader.measured(role) if role in roles else None for role in ("torque", "force"))
    return PairMotion(
        recording.sampling_rate_hz,
        driver[0],
        driven[0],
        driver[1],
        driven[1],
        driver[2],
        driven[2],
        path=path,
        contact=contact,
        methods=reader.methods,
        torque_nm=torque,
        force_n=force,
        source=recording.provenance.source,
        notes=tuple(reader.notes),
    )


@dataclass
class _Reader:
    """Reads channels and derives what is missing, keeping book of it."""

    recording: Recording
    rig: Rig
    roles: Mapping[str, str]
    smoother: LocalPolynomial
    smooths: bool
    unwrap: bool
    methods: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def measured(self, role: str) -> FloatArray:
        """Return a measured channel in SI units, smoothed where a bandwidth is wanted."""
        name = self.roles[role]
        values = role_values(self.recording, self.rig, role, name)
        if role.endswith(" angle"):
            if self.unwrap or self._wraps(name):
                values = np.unwrap(values)
                self.notes.append(f"channel {name!r} was unwrapped")
            check_angle(values, self.recording.sampling_rate_hz, name, self.recording.provenance.source)
        self.methods[role] = f"channel {name!r}" + (f", {self.smoother.text}" if self.smooths else "")
        return self.smoother.apply(values) if self.smooths else values

    def side(self, side: str) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return angle, speed and acceleration of one gear."""
        angle_role, speed_role, acceleration_role = (f"{side} {what}" for what in ("angle", "speed", "acceleration"))
        if angle_role not in self.roles and speed_role not in self.roles:
            raise RefusalError(
                f"neither angle nor speed of the {side} gear was measured: how far the flanks are apart is not known",
                remedy=f'name the channel, e.g. --use "{angle_role}=CHANNEL", or give it quantity = "angle" and the '
                "shaft's name as position in its [[sensor]] table; an acceleration alone drifts away",
            )
        speed = self.measured(speed_role) if speed_role in self.roles else None
        if angle_role in self.roles:
            angle = self.measured(angle_role)
        else:
            assert speed is not None  # noqa: S101  one of the two was measured
            angle = self._summed(speed, side)
        if speed is None:
            speed = self._derived(speed_role, angle, 1, "angle")
        if acceleration_role in self.roles:
            return angle, speed, self.measured(acceleration_role)
        if speed_role in self.roles:
            return angle, speed, self._derived(acceleration_role, speed, 1, "speed")
        return angle, speed, self._derived(acceleration_role, angle, 2, "angle")

    def check_scales(self, side: str, motion: tuple[FloatArray, FloatArray, FloatArray]) -> None:
        """Refuse a measured speed or acceleration that the measured angle of that gear contradicts."""
        angle = self.roles.get(f"{side} angle")
        for order, what in ((1, "speed"), (2, "acceleration")):
            name = self.roles.get(f"{side} {what}")
            if angle is not None and name is not None:
                where, rate = self.recording.provenance.source or "recording", self.recording.sampling_rate_hz
                check_scale(motion[0], motion[order], rate, order=order, names=(angle, name), where=where)

    def _derived(self, role: str, values: FloatArray, order: int, of: str) -> FloatArray:
        self.methods[role] = f"{'second ' if order == 2 else ''}derivative of the {of}: {self.smoother.text}"
        return self.smoother.apply(values, order)

    def _summed(self, speed: FloatArray, side: str) -> FloatArray:
        self.methods[f"{side} angle"] = "sum of the speed (trapezoids), from 0"
        self.notes.append(
            f"the {side} angle is the sum of its speed: an offset of 1 mrad/s moves it by 1 mrad each second"
        )
        steps = 0.5 * (speed[1:] + speed[:-1]) / self.recording.sampling_rate_hz
        return np.concatenate([[0.0], np.cumsum(steps)])

    def _wraps(self, name: str) -> bool:
        sources = (self.recording.speed, self.rig.speed)
        return any(isinstance(s, EncoderChannel) and s.channel == name and s.wraps for s in sources) or any(
            sensor.channel == name and sensor.wraps for sensor in self.rig.sensors
        )


def _check_ratio(driver_rad: FloatArray, driven_rad: FloatArray, path: PathOfContact, where: str) -> None:
    """Refuse angles that do not belong to one gear pair: another sense, another unit, another shaft."""
    z1, z2 = path.teeth
    first, last = int(np.argmin(driver_rad)), int(np.argmax(driver_rad))
    turned, follows = driver_rad[last] - driver_rad[first], driven_rad[last] - driven_rad[first]
    expected = turned * z1 / z2
    if (
        turned < LEAST_TURN_RAD
        or abs(follows - expected) < RATIO_TOLERANCE * expected + MOST_PLAY_TEETH * 2.0 * pi / z2
    ):
        return
    against = abs(follows + expected) < RATIO_TOLERANCE * expected + MOST_PLAY_TEETH * 2.0 * pi / z2
    raise InputError(
        f"the driver turns by {turned:.4g} rad and the driven gear by {follows:.4g} rad"
        + (", the other way round" if against else ""),
        where=where,
        allowed=f"{expected:.4g} rad, by {z1} and {z2} teeth, both counted in their gear's own direction",
        remedy="give scale = -1 in the driven angle's [[sensor]]" if against else "check units, scales and teeth",
    )
