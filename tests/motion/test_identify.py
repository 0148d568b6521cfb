"""Parameters from data: recovered without noise, inside their intervals with it, and refused where they do not show."""

import json
from pathlib import Path

import numpy as np
import pytest

from gearsig.errors import RefusalError
from gearsig.motion import Identification, identify, measure_motion, robust_fit
from gearsig.recording import Recording
from gearsig.rig import read_rig
from sims import simulate
from sims.files import file_set, write_set
from tests.app.test_cli import run
from tests.motion.recordings import QUIET, continuous, start_stop, without

TRUE = {
    "half_backlash_um": 150.0,
    "restitution": 0.95,
    "driver_inertia_kg_m2": 0.01,
    "friction_coefficient": 0.05,
    "driven_inertia_kg_m2": 42.0 + 0.5 * 290.0 * 0.15**2,
    "load_friction_nm": 300.0,
    "load_viscous_nm_s_per_rad": 20.0,
}
STIFFNESS = {"manipulator_formula": 1.8366e10, "manipulator_table": 1.72e9}


def found(recording: Recording) -> Identification:
    return identify(measure_motion(recording))


def drive(preset: str, seed: int = 0, **parameters: float | str) -> Recording:
    return simulate(
        "forging", preset=preset, parameters=parameters, duration_s=12.0, sampling_rate_hz=1000.0, seed=seed
    )


@pytest.mark.parametrize("preset", STIFFNESS)
def test_without_noise_everything_is_recovered(preset: str) -> None:
    fitted = found(drive(preset, **QUIET))
    for name, true in (TRUE | {"stiffness_n_per_m_lambda": STIFFNESS[preset]}).items():
        assert fitted.parameter(name).is_determined, name
        assert fitted.parameter(name).value == pytest.approx(true, rel=0.02), name


def test_other_values_than_the_rigs_are_found() -> None:
    """The rig file says 150 µm and so on: what comes out is the machine's, not the file's."""
    other = {"wear_um": 60.0, "restitution": 0.7, "load_friction_nm": 200.0, "piece_mass_kg": 800.0}
    fitted = found(drive("manipulator_formula", **other))
    assert fitted.parameter("half_backlash_um").value == pytest.approx(180.0, rel=0.01)
    assert fitted.parameter("half_backlash_um").rig_value == 150.0
    assert fitted.parameter("restitution").value == pytest.approx(0.7, abs=0.03)
    assert fitted.parameter("load_friction_nm").value == pytest.approx(200.0, rel=0.03)
    assert fitted.parameter("driven_inertia_kg_m2").value == pytest.approx(42.0 + 0.5 * 800.0 * 0.15**2, rel=0.02)


@pytest.mark.slow
def test_intervals_hold_the_truth() -> None:
    """Nominally 95 %: of 8 parameters in 2 × 4 recordings at least 85 %, and they are not just wide."""
    inside = []
    for preset, stiffness in STIFFNESS.items():
        for seed in range(4):
            fitted = found(drive(preset, seed))
            for name, true in (TRUE | {"stiffness_n_per_m_lambda": stiffness}).items():
                low, high = fitted.parameter(name).interval
                inside.append(low <= true <= high)
            low, high = fitted.parameter("half_backlash_um").interval
            assert high - low < 3.0
    assert len(inside) == 64
    assert np.mean(inside) >= 0.85


def test_noise_takes_away_what_is_small_first() -> None:
    """Encoders of 16 bits: play and load are still told; pinion and friction of the teeth are not."""
    fitted = found(drive("manipulator_formula", encoder_counts=65536, angle_noise_urad=20))
    told = {p.name for p in fitted.parameters if p.is_determined}
    assert {"half_backlash_um", "driven_inertia_kg_m2", "load_friction_nm"} <= told
    assert not {"friction_coefficient", "driver_inertia_kg_m2"} & told
    assert "hardly depends" in fitted.parameter("friction_coefficient").why_not


def test_continuous_rotation_tells_neither_play_nor_damping() -> None:
    fitted = found(continuous())
    assert not fitted.parameter("half_backlash_um").is_determined
    assert "only one flank" in fitted.parameter("half_backlash_um").why_not
    assert not fitted.parameter("restitution").is_determined
    assert not fitted.parameter("motor_inertia_kg_m2").is_determined
    assert fitted.parameter("driven_inertia_kg_m2").is_determined


@pytest.mark.slow
def test_stiffness_from_one_flank_is_not_told() -> None:
    """A torque that a filter has smoothed makes the teeth seem twenty times stiffer, if nothing tells the zero."""
    both = {"mode": "continuous", "slow_channels": "filtered"}
    fitted = found(drive("manipulator_formula", **both)).parameter("stiffness_n_per_m_lambda")
    assert not fitted.is_determined
    assert "only one flank" in fitted.why_not
    stopped = found(drive("manipulator_formula", slow_channels="filtered")).parameter("stiffness_n_per_m_lambda")
    assert stopped.is_determined
    assert stopped.value == pytest.approx(1.8366e10, rel=0.06)


def test_motion_alone_tells_no_values() -> None:
    with pytest.raises(RefusalError, match="no torque"):
        found(without(start_stop(), "torque"))


def test_a_line_with_outliers_and_a_parameter_that_nothing_depends_on() -> None:
    rng = np.random.default_rng(0)
    x = np.linspace(0.0, 1.0, 400)
    y = 2.0 + 3.0 * x + 0.1 * rng.standard_normal(len(x))
    y[::40] += 50.0
    fit = robust_fit(
        lambda p: y - p[0] - p[1] * x + 0.0 * p[2],
        np.array([0.0, 1.0, 5.0]),
        np.ones(3),
        np.ones(len(x), dtype=bool),
        ("offset", "slope", "nothing"),
    )
    assert fit.n_samples == 390
    assert fit.value("slope") == pytest.approx(3.0, abs=4.0 * fit.deviation("slope"))
    expected = 0.1 * np.sqrt(12.0 / 390.0)
    assert expected * 0.85 < fit.deviation("slope") < 2.0 * expected
    assert np.isinf(fit.deviation("nothing"))
    with pytest.raises(RefusalError, match="samples are left"):
        robust_fit(lambda p: y - p[0], np.zeros(1), np.ones(1), np.zeros(len(x), dtype=bool), ("offset",))


def test_the_command(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file, fitted = tmp_path / "drive.h5", tmp_path / "fitted.toml"
    write_set(start_stop(wear_um=60.0), file_set(file))
    code, out, _ = run(capsys, "identify", file, "-o", fitted)
    assert code == 0
    assert "half_backlash_um" in out
    assert "motor_inertia_kg_m2: it is ahead of the torque sensor" in out
    contact = read_rig(fitted).contact
    assert contact is not None
    assert contact.half_backlash_um == pytest.approx(180.0, rel=0.01)
    code, out, _ = run(capsys, "identify", file, "--json")
    data = json.loads(out)
    assert (code, data["schema"]) == (0, "gearsig.identify")
    assert {p["name"] for p in data["parameters"]} >= {*TRUE, "stiffness_n_per_m_lambda"}
    code, _, err = run(capsys, "identify", file, "-o", tmp_path / "fitted.csv")
    assert code == 2
    assert ".toml" in err
