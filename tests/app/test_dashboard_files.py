"""What the dashboard does with bytes and names from strangers, and with several sessions at once."""

import tempfile
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from markdown_it import MarkdownIt

from app.dashboard.analysis import indicator_frame
from app.dashboard.cached import command_of, read_and_analyze, read_content, read_rig_text, safe_file_name
from app.dashboard.state import AnalysisRequest
from app.dashboard.widgets.charts import csv_text, picture_bytes
from app.dashboard.widgets.texts import as_typed, one_line
from app.samples import samples
from gearsig.errors import InputError
from gearsig.indicators import Indicator
from gearsig.report import split_verdict

CSV = b"time (s),a1 (m/s^2)\n" + b"".join(b"%.3f,%d\n" % (i / 1000, (i * 37) % 101) for i in range(2000))


@pytest.fixture
def temporary(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return the folder that temporary files go to, so that a test sees what is left there."""
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    return folder


@pytest.mark.parametrize("name", ["run.csv", "../../run.csv", "/etc/run.csv", r"C:\data\run.csv", ".. /a b/√.csv"])
def test_bytes_are_read_whatever_the_name_and_nothing_is_left(name: str, temporary: Path) -> None:
    recording = read_content(CSV, name, rig=None, sampling_rate_hz=None, speed=None)
    assert recording.n_samples == 2000
    assert recording.sampling_rate_hz == pytest.approx(1000)
    assert recording.provenance.source == name
    assert not list(temporary.iterdir())


def test_broken_bytes_leave_nothing_either(temporary: Path) -> None:
    with pytest.raises(InputError):
        read_content(b"\x80\x04pickle", "run.mat", rig=None, sampling_rate_hz=None, speed=None)
    with pytest.raises(InputError, match="TOML"):
        read_rig_text("[[shaft", "../rig.toml")
    assert not list(temporary.iterdir())


@given(st.text())
def test_a_safe_name_stays_in_its_folder(name: str) -> None:
    safe = safe_file_name(name)
    assert safe
    assert safe not in (".", "..")
    assert not set(safe) & set('/\\\0:*?"<>|')
    assert not safe.startswith(".")
    assert len(safe) <= 100


def test_a_safe_name_keeps_the_ending() -> None:
    assert safe_file_name("a" * 300 + ".csv.gz").endswith("aaa.csv.gz")
    assert safe_file_name("振動.2024.csv.gz") == "2024.csv.gz"
    assert safe_file_name("..") == safe_file_name("振動") == "recording"
    assert safe_file_name("no ending") == "no-ending"
    assert safe_file_name("…/../Messung 1.MAT") == "Messung-1.MAT"


@given(st.text(alphabet=st.characters(codec="utf-8")))
@example("0 m")
def test_markdown_shows_names_as_typed(name: str) -> None:
    """An independent Markdown renderer shows the very text, and nothing but text."""
    html = MarkdownIt("gfm-like", {"linkify": False}).renderInline(as_typed(name))
    seen = html.replace("&lt;", "<").replace("&gt;", ">").replace("&quot;", '"').replace("&amp;", "&")
    assert seen.replace("\u2060", "").replace("\u00a0", " ") == one_line(name)  # numbers stay with their units


@given(st.text(alphabet="ab .()", max_size=300))
def test_a_headline_and_its_rest_are_the_verdict(words: str) -> None:
    headline, rest = split_verdict(words)
    assert f"{headline} {rest}".split() == words.split()
    assert len(words) > 120 or headline == words


def test_formulas_do_not_reach_a_spreadsheet() -> None:
    table = indicator_frame((Indicator("rms", -1.5, channel="=cmd()"), Indicator("peak", 2.0, channel="a1")))
    lines = csv_text(table).splitlines()
    assert lines[1].startswith("rms,-1.5,,'=cmd()")
    assert lines[2].startswith("peak,2.0,,a1")


def test_the_command_survives_a_shell() -> None:
    import shlex

    request = AnalysisRequest("a b; rm -rf.csv", "", "rig's.toml", "x = 1", 25600.0, 1500.0)
    words = shlex.split(command_of(request))
    assert words[:5] == ["gearsig", "analyze", "a b; rm -rf.csv", "--rig", "rig's.toml"]
    assert words[5:] == ["--fs", "25600", "--speed-rpm", "1500"]
    compared = AnalysisRequest("a.h5", "", reference_name="healthy; 1.h5", reference_sha256="1", torque_nm=40.0)
    assert shlex.split(command_of(compared))[3:] == ["--reference", "healthy; 1.h5", "--torque", "40Nm"]
    at_another = replace(compared, reference_rate_hz=12800.0, torque_nm=None)
    assert shlex.split(command_of(at_another))[5:] == ["--reference-fs", "12800"]


def test_dark_pictures_turn_paper_and_ink_over_and_keep_the_hue() -> None:
    from io import BytesIO

    from matplotlib.figure import Figure
    from PIL import Image

    figure = Figure(figsize=(1, 1), facecolor="white")
    axes = figure.add_axes((0, 0, 0.5, 1), facecolor="#0072B2")
    axes.set_xticks([]), axes.set_yticks([])
    pixels = np.asarray(Image.open(BytesIO(picture_bytes(figure, dark=True))), dtype=float)
    paper, blue = pixels[90, 170], pixels[90, 45]
    assert paper == pytest.approx([0x15, 0x17, 0x1B], abs=1)
    assert blue[2] > blue[1] > blue[0] + 20


@pytest.mark.slow
def test_sessions_can_analyse_at_the_same_time() -> None:
    """Streamlit runs each session in a thread: kernels and figures have to bear that."""
    chosen = [s for s in samples() if s.rig.stem in ("damaged_tooth", "no_tachometer")]

    def verdict(job: int) -> str:
        from gearsig.report import page_html

        sample = chosen[job % len(chosen)]
        request = AnalysisRequest(sample.recording.name, str(job), sample.rig.name, sample.rig.read_text())
        analysis = read_and_analyze(request, memoryview(sample.recording.read_bytes()))
        return f"{len(page_html(analysis)) > 100_000} {analysis.verdict}"

    with ThreadPoolExecutor(4) as pool:
        verdicts = list(pool.map(verdict, range(4)))
    assert verdicts[:2] == verdicts[2:]
    assert all(text.startswith("True ") for text in verdicts)
