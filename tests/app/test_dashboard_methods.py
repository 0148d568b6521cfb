"""The further methods of the analysis page, run without a browser."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from streamlit.testing.v1 import AppTest

from app.dashboard import state
from app.dashboard.methods import METHODS
from tests.app.test_dashboard import SAMPLES, opened, shown_text, upload

TAB = "More methods"


def opened_at(method: str, sample: str = "damaged_tooth") -> AppTest:
    page = opened()
    if sample != "damaged_tooth":
        page.sidebar.selectbox(key=state.SAMPLE).set_value(SAMPLES[sample])
    page.session_state[state.TAB] = TAB
    page.run()
    return choose(page, "Method", method)


def choose(page: AppTest, label: str, value: str) -> AppTest:
    next(w for w in page.segmented_control if w.label == label).set_value(value).run()
    assert not page.exception
    return page


def curves(page: AppTest) -> dict[str, np.ndarray]:
    """Return the values of all named curves of the page, those of the first chart where names return."""
    from base64 import b64decode

    found = {}
    for chart in page.get("plotly_chart"):
        for line in json.loads(chart.proto.spec)["data"]:
            y = line["y"]
            values = np.frombuffer(b64decode(y["bdata"]), y["dtype"]) if isinstance(y, dict) else np.array(y, float)
            found.setdefault(line.get("name", ""), values)
    return found


@pytest.mark.parametrize("sample", ["run_up", "two_stage", "no_tachometer"])
def test_every_method_answers_for_samples_of_every_kind(sample: str) -> None:
    page = opened_at("Time–frequency", sample)
    for method in METHODS:
        choose(page, "Method", method)
        assert not page.error, shown_text(page)
        drawn = len(page.get("plotly_chart")) + len(page.get("image"))
        told = method == "Crack severity" and len(page.info) + len(page.success) == 1
        assert drawn > 0 or told
        assert "Analysed: 0 to" in shown_text(page)


def test_only_the_chosen_method_is_computed(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object, **__: object) -> None:
        raise AssertionError

    for name in METHODS:
        if name != "Time–frequency":
            monkeypatch.setitem(METHODS, name, (fail, ""))
    page = opened_at("Time–frequency")
    assert not page.exception
    for tab in ("Spectrum", "Channels"):
        monkeypatch.setitem(METHODS, "Time–frequency", (fail, ""))
        page.session_state[state.TAB] = tab
        page.run()
        assert not page.exception


def test_every_transform_draws_its_map() -> None:
    page = opened_at("Time–frequency", "run_up")
    for over in ("Time", "Shaft angle"):
        choose(page, "Over", over)
        for transform in ("Fourier", "Wavelet", "Squeezed Fourier", "Squeezed wavelet"):
            choose(page, "Transform", transform)
            assert not page.error
            assert len(page.get("image")) == 1
    page.select_slider[0].set_value(page.select_slider[0].options[-3:-1]).run()
    assert not page.exception
    assert not page.error


def test_a_stretch_of_a_recording_is_what_is_analysed() -> None:
    page = opened_at("Time–frequency")
    next(s for s in page.slider if s.label.startswith("Segment")).set_value((1.0, 2.0)).run()
    assert not page.error
    assert "Analysed: 1 to 2 s of 5 s, 12800 samples" in shown_text(page)


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


def opened_machine(method: str) -> AppTest:
    content, rig = machine()
    page = upload(opened(), "orders.csv", content, rig)
    page.session_state[state.TAB] = TAB
    page.run()
    return choose(page, "Method", method)


def test_orders_have_the_amplitudes_that_were_put_in() -> None:
    page = opened_machine("Orders (Vold–Kalman)")
    page.multiselect[0].set_value(["5", "5.5"]).run()
    assert not page.error, shown_text(page)
    for name, amplitude in (("5", 3.0), ("5.5", 1.0)):
        middle = curves(page)[name]
        middle = middle[len(middle) // 4 : -len(middle) // 4]
        np.testing.assert_allclose(middle, amplitude, rtol=0.03)
    assert np.abs(curves(page)["residual without all chosen orders"]).max() < 0.5
    choose(page, "Levels over", "Speed")
    assert not page.error


def test_orders_that_make_no_sense_are_one_message() -> None:
    page = opened_machine("Orders (Vold–Kalman)")
    for orders in (["five"], [], ["5", "5.0"], ["-2"], ["1e9"], ["nan"]):
        page.multiselect[0].set_value(orders).run()
        assert not page.exception
        assert len(page.error) == 1, (orders, shown_text(page))
    page.multiselect[0].set_value(["5"]).run()
    assert not page.error


def test_a_bandwidth_that_is_too_narrow_is_one_message() -> None:
    page = opened_machine("Orders (Vold–Kalman)")
    choose(page, "Bandwidth in", "Hz")
    next(n for n in page.number_input if n.label == "Bandwidth (Hz)").set_value(0.01).run()
    assert not page.exception
    assert len(page.error) == 1


def press(page: AppTest, label: str) -> AppTest:
    next(b for b in page.button if b.label == label).click().run()
    assert not page.exception
    return page


def test_suggested_modes_are_taken_over() -> None:
    page = press(opened_machine("Modes"), "Suggest K and penalty")
    told = shown_text(page).split("Suggested: ")[1]
    n_modes, penalty = int(told.split("**")[1].split()[0]), int(told.split("**")[3])
    assert len(page.dataframe[0].value) >= 3
    k = next(s for s in page.slider if s.label == "Modes K")
    k.set_value(9 if n_modes != 9 else 8).run()
    press(page, "Use it")
    assert next(s for s in page.slider if s.label == "Modes K").value == n_modes
    assert next(s for s in page.select_slider if s.label.startswith("Penalty")).value == penalty
    assert "onverged after" in shown_text(page)


def test_modes_that_share_their_lines_are_warned_of() -> None:
    """Two modes on tones of 50 and 55 Hz at a small penalty reach over each other."""
    page = opened_machine("Modes")
    next(s for s in page.slider if s.label == "Modes K").set_value(2).run()
    next(s for s in page.select_slider if s.label.startswith("Penalty")).set_value(50).run()
    choose(page, "Start", "zero")
    assert any("share the same lines" in w.value for w in page.warning)


@pytest.mark.parametrize(("method", "engine"), [("Modes", "vmdpy"), ("Ridges", "ssqueezepy")])
def test_other_engines_answer_for_short_segments(method: str, engine: str) -> None:
    pytest.importorskip(engine)
    page = choose(opened_machine(method), "Engine", engine)
    assert not page.exception
    assert not page.error, shown_text(page)
    assert len(page.get("image")) == 1


def test_modes_of_envelopes_and_over_angle() -> None:
    page = opened_at("Modes")
    for kind in ("Envelope", "Over angle"):
        choose(page, "Modes of", kind)
        assert not page.error
        assert len(page.get("image")) == 1
    assert any(s.label == "Orders shown" for s in page.slider)


def test_denoised_and_removed_make_the_signal() -> None:
    page = opened_at("Denoising")
    shown = curves(page)
    np.testing.assert_allclose(shown["without noise"] + shown["removed"], shown["signal"], atol=1e-9)
    assert np.std(shown["removed"]) > 0.0
    choose(page, "Threshold", "bayes")
    choose(page, "Noise", "Coloured")
    assert not page.error
    assert np.std(curves(page)["removed"]) < np.std(shown["removed"])
    levels = next(s for s in page.select_slider if s.label == "Levels")
    levels.set_value("3").run()
    assert len(page.dataframe[0].value) == 3
    levels.set_value("14").run()
    assert not page.exception
    assert len(page.error) == 1  # the stretch is too short for so many


def test_the_phase_plane_says_that_a_tone_repeats() -> None:
    page = opened_machine("Phase plane")
    assert not page.error, shown_text(page)
    press(page, "What kind of motion is it?")
    # 5.5 cycles per revolution: the motion returns after two revolutions
    told = shown_text(page)
    assert "Kind of motion: **subharmonic** after 2 cycles" in told, told[-900:]


def test_the_lowest_frequency_is_half_the_slowest_shaft_or_what_the_stretch_allows() -> None:
    page = opened_machine("Phase plane")
    low = next(n for n in page.number_input if n.label.startswith("Lowest"))
    assert low.placeholder.startswith("5, half")
    next(s for s in page.slider if s.label.startswith("Segment")).set_value((0.0, 1.0)).run()
    low = next(n for n in page.number_input if n.label.startswith("Lowest"))
    assert low.placeholder.startswith("14.7, as low as")
    assert not page.error
    low.set_value(1.0).run()
    assert not page.exception
    assert len(page.error) == 1
    assert "the lowest frequency" in shown_text(page)


def test_a_constant_channel_is_one_message_in_every_method() -> None:
    rows = "\n".join(f"{i / 1000:g};1.5;{(i * 37) % 101}" for i in range(3000))
    page = upload(opened(), "dead.csv", f"time (s);a1;a2\n{rows}\n".encode())
    page.session_state[state.TAB] = TAB
    page.run()
    assert not page.exception
    for method in METHODS:
        choose(page, "Method", method)
        assert len(page.error) <= 1


def test_a_channel_that_is_no_motion_is_one_message_and_an_unknown_one_is_asked_about() -> None:
    content, rig = machine()
    for quantity, n_errors in (("sound_pressure", 1), ("unknown", 0), ("displacement", 0)):
        page = upload(opened(), "other.csv", content, rig.replace('"acceleration"', f'"{quantity}"'))
        page.session_state[state.TAB] = TAB
        page.run()
        choose(page, "Method", "Phase plane")
        assert len(page.error) == n_errors, quantity
        asked = [w for w in page.segmented_control if w.label == "The channel measures"]
        assert len(asked) == (quantity == "unknown")
    assert "correct its quantity" not in shown_text(page)


def test_a_longer_stretch_than_can_be_answered_soon_is_cut_and_this_is_said() -> None:
    page = opened_at("Orders (Vold–Kalman)", "run_up")
    orders = page.multiselect[0]
    orders.set_value(list(orders.options[:5])).run()
    assert not page.error
    assert "Analysed: 0 to 5.12 s of 8 s, 65536 samples; a longer one would take too long." in shown_text(page)


def test_names_from_files_are_shown_as_typed_in_every_method() -> None:
    content, rig = machine()
    names = ("<script>alert(1)</script>", "**x** $y$ :smile:")
    rig = rig.replace('"input"', f'"{names[1]}"').replace('"a1"', f'"{names[0]}"')
    page = upload(opened(), "names.csv", content.replace(b";a1", f";{names[0]}".encode()), rig)
    page.session_state[state.TAB] = TAB
    page.run()
    for method in METHODS:
        choose(page, "Method", method)
        assert not page.error
        raw = "\n".join(part.value for part in [*page.markdown, *page.caption, *page.info, *page.warning])
        for markup in ("<script", "**x**", "$y$", ":smile:"):
            assert not re.search(r"(?<!\\)" + re.escape(markup), raw), (method, markup)
        assert all("<script" not in chart.proto.spec for chart in page.get("plotly_chart"))
