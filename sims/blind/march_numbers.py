"""Places in the vector of single values that the compiled march takes."""

from __future__ import annotations

(
    RB_1,
    RB_2,
    LINE_X,
    LINE_Y,
    BASE_PITCH,
    CONTACT_RATIO,
    RHO_START,
    RHO_SUM,
    SOFT_M,
    BACKLASH_M,
    MESH_DAMPING,
    BACK_STIFFNESS,
    LOAD_NM,
    LOAD_SLOPE,
    MOTOR_NM,
    MOTOR_GAIN,
    MOTOR_MEMORY,
    LINE_INERTIA,
    WEDGE_M,
    GRID_S,
    OMEGA_1,
    OMEGA_2,
    CAGE_RATIO_1,
    CAGE_RATIO_2,
    N_BALLS_1,
    N_BALLS_2,
    BALL_RIPPLE,
    PHASE_2,
    SEAT_1,
    SEAT_2,
    HEIGHT,
) = range(31)
N_NUMBERS = 31
