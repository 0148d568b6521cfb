"""Motion of a gear pair from a recording: channels, units, derivatives, checks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi, sqrt

import numpy as np

from gearsig.checks import FloatArray, count, instance_of, known_name, positive
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import counted
from gearsig.recording import Channel, Recording, check_recording
from gearsig.results import Result
from gearsig.rig import (
    SI_FACTORS,
    SIDES,
    EncoderChannel,
    GearPair,
    PathOfContact,
    Rig,
    ToothContact,
    check_rig,
    contact_pair,
    path_of_contact,
    si_factor,
)


@dataclass(frozen=True)
class PairMotion(Result, columns=("time_s", "driver_angle_rad", "driven_angle_rad")):
    """Measured motion of both gears.

    Parameters
    ----------
    sampling_rate_hz : float
    driver_angle_rad, driven_angle_rad : array, (n,)
        Each counted in its gear's direction, so that both increase in forward motion.
    driver_speed_rad_s, driven_speed_rad_s : array, (n,)
    driver_acceleration_rad_s2, driven_acceleration_rad_s2 : array, (n,)
    path : PathOfContact
    contact : ToothContact
    methods : mapping
        Origin of each quantity: a channel, or the filter that derived it.
    torque_nm : array or None
        On the driver's shaft.
    force_n : array or None
        Tooth force, if measured or simulated.
    source : str
    notes : tuple of str
    """

    sampling_rate_hz: float
    driver_angle_rad: FloatArray
    driven_angle_rad: FloatArray
    driver_speed_rad_s: FloatArray
    driven_speed_rad_s: FloatArray
    driver_acceleration_rad_s2: FloatArray
    driven_acceleration_rad_s2: FloatArray
    path: PathOfContact
    contact: ToothContact
    methods: Mapping[str, str] = field(default_factory=dict)
    torque_nm: FloatArray | None = None
    force_n: FloatArray | None = None
    source: str = ""
    notes: tuple[str, ...] = ()

    @property
    def time_s(self) -> FloatArray:
        """Times of the samples from 0."""
        return np.arange(len(self.driver_angle_rad)) / self.sampling_rate_hz

    @property
    def compression_m(self) -> FloatArray:
        """Compression r_b1 θ1 − r_b2 θ2 along the line of action, (n,), with an unknown zero."""
        return self._difference(self.driver_angle_rad, self.driven_angle_rad)

    @property
    def compression_rate_mps(self) -> FloatArray:
        """Its rate."""
        return self._difference(self.driver_speed_rad_s, self.driven_speed_rad_s)

    @property
    def compression_acceleration_mps2(self) -> FloatArray:
        """Its acceleration."""
        return self._difference(self.driver_acceleration_rad_s2, self.driven_acceleration_rad_s2)

    @property
    def shaft_force_n(self) -> FloatArray | None:
        """Measured torque over the base radius, τ/r_b1."""
        return None if self.torque_nm is None else self.torque_nm / self.path.base_radii_m[0]

    @property
    def tooth_force_from_torque_n(self) -> FloatArray | None:
        """(τ − J1 α1)/r_b1: the part of the torque that acts on the teeth, including their friction."""
        return None if self.torque_nm is None else self.torque_and_tooth_force()[1]

    def torque_and_tooth_force(self) -> tuple[FloatArray, FloatArray]:
        """Return the torque in N m and the tooth force derived from it in N, each (n,).

        Raises
        ------
        RefusalError
            If no torque was measured.
        """
        if self.torque_nm is None:
            raise RefusalError("no torque was measured", remedy="record the torque of the driver's shaft")
        inertia = self.contact.driver_inertia_kg_m2 * self.driver_acceleration_rad_s2
        return self.torque_nm, (self.torque_nm - inertia) / self.path.base_radii_m[0]

    def _difference(self, driver: FloatArray, driven: FloatArray) -> FloatArray:
        r1, r2 = self.path.base_radii_m
        return r1 * driver - r2 * driven


def median_deviation(values: FloatArray) -> float:
    """Return the standard deviation of Gaussian values about 0 by their median magnitude, robust to outliers."""
    return 1.4826 * float(np.median(np.abs(values)))


def stands(driver_angle_rad: FloatArray, path: PathOfContact, contact: ToothContact) -> bool:
    """Whether the driver turns by less than its backlash plus a quarter of a tooth pitch."""
    # A machine that turns by less than that is at rest, though impacts may rattle it.
    return float(np.ptp(driver_angle_rad)) < _play_rad(path, contact) + 2.0 * pi / path.teeth[0] * 0.25


def check_motion(value: object) -> None:
    """Raise unless the value is a `PairMotion`."""
    instance_of(value, PairMotion, "motion", remedy="gearsig.measure_motion(recording, rig) makes one")


def check_turns(motion: PairMotion) -> None:
    """Refuse a record in which the driver turns by less than its backlash plus a quarter of a tooth pitch.

    Raises
    ------
    RefusalError
        If the machine is at rest.
    """
    check_motion(motion)
    check_driver_turns(motion.driver_angle_rad, motion.path, motion.contact, motion.sampling_rate_hz, motion.source)


def check_driver_turns(
    driver_angle_rad: FloatArray, path: PathOfContact, contact: ToothContact, sampling_rate_hz: float, source: str
) -> None:
    """Refuse the angle of a driver at rest; see `check_turns`."""
    if not stands(driver_angle_rad, path, contact):
        return
    turned, duration_s = float(np.ptp(driver_angle_rad)), len(driver_angle_rad) / sampling_rate_hz
    raise RefusalError(
        f"{source or 'the recording'}: the driver turns by {1e3 * turned:.3g} mrad in {duration_s:.4g} s, against a "
        f"backlash of {1e3 * _play_rad(path, contact):.3g} mrad: the machine stands still, its stop is "
        "longer than the record",
        remedy="record a start and a braked stop",
    )


def _play_rad(path: PathOfContact, contact: ToothContact) -> float:
    return 2e-6 * contact.half_backlash_um / path.base_radii_m[0]


QUANTITY_OF = {"angle": ("angle", "encoder"), "speed": ("rotational_speed",), "acceleration": ("angular_acceleration",)}
ROLES = (*(f"{side} {what}" for what in QUANTITY_OF for side in SIDES), "torque", "force")
"""Roles of channels: angle, speed and acceleration of each gear, torque of the driver's shaft, tooth force."""


def find_roles(recording: Recording, pair: GearPair, assigned: Mapping[str, str] | None = None) -> dict[str, str]:
    """Find the channel of each role that the recording has.

    A channel belongs to a gear if its position is the name of that gear's shaft, or if its name contains the shaft's
    name (or "driver", "driven").

    Parameters
    ----------
    recording : Recording
    pair : GearPair
    assigned : mapping or None
        Role → channel, used without checks; an empty channel leaves the role out.

    Raises
    ------
    InputError
        If a role or channel does not exist, or several channels fit one role.
    """
    chosen = dict(assigned or {})
    for role, name in chosen.items():
        known_name(role, ROLES, f"there is no role {role!r}")
        if name:
            recording.index(name)
    for role in ROLES:
        fitting = [c.name for c in recording.channels if _fits(c, role, pair)]
        if role not in chosen and len(fitting) > 1:
            raise InputError(
                f"channels {', '.join(map(repr, fitting))} could each be the {role}",
                where=recording.provenance.source or "recording",
                remedy=f'give positions in their [[sensor]] tables, or say which to use as "{role}"',
            )
        if role not in chosen and fitting:
            chosen[role] = fitting[0]
    return {role: chosen[role] for role in ROLES if chosen.get(role)}


def role_values(recording: Recording, rig: Rig, role: str, name: str) -> FloatArray:
    """Return a channel's values in rad, rad/s, rad/s², N m or N.

    Raises
    ------
    InputError
        If the unit is not known or belongs to another quantity.
    """
    channel = recording.channels[recording.index(name)]
    return np.asarray(recording.values(name), dtype=np.float64) * _si_scale(channel, rig, role.rpartition(" ")[2])


def _si_scale(channel: Channel, rig: Rig, quantity: str) -> float:
    source = rig.speed
    if quantity == "angle" and isinstance(source, EncoderChannel) and source.channel == channel.name:
        return 2.0 * pi / source.units_per_revolution
    measured = QUANTITY_OF[quantity][0] if quantity in QUANTITY_OF else quantity
    factor = si_factor(measured, channel.unit)
    if factor is None:
        raise InputError(
            f"the unit of channel {channel.name!r} is {channel.unit!r}",
            allowed=", ".join(SI_FACTORS[measured]),
            remedy="give unit (and scale) in a [[sensor]] table of the rig file",
        )
    return factor


def _fits(channel: Channel, role: str, pair: GearPair) -> bool:
    side, _, quantity = role.rpartition(" ")
    if not side:
        return channel.quantity == quantity
    if channel.quantity not in QUANTITY_OF[quantity]:
        return False
    return side == side_of(channel, pair)


def side_of(channel: Channel, pair: GearPair) -> str:
    """Return "driver", "driven" or ""; if one shaft's name contains the other's, the longer one decides."""
    names = sorted(((pair.driver, "driver"), (pair.driven, "driven")), key=lambda entry: -len(entry[0]))
    for shaft, side in names:
        if channel.position == shaft:
            return side
    text = channel.name.casefold()
    for word, side in (*names, ("driven", "driven"), ("driver", "driver")):
        if word and word.casefold() in text:
            return side
    return ""


ALLOWED = {1: 0.03, 2: 0.06}
"""Maximum relative errors of the scales of speeds and accelerations."""
MIN_RATE_HZ = {1: 0.0, 2: 4000.0}
"""Minimum sampling rates for the comparison: below, ringing of an acceleration aliases in the same way in each start,
so that its sum is wrong and its scatter does not show it."""
CERTAIN = 5.0
"""Minimum error of a scale, in standard errors."""


def channel_scale(
    angle_rad: FloatArray, rate: FloatArray, sampling_rate_hz: float, order: int = 1
) -> tuple[float, float]:
    """Return the scale of a speed or acceleration against the angle, and its standard error.

    Speed: ∫ ω dt = s Δθ over windows of 50 ms. Acceleration: the second difference of ∬ α dt² is s times that of θ.
    Least squares with the angle as regressor, as counters measure it nearly without noise. The error comes from
    leaving out each window (jackknife), as impacts between samples spoil single ones.

    Parameters
    ----------
    angle_rad : array, (n,)
    rate : array, (n,)
        In rad/s or rad/s².
    sampling_rate_hz : float
    order : int
        1: speed, 2: acceleration.

    Returns
    -------
    scale, standard_error : float
        The scale is 1 if both agree; both are nan if there was hardly any motion, or motion in one window only.
    """
    # Compare changes over 50 ms: longer than flanks ring, shorter than a start.
    step = max(2, round(0.05 * sampling_rate_hz))
    edges = np.arange(0, len(angle_rad), step)
    if len(edges) <= 8:
        return float("nan"), float("nan")
    summed = rate
    for _ in range(order):
        summed = np.concatenate([[0.0], np.cumsum(0.5 * (summed[1:] + summed[:-1]))]) / sampling_rate_hz
    x, y = np.diff(angle_rad[edges], order), np.diff(summed[edges], order)
    powers, products = x * x, x * y
    total = float(np.sum(powers))
    # A single window may contribute at most half of the sum of squares.
    if float(np.max(powers)) >= 0.5 * total:
        return float("nan"), float("nan")
    without = (np.sum(products) - products) / (total - powers)
    error = sqrt((len(x) - 1.0) * float(np.var(without)))
    return float(np.sum(products)) / total, error


def check_scale(
    angle_rad: FloatArray, rate: FloatArray, sampling_rate_hz: float, *, order: int, names: tuple[str, str], where: str
) -> None:
    """Refuse a speed or acceleration that is inconsistent with the angle.

    Parameters
    ----------
    angle_rad, rate : array, (n,)
    sampling_rate_hz : float
    order : int
        1: speed, 2: acceleration.
    names : (str, str)
        Of both channels.
    where : str
        Recording, for the error.

    Raises
    ------
    InputError
        If the scale is off by more than 3 % (speeds) or 6 % (accelerations, from 4 kHz) and by more than five standard
        errors.
    """
    if sampling_rate_hz < MIN_RATE_HZ[order]:
        return
    scale, error = channel_scale(angle_rad, rate, sampling_rate_hz, order)
    if not abs(scale - 1.0) > max(ALLOWED[order], CERTAIN * error):
        return
    raise InputError(
        f"channel {names[1]!r} reads {scale:.3g} times what follows from {names[0]!r}",
        where=where,
        allowed=f"1 ± {ALLOWED[order]:g}",
        remedy=f"correct unit or scale of {names[1]!r} in its [[sensor]] table, or leave that channel out of the file",
    )


def check_angle(angle_rad: FloatArray, sampling_rate_hz: float, name: str, where: str = "") -> None:
    """Raise if an angle that should be continuous is not.

    Parameters
    ----------
    angle_rad : array, (n,)
    sampling_rate_hz : float
    name, where : str
        Of the channel and of its recording, for the error.

    Raises
    ------
    InputError
        At the first step of nearly a whole revolution (an encoder that wraps), or at a jump.
    """
    check_wrap(angle_rad, sampling_rate_hz, name, where)
    steps, beyond = _steps(angle_rad)
    moving = np.abs(steps[steps != 0.0])
    quantum = float(moving.min()) if len(moving) else 0.0
    # A jump exceeds a thousandth of a revolution, which no loaded gear moves within one sample; fifty times the typical
    # change of the increments, of which an impact reaches a tenth; and four steps of a coarse encoder.
    limit = max(2e-3 * pi, 50.0 * median_deviation(beyond), 4.0 * quantum)
    jumps = np.flatnonzero(beyond > limit)
    if len(jumps):
        i = int(jumps[0])
        raise InputError(
            f"channel {name!r} jumps by {abs(steps[i]):.4g} rad {_time_text(i, sampling_rate_hz)} "
            f"({counted(len(jumps), 'such jump')})",
            where=where,
            allowed="a continuous angle",
            remedy="cut the recording there; lost counts make all later forces wrong",
        )


def check_wrap(angle_rad: FloatArray, sampling_rate_hz: float, name: str, where: str = "") -> None:
    """Raise if an angle steps by nearly a whole revolution: an encoder that restarts after each.

    Parameters
    ----------
    angle_rad : array, (n,)
    sampling_rate_hz : float
    name, where : str
        Of the channel and of its recording, for the error.

    Raises
    ------
    InputError
        At the first such step, or if there are fewer than 4 samples.
    """
    if len(angle_rad) < 4:
        raise InputError(f"channel {name!r} has {len(angle_rad)} samples", where=where, allowed="at least 4")
    turns = _steps(angle_rad)[1] / (2.0 * pi)
    # An encoder's restart is a step of one revolution, to within a tenth.
    jumps = np.flatnonzero(np.abs(turns - 1.0) < 0.1)
    if len(jumps):
        i = int(jumps[0])
        raise InputError(
            f"channel {name!r} steps by {turns[i]:.3g} revolutions {_time_text(i, sampling_rate_hz)}: the encoder "
            "starts again after each revolution",
            where=where,
            allowed="a continuous angle",
            remedy=f"give wraps = true in the rig file, in [speed] or in the [[sensor]] table of {name!r} (force, "
            "start-stop and identify also take --unwrap)",
        )


def _steps(angle_rad: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angle's steps, and the excess of each over the steps around it."""
    steps = np.diff(angle_rad)
    # The steps around it: the median of three, so that a jump does not hide itself.
    around = np.sort(np.stack([np.roll(steps, 1), steps, np.roll(steps, -1)]), axis=0)[1]
    around[0], around[-1] = steps[1], steps[-2]
    return steps, np.abs(steps - around)


def _time_text(step: int, sampling_rate_hz: float) -> str:
    return f"from {step / sampling_rate_hz:.6g} to {(step + 1) / sampling_rate_hz:.6g} s"


ORDER = 3
SHORTEST = 7
"""Samples of the shortest window, for a cubic through seven."""


@dataclass(frozen=True)
class LocalPolynomial:
    """Savitzky–Golay filter: a cubic fitted to a sliding window gives value and derivatives at its middle.

    Parameters
    ----------
    window : int
        Odd number of samples, 5 or more.
    sampling_rate_hz : float

    Notes
    -----
    Smoothing and derivatives are flat to the third power of frequency. Anything beyond the bandwidth is lost, and an
    impact shorter than the window is smeared over it.

    Source: A. Savitzky, M. J. E. Golay, Smoothing and differentiation of data by simplified least squares procedures,
    Analytical Chemistry 36 (1964); R. W. Schafer, What is a Savitzky–Golay filter?, IEEE Signal Processing Magazine 28
    (2011).
    """

    window: int
    sampling_rate_hz: float

    def __post_init__(self) -> None:
        count(self.window, "window", minimum=5)
        if self.window % 2 == 0:
            raise InputError(f"window is {self.window}", allowed="an odd number of samples")
        positive(self.sampling_rate_hz, "sampling_rate_hz", "Hz")

    @property
    def bandwidth_hz(self) -> float:
        """Frequency at which smoothing halves the power."""
        from scipy.signal import freqz, savgol_coeffs

        f, response = freqz(savgol_coeffs(self.window, ORDER), worN=8192, fs=self.sampling_rate_hz)
        gain = np.abs(response)
        below = int(np.argmax(gain < np.sqrt(0.5)))
        share = (gain[below - 1] - np.sqrt(0.5)) / (gain[below - 1] - gain[below])
        return float(f[below - 1] + share * (f[below] - f[below - 1]))

    @property
    def text(self) -> str:
        """Description of the filter for users."""
        return f"Savitzky–Golay, cubic over {self.window} samples, −3 dB at {self.bandwidth_hz:.4g} Hz"

    def apply(self, values: FloatArray, derivative: int = 0) -> FloatArray:
        """Smoothed values, or their first or second derivative, (n,); the last window's cubic gives the ends."""
        from scipy.signal import savgol_filter

        if len(values) < self.window:
            raise InputError(f"{len(values)} samples are too few", allowed=f"{self.window} or more")
        result: FloatArray = savgol_filter(
            values, self.window, ORDER, deriv=derivative, delta=1.0 / self.sampling_rate_hz, mode="interp"
        )
        return result


def local_polynomial(sampling_rate_hz: float, bandwidth_hz: float | None = None) -> LocalPolynomial:
    """Return the filter with the largest bandwidth up to the one requested; None: the shortest filter.

    Raises
    ------
    InputError
        If the bandwidth is above that of the shortest window.
    """
    shortest = LocalPolynomial(SHORTEST, sampling_rate_hz)
    if bandwidth_hz is None:
        return shortest
    positive(bandwidth_hz, "bandwidth_hz", "Hz")
    if bandwidth_hz > shortest.bandwidth_hz * 1.001:
        raise InputError(
            f"bandwidth_hz is {bandwidth_hz:g} Hz",
            allowed=f"up to {shortest.bandwidth_hz:.4g} Hz at {sampling_rate_hz:g} Hz sampling rate",
        )
    # The bandwidth falls nearly as 1/window: an initial guess, then step by step.
    window = int(SHORTEST * shortest.bandwidth_hz / bandwidth_hz) // 2 * 2 + 1
    window = max(window - 4, SHORTEST)
    while LocalPolynomial(window, sampling_rate_hz).bandwidth_hz > bandwidth_hz:
        window += 2
    return LocalPolynomial(window, sampling_rate_hz)


RATIO_TOLERANCE = 0.02
MAX_PLAY_TEETH = 0.5
"""Maximum difference of both angles as a fraction of a tooth pitch, for the backlash."""


def measure_motion(
    recording: Recording,
    rig: Rig | None = None,
    *,
    use: Mapping[str, str] | None = None,
    bandwidth_hz: float | None = None,
    unwrap: bool = False,
) -> PairMotion:
    """Return the motion of the gear pair whose contact the rig describes.

    Measured quantities are used unchanged. A missing speed is the derivative of the angle, a missing acceleration that
    of the speed (else the second derivative of the angle), by a Savitzky–Golay filter. A missing angle is the integral
    of the speed, which drifts.

    Parameters
    ----------
    recording : Recording
    rig : Rig or None
        With a contact; default: the recording's own.
    use : mapping or None
        Role → channel, see `gearsig.motion.ROLES`; the others are found by name.
    bandwidth_hz : float or None
        Everything is smoothed to it. None: measured quantities are unchanged and derivatives use seven samples.
    unwrap : bool
        Whether angles restart after each revolution.

    Raises
    ------
    InputError
        If an angle jumps or wraps, the ratio of both angles contradicts the teeth, a speed or acceleration contradicts
        its angle, or a unit is not known.
    RefusalError
        If the rig has no contact, or neither angle nor speed of a gear was measured.
    """
    check_recording(recording)
    check_rig(rig)
    instance_of(use, Mapping | None, "use", remedy='write {"driven angle": "enc2"}')
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
    """Reads channels, derives what is missing and records the origin of each."""

    recording: Recording
    rig: Rig
    roles: Mapping[str, str]
    smoother: LocalPolynomial
    smooths: bool
    unwrap: bool
    methods: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def measured(self, role: str) -> FloatArray:
        """Return a measured channel in SI units, smoothed if a bandwidth is given."""
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
        angle_role, speed_role, acceleration_role = (
            f"{side} {quantity}" for quantity in ("angle", "speed", "acceleration")
        )
        if angle_role not in self.roles and speed_role not in self.roles:
            raise RefusalError(
                f"neither angle nor speed of the {side} gear was measured: the distance of the flanks is not known",
                remedy='give its channel quantity = "angle" and the shaft\'s name as position in its [[sensor]] table, '
                f'or use it as "{angle_role}"; an acceleration alone drifts away',
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
        for order, quantity in ((1, "speed"), (2, "acceleration")):
            name = self.roles.get(f"{side} {quantity}")
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
    """Refuse angles that do not belong to one gear pair: wrong sign, unit or shaft."""
    z1, z2 = path.teeth
    first, last = int(np.argmin(driver_rad)), int(np.argmax(driver_rad))
    turned, follows = driver_rad[last] - driver_rad[first], driven_rad[last] - driven_rad[first]
    expected = turned * z1 / z2
    # Below 0.2 rad of the driver the ratio of both angles is not significant.
    if turned < 0.2 or abs(follows - expected) < RATIO_TOLERANCE * expected + MAX_PLAY_TEETH * 2.0 * pi / z2:
        return
    against = abs(follows + expected) < RATIO_TOLERANCE * expected + MAX_PLAY_TEETH * 2.0 * pi / z2
    raise InputError(
        f"the driver turns by {turned:.4g} rad and the driven gear by {follows:.4g} rad"
        + (", in the opposite direction" if against else ""),
        where=where,
        allowed=f"{expected:.4g} rad, by {z1} and {z2} teeth, each counted in its gear's direction",
        remedy="give scale = -1 in the driven angle's [[sensor]]" if against else "check units, scales and teeth",
    )
