"""Along the face width: helix, crowning and misalignment, each slice of the face with its own phase and gap."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, cos, pi, radians, tan

import numpy as np

from gearsig.checks import FloatArray, count, not_negative, within
from sims.mesh._geometry import GearGeometry
from sims.mesh._pair import PairGeometry

MAX_SLICES = 64
"""Of the face width; compiled code holds as many."""


@dataclass(frozen=True)
class Lead:
    """How the flanks of a pair run along the face width, both gears together.

    Parameters
    ----------
    helix_angle_deg : float
        β on the reference circle, −45 to 45; above 0: the driver is right-handed. The gears of the pair are those of
        the transverse section, see `transverse_section`.
    crowning_um : float
        Metal taken off at both ends of the face, a parabola from its middle; along the line of action.
    error_um : float
        Misalignment: by how much the flanks are further apart at the far end of the face (+z) than at the near one,
        in the plane of action (F_β of ISO 6336-1).
    n_slices : int
        Of equal width; 1 for straight, even flanks.

    Notes
    -----
    Slices yield each for themselves, as in ISO 6336-1: a slice that carries does not bend its neighbours.
    """

    helix_angle_deg: float = 0.0
    crowning_um: float = 0.0
    error_um: float = 0.0
    n_slices: int = 1

    def __post_init__(self) -> None:
        within(self.helix_angle_deg, "helix_angle_deg", -45.0, 45.0, "°")
        not_negative(self.crowning_um, "crowning_um", "µm")
        within(self.crowning_um, "crowning_um", 0.0, 500.0, "µm")
        within(self.error_um, "lead_error_um", -500.0, 500.0, "µm")
        count(self.n_slices, "face_slices", maximum=MAX_SLICES)

    @property
    def even(self) -> bool:
        """Whether all of the face carries alike: no helix, no crowning, no misalignment."""
        return self.helix_angle_deg == 0.0 and self.crowning_um == 0.0 and self.error_um == 0.0

    @property
    def places(self) -> FloatArray:
        """Middles of the slices from one end of the face to the other, −½ to ½, (n_slices,)."""
        return (np.arange(self.n_slices) + 0.5) / self.n_slices - 0.5

    def gap_m(self, places: FloatArray) -> FloatArray:
        """Missing metal by crowning and misalignment at places −½ to ½ of the face; 0 in its middle."""
        result: FloatArray = 1e-6 * (self.crowning_um * (2.0 * places) ** 2 + self.error_um * places)
        return result

    def late(self, pair: PairGeometry, places: FloatArray) -> FloatArray:
        """Base pitches by which places −½ to ½ of the face enter after the end that enters first, 0 to ε_β.

        The driver turns counter-clockwise, seen from +z: the far end of a right-handed tooth runs ahead.
        """
        hand = 1.0 if self.helix_angle_deg >= 0.0 else -1.0
        result: FloatArray = self.overlap_ratio(pair) * (0.5 - hand * places)
        return result

    def overlap_ratio(self, pair: PairGeometry) -> float:
        """ε_β = b tan β/(π m_t), how many pitches one end of the face is behind the other."""
        turn = pair.face_width_mm * tan(radians(abs(self.helix_angle_deg)))
        return turn / (pi * pair.driver.module_mm)

    def base_helix_rad(self, pair: PairGeometry) -> float:
        """β_b of tan β_b = tan β cos α_t."""
        return atan(tan(radians(self.helix_angle_deg)) * cos(pair.driver.pressure_angle_rad))

    def axial_share(self, pair: PairGeometry) -> float:
        """Axial force over the force along the line of action, tan β_b: F_a = F_bt tan β_b = F_t tan β."""
        return tan(self.base_helix_rad(pair))


STRAIGHT = Lead()
"""A spur pair whose flanks touch all along the face."""


def transverse_section(
    teeth: int,
    normal_module_mm: float,
    normal_pressure_angle_deg: float,
    helix_angle_deg: float,
    **normal: float | None,
) -> GearGeometry:
    """Return the transverse section of a helical gear that a rack of normal sizes cuts.

    m_t = m_n/cos β,  tan α_t = tan α_n/cos β; profile shift, addendum, dedendum and the tip round keep their lengths.

    Parameters
    ----------
    teeth, normal_module_mm, normal_pressure_angle_deg, helix_angle_deg
        z, m_n, α_n, β.
    **normal
        Further fields of `GearGeometry`, in normal modules or mm.

    Notes
    -----
    In the transverse section the rack's round tip is an ellipse; a circle of the same radius stands for it.

    Source: ISO 21771, *Gears – Cylindrical involute gears and gear pairs* (2007).
    """
    c = cos(radians(within(helix_angle_deg, "helix_angle_deg", -45.0, 45.0, "°")))
    if helix_angle_deg == 0.0:  # exactly the spur gear's
        angle_deg = normal_pressure_angle_deg
    else:
        angle_deg = float(np.degrees(atan(tan(radians(normal_pressure_angle_deg)) / c)))
    sizes = {"profile_shift": 0.0, "addendum": 1.0, "dedendum": 1.25, "tool_tip_radius": 0.38} | normal
    for name in ("profile_shift", "addendum", "dedendum", "tool_tip_radius"):
        sizes[name] = c * float(sizes[name] or 0.0)
    return GearGeometry(teeth, normal_module_mm / c, angle_deg, **sizes)  # type: ignore[arg-type]  # fields by name


@dataclass(frozen=True)
class NormalSection(GearGeometry):
    """Spur gear whose teeth are those of a helical gear's normal section; see `normal_section`.

    Its number of teeth is no whole number, and nothing is checked: the gear that it stands for has been.
    """

    teeth: float  # type: ignore[assignment]

    def __post_init__(self) -> None:
        """Leave it as it is."""


def normal_section(gear: GearGeometry, helix_angle_deg: float) -> GearGeometry:
    """Return the virtual spur gear of a helical one: z_n = z/(cos²β_b cos β), m_n = m_t cos β, tan α_n = tan α_t cos β.

    Parameters
    ----------
    gear : GearGeometry
        The transverse section.
    helix_angle_deg : float

    Notes
    -----
    The bore is as large a part of the root circle as in the gear itself: so the body below a tooth keeps its shape.

    Source: ISO 6336-3, *Calculation of tooth bending strength* (2019), for the virtual spur gear.
    """
    if helix_angle_deg == 0.0:
        return gear
    beta = radians(helix_angle_deg)
    c, base = cos(beta), atan(tan(beta) * cos(gear.pressure_angle_rad))
    virtual = NormalSection(
        gear.teeth / (cos(base) ** 2 * c),
        gear.module_mm * c,
        float(np.degrees(atan(tan(gear.pressure_angle_rad) * c))),
        gear.profile_shift / c,
        gear.face_width_mm,
        gear.addendum / c,
        gear.dedendum / c,
        gear.tool_tip_radius / c,
    )
    object.__setattr__(virtual, "bore_radius_mm", gear.bore_mm / gear.root_radius_mm * virtual.root_radius_mm)
    return virtual


def normal_roll_rad(gear: GearGeometry, virtual: GearGeometry, roll_rad: FloatArray) -> FloatArray:
    """Roll angle on the virtual gear at the height where the transverse section has `roll_rad`."""
    if virtual is gear:
        return roll_rad
    height = gear.base_radius_mm * np.hypot(1.0, roll_rad) - gear.pitch_radius_mm
    ratio = (virtual.pitch_radius_mm + height) / virtual.base_radius_mm
    result: FloatArray = np.sqrt(np.maximum(ratio**2 - 1.0, 0.0))
    return result
