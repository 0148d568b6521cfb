"""Changes to a blind scene: faults and tolerances of flanks, teeth, shafts, bearings and chain, and their catalogue."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from math import gcd, lcm, log10, pi, radians, sin, sqrt

import numpy as np

from gearsig.checks import FloatArray
from sims.blind._rig import SHAFTS, BlindRig, SensorResonance, SpurPair, texture
from sims.blind._scene import BlindMotion, Scene, Train, coloured_noise, path_response, with_speed_profile

Place = Mapping[str, str | int | float]
Span = Callable[[BlindRig], tuple[float, float]]
Apply = Callable[[Scene, float, np.random.Generator], Place]


@dataclass(frozen=True)
class Change:
    """A possible fault or other change.

    Parameters
    ----------
    name, group, unit : str
        Group "outside" for changes that are not in the catalogue.
    span : function
        Rig → severities, barely noticeable and strong.
    apply : function
        Changes the scene and returns the location. All choices come from the given generator, in a fixed order, so that
        every recording of a case has the same fault; variations within a run come from the scene's generator.
    resembles : str
        For a change outside the catalogue: the effect it is easily mistaken for, or empty.
    """

    name: str
    group: str
    unit: str
    span: Span
    apply: Apply
    resembles: str = ""

    def severity(self, rig: BlindRig, level: float) -> float:
        """Severity at a level from 0 (weak end of the span) to 1 (strong end), geometric between."""
        low, high = self.span(rig)
        return float(low * (high / low) ** level)


GEARS = ("pinion", "wheel")
"""Names of the gears on the input and the output shaft, regardless of their size."""


def steady(low: float, high: float) -> Span:
    """Return a span that is the same for every rig."""
    return lambda _rig: (low, high)


def deflection_um(rig: BlindRig) -> float:
    """Mesh deflection at rated load."""
    return 1e6 * rig.rated_nm / rig.pair.base_radii_m[0] / rig.mesh_stiffness_n_per_m()


# --------------------
# Bearings: damaged races with slipping cages, clearance.
# --------------------


EXIT_S = 0.15e-3
"""Duration of the impact at the far edge of a defect."""


def slipping_angles(scene: Scene, shaft: int, order: float, slip: float) -> FloatArray:
    """Shaft angles of impacts at an order, with mean cage slip and cumulative jitter."""
    n = int(scene.turns[shaft] * order) + 2
    spacing = 2 * pi / (order * (1 - slip)) * (1 + scene.rng.normal(0, 0.008, n))
    return np.asarray(np.cumsum(spacing) - spacing[0] * scene.rng.random())


def load_direction(scene: Scene, body: int) -> float:
    """Direction of the mesh force on a rotor."""
    return scene.rig.parts.line_angle + (pi if body == 0 else 0.0)


def blow_n(scene: Scene, severity_mm: float) -> float:
    """Force of an impact: increases with the defect and with the bearing load, which the weight keeps above 0."""
    load_n = scene.mesh_force_n / 2 + 9.81 * max(scene.rig.parts.rotor_mass_kg)
    return float(0.3 * severity_mm**0.8 * load_n)


def add_blows(
    scene: Scene, shaft: int, angle: FloatArray, force: FloatArray, turn: FloatArray, *, width_mm: float, race_mm: float
) -> None:
    """Add an unloading as an element drops in, then a short impact at the far edge."""
    omega = scene.omega[shaft]
    across = width_mm / race_mm / 2  # rad of cage travel over the defect, in shaft angle about twice that
    scene.trains.append(Train(shaft, shaft, angle, -0.3 * force, turn, max(4 * across / omega, 2 * EXIT_S)))
    scene.trains.append(Train(shaft, shaft, angle + 4 * across, force, turn, EXIT_S))


def _race(scene: Scene, severity: float, choice: np.random.Generator, *, is_inner: bool) -> Place:
    shaft, slip, spot = int(choice.integers(2)), choice.uniform(0.002, 0.015), choice.uniform(-0.6, 0.6)
    at = choice.uniform(0, 2 * pi)
    bearing = scene.rig.bearing(shaft)
    order = bearing.orders()["BPFI" if is_inner else "BPFO"]
    angle = slipping_angles(scene, shaft, order, slip)
    force = blow_n(scene, severity) * np.clip(scene.rng.normal(1, 0.2, len(angle)), 0.2, 2)
    sense = 1.0 if shaft == 0 else -1.0
    mid = load_direction(scene, shaft)
    turn = sense * angle + at if is_inner else np.full(len(angle), mid + spot)
    zone = np.maximum(np.cos(turn - mid), 0.0) ** 1.5
    add_blows(
        scene, shaft, angle, force * zone, turn, width_mm=severity, race_mm=(bearing.pitch_diameter_mm or 40.0) / 2
    )
    return {"shaft": SHAFTS[shaft], "bearing": bearing.name, "order": round(order, 4)}


def _clearance(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft = int(choice.integers(2))
    scene.clearance_m[shaft] += severity * 1e-6
    return {"shaft": SHAFTS[shaft], "bearing": scene.rig.bearing(shaft).name}


BEARING_CHANGES = (
    Change("bearing_outer_race", "bearing", "mm", steady(0.06, 6.0), partial(_race, is_inner=False)),
    Change("bearing_inner_race", "bearing", "mm", steady(0.08, 6.0), partial(_race, is_inner=True)),
    Change("bearing_clearance", "bearing", "um", steady(3.0, 60.0), _clearance),
)

# --------------------
# The measurement chain: a resonance of housing or mounting, mains hum, clipping.
# --------------------


def _channels(scene: Scene, choice: np.random.Generator) -> list[int]:
    """Return all sensors, or one of them."""
    n = len(scene.rig.chains)
    channel = int(choice.integers(n))
    return [channel] if choice.random() < 0.5 else list(range(n))


def _path(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Add the response of a sensor on a soft mount: 1 + (g − 1) × band-pass."""
    channels = _channels(scene, choice)
    f_hz, quality = 10 ** choice.uniform(log10(900), log10(8000)), choice.uniform(4, 15)
    gain = 10 ** (severity / 20) - 1

    def stage(motion: BlindMotion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        from scipy.signal import iirpeak, lfilter

        b, a = iirpeak(f_hz, quality, fs=motion.rate_hz)
        changed = np.array(signal)
        for i in channels:
            changed[i] += gain * lfilter(b, a, signal[i])
        return changed

    scene.stages.append(stage)
    return {"frequency_hz": round(float(f_hz), 1), "channels": " ".join(f"a{i + 1}" for i in channels)}


def _hum(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    channels, parts = _channels(scene, choice), np.array([1.0, choice.uniform(0.05, 0.4), choice.uniform(0.1, 0.5)])

    def stage(motion: BlindMotion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        t = np.arange(signal.shape[1]) / scene.rig.sampling_rate_hz
        grid_hz, phase, changed = 50 + rng.normal(0, 0.02), rng.uniform(0, 2 * pi, 3), np.array(signal)
        hum = severity * sum(a * np.sin(2 * pi * grid_hz * (k + 1) * t + phase[k]) for k, a in enumerate(parts))
        changed[channels] += hum
        return changed

    scene.late_stages.append(stage)
    return {"frequency_hz": 50.0, "channels": " ".join(f"a{i + 1}" for i in channels)}


def _clip(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Clip the signal at a limit, a percentage below the loudest healthy recording's peak."""
    channels = _channels(scene, choice)

    def stage(motion: BlindMotion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        changed = np.array(signal)
        for i in channels:
            peak = scene.reference_peak[i] if scene.reference_peak else float(np.abs(signal[i]).max())
            limit = (1 - severity / 100) * peak
            changed[i] = np.clip(signal[i], -limit, limit)
        return changed

    scene.late_stages.append(stage)
    return {"channels": " ".join(f"a{i + 1}" for i in channels)}


CHAIN_CHANGES = (
    Change("transfer_path", "measurement chain", "dB", steady(8.0, 32.0), _path),
    Change("mains_hum", "measurement chain", "m/s^2", steady(0.02, 12.0), _hum),
    Change("clipping", "measurement chain", "% of peak cut off", steady(10.0, 92.0), _clip),
)

# --------------------
# Drive and load: torque ripple, speed fluctuation, backlash.
# --------------------


def _ripple(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft, order, phases = (
        int(choice.integers(2)),
        float(choice.choice([1, 2, 3, 4, 6, 8])),
        choice.uniform(0, 2 * pi, 2),
    )
    mean_nm = scene.condition.true_nm * (scene.rig.pair.z2 / scene.rig.pair.z1 if shaft else 1.0)
    for k, part in enumerate((1.0, 0.25)):
        scene.torque.append((float(shaft), order * (k + 1), severity / 100 * mean_nm * part, phases[k]))
    return {"shaft": SHAFTS[shaft], "order": order}


def _fluctuation(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    first, second, phase = choice.uniform(0.4, 3), choice.uniform(0.1, 0.5), choice.uniform(0, 2 * pi)
    later = scene.rng.uniform(0, 20)

    def factor(t: FloatArray) -> FloatArray:
        swing = np.sin(2 * pi * first * (t + later)) + 0.4 * np.sin(2 * pi * second * (t + later) + phase)
        return np.asarray(1 + severity / 100 * swing)

    with_speed_profile(scene, factor)
    return {"frequency_hz": round(float(first), 3)}


def _backlash(scene: Scene, severity: float, choice: np.random.Generator) -> Place:  # noqa: ARG001 - nothing to choose
    scene.backlash_m += severity * 1e-6
    return {"gear": "both"}


DRIVE_CHANGES = (
    Change("torque_ripple", "drive", "% of mean torque", steady(0.5, 50.0), _ripple),
    Change("speed_fluctuation", "drive", "%", steady(0.6, 12.0), _fluctuation),
    Change("backlash", "drive", "um", lambda rig: (8 * rig.pair.module_mm, 300 * rig.pair.module_mm), _backlash),
)

# --------------------
# All flanks: wear, pitch, roughness, friction.
# --------------------


SMOOTHED = 0.12
"""Fraction of a rough flank's height that remains after averaging over the contact."""


def wear_shape(pair: SpurPair) -> tuple[FloatArray, FloatArray]:
    """Depth of wear over the path on both gears, maximum 1: pressure × sliding distance × number of meshes.

    Source: J. F. Archard, Contact and rubbing of flat surfaces, *J. Appl. Phys.* 24 (1953).
    """
    place = np.clip(pair.path, 0, pair.contact_ratio)
    rho1, rho2 = pair.rho_m(place)
    rolling_1, rolling_2 = rho1, rho2 * pair.z1 / pair.z2
    sliding = np.abs(rolling_1 - rolling_2)
    alone = 0.25 * (1 + np.tanh((place - pair.contact_ratio + 1) / 0.06)) * (1 + np.tanh((1 - place) / 0.06))
    load = 0.5 + 0.5 * alone
    floor = 0.1 * rolling_1.max()
    depth = [
        load * sliding / np.maximum(rolling_1, floor) * pair.z2 / pair.z1,
        load * sliding / np.maximum(rolling_2, floor),
    ]
    deepest = max(d.max() for d in depth)
    return depth[0] / deepest, depth[1] / deepest


def _wear(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    for gear, shape in enumerate(wear_shape(scene.rig.pair)):
        scatter = 1 + choice.normal(0, 0.08, (len(scene.gap_m[gear]), 1))
        scene.gap_m[gear] = scene.gap_m[gear] + severity * 1e-6 * shape * scatter
    return {"gear": "both"}


def _pitch(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Deviations of one gear's teeth; the severity is the largest step between adjacent teeth."""
    gear = int(choice.integers(2))
    n_teeth = len(scene.gap_m[gear])
    if choice.random() < 0.6:
        error = choice.standard_normal(n_teeth)
    else:  # an indexing error that accumulates and is corrected in one step
        error = np.roll(np.linspace(0, 1, n_teeth), int(choice.integers(n_teeth))) + 0.1 * choice.standard_normal(
            n_teeth
        )
    steps = np.abs(np.diff(error, append=error[0]))
    error = (error - error.mean()) / steps.max()
    scene.gap_m[gear] = scene.gap_m[gear] + severity * 1e-6 * error[:, None]
    return {"gear": GEARS[gear], "shaft": ("input", "output")[gear]}


def _roughness(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    pair = scene.rig.pair
    for gear in range(2):
        rough = texture(choice, pair, len(scene.gap_m[gear]), severity * 1e-6 * SMOOTHED / np.sqrt(2))
        scene.gap_m[gear] = scene.gap_m[gear] + rough
    healthy, rough_um = scene.rig.finish_um, min(severity, 0.5)
    scene.slip = scene.slip * max((1.13 - healthy) / (1.13 - rough_um), 1.0)
    return {"gear": "both"}


def _friction(scene: Scene, severity: float, choice: np.random.Generator) -> Place:  # noqa: ARG001 - nothing to choose
    inside = (scene.rig.pair.path >= 0) & (scene.rig.pair.path <= scene.rig.pair.contact_ratio)
    scene.slip = scene.slip * severity / float(np.abs(scene.slip[inside]).mean())
    return {"gear": "both"}


FLANK_CHANGES = (
    Change("tooth_wear", "flank", "um", lambda rig: (0.3 * deflection_um(rig), 12 * deflection_um(rig)), _wear),
    Change("pitch_error", "flank", "um", lambda rig: (0.2 * deflection_um(rig), 8 * deflection_um(rig)), _pitch),
    Change("surface_roughness", "flank", "um", steady(1.0, 20.0), _roughness),
    Change("sliding_friction", "flank", "1", steady(0.09, 0.5), _friction),
)

# --------------------
# Shafts: eccentric gears, unbalance, misalignment.
# --------------------


def _add_unbalance(scene: Scene, shaft: int, amount_kgm: float, angle: float) -> None:
    old, phase = scene.unbalance[shaft]
    total = old * np.exp(1j * phase) + amount_kgm * np.exp(1j * angle)
    scene.unbalance[shaft] = float(abs(total)), float(np.angle(total))


def _eccentricity(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft, angle = int(choice.integers(2)), choice.uniform(0, 2 * pi)
    scene.runout.append((float(shaft), 1.0, severity * 1e-6, angle))
    _add_unbalance(scene, shaft, scene.rig.pair.gear_mass_kg(shaft) * severity * 1e-6, angle)
    return {"gear": GEARS[shaft], "shaft": SHAFTS[shaft]}


def _unbalance(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    shaft, angle = int(choice.integers(2)), choice.uniform(0, 2 * pi)
    _add_unbalance(scene, shaft, severity * 1e-6, angle)
    return {"shaft": SHAFTS[shaft]}


def _misalignment(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A wedge between the flanks, partly rotating with a shaft, and coupling forces once and twice per revolution."""
    shaft = int(choice.integers(2))
    standing, turning = choice.uniform(0.4, 0.7), choice.uniform(0.2, 0.4)
    coupling_n_per_m, phases = choice.uniform(0.5e6, 3e6), choice.uniform(0, 2 * pi, 5)
    offset_m = severity * 1e-6
    scene.wedge_m += standing * offset_m
    scene.wobble.append((float(shaft), 1.0, turning * offset_m, phases[0]))
    for order, part, phase in ((1.0, 0.3, phases[1]), (2.0, 1.0, phases[2])):
        scene.sway.append((float(shaft), order, part * coupling_n_per_m * offset_m, phase, phases[3]))
    torque_nm = 0.02 * severity / (4 * deflection_um(scene.rig)) * scene.condition.true_nm
    scene.torque.append((float(shaft), 2.0, torque_nm, phases[4]))
    return {"shaft": SHAFTS[shaft]}


SHAFT_CHANGES = (
    Change(
        "eccentricity", "shaft", "um", lambda rig: (30 * rig.pair.module_mm, 150 * rig.pair.module_mm), _eccentricity
    ),
    Change(
        "unbalance",
        "shaft",
        "g mm",
        lambda rig: (80 * min(rig.parts.rotor_mass_kg), 2400 * min(rig.parts.rotor_mass_kg)),
        _unbalance,
    ),
    Change("misalignment", "shaft", "um", steady(4.0, 300.0), _misalignment),
)

# --------------------
# One tooth: a root crack, a spall on the flank, a broken tip.
# --------------------


YOUNG_PA = 2.06e11
ROOT_MODULES = 2.0
"""Root chord of a standard tooth in modules."""
CRACK_ANGLE = radians(60)
HERTZ_SHARE = 0.3
"""Fraction of a pair's compliance that is local to the contact."""


def _tooth(scene: Scene, choice: np.random.Generator) -> tuple[int, int, Place]:
    gear = int(choice.integers(2))
    n_teeth = (scene.rig.pair.z1, scene.rig.pair.z2)[gear]
    tooth = int(choice.integers(n_teeth))
    place: dict[str, str | int | float] = {"gear": GEARS[gear], "tooth": tooth, "shaft": SHAFTS[gear]}
    if gear == 0:  # only the input shaft has a tachometer as angle reference
        place["angle_deg"] = round(360 * (tooth + scene.rig.pair.contact_ratio / 2) / n_teeth % 360, 2)
    return gear, tooth, place


def crack_compliance(pair: SpurPair, gear: int, depth_mm: float) -> FloatArray:
    """Deflection per force along the line of action over the path, m/N, from a hinge at the root.

    c = 24 S(a/s) / (E b s²), S(x) = (x/(1 − x))² (5.93 − 19.69x + 37.14x² − 35.84x³ + 13.12x⁴), times the lever
    squared; accurate to 1 % for any depth.

    Source: H. Tada, P. C. Paris and G. R. Irwin, *The Stress Analysis of Cracks Handbook* (2000), single edge crack in
    bending.
    """
    chord_m = ROOT_MODULES * pair.module_mm / 1000
    x = depth_mm / 1000 * sin(CRACK_ANGLE) / chord_m
    opening = (x / (1 - x)) ** 2 * sum(c * x**n for n, c in enumerate((5.93, -19.69, 37.14, -35.84, 13.12)))
    hinge = 24 * opening / (YOUNG_PA * pair.face_mm / 1000 * chord_m**2)
    rho = pair.rho_m(np.clip(pair.path, 0, pair.contact_ratio))[gear]
    rb, rp = pair.base_radii_m[gear], pair.pitch_radii_m[gear]
    lever = np.sqrt(rb**2 + rho**2) - (rp - pair.module_mm / 1000)
    return np.asarray(hinge * (np.maximum(lever, 0) * np.cos(pair.alpha)) ** 2)


def _crack(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    gear, tooth, place = _tooth(scene, choice)
    scene.weak[gear][tooth] += scene.pair_stiffness * crack_compliance(scene.rig.pair, gear, severity)
    return place


def _spall(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Width lost over a band of the flank: the contact there is shorter; the edges are as wide as the Hertzian band."""
    gear, tooth, place = _tooth(scene, choice)
    pair = scene.rig.pair
    centre, length = pair.pitch_point + choice.uniform(-0.2, 0.2), choice.uniform(0.15, 0.35)
    share = min(severity / pair.face_mm, 0.95)
    edge = 0.15 / (pair.base_pitch_m * 1000)
    band = 0.5 * (np.tanh((pair.path - centre + length / 2) / edge) - np.tanh((pair.path - centre - length / 2) / edge))
    scene.weak[gear][tooth] += HERTZ_SHARE * share / (1 - share) * band
    return place


def _chip(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Lost active profile: the pair's path ends earlier (pinion) or begins later (wheel)."""
    gear, tooth, place = _tooth(scene, choice)
    pair, loss_m = scene.rig.pair, severity / 1000
    ra, rb = pair.tip_radii_m[gear], pair.base_radii_m[gear]
    rho = sqrt(max((ra - loss_m) ** 2 - rb**2, 1e-12))
    if gear == 0:
        end = (rho - pair.rho_start_m) / pair.base_pitch_m
        beyond = pair.path - end
    else:
        end = (pair.centre_distance_m * sin(pair.alpha) - rho - pair.rho_start_m) / pair.base_pitch_m
        beyond = end - pair.path
    lost = beyond > 0
    gap = pair.corner_gap_m(1 - gear, beyond[lost] * pair.base_pitch_m, loss_m)
    scene.gap_m[gear][tooth][lost] += np.maximum(gap - scene.base_gap_m[lost], 0)
    return place


def _crack_span(rig: BlindRig) -> tuple[float, float]:
    chord_mm = ROOT_MODULES * rig.pair.module_mm / sin(CRACK_ANGLE)
    return 0.4 * chord_mm, 0.9 * chord_mm


TOOTH_CHANGES = (
    Change("root_crack", "tooth-local", "mm", _crack_span, _crack),
    Change("tooth_spall", "tooth-local", "mm", lambda rig: (0.4 * rig.pair.face_mm, 0.95 * rig.pair.face_mm), _spall),
    Change(
        "chipped_tooth", "tooth-local", "mm", lambda rig: (0.35 * rig.pair.module_mm, 1.5 * rig.pair.module_mm), _chip
    ),
)

# --------------------
# Changes outside the catalogue, some of them easily mistaken for one of its effects.
# --------------------


OUTSIDE = "outside"


def _by_load(low: float, high: float) -> Span:
    """Return a span in fractions of the rated mesh force."""
    return lambda rig: (low * rig.rated_nm / rig.pair.base_radii_m[0], high * rig.rated_nm / rig.pair.base_radii_m[0])


def _rub(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A loose foot or seal that rubs over a few degrees of each revolution."""
    shaft, at, arc, way = (
        int(choice.integers(2)),
        choice.uniform(0, 2 * pi),
        choice.uniform(0.06, 0.3),
        choice.uniform(0, 2 * pi),
    )
    n_turns = int(scene.turns[shaft]) + 2
    n_touches = int(choice.integers(2, 6))
    angle = (
        2 * pi * np.arange(n_turns)[:, None] + at + np.sort(scene.rng.uniform(0, arc, (n_turns, n_touches)))
    ).ravel()
    force = severity * np.clip(scene.rng.normal(0.8, 0.3, len(angle)), 0, 2)
    scene.trains.append(Train(shaft, shaft, angle, force, np.full(len(angle), way), 0.25e-3))
    return {"shaft": SHAFTS[shaft]}


def _knock(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A worn coupling that takes up its play once or twice per revolution."""
    shaft, per_turn, at = int(choice.integers(2)), int(choice.integers(1, 3)), choice.uniform(0, 2 * pi)
    n = int(scene.turns[shaft] * per_turn) + 2
    angle = at + 2 * pi * np.arange(n) / per_turn + scene.rng.normal(0, 0.004, n)
    torque = severity * np.clip(scene.rng.normal(1, 0.12, n), 0.3, 2)
    scene.trains.append(Train(shaft, 2, angle, torque, np.zeros(n), choice.uniform(0.3e-3, 1e-3)))
    # The drive line's compliance keeps most of it from the teeth, but not from the coupling's bearing.
    arm_m = scene.rig.pair.pitch_radii_m[shaft]
    scene.trains.append(
        Train(
            shaft,
            shaft,
            angle,
            torque / arm_m * 0.4,
            np.full(n, choice.uniform(0, 2 * pi)),
            choice.uniform(0.3e-3, 0.8e-3),
        )
    )
    return {"shaft": SHAFTS[shaft], "order": per_turn}


def _ball(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A damaged rolling element: two impacts per spin, strong while the cage has it in the load zone."""
    shaft, slip = int(choice.integers(2)), choice.uniform(0.002, 0.015)
    bearing = scene.rig.bearing(shaft)
    spin, cage = bearing.orders()["BSF"], bearing.orders()["FTF"]
    angle = slipping_angles(scene, shaft, 2 * spin, slip)
    mid = load_direction(scene, shaft)
    turn = mid + cage * angle
    zone = np.maximum(np.cos(turn - mid), 0.0) ** 1.5
    inner_or_outer = np.where(np.arange(len(angle)) % 2, 1.0, 0.7)
    force = blow_n(scene, severity) * zone * inner_or_outer * np.clip(scene.rng.normal(1, 0.25, len(angle)), 0.2, 2)
    add_blows(scene, shaft, angle, force, turn, width_mm=severity, race_mm=(bearing.pitch_diameter_mm or 40.0) / 2)
    return {"shaft": SHAFTS[shaft], "bearing": bearing.name, "order": round(2 * spin, 4)}


def _field(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Magnetic pull of a motor at twice the line frequency, with slip sidebands; it shakes the whole bed."""
    slip_hz, depth = choice.uniform(0.3, 2.5), choice.uniform(0.1, 0.6)

    def stage(motion: BlindMotion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:
        t = np.arange(signal.shape[1]) / motion.rate_hz
        line_hz, phase = 100 + rng.normal(0, 0.04), rng.uniform(0, 2 * pi, 3)
        pull = (
            severity * (1 + depth * np.cos(2 * pi * slip_hz * t + phase[0])) * np.cos(2 * pi * line_hz * t + phase[1])
        )
        pull += 0.15 * severity * np.cos(4 * pi * line_hz * t + phase[2])
        share = np.linspace(1.0, 0.6, signal.shape[0])[:, None]
        return np.asarray(signal + share * pull)

    scene.stages.append(stage)
    return {"frequency_hz": 100.0}


def _cavitation(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A pump on the same bed: broadband cavitation noise modulated by the vanes, and a vane tone."""
    vanes, shaft = int(choice.integers(5, 10)), int(choice.integers(2))
    ways = [
        SensorResonance(10 ** choice.uniform(log10(1500), log10(9000)), choice.uniform(0.05, 0.2), 1.0)
        for _ in range(4)
    ]
    tone, depth = choice.uniform(0.1, 0.4), choice.uniform(0.3, 0.9)
    swell_phase = choice.uniform(0, 2 * pi, len(scene.rig.chains))

    def stage(motion: BlindMotion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:
        theta = motion.theta[shaft]
        changed = np.array(signal)
        for i in range(signal.shape[0]):
            swell = 1 + depth * np.cos(vanes * theta + swell_phase[i])
            wide = path_response(coloured_noise(rng, len(theta), motion.rate_hz, 0.0) * swell, motion.rate_hz, ways)
            changed[i] += severity * (wide / wide.std() + tone * np.cos(vanes * theta))
        return changed

    scene.stages.append(stage)
    return {"shaft": SHAFTS[shaft], "order": vanes}


def _belt(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A belt or fan beside the drive: lines at an order that does not belong to the gear pair."""
    shaft, way, phases = int(choice.integers(2)), choice.uniform(0, 2 * pi), choice.uniform(0, 2 * pi, 4)
    order = float(choice.choice([choice.uniform(0.31, 0.48), choice.uniform(0.53, 0.93), choice.uniform(2.1, 7.9)]))
    for k, part in enumerate((1.0, 0.7, 0.4, 0.25)):
        # Light masses move with it: the force increases with the harmonic's frequency.
        scene.sway.append((float(shaft), order * (k + 1), severity * part, phases[k], way))
    return {"shaft": SHAFTS[shaft], "order": round(order, 4)}


def _cable(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A loose cable: at random times the signal jumps, fades and returns."""
    channel = int(choice.integers(len(scene.rig.chains)))
    depth, step = choice.uniform(0.4, 0.95), choice.uniform(1, 10)

    def stage(motion: BlindMotion, signal: FloatArray, rng: np.random.Generator) -> FloatArray:  # noqa: ARG001 - a stage's form
        fs = scene.rig.sampling_rate_hz
        n, changed = signal.shape[1], np.array(signal)
        level = float(signal[channel].std())
        for _ in range(1 + rng.poisson(severity * n / fs)):
            start, length = int(rng.integers(n)), int(fs * rng.uniform(0.005, 0.06))
            end = min(start + length, n)
            changed[channel, start:end] *= 1 - depth
            decay = np.exp(-np.arange(n - start) / (fs * rng.uniform(0.002, 0.02)))
            changed[channel, start:] += rng.choice([-1, 1]) * step * level * decay
        return changed

    scene.late_stages.append(stage)
    return {"channels": f"a{channel + 1}"}


def _warm(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """A warm housing: its resonance frequencies fall and their damping rises."""
    spread = choice.uniform(0.6, 1.4, (len(scene.paths), 8))
    scene.paths = [
        [
            replace(
                mode,
                frequency_hz=mode.frequency_hz * (1 - severity / 100 * s),
                damping_ratio=mode.damping_ratio * (1 + severity / 30),
            )
            for mode, s in zip(path, row, strict=False)
        ]
        for path, row in zip(scene.paths, spread, strict=True)
    ]
    return {"channels": "all"}


def _turns_to_tooth(pair: SpurPair, tooth: int) -> int:
    """Revolutions of gear 1 until its tooth 0 meets tooth 0 of gear 2, if it now meets `tooth`."""
    g = gcd(pair.z1, pair.z2)
    n_mates = pair.z2 // g
    return -tooth // g * pow(pair.z1 // g, -1, n_mates) % n_mates


def _stain(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Teeth that marked each other at standstill, with an impact whenever the marks meet again.

    Where that is rare, there are several marks, so that marks meet at least every eight revolutions.
    """
    pair = scene.rig.pair
    meeting = lcm(pair.z1, pair.z2) // pair.z1
    period = meeting / -(-meeting // 8)
    n = int(scene.turns[0] / period) + 2
    # The mark is on the same teeth, whichever teeth meet when the recording begins.
    first = (choice.random() * meeting + _turns_to_tooth(pair, scene.offsets[1])) % period
    angle = 2 * pi * (first + period * np.arange(n))
    for shaft, way in ((0, scene.rig.parts.line_angle + pi), (1, scene.rig.parts.line_angle)):
        # Both trains follow the input shaft's angle, so that the gears are pushed apart at the same instant.
        scene.trains.append(Train(0, shaft, angle, np.full(n, severity), np.full(n, way), 0.3e-3))
    return {"gear": "both", "order": 1 / period}


def _ghost(scene: Scene, severity: float, choice: np.random.Generator) -> Place:
    """Ghost component from the index wheel of the gear cutter: a wave whose cycles are not a multiple of the teeth."""
    gear = int(choice.integers(2))
    teeth = (scene.rig.pair.z1, scene.rig.pair.z2)
    order = round(teeth[gear] * choice.uniform(1.15, 2.3))
    while order % teeth[gear] == 0:
        order += 1
    scene.runout.append((float(gear), float(order), severity * 1e-6, choice.uniform(0, 2 * pi)))
    return {"gear": GEARS[gear], "shaft": SHAFTS[gear], "order": order}


CHANGES = (
    Change("foundation_rub", OUTSIDE, "N", _by_load(0.005, 0.4), _rub, "chipped_tooth"),
    Change(
        "coupling_knock", OUTSIDE, "N m", lambda rig: (0.006 * rig.rated_nm, 0.4 * rig.rated_nm), _knock, "root_crack"
    ),
    Change("ball_defect", OUTSIDE, "mm", steady(0.08, 4.0), _ball, "bearing_inner_race"),
    Change("electromagnetic_line", OUTSIDE, "m/s^2", steady(0.02, 12.0), _field, "mains_hum"),
    Change("temperature_shift", OUTSIDE, "%", steady(3.0, 25.0), _warm, "transfer_path"),
    Change("hunting_stain", OUTSIDE, "N", _by_load(0.02, 0.9), _stain, "tooth_spall"),
    Change("ghost_component", OUTSIDE, "um", lambda rig: (0.03 * deflection_um(rig), 1.2 * deflection_um(rig)), _ghost),
    Change("pump_cavitation", OUTSIDE, "m/s^2", steady(0.05, 8.0), _cavitation),
    Change("belt_line", OUTSIDE, "N", _by_load(0.001, 0.15), _belt),
    Change("loose_cable", OUTSIDE, "bursts/s", steady(0.2, 8.0), _cable),
)

# --------------------
# All changes by name.
# --------------------


CATALOGUE: dict[str, Change] = {
    change.name: change
    for family in (TOOTH_CHANGES, FLANK_CHANGES, SHAFT_CHANGES, DRIVE_CHANGES, BEARING_CHANGES, CHAIN_CHANGES)
    for change in family
}
"""The 19 effects that the diagnosing side can name."""
OUTSIDE_CATALOGUE: dict[str, Change] = {change.name: change for change in CHANGES}
"""Changes that it cannot name."""
CHAIN_GROUP = "measurement chain"
MECHANICAL: tuple[str, ...] = tuple(name for name, change in CATALOGUE.items() if change.group != CHAIN_GROUP)
"""The 16 effects of the machine itself."""
EVERY: dict[str, Change] = CATALOGUE | OUTSIDE_CATALOGUE
