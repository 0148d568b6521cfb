"""The parameters of the flexible pair: those it shares with the 16-DOF pair, and those of its gear bodies."""

from __future__ import annotations

from dataclasses import replace

from sims.gear_pair.parameters import PARAMETERS as SHARED
from sims.simulator import Parameter, ParameterValue

MEANINGLESS: dict[str, ParameterValue | None] = {
    "contact_law": "linear",
    "mesh_ramp": 0.05,
    "mass_driver_kg": None,
    "mass_driven_kg": None,
    "inertia_driver_kg_m2": None,
    "inertia_driven_kg_m2": None,
}
"""Parameters of the 16-DOF pair that this model lacks, and the values with which its machine is built all the same."""

_CHANGED = {
    "mesh_damping_ratio": {
        "meaning": "damping ratio of the torsional mode, rotors standing still; the contact gives what others do not",
        "default": 0.08,
    },
    "friction": {"default": "off"},
    "roughness_locked_to": {"choices": ("flank", "none")},
    "bending_stiffness_n_per_m": {"default": 1.5e10},
    "bearing_stiffness_n_per_m": {"default": 1.5e10},
}


def _number(name: str, unit: str, meaning: str, low: float, high: float, default: float | None) -> Parameter:
    return Parameter(name, unit, meaning, low, high, default)


def _bodies() -> tuple[Parameter, ...]:
    found: list[Parameter] = []
    for side, whose in (("driver", "the driver"), ("driven", "the driven gear")):
        found += [
            _number(f"web_thickness_{side}_mm", "mm", f"web of {whose}; none: a full disc", 0.1, 500, None),
            _number(f"rim_thickness_{side}_mm", "mm", f"rim of {whose}; none: 3 modules", 0.1, 500, None),
            _number(f"hub_thickness_{side}_mm", "mm", f"hub of {whose}; none: 3 modules", 0.1, 500, None),
            _number(
                f"hub_inertia_{side}_kg_m2", "kg m^2", f"what hub and shaft add to the inertia of {whose}", 0, 1e5, 0.0
            ),
            _number(f"hub_mass_{side}_kg", "kg", f"what hub and shaft add to the mass of {whose}", 0, 1e5, 0.0),
        ]
    return tuple(found)


_DYNAMICS = (
    _number("body_damping_ratio", "", "damping ratio of the elastic modes of the gears", 0, 0.5, 0.08),
    _number("mode_limit_hz", "Hz", "elastic modes up to here move; those above follow at once", 500, 1e5, 20000.0),
    _number(
        "restitution",
        "",
        "of the gears' impact at first contact after a loss, on top of the compliance, which counts it twice; none: "
        "the compliance alone",
        0,
        1,
        None,
    ),
    _number("lead_error_um", "um", "misalignment of the flanks over the face width", -500, 500, 0.0),
    _number(
        "step_us",
        "us",
        "longest step of the integrator; shortened to what the contact needs and to a part of the sampling interval",
        0.1,
        20,
        5.0,
    ),
    Parameter(
        "mesh_dof",
        "",
        "degrees of freedom of each gear's finite elements, where no ready-made gear fits; kept on disk once reduced",
        5000,
        1e6,
        277200,
        whole=True,
    ),
)

PARAMETERS: tuple[Parameter, ...] = (
    *(replace(p, **_CHANGED.get(p.name, {})) for p in SHARED if p.name not in MEANINGLESS),  # type: ignore[arg-type]  # fields by name
    *_bodies(),
    *_DYNAMICS,
)
"""All of them."""
OWN = frozenset(p.name for p in (*_bodies(), *_DYNAMICS))
"""Those that the 16-DOF pair does not have."""
