"""The page of a machine that starts and stops has the pictures that belong to it."""

import pytest

from gearsig.diagnosis import analyze
from gearsig.report import page_html, start_stop_figures
from tests.motion.recordings import continuous, start_stop, without


def test_the_page_shows_course_planes_impacts_and_force() -> None:
    html = page_html(analyze(start_stop()))
    assert "<h2>Starts and stops</h2>" in html
    for words in ("phases shaded", "phase plane of the teeth", "energy over time and tooth", "Force by two models"):
        assert words in html
    assert len(html) < 3_000_000


def test_what_was_not_measured_has_no_picture() -> None:
    motion = analyze(without(start_stop(), "torque")).motion
    assert motion is not None
    words = [drawn.alternative for drawn in start_stop_figures(motion)]
    assert not any("Force" in text for text in words)
    assert len(words) == 3


def test_force_errors_are_said_under_the_picture() -> None:
    motion = analyze(start_stop()).motion
    assert motion is not None
    caption = list(start_stop_figures(motion))[-1].caption
    assert "Hunt–Crossley" in caption
    assert "6." in caption or "7." in caption  # per cent rms of the piecewise model on this record


def test_a_steady_machine_has_no_such_group() -> None:
    analysis = analyze(continuous())
    assert analysis.motion is None
    assert "Starts and stops" not in page_html(analysis)


@pytest.mark.parametrize("missing", ["wheel angle"])
def test_without_both_gears_the_page_stands_without_them(missing: str) -> None:
    recording = without(start_stop(), missing, "wheel speed", "wheel acceleration")
    analysis = analyze(recording)
    assert analysis.motion is None
    assert "Starts and stops" not in page_html(analysis)
