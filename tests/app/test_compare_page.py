"""The page *Comparison*, run without a browser."""

import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import state
from app.dashboard.compare import MACHINE, ORIGIN, TWIN, SimulationToCompare, command_of, teeth_of
from app.dashboard.state import AnalysisRequest
from gearsig.rig import GearPair, Rig, Shaft
from tests.app.pages import SAMPLES, figures, pictures, shown_text, turned_to
from tests.app.pages import opened as opened_analysis


def opened(recording: str = "root_crack_3mm", simulation: str = "root_crack_0mm") -> AppTest:
    """Choose a recording on the analysis page's own widgets, then go to the comparison."""
    page = opened_analysis(recording)
    page.session_state[ORIGIN] = "Sample"
    page.session_state["simulation sample"] = SAMPLES[simulation]
    return turned_to(page, "compare")


@pytest.mark.slow
def test_two_samples_are_compared_in_every_view() -> None:
    page = opened()
    assert not page.exception
    assert not page.error
    text = shown_text(page)
    assert "root_crack_0mm.h5 beside root_crack_3mm.h5" in text  # what the analysis page had open stays open
    assert "do not differ by more than the records' own scatter" in text
    _, headline = (text.value for text in page.subheader)
    assert headline.count(".") - headline.count("\\.") == 1  # one sentence; the others stand below it
    assert [button.label for button in page.get("download_button")] == ["Report (HTML)", "JSON", "Lines (CSV)"]
    drawn = {}
    for tab in ("Orders", "Angle", "Bands", "Lines"):
        page.session_state["comparison tab"] = tab
        page.run()
        assert not page.exception
        assert not page.get("image")
        assert not pictures(page)
        drawn[tab] = (len(figures(page)), len(page.dataframe), len(page.table))
    assert drawn == {"Orders": (2, 0, 1), "Angle": (4, 0, 1), "Bands": (2, 0, 1), "Lines": (0, 1, 1)}
    assert "gearsig compare root_crack_0mm.h5 root_crack_3mm.h5" in page.code[0].value


def test_the_differences_follow_the_zoom_of_the_spectra() -> None:
    page = opened()
    channel = figures(page)[0]
    page.session_state[state.ZOOMS] = {"orders chart of comparison a1": [50.0, 60.0]}
    page.run()
    assert not page.exception
    assert channel["shown"] != [50.0, 60.0]
    assert [figure["shown"] for figure in figures(page)] == [[50.0, 60.0]] * 2
    name, *ends = page.query_params["zoom"].split("_")
    assert ends == ["50", "60"]
    del page.session_state[state.ZOOMS]
    page.query_params["zoom"] = f"{name}_51_52"
    page.run()
    assert [figure["shown"] for figure in figures(page)] == [[51.0, 52.0]] * 2


def test_records_of_other_gears_are_an_error_on_the_page() -> None:
    page = opened(simulation="healthy")
    assert not page.exception
    assert "other gears" in page.error[0].value


def test_a_simulation_is_run_at_the_recordings_speed() -> None:
    page = opened("healthy")
    page.session_state["length of compare"] = 2.0
    page.sidebar.radio(key=ORIGIN).set_value("Simulate now").run()
    assert not page.exception
    assert not page.error
    assert page.sidebar.selectbox(key=MACHINE).value == TWIN
    assert "1495.6" in shown_text(page)


def test_a_preset_takes_the_rigs_teeth() -> None:
    rig = Rig(shafts=(Shaft("a"), Shaft("b")), pairs=(GearPair("p", "a", "b", 23, 46),))
    assert teeth_of(rig) == {"teeth_driver": 23.0, "teeth_driven": 46.0}
    assert teeth_of(None) == {}


def test_the_command_repeats_the_comparison() -> None:
    request = AnalysisRequest("my run.csv", "0", "rig.toml", "[[pair]]", speed_rpm=1500.0)
    file = AnalysisRequest("model.h5", "1", "model.toml", "[[pair]]")
    words = command_of(request, file, (("a", "b"),), "correlation")
    assert words == (
        "gearsig compare model.h5 'my run.csv' --rig rig.toml --speed-rpm 1500 --sim-rig model.toml --channel a=b "
        "--align correlation -o comparison"
    )
    assert command_of(request, SimulationToCompare(TWIN), (), "auto") == ""
