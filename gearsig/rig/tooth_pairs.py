"""Which tooth pairs touch at an angle of the driver, forwards, backwards and on the back flank."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, radians, sin, sqrt
from typing import TYPE_CHECKING

import numpy as np

from gearsig.checks import FloatArray, within
from gearsig.errors import InputError, RefusalError

if TYPE_CHECKING:
    from gearsig.rig.types import GearPair, Rig


@dataclass(frozen=True)
class PathOfContact:
    """The path of contact of a spur pair in numbers.

    Tooth pair j lies at p = z1 θ1/2π − phase − j base pitches behind its entry and touches for 0 ≤ p ≤ ε, at ρ1 = ρ1A +
    p·p_b from the driver's base tangent point. A rotation alone decides: the count holds forwards and backwards alike.
    On the back flank the path is mirrored, half a pitch away from where the drive flank passes the pitch point:
    p' = −(z1 θ1/2π − phase) + 2 p_C + ½.

    Parameters
    ----------
    teeth : (int, int)
        Of driver and driven gear.
    base_radii_m : (float, float)
    contact_ratio : float
        ε, 1 to 2.
    base_pitch_m : float
    start_m : float
        ρ1A, where a pair enters.
    length_m : float
        a sin α = ρ1 + ρ2.
    phase : float
        Driver's angle in pitches at which a pair enters on the drive flank.
    """

    teeth: tuple[int, int]
    base_radii_m: tuple[float, float]
    contact_ratio: float
    base_pitch_m: float
    start_m: float
    length_m: float
    phase: float = 0.0

    @property
    def pitch_point(self) -> float:
        """p_C, where a pair passes the pitch point."""
        r1, r2 = self.base_radii_m
        return (self.length_m * r1 / (r1 + r2) - self.start_m) / self.base_pitch_m

    def position(self, driver_angle_rad: FloatArray, flank: FloatArray | float = 1.0) -> FloatArray:
        """Position of the younger pair behind its entry, 0 to 1 base pitch; the older one is one further.

        Parameters
        ----------
        driver_angle_rad : array
        flank : array or float
            Above 0: drive flank; below 0: back flank.
        """
        x = np.asarray(driver_angle_rad, dtype=np.float64) * self.teeth[0] / (2.0 * pi) - self.phase
        x = np.where(np.asarray(flank) < 0.0, 2.0 * self.pitch_point + 0.5 - x, x)
        position: FloatArray = x - np.floor(x)
        return position

    def n_pairs(self, driver_angle_rad: FloatArray, flank: FloatArray | float = 1.0) -> FloatArray:
        """Pairs in contact: 2 where u < ε − 1, else 1, with u = frac(z1 θ1/2π − phase)."""
        count: FloatArray = np.where(self.position(driver_angle_rad, flank) < self.contact_ratio - 1.0, 2.0, 1.0)
        return count

    def tooth(self, driver_angle_rad: FloatArray) -> FloatArray:
        """Tooth of the driver that entered last, from 1, as diagnoses count them."""
        x = np.asarray(driver_angle_rad, dtype=np.float64) * self.teeth[0] / (2.0 * pi) - self.phase
        number: FloatArray = np.mod(np.floor(x), self.teeth[0]) + 1.0
        return number

    def driver_lever_m(self, position: FloatArray) -> FloatArray:
        """ρ1 of a pair at `position` base pitches behind its entry."""
        lever: FloatArray = self.start_m + np.asarray(position, dtype=np.float64) * self.base_pitch_m
        return lever


def path_of_contact(rig: Rig) -> PathOfContact:
    """Return the path of contact of the pair that the rig's contact names.

    Raises
    ------
    RefusalError
        If the rig has no contact, or teeth, module or pressure angle are missing.
    """
    pair = contact_pair(rig)
    contact = rig.contact
    if contact is None:
        raise RefusalError("the rig has no [contact] table", remedy="give the contact's stiffness and backlash there")
    known = (pair.driver_teeth, pair.driven_teeth, pair.module_mm, pair.pressure_angle_deg)
    if None in known:
        raise RefusalError(
            f"pair {pair.name!r} lacks teeth, module or pressure angle, which the path of contact follows from",
            remedy="add them to its [[pair]] table",
        )
    z1, z2, module_mm, angle_deg = known
    assert z1 is not None and z2 is not None and module_mm is not None and angle_deg is not None  # noqa: S101, PT018
    return standard_path(
        (z1, z2), module_mm * 1e-3, radians(angle_deg), phase=contact.mesh_phase, contact_ratio=contact.contact_ratio
    )


def standard_path(
    teeth: tuple[int, int],
    module_m: float,
    pressure_angle_rad: float,
    *,
    phase: float = 0.0,
    contact_ratio: float | None = None,
) -> PathOfContact:
    """Return the path of contact of standard teeth: addendum of one module, no shift, reference centre distance.

    ε p_b = √(ra1² − rb1²) + √(ra2² − rb2²) − a sin α. A stated contact ratio shortens or lengthens both ends alike.

    Raises
    ------
    InputError
        If the teeth interfere, or the contact ratio is not 1 to 2.

    Examples
    --------
    >>> path = standard_path((20, 100), 5e-3, 0.3490658503988659)
    >>> round(path.contact_ratio, 3)
    1.705
    """
    r = [0.5 * module_m * z for z in teeth]
    rb1, rb2 = (radius * cos(pressure_angle_rad) for radius in r)
    base_pitch = pi * module_m * cos(pressure_angle_rad)
    length = (r[0] + r[1]) * sin(pressure_angle_rad)
    out_1, out_2 = (sqrt((radius + module_m) ** 2 - (radius * cos(pressure_angle_rad)) ** 2) for radius in r)
    if max(out_1, out_2) > length:
        raise InputError(
            f"standard teeth of {teeth[0]} and {teeth[1]} interfere: a tip reaches past the other's involute",
            where="teeth",
            remedy="give the smaller gear more teeth",
        )
    own = (out_1 + out_2 - length) / base_pitch
    ratio = own if contact_ratio is None else contact_ratio
    within(ratio, "contact_ratio", 1.0, 2.0, remedy="the model holds for one to two pairs in contact")
    start = length - out_2 - 0.5 * (ratio - own) * base_pitch
    return PathOfContact(teeth, (rb1, rb2), ratio, base_pitch, max(start, 0.0), length, phase)


def contact_pair(rig: Rig) -> GearPair:
    """Return the pair that the rig's contact belongs to."""
    name = rig.contact.pair if rig.contact is not None else ""
    if name:
        return rig.pair(name)
    if len(rig.pairs) != 1:
        raise InputError(
            f"the rig has {len(rig.pairs)} gear pairs and the contact names none",
            where="rig: [contact]",
            remedy="name the pair there",
        )
    return rig.pairs[0]
