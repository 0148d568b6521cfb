"""`simulate forging --check`: the tolerance in use is tight enough, and one that is not is told."""

import pytest

from gearsig.errors import RefusalError
from sims.forging import Cycle, check_convergence
from sims.machine import Profile
from tests.app.test_cli import run
from tests.sims.forging.drives import drive


@pytest.mark.parametrize("mode", ["start-stop", "continuous"])
@pytest.mark.parametrize("stiffness", ["formula", "table"])
def test_the_tolerance_in_use_is_enough(mode: str, stiffness: str) -> None:
    made = drive(contact_stiffness=stiffness)
    found = check_convergence(made, Cycle(mode, brake_nm=60.0), Profile.constant(95.0))
    assert found.converged
    assert abs(found.time_s - found.exact_time_s) < 2e-6
    assert found.energy_error < 1e-3
    assert found.n_exact_steps > 2 * found.n_steps


def test_a_coarse_tolerance_is_told() -> None:
    found = check_convergence(drive(), Cycle(brake_nm=60.0), Profile.constant(95.0), tolerance=1e-3)
    assert not found.converged
    assert "NOT converged" in found.text


def test_without_torque_there_is_nothing_to_compare() -> None:
    with pytest.raises(RefusalError, match="never meet"):
        check_convergence(drive(), Cycle(), Profile.constant(0.0))


def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "simulate", "forging", "--check")
    assert code == 0
    assert "back-impact after the torque has gone" in out
    assert "converged" in out
    assert "NOT" not in out
