"""The integrator: exact modes, second order with the mesh, conserved energy; teeth against textbook formulas."""

from dataclasses import replace
from math import acos, cos, pi, radians, sin, sqrt, tan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from gearsig.errors import InputError
from sims.blind import (
    BlindRig,
    RunCondition,
    Scene,
    SpurPair,
    draw_rig,
    march,
    march_arguments,
    mass_matrix,
    modes_of,
    output_rows,
    run,
    scene_of,
    step_coefficients,
    stiffness_matrix,
)

NUMBER, MODAL, Q, P, SUPPORTS, TABLES, LINES, SPEED = 4, 5, 6, 7, 8, 9, 11, 12


def rig(seed: int = 3) -> BlindRig:
    return draw_rig(np.random.default_rng(seed), "development")


def condition(of: BlindRig, rpm: float = 1200.0, share: float = 0.6, duration_s: float = 0.3) -> RunCondition:
    nm = share * of.rated_nm
    return RunCondition(rpm, nm, rpm, nm, duration_s, 7, 8)


def smooth_scene() -> Scene:
    """A scene without rough tables: straight pieces between points have kinks that hide the order."""
    base = rig()
    scene = scene_of(base, condition(base, duration_s=0.08))
    scene.gap_m = [np.zeros_like(g) for g in scene.gap_m]
    scene.base_gap_m = base.pair.end_gap_m()
    scene.slip = 0.05 * np.tanh((base.pair.path - base.pair.pitch_point) / 0.2)
    return scene


def test_one_mode_under_a_ramp_is_exact() -> None:
    """One step of any length against a high-order integration of q'' + 2ζω q' + ω² q = f0 + (f1 − f0) t/h."""
    modes = modes_of(rig().parts)
    h, f0, f1, q0, p0 = 3e-3, 1.3, -0.7, 2e-4, 0.1
    c = step_coefficients(modes, h)
    for i in (0, 2, 6, 10):
        w, z = modes.omega[i], modes.zeta[i]
        exact = solve_ivp(
            lambda t, y, w=w, z=z: [y[1], f0 + (f1 - f0) * t / h - 2 * z * w * y[1] - w * w * y[0]],
            (0, h), [q0, p0], "DOP853", rtol=1e-12, atol=1e-15,
        ).y[:, -1]  # fmt: skip
        ours = [c[k, i] * q0 + c[k + 1, i] * p0 + c[k + 4, i] * f0 + c[k + 5, i] * f1 for k in (0, 2)]
        np.testing.assert_allclose(ours, exact, rtol=1e-8)


def test_modes_diagonalise_the_structure() -> None:
    parts = rig().parts
    modes = modes_of(parts)
    m, k, shapes = mass_matrix(parts), stiffness_matrix(parts), modes.shapes
    np.testing.assert_allclose(shapes.T @ m @ shapes, np.eye(11), atol=1e-9)
    np.testing.assert_allclose(shapes.T @ k @ shapes, np.diag(modes.omega**2), atol=1e-6 * modes.omega.max() ** 2)
    assert (modes.omega[:2] == 0).all()
    assert modes.omega[2] > 2 * pi * 3


@pytest.mark.slow
def test_second_order_in_the_step() -> None:
    """The compression of the mesh converges with the square of the step, contact changes and friction on."""
    x = {n: run(smooth_scene(), sub_steps=n).squeeze_m for n in (4, 8, 16, 64)}
    error = [float(np.std(x[n] - x[64])) for n in (4, 8, 16)]
    assert error[0] < 0.02 * x[64].std()
    assert np.log2(error[0] / error[1]) > 1.6
    assert np.log2(error[1] / error[2]) > 1.6


@pytest.mark.parametrize("is_exact", [True, False])
def test_the_default_step_is_fine_enough(is_exact: bool) -> None:
    """Rms transmission error and bearing force at the default step, to 1 % of four times as fine; full scene too."""
    base = rig(5)

    def scene() -> Scene:
        return smooth_scene() if is_exact else scene_of(base, condition(base, 2000.0, duration_s=0.2))

    coarse, fine = run(scene()), run(scene(), sub_steps=16)
    assert coarse.squeeze_m.std() == pytest.approx(fine.squeeze_m.std(), rel=0.01)
    np.testing.assert_allclose(coarse.bearing_n.std(axis=1), fine.bearing_n.std(axis=1), rtol=0.02)


def energy_swing(sub_steps: int) -> float:
    """Largest change of energy in free vibration, damping, friction, drive and weight off; relative to the vibration's.

    The stiffness of a pair over the path is a box of one base pitch smeared by another box: the sum over all pairs is
    then the same at every angle, and the compression law alone stores energy. The drive line starts twisted, so that
    the teeth are thrown from flank to flank.
    """
    base = replace(rig(), parts=replace(rig().parts, damping_ratios=(0.0,) * 11))
    scene = scene_of(base, condition(base, rpm=200.0, duration_s=0.002))
    off = ("mesh_damping", "load_nm", "load_slope", "wedge_m", "motor_nm", "motor_gain", "line_inertia")
    args = list(march_arguments(scene, sub_steps, **dict.fromkeys(off, 0.0)))
    path, ratio = base.pair.path, base.pair.contact_ratio
    from_start, to_end = path - path[0], path[-1] - path
    shape = np.clip(np.minimum(from_start, to_end), 0, 1) * base.mesh_stiffness_n_per_m() / (ratio + 0.7 - 1)
    flat = np.zeros_like(path)
    args[TABLES] = (flat, shape, flat, *(np.zeros_like(g) for g in scene.gap_m), *scene.weak)
    zero = np.zeros_like
    steady, bearing_k, clearance, unbalance = args[SUPPORTS]
    args[SUPPORTS] = (zero(steady), bearing_k, zero(clearance), zero(unbalance))
    args[LINES] = tuple(np.zeros((0, rows.shape[1])) for rows in args[LINES])
    _, _, outputs, omega, _ = args[MODAL]
    h, k, backlash = base.soft_m, base.mesh_stiffness_n_per_m(), scene.backlash_m

    def stored(x: float) -> float:
        x = max(x, 0.0)
        return float(k * (0.5 * (x * np.hypot(x, h) + h * h * np.arcsinh(x / h)) - h * x))

    def energy() -> float:
        x = float(outputs[0] @ args[Q])
        moving = 0.5 * (args[P] ** 2).sum() + 0.5 * (omega**2 * args[Q] ** 2).sum()
        return float(moving) + stored(x) + stored(-x - backlash)

    first = energy()
    vibration = first - 0.5 * float((args[P] ** 2).sum())
    swing = 0.0
    args[0], args[1] = 50, 0
    for _ in range(20):
        march(*args)
        swing = max(swing, abs(energy() - first))
    return swing / vibration


def test_energy_is_conserved_at_second_order() -> None:
    coarse, fine = energy_swing(4), energy_swing(16)
    assert coarse < 0.01
    assert fine < coarse / 8


def test_forces_balance() -> None:
    """Mean mesh force is torque over base radius; bearings carry it along the line of action, and the weight."""
    base = rig(4)
    runs = condition(base, 1500.0, 0.7, 2.0)
    motion = run(scene_of(base, runs))
    force = runs.true_nm / base.pair.base_radii_m[0]
    assert motion.mesh_n.mean() == pytest.approx(force, rel=0.01)
    along = np.array([np.cos(base.parts.line_angle), np.sin(base.parts.line_angle)])
    weight = np.array([0.0, -9.81])
    # Friction pushes across the line of action; its mean is not nothing, some per cent of the mesh force.
    on_1, on_2 = motion.bearing_n.mean(axis=1).reshape(2, 2)
    np.testing.assert_allclose(on_1, -force * along + weight * base.parts.rotor_mass_kg[0], atol=0.04 * force)
    np.testing.assert_allclose(on_2, force * along + weight * base.parts.rotor_mass_kg[1], atol=0.04 * force)


def test_output_rows_match_a_rigid_turn() -> None:
    """Gears that roll together compress nothing; a casing that moves with its rotors loads no bearing."""
    parts = rig().parts
    rows = output_rows(parts)
    turn = np.zeros(11)
    turn[[1, 2]] = parts.base_radii_m[1], parts.base_radii_m[0]
    assert abs(rows[0] @ turn) < 1e-15
    rigid = np.zeros(11)
    rigid[[4, 6, 8]] = 1.0
    np.testing.assert_allclose(rows[[0, 3, 4, 5, 6]] @ rigid, 0.0, atol=1e-15)


# Involute kinematics and stiffness against textbook formulas and an own construction.

pairs = st.builds(
    SpurPair, st.integers(22, 70), st.integers(22, 70), st.sampled_from([1.5, 3.0, 6.0]), st.floats(10.0, 60.0)
)


def test_contact_ratio_of_published_pairs() -> None:
    """20/100 standard teeth: 1.705; 50/50: 1.755."""
    assert SpurPair(20, 100, 5.0, 50.0).contact_ratio == pytest.approx(1.705, abs=5e-3)
    assert SpurPair(50, 50, 3.0, 20.0).contact_ratio == pytest.approx(1.755, abs=5e-4)


def test_iso_stiffness_by_hand() -> None:
    """30/40 teeth, 20 mm: q' = 0.05886, c' = 13.25, ε = 1.684, c_γ = 20.05 N/(mm µm)."""
    pair = SpurPair(30, 40, 2.0, 20.0)
    assert pair.mean_stiffness_n_per_m() == pytest.approx(20.05 * 20 * 1e6, rel=2e-3)


@given(pairs)
def test_the_pairs_together_have_the_mean_of_the_standard(pair: SpurPair) -> None:
    path, k = pair.path, pair.pair_stiffness_n_per_m()
    inside = (path >= 0) & (path <= pair.contact_ratio)
    assert np.trapezoid(k[inside], path[inside]) == pytest.approx(pair.mean_stiffness_n_per_m(), rel=0.02)


@given(pairs)
@settings(deadline=None)
def test_gaps_open_smoothly_and_ever_more(pair: SpurPair) -> None:
    gap, path = pair.end_gap_m(), pair.path
    inside = (path >= 0) & (path <= pair.contact_ratio)
    assert (gap[inside] == 0).all()
    for side in (gap[path < 0][::-1], gap[path > pair.contact_ratio]):
        assert (np.diff(side) > 0).all()
        assert side[0] < 1e-6 * pair.module_mm  # no jump at the end of the path
        quarter, half = side[len(side) // 4], side[len(side) // 2]
        assert 3 < half / quarter < 6.5  # about the square of the distance


def polygon_gap(pair: SpurPair, beyond_m: float) -> float:
    """Separation after E found by search: turn the wheel until its flank, drawn as points, meets the pinion's tip."""
    rb1, rb2 = pair.base_radii_m
    ra1 = pair.tip_radii_m[0]
    a, alpha = pair.centre_distance_m, radians(pair.pressure_angle_deg)
    rho = sqrt(ra1**2 - rb1**2)
    # Line of action from the pinion's base circle at (cos α, sin α) towards (sin α, −cos α).
    x, y = rb1 * cos(alpha) + rho * sin(alpha), rb1 * sin(alpha) - rho * cos(alpha)
    tip = np.arctan2(y, x) - beyond_m / rb1  # the pinion turns on, clockwise
    px, py = ra1 * cos(tip) - a, ra1 * sin(tip)
    rho2 = a * sin(alpha) - rho - beyond_m
    roll = np.linspace(0, 3 * rho2 / rb2 + 0.5, 200_000)

    def flank(base_angle: float) -> tuple[np.ndarray, np.ndarray]:
        at = base_angle + roll
        return rb2 * (np.cos(at) + roll * np.sin(at)), rb2 * (np.sin(at) - roll * np.cos(at))

    # Seen from the wheel the base tangent point is at π + α; the involute unwinds the other way.
    start = pi + alpha - rho2 / rb2
    fx, fy = flank(start)
    r = np.hypot(fx, fy)
    order = np.argsort(r)
    angle_at = np.interp(np.hypot(px, py), r[order], np.unwrap(np.arctan2(fy, fx))[order])
    return float(rb2 * abs((np.arctan2(py, px) - angle_at + pi) % (2 * pi) - pi))


@pytest.mark.parametrize("beyond", [0.05, 0.1, 0.2])
def test_gap_after_the_path_by_points_on_the_flank(beyond: float) -> None:
    pair = SpurPair(30, 40, 3.0, 24.0)
    gap = pair.corner_gap_m(1, np.array([beyond * pair.base_pitch_m]))[0]
    assert gap == pytest.approx(polygon_gap(pair, beyond * pair.base_pitch_m), rel=1e-3)


def ends_rad(pair: SpurPair, centre_m: float) -> tuple[float, float]:
    """Pinion angles at which contact begins and ends at a centre distance, from a fixed direction."""
    (rb1, rb2), (ra1, ra2) = pair.base_radii_m, pair.tip_radii_m
    alpha = acos((rb1 + rb2) / centre_m)
    rho_start = centre_m * sin(alpha) - sqrt(ra2**2 - rb2**2)
    return rho_start / rb1 - alpha, sqrt(ra1**2 - rb1**2) / rb1 - alpha


@given(pairs)
def test_ends_move_with_the_centre_distance(pair: SpurPair) -> None:
    step = 1e-6
    before, after = ends_rad(pair, pair.centre_distance_m), ends_rad(pair, pair.centre_distance_m + step)
    moved = [(b - a) * pair.base_radii_m[0] / pair.base_pitch_m / step for a, b in zip(before, after, strict=True)]
    np.testing.assert_allclose(moved, pair.end_shift_per_m(), rtol=1e-3)
    assert tan(pair.alpha) > 0


def test_bad_pairs_are_refused() -> None:
    with pytest.raises(InputError, match="z1"):
        SpurPair(12, 40, 2.0, 20.0)
    with pytest.raises(InputError, match="interfere"):
        SpurPair(17, 2000, 2.0, 20.0)
