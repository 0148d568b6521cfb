"""The flexible pair set to a rig, for the gap diagnosis."""

import pickle
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from gearsig.errors import RefusalError
from gearsig.gap import Added, OperatingCondition
from gearsig.rig import Bearing, GearPair, OperatingPoint, Rig, Sensor, Shaft
from sims import simulate
from sims.effects import effects
from sims.reduced_fe import (
    TRANSMISSION_ERROR,
    TWIN_STEP_S,
    ReducedPair,
    ReducedTwin,
    constants,
    respond,
)
from sims.registry import gap_simulator
from sims.simulator import SimulationSetup
from tests.sims.reduced_fe.synthetic import synthetic_gear

POINT = OperatingCondition(1800.0, 40.0)
RIG = Rig(
    "bench",
    (Shaft("pinion"), Shaft("wheel")),
    (GearPair("pair", "pinion", "wheel", 21, 50, 2.0, 20.0, 18.0),),
    (Bearing("P1", "pinion", 9, 7.94, 39.04),),
    (Sensor("acc", "acceleration", "m/s^2", "over P1, vertical"),),
    OperatingPoint("wheel", 756.0, torque_nm=100.0),
)
CRACK = Added("root_crack", 2.0, {"gear": "driver", "tooth": 4.0})


@pytest.fixture(scope="module")
def twin() -> Iterator[ReducedTwin]:
    """Of synthetic gears: how gears are reduced is tested elsewhere."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "sims.reduced_fe._simulator.reduced_gear", cache(lambda blank, _n_dof: synthetic_gear(blank.geometry))
        )
        made = gap_simulator("reduced-fe").twin_of(RIG)
        assert isinstance(made, ReducedTwin)
        yield made


def run(twin, added=(), *, seed=0, noise=0):
    return twin.run(POINT, added, seed=seed, noise=noise, duration_s=0.1, sampling_rate_hz=20480.0)


@pytest.fixture(scope="module")
def healthy(twin):
    return run(twin)


def test_the_twin_is_the_rig_with_this_model(twin, healthy):
    found = healthy
    assert found.rig is not None
    assert found.rig.pairs == RIG.pairs
    assert found.truth["model"] == "reduced-fe"
    assert found.truth["parameters"]["teeth_driven"] == 50
    assert found.channel_names[0] == "acc"
    assert twin.key.startswith("reduced-fe ")


@pytest.mark.slow
def test_an_effect_alone_makes_the_difference(twin, healthy):
    cracked, other = run(twin, (CRACK,)), run(twin, seed=1)
    np.testing.assert_array_equal(healthy.samples, run(twin).samples)
    change = np.std(cracked.samples[0] - healthy.samples[0])
    assert 1e-3 * np.std(healthy.samples[0]) < change < np.std(other.samples[0] - healthy.samples[0])
    assert not np.array_equal(run(twin, noise=1).samples[0], healthy.samples[0])


@pytest.mark.slow
def test_a_small_spall_in_a_bearing_knocks_as_in_the_other_model(twin, healthy):
    """The knock's force is that of the rolling element's load, and bearing and sensor are the same in both."""
    other = gap_simulator("cracked").twin_of(RIG)
    baselines = healthy.samples[0], run(other).samples[0]
    for race in ("outer", "inner"):
        spall = Added(f"bearing_{race}_race", 0.08, {"bearing": "P1"})
        knocks = (run(t, (spall,)).samples[0] for t in (twin, other))
        change = [np.std(knock - baseline) for knock, baseline in zip(knocks, baselines, strict=True)]
        assert change[0] == pytest.approx(change[1], rel=0.1)


def test_effects_of_the_model_have_candidates(twin):
    known = gap_simulator("reduced-fe").gap_effects()
    assert set(known) == set(effects())
    for name in ("root_crack", "tooth_wear", "eccentricity", "transfer_path"):
        candidates = twin.candidates(name)
        assert len(candidates) >= 2
        assert twin.draw(name, np.random.default_rng(1)).name == name


@pytest.mark.slow
def test_the_preset_of_a_diagnosis_runs_again(twin, tmp_path):
    path = tmp_path / "twin.toml"
    path.write_text(twin.preset_toml(POINT, (CRACK,), (), seed=0), encoding="utf-8")
    again = simulate("reduced-fe", preset=str(path), duration_s=0.2, seed=0)
    assert again.truth["effects"][0]["name"] == "root_crack"
    assert again.truth["parameters"]["mesh_dof"] == 45000.0


def test_twins_travel_between_processes(twin):
    assert pickle.loads(pickle.dumps(twin)).key == twin.key  # noqa: S301 - our own bytes


def test_a_rig_without_a_module_is_refused():
    rig = Rig("x", (Shaft("a"), Shaft("b")), (GearPair("p", "a", "b", 21, 50),))
    with pytest.raises(RefusalError, match="module_mm"):
        gap_simulator("reduced-fe").twin_of(rig)


def test_the_step_is_short_enough_for_what_is_compared(twin):
    """Lines of acceleration up to 10 kHz, within 60 dB of the greatest, against a step of a fourth."""
    ready = ReducedPair().prepare(SimulationSetup(twin.preset(POINT)), np.random.default_rng(0))
    own, found = constants(ready.pair, ready.operation), []
    for part in (1, 4):
        signals = ("driver y acceleration", "bearing 1 y acceleration", TRANSMISSION_ERROR)
        run = respond(
            ready.pair, ready.operation, duration_s=0.4, signals=signals, step_s=TWIN_STEP_S / part, ready=own
        )
        x = np.array([run[name][len(run[name]) // 2 :: part] for name in signals])
        found.append(np.abs(np.fft.rfft(x * np.hanning(x.shape[1])))[:, : round(1e4 * x.shape[1] * TWIN_STEP_S)])
    for line, (coarse, fine) in enumerate(zip(*found, strict=True)):
        great = fine > 1e-3 * fine.max()
        off = np.abs(20.0 * np.log10(coarse[great] / fine[great]))
        assert np.median(off) < (0.3, 0.3, 0.02)[line]
        assert np.quantile(off, 0.95) < (1.5, 1.5, 0.4)[line]
