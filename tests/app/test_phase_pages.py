"""Embedding and chaos on the analysis page, bifurcations in the laboratory; run without a browser."""

import pytest

from app.dashboard.laboratory import bifurcation as bifurcation_view
from app.dashboard.laboratory.views import TAB
from app.dashboard.widgets.method import two_numbers
from gearsig.errors import InputError
from tests.app.pages import figures, opened_at, shown_text
from tests.app.test_laboratory import opened


def number(page, label):
    return next(w for w in page.number_input if w.label.startswith(label))


@pytest.mark.parametrize("method", ["Lyapunov exponent", "Kind of motion", "Recurrence", "0–1 test"])
def test_every_question_is_answered_or_says_why_not(method):
    page = opened_at(method)
    if method == "Lyapunov exponent":
        assert not page.error
        assert "the signal is stochastic or too noisy" in page.info[0].value.replace("\\", "")
        return
    assert len(figures(page)) == (1 if method == "Recurrence" else 2)
    assert not page.error
    assert method != "Kind of motion" or "the signal as measured" in shown_text(page)


@pytest.mark.slow
def test_the_path_is_shown_in_space_with_its_own_dimension():
    page = opened_at("Portrait and section")
    number(page, "Dimension").set_value(2)
    next(w for w in page.toggle if w.label == "Drawn in space").set_value(True).run()
    assert "give at least 3" in shown_text(page)
    number(page, "Dimension").set_value(4).run()
    assert len(page.get("plotly_chart")) == 1


@pytest.mark.slow
def test_a_run_up_is_warned_of():
    assert "at steady speed" in shown_text(opened_at("Phase plane", "run_up"))
    assert "at steady speed" not in shown_text(opened_at("Phase plane"))


def test_the_lowest_frequency_lies_below_the_mesh():
    page = opened_at("Phase plane")
    assert "a third of the slowest mesh frequency" in number(page, "Lowest frequency").placeholder


def test_a_stretch_to_fit_is_taken_or_refused():
    assert two_numbers("", "fit") is None
    assert two_numbers("0.001; 2e-3", "fit") == (0.001, 0.002)
    for wrong in ("1", "a, b", "1, 2, 3"):
        with pytest.raises(InputError, match="two numbers"):
            two_numbers(wrong, "fit")


def at_bifurcation():
    page = opened("small_30_25")
    page.session_state[TAB] = "Bifurcation"
    page.session_state["values of laboratory"] = 3
    return page.run()


def button(page, label):
    return next(b for b in page.button if b.label == label)


@pytest.mark.slow
def test_a_bifurcation_is_drawn_on_demand():
    page = at_bifurcation()
    assert not figures(page)
    assert "Nothing is drawn yet" in shown_text(page)
    button(page, "Draw").click().run()
    assert not page.exception
    assert not page.error
    assert [figure["plane"] for figure in figures(page)] == [True, False]  # points of sections, then lines over speed
    assert any(b.proto.label == "Points (CSV)" for b in page.get("download_button"))


def test_stopped_it_keeps_what_is_complete(monkeypatch):
    page = at_bifurcation()
    monkeypatch.setattr(bifurcation_view, "PASS_S", -1.0)  # the time is always up

    monkeypatch.setattr(bifurcation_view, "_go_on", lambda: None)
    button(page, "Draw").click().run()
    assert not figures(page)
    button(page, "Stop").click().run()
    assert page.session_state[bifurcation_view.ASKED] == ""


def test_too_much_is_refused_with_the_remedy(monkeypatch):
    monkeypatch.setattr(bifurcation_view, "MAX_MOTION_S", 1.0)
    page = at_bifurcation()
    button(page, "Draw").click().run()
    assert "of motion" in page.error[0].value
    assert "command line" in page.error[0].value


def test_a_range_must_ascend():
    page = at_bifurcation()
    number(page, "From").set_value(9000.0).run()
    assert "the range goes from" in page.error[0].value
