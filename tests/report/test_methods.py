"""Methods by name: figure, table and arrays of one channel, and which of them a recording calls for."""

import json
from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pytest

from app.cli.main import main
from gearsig.diagnosis import CHANGED, CannotTell, Finding, Kind, Where, analyze
from gearsig.errors import InputError, RefusalError
from gearsig.methods import METHODS, apply_method, suggested_rate_hz
from gearsig.prepared import prepare
from gearsig.recording import Channel, Recording, write_recording
from gearsig.report import answer_json, fitting_methods, named_method, write_answer
from gearsig.rig import Bearing, ConstantSpeed, GearPair, Rig, Shaft
from tests.marks import further
from tests.motion.test_transmission_error import recording as encoders_of_both_shafts

RATE_HZ, N = 8192.0, 16384
T = np.arange(N) / RATE_HZ
RIG = Rig(
    "pair",
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage 1", "input", "output", 20, 40),),
    speed=ConstantSpeed(1500.0),
)
OF_EACH_KIND = ("spectrum", "average", "order-map", "kurtogram", "ridges", "modes", "poincare", "recurrence", "motion")
"""Methods whose answers differ in kind: lines, maps, places, portraits, tables."""


def recording(seed: int = 0) -> Recording:
    """A tone of 3 at the mesh, 500 Hz, and bursts at 2 kHz ten times a second, in noise of 0.1."""
    noise = np.random.default_rng(seed).normal(size=N)
    bursts = 8.0 * np.exp(-((T % 0.1) * 600.0)) * np.sin(2 * np.pi * 2000.0 * (T % 0.1))
    x = 3.0 * np.cos(2 * np.pi * 500.0 * T) + bursts + 0.1 * noise
    return Recording(x[None], RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),), speed=ConstantSpeed(1500.0), rig=RIG)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name if name in OF_EACH_KIND else further(name) for name in METHODS])
def test_each_method_writes_figure_table_arrays_and_numbers(name, tmp_path) -> None:
    recorded = encoders_of_both_shafts() if name == "transmission-error" else recording()
    answer = apply_method(name, recorded, **({"n_modes": 3} if name == "modes" else {}))
    png, svg, csv, h5, numbers = write_answer(answer, tmp_path)
    assert png.stat().st_size > 5_000
    assert svg.read_text(encoding="utf-8").lstrip().startswith("<?xml")
    frame = pd.read_csv(csv)
    assert len(frame) > 0
    with h5py.File(h5) as file:
        for title, column in answer.table.items():
            kept = file["table"][title.replace("/", "∕")][()]
            assert len(kept) == len(frame)
            if np.asarray(column).dtype.kind == "f":
                assert frame[title].to_numpy() == pytest.approx(kept, rel=1e-8, nan_ok=True)
        for matrix in answer.matrices:
            assert file["matrices"][matrix].ndim == 2
    about = json.loads(numbers.read_text(encoding="utf-8"))
    assert (about["method"], about["channel"]) == (name, answer.channel)


def test_transmission_error_is_parted_into_mesh_and_gears_and_asks_for_two_encoders() -> None:
    answer = apply_method("transmission-error", encoders_of_both_shafts())
    assert answer.numbers["peak_to_peak_um"]["driver"] == pytest.approx(4.0, abs=0.1)  # one tooth by so much
    assert answer.numbers["peak_to_peak_um"]["driven gear"] == pytest.approx(10.0, abs=0.1)  # order 1 of 5 µm
    assert len(answer.panels) == len(answer.tables) == 3
    without = replace(recording(), rig=encoders_of_both_shafts().rig, speed=None)
    with pytest.raises(RefusalError, match="encoder"):
        apply_method("transmission-error", without)


def test_the_kurtograms_outline_frames_the_row_of_its_band() -> None:
    answer = apply_method("kurtogram", recording())
    panel, (low_hz, high_hz) = answer.panels[0], answer.numbers["band_hz"]
    assert (panel.y, panel.logarithmic) == ("bandwidth (Hz)", True)
    x, y = panel.lines[0].x, panel.lines[0].y
    assert (x.min(), x.max()) == pytest.approx((low_hz, high_hz))
    # Lines of the map are drawn equally high, the first from the first position upwards.
    n = len(panel.positions)
    share = (np.arange(n) + 0.5) / n
    drawn_at = panel.positions[0] * (panel.positions[-1] / panel.positions[0]) ** share
    across = (panel.at > low_hz) & (panel.at < high_hz)
    inside = panel.levels[(drawn_at > y.min()) & (drawn_at < y.max())][:, across]
    assert inside.size
    assert inside == pytest.approx(np.full(inside.shape, answer.numbers["kurtosis"]))
    for beside in (panel.levels[drawn_at < y.min()][-1, across], panel.levels[drawn_at > y.max()][0, across]):
        assert not np.allclose(beside, answer.numbers["kurtosis"])


def test_the_kurtogram_lies_the_same_way_in_figure_and_page() -> None:
    """Frequency to the right, bandwidth upwards: the widest band on top."""
    answer = apply_method("kurtogram", recording())
    panel, axes = answer.panels[0], answer.draw().axes[0]
    assert (axes.get_xlabel(), axes.get_ylabel()) == (panel.x, panel.y) == ("frequency (Hz)", "bandwidth (Hz)")
    widths_hz = [float(label.get_text()) for label in axes.get_yticklabels()]
    upwards = widths_hz if axes.get_ylim()[0] < axes.get_ylim()[1] else widths_hz[::-1]
    assert upwards == sorted(upwards)
    assert upwards[-1] == pytest.approx(RATE_HZ / 2)
    assert np.all(np.diff(panel.positions) > 0)


def test_modes_show_the_waveform_that_their_text_speaks_of() -> None:
    answer = apply_method("modes", recording(), n_modes=3)
    number = answer.numbers["chosen_mode"]
    assert number > 1
    assert f"Mode **{number}** is the most impulsive" in answer.facts[0]
    assert answer.waveforms.shown_first.startswith(f"mode {number},")
    asked = apply_method("modes", recording(), n_modes=3, mode=1)
    assert asked.waveforms.shown_first.startswith("mode 1,")


def where_from(analysis, *findings: Finding, **changes) -> float | None:
    return suggested_rate_hz(replace(analysis, findings=findings, **changes))


def test_impacts_are_sought_at_the_rate_that_was_found_or_is_described() -> None:
    """At 25 Hz; the 6205 on the output, which turns half as fast, has an outer race at 3.585 times its speed."""
    rig = replace(RIG, bearings=(Bearing("drive end", "output", bearing="6205"),))
    analysis = analyze(replace(recording(), rig=rig))
    impacts = Where(("a1",), order=3.2, frequency_hz=80.0, band_hz=(1000.0, 2000.0))
    tooth = Where(("a1",), shaft="output", gear="stage 1/output", tooth=3)
    found = Finding("impacts", Kind.SUSPICION, "", impacts)
    changed = Finding(CHANGED, Kind.SUSPICION, "", replace(impacts, frequency_hz=81.0))
    assert where_from(analysis, changed, found) == 80.0
    assert where_from(analysis, Finding("tooth", Kind.FAULT, "", tooth)) == pytest.approx(12.5, rel=1e-3)
    assert where_from(analysis) == pytest.approx(12.5 * 3.5848, rel=1e-3)
    assert where_from(analysis, rig=None) == pytest.approx(25.0, rel=1e-3)
    assert where_from(analysis, rig=None, shaft_angle=CannotTell("speed", "unknown")) is None


def test_a_rate_that_nothing_tells_is_said_to_be_assumed() -> None:
    noise = Recording(np.random.default_rng(1).normal(size=(1, N)), RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),))
    assumed = apply_method("deconvolution", noise)
    assert "100 impacts per second are assumed" in assumed.warnings[0]
    assert "at 100 Hz is **no clearer than in white noise**" in assumed.facts[0]
    described = apply_method("deconvolution", recording(), rate_hz=25.0)
    assert not described.warnings
    assert "at 25 Hz is" in described.facts[0]
    assert any("1× input" in note for note in described.notes)
    assert described.waveforms.first_length == pytest.approx(0.2)  # five impacts


def test_an_envelope_has_plain_numbers_and_the_lines_of_bearings() -> None:
    rig = replace(RIG, bearings=(Bearing("drive end", "input", bearing="6205"),))
    answer = apply_method("envelope", replace(recording(), rig=rig), band_hz=(1000.4, 4000.0))
    assert answer.caption == "spectrum of the squared envelope of 1000 to 4000 Hz"
    fast = replace(recording(), sampling_rate_hz=65536.0, rig=None)
    answer = apply_method("envelope", fast, band_hz=(12_207.03, 16_276.04))
    assert answer.caption == "spectrum of the squared envelope of 12207 to 16276 Hz"
    labels = [c.label for c in apply_method("envelope", replace(recording(), rig=rig)).panels[0].cursors]
    assert {"BPFO", "2× BPFO", "3× BPFO", "1× input"} <= set(labels)
    assert not any("mesh" in label for label in labels)


@pytest.mark.parametrize("name", METHODS)
def test_each_method_is_a_command_that_hands_its_options_on(name, tmp_path, monkeypatch, capsys) -> None:
    path = tmp_path / "bursts.h5"
    write_recording(recording(), path)
    handed: dict[str, object] = {}

    def answer(asked, /, *_args, **given):
        handed.update(given, asked=asked)
        return apply_method("waveform", recording())

    monkeypatch.setattr("gearsig.methods.apply_method_to_file", answer)
    with pytest.raises(SystemExit) as ended:
        main(["show", name, str(path), "--json"])
    assert not ended.value.code
    assert json.loads(capsys.readouterr().out)["channel"] == "a1"
    assert handed["asked"] == name
    assert {option.name for option in METHODS[name].options} <= set(handed)


def test_the_cepstrum_peaks_at_the_period_of_a_family() -> None:
    answer = apply_method("cepstrum", recording())
    table = pd.DataFrame(answer.table)
    top = table.loc[table.iloc[:, 1].idxmax()].iloc[0]
    assert top == pytest.approx(0.1, rel=0.01)  # bursts ten times a second
    turns = {cursor.label: cursor.position for cursor in answer.panels[0].cursors}
    assert turns["period of input"] == pytest.approx(0.04)
    assert turns["period of output"] == pytest.approx(0.08)
    assert "removed as noise" not in "".join(apply_method("denoising", recording()).warnings)


def test_a_signal_of_lines_that_denoising_takes_away_is_said() -> None:
    lines = replace(recording(), samples=np.cos(2 * np.pi * 3000.0 * T)[None])
    of_finest = apply_method("denoising", lines, noise="finest level")
    assert "removed as noise" in "".join(of_finest.warnings)


def test_the_spectrum_reads_the_tone_and_the_map_its_order() -> None:
    spectrum = pd.DataFrame(apply_method("spectrum", recording()).table)
    top = spectrum.loc[spectrum.iloc[:, 1].idxmax()]
    assert tuple(top) == pytest.approx((500.0, 3.0), rel=0.01)
    levels = apply_method("order-map", recording())
    titles = list(levels.table)
    assert titles[:3] == ["time (s)", "speed (rpm)", "order 0 (m/s²)"]
    about = json.loads(answer_json(levels))
    assert (about["n_columns"], about["columns"]) == (len(titles), titles[:40])
    orders, mean = levels.axes["order"], levels.matrices["levels"].mean(axis=0)
    assert orders[np.argmax(mean)] == pytest.approx(20.0, abs=0.1)  # 20 teeth
    tracked = apply_method("tracking", recording(), orders=(20.0,)).table
    amplitude = next(v for k, v in tracked.items() if "amplitude" in k)
    assert np.median(amplitude) == pytest.approx(3.0, rel=0.02)


def test_the_envelope_of_a_band_shows_the_rhythm_of_bursts() -> None:
    answer = apply_method("envelope", recording(), band_hz=(1500.0, 2500.0), highest=100.0)
    hz, level = answer.table.values()
    assert hz[1:][np.argmax(level[1:])] % 10.0 == pytest.approx(0.0, abs=0.6)


def test_the_most_impulsive_mode_goes_on_to_the_squeezed_transform() -> None:
    answer = apply_method("modes", recording(), n_modes=3, then="squeezed-cwt")
    centre = answer.numbers["centres"][answer.numbers["chosen_mode"] - 1]
    assert centre == pytest.approx(2000.0, rel=0.06)
    assert max(answer.numbers["kurtosis"]) == answer.numbers["kurtosis"][answer.numbers["chosen_mode"] - 1]
    lines = next(v for k, v in answer.axes.items() if k.startswith("frequency"))
    power = np.square(answer.matrices["levels"]).sum(axis=0)
    assert np.sum(lines * power) / np.sum(power) == pytest.approx(2000.0, rel=0.1)
    tone = apply_method("modes", recording(), n_modes=3, then="squeezed-cwt", mode=1)
    levels, at = tone.matrices["levels"], next(v for k, v in tone.axes.items() if k.startswith("frequency"))
    assert at[np.argmax(np.square(levels).sum(axis=0))] == pytest.approx(500.0, rel=0.03)


def test_options_of_other_methods_wrong_names_and_missing_speeds_are_refused() -> None:
    with pytest.raises(InputError, match="envelope"):
        apply_method("spectrum", recording(), band_hz=(1.0, 2.0))
    with pytest.raises(InputError, match="order-map"):
        apply_method("ordermap", recording())
    with pytest.raises(InputError, match="1 to 3"):
        apply_method("modes", recording(), n_modes=3, mode=4)
    with pytest.raises(InputError, match="cannot be followed by a transform"):
        named_method("kurtogram+cwt")
    still = Recording(recording().samples, RATE_HZ, recording().channels)
    with pytest.raises((InputError, RefusalError)):
        apply_method("poincare", still)


def test_a_run_up_calls_for_a_map_over_frequency_a_suspected_tooth_for_modes() -> None:
    assert fitting_methods(recording(), None, suspects_crack=True) == ("modes+squeezed-cwt",)
    assert fitting_methods(recording(), None, suspects_bearing=True) == ("kurtogram",)
    assert fitting_methods(recording(), None) == ()
    sample = "sample_data/run_up.h5"
    from gearsig.recording import read_recording
    from gearsig.rig import read_rig

    run_up = read_recording(sample, rig=read_rig("sample_data/run_up.toml"))
    assert fitting_methods(run_up, prepare(run_up).shaft_angle) == ("frequency-map",)


def test_the_command_writes_what_the_method_finds(tmp_path, capsys) -> None:
    path = tmp_path / "a.h5"
    write_recording(recording(), path)
    with pytest.raises(SystemExit) as ended:
        main(["show", "spectrum", str(path), "--highest", "1000", "-o", str(tmp_path / "out")])
    assert not ended.value.code
    frame = pd.read_csv(tmp_path / "out" / "spectrum.csv")
    assert frame.iloc[:, 0].max() <= 1000.0
    with pytest.raises(SystemExit) as ended:
        main(["modes", str(path), "--n-modes", "3", "--then", "squeezed-cwt", "--json"])
    assert not ended.value.code
    printed = capsys.readouterr().out
    assert json.loads(printed[printed.index("{") :])["method"] == "modes"


@pytest.mark.parametrize("most_bytes", [0, 30_000, 200_000])
def test_a_full_disk_is_said_and_no_file_of_an_answer_is_half_written(most_bytes, tmp_path) -> None:
    resource = pytest.importorskip("resource")
    answer = apply_method("waveform", recording())
    whole = {path.name: path.stat().st_size for path in write_answer(answer, tmp_path / "whole")}
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, before[1]))  # as if no more room were left
    try:
        with pytest.raises(InputError, match="cannot be written"):
            write_answer(answer, tmp_path / "full")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert all(path.stat().st_size == whole[path.name] for path in (tmp_path / "full").iterdir())
