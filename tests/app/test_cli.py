"""The command line: what it prints, its exit codes, and that bad input is one line."""

import json
import os
import pickle
import re
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.cli.main import main
from app.samples import samples
from gearsig import __version__
from gearsig.recording import read_recording, write_recording

RIG = '[[pair]]\nname = "p"\ndriver = "in"\ndriven = "out"\ndriver_teeth = 23\ndriven_teeth = 47\n'


def run(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    """Run the command; return exit code, standard output and standard error."""
    with pytest.raises(SystemExit) as stopped:
        main([str(a) for a in arguments])
    out, err = capsys.readouterr()
    code = stopped.value.code
    return (code if isinstance(code, int) else int(code is not None)), out, err


def sample(stem: str) -> Path:
    return next(s.recording for s in samples() if s.rig.stem == stem)


def csv(folder: Path, text: str, name: str = "record.csv") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_analyze_finds_the_rig_file_beside_the_recording(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "analyze", sample("damaged_tooth"))
    assert code == 0
    assert "Fault: Local tooth damage" in out
    assert "damaged_tooth.toml" in err


def test_analyze_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run(capsys, "analyze", sample("outer_race"), "--json")
    assert code == 0
    result = json.loads(out)
    assert result["findings"][0]["code"] == "bearing-outer-race"


def test_analyze_without_a_rig_says_what_is_missing(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=4000)
    path = csv(tmp_path, "a1\n" + "\n".join(f"{v:.6g}" for v in values))
    code, out, _ = run(capsys, "analyze", path, "--fs", 1000)
    assert code == 0
    assert "Cannot tell" in out
    assert "rig example" in out


def test_rig_check_prints_the_orders(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, out, _ = run(capsys, "rig", "check", csv(tmp_path, RIG, "rig.toml"))
    assert code == 0
    assert "mesh order 23" in out
    assert "hunting tooth" in out


def test_the_example_rig_is_valid(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    _, text, _ = run(capsys, "rig", "example")
    code, out, _ = run(capsys, "rig", "check", csv(tmp_path, text, "rig.toml"))
    assert code == 0
    assert all(name in out for name in ("BPFO", "BPFI", "BSF", "FTF"))


def test_report_lists_the_broken_file_and_goes_on(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    broken = csv(tmp_path, "a1\n1\nnonsense\n3\n")
    code, out, err = run(capsys, "report", sample("no_tachometer"), broken, "-o", tmp_path / "pages", "-j", 1)
    assert code == 1
    assert "no_tachometer.csv: No fault shows" in out
    assert "record.csv: not analysed" in err
    index = (tmp_path / "pages" / "index.html").read_text()
    assert "no_tachometer.html" in index
    assert "record.csv" in index
    assert not list((tmp_path / "pages").glob("*record*.html"))


def test_pulse_times_from_a_file(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    t = np.arange(20_000) / 2000.0
    values = np.cos(2 * np.pi * 23 * 10.0 * t) + 0.1 * np.random.default_rng(0).normal(size=len(t))
    path = csv(tmp_path, "a1\n" + "\n".join(f"{v:.6g}" for v in values))
    pulses = csv(tmp_path, "\n".join(f"{0.1 * k:.6f}" for k in range(1, 99)), "pulses.csv")
    rig = csv(tmp_path, RIG, "rig.toml")
    code, out, _ = run(capsys, "analyze", path, "--fs", 2000, "--rig", rig, "--tach-times", pulses)
    assert code == 0
    assert "600" in next(line for line in out.splitlines() if "turns at" in line)


def test_version_and_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert __version__ in run(capsys, "--version")[1]
    for command in ("analyze", "report", "rig", "demo", "dashboard"):
        code, out, _ = run(capsys, command, "--help")
        assert code == 0
        assert len(out.splitlines()) > 5
        assert command in run(capsys, "--help")[1]


BAD = {
    "absent.csv": None,
    "empty.csv": b"",
    "zeros.mat": bytes(4096),
    "pickle.mat": pickle.dumps({"a1": [1.0, 2.0]}),
    "text.csv": b"a1,a2\n1,2\nx,3\n",
    "nan.csv": b"a1\n" + b"1\n2\nnan\n" * 200,
    "backwards.csv": b"time [s],a1\n0,1\n0.1,2\n0.05,3\n0.2,1\n",
    "doubled.csv": b"a1,a1\n1,2\n3,4\n",
    "short.wav": b"RIFF\x10\x00\x00\x00WAVEfmt ",
}


@pytest.mark.parametrize("name", BAD)
def test_bad_recordings_are_one_line_and_code_2(capsys: pytest.CaptureFixture[str], tmp_path: Path, name: str) -> None:
    content = BAD[name]
    if content is not None:
        (tmp_path / name).write_bytes(content)
    code, out, err = run(capsys, "analyze", tmp_path / name, "--fs", 1000)
    assert code == 2
    assert out == ""
    assert len(err.strip().splitlines()) == 1
    assert name in err
    assert [p.name for p in tmp_path.iterdir()] == ([name] if content is not None else [])


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("--fs", "0"), "above zero"),
        (("--fs", "-5"), "above zero"),
        (("--fs", "1000", "--speed-rpm", "-1"), "speed_rpm is -1"),
        (("--fs", "1000", "--speed-rpm", "600", "--tach-times", "x.csv"), "both given"),
        (("--fs", "1000", "--tach-times", "absent.csv"), "absent.csv"),
        (("--fs", "1000", "--rig", "absent.toml"), "absent.toml"),
    ],
)
def test_bad_options(capsys: pytest.CaptureFixture[str], tmp_path: Path, arguments: tuple[str, ...], text: str) -> None:
    path = csv(tmp_path, "a1\n" + "1\n2\n" * 500)
    code, _, err = run(capsys, "analyze", path, *arguments)
    assert code == 2
    assert text in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("pulses", ["", "0.5\n", "0.1\n0.2\n0.15\n0.3\n"], ids=["none", "one", "backwards"])
def test_bad_pulse_files(capsys: pytest.CaptureFixture[str], tmp_path: Path, pulses: str) -> None:
    path = csv(tmp_path, "a1\n" + "1\n2\n" * 500)
    times = csv(tmp_path, pulses, "pulses.csv")
    code, _, err = run(capsys, "analyze", path, "--fs", 1000, "--tach-times", times)
    assert code == 2
    assert len(err.strip().splitlines()) == 1
    assert "puls" in err


@pytest.mark.parametrize("n_pulses", [0, 1])
def test_a_tachometer_channel_without_pulses(capsys: pytest.CaptureFixture[str], tmp_path: Path, n_pulses: int) -> None:
    tacho = np.zeros(4000)
    tacho[1000 : 1000 + 20 * n_pulses] = 5.0
    values = np.random.default_rng(0).normal(size=len(tacho))
    path = csv(tmp_path, "a1,tacho\n" + "\n".join(f"{v:.4g},{p:g}" for v, p in zip(values, tacho, strict=True)))
    rig = csv(tmp_path, RIG + '[speed]\nsource = "tachometer"\nchannel = "tacho"\nshaft = "in"\n', "rig.toml")
    code, out, err = run(capsys, "analyze", path, "--fs", 1000, "--rig", rig)
    if n_pulses:
        assert code == 2
        assert "record.csv" in err
        assert "tacho" in err
        assert len(err.strip().splitlines()) == 1
    else:  # a machine at rest makes no pulses: no mistake of the user's, but no answer either
        assert code == 0
        assert "no pulses" in out


def test_a_folder_is_no_recording(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    code, _, err = run(capsys, "analyze", tmp_path)
    assert code == 2
    assert "folder" in err


def test_a_report_that_cannot_be_written(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    occupied = csv(tmp_path, "not a folder", "pages")
    code, _, err = run(capsys, "report", sample("healthy"), "-o", occupied)
    assert code == 2
    assert "pages" in err


def test_crack_against_a_reference_names_tooth_and_depth(capsys: pytest.CaptureFixture[str]) -> None:
    depths = []
    for depth in (1, 3):
        reference = ("--reference", sample("root_crack_0mm"))
        code, out, _ = run(capsys, "crack", sample(f"root_crack_{depth}mm"), *reference)
        assert code == 0
        assert "tooth 21 of stage 1/input" in out
        depths.append(float(re.findall(r"([\d.]+) mm \(", out)[0]))
    assert depths[0] == pytest.approx(1.0, abs=0.8)
    assert depths[1] == pytest.approx(3.0, abs=0.8)


@pytest.mark.parametrize("command", ["crack", "analyze"])
def test_a_reference_of_another_machine_is_named(capsys: pytest.CaptureFixture[str], command: str) -> None:
    code, out, err = run(capsys, command, sample("root_crack_3mm"), "--reference", sample("damaged_tooth"))
    assert (code, out) == (2, "")
    assert "another machine: its rig file says teeth 29/47, the recording's 55/75" in err


@pytest.mark.parametrize(
    ("option", "value", "text"),
    [("--torque", "-110Nm", "--torque is -110"), ("--torque", "0", "--torque is 0"), ("--tip-relief", "15mm", "0 to ")],
)
def test_impossible_loads_and_reliefs(capsys: pytest.CaptureFixture[str], option: str, value: str, text: str) -> None:
    code, _, err = run(capsys, "crack", sample("root_crack_3mm"), option, value)
    assert code == 2
    assert text in err


def test_the_file_without_a_tachometer_is_named_once(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    const = csv(tmp_path, "a1\n" + "1\n" * 2000, "const.csv")
    code, _, err = run(capsys, "analyze", sample("root_crack_3mm"), "--reference", const, "--fs", 12800)
    assert code == 2
    assert err.count("const.csv") == 1


@pytest.mark.slow
def test_a_reference_has_the_channels_and_the_speed_source_of_its_own_rig_file(
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The eccentric wheel has ch1 and a tachometer on ch2, its healthy machine a1 and one on tacho."""
    code, out, _ = run(capsys, "analyze", sample("eccentric_wheel"), "--reference", sample("healthy"))
    assert code == 0
    assert "Compared with healthy.h5." in out
    assert "Suspicion: Perhaps an eccentric, loose or damaged gear on shaft output." in " ".join(out.split())


def test_the_rate_of_a_reference_that_does_not_state_it_is_an_option(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    healthy = read_recording(sample("root_crack_0mm"))
    bare = tmp_path / "bare.csv"
    np.savetxt(bare, healthy.samples.T, delimiter=",", header=",".join(healthy.channel_names), comments="", fmt="%.9g")
    given = ("crack", sample("root_crack_3mm"), "--reference", bare)
    code, _, err = run(capsys, *given)
    assert code == 2
    assert "bare.csv: states no sampling rate (allowed: above 0 Hz); give --reference-fs or" in err
    code, out, _ = run(capsys, *given, "--reference-fs", 12800)
    assert (code, out) == (0, run(capsys, *given[:-1], sample("root_crack_0mm"))[1])


@pytest.mark.slow
def test_analyze_against_a_reference_names_the_crack_once(capsys: pytest.CaptureFixture[str]) -> None:
    reference = ("--reference", sample("root_crack_0mm"))
    code, out, _ = run(capsys, "analyze", sample("root_crack_4mm"), *reference, "--json")
    assert code == 0
    result = json.loads(out)
    faults = [f for f in result["findings"] if f["kind"] == "fault"]
    assert [f["where"]["tooth"] for f in faults] == [21]
    assert result["crack"]["depth_mm"] == pytest.approx(4.0, abs=0.8)
    assert any(f"{result['crack']['depth_mm']:.1f} mm" in text for text in (faults[0]["title"], *faults[0]["evidence"]))
    assert any(i["change_db"] is not None for i in result["indicators"])
    assert run(capsys, "analyze", sample("root_crack_1mm"), *reference)[1].count("tooth 21 of stage 1/input") == 2


def test_the_recording_itself_is_no_reference(capsys: pytest.CaptureFixture[str]) -> None:
    same = sample("root_crack_0mm")
    code, _, err = run(capsys, "analyze", same, "--reference", same)
    assert code == 2
    assert "itself" in err


@pytest.mark.slow
def test_report_with_a_reference_compares_all_but_itself(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    reference, cracked = sample("root_crack_0mm"), sample("root_crack_2mm")
    code, out, _ = run(capsys, "report", reference, cracked, "--reference", reference, "-o", tmp_path, "-j", 1)
    assert code == 0
    assert re.search(r"root_crack_2mm.h5: (Fault|Suspicion): .*tooth 21 of stage 1/input", out)
    page = (tmp_path / "root_crack_2mm.html").read_text()
    assert "The damaged tooth" in page
    assert "Compared with root_crack_0mm.h5" in page
    assert "The damaged tooth" not in (tmp_path / "root_crack_0mm.html").read_text()
    assert (tmp_path / "index.html").read_text().count("(the reference)") == 1


@pytest.mark.parametrize("n_done", [0, 1])
def test_an_interrupted_report_says_what_was_kept(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, n_done: int
) -> None:
    def interrupted(_files: list[Path], output: Path, *, on_progress: Callable[..., None], **_: object) -> None:
        output.mkdir()
        for number in range(n_done):
            (output / "page.html").touch()
            on_progress(number + 1, 2, None)
        raise KeyboardInterrupt

    monkeypatch.setattr("gearsig.batch.report_many", interrupted)
    code, _, err = run(capsys, "report", sample("healthy"), sample("run_up"), "-o", tmp_path / "pages")
    assert code == 130
    assert len(err.strip().splitlines()) == 1
    assert ("stopped after 1 of 2 files; pages in" if n_done else "stopped after 0 files; nothing was kept") in err
    assert (tmp_path / "pages").exists() == bool(n_done)


def test_report_with_pulse_times_is_of_one_recording(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    pulses = csv(tmp_path, "\n".join(f"{0.04 * k:.6f}" for k in range(1, 99)), "pulses.csv")
    both = sample("no_tachometer"), sample("healthy")
    code, _, err = run(capsys, "report", *both, "--tach-times", pulses, "-o", tmp_path / "pages")
    assert code == 2
    assert "one recording" in err
    code, _, _ = run(capsys, "report", both[0], "--tach-times", pulses, "-o", tmp_path / "pages", "-j", 1)
    assert code == 0
    assert "from tachometer pulses" in (tmp_path / "pages" / "no_tachometer.html").read_text()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (("analyze", "x.csv", "--nonsense"), "--nonsense"),
        (("analyze", "x.csv", "--fs", "fast"), "--fs"),
        (("analyze",), "recording"),
        (("analyse", "x.csv"), "analyze"),
        (("report", "x.csv"), "--output"),
        (("rig", "chek", "x"), "check"),
    ],
)
def test_wrong_options_are_one_line(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], text: str) -> None:
    code, out, err = run(capsys, *arguments)
    assert (code, out) == (2, "")
    assert err.startswith("gearsig: ")
    assert text in err
    assert "--help" in err
    assert len(err.strip().splitlines()) == 1


def test_without_a_command_the_help_is_shown(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys)
    assert code == 2
    assert "analyze" in out
    assert err == ""


def with_second_channel(stem: str, gain: float, path: Path) -> Path:
    """Write a sample with its first channel a second time, as a2, times a gain."""
    recording = read_recording(sample(stem))
    channels = (*recording.channels, replace(recording.channels[0], name="a2"))
    rows = np.vstack([recording.samples, gain * recording.samples[0]])
    return write_recording(replace(recording, samples=rows, channels=channels), path)


@pytest.mark.slow
def test_crack_leaves_a_dead_channel_out(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    now = with_second_channel("root_crack_3mm", 0.0, tmp_path / "now.h5")
    then = with_second_channel("root_crack_0mm", 1.0, tmp_path / "then.h5")
    rig = ("--rig", sample("root_crack_3mm").with_suffix(".toml"), "--reference", then)
    code, _, err = run(capsys, "crack", now, *rig)
    assert code == 2
    assert "channel 'a2' is dead" in err
    code, out, _ = run(capsys, "crack", now, *rig, "--channel", "a1", "--channel", "a1")
    assert code == 0
    reference = ("--reference", sample("root_crack_0mm"))
    assert out == run(capsys, "crack", sample("root_crack_3mm"), *reference)[1]
    answer = json.loads(run(capsys, "analyze", now, *rig, "--json")[1])["crack"]  # which leaves it out by itself
    assert answer["text"] in out


def test_crack_names_the_channels_there_are(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "crack", sample("root_crack_3mm"), "--channel", "a1", "--channel", "a 7")
    assert (code, out) == (2, "")
    assert "'a 7' is not an acceleration channel" in err
    assert "allowed: a1" in err


def test_crack_refuses_a_torque_in_millimetres(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "crack", sample("root_crack_3mm"), "--torque", "3mm")
    assert code == 2
    assert "give it in N m" in err


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("benchmark", "gap", "--seed", "-1", "-o", "b"), "seed"),
        (("sweep", "cracked", "--vary", "speed=300..1500rpm:1000000000", "-o", "s"), "100000"),
        (("bifurcation", "cracked", "--vary", "speed=300..1500rpm:1000000000", "-o", "s"), "100000"),
        (("gap", "x.csv", "--torque", "", "-o", "g"), "--torque"),
    ],
)
def test_numbers_that_no_run_could_serve_are_refused_at_once(
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    arguments: tuple[str, ...],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    code, out, err = run(capsys, *arguments)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert said in err
    assert not list(tmp_path.iterdir())


def test_effect_file_that_ends_the_program_is_an_error(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    file = tmp_path / "own.py"
    file.write_text("import sys\nsys.exit(0)\n")
    code, _, err = run(capsys, "gap", "--list-effects", "--effect-file", file)
    assert code == 2
    assert "SystemExit" in err


def test_name_that_is_no_utf8_does_not_end_a_report(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    good = sample("healthy")
    bad = tmp_path / "bad\udcff.csv"
    bad.write_text("time,a\n0,1\n1,2\n")
    code, _, err = run(capsys, "report", bad, good, "-o", tmp_path / "out", "-j", 1)
    assert code == 1
    assert "bad?.csv" in err
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "bad?.csv" in page
    assert good.name in page


def test_a_sampling_rate_may_be_in_kilohertz(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    path = csv(tmp_path, "a\n" + "\n".join(str(i % 7) for i in range(4096)) + "\n")
    code, out, _ = run(capsys, "show", "spectrum", path, "--fs", "2.56kHz", "--json")
    assert code == 0
    assert json.loads(out)["resolution"] == pytest.approx(2560 / 4096)
    code, _, err = run(capsys, "show", "spectrum", path, "--fs", "25.6k")
    assert code == 2
    assert "give it in Hz (or kHz, MHz)" in err


def test_a_misspelt_method_has_a_suggestion(capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run(capsys, "show", "spectrm", "x.csv")
    assert code == 2
    assert err.strip().endswith("did you mean spectrum?")


def dashboard_words() -> tuple[list[str], int]:
    """Return the command that starts a dashboard, and its port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    return [sys.executable, "-m", "app.cli.main", "dashboard", "--port", str(port), "--no-browser"], port


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C is sent to a group of processes")
def test_a_dashboard_compiles_its_code_at_the_first_start_and_says_only_where_it_is(tmp_path: Path) -> None:
    words, port = dashboard_words()
    home = {"HOME": str(tmp_path), "GEARSIG_CACHE": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "numba")}
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    for n_looks in (10, 1200):  # Ctrl-C at once, then when the code is compiled
        with subprocess.Popen(words, env=os.environ | home, start_new_session=True, **pipes) as server:
            assert server.stdout is not None
            said = server.stdout.readline()
            for _ in range(n_looks):
                if list(tmp_path.glob("compiled/*")):
                    break
                time.sleep(0.1)
            os.killpg(server.pid, signal.SIGINT)
            _, errors = server.communicate(timeout=60)
        assert f"http://localhost:{port} " in said
        assert errors == ""
    assert list(tmp_path.glob("compiled/*"))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="SIGTERM ends a process of Windows without asking it")
def test_a_dashboard_whose_output_nobody_reads_stops_when_it_is_told_to() -> None:
    words, port = dashboard_words()
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as server:
        assert server.stdout is not None
        server.stdout.readline()
        server.stdout.close()
        # It answers when all that is printed at its start is printed.
        with urllib.request.urlopen(f"http://localhost:{port}/_stcore/health", timeout=20) as answer:
            assert answer.status == 200
        server.terminate()
        try:
            assert server.wait(20) == 0
        finally:
            server.kill()


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="Linux' /proc is a folder that nobody can write to")
def test_a_demo_that_cannot_write_ends_before_its_work(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run(capsys, "demo", "-o", "/proc/report")
    assert (code, out) == (2, "")
    assert "-o" in err


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no device that is always full")
def test_output_to_a_full_disk_is_one_line_and_a_code() -> None:
    command = [sys.executable, "-c", "from app.cli.main import main; main(['rig', 'example'])"]
    with Path("/dev/full").open("w") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.splitlines() == [
        "gearsig: output cannot be written (No space left on device); make room on its disk"
    ]
