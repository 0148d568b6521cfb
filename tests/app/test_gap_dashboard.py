"""The gap page without a browser: what it is given becomes files, a run shows and stops, names are never markup."""

import os
import time
from hashlib import sha256
from pathlib import Path

import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import gap as view
from app.dashboard.gap import _FINISHED, _JOB, Finished
from app.dashboard.gap.choice import Choice, common_rig, files_of, own_rig
from app.dashboard.state import ChosenFile
from app.gap_job import JSON
from app.samples import sample_folder
from gearsig.errors import InputError
from gearsig.gap import read_gap_inputs
from gearsig.report import gap_figures, gap_to_json
from tests.app.pages import at, labelled, on, press, sent_to, shown_text, turned_to
from tests.gap.example_report import all_reports, effect_report, with_few_curves
from tests.gap.stub_diagnosis import OUTCOME, SECONDS, environment

SAMPLES = sample_folder()
CRACKED, HEALTHY = SAMPLES / "root_crack_3mm.h5", SAMPLES / "root_crack_0mm.h5"
RIG = (SAMPLES / "root_crack_3mm.toml").read_text()
REPORTS = all_reports()
EVIL = "<script>*a*</script> :rocket: [x](http://y)"


@pytest.fixture(autouse=True)
def results_of_their_own(tmp_path, monkeypatch):
    """Let no test find the results that another one has kept."""
    monkeypatch.setenv("GEARSIG_CACHE", str(tmp_path / "cache"))


def upload(name: str, content: bytes = b"", text: str = "") -> ChosenFile:
    return ChosenFile(name, sha256(content).hexdigest(), memoryview(content), name, text)


def sample(path: Path) -> ChosenFile:
    return ChosenFile(path.name, sha256(path.read_bytes()).hexdigest(), path)


def opened() -> AppTest:
    return on("gap")


@pytest.fixture
def stub(tmp_path, monkeypatch):
    """Let processes that the page starts answer as the test says."""

    def use(**more: str) -> None:
        for name, value in environment(tmp_path, **more).items():
            monkeypatch.setenv(name, value)

    return use


def wait_for_the_end(page: AppTest) -> AppTest:
    for _ in range(300):
        if _JOB not in page.session_state:
            return page
        time.sleep(0.1)
        page.run()
    pytest.fail("it takes too long")


def test_uploads_become_files_with_their_own_rigs(tmp_path) -> None:
    own = RIG.replace("torque_nm = 110.0", "torque_nm = 55.0")
    content = CRACKED.read_bytes()
    choice = Choice(
        (upload("../a run.h5", content), upload("b.h5", content)),
        (upload("b.h5", HEALTHY.read_bytes()),),
        (upload("gearbox.toml", text=RIG), upload("b.toml", text=own)),
        torque_nm=None,
        reference_rate_hz=51200.0,
        run_up=upload("rising.h5", HEALTHY.with_name("root_crack_2mm.h5").read_bytes()),
    )
    request = files_of(choice, tmp_path)
    assert all(tmp_path in path.parents for path in (*request.recordings, *request.references, request.run_up))
    assert request.names == ("../a run.h5", "b.h5")
    inputs = read_gap_inputs(request)
    torques = [r.rig.operating_point.torque_nm for r in (*inputs.recordings, *inputs.references, inputs.run_up)]
    assert torques == [110.0, 55.0, 55.0, 110.0]
    assert request.reference_rate_hz == 51200.0
    assert "--reference-fs 51200" in choice.command
    assert "--rig gearbox.toml" in choice.command
    assert "--run-up rising.h5" in choice.command
    assert "'../a run.h5'" in choice.command


def test_two_rig_files_for_all_are_refused() -> None:
    choice = Choice((sample(CRACKED),), rigs=(upload("one.toml", text=RIG), upload("two.toml", text=RIG)))
    with pytest.raises(InputError, match=r"one\.toml, two\.toml"):
        common_rig(choice)


def test_names_that_differ_after_a_dot_have_their_own_rigs(tmp_path) -> None:
    content, own = CRACKED.read_bytes(), RIG.replace("torque_nm = 110.0", "torque_nm = 55.0")
    names = ("run.5Nm.h5", "run.10Nm.h5")
    choice = Choice(
        tuple(upload(name, content) for name in names),
        rigs=(upload("run.10Nm.toml", text=RIG), upload("run.5Nm.toml", text=own)),
    )
    assert common_rig(choice) is None
    recordings = read_gap_inputs(files_of(choice, tmp_path)).recordings
    assert [recording.rig.operating_point.torque_nm for recording in recordings] == [55.0, 110.0]
    assert own_rig(upload("run.5Nm.csv.gz"), choice.rigs) is choice.rigs[1]


def test_two_rig_files_for_one_recording_are_refused(tmp_path) -> None:
    twice = (upload("a.toml", text=RIG), upload("a.toml", text=RIG + "\n"))
    with pytest.raises(InputError, match=r"a\.h5: 2 rig files .*a\.toml, a\.toml.*remove all but one"):
        files_of(Choice((upload("a.h5"),), rigs=twice), tmp_path)


def test_the_only_rig_file_is_for_all_though_it_is_named_as_the_reference() -> None:
    now, healthy = upload("now.h5", b"1"), upload("healthy.h5", b"2")
    rig = upload("healthy.toml", text=RIG)
    assert common_rig(Choice((now,), (healthy,), (rig,))) is rig


def test_another_choice_has_another_key() -> None:
    one = Choice((sample(CRACKED),), (sample(HEALTHY),))
    others = (
        Choice((sample(CRACKED),)),
        Choice((sample(HEALTHY),)),
        Choice((sample(CRACKED),), (sample(HEALTHY),), torque_nm=3.0),
        Choice((sample(CRACKED),), (sample(HEALTHY),), (upload("r.toml", text=RIG),)),
        Choice((sample(CRACKED),), (sample(HEALTHY),), run_up=upload("rising.h5")),
    )
    assert len({one.key, *(other.key for other in others)}) == 6
    assert one.key == Choice((sample(CRACKED),), (sample(HEALTHY),)).key


@pytest.mark.slow
def test_a_run_from_the_button_to_the_answer(stub) -> None:
    stub(**{SECONDS: "1"})
    page = press(opened(), "Diagnose")
    assert [button.label for button in page.button if button.disabled] == ["Diagnose"]
    assert "which** effect missing from the simulator" in shown_text(page)
    page = wait_for_the_end(page)
    assert not page.exception
    text = shown_text(page)
    assert "tooth 21 of the driver (93 %): crack in a tooth root" in text
    assert "10 mm" not in text
    labels = [button.label for button in page.get("download_button")]
    assert labels[:3] == ["Report (HTML)", "JSON", "Twin (preset)"]
    assert labels[3:] == ["PNG", "SVG", "CSV"] * (len(labels[3:]) // 3)  # of pictures that do not zoom
    page.sidebar.multiselect(key="references of gap").set_value([]).run()
    assert "answer for the previous choice" in shown_text(page)


@pytest.mark.slow
def test_the_start_page_s_example_needs_one_click(stub) -> None:
    stub(**{SECONDS: "1"})
    page = on("start")
    page.button(key="try gap").click().run()
    turned_to(page, "gap")  # AppTest does not follow a switch
    assert [button.label for button in page.button if button.disabled] == ["Diagnose"]
    assert "tooth 21 of the driver (93 %)" in shown_text(wait_for_the_end(page))


@pytest.mark.slow
def test_a_result_is_shown_again_after_a_reload(stub, tmp_path, monkeypatch) -> None:
    stub()
    page = wait_for_the_end(press(opened(), "Diagnose"))
    again = opened()
    assert "tooth 21 of the driver (93 %)" in shown_text(again)
    assert next(button for button in again.get("download_button")).label == "Report (HTML)"
    again.sidebar.multiselect(key="references of gap").set_value([]).run()
    assert "answer for the previous choice" in shown_text(again)
    again.sidebar.multiselect(key="references of gap").set_value(page.session_state["references of gap"]).run()
    assert "answer for the previous choice" not in shown_text(again)
    (kept,) = (tmp_path / "cache" / "gap-results").iterdir()
    whole = kept.read_bytes()
    kept.write_bytes(whole[: len(whole) // 2])
    assert "which** effect missing from the simulator" in shown_text(opened())
    kept.write_bytes(whole)
    monkeypatch.setattr(view, "_code", lambda: "another state of it")
    assert "which** effect missing from the simulator" in shown_text(opened())


def test_only_so_many_results_are_kept(monkeypatch) -> None:
    monkeypatch.setattr(view, "N_KEPT", 2)
    choices = [Choice((sample(CRACKED),), torque_nm=float(n)) for n in range(1, 5)]
    files = {JSON: gap_to_json(with_few_curves(effect_report())).encode()}
    for n, choice in enumerate(choices):
        view._keep_result(choice, files)
        if view._place_of(choice).exists():
            os.utime(view._place_of(choice), (n, n))
    assert [view.kept_result(choice) is not None for choice in choices] == [False, False, True, True]


def test_own_files_survive_a_reload() -> None:
    page = at("gap", {"of": "Your files"})
    page.sidebar.file_uploader(key="gap recordings").upload("one.h5", CRACKED.read_bytes())
    page.sidebar.file_uploader(key="gap references").upload("two.h5", HEALTHY.read_bytes())
    page.sidebar.file_uploader(key="gap rigs").upload("rig.toml", RIG.encode())
    page.run()
    again = at("gap", page.query_params)
    assert "one.h5, against two.h5" in shown_text(again)
    assert "Teeth: 55/75" in shown_text(again)
    assert again.query_params == page.query_params


@pytest.mark.slow
def test_the_report_is_looked_at_before_it_is_taken() -> None:
    page = opened()
    page.session_state[_FINISHED] = finished(effect_report())
    assert not sent_to(page.run(), "document")
    labelled(page, "toggle", "Preview").set_value(True).run()
    assert [sent["html"] for sent in sent_to(page, "document")] == ["<html>"]


def test_stop_ends_it_and_says_so(stub) -> None:
    stub(**{SECONDS: "100"})
    page = press(opened(), "Diagnose")
    job = page.session_state[_JOB].job
    assert job.is_running
    page = press(page, "Stop")
    assert not job.is_running
    assert not job.folder.exists()
    assert "Stopped." in shown_text(page)
    assert not page.exception
    page.run()
    assert "Stopped." not in shown_text(page)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("outcome", "said"), [("refusal", "the rig <file> has no teeth"), ("crash", "something nobody thought of")]
)
def test_why_there_is_no_answer_is_said(stub, outcome, said) -> None:
    stub(**{OUTCOME: outcome})
    page = wait_for_the_end(press(opened(), "Diagnose"))
    assert not page.exception
    assert said in shown_text(page)
    assert len(page.error) == 1


def test_why_nothing_can_be_started_is_said() -> None:
    page = opened()
    page.sidebar.radio(key="of of gap").set_value("Your files").run()
    page.sidebar.file_uploader(key="gap recordings").upload("a.h5", CRACKED.read_bytes())
    page.sidebar.file_uploader(key="gap rigs").upload("one.toml", RIG.encode()).upload("two.toml", RIG.encode())
    page = press(page.run(), "Diagnose")
    assert not page.exception
    assert _JOB not in page.session_state
    assert len(page.error) == 1
    assert "2 rig files are not named like a recording: one.toml, two.toml" in shown_text(page)
    assert not next(button for button in page.button if button.label == "Diagnose").disabled


def finished(report) -> Finished:
    report = with_few_curves(report)
    data = gap_to_json(report).encode()
    return Finished("another choice", report, tuple(gap_figures(report)), b"<html>", data, None)


@pytest.mark.parametrize("outcome", list(REPORTS))
def test_every_outcome_shows_in_every_view(outcome) -> None:
    page = opened()
    page.session_state[_FINISHED] = finished(REPORTS[outcome])
    for tab in ("Where", "Which", "How far", "Next and facts"):
        page.session_state["gap tab"] = tab
        page.run()
        assert not page.exception, tab
        assert not page.error, tab
    for line in REPORTS[outcome].verdict:
        assert line.partition(": ")[2][1:] in shown_text(page)


def test_names_from_files_are_never_markup() -> None:
    page = opened()
    page.session_state[_FINISHED] = finished(effect_report(rig=EVIL, simulator=EVIL))
    page.session_state["gap tab"] = "Next and facts"
    page.run()
    assert not page.exception
    shown = [part.value for part in (*page.markdown, *page.caption) if "script" in part.value]
    assert shown
    assert all("<script>" not in text.replace("\\<", "") for text in shown)


def test_without_recordings_nothing_can_be_started() -> None:
    page = opened()
    page.sidebar.radio(key="of of gap").set_value("Your files").run()
    assert not page.exception
    assert all(button.disabled for button in page.button if button.label in ("Diagnose", "Stop"))
    content = CRACKED.read_bytes()
    page.sidebar.file_uploader(key="gap recordings").upload("one.h5", content).upload("two.h5", content)
    page.sidebar.file_uploader(key="gap rigs").upload("rig.toml", RIG.encode())
    page.run()
    assert not page.exception
    assert "one.h5" in shown_text(page)
    assert not next(button for button in page.button if button.label == "Diagnose").disabled
