"""What the gears are made of."""

from __future__ import annotations

from dataclasses import dataclass

from gearsig.checks import positive, within


@dataclass(frozen=True)
class Material:
    """Isotropic, linearly elastic.

    Parameters
    ----------
    youngs_modulus_gpa : float
        E.
    poisson_ratio : float
        ν, 0 to 0.49.
    density_kg_m3 : float
    """

    youngs_modulus_gpa: float = 206.0
    poisson_ratio: float = 0.3
    density_kg_m3: float = 7850.0

    def __post_init__(self) -> None:
        positive(self.youngs_modulus_gpa, "youngs_modulus_gpa", "GPa")
        within(self.poisson_ratio, "poisson_ratio", 0.0, 0.49)
        positive(self.density_kg_m3, "density_kg_m3", "kg/m^3")

    @property
    def youngs_modulus_pa(self) -> float:
        """E in Pa."""
        return self.youngs_modulus_gpa * 1e9


STEEL = Material()
"""Gear steel, E = 206 GPa."""
