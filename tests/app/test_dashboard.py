"""The dashboard's pages, run without a browser."""

import ast
import errno
import json
import re
import tomllib
from base64 import b64decode
from pathlib import Path

import numpy as np
import pytest
from streamlit.dataframe_util import convert_arrow_bytes_to_pandas_df
from streamlit.testing.v1 import AppTest

from app.dashboard import compiled, state
from app.dashboard.analysis import VIEWS
from app.dashboard.cached import command_of
from app.dashboard.state import ChosenFile
from app.dashboard.widgets.texts import PAGE_TEXTS, in_page_text
from gearsig.recording import write_recording
from gearsig.rig import write_rig
from sims import simulate
from tests.app.pages import (
    SAMPLES,
    at,
    choose,
    figures,
    key_of,
    labelled,
    machine,
    numbers,
    opened,
    opened_file,
    pictures,
    press,
    sent_to,
    shown_text,
    upload,
)
from tests.marks import further

SLOW = ("Modes", "Phase", "Time–frequency")
"""Views that compute: they have tests of their own."""
OF_EACH_KIND = ("damaged_tooth", "no_tachometer", "outer_race", "run_up", "two_stage")
"""Samples that differ in what can be shown; the others are like one of them."""


def test_a_sample_is_open_at_the_start() -> None:
    page = opened()
    assert not page.exception
    assert "tooth" in page.subheader[0].value
    assert page.subheader[0].value.startswith("Fault")


def test_what_the_start_page_offers_first_is_compiled_first(monkeypatch) -> None:
    done = []
    monkeypatch.setattr("gearsig.diagnosis.analyze_file", lambda path, *_, **__: done.append(path.name))
    monkeypatch.setattr(compiled, "run_every_model", lambda: done.append("models"))
    compiled.compile_all()
    assert done == [SAMPLES["damaged_tooth"].recording.name, "models"]


def test_code_that_cannot_be_compiled_ahead_is_one_line(monkeypatch) -> None:
    monkeypatch.setattr("signal.signal", lambda *_: None)  # this process keeps its own
    monkeypatch.setattr(compiled, "compile_all", lambda: 1 / 0)
    with pytest.raises(SystemExit, match=r"compiled ahead.*ZeroDivisionError") as caught:
        compiled._compile_or_say()
    assert "\n" not in str(caught.value)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name if name in OF_EACH_KIND else further(name) for name in sorted(SAMPLES)])
def test_every_sample_opens_in_every_view(name: str) -> None:
    page = opened(name)
    assert not page.exception
    as_another = name.startswith("root_crack") and name != "root_crack_3mm"  # the same machine and sensors
    for tab in (tab for tab in VIEWS if tab not in SLOW and not as_another):
        page.session_state[state.TAB] = tab
        page.run()
        assert not page.exception, (name, tab)
        assert not page.error, (name, tab)
    assert SAMPLES[name].recording.name in shown_text(page)


@pytest.mark.slow
def test_views_draw_what_they_promise() -> None:
    page = opened()
    drawn = {}
    for tab in VIEWS:
        page.session_state[state.TAB] = tab
        page.run()
        drawn[tab] = (len(figures(page)), len(pictures(page)), len(page.dataframe))
    assert drawn["Waveform"] == (2, 0, 1)
    assert drawn["Speed"] == drawn["Spectrum"] == drawn["Order spectrum"] == drawn["Envelope"] == (1, 0, 0)
    assert drawn["Map"] == (1, 0, 0)
    assert drawn["Average"] == (1, 0, 0)  # its ring stands beside the verdict
    assert drawn["Machine"] == (0, 0, 5)
    page.session_state[state.TAB] = "Machine"
    page.run()
    assert len(page.get("image")) == 1  # the train
    assert drawn["Indicators"] == (0, 0, 1)


def test_a_map_shows_along_a_run_up_over_time_and_over_speed() -> None:
    page = opened("run_up", tab="Map")
    over_time = figures(page)[0]
    assert over_time["y"] == "time (s)"
    assert over_time["map"]["columns"] * over_time["map"]["rows"] == len(b64decode(over_time["map"]["levels"]))
    for label, value in (("Lines over", "Frequency"), ("Along", "Speed")):
        page = choose(page, label, value)
    campbell = figures(page)[0]
    assert campbell["y"] == "speed (rpm)"
    low, high = campbell["map"]["limits"]
    assert 550 < low < 700
    assert 2900 < high < 3050
    for ray in campbell["lines"]:  # the mesh of 29 teeth and its harmonics: f = k 29 n/60
        order = 60 * numbers(ray["x"]) / numbers(ray["y"])
        assert np.allclose(order / 29, np.round(order[0] / 29))


def test_an_upload_and_its_rig_give_the_diagnosis_of_the_same_files_on_disk() -> None:
    sample = SAMPLES["outer_race"]
    page = opened("outer_race")
    verdict = page.subheader[0].value
    # As loggers name files: the name has no ending, the first bytes tell.
    page = upload(page, "2003.10.22.12.06.24", sample.recording.read_bytes(), sample.rig.read_text())
    assert not page.exception
    assert page.subheader[0].value == verdict


def test_a_disk_without_room_for_an_upload_is_said(monkeypatch) -> None:
    def write(*_: object, **__: object) -> int:
        raise OSError(errno.ENOSPC, "No space left on device")

    page = opened()
    content = SAMPLES["outer_race"].recording.read_bytes()
    with monkeypatch.context() as full:
        full.setattr(Path, "write_bytes", write)
        page = upload(page, "new.mat", content)
        assert not page.exception
        assert "No space left on device" in page.error[0].value
    page.run()
    assert not page.error


@pytest.mark.slow
def test_the_machine_can_be_changed_as_text_and_a_wrong_one_is_mended() -> None:
    page = opened(tab="Machine")
    before = page.text_area[0].value
    page.text_area[0].set_value(before.replace("driver_teeth = 29", "driver_teeth = -29")).run()
    press(page, "Use this text")
    assert len(page.error) >= 1
    assert "driver teeth of pair 'stage 1'" in shown_text(page)
    assert "a whole number from 3" in shown_text(page)
    page.text_area[0].set_value(before.replace("driver_teeth = 29", "driver_teeth = 31")).run()
    press(page, "Use this text")
    assert not page.error
    page.session_state[state.TAB] = "Machine"
    orders = next(table.value for table in page.run().dataframe if "order of input" in table.value)
    assert 31.0 in set(orders["order of input"])


@pytest.mark.slow
def test_the_form_of_the_machine_makes_the_rig_of_its_file() -> None:
    """Opened and left alone, the form changes nothing; a constant speed replaces the tachometer."""
    page = opened(tab="Machine")
    assert not [b for b in page.button if b.label.startswith("Analyse")]
    next(w for w in page.main.selectbox if w.label == "Speed from").set_value("constant").run()
    press(page, "Analyse with this machine")
    labelled(page, "number_input", "Constant speed (rpm)").set_value(1497.0).run()
    assert not page.error
    page.session_state[state.TAB] = "Speed"
    assert "from tachometer pulses" not in shown_text(page.run())


WHOLE_RIG = """
name = ""
sources = ["nameplate"]
assumed = ["teeth"]
sampling_rate_hz = 12800
[[shaft]]
name = "input"
[[shaft]]
name = "output"
direction = "cw"
[[pair]]
name = "stage 1"
driver = "input"
driven = "output"
driver_teeth = 29
driven_teeth = 47
pressure_angle_deg = 20
[[bearing]]
name = "by name"
shaft = "input"
bearing = "SKF 6205-2RS/C3"
[[bearing]]
name = "by geometry"
shaft = "output"
n_rolling_elements = 12
rolling_element_diameter_mm = 9.5
pitch_diameter_mm = 52
contact_angle_deg = 40
[[bearing]]
name = "by orders"
shaft = "output"
bpfo_order = 5.2
bpfi_order = 7.8
[[sensor]]
channel = "a1"
quantity = "acceleration"
unit = "m/s^2"
scale = 9.81
offset = -0.5
wraps = false
[operating_point]
shaft = "output"
speed_rpm = 1480
speed_tolerance_percent = 2
torque_nm = -50
[machine]
power_kw = 55
mounting = "flexible"
[contact]
pair = "stage 1"
half_backlash_um = 100
[speed]
source = "tachometer"
channel = "tacho"
threshold = 2.5
edge = "falling"
"""


@pytest.mark.slow
def test_a_rig_file_survives_the_form() -> None:
    """One field is changed: all others stay, those too that the form does not show."""
    content = SAMPLES["damaged_tooth"].recording.read_bytes()
    page = opened_file("a.csv.gz", content, WHOLE_RIG, tab="Machine")
    assert not [b for b in page.button if b.label.startswith("Analyse")]
    labelled(page, "number_input", "Rated power (kW)").set_value(75.0).run()
    text = page.text_area[0].value
    assert tomllib.loads(text) == tomllib.loads(WHOLE_RIG.replace("power_kw = 55", "power_kw = 75"))
    assert "speed_rpm = 1480\n" in text


def test_a_machine_is_described_by_the_form_alone() -> None:
    """Without a tachometer: nominal speed with its tolerance; for the zones of ISO 20816-3: power and mounting."""
    page = opened_file("a.csv.gz", SAMPLES["damaged_tooth"].recording.read_bytes(), tab="Machine")
    labelled(page, "selectbox", "Mounting").set_value("rigid")
    for label, value in (("Rated power", 22.0), ("Speed tolerance", 4.0), ("Speed (rpm)", 1490.0)):
        labelled(page, "number_input", label).set_value(value)
    page.run()
    assert not page.exception
    assert tomllib.loads(page.text_area[0].value) == {
        "operating_point": {"speed_rpm": 1490.0, "speed_tolerance_percent": 4.0},
        "machine": {"power_kw": 22.0, "mounting": "rigid"},
    }


def test_a_speed_that_is_stated_later_draws_the_pictures_of_the_views() -> None:
    page = opened_file("bare.csv.gz", SAMPLES["damaged_tooth"].recording.read_bytes(), tab="Machine")

    def drawn() -> set[str]:
        strip = next(part.proto for part in page.get("bidi_component") if part.proto.component_name == "gearsig.strip")
        return {item["name"] for item in json.loads(strip.json)["items"] if item.get("path") or item.get("picture")}

    assert not {"Speed", "Order spectrum"} & drawn()
    labelled(page, "number_input", "Constant speed (rpm)").set_value(1497.0).run()
    assert {"Speed", "Order spectrum"} <= drawn()


def test_a_shaft_without_a_name_and_a_mark_is_explained() -> None:
    content, _ = machine()
    rig = '[speed]\nsource = "constant"\nspeed_rpm = 600\n'
    page = opened_file("orders.csv", content, rig, tab="Average")
    assert next(w for w in page.main.selectbox if w.label == "Shaft").options == ["the shaft"]
    assert "The shaft has no mark" in shown_text(page)


def test_a_speed_that_nobody_stated_is_not_made_up() -> None:
    content = SAMPLES["damaged_tooth"].recording.read_bytes()
    page = opened_file("a.csv.gz", content, '[speed]\nsource = "constant"\n', tab="Machine")
    assert "Speed (rpm) must be given" in shown_text(page)
    assert labelled(page, "number_input", "Constant speed (rpm)").value is None


def test_a_speed_is_stated_in_one_place_of_the_form() -> None:
    """What measures it takes the place of a constant one that was stated, and that of one in the rig file."""
    page = opened_file("a.csv.gz", SAMPLES["damaged_tooth"].recording.read_bytes(), tab="Machine")
    assert labelled(page, "selectbox", "Speed from").value == "constant"
    labelled(page, "number_input", "Constant speed (rpm)").set_value(1497.0).run()
    assert page.session_state["chosen"].request.speed_rpm == 1497.0
    labelled(page, "selectbox", "Speed from").set_value("tachometer").run()
    assert page.session_state["chosen"].request.speed_rpm is None
    assert not [field for field in page.main.number_input if field.label == "Constant speed (rpm)"]


def test_a_file_of_pulse_times_tells_the_speed() -> None:
    """Given beside the recording, in the form; a broken one is one message beside it."""
    page = opened_file("a.csv.gz", SAMPLES["damaged_tooth"].recording.read_bytes(), tab="Machine")
    labelled(page, "selectbox", "Speed from").set_value("pulse times").run()
    times = "".join(f"{0.03 + 0.02 * i:.6f}\n" for i in range(240))
    next(w for w in page.main.file_uploader if w.label == "File of pulse times").upload("p.txt", times.encode()).run()
    assert not page.error
    labelled(page, "number_input", "Pulses per revolution").set_value(2).run()
    request = page.session_state["chosen"].request
    assert command_of(request).endswith("--tach-times p.txt --pulses-per-revolution 2")
    page.session_state[state.TAB] = "Speed"
    assert "1500" in shown_text(page.run())
    assert "from tachometer pulses" in shown_text(page)
    page.session_state[state.TAB] = "Machine"
    page.run()
    next(w for w in page.main.file_uploader if w.label == "File of pulse times").upload("p.txt", b"2\n1\n").run()
    assert "runs backwards" in page.error[0].value
    labelled(page, "selectbox", "Speed from").set_value("constant").run()
    assert page.session_state["chosen"].request.pulses is None
    assert not page.error


def test_a_machine_without_a_name_is_described_all_the_same() -> None:
    sample = SAMPLES["damaged_tooth"]
    nameless = sample.rig.read_text("utf-8").partition("\n")[2]
    page = opened_file("a.csv.gz", sample.recording.read_bytes(), nameless)
    assert "unnamed machine" in shown_text(page)
    page = opened_file("a.csv.gz", sample.recording.read_bytes())
    assert "machine not described" in shown_text(page)


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('[[bearing]]\nname = "b"\nshaft = "input"\nn_rolling_elements = 8\n', ("Bearings, row 1", "Ø pitch (mm)")),
        ('[[bearing]]\nname = "b"\nshaft = "input"\npitch_diameter_mm = "x"\n', ("Bearings, row 1, Ø pitch (mm)",)),
        ('[[bearing]]\nname = "b"\nshaft = "outptu"\n', ("machine.toml", "output")),
        ('[[sensor]]\nchannel = "a1"\nscale = 0\n', ("Sensors, row 1",)),
        ('[speed]\nsource = "constant"\nspeed_rpm = -3\n', ("Speed", "Speed (rpm)")),
        ("[[pair]]\nmodule_mm = -1\n", ("Gear pairs, row 1",)),
        ("[operating_point]\nspeed_rpm = -3\n", ("Nominal operating point", "nominal Speed (rpm)")),
        ('[machine]\nmounting = "soft"\n', ("Size and mounting", "rigid, flexible")),
        ('[[bearing]]\nname = "b"\nshaft = "input"\ncontact_angle_deg = 95\n', ("Bearings, row 1", "contact angle")),
    ],
)
def test_the_form_is_corrected_in_its_own_words(table: str, said: tuple[str, ...]) -> None:
    rig = f'[[shaft]]\nname = "input"\n[[shaft]]\nname = "output"\n{table}'
    page = opened_file("a.csv.gz", SAMPLES["damaged_tooth"].recording.read_bytes(), rig)
    (error,) = page.error
    words = error.value.replace("\\", "").replace("\u2060", "")
    assert all(text in words for text in said), words
    assert not re.search(r"\[\[|\[speed\]|\w_\w", words)


def test_what_a_recording_lacks_is_said_in_the_words_of_the_form() -> None:
    page = opened_file("bare.csv", b"a1\n" + b"1\n2\n" * 500)
    assert "the sampling rate, below or under Machine" in shown_text(page)
    assert "sampling_rate_hz" not in shown_text(page)
    page = opened_file("pulses.csv", b"time\n1\n2\n3\n")
    assert "give them as Speed from pulse times under Machine" in shown_text(page)
    assert "--tach-times" not in shown_text(page)


@pytest.mark.slow
def test_phrases_that_pages_replace_occur_in_messages() -> None:
    root = Path(__file__).parents[2]
    sources = [path for room in ("app", "gearsig", "sims") for path in (root / room).rglob("*.py")]
    trees = [ast.parse(path.read_text("utf-8")) for path in sources if path.name != "texts.py"]
    constants = (node.value for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    messages = "\n".join(text for text in constants if isinstance(text, str))
    of_the_reference = messages.replace("--fs", "--reference-fs")
    assert [text for text in PAGE_TEXTS if text not in messages and text not in of_the_reference] == []


def test_units_are_written_as_in_print() -> None:
    page = opened(tab="Machine")  # whose rig file says m/s^2
    assert any("unit" in table.value and "m/s²" in set(table.value["unit"]) for table in page.dataframe)
    assert not [b for b in page.button if b.label.startswith("Analyse")]
    assert in_page_text("the file says g, the rig file m/s^2") == "the file says g, the rig file m/s²"


def test_the_report_is_looked_at_before_it_is_taken() -> None:
    page = opened(tab="Report")
    assert not sent_to(page, "document")
    labelled(page, "toggle", "Preview").set_value(True).run()
    (sent,) = sent_to(page, "document")
    assert "Local tooth damage" in sent["html"]


def test_recording_and_rig_file_are_given_at_once_on_the_start_page() -> None:
    sample = SAMPLES["damaged_tooth"]
    page = at("start", {})
    uploader = page.file_uploader(key="start file")
    uploader.upload("machine.toml", sample.rig.read_bytes()).run()
    assert "Now add the recording" in shown_text(page)
    uploader = page.file_uploader(key="start file").upload("machine.toml", sample.rig.read_bytes())
    uploader.upload(sample.recording.name, sample.recording.read_bytes()).run()
    (file,) = state_of(page, state.RECORDING_FILE)
    assert (file.name, file.rig_name) == (sample.recording.name, "machine.toml")
    assert file.rig_text == sample.rig.read_text("utf-8")
    assert "Local tooth damage" in shown_text(page)


def test_a_recording_without_a_rig_file_waits_for_it_or_a_press() -> None:
    page = at("start", {})
    content = SAMPLES["damaged_tooth"].recording.read_bytes()
    page.file_uploader(key="start file").upload("a.csv.gz", content).run()
    assert "or add its rig file" in shown_text(page)
    press(page, "Open it")
    assert "a.csv.gz" in shown_text(page)
    page = at("start", {})
    page.file_uploader(key="start file").upload("a.csv", b"1").upload("b.csv", b"1").run()
    assert "2 recordings are given" in shown_text(page)


def state_of(page: AppTest, kind: str) -> tuple[ChosenFile, ...]:
    files: tuple[ChosenFile, ...] = page.session_state[f"kept files of {kind}"]
    return files


def test_a_sampling_rate_that_is_missing_is_asked_for_and_taken() -> None:
    lines = "\n".join(str((i * 37) % 101 - 50) for i in range(4000))
    page = upload(opened(), "bare.csv", f"a1\n{lines}\n".encode())
    assert len(page.error) == 1
    assert "sampling rate" in shown_text(page)
    assert "--" not in shown_text(page)
    next(w for w in page.number_input if w.label.startswith("Sampling")).set_value(1000.0).run()
    assert not page.error
    assert "4 s at 1000 Hz" in shown_text(page)


@pytest.mark.parametrize("rate", [0.0, -1.0])
def test_an_impossible_sampling_rate_is_one_message(rate: float) -> None:
    page = opened(tab="Machine")
    next(w for w in page.number_input if w.label.startswith("Sampling")).set_value(rate).run()
    page.run()
    assert not page.exception
    assert len(page.error) == 1


HOSTILE_RIGS = (
    "a=" + "[" * 5000 + "]" * 5000,
    "sampling_rate_hz=" + "9" * 5000,
    "shaft=5",
    "shaft=[1, 2]",
    '[shaft]\nname="a"\n',
    "speed=3",
    '[speed]\nsource="constant"\nspeed_rpm="fast"\n',
    "name=[1]",
    '[[pair]]\nname="a"\ndriver="b"\ndriven=[]\n',
    '[[pair]]\nname="a"\ndriver="b"\ndriven="c"\ndriver_teeth="x"\ndriven_teeth=1' + "0" * 400,
    "".join(f'[[shaft]]\nname="{i}"\n' for i in range(2000)),
)


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
        *(("good.csv", b"a1\n1\n2\n", rig) for rig in HOSTILE_RIGS),
    ],
)
def test_broken_files_show_one_message(name: str, content: bytes, rig: str) -> None:
    page = upload(opened(), name, content, rig)
    assert not page.exception
    assert len(page.error) == 1
    assert not figures(page, of_verdict=True)


def test_nothing_is_open_before_a_file_is_given() -> None:
    page = opened()
    page.sidebar.radio(key=state.ORIGIN).set_value("Your file").run()
    assert not page.exception
    assert not figures(page, of_verdict=True)
    assert "Choose a recording" in shown_text(page)


def test_no_long_signal_goes_to_the_browser_whole() -> None:
    """A million samples: the page carries thousands; a window shows its own samples again."""
    from io import BytesIO

    from scipy.io import savemat

    x = np.random.default_rng(0).standard_normal(1_000_000).astype(np.float32)
    x[123_456] = 99.0
    file = BytesIO()
    savemat(file, {"a1": x, "fs": 10_000.0})
    page = opened_file("long.mat", file.getvalue(), tab="Waveform")
    assert not page.exception
    whole = figures(page)[0]["lines"][0]
    assert len(numbers(whole["y"])) <= 3200
    assert numbers(whole["y"]).max() == pytest.approx(99.0)
    assert numbers(whole["x"])[np.argmax(numbers(whole["y"]))] == pytest.approx(12.3456)
    ids = [part.proto.id for part in page.get("bidi_component")]
    key = next(name for name in ids if "time of a1" in name).split("-", 2)[-1]
    page.session_state[state.ZOOMS] = {key: [12.3, 12.4]}
    near = figures(page.run())[0]
    assert near["shown"] == [12.3, 12.4]
    assert len(numbers(near["lines"][0]["y"])) == pytest.approx(1000, abs=5)
    assert numbers(near["lines"][0]["y"]).max() == pytest.approx(99.0)


def test_names_from_files_are_shown_as_typed() -> None:
    """Markup in channel, shaft and file names stays text, in every view."""
    names = ("<script>alert(1)</script>", "**x** $y$ :material/delete: :smile: a->b __")
    rows = "\n".join(f"{i / 1000};{(i * 37) % 101};{(i * 53) % 97}" for i in range(3000))
    rig = '[[shaft]]\nname = "<img src=x onerror=alert(1)>"\n[speed]\nsource = "constant"\nspeed_rpm = 1200\n'
    page = opened_file("[a](http://x.y) **b**.csv", f"time (s);{names[0]};{names[1]}\n{rows}\n".encode(), rig)
    for tab in VIEWS:
        page.session_state[state.TAB] = tab
        page.run()
        assert not page.exception, tab
        raw = "\n".join(part.value for part in [*page.markdown, *page.subheader, *page.caption, *page.info])
        for markup in ("<script", "<img", "**x**", "$y$", ":material/delete:", ":red[", "[a](", "http:"):
            assert not re.search(r"(?<!\\)" + re.escape(markup), raw), (tab, markup)
    page.session_state[state.TAB] = "Waveform"
    page.run()
    for name in names:
        assert name in shown_text(page)


@pytest.mark.slow
def test_a_reference_changes_verdict_and_indicators_as_on_the_command_line() -> None:
    from app.dashboard.cached import read_and_analyze
    from app.dashboard.state import AnalysisRequest
    from gearsig.report import headline_of

    page = opened("root_crack_1mm", tab="Indicators")
    assert "reference" in page.dataframe[0].value.columns  # its own healthy reference is chosen at first
    next(w for w in page.sidebar.selectbox if w.label.startswith("Compared")).set_value("None").run()
    assert "reference" not in page.dataframe[0].value.columns
    next(w for w in page.sidebar.selectbox if w.label.startswith("Compared")).set_value("No crack").run()
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
    assert headline_of(same)[0] in shown_text(page)


@pytest.mark.slow
def test_a_reference_with_a_rig_file_of_its_own_is_read_with_its_channels() -> None:
    """The eccentric wheel's tachometer is on ch2, that of the healthy gearbox on tacho."""
    page = opened("eccentric_wheel")
    assert not page.exception
    assert not page.error, shown_text(page)
    assert "**Changed since the reference** :gray[healthy.h5]" in shown_text(page)


def test_an_uploaded_reference_that_does_not_fit_is_one_message() -> None:
    page = opened()
    next(w for w in page.sidebar.selectbox if w.label.startswith("Compared")).set_value("Your file").run()
    assert not page.error
    healthy = page.sidebar.file_uploader[0]
    rows = (b"%g;%d;%d" % (i / 1000, i * 37 % 101, i * 41 % 101) for i in range(3000))
    healthy.upload("other.csv", b"time (s);b;c\n" + b"\n".join(rows))
    page.run()
    assert not page.exception
    assert len(page.error) == 1
    assert "the reference has no channel" in shown_text(page)


def test_the_sampling_rate_of_an_uploaded_reference_is_asked_for() -> None:
    page = opened()
    next(w for w in page.sidebar.selectbox if w.label.startswith("Compared")).set_value("Your file").run()
    assert all(w.label != "Its sampling rate (Hz)" for w in page.sidebar.number_input)
    rows = "\n".join(f"{i * 37 % 101};{i * 41 % 101}" for i in range(3000))
    page.sidebar.file_uploader[0].upload("bare.csv", f"b;c\n{rows}".encode())
    page.run()
    assert "its sampling rate on the left" in page.error[0].value
    assert "--" not in page.error[0].value
    labelled(page, "number_input", "Its sampling rate (Hz)").set_value(12800.0).run()
    assert "the reference has no channel" in page.error[0].value
    assert not page.exception


def test_a_machine_that_starts_and_stops_opens_on_its_motion(tmp_path) -> None:
    drive = simulate("forging", duration_s=6.0, sampling_rate_hz=1000.0)
    file, rig = write_recording(drive, tmp_path / "drive.h5"), tmp_path / "drive.toml"
    write_rig(drive.rig, rig)
    page = opened_file(file.name, file.read_bytes(), rig.read_text())
    assert not page.exception
    assert page.session_state[state.TAB] == "Starts and stops"


def test_a_zoomed_ring_of_teeth_is_kept_in_the_address_and_reads_off_its_values() -> None:
    page = opened(tab="Average")
    (ring,) = sent_to(page, "picture")  # once: that of the verdict
    assert ring["shown"] is None
    assert ring["ring"]["teeth"] == 29
    values = numbers(ring["ring"]["curves"][0]["values"])
    tooth = 1 + int(29 * np.argmax(np.abs(values)) / len(values))
    assert tooth == 12
    page.session_state[state.ZOOMS] = {key_of("verdict tooth"): [200.0, 300.0, 100.0, 200.0]}
    page.run()
    assert sent_to(page, "picture")[0]["shown"] == [200.0, 300.0, 100.0, 200.0]
    assert page.query_params["zoom"].endswith("_200_300_100_200")


@pytest.mark.slow
def test_the_average_of_a_crack_opens_on_what_changed_since_the_reference() -> None:
    page = opened("root_crack_3mm", tab="Average")
    (ring,) = sent_to(page, "picture")
    (average,) = figures(page)
    assert "change" in average["y"]
    values, over_angle = numbers(ring["ring"]["curves"][0]["values"]), numbers(average["lines"][0]["y"])
    assert np.abs(values).max() == pytest.approx(np.abs(over_angle).max(), rel=0.2)


def test_numbers_of_tables_have_a_minus_sign_and_are_sorted_by_what_they_are() -> None:
    page = opened(tab="Indicators")
    table = page.dataframe[0]
    written = convert_arrow_bytes_to_pandas_df(table.proto.arrow_data.styler.display_values)
    changes = table.value["change (dB)"]
    assert changes.dtype.kind == "f"
    for value, text in zip(changes, written["change (dB)"], strict=True):
        assert text == ("" if np.isnan(value) else f"{value:+.1f}".replace("-", "−"))
    assert (changes < 0).any()
