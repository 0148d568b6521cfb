"""The healthy spur pair of 55 and 75 teeth that simulators and effects are tested on."""

from math import cos, radians, sin

from gearsig.rig import Bearing
from sims.machine import BearingSupport, Drive, Machine, ShaftLine, Wheel
from sims.measure import MeasuredChannel, MeasurementChain, ModalPath, Tachometer
from sims.mesh import GearGeometry, GearMesh, PairGeometry, disc_inertia_kg_m2, disc_mass_kg

TEETH = (55, 75)
LINE_OF_ACTION_DEG = 20.0


def spur_pair_machine(*, sampling_rate_hz: float = 20480.0) -> Machine:
    """Return the pair: module 2, 20 mm wide, on four ball bearings; one accelerometer stands upright on bearing 1.

    Shafts are "input" and "output", bearings "bearing 1" to "bearing 4". The sensor has no noise.
    """
    driver, driven = (GearGeometry(z, 2.0, face_width_mm=20.0, bore_radius_mm=17.5) for z in TEETH)
    return Machine(
        mesh=GearMesh(PairGeometry(driver, driven)),
        wheels=(_wheel(driver), _wheel(driven)),
        shafts=(_shaft("input", 2e-3), _shaft("output", 1e-2)),
        bearings=(_bearing(1, "input"), _bearing(2, "input"), _bearing(3, "output"), _bearing(4, "output")),
        chain=MeasurementChain(sampling_rate_hz, (_upright("a1"),), tachometer=Tachometer("input")),
        drive=Drive(),
        line_of_action_deg=LINE_OF_ACTION_DEG,
    )


def _wheel(gear: GearGeometry) -> Wheel:
    return Wheel(disc_mass_kg(gear), disc_inertia_kg_m2(gear))


def _shaft(name: str, rotor_inertia_kg_m2: float) -> ShaftLine:
    return ShaftLine(
        name,
        bending_stiffness_n_per_m=2e8,
        bending_damping_n_s_per_m=600.0,
        torsional_stiffness_nm_per_rad=4e4,
        torsional_damping_nm_s_per_rad=8.0,
        rotor_inertia_kg_m2=rotor_inertia_kg_m2,
    )


def _bearing(number: int, shaft: str) -> BearingSupport:
    ball = Bearing(f"bearing {number}", shaft, 9, 7.94, 39.04)  # size 6205
    return BearingSupport(ball, mass_kg=0.3, stiffness_n_per_m=2e8, damping_n_s_per_m=1.5e3)


def _upright(name: str) -> MeasuredChannel:
    # y runs along the line of action, which leans towards -x: the vertical is cos of y and sin of x.
    lean = radians(LINE_OF_ACTION_DEG)
    path = ModalPath({"bearing 1 x": sin(lean), "bearing 1 y": cos(lean)})
    return MeasuredChannel(name, path, position="bearing 1, vertical")
