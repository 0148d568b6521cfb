"""The fleet's page, run without a browser on a small store."""

from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard.fleet import STORE, example_store
from gearsig.fleet import TrendSettings, open_fleet
from tests.app.pages import at, figures, labelled, numbers, on, press, shown_text
from tests.fleet.conftest import make_recordings  # noqa: F401 - a fixture
from tests.fleet.recordings import PATTERN


def opened(folder: Path) -> AppTest:
    return on("fleet", **{STORE: str(folder)})


@pytest.mark.slow
def test_the_worst_is_first_its_trend_has_limits_and_its_recording_opens(make_recordings, tmp_path):  # noqa: F811
    make_recordings("calm", [1.0])
    data = make_recordings("loud [1]", [1.0] * 7 + [9.0] * 2)
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.set(TrendSettings(n_baseline=7))
    fleet.add(data, pattern=PATTERN, n_processes=1)
    page = opened(tmp_path / "store")
    assert not page.exception
    assert not page.error
    assert "2 machines, 2 measuring points" in shown_text(page)
    assert "loud" in next(button.label for button in page.button if button.key.startswith("point "))
    assert "loud [1] · DE" in shown_text(page)
    names = labelled(page, "selectbox", "Indicator")
    names.set_value(next(i for i, words in enumerate(names.options) if ": rms " in words)).run()
    sent = figures(page)[0]
    assert sent["dates"]
    curves = {line["name"]: line for line in sent["lines"]}
    assert len(numbers(curves["rms"]["y"])) == 9
    assert numbers(curves["rms"]["x"])[-1] == 20462.0  # 9 January 2026
    limit = numbers(curves["expected, within its limits"]["high"])[-1]
    assert numbers(curves["rms"]["y"])[-1] > limit > numbers(curves["rms"]["y"])[0]
    assert [at for at, _ in sent["marked"]] == [20461.0, 20462.0]
    labelled(page, "button", "Open its analysis").click().run()
    assert not page.exception
    assert "DE_20260109.csv" in shown_text(page)


@pytest.mark.slow
def test_an_indicator_over_load_in_the_limits_that_follow_it(make_recordings, tmp_path):  # noqa: F811
    loads = [20.0, 40.0, 60.0, 80.0, 100.0, 30.0, 50.0, 70.0, 90.0]
    data = make_recordings("mill", [load / 50 for load in loads[:8]] + [20.0])
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.set(TrendSettings(n_baseline=8))
    for path, load in zip(sorted((data / "mill").iterdir()), loads, strict=True):
        fleet.add(path, pattern=PATTERN, torque_nm=load, n_processes=1)
    page = at("fleet", {"over": "load", "indicator": "rms (a1, raw)"}, **{STORE: str(tmp_path / "store")})
    assert not page.exception
    sent = figures(page)[0]
    curves = {line["name"]: line for line in sent["lines"]}
    assert numbers(curves["rms"]["x"]) == [90.0]
    assert [x for x, _ in sent["marked"]] == [90.0]
    assert sorted(numbers(curves["baseline"]["x"])) == sorted(loads[:8])
    high = numbers(curves["expected, within its limits"]["high"])
    assert high[-1] / high[0] > 4.0
    assert "dependence on load" in shown_text(page)


def test_an_empty_store_says_how_to_fill_it(tmp_path):
    page = opened(tmp_path / "nothing")
    assert not page.exception
    assert not page.error
    assert "gearsig fleet add" in shown_text(page)
    open_fleet(tmp_path / "empty", create=True)
    assert "gearsig fleet add" in shown_text(opened(tmp_path / "empty"))


@pytest.mark.slow
def test_an_empty_page_shows_an_example_whose_damaged_machines_are_alarms(tmp_path):
    page = opened(tmp_path / "nothing")
    press(page, "See an example")
    assert "3 machines, 3 measuring points" in shown_text(page)
    assert "alarm" in {level for name in ("Mixer 1", "Mixer 2") for level in _levels(name)}
    assert _levels("Mixer 3") == ["ok"]
    assert not (tmp_path / "nothing").exists()
    press(page, "Close the example")
    assert "gearsig fleet add" in shown_text(page)


@pytest.mark.slow
def test_a_link_to_the_example_shows_it_in_another_session(tmp_path):
    folder = {STORE: str(tmp_path / "nothing")}
    page = press(at("fleet", {}, **folder), "See an example")
    sent = at("fleet", page.query_params, **folder)
    assert "3 machines, 3 measuring points" in shown_text(sent)
    assert sent.query_params == page.query_params
    labelled(sent, "text_input", "Folder").set_value(str(tmp_path)).run()
    assert "gearsig fleet add" in shown_text(sent)
    assert "store" not in sent.query_params


def test_a_link_opens_no_folder_of_this_machine(make_recordings, tmp_path):  # noqa: F811
    data = make_recordings("calm", [1.0])
    open_fleet(tmp_path / "store", create=True).add(data, pattern=PATTERN, n_processes=1)
    assert "calm" not in shown_text(at("fleet", {"store": str(tmp_path / "store")}))


def _levels(machine: str) -> list[str]:
    status = open_fleet(example_store()).status()
    return list(status.loc[status["machine"] == machine, "level"])
