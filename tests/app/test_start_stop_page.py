"""The page of the start–stop drive, run without a browser."""

from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

import app.dashboard
from app.dashboard.start_stop.setup import DriveSetup
from app.dashboard.start_stop.view import NUMBERS, VIEWS
from sims.effects import EffectSetting

MAIN = Path(app.dashboard.__file__).parent / "main.py"


def opened() -> AppTest:
    page = AppTest.from_file(str(MAIN), default_timeout=120).run()
    page.switch_page("pages/start_stop.py").run()
    return page


@pytest.mark.parametrize("view", VIEWS)
def test_every_view_of_the_sound_drive(view: str) -> None:
    page = opened()
    page.session_state["view of the drive"] = view
    page.run()
    assert not page.exception
    assert not page.error
    assert [metric.label for metric in page.metric] == [name[:1].upper() + name[1:] for name in NUMBERS]
    backlash = next(m for m in page.metric if m.label == "Backlash")
    assert float(backlash.value.split()[0]) == pytest.approx(300.0, rel=0.02)
    assert len(page.get("image")) + len(page.dataframe) >= 1


def test_an_effect_shows_beside_the_sound_drive() -> None:
    page = opened()
    page.sidebar.multiselect(key="effects of the drive").set_value(["backlash"]).run()
    assert not page.exception
    backlash = next(m for m in page.metric if m.label == "Backlash")
    assert float(backlash.value.split()[0]) == pytest.approx(400.0, rel=0.02)
    assert backlash.delta.startswith("sound 299")


def test_continuous_rotation_says_what_it_cannot_tell() -> None:
    page = opened()
    page.session_state["mode of the drive"] = "continuous"
    page.run()
    assert not page.exception
    assert any("Cannot tell the backlash" in caption.value for caption in page.caption)


def test_a_setup_names_its_files_and_makes_the_commands_recording() -> None:
    setup = DriveSetup("manipulator_formula", 100.0, 95.0, (), (EffectSetting("backlash", 100.0),), 3.5)
    assert setup.file_stem == "manipulator_formula_backlash"
    recording = setup.record()
    assert recording.truth is not None
    assert recording.truth["backlash_um"] == 400.0
    assert setup.sound.effects == ()


def test_a_crack_has_its_tooth_and_a_ripple_its_order() -> None:
    page = opened()
    page.sidebar.multiselect(key="effects of the drive").set_value(["root_crack", "torque_ripple"]).run()
    page.number_input(key="tooth of root_crack of the drive").set_value(7).run()
    assert not page.exception
    assert page.number_input(key="order of torque_ripple of the drive").value == 6


def test_the_laboratory_leads_to_the_drive() -> None:
    page = AppTest.from_file(str(MAIN), default_timeout=120).run()
    page.switch_page("pages/laboratory.py").run()
    button = next(b for b in page.sidebar.button if b.label == "A drive that starts and stops")
    button.click().run()
    assert not page.exception
    assert "Backlash" in [metric.label for metric in page.metric]
