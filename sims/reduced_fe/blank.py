"""The gear body to be meshed: teeth, bore, hub, web and rim, and what it is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from math import pi
from typing import Any

from gearsig.checks import positive, within
from gearsig.errors import InputError
from sims.mesh.geometry import GearGeometry
from sims.mesh.material import STEEL, Material

LEAST_RIM = 1.0
"""Least thickness of rim and hub in modules: thinner ones crack through the rim, which this model does not follow."""


@dataclass(frozen=True)
class GearBlank:
    """A spur gear as a solid body.

    From the bore outwards: a hub as wide as the face, a web in its middle plane, a rim as wide as the face, the teeth.
    Without a web the body is one full disc.

    Parameters
    ----------
    geometry : GearGeometry
        Teeth, module, pressure angle, profile shift, face width, fillet (by the tool's tip radius) and bore. It refuses
        undercut and pointed teeth and a fillet that does not fit.
    web_thickness_mm : float or None
        Along the axis, above 0 and at most the face width. None: full disc.
    rim_thickness_mm : float or None
        Radially below the root circle; at least 1 module. None: 3 modules. Only with a web.
    hub_thickness_mm : float or None
        Radially outside the bore; at least 1 module. None: 3 modules. Only with a web.
    material : Material

    Raises
    ------
    InputError
        If the web is thicker than the face, hub and rim meet, or the bore leaves less than 1 module below the root
        circle.

    Notes
    -----
    Left out: keyways, holes in the web, chamfers, crowning and tip relief, rounds between web and rim.

    Examples
    --------
    >>> blank = GearBlank(GearGeometry(50, 3.0, bore_radius_mm=20.0))
    >>> blank.web_thickness_mm is None, blank.material.youngs_modulus_gpa
    (True, 206.0)
    """

    geometry: GearGeometry
    web_thickness_mm: float | None = None
    rim_thickness_mm: float | None = None
    hub_thickness_mm: float | None = None
    material: Material = field(default=STEEL)

    def __post_init__(self) -> None:
        self._check_bore()
        if self.web_thickness_mm is None:
            self._refuse_parts_without_web()
        else:
            self._check_web()

    @property
    def n_teeth(self) -> int:
        """Number of teeth, and of equal sectors."""
        return self.geometry.teeth

    @property
    def pitch_angle_rad(self) -> float:
        """2π/z, the angle of one sector."""
        return 2.0 * pi / self.geometry.teeth

    @property
    def rim_radius_mm(self) -> float:
        """Inner radius of the rim; of a full disc, the radius where the fine mesh below the teeth ends."""
        thickness = 3.0 * self.geometry.module_mm if self.rim_thickness_mm is None else self.rim_thickness_mm
        radius = self.geometry.root_radius_mm - thickness
        return radius if self.web_thickness_mm is not None else max(radius, self._middle_of_body_mm)

    @property
    def hub_radius_mm(self) -> float:
        """Outer radius of the hub; of a full disc the bore radius."""
        if self.web_thickness_mm is None:
            return self.geometry.bore_mm
        thickness = 3.0 * self.geometry.module_mm if self.hub_thickness_mm is None else self.hub_thickness_mm
        return self.geometry.bore_mm + thickness

    def as_text(self) -> str:
        """Return the blank as JSON, from which `blank_from_text` makes it again; equal blanks give equal texts."""
        return json.dumps(asdict(self), sort_keys=True)

    @property
    def _middle_of_body_mm(self) -> float:
        return (self.geometry.root_radius_mm + self.geometry.bore_mm) / 2.0

    def _check_bore(self) -> None:
        g = self.geometry
        largest = g.root_radius_mm - LEAST_RIM * g.module_mm
        if g.bore_mm > largest:
            raise InputError(
                f"bore_radius_mm is {g.bore_mm:g} mm: it leaves {g.root_radius_mm - g.bore_mm:.3g} mm below the teeth",
                allowed=f"at most {largest:.4g} mm, 1 module below the root circle",
                remedy="take a smaller bore",
            )

    def _refuse_parts_without_web(self) -> None:
        for name in ("rim_thickness_mm", "hub_thickness_mm"):
            value = getattr(self, name)
            if value is not None:
                raise InputError(f"{name} is {value:g} mm, but a full disc has none", remedy="give web_thickness_mm")

    def _check_web(self) -> None:
        g = self.geometry
        web = positive(self.web_thickness_mm or 0.0, "web_thickness_mm", "mm")
        if web > g.face_width_mm:
            raise InputError(
                f"web_thickness_mm is {web:g} mm, thicker than the face",
                allowed=f"at most the face width, {g.face_width_mm:g} mm",
                remedy="take a thinner web, or leave it out for a full disc",
            )
        space = g.root_radius_mm - g.bore_mm
        least = LEAST_RIM * g.module_mm
        for name in ("rim_thickness_mm", "hub_thickness_mm"):
            if getattr(self, name) is not None:
                within(getattr(self, name), name, least, space, "mm")
        if self.rim_radius_mm - self.hub_radius_mm < 0.5 * g.module_mm:
            raise InputError(
                f"hub and rim leave {self.rim_radius_mm - self.hub_radius_mm:.3g} mm for the web",
                allowed=f"at least half a module, {0.5 * g.module_mm:g} mm",
                remedy="take a smaller bore, a thinner hub or rim, or a full disc",
            )


def blank_from_text(text: str) -> GearBlank:
    """Return the blank that `GearBlank.as_text` wrote; it is checked again."""
    values: Mapping[str, Any] = json.loads(text)
    own = {name: values[name] for name in ("web_thickness_mm", "rim_thickness_mm", "hub_thickness_mm")}
    return GearBlank(GearGeometry(**values["geometry"]), material=Material(**values["material"]), **own)
