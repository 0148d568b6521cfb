"""The fault laboratory with the pair of finite-element gears."""

import numpy as np
import pytest

from app.dashboard.laboratory.run import run_setup
from app.dashboard.laboratory.setup import Setup
from app.dashboard.laboratory.views import TAB, stiffness
from sims.effects import EffectSetting
from sims.presets import presets
from tests.app.pages import shown_text
from tests.app.test_laboratory import opened, slider

NAME = "flexible_50_50"
CRACKED = Setup(
    NAME, 2000.0, 170.0, effects=(EffectSetting("root_crack", 2.0),), duration_s=0.1, model="reduced-fe", seed=2
)


@pytest.fixture
def page():
    return opened(NAME)


def test_the_machine_opens_with_all_effects(page) -> None:
    assert not page.exception
    assert not page.error
    assert presets("reduced-fe")[NAME].title in shown_text(page)
    labels = [s.label for s in (*page.sidebar.slider, *page.sidebar.number_input)]
    assert any(label.startswith("Flank roughness") for label in labels)
    shown = page.sidebar.multiselect(key="effects of the laboratory").options
    assert any("inner race" in option for option in shown)
    assert any("friction" in option for option in shown)
    assert any("eccentric" in option or "off its axis" in option for option in shown)


@pytest.mark.slow
def test_every_view_shows_the_cracked_gear_beside_the_healthy_one(page) -> None:
    slider(page, "Crack").set_value(2.0).run()
    assert "Crack in a tooth root, 2 mm" in shown_text(page)
    for tab in ("Time", "Spectrum", "Envelope", "Phase portrait", "Bifurcation", "Mesh"):
        page.session_state[TAB] = tab
        page.run()
        assert not page.exception, tab
    page.session_state[TAB] = "Bifurcation"
    assert "model with rigid gears" in shown_text(page.run())


def test_the_page_simulates_what_the_command_line_does() -> None:
    run, saved = run_setup(CRACKED), CRACKED.record()
    np.testing.assert_array_equal(run.recording.samples, saved.samples)
    assert run.pair is not None
    cycles = np.linspace(0.0, 2.0, 21)
    assert 2.0e8 < stiffness(run, cycles).mean() < 3.2e8
