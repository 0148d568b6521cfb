"""The page of a machine that starts and stops has the pictures that belong to it."""

from dataclasses import replace

import pytest

from gearsig.diagnosis import Analysis, analyze
from gearsig.report import page_html, start_stop_figures
from tests.motion.recordings import continuous, start_stop, without


@pytest.fixture(scope="module")
def examined() -> Analysis:
    return analyze(start_stop())


@pytest.mark.slow
def test_the_page_shows_course_planes_impacts_and_force(examined: Analysis) -> None:
    html = page_html(examined)
    assert "<h2>Starts and stops</h2>" in html
    for words in ("phases shaded", "phase plane of the teeth", "energy over time and tooth", "Force by two models"):
        assert words in html
    assert len(html) < 3_000_000


@pytest.mark.slow
def test_what_was_not_measured_has_no_picture() -> None:
    motion = analyze(without(start_stop(), "torque")).motion
    assert motion is not None
    words = [drawn.alternative for drawn in start_stop_figures(motion)]
    assert not any("Force" in text for text in words)
    assert len(words) == 3


def test_force_errors_are_said_under_the_picture(examined: Analysis) -> None:
    motion = examined.motion
    assert motion is not None
    caption = list(start_stop_figures(motion))[-1].caption
    assert "Hunt–Crossley" in caption
    percent = float(caption.partition(" % rms")[0].split()[-1])  # of the piecewise model on this record
    assert 3.0 < percent < 6.0


@pytest.mark.parametrize("is_steady", [True, False])
def test_steady_or_without_both_gears_there_is_no_such_group(is_steady: bool) -> None:
    recording = continuous() if is_steady else without(start_stop(), "wheel angle", "wheel speed", "wheel acceleration")
    analysis = replace(analyze(recording), channels=())
    assert analysis.motion is None
    assert "Starts and stops" not in page_html(analysis)
