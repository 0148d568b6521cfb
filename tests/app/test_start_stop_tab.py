"""The analysis page on a recording of a machine that starts and stops, run without a browser."""

from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import state
from app.dashboard.analysis import MOTION, VIEWS
from sims.files import file_set, write_set
from tests.app.pages import figures, opened, opened_file, shown_text, tiles
from tests.motion.recordings import start_stop


@pytest.fixture
def page(tmp_path: Path) -> AppTest:
    names = file_set(tmp_path / "drive.h5")
    write_set(start_stop(), names)
    return opened_file("drive.h5", names.recording.read_bytes(), names.rig.read_text())


def test_its_figures_have_a_tab_and_the_others_say_why_they_are_empty(page: AppTest) -> None:
    assert tiles(page) == [MOTION, *VIEWS]
    page.session_state[state.TAB] = "Starts and stops"
    page.run()
    assert not page.exception
    assert len(figures(page)) >= 4
    assert "Hunt–Crossley, one pair on one flank" in shown_text(page)
    page.session_state[state.TAB] = "Spectrum"
    page.run()
    assert not page.exception
    assert "The machine starts and stops" in shown_text(page)


def test_other_recordings_have_no_such_tab() -> None:
    assert tiles(opened()) == list(VIEWS)
