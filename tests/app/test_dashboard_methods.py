"""The further methods of the analysis page, run without a browser."""

from __future__ import annotations

import csv
import io
import re
from base64 import b64decode
from dataclasses import replace

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import state
from app.dashboard.widgets.method import OVER_TIME, table_csv, waveforms_file
from gearsig.methods import METHODS, TRANSFORMS, Waveforms, by_centre
from gearsig.recording import read_recording
from tests.app.pages import (
    choose,
    curves,
    figures,
    go,
    labelled,
    machine,
    numbers,
    opened_at,
    opened_file,
    opened_machine,
    pictures,
    shown_text,
    view_of,
)

OUTER_RACE_HZ = 88.2
METHOD = "Denoising"
PAGES = [method.title for method in METHODS.values() if method.view]
SLOW = ("Kind of motion", "Recurrence", "0–1 test", "Lyapunov exponent", "Portrait and section")
"""They draw on the same embedding as "Delay and dimension"."""


@pytest.mark.parametrize("sample", ["run_up", pytest.param("two_stage", marks=pytest.mark.slow), "no_tachometer"])
def test_every_method_answers_for_samples_of_every_kind_and_offers_what_it_shows(sample: str) -> None:
    page = opened_at("Time–frequency", sample)
    for method in (*(name for name in PAGES if name not in SLOW), "Crack severity"):
        go(page, method)
        assert not page.error, shown_text(page)
        drawn = len(figures(page)) + len(page.get("plotly_chart")) + len(pictures(page))
        told = method == "Crack severity" and len(page.info) + len(page.success) == 1
        assert drawn > 0 or told
        assert "Analysed: 0 to" in shown_text(page)
        assert method == "Crack severity" or len(page.get("download_button")) >= 1, method


def test_every_method_of_the_table_has_its_page_and_its_command(capsys: pytest.CaptureFixture[str]) -> None:
    """One row of the table is a page under a view and a command with the same options."""
    from app.cli.main import main
    from app.dashboard.analysis import OF_CHANNEL

    pages = {title for methods in OF_CHANNEL.values() for title in methods}
    assert set(PAGES) <= pages
    for name in ("coherence", "modes"):
        with pytest.raises(SystemExit):
            main(["show", name, "--help"])
        told = capsys.readouterr().out.replace("_", "-")
        for option in METHODS[name].options:
            assert f"--{option.name.removesuffix('_hz').replace('_', '-')}"[:18] in told


DEAD = "time (s);a1;a2\n" + "\n".join(f"{i / 1000:g};1.5;{(i * 37) % 101}" for i in range(3000))
SHORT = "time (s);a1\n" + "\n".join(f"{i / 1000:g};{(i * 37) % 101}" for i in range(700))


@pytest.mark.slow
@pytest.mark.parametrize("content", [DEAD, SHORT], ids=["constant channel", "short recording"])
def test_what_cannot_be_analysed_is_at_most_one_message_in_every_method(content: str) -> None:
    page = opened_file("bad.csv", f"{content}\n".encode(), tab=view_of(METHOD))
    assert not page.exception
    for method in PAGES:
        go(page, method)
        assert len(page.error) <= 1, method


@pytest.mark.slow
def test_names_are_shown_as_typed_and_a_segment_too_short_is_at_most_one_message_in_every_method() -> None:
    content, rig = machine()
    names = ("<script>alert(1)</script>", "**x** $y$ :smile:")
    rig = rig.replace('"input"', f'"{names[1]}"').replace('"a1"', f'"{names[0]}"')
    page = opened_file("names.csv", content.replace(b";a1", f";{names[0]}".encode()), rig, tab=view_of(METHOD))
    for method in PAGES:
        go(page, method)
        messages = [*page.error, *page.info]
        assert len(messages) <= (view_of(method) == "Phase"), (method, shown_text(page))
        raw = "\n".join(part.value for part in [*page.markdown, *page.caption, *page.info, *page.warning])
        for markup in ("<script", "**x**", "$y$", ":smile:"):
            assert not re.search(r"(?<!\\)" + re.escape(markup), raw), (method, markup)
        assert all("<script" not in chart.proto.spec for chart in page.get("plotly_chart"))
        sliders = [s for s in page.slider if s.label.startswith("Segment")]
        for limits_s in ((2.0, 2.05), (0.0, 0.0)) if sliders else ():
            next(s for s in page.slider if s.label.startswith("Segment")).set_value(limits_s).run()
            assert not page.exception, method
            assert len([*page.error, *page.info]) <= 1, method


@pytest.mark.slow
def test_modes_open_with_the_waveform_that_the_text_speaks_of_and_notes_are_a_list() -> None:
    page = opened_at("Modes", "root_crack_3mm")
    number = re.search(r"Mode \*\*(\d+)\*\* is the most impulsive", shown_text(page))[1]
    assert labelled(page, "selectbox", "Waveform of").value.startswith(f"mode {number},")
    notes = next(caption.value for caption in page.caption if "Vertical lines" in caption.value)
    assert all(line.startswith("- ") for line in notes.splitlines())
    assert len(notes.splitlines()) > 1


@pytest.mark.slow
def test_deconvolution_opens_at_the_rate_that_the_analysis_found() -> None:
    page = opened_at("Deconvolution", "two_stage")
    rate = labelled(page, "number_input", "Impacts per second")
    assert rate.value == pytest.approx(73.703, rel=1e-3)
    assert "BPFI intermediate drive end" in shown_text(page)


def test_waveforms_open_with_five_mesh_cycles() -> None:
    """The crack's pair has 55 teeth on a shaft of 8.3128 Hz."""
    page = opened_at("Denoising", "root_crack_3mm")
    for method in ("Denoising", "Modes"):  # the others draw as denoising does
        go(page, method)
        low, high = labelled(page, "slider", "Waveforms shown").value
        assert (high - low) * 55 * 8.3128 == pytest.approx(5.0, rel=0.01), method


@pytest.mark.parametrize(
    ("method", "engine"), [("Modes", "vmdpy"), pytest.param("Ridges", "ssqueezepy", marks=pytest.mark.slow)]
)
def test_other_engines_answer_for_short_segments(method: str, engine: str) -> None:
    pytest.importorskip(engine)
    page = opened_machine("Denoising")
    go(page, method)
    labelled(page, "slider", "Segment").set_value((0.0, 1.0)).run()
    choose(page, "Engine" if method == "Modes" else "Engine of squeezed transforms", engine)
    assert not page.error, shown_text(page)
    assert len(figures(page)) >= 3


@pytest.mark.slow
def test_a_ridge_has_the_frequency_and_amplitude_that_was_put_in() -> None:
    """The machine's order 5 has 50 Hz and an amplitude of 3."""
    page = opened_machine("Ridges")
    labelled(page, "select_slider", "Ridges").set_value(1).run()
    shown = curves(page)
    together = shown["component 1"] + shown["residual without all of them"]
    np.testing.assert_allclose(together, shown["signal"], atol=1e-6)
    for transform in TRANSFORMS:
        labelled(page, "selectbox", "Transform").set_value(transform).run()
        assert not page.error, shown_text(page)
        frequency, amplitude = (numbers(figure["lines"][0]["y"]) for figure in figures(page)[1:3])
        middle = slice(len(frequency) // 4, -len(frequency) // 4)
        assert np.median(frequency[middle]) == pytest.approx(50.0, abs=3.0)
        assert 2.0 < np.median(amplitude[middle]) < 4.2  # with its neighbour of 55 Hz and amplitude 1
    choose(page, "Over", "Shaft angle")
    assert not page.error


@pytest.mark.parametrize(("quantity", "n_errors"), [("sound_pressure", 1), ("unknown", 0), ("displacement", 0)])
def test_a_channel_that_is_no_motion_is_one_message(quantity: str, n_errors: int) -> None:
    assert len(opened_machine("Phase plane", quantity=quantity).error) == n_errors


@pytest.mark.slow
def test_the_depth_of_a_crack_against_the_healthy_sample_at_the_torque_that_is_stated() -> None:
    page = opened_at("Crack severity", "root_crack_3mm")
    next(w for w in page.sidebar.selectbox if w.label.startswith("Compared")).set_value("None").run()
    assert "give a reference" in shown_text(page)
    next(w for w in page.sidebar.selectbox if w.label.startswith("Compared")).set_value("No crack").run()
    assert len(page.error) == 1
    at_110 = page.error[0].value
    assert "tooth 21" in at_110
    assert "Torque 110 N·m, from the rig" in shown_text(page)
    interval = re.search(r"\*\*([\d.]+) to ([\d.]+) mm\*\*", shown_text(page))
    assert interval is not None
    low, high = (float(text) for text in interval.groups())
    assert low <= 3.0 <= high
    assert [bool(figure["x"]) for figure in figures(page)] == [True] * 4
    (torque,) = (w for w in page.number_input if w.label.startswith("Torque"))
    torque.set_value(60.0).run()
    assert "Torque 60 N·m, as stated in the sidebar" in shown_text(page)
    assert not page.error or page.error[0].value != at_110  # a crack's effect grows with the load


def test_only_the_chosen_method_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise AssertionError

    for name, method in METHODS.items():
        if name != "time-frequency":
            monkeypatch.setitem(METHODS, name, replace(method, answer=fail))
    page = opened_at("Time–frequency")
    assert not page.exception
    for tab in ("Spectrum", "Channels"):
        monkeypatch.setitem(METHODS, "time-frequency", replace(METHODS["time-frequency"], answer=fail))
        page.session_state[state.TAB] = tab
        page.run()
        assert not page.exception


@pytest.mark.slow
def test_every_transform_draws_its_map_and_zooming_is_of_its_own_lines() -> None:
    page = opened_machine("Time–frequency")
    for over, chosen in (("Time", TRANSFORMS), ("Shaft angle", TRANSFORMS[1:2])):
        choose(page, "Over", over)
        for transform in chosen:
            labelled(page, "selectbox", "Transform").set_value(transform).run()
            assert not page.error
            (figure,) = figures(page)
            assert figure["map"]["rows"] > 10
    labelled(page, "number_input", "Highest line").set_value(20.0).run()
    assert not page.error
    assert figures(page)[0]["map"]["limits"][1] <= 20.5


def test_a_segment_of_a_recording_is_what_is_analysed() -> None:
    page = opened_at("Time–frequency")
    next(s for s in page.slider if s.label.startswith("Segment")).set_value((1.0, 2.0)).run()
    assert not page.error
    assert "Analysed: 1 to 2 s of 5 s, 12800 samples" in shown_text(page)


def test_orders_have_the_amplitudes_that_were_put_in() -> None:
    page = opened_machine("Orders (Vold–Kalman)")
    page.multiselect[0].set_value(["5", "5.5"]).run()
    assert not page.error, shown_text(page)
    for name, amplitude in (("5", 3.0), ("5.5", 1.0)):
        middle = curves(page)[name]
        middle = middle[len(middle) // 4 : -len(middle) // 4]
        np.testing.assert_allclose(middle, amplitude, rtol=0.03)
    assert np.abs(curves(page)["residual without all chosen orders"]).max() < 0.5
    labelled(page, "selectbox", "Waveform of").set_value("5.5").run()
    choose(page, "Levels over", "Speed")
    assert not page.error


@pytest.mark.slow
def test_orders_that_make_no_sense_are_one_message() -> None:
    page = opened_machine("Orders (Vold–Kalman)")
    for orders in (["five"], ["5", "5.0"], ["-2"], ["1e9"], ["nan"]):
        page.multiselect[0].set_value(orders).run()
        assert not page.exception
        assert len([*page.error, *page.info]) == 1, (orders, shown_text(page))
    page.multiselect[0].set_value(["5"]).run()
    assert not page.error


def test_a_bandwidth_that_is_too_narrow_is_one_message() -> None:
    page = opened_machine("Orders (Vold–Kalman)")
    choose(page, "Bandwidth in", "Hz")
    next(n for n in page.number_input if n.label == "Bandwidth").set_value(0.01).run()
    assert not page.exception
    assert len(page.error) == 1


def test_modes_are_as_the_signal_suggests_until_one_says_otherwise() -> None:
    page = opened_machine("Modes")
    assert "as the signal suggests" in labelled(page, "selectbox", "Modes K").options[0].lower()
    suggested = int(shown_text(page).split("** modes")[0].rsplit("**", 1)[-1] if "** modes" in shown_text(page) else 0)
    assert suggested == 0 or suggested >= 1
    assert any(len(table.value) >= 3 for table in page.dataframe)  # what was tried
    labelled(page, "selectbox", "Modes K").set_value(3).run()
    assert "**3 modes**" in shown_text(page)
    assert "onverged after" in shown_text(page)


def test_the_chosen_mode_goes_on_to_the_squeezed_transform_in_one_step() -> None:
    """Of two modes on tones of 50 and 55 Hz, the second one's map has its ridge at 55 Hz."""
    page = opened_machine("Modes")
    labelled(page, "selectbox", "Modes K").set_value(2)
    labelled(page, "selectbox", "Chosen mode").set_value(2)
    labelled(page, "selectbox", "The chosen mode").set_value("squeezed-cwt").run()
    assert not page.error, shown_text(page)
    shown = figures(page)[0]["map"]
    levels = np.frombuffer(b64decode(shown["levels"]), np.uint8).reshape(shown["rows"], -1)
    lines = np.geomspace(*shown["limits"], shown["rows"])
    assert lines[np.argmax(levels.astype(float).sum(axis=1))] == pytest.approx(55.0, rel=0.03)


def test_modes_that_share_their_lines_are_warned_of() -> None:
    """Two modes on tones of 50 and 55 Hz at a small penalty reach over each other."""
    page = opened_machine("Modes")
    labelled(page, "selectbox", "Modes K").set_value(2)
    labelled(page, "selectbox", "Penalty").set_value(50)
    labelled(page, "selectbox", "Start").set_value("zero").run()
    assert any("share the same lines" in w.value for w in page.warning)


@pytest.mark.slow
def test_modes_of_envelopes_and_over_angle() -> None:
    page = opened_machine("Modes")
    envelope = labelled(page, "slider", "Envelope of the band")
    envelope.set_value((500.0, 900.0)).run()
    assert not page.error, shown_text(page)
    labelled(page, "slider", "Envelope of the band").set_value((0.0, 1000.0)).run()
    choose(page, "Over", "Shaft angle")
    assert not page.error, shown_text(page)
    assert any("revolutions" in s.label for s in page.slider)


def test_denoised_and_removed_make_the_signal() -> None:
    page = opened_at("Denoising")
    shown = curves(page)
    np.testing.assert_allclose(shown["without noise"] + shown["removed"], shown["signal"], atol=1e-9)
    assert np.std(shown["removed"]) > 0.0
    choose(page, "Threshold", "bayes")
    choose(page, "Noise", "Coloured")
    assert not page.error
    assert np.std(curves(page)["without noise"]) > 0.0
    choose(page, "Threshold", "universal")
    choose(page, "Noise", "White, finest level")
    assert np.std(curves(page)["removed"]) > np.std(shown["removed"])
    labelled(page, "selectbox", "Levels").set_value(3).run()
    assert len(page.dataframe[0].value) == 3
    labelled(page, "selectbox", "Levels").set_value(14).run()
    assert not page.exception
    assert len(page.error) == 1  # the segment is too short for so many


def test_a_tone_repeats() -> None:
    page = choose(opened_machine("Kind of motion"), "Asked of", "Phase plane")
    assert not page.error, shown_text(page)
    # 5.5 cycles per revolution: the motion returns after two revolutions
    told = shown_text(page)
    assert "Kind of motion: **subharmonic** after 2 cycles" in told, told[-900:]


def test_the_lowest_frequency_is_half_the_slowest_shaft_or_what_the_segment_allows() -> None:
    page = opened_machine("Phase plane")
    low = next(n for n in page.number_input if n.label.startswith("Lowest"))
    assert low.placeholder.startswith("5, half")
    next(s for s in page.slider if s.label.startswith("Segment")).set_value((0.0, 1.0)).run()
    low = next(n for n in page.number_input if n.label.startswith("Lowest"))
    assert low.placeholder.startswith("14.7, as low as")
    assert not page.error
    low.set_value(1.0).run()
    assert not page.exception
    assert not page.error
    assert "segment does not allow an answer" in page.info[0].value
    assert "the lowest frequency" in shown_text(page)


@pytest.mark.slow
def test_a_longer_segment_than_can_be_answered_soon_is_cut_and_this_is_said() -> None:
    page = opened_at("Orders (Vold–Kalman)", "run_up")
    orders = page.multiselect[0]
    orders.set_value(list(orders.options[:5])).run()
    assert not page.error
    assert "Analysed: 0 to 5.12 s of 8 s, 65536 samples; a longer one would take too long." in shown_text(page)


def measured_line(page: AppTest) -> tuple[np.ndarray, np.ndarray]:
    """Return x and y of the measured line of the page's spectrum."""
    line = next(figure for figure in figures(page) if "map" not in figure)["lines"][0]
    return numbers(line["x"]), numbers(line["y"])


@pytest.mark.parametrize("preparation", ["As recorded", "Tones removed", "Whitened"])
def test_the_kurtogram_shows_the_bearing_in_its_own_band(preparation: str) -> None:
    page = choose(opened_at("Kurtogram", "outer_race"), "Signal", preparation)
    assert "The kurtogram's band: " in shown_text(page)
    at, values = measured_line(page)
    fault = float(at[at > 5][np.argmax(values[at > 5])])
    assert min(fault % OUTER_RACE_HZ, -fault % OUTER_RACE_HZ) < 1.0  # the race or a harmonic of it
    choose(page, "Modulation over", "Order")
    assert not page.error


def test_the_user_may_choose_another_band() -> None:
    page = opened_at("Kurtogram", "outer_race")
    labelled(page, "slider", "Band (Hz)").set_value((1000.0, 1500.0)).run()
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


def test_modes_are_numbered_by_rising_centre() -> None:
    from gearsig.decompose import VmdSettings, vmd
    from gearsig.timefreq import UniformSignal

    t = np.arange(8000) / 1000.0
    x = np.cos(2 * np.pi * 300 * t) + 0.5 * np.cos(2 * np.pi * 60 * t)
    signal = UniformSignal(x, 1000.0, unit="g", source="a")
    modes = by_centre(vmd(signal, None, VmdSettings(2, 2000.0, start="peaks")))
    assert modes.by_centre() == (0, 1)
    assert modes.centres == pytest.approx([60.0, 300.0], abs=2.0)
    assert modes.rms == pytest.approx([0.5 / np.sqrt(2), 1 / np.sqrt(2)], rel=0.05)
    assert modes.centre_history[-1, 0] < modes.centre_history[-1, 1]


def test_coherence_names_the_lines_that_stand_out() -> None:
    page = opened_at("Cyclic coherence", "outer_race")
    at, values = measured_line(page)
    assert values[np.abs(at - OUTER_RACE_HZ) <= 1.0].max() > 0.3
    assert "above the level of noise" in shown_text(page)
    named = shown_text(page).split("for slip: ")[1].split("Bearing lines whose peak")[0]
    assert "BPFO bearing" in named
    assert "not that there is damage" in shown_text(page)
    choose(page, "Modulation over", "Order")
    assert not page.error
    labelled(page, "number_input", "Highest modulation frequency").set_value(1e9).run()
    assert len(page.error) == 1
    assert not page.exception


def test_wavelet_packets_share_the_energy_and_add_up_to_the_signal() -> None:
    page = opened_machine("Wavelet packets")
    shares = curves(page)["share"][::2]
    assert len(shares) == 16
    assert shares.sum() == pytest.approx(100.0)
    nodes = labelled(page, "multiselect", "Waveform of the nodes")
    nodes.set_value([str(node) for node in range(16)]).run()
    shown = curves(page)
    whole = next(values for name, values in shown.items() if name.startswith("nodes"))
    np.testing.assert_allclose(whole, shown["signal"], atol=1e-9)
    labelled(page, "multiselect", "Waveform of the nodes").set_value(["99"]).run()
    assert len(page.error) == 1


@pytest.mark.slow
def test_what_crack_severity_cannot_tell_is_said() -> None:
    page = opened_at("Crack severity", "two_stage")
    assert not page.error
    assert "The depth cannot be estimated" in shown_text(page)
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
    found, put_in = read_recording(path), kept.recording()
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


def test_numbers_that_are_none_are_refused_when_the_file_is_read() -> None:
    rows = "\n".join(f"{i / 1000:g};{'nan' if i == 900 else (i * 37) % 101}" for i in range(3000))
    page = opened_file("holes.csv", f"time (s);a1\n{rows}\n".encode())
    assert not page.exception
    assert len(page.error) == 1
    assert "What to do" in shown_text(page)
