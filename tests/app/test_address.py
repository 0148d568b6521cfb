"""What is chosen on a page stands in its address: sent, it restores the view; nonsense in it is ignored."""

from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from streamlit.testing.v1 import AppTest

from app.dashboard import address, state
from app.dashboard.analysis import OF_CHANNEL
from app.dashboard.fleet import STORE
from app.dashboard.state import AnalysisRequest, Chosen
from gearsig.fleet import open_fleet
from gearsig.methods import METHODS
from tests.app.pages import SAMPLES, at, choose, figures, go, key_of, labelled, press, shown_text, turned_to
from tests.fleet.conftest import make_recordings  # noqa: F401 - a fixture
from tests.fleet.recordings import PATTERN
from tests.marks import further

PAGE = {"sample", "described", "file", "view", "zoom", "reference", "reference_file", "torque"}
"""What stands in the address of the analysis page in every view."""


def analysis(sample: str = "two_stage", **query: Any) -> AppTest:
    return at("analysis", {"sample": sample, **query})


def choices(page: AppTest) -> dict[str, Any]:
    """Return what a view keeps in the address."""
    return {name: value for name, value in page.query_params.items() if name not in PAGE}


def pills(page: AppTest, label: str) -> Any:
    return next(w for w in page.get("button_group") if w.label == label)


@pytest.mark.slow
def test_a_view_that_is_sent_opens_with_its_channel_scale_and_cursors() -> None:
    page = analysis(view="Spectrum")
    assert choices(page) == {}  # nothing differs from what everybody begins with
    names = labelled(page, "selectbox", "Channel").options
    other = next(name for name in names if name != labelled(page, "selectbox", "Channel").value)
    labelled(page, "selectbox", "Channel").set_value(other).run()
    choose(page, "Amplitude", "dB")
    pills(page, "Cursors").set_value(["mesh", "shaft"]).run()
    assert choices(page) == {"channel": other, "amplitude": "dB", "cursors": ["mesh", "shaft"]}
    sent = analysis(**page.query_params)
    assert labelled(sent, "selectbox", "Channel").value == other
    assert pills(sent, "Amplitude").value == "dB"
    assert pills(sent, "Cursors").value == ["mesh", "shaft"]
    assert [figure["y"] for figure in figures(sent)] == [figure["y"] for figure in figures(page)]
    assert choices(sent) == choices(page)
    pills(sent, "Cursors").set_value([]).run()
    assert choices(sent)["cursors"] == ""
    assert pills(analysis(**sent.query_params), "Cursors").value == []
    choose(sent, "Amplitude", "Logarithmic")
    assert "amplitude" not in sent.query_params


def test_a_method_that_is_sent_opens_with_its_options_and_segment() -> None:
    page = go(analysis("damaged_tooth", view="Envelope"), "Kurtogram")
    assert choices(page) == {"show": "Kurtogram"}
    choose(page, "Signal", "tones removed")
    labelled(page, "number_input", "Levels").set_value(3).run()
    labelled(page, "slider", "Segment").set_value((0.5, 1.5)).run()
    assert choices(page) == {"show": "Kurtogram", "preparation": "tones removed", "levels": "3", "segment": "0.5_1.5"}
    sent = analysis(**page.query_params)
    assert labelled(sent, "number_input", "Levels").value == 3
    assert labelled(sent, "slider", "Segment").value == (0.5, 1.5)
    assert choices(sent) == choices(page)
    assert "Analysed: 0.5 to 1.5 s" in shown_text(sent)
    go(sent, "Cyclic coherence")  # which has a preparation, too
    assert choices(sent) == {"show": "Cyclic coherence"}


@pytest.mark.parametrize(
    ("view", "asked"),
    [
        ("Map", {"lines": "Frequency", "along": "Speed"}),
        ("Waveform", {"channels": "a1"}),
        ("Indicators", {"contains": "rms", "channel": "a1"}),
        ("Order spectrum", {"amplitude": "Linear"}),
        ("Average", {"signal": "average"}),
        ("Average", {"show": "Crack severity"}),
        ("Map", {"show": "Orders (Vold–Kalman)", "orders": ["29", "0.42"], "poles": "1", "shown": "1_2"}),
        ("Time–frequency", {"show": "Time–frequency", "over_angle": "1", "colours": "80"}),
        ("Phase", {"show": "Lyapunov exponent", "method": "kantz", "fit_s": "0.001, 0.004"}),
    ],
)
def test_what_an_address_asks_for_is_shown_and_stays_in_it(view: str, asked: dict[str, Any]) -> None:
    page = analysis("run_up", view=view, **asked)
    assert not page.error, shown_text(page)
    first = next(iter(OF_CHANNEL.get(view, ())), "")  # which is not named
    assert choices(page) == {name: text for name, text in asked.items() if text != first}


NONSENSE = ("nonsense", "", "-1", "1e400", "nan", "0_inf", "1_2_3", "9" * 500, "<script>alert(1)</script>", "\0", "٣")
NAMES = {o.name for m in METHODS.values() for o in m.options} | {
    *("channel", "channels", "show", "segment", "shown", "waveform", "colours", "amplitude", "cursors", "shaft"),
    *(
        "signal",
        "gear",
        "lines",
        "along",
        "of",
        "one_channel",
        "zoom",
        "reference",
        "torque",
    ),
}


@pytest.mark.parametrize("text", NONSENSE)
def test_nonsense_in_an_address_is_ignored_and_taken_out(text: str) -> None:
    usual = analysis(view="Order spectrum")
    page = analysis(view="Order spectrum", **dict.fromkeys(NAMES - {"cursors"}, text), other=text)
    assert not page.error
    assert page.query_params == usual.query_params
    assert figures(page) == figures(usual)


@pytest.mark.slow
@pytest.mark.parametrize(
    "method", ["Kurtogram", further("Orders (Vold–Kalman)"), "Ridges", further("Modes"), further("Lyapunov exponent")]
)
def test_nonsense_among_the_options_of_a_method_is_ignored(method: str) -> None:
    usual = go(analysis("healthy"), method)
    asked = {name: usual.query_params[name] for name in ("view", "show") if name in usual.query_params}
    for text in ("nonsense", "-1", "9" * 500):
        page = analysis("healthy", **dict.fromkeys(NAMES, text) | {"show": method} | asked)
        assert page.query_params == usual.query_params
        assert shown_text(page) == shown_text(usual)


def test_another_view_and_another_recording_begin_with_their_own_defaults() -> None:
    page = analysis(view="Spectrum", amplitude="dB", cursors="mesh")
    channel = labelled(page, "selectbox", "Channel")
    other = next(name for name in channel.options if name != channel.value)
    channel.set_value(other).run()
    page.session_state[state.TAB] = "Envelope"
    page.run()
    assert choices(page) == {"channel": other}  # the channel is of both views
    assert pills(page, "Amplitude").value == "Linear"
    page.sidebar.selectbox(key=state.SAMPLE).set_value(SAMPLES["healthy"]).run()
    assert choices(page) == {}
    assert page.query_params["sample"] == "healthy"


def test_what_belongs_to_a_recording_that_is_not_there_is_not_taken_for_another() -> None:
    asked = {"view": "Spectrum", "amplitude": "dB", "torque": "3", "reference": "None"}
    for query in ({"sample": "nonsense"}, {"file": "x" * 22}, {"sample": "two_stage", "file": "nonsense"}):
        page = at("analysis", {**asked, **query})
        usual = at("analysis", {"sample": page.query_params["sample"]})
        assert page.query_params == usual.query_params
        assert figures(page) == figures(usual)


def test_the_zoom_of_a_view_leaves_the_address_with_it() -> None:
    page = analysis("healthy", view="Spectrum")
    page.session_state[state.ZOOMS] = {key_of("spectrum of a1 chart", "healthy"): [100.0, 200.0]}
    page.run()
    assert page.query_params["zoom"].endswith("_100_200")
    sent = analysis(**page.query_params)
    assert figures(sent)[0]["shown"] == [100.0, 200.0]
    assert sent.query_params == page.query_params
    sent.session_state[state.TAB] = "Envelope"
    sent.run()
    assert "zoom" not in sent.query_params


def opens(page: AppTest, script: str, query: dict[str, Any] | None = None) -> AppTest:
    """Go to a page of the same session: by a link, whose address is empty, or with the address of Back."""
    page.query_params.clear()
    page.query_params.update(query or {})
    turned_to(page, script)
    assert not page.exception
    return page


@pytest.mark.slow
def test_scale_and_zoom_of_a_view_outlast_another_page() -> None:
    page = analysis("healthy", view="Spectrum")
    choose(page, "Amplitude", "dB")
    page.session_state[state.ZOOMS] = {key_of("spectrum of a1 chart", "healthy"): [100.0, 200.0]}
    page.run()
    left = dict(page.query_params)
    opens(page, "compare")
    assert "amplitude" not in page.query_params or page.query_params["amplitude"] != "dB"
    opens(page, "analysis")
    assert pills(page, "Amplitude").value == "dB"
    assert figures(page)[0]["shown"] == [100.0, 200.0]
    assert page.query_params == left


def test_back_restores_view_channel_scale_zoom_and_recording(monkeypatch: pytest.MonkeyPatch) -> None:
    page = analysis(view="Spectrum")
    first = dict(page.query_params)
    channel = labelled(page, "selectbox", "Channel")
    before = channel.value
    channel.set_value(next(name for name in channel.options if name != before)).run()
    choose(page, "Amplitude", "dB")
    page.session_state[state.ZOOMS] = {key_of(f"spectrum of {channel.value} chart", "two_stage"): [100.0, 200.0]}
    page.run()
    second = dict(page.query_params)
    page.session_state[state.TAB] = "Envelope"
    page.run()
    page.sidebar.selectbox(key=state.SAMPLE).set_value(SAMPLES["healthy"]).run()
    third = dict(page.query_params)

    def go_to(query: dict[str, Any]) -> None:
        with monkeypatch.context() as patch:
            patch.setattr(address, "is_history", lambda: True)
            opens(page, "analysis", query)
        assert page.query_params == query

    go_to(second)
    assert page.sidebar.selectbox(key=state.SAMPLE).value == SAMPLES["two_stage"]
    assert labelled(page, "selectbox", "Channel").value != before
    assert pills(page, "Amplitude").value == "dB"
    assert figures(page)[0]["shown"] == [100.0, 200.0]
    go_to(first)
    assert labelled(page, "selectbox", "Channel").value == before
    assert pills(page, "Amplitude").value == "Logarithmic"
    go_to(third)
    assert page.session_state[state.TAB] == "Envelope"
    page.sidebar.selectbox(key=state.SAMPLE).set_value(SAMPLES["two_stage"]).run()
    assert page.query_params["sample"] == "two_stage"  # what is chosen afterwards is the user's again


def test_all_that_a_run_changes_is_one_step_of_back(monkeypatch: pytest.MonkeyPatch) -> None:
    from streamlit.runtime.state.query_params import QueryParams

    sent: list[None] = []
    send = QueryParams._send_query_param_msg
    page = analysis(view="Spectrum", amplitude="dB", cursors="mesh", torque="3")
    monkeypatch.setattr(QueryParams, "_send_query_param_msg", lambda params: sent.append(send(params)))
    page.session_state[state.TAB] = "Envelope"
    page.run()
    assert choices(page) == {}
    assert len(sent) == 1


@pytest.mark.slow
def test_the_described_machine_of_a_sample_survives_a_reload() -> None:
    page = analysis("damaged_tooth", view="Machine")
    labelled(page, "text_input", "Machine").set_value("Mill 3").run()
    press(page, "Analyse with this machine")
    assert "Mill 3" in shown_text(page)
    sent = analysis(**page.query_params)
    assert "Mill 3" in shown_text(sent)
    assert sent.query_params == page.query_params
    assert "Mill 3" not in shown_text(analysis(sample="two_stage", described=page.query_params["described"]))


def test_the_described_machine_of_a_laboratorys_recording_survives_a_reload() -> None:
    sample = SAMPLES["healthy"]
    request = AnalysisRequest("made.h5", "0", "made.toml", sample.rig.read_text("utf-8"))
    made = Chosen(request, memoryview(sample.recording.read_bytes()))
    page = at("analysis", {"view": "Machine"}, **{"simulated": made, state.ORIGIN: state.OF_LABORATORY})
    labelled(page, "text_input", "Machine").set_value("Mill 4").run()
    press(page, "Analyse with this machine")
    sent = at("analysis", page.query_params)
    assert "made.h5" in shown_text(sent)
    assert "Mill 4" in shown_text(sent)


def test_an_own_healthy_reference_survives_a_reload() -> None:
    page = analysis("damaged_tooth", view="Spectrum", reference="Your file")
    healthy = SAMPLES["healthy"].recording
    labelled(page, "file_uploader", "Recording of the healthy").upload("mine.h5", healthy.read_bytes())
    page.run()
    assert "Changed since the reference" in shown_text(page)
    sent = analysis(**page.query_params)
    assert "mine.h5" in shown_text(sent)
    assert "Changed since the reference" in shown_text(sent)
    assert sent.query_params == page.query_params


def test_no_option_of_a_method_is_called_as_another_choice_beside_it() -> None:
    beside = PAGE | {"channel", "show", "segment", "shown", "waveform", "colours"}
    assert not beside & {option.name for method in METHODS.values() if method.view for option in method.options}


@pytest.mark.slow
def test_the_indicator_of_a_fleet_is_named_and_restored(make_recordings, tmp_path):  # noqa: F811
    make_recordings("calm", [1.0])
    data = make_recordings("loud", [1.0] * 3)
    open_fleet(tmp_path / "store", create=True).add(data, pattern=PATTERN, n_processes=1)
    folder = {STORE: str(tmp_path / "store")}
    page = at("fleet", {"machine": "calm", "point": "nonsense", "indicator": "nonsense", "search": "a"}, **folder)
    assert page.query_params["machine"] == "calm"
    assert page.query_params["point"] == "DE"
    assert page.query_params["search"] == "a"
    names = labelled(page, "selectbox", "Indicator")
    names.set_value(len(names.options) - 1).run()
    chosen = page.query_params["indicator"]
    assert names.options[-1].endswith(chosen)
    sent = at("fleet", page.query_params, **folder)
    assert labelled(sent, "selectbox", "Indicator").value == len(names.options) - 1
    labelled(sent, "text_input", "Machine").set_value("").run()
    next(b for b in sent.button if b.key == "point 'loud' 'DE'").click().run()
    assert sent.query_params["machine"] == "loud"
    assert sent.query_params["indicator"] != chosen


def test_a_comparison_is_restored() -> None:
    asked = {"sample": "root_crack_3mm", "simulation": "Sample", "simulated": "root_crack_0mm", "view": "Bands"}
    page = at("compare", {**asked, "align": "marks", "view": "Bands", "channel": "nonsense", "seed": "-4"})
    assert not page.error, shown_text(page)
    assert "root_crack_0mm.h5 beside root_crack_3mm.h5" in shown_text(page)
    assert page.session_state["comparison tab"] == "Bands"
    assert page.query_params == {**asked, "align": "marks"}


@pytest.mark.slow
def test_the_choices_of_the_laboratory_are_restored() -> None:
    asked = {"machine": "small_30_25", "root_crack": "1.5", "root_crack-gear": "driven", "length": "0.5"}
    asked |= {"view": "Time", "signal": "mesh force", "shown": "all", "friction": "0", "seed": "7"}
    page = at("laboratory", {**asked, "rate": "1", "roughness_um-of-large": "2", "mains_hum": "3"})
    assert not page.error, shown_text(page)
    assert labelled(page, "selectbox", "Signal").value == "mesh force"
    assert page.query_params == asked


@given(st.lists(st.text(), min_size=1))
def test_no_text_of_an_address_breaks_a_reader(texts: list[str]) -> None:
    readers = (
        address.one_of(["a", None, 2.5, False]),
        address.some_of(["a", "b"], maximum=1),
        address.number(0.0, 5.0),
        address.number(whole=True),
        address.span(0.0, 5.0),
        address.words,
    )
    for read in readers:
        try:
            value = read(texts)
        except (ValueError, KeyError, IndexError):
            continue
        assert value in (*["a", None, 2.5, False], ["a"], ["b"], [], texts[0]) or isinstance(value, int | float | tuple)


@given(st.floats(0.0, 5.0), st.integers(-(2**52), 2**52))
def test_numbers_come_back_as_they_were(number: float, count: int) -> None:
    assert address.number(0.0, 5.0)([address.text_of(number)]) == pytest.approx(number, rel=1e-11)
    assert address.number(whole=True)([address.text_of(count)]) == count
