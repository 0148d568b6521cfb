"""The page of the start–stop drive, run without a browser."""

import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard.laboratory.drive import FAULTS, NUMBERS, VIEWS
from app.dashboard.laboratory.setup import DRIVE_MODEL, Setup
from sims.effects import EffectSetting
from tests.app.pages import figures, on


def opened(machine: str = "manipulator_formula") -> AppTest:
    return on("laboratory", **{"machine of laboratory": machine})


def test_every_view_of_the_healthy_drive() -> None:
    page = opened()
    for view in VIEWS:
        page.session_state["view of the healthy drive"] = view
        page.run()
        assert not page.exception
        assert not page.error
        assert len(figures(page)) + len(page.dataframe) >= 1
    assert [metric.label for metric in page.metric] == [name[:1].upper() + name[1:] for name in NUMBERS]
    backlash = next(m for m in page.metric if m.label == "Backlash")
    assert float(backlash.value.split()[0]) == pytest.approx(300.0, rel=0.02)


def test_an_effect_shows_beside_the_healthy_drive() -> None:
    page = opened()
    page.sidebar.slider(key="lab severity of backlash of the drive").set_value(100.0).run()
    assert not page.exception
    assert not page.error
    assert len(figures(page)) == 5
    backlash = next(m for m in page.metric if m.label == "Backlash")
    assert float(backlash.value.split()[0]) == pytest.approx(400.0, rel=0.02)
    assert backlash.delta.startswith("healthy 299")


def test_continuous_rotation_says_what_it_cannot_tell() -> None:
    page = opened()
    page.session_state["mode of laboratory"] = "continuous"
    page.run()
    assert not page.exception
    assert any("Cannot tell the backlash" in caption.value for caption in page.caption)


def test_a_setup_names_its_files_and_makes_the_commands_recording() -> None:
    setup = Setup(
        "manipulator_formula", 100.0, 95.0, (), (EffectSetting("backlash", 100.0),), 3.5, 1000.0, model=DRIVE_MODEL
    )
    assert setup.file_stem == "manipulator_formula_backlash_100"
    recording = setup.record()
    assert recording.truth is not None
    assert recording.truth["backlash_um"] == 400.0
    assert setup.healthy.effects == ()


def test_a_crack_has_its_tooth_and_a_ripple_its_order() -> None:
    page = opened()
    page.sidebar.slider(key="lab severity of root_crack of the drive").set_value(6.0).run()
    page.sidebar.slider(key="lab severity of torque_ripple of the drive").set_value(5.0).run()
    page.number_input(key="tooth of root_crack of the drive").set_value(7).run()
    assert not page.exception
    assert page.number_input(key="order of torque_ripple of the drive").value == 6


@pytest.mark.slow
def test_the_laboratory_goes_back_to_pairs_that_run_on() -> None:
    page = opened()
    page.sidebar.selectbox(key="machine of laboratory").set_value("published_55_75").run()
    assert not page.exception
    assert not page.error
    assert "Kurtosis" in [metric.label for metric in page.metric]


@pytest.mark.parametrize("name", FAULTS)
def test_every_fault_at_the_end_of_its_slider_runs_or_says_why(name: str) -> None:
    page = opened()
    slider = page.sidebar.slider(key=f"lab severity of {name} of the drive")
    slider.set_value(slider.max).run()
    assert not page.exception
    assert not page.error
