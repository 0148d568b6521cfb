"""The dashboard's pages, run without a browser."""

import re

import numpy as np
import pytest

from app.dashboard import state
from app.dashboard.widgets.views import OF_CHANNEL, OF_RECORDING
from tests.app.pages import METHODS_TAB, SAMPLES, charts, numbers, opened, opened_file, shown_text, upload

TABS = (*OF_RECORDING, *OF_CHANNEL, "Indicators", "Report")


def test_a_sample_is_open_at_the_start() -> None:
    page = opened()
    assert not page.exception
    assert "tooth" in page.subheader[0].value
    assert page.subheader[0].value.startswith("Fault")
    assert [tab.label for tab in page.tabs] == list(TABS)


@pytest.mark.parametrize("name", sorted(SAMPLES))
def test_every_sample_opens_in_every_view(name: str) -> None:
    page = opened(name)
    for tab in (tab for tab in TABS if tab != METHODS_TAB):
        page.session_state[state.TAB] = tab
        page.run()
        assert not page.exception, (name, tab)
        assert not page.error, (name, tab)
    assert SAMPLES[name].recording.name in shown_text(page)


def test_views_draw_what_they_promise() -> None:
    page = opened()
    drawn = {}
    for tab in TABS:
        page.session_state[state.TAB] = tab
        page.run()
        drawn[tab] = (len(page.get("plotly_chart")), len(page.get("image")), len(page.dataframe))
    assert drawn["Channels"] == (2, 0, 1)
    assert drawn["Speed"] == drawn["Spectrum"] == drawn["Order spectrum"] == drawn["Envelope"] == (1, 0, 0)
    assert drawn["Synchronous average"] == (1, 1, 0)
    assert drawn["Indicators"] == (0, 0, 1)


def test_a_map_shows_along_a_run_up() -> None:
    page = opened("run_up", tab="Order map")
    assert len(page.get("image")) == 1


def test_an_upload_and_its_rig_give_the_diagnosis_of_the_same_files_on_disk() -> None:
    sample = SAMPLES["damaged_tooth"]
    page = opened()
    verdict = page.subheader[0].value
    page = upload(page, sample.recording.name, sample.recording.read_bytes(), sample.rig.read_text())
    assert not page.exception
    assert page.subheader[0].value == verdict


def test_the_rig_can_be_changed_on_the_page() -> None:
    page = opened()
    text = page.sidebar.text_area[0]
    text.set_value(text.value.replace("driver_teeth = 29", "driver_teeth = -29")).run()
    assert not page.exception
    assert "driver teeth of pair 'stage 1'" in shown_text(page)
    assert "at least 3" in shown_text(page)


def test_a_sampling_rate_that_is_missing_is_asked_for_and_taken() -> None:
    lines = "\n".join(str((i * 37) % 101 - 50) for i in range(4000))
    page = upload(opened(), "bare.csv", f"a1\n{lines}\n".encode())
    assert len(page.error) == 1
    assert "sampling rate" in shown_text(page)
    page.sidebar.number_input[0].set_value(1000.0).run()
    assert not page.error
    assert "4 s at 1000 Hz" in shown_text(page)


@pytest.mark.parametrize("rate", [0.0, -1.0])
def test_an_impossible_sampling_rate_is_one_message(rate: float) -> None:
    page = opened()
    page.sidebar.number_input[0].set_value(rate).run()
    assert not page.exception
    assert len(page.error) == 1


@pytest.mark.parametrize(
    ("name", "content", "rig"),
    [
        ("empty.csv", b"", ""),
        ("zeros.mat", bytes(4096), ""),
        ("pickle.mat", b"\x80\x04\x95\x10\x00\x00\x00", ""),
        ("torn.h5", b"\x89HDF\r\n\x1a\n" + b"\xff" * 64, ""),
        ("short.csv", b"a1\n1\n2\n", ""),
        ("good.csv", b"a1\n1\n2\n", "[[shaft]\n"),
        ("good.csv", b"a1\n1\n2\n", "[[pear]]\n"),
    ],
)
def test_broken_files_show_one_message(name: str, content: bytes, rig: str) -> None:
    page = upload(opened(), name, content, rig)
    assert not page.exception
    assert len(page.error) == 1
    assert not page.tabs


def test_nothing_is_open_before_a_file_is_given() -> None:
    page = opened()
    page.sidebar.radio(key=state.ORIGIN).set_value("Own file").run()
    assert not page.exception
    assert not page.tabs
    assert "Open a recording" in shown_text(page)


def test_no_long_signal_goes_to_the_browser_whole() -> None:
    """A million samples: the page carries thousands; a window shows its own samples again."""
    from io import BytesIO

    from scipy.io import savemat

    x = np.random.default_rng(0).standard_normal(1_000_000).astype(np.float32)
    x[123_456] = 99.0
    file = BytesIO()
    savemat(file, {"a1": x, "fs": 10_000.0})
    page = opened_file("long.mat", file.getvalue(), tab="Channels")
    assert not page.exception
    spec = page.get("plotly_chart")[0].proto.spec
    assert len(spec) < 200_000
    assert numbers(charts(page)[0]["data"][0]["y"]).max() == pytest.approx(99.0)
    slider = next(s for s in page.slider if s.label.startswith("Time"))
    slider.set_value((12.3, 12.4)).run()
    near = numbers(charts(page)[0]["data"][0]["y"])
    assert len(near) == pytest.approx(1000, abs=5)
    assert near.max() == pytest.approx(99.0)


def test_names_from_files_are_shown_as_typed() -> None:
    """Markup in channel, shaft and file names stays text, in every view."""
    names = ("<script>alert(1)</script>", "**x** $y$ :material/delete: :smile: a->b")
    rows = "\n".join(f"{i / 1000};{(i * 37) % 101};{(i * 53) % 97}" for i in range(3000))
    rig = '[[shaft]]\nname = "<img src=x onerror=alert(1)>"\n[speed]\nsource = "constant"\nspeed_rpm = 1200\n'
    page = opened_file("[a](http://x.y) **b**.csv", f"time (s);{names[0]};{names[1]}\n{rows}\n".encode(), rig)
    for tab in TABS:
        page.session_state[state.TAB] = tab
        page.run()
        assert not page.exception, tab
        raw = "\n".join(part.value for part in [*page.markdown, *page.subheader, *page.caption, *page.info])
        for markup in ("<script", "<img", "**x**", "$y$", ":material/delete:", ":red[", "[a](", "http:"):
            assert not re.search(r"(?<!\\)" + re.escape(markup), raw), (tab, markup)
        for chart in page.get("plotly_chart"):
            assert "<script" not in chart.proto.spec
            assert "<img" not in chart.proto.spec
    page.session_state[state.TAB] = "Channels"
    page.run()
    for name in names:
        assert name in shown_text(page)


def test_a_reference_changes_verdict_and_indicators_as_on_the_command_line() -> None:
    from app.dashboard.cached import read_and_analyze
    from app.dashboard.state import AnalysisRequest
    from app.dashboard.widgets.verdict import headline_of

    page = opened("root_crack_1mm", tab="Indicators")
    assert "reference" not in page.dataframe[0].value.columns
    next(w for w in page.sidebar.selectbox if w.label == "Compared with").set_value("Root crack 0mm").run()
    assert not page.exception
    assert not page.error, shown_text(page)
    assert "Compared with root_crack_0mm.h5" in shown_text(page)
    table = page.dataframe[0].value
    rms = table[table["indicator"] == "rms"]
    assert len(rms)
    np.testing.assert_allclose(rms["change (dB)"], 20.0 * np.log10(rms["value"] / rms["reference"]), atol=1e-6)
    sample, healthy = SAMPLES["root_crack_1mm"], SAMPLES["root_crack_0mm"]
    request = AnalysisRequest("now.h5", "1", sample.rig.name, sample.rig.read_text(), reference_name="healthy.h5")
    same = read_and_analyze(
        request, memoryview(sample.recording.read_bytes()), memoryview(healthy.recording.read_bytes())
    )
    assert headline_of(same.verdict)[0] in shown_text(page)


def test_an_uploaded_reference_that_does_not_fit_is_one_message() -> None:
    page = opened()
    next(w for w in page.sidebar.selectbox if w.label == "Compared with").set_value("Own file").run()
    assert not page.error
    healthy = page.sidebar.file_uploader[0]
    healthy.upload("other.csv", b"time (s);b\n" + b"\n".join(b"%g;%d" % (i / 1000, i * 37 % 101) for i in range(3000)))
    page.run()
    assert not page.exception
    assert len(page.error) == 1
    assert "the reference has no channel" in shown_text(page)
