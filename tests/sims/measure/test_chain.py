"""The whole chain: from motion to a recording that the analysis side reads as a measured one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.angle import find_shaft_angle
from gearsig.errors import InputError
from gearsig.rig import EncoderChannel, GearPair, Rig, Shaft, TachometerChannel
from sims.measure import (
    Accelerometer,
    AntiAlias,
    Converter,
    Encoder,
    MainsHum,
    MeasuredChannel,
    MeasurementChain,
    ModalPath,
    Motion,
    PathMode,
    Tachometer,
    ratio_of_rates,
)

STEP, RATE = 2e-5, 5000.0
RIG = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(GearPair("p", "in", "out", 20, 40),))
PATH = ModalPath({"y": 0.2}, (PathMode(640.0, 0.05, {"y": 1.0}),))
CHAIN = MeasurementChain(RATE, (MeasuredChannel("a1", PATH, position="bearing"),))


def motion(seconds=2.3, tone_hz=375.0, rev_per_s=25.0):
    t = np.arange(round(seconds / STEP)) * STEP
    angle = 2 * np.pi * rev_per_s * t
    return Motion(STEP, ("y",), np.cos(2 * np.pi * tone_hz * t)[:, None], {"in": angle, "out": angle / 2})


def record(chain=CHAIN, given=None, seed=0, **options):
    return chain.record(given or motion(), rng=np.random.default_rng(seed), **({"rig": RIG} | options))


def line(values, frequency_hz, time_s):
    return 2 * np.mean(values * np.exp(-2j * np.pi * frequency_hz * time_s))


def test_tone_arrives_with_the_paths_gain_and_phase_at_its_time():
    r = record(duration_s=2.0)
    assert r.n_samples == 10_000
    start_s = r.truth["measurement"]["lead_in_s"]
    found = line(r.values("a1"), 375.0, r.time_s() + start_s)
    assert found == pytest.approx(PATH.response(np.array([375.0]), "y")[0], rel=1e-3)


def test_high_tone_does_not_fold_into_the_recording():
    quiet = record(replace(CHAIN, channels=(MeasuredChannel("a1", ModalPath({"y": 1.0})),)), motion(tone_hz=4700.0))
    assert np.abs(quiet.values("a1")).max() < 1e-4


def test_anti_alias_filter_smooths_what_the_sensor_clips_but_the_converter_holds():
    direct = ModalPath({"y": 1.0})
    sensor = MeasuredChannel("sensor", direct, Accelerometer(range_mps2=0.5))
    adc = MeasuredChannel("adc", direct, converter=Converter(0.5, 16))
    r = record(replace(CHAIN, channels=(sensor, adc)))
    assert r.values("adc").max() == 0.5 - Converter(0.5, 16).step_mps2
    assert np.mean(r.values("adc") == r.values("adc").max()) > 0.25
    # Odd harmonics of a clipped tone, within the pass band.
    assert abs(line(r.values("sensor")[:5000], 1125.0, r.time_s()[:5000])) > 0.05


def test_noise_density_survives_sampling():
    from scipy.signal import welch

    noisy = MeasuredChannel("a1", ModalPath({"y": 0.0}), Accelerometer(noise_mps2_per_sqrt_hz=1e-2))
    r = record(replace(CHAIN, channels=(noisy,)), motion(6.0))
    f, density = welch(r.values("a1"), RATE, nperseg=512)
    band = (f > 50) & (f < 0.38 * RATE)
    assert np.sqrt(density[band].mean()) == pytest.approx(1e-2, rel=0.02)


def test_hum_stays_at_its_frequency():
    humming = MeasuredChannel("a1", ModalPath({"y": 0.0}), hum=MainsHum((0.2, 0.1)))
    r = record(replace(CHAIN, channels=(humming,)), duration_s=2.0)
    assert abs(line(r.values("a1"), 50.0, r.time_s())) == pytest.approx(0.2, rel=1e-9)
    assert abs(line(r.values("a1"), 100.0, r.time_s())) == pytest.approx(0.1, rel=1e-9)


@pytest.mark.parametrize(
    ("parts", "kind", "tolerance_rev"),
    [
        ({"tachometer": Tachometer("out", 4, edge_s=1e-3)}, TachometerChannel, 1e-6),
        ({"encoders": (Encoder(shaft="out", counts_per_revolution=3600),)}, EncoderChannel, 6e-4),
    ],
)
def test_shaft_angle_is_found_again(parts, kind, tolerance_rev):
    r = record(replace(CHAIN, **parts), duration_s=2.0)
    assert isinstance(r.speed_source, kind)
    assert r.speed_source.shaft == "out"
    angle = find_shaft_angle(r)
    t = np.linspace(0.2, 1.8, 50)
    turned = np.interp(t, angle.time_s, angle.revolutions)
    np.testing.assert_allclose(turned - turned[0], 25.0 * (t - t[0]), atol=tolerance_rev)
    assert r.truth["measurement"]["n_revolutions"]["out"] == pytest.approx(25.0, rel=1e-9)


def test_channels_carry_quantity_unit_and_position():
    chain = replace(CHAIN, tachometer=Tachometer(edge_s=1e-3), encoders=(Encoder(),))
    r = record(chain)
    assert [(c.name, c.quantity, c.unit, c.position) for c in r.channels] == [
        ("a1", "acceleration", "m/s^2", "bearing"),
        ("tacho", "tachometer", "V", "in"),
        ("encoder", "encoder", "deg", "in"),
    ]
    assert isinstance(r.speed_source, TachometerChannel)
    assert r.provenance.reader == "sims.measure"


def test_pulse_that_the_recording_starts_in_is_high():
    held = motion(2.3, rev_per_s=0.02)
    tacho = Tachometer(duty=0.5, first_pulse_rev=0.9, edge_s=1e-3)  # open from -0.1 rev to 0.4 rev
    r = record(replace(CHAIN, tachometer=tacho), held)
    np.testing.assert_allclose(r.values("tacho"), 5.0)


def test_truth_is_plain_and_holds_the_simulators():
    r = record(truth={"crack_depth_mm": 2.0})
    truth = json.loads(json.dumps(dict(r.truth)))
    assert truth["crack_depth_mm"] == 2.0
    modes = truth["measurement"]["chain"]["channels"][0]["path"]["modes"]
    assert modes[0] == {"kind": "PathMode", "frequency_hz": 640.0, "damping_ratio": 0.05, "gains": {"y": 1.0}}


def test_same_seed_same_recording():
    noisy = replace(
        CHAIN,
        channels=(MeasuredChannel("a1", PATH, Accelerometer(noise_mps2_per_sqrt_hz=1e-2)),),
        tachometer=Tachometer(jitter_s=1e-6, noise_v=0.01),
    )
    a, b, c = (record(noisy, seed=s).samples for s in (1, 1, 2))
    np.testing.assert_array_equal(a, b)
    assert not np.array_equal(a, c)


def test_simulated_time_is_enough_and_not_wasteful():
    for filter_ in (AntiAlias(), AntiAlias(120.0, 0.45)):
        chain = replace(CHAIN, anti_alias=filter_)
        needed = chain.simulated_s(1.0)
        assert record(chain, motion(needed), duration_s=1.0).n_samples == 5000
        with pytest.raises(InputError, match="simulate longer"):
            record(chain, motion(needed - 5 / RATE), duration_s=1.0)


def test_lead_in_of_zero_keeps_what_the_filter_allows():
    r = record(lead_in_s=0.0)
    reach_s = AntiAlias().reach_s(RATE)
    assert reach_s <= r.truth["measurement"]["lead_in_s"] < reach_s + 2 / RATE


def test_misfits_are_refused():
    with pytest.raises(InputError, match="whose angle the simulation does not provide"):
        record(replace(CHAIN, tachometer=Tachometer("gear")))
    with pytest.raises(InputError, match="no channel"):
        MeasurementChain(RATE, ())
    with pytest.raises(InputError, match="one name per column"):
        Motion(STEP, ("x", "y"), np.zeros((5, 1)))


# Anti-alias filter and sampling: pass band, rejection, no delay, ratios of rates.

FAST_HZ = 20480.0


def sampled(frequency_hz, step_s, filter_=None, n_samples=400, first=100, phase=0.4, rate=FAST_HZ):
    t = np.arange(round((first + n_samples + 100) / rate / step_s)) * step_s
    x = np.cos(2 * np.pi * frequency_hz * t + phase)
    out = (filter_ or AntiAlias()).sample(x[None], step_s, rate, first, n_samples)[0]
    return out, np.cos(2 * np.pi * frequency_hz * (first + np.arange(n_samples)) / rate + phase)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.0, 0.4), st.sampled_from([4e-6, 1 / (12 * FAST_HZ), 1 / FAST_HZ / 5.5]), st.integers(60, 300))
def test_pass_band_keeps_amplitude_phase_and_time(fraction, step_s, first):
    out, expected = sampled(fraction * FAST_HZ, step_s, first=first, n_samples=100)
    np.testing.assert_allclose(out, expected, atol=4 * 10 ** (-AntiAlias().attenuation_db / 20))


@settings(max_examples=25, deadline=None)
@given(st.floats(0.5, 5.0), st.sampled_from([4e-6, 1 / (12 * FAST_HZ)]))
def test_what_would_alias_is_rejected(fraction, step_s):
    out, _ = sampled(fraction * FAST_HZ, step_s)
    assert 20 * np.log10(np.abs(out).max()) < -88.0


def test_rejection_follows_the_filter_asked_for():
    for attenuation in (50.0, 70.0, 110.0):
        worst = max(
            np.abs(sampled(f * FAST_HZ, 4e-6, AntiAlias(attenuation))[0]).max()
            for f in (0.5, 0.52, 0.55, 0.6, 0.9, 1.3)
        )
        assert -attenuation - 25 < 20 * np.log10(worst) < -attenuation + 2


def test_without_the_filter_the_tone_would_alias():
    """The rejected tone lies well inside the band after plain picking of samples: the filter is what removes it."""
    step = 1 / (12 * FAST_HZ)
    t = np.arange(12 * 600) * step
    picked = np.cos(2 * np.pi * 0.9 * FAST_HZ * t)[::12]
    assert np.abs(picked).max() > 0.99


def test_same_rate_passes_through():
    x = np.random.default_rng(0).standard_normal((2, 1000))
    t = np.arange(1000)
    x = np.cos(2 * np.pi * np.array([[0.1], [0.3]]) * t)
    out = AntiAlias().sample(x, 1 / FAST_HZ, FAST_HZ, 100, 700)
    np.testing.assert_allclose(out, x[:, 100:800], atol=4 * 10 ** (-AntiAlias().attenuation_db / 20))


def test_ratios_of_rates():
    assert ratio_of_rates(4e-6, 20480.0) == (256, 3125)
    assert ratio_of_rates(1 / (12 * FAST_HZ), FAST_HZ) == (1, 12)
    with pytest.raises(InputError, match="does not fit"):
        ratio_of_rates(np.pi * 1e-6, FAST_HZ)
    with pytest.raises(InputError, match="at most the solver's rate"):
        ratio_of_rates(1e-4, FAST_HZ)


def test_samples_past_the_ends_are_refused():
    filter_ = AntiAlias()
    n = round(0.02 / 4e-6)
    with pytest.raises(InputError, match="simulate longer"):
        filter_.sample(np.zeros((1, n)), 4e-6, FAST_HZ, 0, 10)
    with pytest.raises(InputError, match="simulate longer"):
        filter_.sample(np.zeros((1, n)), 4e-6, FAST_HZ, 100, 400)
