"""Comparisons whose outcome is known: equal signals, gains, shifts, noise alone."""

import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gearsig.comparison import Comparison, LineLevel, compare, missing_line_text
from gearsig.errors import InputError, RefusalError
from gearsig.formatting import plus_minus
from gearsig.recording import Channel, Recording
from gearsig.report import comparison_page, comparison_text
from gearsig.rig import ConstantSpeed, GearPair, PulseTimes, Rig, Shaft
from tests.comparison.machines import LINES, RIG, TEETH, gear_record


def line(comparison: Comparison, order: float) -> LineLevel:
    lines = (*comparison.channels[0].lines, *comparison.channels[0].other_lines)
    return next(x for x in lines if abs(x.order - order) < 0.03)


def test_a_record_against_itself_agrees_in_everything() -> None:
    record = gear_record()
    found = compare(record, record)
    channel = found.channels[0]
    assert all(x.level.difference_db == 0 for x in (*channel.lines, *channel.other_lines))
    assert all(band.level.difference_db == 0 for band in (*channel.order_bands, *channel.third_octaves))
    for shaft in channel.shafts:
        assert shaft.correlation.value == pytest.approx(1.0, abs=1e-12)
        assert shaft.agreement.complex_frac.value == pytest.approx(1.0, abs=1e-12)
        assert shaft.agreement.magnitude_frac.value == pytest.approx(1.0, abs=1e-12)
        assert all(tooth.difference_db == 0 for tooth in shaft.tooth_levels)
    assert channel.overall.difference_db == 0
    assert "do not differ by more than" in found.verdict


def test_levels_are_rms_of_the_lines() -> None:
    found = compare(gear_record(), gear_record(seed=1))
    for order, amplitude in LINES.items():
        level = line(found, order).level if order in (1, 2, 22, 23, 24, 46, 47, 69) else None
        assert level is not None
        expected = 20 * np.log10(amplitude / np.sqrt(2))
        assert level.recorded_db == pytest.approx(expected, abs=4 * max(level.repeatability_db, 0.01))
    power = sum(a**2 / 2 for a in LINES.values()) + 0.05**2
    # White noise reaches beyond the highest order that is compared: 0.4 of the rate, not 0.5.
    assert found.channels[0].overall.recorded_db == pytest.approx(10 * np.log10(power), abs=0.01)


@settings(max_examples=8, deadline=None)
@given(gain_db=st.floats(-40.0, 40.0))
def test_a_gain_is_found_at_every_line_and_band_and_changes_no_shape(gain_db: float) -> None:
    record = gear_record(noise=0.02)
    louder = replace(record, samples=record.samples * 10 ** (gain_db / 20))
    channel = compare(louder, record).channels[0]
    for item in (*channel.lines, *channel.order_bands, *channel.third_octaves):
        assert item.level.difference_db == pytest.approx(gain_db, abs=1e-6)
    assert channel.overall.difference_db == pytest.approx(gain_db, abs=1e-9)
    assert channel.shafts[0].correlation.value == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize("shift_deg", [-170.0, -37.3, 0.0, 11.2, 90.0, 180.0])
def test_a_shift_is_found_by_correlation(shift_deg: float) -> None:
    simulated = gear_record(with_pulses=False, seed=1)
    found = compare(simulated, gear_record(shift_rev=shift_deg / 360.0), align_by="correlation")
    first = found.alignments[0]
    assert first.method == "correlation"
    off = (first.shift_deg - shift_deg + 180.0) % 360.0 - 180.0
    assert abs(off) < 0.05
    assert first.tooth_is_certain
    assert found.channels[0].shafts[0].correlation.value > 0.99


def test_a_clipped_channel_is_told() -> None:
    simulated, recorded = gear_record(seed=1), gear_record(seed=2)
    limit = float(np.quantile(np.abs(recorded.values(recorded.vibration_names()[0])), 0.95))
    cut = recorded.samples.copy()
    cut[0] = np.clip(cut[0], -limit, limit)
    notes = compare(simulated, replace(recorded, samples=cut)).notes
    assert sum("clipped" in note and note.startswith("The recording") for note in notes) == 1


def test_marks_are_trusted_and_a_better_shift_is_told() -> None:
    simulated, recorded = gear_record(seed=1), gear_record(shift_rev=0.1)
    found = compare(simulated, recorded)
    assert (found.alignments[0].method, found.alignments[0].shift_deg) == ("marks", 0.0)
    assert found.alignments[0].best_shift_deg == pytest.approx(36.0, abs=0.1)
    assert found.channels[0].shafts[0].correlation.value < 0.5
    assert any("+36" in note for note in found.notes)
    turned = compare(simulated, recorded, align_by="correlation")
    assert turned.channels[0].shafts[0].correlation.value > 0.99
    # Levels know no angle.
    for a, b in zip(found.channels[0].lines, turned.channels[0].lines, strict=True):
        assert a.level.difference_db == pytest.approx(b.level.difference_db, abs=1e-9)


def test_teeth_that_are_all_alike_are_aligned_to_whole_teeth_only() -> None:
    mesh = {23: 2.0, 46: 1.0}
    found = compare(
        gear_record(lines=mesh, with_pulses=False, seed=1), gear_record(lines=mesh, shift_rev=0.01, with_pulses=False)
    )
    assert found.alignments[0].tooth_is_certain is False
    pitch_deg = 360.0 / 23
    assert (found.alignments[0].shift_deg - 3.6 + pitch_deg / 2) % pitch_deg == pytest.approx(pitch_deg / 2, abs=0.1)
    assert any("in the simulation is which in the recording" in note for note in found.notes)


@pytest.mark.parametrize(
    ("recorded_lines", "verdict"),
    [
        ({}, "agree within 0.0 dB at 3 lines."),
        (
            {9.3: 7.0},
            "Order 9.2969 differs most after a common gain of +40.0 dB: there the simulation is too weak by 20.0",
        ),
    ],
)
def test_of_unknown_units_lines_of_no_shaft_are_compared_after_a_common_gain(
    recorded_lines: dict[float, float], verdict: str
) -> None:
    lines = {3.6: 1.0, 5.4: 0.5, 9.3: 0.7}
    t = np.arange(60_000) / 10_000.0

    def record(gain: float, unit: str, lines: dict[float, float], seed: int) -> Recording:
        x = 0.1 * np.random.default_rng(seed).normal(size=len(t))
        x += sum(a * np.cos(2 * np.pi * order * 25.0 * t) for order, a in lines.items())
        quantity = "acceleration" if unit else "unknown"
        return Recording(gain * x[None], 10_000.0, (Channel("a1", quantity, unit),), ConstantSpeed(1500.0))

    found = compare(record(0.01, "", lines, 1), record(1.0, "m/s^2", lines | recorded_lines, 2))
    assert found.verdict.startswith("The unit of one side is not known")
    assert "a common gain of +40.0 dB" in found.verdict
    assert verdict in found.verdict


def test_noise_alone_shows_no_line_and_no_agreement() -> None:
    simulated, recorded = (gear_record(lines={}, noise=1.0, seed=seed) for seed in (1, 2))
    found = compare(simulated, recorded)
    channel = found.channels[0]
    assert "No line of the recording stands above its own noise" in found.verdict
    assert not any(x.is_seen for x in channel.lines if x.kind == "mesh")
    assert sum(x.is_seen for x in channel.lines) <= 1  # of some 80, at one in 8000
    for shaft in channel.shafts:
        assert shaft.recorded_reliability < 0.3
        assert abs(shaft.correlation.value) < 0.3
    assert channel.locked.recorded.value < 0.05
    bands = [band.level for band in (*channel.order_bands, *channel.third_octaves)]
    assert sum(level.is_beyond for level in bands) <= 0.15 * len(bands)
    # White noise of equal density: no band differs by much.
    assert abs(channel.overall.difference_db) < 0.2


def test_other_rate_length_and_speed_change_nothing_by_order() -> None:
    simulated = gear_record(rate_hz=12000.0, duration_s=4.0, speed_rpm=1620.0, seed=1)
    found = compare(simulated, gear_record())
    assert found.simulated.mean_speed_rpm == pytest.approx(1620.0)
    for order in LINES:
        assert line(found, order).level.difference_db == pytest.approx(0.0, abs=0.3)
    assert found.channels[0].shafts[0].correlation.value > 0.99
    assert any("8.0 % faster" in note for note in found.notes)
    fast = compare(gear_record(speed_rpm=1800.0, seed=1), gear_record())
    assert any("+20 %" in note for note in fast.notes)
    assert line(fast, 23).level.difference_db == pytest.approx(0.0, abs=0.1)


def test_another_shafts_lines_do_not_leak_into_an_average() -> None:
    """Records of other lengths leak differently; the driver has nothing at its own orders here."""
    out = {31: 2.0, 30: 0.5, 32: 0.5, 1: 1.0}
    simulated = gear_record(lines={}, out_lines=out, noise=1e-4, duration_s=5.3)
    recorded = gear_record(lines={}, out_lines=out, noise=1e-4, seed=1)
    found = compare(simulated, recorded)
    assert line(found, 23).level.difference_db == pytest.approx(0.0, abs=0.02)  # the mesh is both shafts'
    assert line(found, 30 * 23 / 31).level.difference_db == pytest.approx(0.0, abs=0.02)
    driver = [x for x in found.channels[0].lines if x.shaft == "in" and x.kind != "mesh"]
    assert max(x.level.recorded_db for x in driver) < -70  # 65 dB and more below the sidebands beside them


def test_a_line_that_belongs_to_nothing_is_named_and_missed() -> None:
    recorded = gear_record(other_lines={5.5: 0.5, 17.5: 0.4})
    found = compare(gear_record(seed=1), recorded)
    missing = line(found, 5.5)
    assert (missing.kind, missing.recorded_is_seen, missing.simulated_is_seen) == ("other", True, False)
    assert missing.level.recorded_db == pytest.approx(20 * np.log10(0.5 / np.sqrt(2)), abs=0.1)
    assert missing.level.difference_db < -20
    assert any(text.startswith("The simulation lacks order 5.5") for text in found.findings)
    assert "1× mesh − 5.5" in line(found, 17.5).label
    assert found.channels[0].locked.recorded.value < 0.99


def test_energy_that_turns_with_the_shafts() -> None:
    noise = 1.0
    found = compare(gear_record(noise=0.0), gear_record(noise=noise, duration_s=20.0))
    locked = sum(a**2 / 2 for a in LINES.values())
    reach = found.highest_order * 25.0 / 4000.0
    share = found.channels[0].locked
    assert share.simulated.value == pytest.approx(1.0, abs=1e-3)
    assert share.recorded.value == pytest.approx(locked / (locked + reach * noise**2), abs=0.02)


def test_one_stronger_tooth_is_found_tooth_by_tooth() -> None:
    record = gear_record(noise=0.01, seed=1)
    theta = 25.0 * record.time_s()
    burst = ((theta % 1.0) * 23).astype(int) == 6
    marked = replace(record, samples=record.samples * np.where(burst, 2.0, 1.0))
    teeth = compare(record, marked).channels[0].shafts[0].tooth_levels
    differences = [tooth.difference_db for tooth in teeth]
    assert len(teeth) == 23
    assert int(np.argmin(differences)) == 6
    assert differences[6] == pytest.approx(-6.0, abs=0.7)  # the band limit rounds the edges of the doubled tooth


def test_the_verdict_opens_with_the_tooth_that_differs_where_no_mesh_harmonic_does() -> None:
    record = gear_record(noise=0.01, seed=1)
    strike = np.exp(-(((25.0 * record.time_s() % 1.0 - 6.5 / 23) * 23 / 0.3) ** 2))  # in the middle of tooth 7
    marked = replace(record, samples=record.samples + 3.0 * strike * np.sin(2 * np.pi * 37 * 25.0 * record.time_s()))
    found = compare(gear_record(noise=0.01, seed=2), marked)
    assert found.verdict.startswith("The averages over angle differ most at tooth 7 of in (102°), where the simulation")
    assert "is too weak by" in found.verdict
    assert "do not differ" not in found.verdict.partition(". ")[0]
    table = comparison_text(found)
    assert "tooth 7 of in (102°)" in table.partition("The averages over angle")[0]


def test_the_verdict_names_a_line_that_one_record_lacks_and_the_table_shows_it() -> None:
    lines = {n: amplitude for n, amplitude in LINES.items() if n != 24}
    found = compare(gear_record(lines=lines, seed=1), gear_record())
    assert found.verdict.startswith("Beside the mesh harmonics, 1× mesh p + 1× in differs most: it is not in the sim")
    row = next(text for text in comparison_text(found).splitlines() if text.startswith("1× mesh p + 1× in"))
    assert row.endswith("not in the simulation")


def test_a_larger_difference_of_the_mesh_comes_first() -> None:
    lines = {n: amplitude * {23: 0.5, 24: 0.4}.get(n, 1.0) for n, amplitude in LINES.items()}
    verdict = compare(gear_record(lines=lines, seed=1), gear_record()).verdict
    first, _, second = verdict.partition(". ")
    assert first.startswith("Simulation and recording differ by up to 6.")
    assert "1× mesh p + 1× in differs most: there the simulation is too weak by 8." in second


def test_averages_of_equal_levels_that_do_not_correlate_are_told() -> None:
    turned = {n: amplitude * (-1.0 if n in (23, 46) else 1.0) for n, amplitude in LINES.items()}
    found = compare(gear_record(lines=turned, seed=1), gear_record(), align_by="marks")
    figure = found.channels[0].shafts[0].correlation
    assert figure.value < 0.0
    teeth_or_average = found.verdict.partition(". ")[0]
    assert "differ" in teeth_or_average
    assert "do not" not in teeth_or_average


@pytest.mark.slow
def test_records_of_one_state_do_not_differ_whatever_their_noise() -> None:
    for seed in range(1, 31):
        verdict = compare(gear_record(seed=seed, noise=0.5), gear_record(seed=100 + seed, noise=0.5)).verdict
        assert "differ most" not in verdict, seed
        assert "differs most" not in verdict, seed


def test_every_scatter_is_twice_the_standard_error_and_never_zero() -> None:
    """The terminal, the page and the sentences write one figure alike."""
    found = compare(gear_record(seed=1, noise=0.005), gear_record(noise=0.005))
    shaft = found.channels[0].shafts[0]
    figure = plus_minus(shaft.correlation.value, 2 * shaft.correlation.repeatability, 3)
    text, page = comparison_text(found), comparison_page(found)
    assert f"correlation {figure}" in text
    assert figure.replace("<", "&lt;") in page
    assert figure in " ".join(found.findings)
    assert "± is twice the standard error" in text
    assert not re.search(r"± 0\.0+(?![0-9])", text + page)


@pytest.mark.parametrize(("unit", "per_si"), [("g", 1 / 9.80665), ("mg", 1e3 / 9.80665), ("m/s**2", 1.0)])
def test_units_are_converted_and_unknown_ones_told(unit: str, per_si: float) -> None:
    simulated = gear_record(seed=1)
    recorded = gear_record(gain=per_si, noise=0.05 * per_si, channel=Channel("a1", "acceleration", unit))
    found = compare(simulated, recorded)
    assert found.channels[0].unit == unit
    assert line(found, 23).level.difference_db == pytest.approx(0.0, abs=0.1)
    bare = gear_record(gain=20.0, noise=1.0, channel=Channel("a1"))
    found = compare(simulated, bare)
    assert not found.channels[0].levels_compare
    assert found.channels[0].unit == ""
    assert "after a common gain of +26.0 dB" in found.verdict
    assert "agree within" in found.verdict


def test_without_a_rig_the_shafts_orders_are_compared() -> None:
    found = compare(gear_record(rig=None, seed=1), gear_record(rig=None))
    assert [x.order for x in found.channels[0].lines] == list(range(1, 13))
    assert found.mesh_orders == ()
    assert line(found, 1).level.difference_db == pytest.approx(0.0, abs=0.3)


def test_a_side_without_rig_takes_the_others_gears() -> None:
    for simulated, recorded in ((None, RIG), (RIG, None)):
        found = compare(gear_record(rig=simulated, seed=1), gear_record(rig=recorded))
        assert found.mesh_orders == (23.0,)
        assert line(found, 23).level.difference_db == pytest.approx(0.0, abs=0.1)


def test_shafts_of_other_names_are_matched_by_their_gears() -> None:
    own = Rig(shafts=(Shaft("driver"), Shaft("driven")), pairs=(GearPair("mesh", "driver", "driven", *TEETH),))
    simulated = gear_record(seed=1)
    assert simulated.speed is not None
    simulated = replace(simulated, rig=own, speed=replace(simulated.speed, shaft="driver"))
    found = compare(simulated, gear_record())
    assert [a.shaft for a in found.alignments] == ["in", "out"]
    assert found.alignments[0].method == "marks"
    assert line(found, 23).level.difference_db == pytest.approx(0.0, abs=0.1)


@pytest.mark.slow
def test_a_wandering_speed_without_tachometer_keeps_its_mesh_harmonics() -> None:
    """Half a cycle of the mesh, to and fro in ten seconds, must not cost a decibel."""
    rate, rng = 8000.0, np.random.default_rng(3)
    time = np.arange(80000) / rate
    theta = 25.0 * time + 0.25 / 23 * np.sin(2 * np.pi * 0.15 * time)
    x = sum(a * np.cos(2 * np.pi * n * theta + 0.7 * n**2) for n, a in LINES.items())
    x = x + 0.05 * rng.standard_normal(len(time))
    recorded = replace(gear_record(), samples=x[None, :], speed=None)
    found = compare(gear_record(seed=1), recorded)
    for order in (23, 46, 69):
        assert line(found, order).level.difference_db == pytest.approx(0.0, abs=0.2)


@pytest.mark.slow
def test_what_cannot_be_compared_is_refused() -> None:
    record = gear_record()
    with pytest.raises(InputError, match="measure different things: velocity and acceleration"):
        compare(gear_record(channel=Channel("a1", "velocity", "m/s")), record)
    with pytest.raises(InputError, match=r"in V and m/s\^2"):
        compare(gear_record(channel=Channel("a1", "acceleration", "V")), record)
    other = Rig(shafts=RIG.shafts, pairs=(GearPair("p", "in", "out", 25, 31),))
    with pytest.raises(InputError, match="simulation is of other gears: 25/31"):
        compare(gear_record(rig=other), record)
    with pytest.raises(RefusalError, match="simulation holds 6"):
        compare(gear_record(duration_s=0.25), record)
    bare = replace(gear_record(rig=None), speed=None)
    with pytest.raises(RefusalError, match="speed of the recording is not known"):
        compare(gear_record(rig=None), bare)
    silent = replace(record, samples=record.samples * np.array([[float(not c.is_vibration)] for c in record.channels]))
    with pytest.raises(RefusalError, match="channel a1 of the recording is dead"):
        compare(record, silent)
    with pytest.raises(RefusalError, match="no shaft has a mark"):
        compare(gear_record(with_pulses=False), record, align_by="marks")
    with pytest.raises(InputError, match="align_by is 'mark'"):
        compare(record, record, align_by="mark")


def test_channels_that_do_not_pair_are_listed_on_both_sides() -> None:
    one = gear_record()
    two = replace(
        one,
        samples=np.repeat(one.samples, 2, axis=0),
        channels=(Channel("b1", "acceleration", "m/s^2"), Channel("b2", "acceleration", "m/s^2")),
    )
    with pytest.raises(InputError, match=r"the simulation has a1; the recording has b1, b2.*--channel \"a1=b1\""):
        compare(one, two)
    found = compare(one, two, channels=[("a1", "b2")])
    assert [(c.simulated_name, c.recorded_name) for c in found.channels] == [("a1", "b2")]
    with pytest.raises(InputError, match="no channel 'a9'"):
        compare(one, two, channels=[("a9", "b2")])


def run_up(seed: int = 0) -> Recording:
    """Return the lines of `gear_record` from 600 to 3000 rpm; a resonance on the way turns all phases by 180°."""
    time = np.arange(round(8.0 * 8000.0)) / 8000.0
    speed_hz = 10.0 + 5.0 * time
    theta = np.cumsum(speed_hz) / 8000.0
    x = sum(a * np.cos(2 * np.pi * n * theta + n + np.pi * (speed_hz > 30.0)) for n, a in LINES.items())
    x = x + 0.05 * np.random.default_rng(seed).standard_normal(len(time))
    pulses = np.interp(np.arange(1, int(theta[-1])), theta, time)
    return replace(gear_record(duration_s=8.0), samples=x[None, :], speed=PulseTimes(pulses, 1, "in"))


def test_a_run_up_has_no_speed_of_its_own_and_its_scatter_is_no_missing_line() -> None:
    found = compare(run_up(), gear_record())
    (speeds,) = [note for note in found.notes if "rpm" in note]
    assert "The simulation runs between" in speeds
    assert "the recording turns at 1500 rpm" in speeds
    assert "levels of the simulation are means" in speeds
    said = " ".join((found.verdict, *found.findings))
    assert "too strong" not in said
    hidden = [x for x in found.channels[0].lines if missing_line_text(x) == "hidden by the simulation's scatter"]
    assert {x.order for x in hidden} >= {float(TEETH[0]), 2.0 * TEETH[0]}
    assert not any(
        x.label in text for x in hidden for text in found.findings if text.startswith("The simulation lacks")
    )
    assert "(0.00 is possible)" not in said
    assert "halves do not repeat" in said
    assert not any("would correlate better" in note for note in found.notes)


def test_steady_records_at_other_speeds_turn_at_them() -> None:
    found = compare(gear_record(speed_rpm=1800.0, seed=1), gear_record())
    (speeds,) = [note for note in found.notes if "rpm" in note]
    assert "turns at 1800 rpm, the recording at 1500 rpm (+20 %)" in speeds
