"""Order–frequency coherence: on a run-up, at constant speed, and sums over unequal angles."""

import numpy as np
import pytest

from gearsig.angle import ShaftAngle
from gearsig.errors import InputError, RefusalError
from gearsig.recording import Channel, Recording
from gearsig.spectra import NonuniformTransform, enhanced_envelope, order_coherence, spectral_coherence

FS = 10_000.0
N = (1 << 16) + 1


def recording_of(x: np.ndarray) -> Recording:
    return Recording(x[None, :], FS, (Channel("a", "acceleration", "m/s^2"),))


def run_up(start: float, end: float, n: int = N) -> ShaftAngle:
    t = np.linspace(0.0, (n - 1) / FS, 60)
    slope = (end - start) / t[-1]
    return ShaftAngle("s", t, start * t + slope * t**2 / 2, start + slope * t, "pulses")


def modulated(angle: ShaftAngle, order: float, depth: float, n: int = N) -> np.ndarray:
    turns = angle.revolutions_at(np.arange(n) / FS)
    return (1 + depth * np.cos(2 * np.pi * order * turns)) * np.random.default_rng(1).normal(size=n)


@pytest.mark.parametrize(("start", "end"), [(20.0, 20.0), (10.0, 30.0), (30.0, 12.0)])
def test_modulation_locked_to_the_shaft_stays_on_one_line(start, end):
    angle, depth = run_up(start, end), 0.6
    order = round(3.2 * angle.n_revolutions) / angle.n_revolutions
    c = order_coherence(recording_of(modulated(angle, order, depth)), "a", angle, highest_order=8.0, n_bands=32)
    at = int(np.argmin(np.abs(c.alpha - order)))
    assert c.shaft == "s"
    assert np.argmax(c.coherence_squared.mean(axis=1)) == at
    assert c.coherence_squared[at].mean() == pytest.approx((depth / (1 + depth**2 / 2)) ** 2, rel=0.06)
    assert np.abs(c.correlation[at]).mean() == pytest.approx(depth * 2 / FS, rel=0.06)
    over_time = spectral_coherence(
        modulated(angle, order, depth), FS, highest_alpha_hz=8.0 * max(start, end), n_bands=32
    )
    if start != end:
        assert over_time.coherence_squared.mean(axis=1).max() < 0.2 * c.coherence_squared[at].mean()


@pytest.mark.parametrize(("start", "end"), [(20.0, 20.0), (10.0, 30.0)])
def test_noise_stays_below_the_level(start, end):
    x = np.random.default_rng(7).normal(size=N)
    x[1:] += 0.7 * x[:-1]
    c = order_coherence(recording_of(x), "a", run_up(start, end), highest_order=8.0, n_bands=32)
    assert np.mean(c.coherence_squared <= c.level()) == pytest.approx(0.95, abs=0.01)
    e = enhanced_envelope(c)
    assert np.mean(e.spectrum.values <= e.level) == pytest.approx(0.95, abs=0.035)


def test_at_constant_speed_it_is_nearly_that_over_frequency():
    """The same bands and window; the whitening and the mean power at f - α differ."""
    angle = run_up(20.0, 20.0)
    x = modulated(angle, 3.2, 0.6)
    a = order_coherence(recording_of(x), "a", angle, highest_order=8.0, n_bands=20)
    b = spectral_coherence(x, FS, highest_alpha_hz=160.0, n_bands=20)
    assert a.n_independent == pytest.approx(b.n_independent, rel=1e-3)
    assert a.alpha[:50] * 20.0 == pytest.approx(b.alpha[:50], rel=1e-3)
    strongest = [float(r.coherence_squared.mean(axis=1).max()) for r in (a, b)]
    assert strongest[0] == pytest.approx(strongest[1], rel=0.1)


def test_float32_and_angle_over_a_part_of_the_recording():
    angle = run_up(10.0, 30.0).between(0.5, 5.5)
    x = modulated(run_up(10.0, 30.0), 4.0, 0.8)
    c = order_coherence(recording_of(x), "a", angle, highest_order=8.0, n_bands=20)
    d = order_coherence(recording_of(x.astype(np.float32)), "a", angle, highest_order=8.0, n_bands=20)
    assert d.coherence_squared == pytest.approx(c.coherence_squared, abs=1e-5)
    assert c.alpha[np.argmax(c.coherence_squared.mean(axis=1))] == pytest.approx(4.0, abs=c.alpha_resolution)


def test_sums_over_unequal_angles_are_exact():
    rng = np.random.default_rng(2)
    theta, p = rng.random(400), rng.normal(size=400) + 1j * rng.normal(size=400)
    exact = np.exp(-2j * np.pi * np.outer(np.arange(71), theta)) @ p
    assert NonuniformTransform(theta, 70)(p) == pytest.approx(exact, abs=1e-8 * np.abs(p).sum())


def test_bad_input_names_the_remedy():
    x = np.random.default_rng(0).normal(size=N)
    with pytest.raises(RefusalError, match="at least 8 revolutions"):
        order_coherence(recording_of(x), "a", run_up(20.0, 20.0).between(1.0, 1.2), highest_order=8.0)
    with pytest.raises(InputError, match="highest_order"):
        order_coherence(recording_of(x), "a", run_up(20.0, 20.0), highest_order=0.01)
    with pytest.raises(InputError, match="highest_order is 480"):
        order_coherence(recording_of(x), "a", run_up(20.0, 20.0), highest_order=480.0)
    with pytest.raises(InputError, match="no channel"):
        order_coherence(recording_of(x), "b", run_up(20.0, 20.0), highest_order=8.0)
