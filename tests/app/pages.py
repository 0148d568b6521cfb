"""Pages of the dashboard run without a browser: opened as a session would find them, and what they show."""

from __future__ import annotations

import json
from base64 import b64decode
from collections.abc import Mapping
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from streamlit import config
from streamlit.testing.v1 import AppTest
from streamlit.util import calc_hash

import app.dashboard
from app.dashboard import state
from app.dashboard.analysis import OF_CHANNEL
from app.dashboard.state import AnalysisRequest, Chosen
from app.samples import samples
from gearsig.recording import read_recording, sha256_of
from gearsig.rig import read_rig

FOLDER = Path(app.dashboard.__file__).parent
SAMPLES = {sample.rig.stem: sample for sample in samples()}

# Tests set widgets ahead of the first run, which Streamlit would remark upon.
config.set_option("global.disableWidgetStateDuplicationWarning", True)
# As the command starts it; what Streamlit would count takes a tenth of a page's time.
config.set_option("browser.gatherUsageStats", False)


def turned_to(page: AppTest, name: str) -> AppTest:
    """Turn a session to another page; Streamlit's tests know pages that are files alone."""
    page._page_hash = calc_hash(name)
    return page.run()


def on(name: str, query: Mapping[str, Any] | None = None, **values: Any) -> AppTest:
    """Open a page in a session that holds some values."""
    page = AppTest.from_file(str(FOLDER / "main.py"), default_timeout=300)
    page.query_params.update(query or {})
    for key, value in values.items():
        page.session_state[key] = value
    return turned_to(page, name)


def opened(sample: str = "damaged_tooth", *, tab: str = "", **values: Any) -> AppTest:
    """Open the analysis page on a sample and a tab, with values of its session."""
    tabs = {state.TAB: tab} if tab else {}
    return on("analysis", **{state.SAMPLE: SAMPLES[sample]}, **tabs, **values)


def at(page: str, query: Mapping[str, Any], **values: Any) -> AppTest:
    """Open a page by an address, in a session that knows nothing else."""
    opened = on(page, query, **values)
    assert not opened.exception
    return opened


def upload(page: AppTest, name: str, content: bytes, rig: str = "") -> AppTest:
    page.sidebar.radio(key=state.ORIGIN).set_value("Your file").run()
    page.sidebar.file_uploader(key=state.RECORDING_FILE).upload(name, content)
    if rig:
        page.sidebar.file_uploader(key=state.RIG_FILE).upload("machine.toml", rig.encode())
    return page.run()


def opened_file(name: str, content: bytes, rig: str = "", *, tab: str = "", **values: Any) -> AppTest:
    """Open a recording as the laboratory hands it over: in one run, without the steps of an upload."""
    request = AnalysisRequest(name, sha256(content).hexdigest(), "machine.toml", rig)
    chosen = {"simulated": Chosen(request, memoryview(content)), state.ORIGIN: state.OF_LABORATORY}
    return opened(tab=tab, **chosen, **values)


def view_of(method: str) -> str:
    """Return the view of the chain that a method belongs to."""
    return next(view for view, methods in OF_CHANNEL.items() if method in methods)


def method_key(method: str, digest: str, rate_hz: float) -> str:
    return f" method of {view_of(method)} of {digest} at {rate_hz!r}"


@cache
def _key_of(sample: str) -> tuple[str, float]:
    chosen = SAMPLES[sample]
    rate_hz = read_recording(chosen.recording, rig=read_rig(chosen.rig)).sampling_rate_hz
    return sha256_of(chosen.recording), rate_hz


def key_of(name: str, sample: str = "damaged_tooth") -> str:
    """Return the key of a widget that shows a sample, see `state.view_key`."""
    digest, rate_hz = _key_of(sample)
    return f"{name} of {digest} at {rate_hz!r}"


def opened_at(method: str, sample: str = "damaged_tooth") -> AppTest:
    """Open a sample at a method, in one run."""
    page = opened(sample, tab=view_of(method), **{method_key(method, *_key_of(sample)): method})
    assert not page.exception
    return page


def go(page: AppTest, method: str) -> AppTest:
    """Go to a method from another view or method."""
    view = view_of(method)
    if page.session_state[state.TAB] != view:
        page.session_state[state.TAB] = view
        page.run()
        assert not page.exception
    return choose(page, "Method", method) if len(OF_CHANNEL[view]) > 1 else page


@cache
def machine(rate_hz: float = 2000.0, duration_s: float = 8.0) -> tuple[bytes, str]:
    """Return a recording whose order 5 has amplitude 3 and order 5.5 amplitude 1, and its rig."""
    time = np.arange(round(rate_hz * duration_s)) / rate_hz
    turns = 10.0 * time
    x = 3.0 * np.cos(2 * np.pi * 5.0 * turns) + np.cos(2 * np.pi * 5.5 * turns)
    x += 0.01 * np.random.default_rng(3).standard_normal(len(x))
    rows = "\n".join(f"{t:.6f};{value:.9g}" for t, value in zip(time, x, strict=True))
    rig = (
        '[[shaft]]\nname = "input"\n[speed]\nsource = "constant"\nshaft = "input"\nspeed_rpm = 600\n'
        '[[sensor]]\nchannel = "a1"\nquantity = "acceleration"\nunit = "m/s^2"\n'
    )
    return f"time (s);a1\n{rows}\n".encode(), rig


def opened_machine(method: str, *, quantity: str = "acceleration", **values: Any) -> AppTest:
    """Open the recording of `machine` at a method."""
    content, rig = machine()
    unit = {"sound_pressure": "Pa", "displacement": "mm"}.get(quantity, "m/s^2")
    rig = rig.replace('"acceleration"', f'"{quantity}"').replace('"m/s^2"', f'"{unit}"')
    values[method_key(method, sha256(content).hexdigest(), 2000.0)] = method
    return opened_file("orders.csv", content, rig, tab=view_of(method), **values)


def choose(page: AppTest, label: str, value: str) -> AppTest:
    next(w for w in page.segmented_control if w.label == label).set_value(value).run()
    assert not page.exception
    return page


def press(page: AppTest, label: str) -> AppTest:
    labelled(page, "button", label).click().run()
    assert not page.exception
    return page


def labelled(page: AppTest, kind: str, label: str) -> Any:
    return next(w for w in page.get(kind) if w.label.startswith(label))


def shown_text(page: AppTest) -> str:
    """Return the words of the page as a reader sees them: without escapes and invisible joiners."""
    parts = [*page.markdown, *page.subheader, *page.caption, *page.error, *page.warning, *page.info, *page.code]
    return "\n".join(part.value for part in parts).replace("\\", "").replace("\u2060", "").replace("\u00a0", " ")


def bars(page: AppTest) -> np.ndarray:
    """Return the heights of the bars of the page."""
    values = json.loads(page.get("plotly_chart")[0].proto.spec)["data"][0]["y"]
    return np.frombuffer(b64decode(values["bdata"]), values["dtype"]) if isinstance(values, dict) else np.array(values)


def pictures(page: AppTest) -> list[dict[str, Any]]:
    """Return what was sent to the pictures of the page that zoom; without the ring of teeth beside the verdict."""
    return [picture for picture in sent_to(page, "picture") if not picture["words"].endswith("stands out")]


def sent_to(page: AppTest, component: str) -> list[dict[str, Any]]:
    """Return what was sent to the components of one name."""
    protos = [part.proto for part in page.get("bidi_component")]
    return [json.loads(proto.json) for proto in protos if proto.component_name == f"gearsig.{component}"]


def figures(page: AppTest, *, of_verdict: bool = False) -> list[dict[str, Any]]:
    """Return what was sent to the figures of the page that zoom; without the one beside the verdict."""
    known = sent_to(page, "figure")
    return known if of_verdict else [figure for figure in known if not figure["name"].startswith("verdict")]


def tiles(page: AppTest) -> list[str]:
    """Return the names of the views in the strip."""
    strip = next(part.proto for part in page.get("bidi_component") if part.proto.component_name == "gearsig.strip")
    return [item["name"] for item in json.loads(strip.json)["items"]]


def numbers(values: str) -> np.ndarray:
    """Return the numbers of a curve, which are encoded."""
    return np.frombuffer(b64decode(values), "<f8")


def curves(page: AppTest) -> dict[str, np.ndarray]:
    """Return the values of all named curves of the page, those of the first figure where names return."""
    found: dict[str, np.ndarray] = {}
    for figure in figures(page):
        for line in figure["lines"]:
            found.setdefault(line["name"], numbers(line["y"]))
    return found
