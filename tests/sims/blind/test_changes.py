"""Each change appears where physics says, and grows with its severity; looked at in the motion itself."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import hilbert

from sims.blind import (
    CATALOGUE,
    EVERY,
    ROOT_MODULES,
    BlindMotion,
    RunCondition,
    Scene,
    SpurPair,
    crack_compliance,
    draw_rig,
    measure,
    run,
    scene_of,
    wear_shape,
)

PER_TURN = 1024
RIG = draw_rig(np.random.default_rng(5), "calibration")
PAIR = RIG.pair
EVERYWHERE = " ".join(f"a{i + 1}" for i in range(len(RIG.chains)))


def scene(share: float = 0.6, rpm: float = 1500.0, duration_s: float = 1.2) -> Scene:
    nm = share * RIG.rated_nm
    return scene_of(RIG, RunCondition(rpm, nm, rpm, nm, duration_s, 21, 22))


def changed(name: str, severity: float, choice: int = 0, **wishes: float) -> tuple[Scene, BlindMotion, dict]:
    made = scene(**wishes)
    place = EVERY[name].apply(made, severity, np.random.default_rng(choice))
    return made, run(made), dict(place)


@pytest.fixture(scope="module")
def healthy() -> BlindMotion:
    return run(scene())


def choice_with(name: str, **wanted: object) -> int:
    """A seed of choices for which the change sits where it is wanted."""
    return next(
        i
        for i in range(200)
        if wanted.items() <= dict(EVERY[name].apply(scene(), 1.0, np.random.default_rng(i))).items()
    )


def turns(motion: BlindMotion, x: np.ndarray, shaft: int = 0) -> np.ndarray:
    """A signal at even angles of a shaft, (n_turns, PER_TURN)."""
    theta = motion.theta[shaft] / (2 * np.pi)
    first, last = int(np.ceil(theta[0])), int(np.floor(theta[-1]))
    at = first + np.arange((last - first) * PER_TURN) / PER_TURN
    return np.interp(at, theta, x).reshape(last - first, PER_TURN)


def line(motion: BlindMotion, x: np.ndarray, order: float, shaft: int = 0) -> float:
    """Amplitude at an order of a shaft."""
    whole = turns(motion, x, shaft).ravel()
    whole = (whole - whole.mean()) * np.hanning(len(whole))
    at = np.exp(-2j * np.pi * order * np.arange(len(whole)) / PER_TURN)
    return float(4 * abs((whole * at).mean()))


def severity(name: str, level: float) -> float:
    return EVERY[name].severity(RIG, level)


@pytest.mark.parametrize("name", ["root_crack", "tooth_spall", "chipped_tooth"])
def test_a_bad_tooth_shows_at_its_angle(name: str, healthy: BlindMotion) -> None:
    """Most of the change of the mean turn lies within two teeth of the place given, and it grows."""
    choice = choice_with(name, gear="pinion")
    sizes = []
    for level in (0.5, 0.75, 1.0):
        _, motion, place = changed(name, severity(name, level), choice)
        delta = turns(motion, motion.squeeze_m).mean(axis=0) - turns(healthy, healthy.squeeze_m).mean(axis=0)
        off = np.abs((np.arange(PER_TURN) / PER_TURN * 360 - float(place["angle_deg"]) + 180) % 360 - 180)
        delta = delta - np.median(delta)
        near = off < 2.5 * 360 / PAIR.z1
        sizes.append(float((delta**2).sum()))
        assert (delta[near] ** 2).sum() > 0.7 * (delta**2).sum()
        assert np.argmax(np.abs(delta)) in np.flatnonzero(near)
    assert sizes[0] < sizes[1] < sizes[2]


def test_crack_hinge_by_fracture_mechanics() -> None:
    """∫ x F² dx of the edge crack in bending (Tada) against the closed form, from shallow to nearly through."""

    def factor(x: float) -> float:
        y = np.pi * x / 2
        return float(np.sqrt(np.tan(y) / y) * (0.923 + 0.199 * (1 - np.sin(y)) ** 4) / np.cos(y))

    pair = SpurPair(30, 40, 3.0, 24.0)
    chord_m = ROOT_MODULES * 3e-3
    lever_m = None
    for depth in (0.1, 0.25, 0.4, 0.6, 0.8):
        integral = quad(lambda x: x * factor(x) ** 2, 1e-9, depth)[0]
        ours = crack_compliance(pair, 0, depth * chord_m * 1000 / np.sin(np.radians(60)))[200]
        hinge = 72 * np.pi * integral / (2.06e11 * 24e-3 * chord_m**2)
        lever2 = ours / hinge
        lever_m = lever2 if lever_m is None else lever_m
        assert lever2 == pytest.approx(lever_m, rel=0.1)
    assert 1e-3 < np.sqrt(lever_m or 0) < 8e-3


def test_wear_spares_the_pitch_point() -> None:
    one, two = wear_shape(PAIR)
    at = int(np.argmin(np.abs(PAIR.path - PAIR.pitch_point)))
    assert max(one[at], two[at]) < 0.05
    assert max(one.max(), two.max()) == pytest.approx(1.0)
    assert min(one.min(), two.min()) >= 0


def test_wear_raises_the_mesh_error(healthy: BlindMotion) -> None:
    """More of the static compression is lost to the worn flanks with every step."""
    means = [changed("tooth_wear", severity("tooth_wear", x))[1].squeeze_m.mean() for x in (0.3, 0.6, 1.0)]
    assert healthy.squeeze_m.mean() < means[0] < means[1] < means[2]


def test_pitch_error_draws_shaft_lines(healthy: BlindMotion) -> None:
    """Lines of its shaft that are no mesh lines rise with the severity; those of the mesh much less."""
    choice = choice_with("pitch_error", gear="pinion")
    orders = [k for k in range(3, PAIR.z1) if k != PAIR.z1]

    def energy(motion: BlindMotion) -> float:
        return sum(line(motion, motion.squeeze_m, k) ** 2 for k in orders)

    found = [energy(healthy)] + [
        energy(changed("pitch_error", severity("pitch_error", x), choice)[1]) for x in (0.4, 0.7, 1)
    ]
    assert found == sorted(found)
    assert found[-1] > 10 * found[0]


def test_roughness_is_not_periodic_with_the_mesh() -> None:
    """What is left after taking the mean tooth out grows in proportion."""

    def rest(level_um: float) -> float:
        _, motion, _ = changed("surface_roughness", level_um)
        x = turns(motion, motion.mesh_n)
        spectrum = np.abs(np.fft.rfft(x.ravel()))
        spectrum[:: len(x) * PAIR.z1] = 0  # the mesh lines
        spectrum[: 3 * len(x) * PAIR.z1] = 0
        return float(np.sqrt((spectrum**2).sum()))

    found = [rest(x) for x in (1.0, 2.0, 4.0)]
    assert found[1] == pytest.approx(2 * found[0], rel=0.4)
    assert found[2] == pytest.approx(2 * found[1], rel=0.4)


def test_friction_pushes_across_the_line_of_action() -> None:
    """The force across the line of action at the mesh order is in proportion to the coefficient."""
    across = np.array([np.sin(RIG.parts.line_angle), -np.cos(RIG.parts.line_angle)])
    # A slow shaft keeps the rotor's own resonance out of it.
    found = []
    for mu in (0.06, 0.12, 0.18):
        _, motion, _ = changed("sliding_friction", mu, rpm=620.0)
        found.append(line(motion, across @ motion.bearing_n[:2], PAIR.z1))
    assert found[0] < found[1] < found[2]
    assert found[2] - found[1] == pytest.approx(found[1] - found[0], rel=0.25)


def test_eccentricity_is_a_once_per_turn_run_out(healthy: BlindMotion) -> None:
    for shaft, gear in enumerate(("pinion", "wheel")):
        choice = choice_with("eccentricity", gear=gear)
        _, motion, _ = changed("eccentricity", 40.0, choice)
        assert line(motion, motion.squeeze_m, 1.0, shaft) == pytest.approx(40e-6, rel=0.25)
        assert line(healthy, healthy.squeeze_m, 1.0, shaft) < 10e-6
        _, motion, _ = changed("eccentricity", 100.0, choice)
        away = 1 if shaft == 0 else PAIR.z1 / PAIR.z2
        side, before = (
            sum(line(m, m.mesh_n, h * PAIR.z1 + s * away) for h in (1, 2) for s in (-1, 1)) for m in (motion, healthy)
        )
        assert side > 2 * before


def test_unbalance_turns_with_its_shaft(healthy: BlindMotion) -> None:
    """Force m e ω² on the bearing at order 1, and at no other shaft's; 90° apart in x and y."""
    choice = choice_with("unbalance", shaft="input")
    _, motion, _ = changed("unbalance", 2000.0, choice)
    expected = 2000e-6 * (1500 * np.pi / 30) ** 2
    delta = [line(motion, motion.bearing_n[k], 1.0) - line(healthy, healthy.bearing_n[k], 1.0) for k in (0, 1)]
    np.testing.assert_allclose(delta, expected, rtol=0.3)
    other = PAIR.z1 / PAIR.z2
    if abs(other - 1) > 0.1:
        assert (
            line(motion, motion.bearing_n[2], other) < 2 * line(healthy, healthy.bearing_n[2], other) + 0.05 * expected
        )


def test_misalignment_doubles_the_shaft_order(healthy: BlindMotion) -> None:
    choice = choice_with("misalignment", shaft="input")
    twice = [line(healthy, healthy.bearing_n[0], 2.0) + line(healthy, healthy.bearing_n[1], 2.0)]
    for um in (20.0, 60.0):
        _, motion, _ = changed("misalignment", um, choice)
        twice.append(line(motion, motion.bearing_n[0], 2.0) + line(motion, motion.bearing_n[1], 2.0))
    assert twice[0] < twice[1] < twice[2]


def test_torque_ripple_at_its_order(healthy: BlindMotion) -> None:
    choice = choice_with("torque_ripple", shaft="output")
    force = []
    for percent in (5.0, 20.0):
        _, motion, place = changed("torque_ripple", percent, choice)
        force.append(line(motion, motion.mesh_n, float(place["order"]), 1))
    base = line(healthy, healthy.mesh_n, float(place["order"]), 1)
    assert force[0] < force[1]
    assert base < force[1]


def test_speed_swings_by_what_is_asked() -> None:
    for percent in (1.0, 4.0):
        _, motion, _ = changed("speed_fluctuation", percent, duration_s=4.0)
        turn_s = np.diff(
            np.interp(
                np.arange(motion.theta[0][0] + 1, motion.theta[0][-1] - 1, 2 * np.pi),
                motion.theta[0],
                np.arange(len(motion.theta[0])),
            )
        )
        swing = turn_s.std() / turn_s.mean()
        assert 0.4 * percent / 100 < swing < 1.1 * percent / 100


def test_backlash_matters_only_when_teeth_part() -> None:
    loaded = [changed("backlash", um)[1].mesh_n for um in (1.0, 400.0)]
    np.testing.assert_array_equal(loaded[0], loaded[1])
    light = [changed("backlash", um, share=0.001)[1] for um in (1.0, 100.0, 400.0)]
    assert light[0].squeeze_m.min() > light[1].squeeze_m.min() > light[2].squeeze_m.min()
    assert light[2].mesh_n.min() < 0


@pytest.mark.parametrize(("name", "key"), [("bearing_outer_race", "BPFO"), ("bearing_inner_race", "BPFI")])
def test_race_defects_strike_at_the_bearing_order(name: str, key: str, healthy: BlindMotion) -> None:
    """The envelope of the bearing's force has a line near the order, below it by no more than the cage's slip."""
    choice = choice_with(name, shaft="input")
    _, motion, place = changed(name, 1.5, choice, duration_s=3.0)
    order = RIG.bearing(0).orders()[key]
    assert place["order"] == pytest.approx(order, abs=1e-4)

    def envelope(of: BlindMotion) -> np.ndarray:
        x = turns(of, of.bearing_n[0]).ravel()
        x = np.diff(x, 2)
        return np.asarray(np.abs(hilbert(x)))

    env = envelope(motion)
    spectrum = np.abs(np.fft.rfft(env - env.mean()))
    orders = np.arange(len(spectrum)) * PER_TURN / len(env)
    near = (orders > 0.97 * order) & (orders < 1.003 * order)
    around = (orders > 0.85 * order) & (orders < 1.15 * order) & ~near
    assert spectrum[near].max() > 3 * np.median(spectrum[around])
    assert env.std() > envelope(healthy).std()


def test_clearance_lets_the_shaft_move(healthy: BlindMotion) -> None:
    """The bearing still carries the load; its force passes more of the elements' passing."""
    choice = choice_with("bearing_clearance", shaft="input")
    _, motion, _ = changed("bearing_clearance", 20.0, choice)
    np.testing.assert_allclose(motion.bearing_n[:2].mean(axis=1), healthy.bearing_n[:2].mean(axis=1), rtol=0.1)
    order = RIG.bearing(0).orders()["BPFO"]
    both = [line(m, m.bearing_n[0], order) + line(m, m.bearing_n[1], order) for m in (healthy, motion)]
    assert both[1] > both[0]


def recorded(name: str, amount: float, choice: int = 0) -> np.ndarray:
    made = scene(duration_s=2.0)
    made.reference_rms, made.reference_peak = (1.0,) * len(RIG.chains), (10.0,) * len(RIG.chains)
    EVERY[name].apply(made, amount, np.random.default_rng(choice))
    return np.asarray(measure(made, run(made)).samples[0], dtype=float)


def spectrum(x: np.ndarray) -> np.ndarray:
    return np.abs(np.fft.rfft(x * np.hanning(len(x)))) * 4 / len(x)


def test_hum_is_a_line_at_the_grid() -> None:
    choice = choice_with("mains_hum", channels=EVERYWHERE)
    delta = spectrum(recorded("mains_hum", 2.0, choice))
    f = np.fft.rfftfreq(2 * (len(delta) - 1), 1 / RIG.sampling_rate_hz)
    assert delta[(f > 49) & (f < 51)].max() == pytest.approx(2.0, rel=0.3)


def test_clipping_holds_the_signal() -> None:
    x = recorded("clipping", 60.0, choice_with("clipping", channels=EVERYWHERE))
    assert np.abs(x).max() <= 4.0 * (1 + 1e-6)


def test_path_peak_stands_where_it_is_said() -> None:
    choice = choice_with("transfer_path", channels=EVERYWHERE)
    place = dict(CATALOGUE["transfer_path"].apply(scene(), 20.0, np.random.default_rng(choice)))
    with_it, without = (
        spectrum(recorded("transfer_path", 20.0, choice)),
        spectrum(recorded("transfer_path", 0.0, choice)),
    )
    f = np.fft.rfftfreq(2 * (len(with_it) - 1), 1 / RIG.sampling_rate_hz)
    ratio_db = 20 * np.log10(with_it / without)
    at = np.abs(f - float(place["frequency_hz"])) < 15
    far = np.abs(f / float(place["frequency_hz"]) - 1) > 0.7
    assert np.median(ratio_db[at]) > 12
    assert abs(np.median(ratio_db[far])) < 3


def test_no_change_is_no_change() -> None:
    """At severity 0 every change that is added to something leaves the scene's tables as they were."""
    plain = scene()
    for name in ("root_crack", "tooth_spall", "chipped_tooth", "tooth_wear", "pitch_error", "surface_roughness"):
        made = scene()
        EVERY[name].apply(made, 0.0, np.random.default_rng(0))
        for a, b in zip((*plain.gap_m, *plain.weak), (*made.gap_m, *made.weak), strict=True):
            np.testing.assert_allclose(a, b, atol=1e-12)
