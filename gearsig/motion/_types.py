"""Motion of a gear pair along its line of action, and what follows from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import pi
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, freeze, instance_of
from gearsig.errors import RefusalError
from gearsig.results import Result
from gearsig.rig import PathOfContact, ToothContact

if TYPE_CHECKING:
    from pandas import DataFrame


@dataclass(frozen=True)
class PairMotion(Result, columns=("time_s", "driver_angle_rad", "driven_angle_rad")):
    """Measured motion of both gears.

    Parameters
    ----------
    sampling_rate_hz : float
    driver_angle_rad, driven_angle_rad : array, (n,)
        Each in its own direction, so that both rise in forward motion.
    driver_speed_rad_s, driven_speed_rad_s : array, (n,)
    driver_acceleration_rad_s2, driven_acceleration_rad_s2 : array, (n,)
    path : PathOfContact
    contact : ToothContact
    methods : mapping
        Where each came from: a channel, or the filter that made it.
    torque_nm : array or None
        On the driver's shaft.
    force_n : array or None
        Of the teeth, where something else measured or simulated it.
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
        """Distance r_b1 θ1 − r_b2 θ2 between the flanks along the line of action, against an unknown zero."""
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
        """(τ − J1 α1)/r_b1: what is left of the torque for the teeth, with their friction."""
        return None if self.torque_nm is None else self.torque_and_tooth_force()[1]

    def torque_and_tooth_force(self) -> tuple[FloatArray, FloatArray]:
        """Return the torque in N m and the tooth force from it in N, (n,) each.

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


@dataclass(frozen=True)
class Datum:
    """Zero of the compression: where it is when the teeth stand in the middle of the backlash.

    Parameters
    ----------
    compression_m : float
    uncertainty_m : float
        One standard deviation; nan where it was given.
    method : str
    """

    compression_m: float
    uncertainty_m: float
    method: str


@dataclass(frozen=True)
class ForceError:
    """How far a model's force is from the reference.

    Parameters
    ----------
    model, reference : str
    rms_n, bias_n, largest_n : float
        Root mean square, mean and largest magnitude of model − reference.
    relative_rms : float
        Root mean square over that of the reference.
    correlation : float
    """

    model: str
    reference: str
    rms_n: float
    relative_rms: float
    bias_n: float
    largest_n: float
    correlation: float


@dataclass(frozen=True)
class ForceEstimate(Result):
    """Force between the teeth from their motion, by several models.

    Parameters
    ----------
    motion : PairMotion
    datum : Datum
    depth_m : array, (n,)
        g: depth of the contact with the flank's sign, 0 in the backlash.
    n_pairs : array, (n,)
    forces_n : mapping
        Model → (n,).
    references_n : mapping
        "torque / base radius" or "tooth force" → (n,); empty where nothing was measured.
    errors : tuple of ForceError
        Of every model against every reference it can be compared with.
    descriptions : mapping
        Model → formula with its numbers.
    """

    motion: PairMotion
    datum: Datum
    depth_m: FloatArray
    n_pairs: FloatArray
    forces_n: Mapping[str, FloatArray]
    references_n: Mapping[str, FloatArray]
    errors: tuple[ForceError, ...]
    descriptions: Mapping[str, str]

    def __post_init__(self) -> None:
        freeze(self, "depth_m", "n_pairs")

    def to_frame(self) -> DataFrame:
        """Return time, references, models, depth and pairs in contact as a pandas table, one row a sample."""
        from pandas import DataFrame

        forces = {f"{name} [N]": values for name, values in {**self.references_n, **self.forces_n}.items()}
        return DataFrame(
            {"time_s": self.motion.time_s, **forces, "depth [um]": 1e6 * self.depth_m, "pairs in contact": self.n_pairs}
        )

    def error(self, model: str, reference: str) -> ForceError:
        """Return the error of one model against one reference."""
        return next(e for e in self.errors if (e.model, e.reference) == (model, reference))


def median_deviation(values: FloatArray) -> float:
    """Return the standard deviation of Gaussian values about 0 by their median magnitude: outliers do not count."""
    return 1.4826 * float(np.median(np.abs(values)))


def stands(driver_angle_rad: FloatArray, path: PathOfContact, contact: ToothContact) -> bool:
    """Say whether the driver turns by less than its play and a quarter of a tooth pitch."""
    # A machine that turns by less than that stands, though a blow may rattle it.
    return float(np.ptp(driver_angle_rad)) < _play_rad(path, contact) + 2.0 * pi / path.teeth[0] * 0.25


def check_motion(value: object) -> None:
    """Raise unless the value is the motion of a pair."""
    instance_of(value, PairMotion, "motion", remedy="gearsig.measure_motion(recording, rig) makes one")


def check_turns(motion: PairMotion) -> None:
    """Refuse a record in which the driver turns by less than its play and a quarter of a tooth pitch.

    Raises
    ------
    RefusalError
        If the machine stands.
    """
    check_motion(motion)
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
