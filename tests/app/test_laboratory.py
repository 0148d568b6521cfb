"""The fault laboratory's page, run without a browser."""

from io import BytesIO
from time import monotonic

import numpy as np
import pytest
from scipy.io import wavfile
from streamlit.testing.v1 import AppTest

from app.dashboard import state
from app.dashboard.laboratory import setup as controls
from app.dashboard.laboratory.run import chosen_of
from app.dashboard.laboratory.setup import MODELS, WIDEST, Setup, automatic_s, greatest_severity, nice_step, shown_name
from app.dashboard.laboratory.views import NUMBERS, TAB, VIEWS, change
from gearsig.errors import InputError
from sims.effects import EffectSetting, effects
from sims.presets import Preset, presets
from sims.reduced_fe import static_table
from sims.registry import simulator
from sims.simulator import SimulationSetup
from tests.app.pages import figures, on, shown_text

CHARTS = {"Gears": 0, "Time": 3, "Spectrum": 1, "Envelope": 1, "Phase portrait": 2, "Bifurcation": 0, "Mesh": 2}


def opened(preset: str = "small_30_25") -> AppTest:
    """Open the page with a short signal."""
    return on("laboratory", **{"machine of laboratory": preset, "length of laboratory": 0.5})


def slider(page: AppTest, start: str):  # type: ignore[no-untyped-def]
    return next(s for s in page.sidebar.slider if s.label.startswith(start))


def typed(page: AppTest, start: str):  # type: ignore[no-untyped-def]
    return next(s for s in page.sidebar.number_input if s.label.startswith(start))


def test_at_the_start_the_machine_is_healthy() -> None:
    page = opened()
    assert not page.exception
    assert page.subheader[0].value.startswith("Healthy")
    assert [tab.label for tab in page.tabs] == list(VIEWS)
    assert [part.proto.component_name for part in page.get("bidi_component")] == ["gearsig.gears"]
    assert len(page.get("audio")) == 1
    assert [metric.label for metric in page.metric] == list(NUMBERS)
    assert not any(metric.delta for metric in page.metric)
    assert "mesh 900 Hz" in shown_text(page)  # 30 teeth at 1800 rpm


def test_the_crack_slider_shows_the_faulty_machine_in_every_view() -> None:
    page = opened()
    slider(page, "Crack").set_value(1.5).run()
    assert "Crack in a tooth root, 1.5 mm" in shown_text(page)
    assert "burst per revolution" in shown_text(page)
    assert all("healthy" in metric.delta for metric in page.metric)
    for tab in VIEWS:
        page.session_state[TAB] = tab
        page.run()
        assert not page.exception, tab
        assert not page.error, tab
        assert len(figures(page)) + len(page.get("plotly_chart")) == CHARTS[tab], tab


def test_both_machines_are_heard_on_one_scale(monkeypatch) -> None:
    heard: list[bytes] = []
    monkeypatch.setattr("streamlit.audio", heard.append)
    page = opened()
    heard.clear()
    slider(page, "Crack").set_value(1.5).run()
    (rate_hz, healthy), (_, faulty) = [wavfile.read(BytesIO(sound)) for sound in heard]
    assert len(healthy) == len(faulty) == 2 * rate_hz
    quieter, louder = sorted(int(np.abs(sound.astype(int)).max()) for sound in (healthy, faulty))
    assert 10_000 < quieter < louder <= 32767


@pytest.mark.slow
def test_every_effect_has_a_slider_that_switches_it_on() -> None:
    page = opened()
    others = [name for name in effects() if name != "root_crack"]
    groups = [others[i::5] for i in range(5)]  # neighbours in the list may not go together
    for names in groups:
        page.sidebar.multiselect[0].set_value(names).run()
        assert not page.exception, names
        assert not page.error, (names, shown_text(page))
        title = page.subheader[0].value.replace("\\", "").replace("\u00a0", " ").lower()
        for name in names:
            found = effects()[name]
            own = slider(page, found.title.capitalize()[:8])
            assert own.value == found.severity.typical, name
            assert f"typical {found.severity.typical:g}" in own.label
            assert found.title.lower() in title, name


def _pull_marked_effect() -> None:
    from dataclasses import replace

    from app.dashboard.laboratory.setup import _choose_severity
    from sims.effects import effect
    from sims.presets import preset

    wear = effect("tooth_wear")
    severity = replace(wear.severity, unit="$x^2$", meaning=":smile:")
    marked = replace(wear, title="**b**", severity=severity, changes="[l](x)", options=())
    _choose_severity(marked, preset("cracked", "small_30_25"), start=1.0)


def test_texts_of_an_effect_of_ones_own_are_no_markup(monkeypatch) -> None:
    monkeypatch.setattr(controls, "is_user_effect", lambda _: True)
    page = AppTest.from_function(_pull_marked_effect).run()
    assert not page.exception
    (of_effect,) = page.slider
    assert "b" in of_effect.label
    assert not any(text in of_effect.label + of_effect.help for text in ("**b**", "$x^2$", ":smile:", "[l](x)"))


@pytest.mark.slow
def test_two_effects_at_once() -> None:
    page = opened()
    page.sidebar.multiselect[0].set_value(["mains_hum", "eccentricity"]).run()
    title = page.subheader[0].value.replace("\\", "").replace("\u00a0", " ")
    assert title == "Gear off its axis, 20 µm + mains hum, 1 m/s²"
    for name in ("mains_hum", "eccentricity"):
        assert effects()[name].signature[:30] in shown_text(page)


@pytest.mark.slow
def test_the_address_keeps_the_machine_and_what_was_pulled() -> None:
    query = {"machine": "small_30_25", "root_crack": "1.5", "effects": "mains_hum,nonsense"}
    page = on("laboratory", query, **{"length of laboratory": 0.5})
    assert not page.exception
    assert (
        page.subheader[0].value.replace("\\", "").replace("\u00a0", " ")
        == "Crack in a tooth root, 1.5 mm + mains hum, 1 m/s²"
    )
    slider(page, "Crack").set_value(0.0).run()
    assert "root_crack" not in page.query_params
    assert page.query_params["machine"] == "small_30_25"
    slider(page, "Mains hum").set_value(2.0).run()
    assert page.query_params["mains_hum"] == "2"


def test_a_crack_deeper_than_the_tooth_is_one_message() -> None:
    page = opened()
    page.sidebar.toggle(key="lab typed values").set_value(True).run()
    typed(page, "Crack").set_value(9.0).run()
    assert not page.exception
    assert len(page.error) == 1
    assert "past the tooth" in page.error[0].value
    assert "Allowed" in page.error[0].value
    assert "healthy machine alone" in page.subheader[0].value
    assert len(page.metric) == len(NUMBERS)
    typed(page, "Crack").set_value(1.0).run()
    assert not page.error
    assert "1 mm" in shown_text(page)


@pytest.mark.slow
def test_numbers_can_be_typed_and_carry_over() -> None:
    page = opened()
    slider(page, "Crack").set_value(1.3).run()
    page.sidebar.toggle(key="lab typed values").set_value(True).run()
    assert typed(page, "Crack").value == pytest.approx(1.3)
    typed(page, "Torque").set_value(75.0).run()
    typed(page, "Speed").set_value(-5.0).run()
    assert not page.exception
    assert len(page.error) == 1
    assert "at least 0 rpm" in shown_text(page)
    typed(page, "Speed").set_value(900.0).run()
    assert not page.error
    page.sidebar.toggle(key="lab typed values").set_value(False).run()
    assert slider(page, "Torque").value == pytest.approx(75.0)  # beyond the slider's usual end
    assert "900 rpm, 75 N·m" in shown_text(page)


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "torque"), [(0.0, 20.0), (1800.0, 0.0)])
def test_standing_still_and_no_load_are_shown(speed: float, torque: float) -> None:
    page = opened()
    page.sidebar.toggle(key="lab typed values").set_value(True).run()
    typed(page, "Speed").set_value(speed).run()
    typed(page, "Torque").set_value(torque).run()
    for tab in VIEWS:
        page.session_state[TAB] = tab
        page.run()
        assert not page.exception, tab


@pytest.mark.parametrize("name", sorted(presets("cracked")))
def test_every_machine_opens(name: str) -> None:
    page = opened(name)
    assert not page.exception
    assert not page.error
    assert presets("cracked")[name].title in shown_text(page)


@pytest.mark.slow
def test_a_recording_of_the_laboratory_opens_in_the_analysis() -> None:
    setup = Setup("small_30_25", 1800.0, 20.0, effects=(EffectSetting("root_crack", 1.5),), duration_s=2.0)
    page = on("analysis", **{"simulated": chosen_of(setup), state.ORIGIN: state.OF_LABORATORY})
    assert not page.exception
    assert not page.error
    assert "small_30_25_root_crack_1_5.h5" in shown_text(page)
    assert "2 s at 20480 Hz" in shown_text(page)
    page.sidebar.radio(key=state.ORIGIN).set_value("Sample").run()
    assert "small_30_25" not in page.subheader[0].value


def test_names_and_steps_for_people() -> None:
    assert shown_name("published_55_75") == "Published 55/75"
    assert (nice_step(0.07), nice_step(13.3), nice_step(3.0)) == (0.05, 10.0, 2.0)
    assert (change(2.0, 2.5), change(2.0, 2.0001), change(0.0, 1.0), change(1.0, 3.0)) == (
        " (+25 %)",
        " (±0 %)",
        "",
        " (3 ×)",
    )


def test_the_automatic_length_holds_eight_revolutions_where_it_can() -> None:
    preset = presets("cracked")["published_55_75"]
    assert automatic_s(preset, 500.0) == 1.0  # 8 revolutions of the output shaft would take 1.3 s
    assert automatic_s(preset, 1400.0) == 0.5  # they take 0.47 s


@pytest.mark.parametrize("name", [n for model in MODELS for n in presets(model)])
def test_sliders_end_where_the_machine_does(name: str) -> None:
    """At its end every slider gives a machine; a step further the crack's does not."""
    (chosen,) = (found for model in MODELS for found in presets(model).values() if found.name == name)
    for own in effects().values():
        wanted = min(own.severity.high, WIDEST * own.severity.typical)
        end = greatest_severity(chosen, own.name, wanted)
        assert 0.0 < end <= wanted
        prepared(chosen, EffectSetting(own.name, end))
    end = greatest_severity(chosen, "root_crack", 10.0)
    with pytest.raises(InputError, match="crack"):
        prepared(chosen, EffectSetting("root_crack", end + 0.06))


def prepared(chosen: Preset, setting: EffectSetting) -> None:
    """Make the machine as far as its contact, without a simulation."""
    ready = simulator(chosen.model).prepare(SimulationSetup(chosen.name, {}, (setting,)), np.random.default_rng(0))  # type: ignore[attr-defined]
    if chosen.model == "reduced-fe":
        static_table(ready.pair.gears, ready.pair.machine.mesh)


@pytest.mark.slow
def test_a_steeper_crack_ends_the_slider_earlier_or_later() -> None:
    chosen = presets("reduced-fe")["flexible_50_50"]
    ends = [greatest_severity(chosen, "root_crack", 10.0, (("angle_deg", a),)) for a in (30.0, 45.0, 90.0)]
    assert ends == [10.0, pytest.approx(8.15), pytest.approx(6.2)]
    page = opened("flexible_50_50")
    assert slider(page, "Crack").max == pytest.approx(8.15)
    assert slider(page, "Crack").min == 0.0


@pytest.mark.parametrize(("ago_s", "waits"), [(0.0, True), (1e6, False)])
def test_a_slider_that_keeps_changing_comes_to_rest_before_anything_is_simulated(monkeypatch, ago_s, waits) -> None:
    page = opened()
    looks = []
    monkeypatch.setattr(controls, "let_user_act", lambda: looks.append(None))
    page.session_state["last change of a slider"] = {}, monotonic() + 1e3 * waits - ago_s
    slider(page, "Crack").set_value(0.5).run()
    assert not page.exception
    assert bool(looks) == waits
    looks.clear()
    page.run()  # nothing changed
    assert not looks
