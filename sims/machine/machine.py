"""A spur gear pair between two rotors: what the simulators of one share, and what effects change."""

from __future__ import annotations

from dataclasses import dataclass, field

from gearsig.checks import not_negative, within
from gearsig.errors import InputError
from sims.machine.parts import BearingSupport, Drive, Lubrication, Roughness, ShaftLine, Wheel
from sims.measure.chain import MeasurementChain
from sims.mesh.gear_mesh import GearMesh


@dataclass(frozen=True)
class Machine:
    """A spur gear pair, its shafts, bearings, drive and measurement chain. Index 0 is the driver, 1 the driven side.

    Frame: y along the line of action, the way the driver's tooth pushes; x off it. The driver turns counter-clockwise,
    the driven gear clockwise; angles count in the gears' own directions.

    Parameters
    ----------
    mesh : GearMesh
        Geometry, stiffness, tooth faults and flank deviations.
    wheels : tuple of two Wheel
    shafts : tuple of two ShaftLine
    bearings : tuple of four BearingSupport
        Two of the driver's shaft (the first on the coupling's side), then two of the driven one's.
    mesh_damping_ratio : float
        ζ of the pair on its mean mesh stiffness; the damping of each tooth pair is proportional to its stiffness.
    half_backlash_um : float
        b; the flanks have 2b of play along the line of action.
    lubrication : Lubrication
    roughness : Roughness
    drive : Drive
    chain : MeasurementChain
    gravity_mps2 : float
    line_of_action_deg : float
        β, angle between the line of action and the vertical: upwards is x sin β + y cos β.

    Notes
    -----
    Shafts are mirror-symmetric: either bearing takes half of the gear's force.
    """

    mesh: GearMesh
    wheels: tuple[Wheel, Wheel]
    shafts: tuple[ShaftLine, ShaftLine]
    bearings: tuple[BearingSupport, BearingSupport, BearingSupport, BearingSupport]
    chain: MeasurementChain
    mesh_damping_ratio: float = 0.06
    half_backlash_um: float = 20.0
    lubrication: Lubrication = field(default_factory=Lubrication)
    roughness: Roughness = field(default_factory=Roughness)
    drive: Drive = field(default_factory=Drive)
    gravity_mps2: float = 9.81
    line_of_action_deg: float = 20.0

    def __post_init__(self) -> None:
        within(self.mesh_damping_ratio, "mesh_damping_ratio", 0.0, 1.0)
        not_negative(self.half_backlash_um, "half_backlash_um", "µm")
        not_negative(self.gravity_mps2, "gravity_mps2", "m/s^2")
        within(self.line_of_action_deg, "line_of_action_deg", -180.0, 180.0, "°")
        for name, wanted in (("wheels", 2), ("shafts", 2), ("bearings", 4)):
            if len(getattr(self, name)) != wanted:
                raise InputError(f"{len(getattr(self, name))} {name}", where="machine", allowed=str(wanted))

    @property
    def shaft_names(self) -> tuple[str, str]:
        """Names of the driver's and the driven shaft."""
        return self.shafts[0].name, self.shafts[1].name

    @property
    def ratio(self) -> float:
        """Revolutions of the driver per revolution of the driven gear, z2/z1."""
        return self.mesh.pair.driven.teeth / self.mesh.pair.driver.teeth


def bearing_index(machine: Machine, name: str) -> int:
    """Place of a bearing in `machine.bearings` by its name."""
    from gearsig.checks import closest_match_hint

    names = [support.bearing.name for support in machine.bearings]
    if name not in names:
        raise InputError(
            f"there is no bearing {name!r}", allowed=", ".join(names), remedy=closest_match_hint(name, names)
        )
    return names.index(name)
