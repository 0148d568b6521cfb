"""Compiled: what each pair carries. Imported only where it is used, since it loads the compiler."""

from __future__ import annotations

from numba import njit

from gearsig.checks import FloatArray


@njit(cache=True)
def engagement(progress: float, contact_ratio: float, ramp: float) -> float:
    """Part of its stiffness a pair has: 0 outside, 1 inside, with a quintic step of width `ramp` at either end."""
    return float(engagement_and_slope(progress, 0.0, contact_ratio, ramp)[0])


@njit(cache=True, nogil=True, error_model="numpy")
def engagement_and_slope(progress: float, late: float, contact_ratio: float, ramp: float) -> tuple[float, float]:
    """(w, ∂w/∂ζ) of `engagement`, for a pair that enters `late` base pitches late."""
    if ramp <= 0.0:
        return (1.0 if late <= progress <= contact_ratio else 0.0), 0.0
    rise, rise_slope = _smooth((progress - late) / ramp + 0.5)
    fall, fall_slope = _smooth((contact_ratio - progress) / ramp + 0.5)
    return rise * fall, (rise_slope * fall - rise * fall_slope) / ramp


@njit(cache=True, nogil=True, error_model="numpy")
def _smooth(t: float) -> tuple[float, float]:
    """6t⁵ − 15t⁴ + 10t³ between 0 and 1, with two continuous derivatives, and its slope."""
    if t <= 0.0:
        return 0.0, 0.0
    if t >= 1.0:
        return 1.0, 0.0
    return t * t * t * (t * (6.0 * t - 15.0) + 10.0), 30.0 * t * t * (t - 1.0) * (t - 1.0)


@njit(cache=True)
def cubic(row: FloatArray, start: float, step: float, progress: float) -> float:
    """Lagrange interpolation through the four nearest columns; beyond the ends the last cubic goes on."""
    place = (progress - start) / step
    i = min(max(int(place), 1), row.size - 3)
    t = place - i
    a, b, c, d = row[i - 1], row[i], row[i + 1], row[i + 2]
    return float(
        -a * t * (t - 1.0) * (t - 2.0) / 6.0
        + b * (t + 1.0) * (t - 1.0) * (t - 2.0) / 2.0
        - c * (t + 1.0) * t * (t - 2.0) / 2.0
        + d * (t + 1.0) * t * (t - 1.0) / 6.0
    )


@njit(cache=True)
def pair_force(
    penetration: float, compliance: float, contact: float, load_dependent: bool, weight: float
) -> tuple[float, float]:
    """Force N ≥ 0 and its slope dN/dδ of one pair.

    Linear: δ = N (c + c_h).  Load-dependent: δ = c N + B N^0.9. Both times the engagement weight.

    With N = u¹⁰ the second is convex and rising in u; from above the root Newton's method comes down without a miss.
    """
    if penetration <= 0.0 or weight <= 0.0:
        return 0.0, 0.0
    if not load_dependent:
        slope = weight / (compliance + contact)
        return slope * penetration, slope
    u = min((penetration / compliance) ** 0.1, (penetration / contact) ** (1.0 / 9.0))
    for _ in range(50):
        u8 = u**8
        change = (u8 * u * (compliance * u + contact) - penetration) / (u8 * (10.0 * compliance * u + 9.0 * contact))
        u -= change
        if change <= 1e-14 * u:
            break
    return weight * u**10, weight / (compliance + 0.9 * contact / u)


@njit(cache=True)
def share_load(
    force: float,
    compliance: FloatArray,
    separation: FloatArray,
    weight: FloatArray,
    contact: float,
    load_dependent: bool,
    pair_forces: FloatArray,
) -> tuple[float, float]:
    """Approach δ at which the pairs' forces N_i(δ − E_i) sum to `force`; return δ and dF/dδ, fill `pair_forces`.

    The sum is convex in δ, and a pair that carried everything alone gives a δ that is too large: Newton comes down.
    """
    delta = 1e300
    for i in range(compliance.size):
        if weight[i] > 0.0:
            n = force / weight[i]
            own = compliance[i] * n + (contact * n**0.9 if load_dependent else contact * n)
            delta = min(delta, separation[i] + own)
    slope = 0.0
    for _ in range(60):
        total, slope = -force, 0.0
        for i in range(compliance.size):
            n, k = pair_force(delta - separation[i], compliance[i], contact, load_dependent, weight[i])
            pair_forces[i] = n
            total += n
            slope += k
        if abs(total) <= 1e-13 * force or slope <= 0.0:
            break
        delta -= total / slope
    return delta, slope


@njit(cache=True)
def share_loads(
    force: float,
    compliance: FloatArray,
    separation: FloatArray,
    weight: FloatArray,
    contact: float,
    load_dependent: bool,
    delta: FloatArray,
    slope: FloatArray,
    pair_forces: FloatArray,
) -> None:
    """`share_load` at each row; fills the last three."""
    for row in range(delta.size):
        delta[row], slope[row] = share_load(
            force, compliance[row], separation[row], weight[row], contact, load_dependent, pair_forces[row]
        )


@njit(cache=True)
def fill_pairs(
    mesh_cycles: FloatArray,
    start: float,
    step: float,
    rows_1: FloatArray,
    rows_2: FloatArray,
    variant_1: FloatArray,
    variant_2: FloatArray,
    separation_1: FloatArray,
    separation_2: FloatArray,
    surface_1: FloatArray,
    surface_2: FloatArray,
    pitch_1: FloatArray,
    pitch_2: FloatArray,
    contact_ratio: float,
    ramp: float,
    compliance: FloatArray,
    separation: FloatArray,
    weight: FloatArray,
) -> None:
    """Look up compliance, separation and weight of the pairs at each c; column j is pair ⌊c + ramp/2⌋ − j."""
    for row in range(mesh_cycles.size):
        newest = int((mesh_cycles[row] + ramp / 2.0) // 1.0)
        for j in range(compliance.shape[1]):
            k = newest - j
            progress = mesh_cycles[row] - k
            tooth_1, tooth_2 = k % variant_1.size, k % variant_2.size
            compliance[row, j] = cubic(rows_1[variant_1[tooth_1]], start, step, progress) + cubic(
                rows_2[variant_2[tooth_2]], start, step, progress
            )
            flanks = cubic(separation_1[surface_1[tooth_1]], start, step, progress) + cubic(
                separation_2[surface_2[tooth_2]], start, step, progress
            )
            separation[row, j] = flanks + pitch_1[tooth_1] + pitch_2[tooth_2]
            weight[row, j] = engagement(progress, contact_ratio, ramp)
