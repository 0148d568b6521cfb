"""Kurtogram, coherence, wavelet packets, ridges, crack severity and downloads on the page, without a browser."""

from __future__ import annotations

import csv
import io
import json
import re
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import state
from app.dashboard.methods import METHODS
from app.dashboard.methods.frame import OVER_TIME, Waveforms, recording_of, table_csv, waveforms_file
from gearsig.recording import read_recording
from tests.app.test_dashboard import SAMPLES, opened, shown_text, upload
from tests.app.test_dashboard_methods import TAB, choose, curves, opened_at, opened_machine

OUTER_RACE_HZ = 88.2
OFFERING = (
    *("Time–frequency", "Ridges", "Wavelet packets", "Kurtogram", "Cyclic coherence"),
    *("Orders (Vold–Kalman)", "Modes", "Denoising"),
)
"""Methods whose waveforms, spectra or maps can be taken along."""


def near(values: np.ndarray, at: np.ndarray, position: float, width: float) -> float:
    return float(values[np.abs(at - position) <= width].max())


def labelled(page: AppTest, kind: str, label: str):
    return next(w for w in page.get(kind) if w.label.startswith(label))


def charts(page: AppTest) -> list[dict]:
    return [json.loads(chart.proto.spec) for chart in page.get("plotly_chart")]


def numbers(values: dict | list) -> np.ndarray:
    """Return the numbers of a plotly trace, which may be packed."""
    if isinstance(values, dict):
        return np.frombuffer(b64decode(values["bdata"]), values["dtype"]).astype(float)
    return np.array(values, float)


def measured_line(page: AppTest) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of the measured line of the page's spectrum."""
    line = next(t for chart in charts(page) for t in chart["data"] if t.get("line", {}).get("width") == 1.1)
    return numbers(line["x"]), numbers(line["y"])


@pytest.mark.parametrize("preparation", ["As recorded", "Tones removed", "Whitened"])
def test_the_kurtogram_shows_the_bearing_in_its_own_band(preparation: str) -> None:
    page = choose(opened_at("Kurtogram", "outer_race"), "Signal", preparation)
    assert "The kurtogram's band: " in shown_text(page)
    at, values = measured_line(page)
    fault = float(at[at > 5][np.argmax(values[at > 5])])
    assert min(fault % OUTER_RACE_HZ, -fault % OUTER_RACE_HZ) < 1.0  # the race or a harmonic of it
    choose(page, "Envelope spectrum over", "Modulation order")
    assert not page.error


def test_the_user_may_choose_another_band() -> None:
    page = choose(opened_at("Kurtogram", "outer_race"), "Band", "My own")
    labelled(page, "slider", "Band of the envelope").set_value((1000.0, 1500.0)).run()
    assert not page.error
    assert "Your band: **1000 to 1500 Hz**" in shown_text(page)
    labelled(page, "number_input", "Highest modulation").set_value(1e9).run()
    assert len(page.error) == 1
    assert "the highest modulation is 1e+09 Hz" in shown_text(page)
    assert not page.exception


def test_bearing_lines_on_multiples_of_a_shaft_are_named_apart() -> None:
    page = opened_at("Cyclic coherence", "root_crack_3mm")
    apart = shown_text(page).split("multiple of a shaft's speed")[1].split(": ")[1]
    assert "BSF" in apart
    assert "1× input" not in apart


def test_waveforms_open_with_five_mesh_cycles() -> None:
    """The crack's pair has 55 teeth on a shaft of 8.3128 Hz."""
    for method in ("Denoising", "Wavelet packets", "Ridges", "Modes"):
        page = opened_at(method, "root_crack_3mm")
        low, high = labelled(page, "slider", "Waveforms shown").value
        assert (high - low) * 55 * 8.3128 == pytest.approx(5.0, rel=0.01), method


def test_modes_are_numbered_by_rising_centre() -> None:
    from app.dashboard.methods.modes import modes_of
    from gearsig.decompose import VmdSettings
    from gearsig.timefreq import UniformSignal

    t = np.arange(8000) / 1000.0
    x = np.cos(2 * np.pi * 300 * t) + 0.5 * np.cos(2 * np.pi * 60 * t)
    signal = UniformSignal(x, 1000.0, unit="g", source="a")
    modes = modes_of(signal, VmdSettings(2, 2000.0, start="peaks"))
    assert modes.by_centre() == (0, 1)
    assert modes.centres == pytest.approx([60.0, 300.0], abs=2.0)
    assert modes.rms == pytest.approx([0.5 / np.sqrt(2), 1 / np.sqrt(2)], rel=0.05)
    assert modes.centre_history[-1, 0] < modes.centre_history[-1, 1]


def test_coherence_names_the_lines_that_stand_out() -> None:
    page = opened_at("Cyclic coherence", "outer_race")
    at, values = measured_line(page)
    assert near(values, at, OUTER_RACE_HZ, 1.0) > 0.3
    assert "stand above noise's level" in shown_text(page)
    named = shown_text(page).split("for their slip: ")[1].split("Bearing lines whose peak")[0]
    assert "BPFO bearing" in named
    assert "not that there is damage" in shown_text(page)
    choose(page, "Over", "Cyclic order")
    assert not page.error
    labelled(page, "number_input", "Highest cyclic order").set_value(1e9).run()
    assert len(page.error) == 1
    assert not page.exception


def test_wavelet_packets_share_the_energy_and_add_up_to_the_signal() -> None:
    page = opened_at("Wavelet packets")
    shares = numbers(charts(page)[0]["data"][0]["y"])
    assert shares.sum() == pytest.approx(100.0)
    nodes = labelled(page, "multiselect", "Waveform of the nodes")
    nodes.set_value(list(range(16))).run()
    shown = curves(page)
    whole = next(values for name, values in shown.items() if name.startswith("nodes"))
    np.testing.assert_allclose(whole, shown["signal"], atol=1e-9)
    for ordering in ("filter tree", "energy"):
        choose(page, "Order of the nodes", ordering)
        assert not page.error
    labelled(page, "multiselect", "Waveform of the nodes").set_value([]).run()
    assert len(page.error) == 1


@pytest.mark.parametrize("transform", ["Fourier", "Wavelet", "Squeezed Fourier", "Squeezed wavelet"])
def test_a_ridge_has_the_frequency_and_amplitude_that_was_put_in(transform: str) -> None:
    """The machine's order 5 has 50 Hz and an amplitude of 3."""
    page = choose(opened_machine("Ridges"), "Transform", transform)
    labelled(page, "slider", "Ridges").set_value(1).run()
    assert not page.error, shown_text(page)
    frequency, amplitude = (numbers(chart["data"][0]["y"]) for chart in charts(page)[:2])
    middle = slice(len(frequency) // 4, -len(frequency) // 4)
    assert np.median(frequency[middle]) == pytest.approx(50.0, abs=3.0)
    assert 2.0 < np.median(amplitude[middle]) < 4.2  # with its neighbour of 55 Hz and amplitude 1
    choose(page, "Over", "Shaft angle")
    assert not page.error


def test_component_and_rest_make_the_signal() -> None:
    page = opened_machine("Ridges")
    labelled(page, "slider", "Ridges").set_value(1).run()
    shown = curves(page)
    together = shown["component 1"] + shown["residual without all of them"]
    np.testing.assert_allclose(together, shown["signal"], atol=1e-6)


def test_the_depth_of_a_crack_against_the_sound_sample() -> None:
    page = opened_at("Crack severity", "root_crack_3mm")
    assert "give a reference" in shown_text(page)
    choose(page, "Reference", "Sample")
    assert len(page.error) == 1
    assert "tooth 21" in page.error[0].value
    interval = re.search(r"\*\*([\d.]+) to ([\d.]+) mm\*\*", shown_text(page))
    assert interval is not None
    low, high = (float(text) for text in interval.groups())
    assert low <= 3.0 <= high
    assert len(page.get("image")) == 1


def test_the_reference_may_be_an_own_file() -> None:
    page = choose(opened_at("Crack severity", "root_crack_3mm"), "Reference", "Own file")
    sound = SAMPLES["root_crack_0mm"].recording
    uploader = next(w for w in page.file_uploader if w.label == "Recording of the healthy gears")
    uploader.upload(sound.name, sound.read_bytes())
    page.run()
    assert "tooth 21" in page.error[0].value


def test_the_torque_of_a_crack_is_stated_in_one_place() -> None:
    page = choose(opened_at("Crack severity", "root_crack_3mm"), "Reference", "Sample")
    assert "Torque 110 N·m, of the rig" in shown_text(page)
    at_110 = page.error[0].value
    (torque,) = (w for w in page.number_input if w.label.startswith("Torque"))
    torque.set_value(60.0).run()
    assert "Torque 60 N·m, as stated in the sidebar" in shown_text(page)
    assert not page.error or page.error[0].value != at_110  # a crack's effect grows with the load


def test_what_crack_severity_cannot_tell_is_said() -> None:
    page = opened_at("Crack severity", "two_stage")
    assert not page.error
    assert "The depth cannot be told" in shown_text(page)
    assert "What would help" in shown_text(page)


def some_waveforms(axis: str = "frequency") -> Waveforms:
    rng = np.random.default_rng(2)
    columns = {"1× mesh, (29)": rng.normal(size=3000).astype(np.float32).astype(float), "rest": np.zeros(3000)}
    return Waveforms(columns, 1000.0, 2.0, "m/s^2", "acceleration", "orders", axis, "input")


@pytest.mark.parametrize("ending", OVER_TIME)
def test_waveforms_come_back_from_every_format(ending: str, tmp_path) -> None:
    kept = some_waveforms()
    path = tmp_path / f"kept{ending}"
    path.write_bytes(waveforms_file(kept, ending))
    found, put_in = read_recording(path), recording_of(kept)
    assert found.channels == put_in.channels
    assert found.sampling_rate_hz == 1000.0
    np.testing.assert_array_equal(found.samples, put_in.samples)
    assert "orders" in found.provenance.history[0]


def test_waveforms_over_angle_are_columns() -> None:
    kept = replace(some_waveforms("order"), rate=64.0)
    rows = list(csv.reader(io.StringIO(waveforms_file(kept, ".csv").decode())))
    assert rows[0] == ["angle (revolutions of input)", *kept.columns]
    assert len(rows) == 3001
    assert float(rows[1][0]) == 2.0
    assert float(rows[65][0]) == 3.0
    assert float(rows[7][1]) == kept.columns["1× mesh, (29)"][6]


def test_names_that_hold_separators_stay_one_column() -> None:
    rows = list(csv.reader(io.StringIO(table_csv({'a,"b"\nc': [1.5], "d": ["x;y"]}).decode())))
    assert rows == [['a,"b"\nc', "d"], ["1.5", "x;y"]]


@pytest.mark.parametrize("method", OFFERING)
def test_every_method_offers_what_it_shows(method: str) -> None:
    page = opened_machine(method)
    assert not page.error, shown_text(page)
    assert len(page.get("download_button")) >= 1


@pytest.mark.parametrize("stretch_s", [(0.0, 0.0), (2.0, 2.05)])
def test_a_stretch_that_is_too_short_is_at_most_one_message(stretch_s: tuple[float, float]) -> None:
    page = opened_at("Time–frequency")
    for method in METHODS:
        choose(page, "Method", method)
        sliders = [s for s in page.slider if s.label.startswith("Segment")]
        if sliders:
            sliders[0].set_value(stretch_s).run()
        assert not page.exception, method
        assert len(page.error) <= 1, method


def test_a_short_recording_is_at_most_one_message_in_every_method() -> None:
    rows = "\n".join(f"{i / 1000:g};{(i * 37) % 101}" for i in range(700))
    page = upload(opened(), "short.csv", f"time (s);a1\n{rows}\n".encode())
    page.session_state[state.TAB] = TAB
    page.run()
    for method in METHODS:
        choose(page, "Method", method)
        assert len(page.error) <= 1, method


def test_numbers_that_are_none_are_refused_when_the_file_is_read() -> None:
    rows = "\n".join(f"{i / 1000:g};{'nan' if i == 900 else (i * 37) % 101}" for i in range(3000))
    page = upload(opened(), "holes.csv", f"time (s);a1\n{rows}\n".encode())
    assert not page.exception
    assert len(page.error) == 1
    assert "What to do" in shown_text(page)
