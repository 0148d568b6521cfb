"""Arguments of another kind than asked for: each public function says which, what it takes and how to get it."""

from pathlib import Path

import numpy as np
import pytest

import gearsig
from gearsig import Channel, ConstantSpeed, InputError, Recording, Rig
from gearsig.angle import estimate_shaft_angle
from gearsig.diagnosis import analyze_file, read_reference
from gearsig.orders import average_lines, band_passed_mesh, separate, separate_shafts, track_order_bands
from gearsig.phase import find_lock, recurrence_measures
from gearsig.plot import average_figure, polar_figure
from gearsig.recording import read_pulse_times
from gearsig.rig import Bearing, GearPair, OperatingPoint, PulseTimes, Sensor, Shaft, TachometerChannel

ARRAY = np.random.default_rng(0).standard_normal((2, 20000))
CHANNELS = (Channel("a1", "acceleration", "m/s^2"), Channel("a2", "acceleration", "m/s^2"))
BARE = Recording(ARRAY, 10_000.0, CHANNELS)
RECORD = Recording(ARRAY, 10_000.0, CHANNELS, ConstantSpeed(1500.0))
PREPARED = gearsig.PreparedRecording(RECORD)
AVERAGE = gearsig.synchronous_average(RECORD, "a1")
ANGLE = gearsig.find_shaft_angle(RECORD)

MADE = r"recording is an array of shape \(2, 20000\) \(allowed: Recording.*make one: gearsig\.Recording\("
READ = r"is 'a\.csv' \(allowed: .*read the file first: gearsig\.read_recording\('a\.csv'\)"
RIG = r"rig is 'x\.toml' \(allowed: Rig.*read the rig file first: gearsig\.read_rig\('x\.toml'\)"

CASES = {
    # Recordings and their channels.
    "speed a number": (lambda: Recording(ARRAY, 1e4, CHANNELS, 1500.0), r"speed is 1500\.0.*gearsig\.ConstantSpeed\("),
    "speed a name": (lambda: Recording(ARRAY, 1e4, CHANNELS, "t"), r"speed is 't'.*gearsig\.TachometerChannel\('t'\)"),
    "speed a path": (lambda: Recording(ARRAY, 1e4, CHANNELS, Path("p.csv")), r"read_pulse_times\(path\)"),
    "speed times": (lambda: Recording(ARRAY, 1e4, CHANNELS, ARRAY[0]), r"gearsig\.PulseTimes\(times_s\)"),
    "speed a class": (lambda: Recording(ARRAY, 1e4, CHANNELS, ConstantSpeed), r"speed is <class"),
    "rig of a recording": (lambda: Recording(ARRAY, 1e4, CHANNELS, rig="x.toml"), RIG),
    "rate a text": (lambda: Recording(ARRAY, "10000", CHANNELS), r"sampling rate is '10000' \(allowed: a number\)"),
    "channels texts": (lambda: Recording(ARRAY[:1], 1e4, ("a1",)), r"channels\[0\] is 'a1' \(allowed: Channel\)"),
    "channels one": (lambda: Recording(ARRAY[:1], 1e4, CHANNELS[0]), r"channels is a Channel \(allowed: a list or"),
    "channels a text": (lambda: Recording(ARRAY[:1], 1e4, "a"), r"channels is 'a' \(allowed: a list or tuple of Ch"),
    "transposed": (lambda: Recording(ARRAY.T, 1e4, CHANNELS), r"2 channels for .*\(20000, 2\).*transpose.*samples\.T"),
    "one transposed": (lambda: Recording(ARRAY[:1].T, 1e4, CHANNELS[:1]), r"1 channel for .*samples\.T"),
    "channels too few": (lambda: Recording(ARRAY, 1e4, CHANNELS[:1]), r"1 channel for samples of shape \(2, 20000\)"),
    "one row": (lambda: Recording(ARRAY[0], 1e4, CHANNELS[:1]), r"shape \(20000,\).*give samples\[None\]"),
    "ragged": (lambda: Recording([[1.0, 2.0], [3.0]], 1e4, CHANNELS), r"recording: samples .* does not hold numbers"),
    "complex": (lambda: Recording(ARRAY + 1j, 1e4, CHANNELS), r"holds complex numbers.*take the real part"),
    "truth": (lambda: Recording(ARRAY, 1e4, CHANNELS, truth=5), r"truth is 5 \(allowed: Mapping, None\)"),
    "provenance": (lambda: Recording(ARRAY, 1e4, CHANNELS, provenance="x"), r"provenance of a Recording is 'x'"),
    "channel's name": (lambda: Channel(1, "acceleration"), r"name of a Channel is 1 \(allowed: text\)"),
    "channel's quantity": (lambda: Channel("a", 1), r"quantity of channel 'a' is 1 \(allowed: acceleration, "),
    "channel's unit": (lambda: Channel("a", "acceleration", 1), r"unit of channel 'a' is 1"),
    "select": (lambda: RECORD.select("a1"), r"names is 'a1' .*write \['a1'\]"),
    "between": (lambda: RECORD.between("0", 1), r"start_s is '0' \(allowed: a number\)"),
    "with_rig": (lambda: RECORD.with_rig("x.toml"), RIG),
    # Parts of a rig.
    "constant speed": (lambda: ConstantSpeed("1500"), r"speed_rpm is '1500' \(allowed: a number\)"),
    "pulses": (lambda: PulseTimes(["1", "2"]), r"tachometer pulse times holds text"),
    "tachometer": (lambda: TachometerChannel(1), r"channel of a TachometerChannel is 1 \(allowed: text\)"),
    "threshold": (lambda: TachometerChannel("t", threshold="2"), r"threshold of tachometer 't' is '2'"),
    "teeth": (lambda: GearPair("p", "a", "b", "23"), r"driver teeth of pair 'p' is '23' \(allowed: a whole number"),
    "torque": (lambda: OperatingPoint("a", torque_nm="9"), r"torque_nm is '9' \(allowed: a number\)"),
    "scale": (lambda: Sensor("a1", scale="2"), r"scale of sensor 'a1' is '2'"),
    "shaft's name": (lambda: Shaft(1), r"name of a Shaft is 1"),
    "bearing's shaft": (lambda: Bearing("b", 1), r"shaft of a Bearing is 1"),
    "shafts": (lambda: Rig(shafts=("input",)), r"rig\.shafts\[0\] is 'input' \(allowed: Shaft\)"),
    "one shaft": (lambda: Rig(shafts=Shaft("input")), r"rig\.shafts is a Shaft .*put it into a list"),
    "rig's speed": (lambda: Rig(speed=1500.0), r"rig\.speed is 1500\.0.*gearsig\.ConstantSpeed\("),
    "operating point": (lambda: Rig(operating_point=1500.0), r"rig\.operating_point is 1500\.0"),
    # What looks at recordings.
    "analyze": (lambda: gearsig.analyze(ARRAY), MADE),
    "analyze a path": (lambda: gearsig.analyze("a.csv"), f"recording {READ}"),
    "analyze, rig": (lambda: gearsig.analyze(RECORD, "x.toml"), RIG),
    "analyze, settings": (lambda: gearsig.analyze(RECORD, settings=5), r"settings is 5"),
    "analyze, reference": (lambda: gearsig.analyze(RECORD, reference="a.csv"), f"reference {READ}"),
    "analyze, torque": (lambda: gearsig.analyze(RECORD, torque_nm="9"), r"torque_nm is '9' \(allowed: a number\)"),
    "analyze_file": (lambda: analyze_file("a.csv", reference=ARRAY), r"reference is an array"),
    "analyze_file, path": (lambda: analyze_file(RECORD), r"path is a Recording \(allowed: text, path\)"),
    "read_reference": (lambda: read_reference(RECORD), r"path is a Recording .*in memory"),
    "analysis_text": (
        lambda: gearsig.analysis_text(RECORD),
        r"analysis is a Recording .*gearsig\.analyze\(",
    ),
    "compare": (lambda: gearsig.compare(RECORD, ARRAY), r"recorded is an array"),
    "compare, simulated": (lambda: gearsig.compare("a.csv", RECORD), f"simulated {READ}"),
    "compare, rig": (lambda: gearsig.compare(RECORD, RECORD, "x.toml"), RIG),
    "compare, channels": (lambda: gearsig.compare(RECORD, RECORD, channels=("a1",)), r"channels\[0\] is 'a1'"),
    "compare, triple": (lambda: gearsig.compare(RECORD, RECORD, channels=[("a", "b", "c")]), r"allowed: a pair"),
    "estimate_crack": (lambda: gearsig.estimate_crack(ARRAY), MADE),
    "estimate_crack, reference": (lambda: gearsig.estimate_crack(RECORD, reference=ARRAY), r"reference is an array"),
    "find_shaft_angle": (lambda: gearsig.find_shaft_angle(ARRAY), MADE),
    "find_shaft_angle, prepared": (lambda: gearsig.find_shaft_angle(PREPARED), r"give recording\.recording"),
    "find_shaft_angle, rig": (lambda: gearsig.find_shaft_angle(RECORD, "x.toml"), RIG),
    "estimate_shaft_angle": (lambda: estimate_shaft_angle(RECORD, None), r"rig is None \(allowed: Rig\)"),
    "prepared": (lambda: gearsig.PreparedRecording(ARRAY), MADE),
    "prepared twice": (lambda: gearsig.PreparedRecording(PREPARED), r"give recording\.recording"),
    "prepared, rig": (lambda: gearsig.PreparedRecording(RECORD, "x.toml"), RIG),
    "resample": (lambda: gearsig.resample_to_angle(ARRAY, ANGLE), MADE),
    "resample, angle": (lambda: gearsig.resample_to_angle(RECORD, 1500.0), r"shaft_angle is 1500\.0 .*as speed_rpm"),
    "resample, channels": (lambda: gearsig.resample_to_angle(RECORD, ANGLE, channels="a1"), r"write \['a1'\]"),
    "write_recording": (lambda: gearsig.write_recording(ARRAY, "a.csv"), MADE),
    "read_recording": (lambda: gearsig.read_recording(ARRAY), r"path is an array .*\(allowed: text, path\)"),
    "read_pulse_times": (lambda: read_pulse_times(5), r"path is 5 \(allowed: text, path\)"),
    "measure_motion": (lambda: gearsig.measure_motion(ARRAY), MADE),
    "measure_motion, rig": (lambda: gearsig.measure_motion(RECORD, "x.toml"), RIG),
    "examine_start_stop": (lambda: gearsig.examine_start_stop(RECORD), r"motion is a Recording .*measure_motion\("),
    "estimate_forces": (lambda: gearsig.estimate_forces(RECORD), r"motion is a Recording .*measure_motion\("),
    "diagnose_gap": (lambda: gearsig.diagnose_gap([RECORD], None), r"simulator is None .*gap_simulator"),
    "find_lock": (lambda: find_lock(ARRAY), MADE),
    "poincare_section": (lambda: gearsig.poincare_section(ARRAY), r"portrait is an array .*delay_embedding\("),
    "recurrence_plot": (lambda: gearsig.recurrence_plot(RECORD), r"portrait is a Recording"),
    "recurrence_measures": (lambda: recurrence_measures(RECORD), r"portrait is a Recording"),
    "largest_lyapunov": (lambda: gearsig.largest_lyapunov_exponent(ARRAY), r"portrait is an array"),
    "kind_of_motion": (lambda: gearsig.kind_of_motion(ARRAY, None), r"lock is None .*find_lock\("),
    # Signals: a recording and its channel, or an array and its rate.
    "amplitude_spectrum": (lambda: gearsig.amplitude_spectrum("a.csv", "a1"), f"signal {READ}"),
    "amplitude_spectrum, prepared": (lambda: gearsig.amplitude_spectrum(PREPARED, "a1"), r"give signal\.recording"),
    "amplitude_spectrum, complex": (lambda: gearsig.amplitude_spectrum(ARRAY[0] + 1j, 1e4), r"holds complex numbers"),
    "stft": (lambda: gearsig.stft(PREPARED, "a1"), r"give signal\.recording"),
    "denoise": (lambda: gearsig.denoise("a.csv", "a1"), f"signal {READ}"),
    "delay_embedding": (lambda: gearsig.delay_embedding("a.csv", "a1"), f"signal {READ}"),
    "order_map": (lambda: gearsig.order_map("a.csv", "a1"), f"signal {READ}"),
    "order_spectrum, no channel": (lambda: gearsig.order_spectrum(BARE, "b1"), r"no channel 'b1' \(allowed: a1, a2\)"),
    "order_spectrum, no speed": (
        lambda: gearsig.order_spectrum(BARE, "a1"),
        r"speed is not known; give speed_rpm, or shaft_angle",
    ),
    "order_spectrum, prepared": (lambda: gearsig.order_spectrum(PREPARED, "a1"), r"give signal\.recording"),
    "order_spectrum, angle": (lambda: gearsig.order_spectrum(BARE, "a1", shaft_angle=5.0), r"as speed_rpm"),
    "order_spectrum, speed": (lambda: gearsig.order_spectrum(BARE, "a1", speed_rpm="9"), r"speed_rpm is '9'"),
    "track_orders": (lambda: gearsig.track_orders(RECORD, "a1", 10.0), r"orders is 10\.0 .*give a list: \[2, 4\.5\]"),
    "track_orders, text": (lambda: gearsig.track_orders(RECORD, "a1", "2,4"), r"orders is '2,4' .*give a list"),
    "track_orders, texts": (lambda: gearsig.track_orders(RECORD, "a1", [2, "4"]), r"orders\[1\] is '4'"),
    "track_order_bands": (lambda: track_order_bands(RECORD, "a1", 10.0), r"orders is 10\.0"),
    "track_order_bands, block": (
        lambda: track_order_bands(RECORD, "a1", [2], revolutions_per_block="24"),
        r"revolutions_per_block is '24'",
    ),
    "vold_kalman": (lambda: gearsig.track_vold_kalman(RECORD, "a1", 10.0, bandwidth_hz=5.0), r"orders is 10\.0"),
    "vold_kalman, text": (lambda: gearsig.track_vold_kalman(RECORD, "a1", "2,4", bandwidth_hz=5.0), r"orders is '2,4'"),
    "vold_kalman, triple": (
        lambda: gearsig.track_vold_kalman(RECORD, "a1", [("s", 2, 3)], bandwidth_hz=5.0),
        r"allowed: a number, or \(shaft, number\)",
    ),
    "envelope, band text": (
        lambda: gearsig.envelope_spectrum(RECORD, "a1", band_hz="1k..2k"),
        r"band_hz is '1k\.\.2k' \(allowed: two numbers, \(lower, upper\) in Hz\); give both",
    ),
    "envelope, band texts": (
        lambda: gearsig.envelope_spectrum(RECORD, "a1", band_hz=("9", 2e3)),
        r"band_hz\[0\] is '9'",
    ),
    "envelope, half a band": (
        lambda: gearsig.envelope_spectrum(RECORD, "a1", band_hz=(None, 2e3)),
        r"band_hz\[0\] is None",
    ),
    "envelope, one number": (lambda: gearsig.envelope_spectrum(RECORD, "a1", band_hz=2e3), r"band_hz is 2000\.0"),
    "envelope, highest": (lambda: gearsig.envelope_spectrum(RECORD, "a1", highest_hz="9"), r"highest_hz is '9'"),
    "window a number": (
        lambda: gearsig.amplitude_spectrum(RECORD, "a1", window=5),
        r"window is 5 \(allowed: rectangular, hann",
    ),
    "window a list": (lambda: gearsig.order_spectrum(RECORD, "a1", window=["hann"]), r"window is \['hann'\] \(allowed"),
    "unit a number": (lambda: gearsig.power_density(RECORD, "a1", unit=5), r"unit is 5 \(allowed: text\)"),
    "rate None": (lambda: gearsig.amplitude_spectrum(ARRAY[0], None), r"an array.s sampling rate, is None"),
    "shaft a list": (lambda: gearsig.synchronous_average(RECORD, "a1", shaft=["in"]), r"shaft is \['in'\]"),
    "order_map, highest": (lambda: gearsig.order_map(RECORD, "a1", highest_order="9"), r"highest_order is '9'"),
    "stft, lowest": (lambda: gearsig.stft(ARRAY[0], 1e4, lowest="9"), r"lowest is '9' \(allowed: a number\)"),
    "cwt, wavelet": (
        lambda: gearsig.cwt(ARRAY[0], 1e4, wavelet="morse"),
        r"wavelet is 'morse' \(allowed: Morse, Morlet",
    ),
    "ridges": (lambda: gearsig.ridges(ARRAY), r"transform is an array .*gearsig\.cwt"),
    "vmd, block": (lambda: gearsig.vmd(ARRAY[0], 1e4, 3, n_per_block="9"), r"n_per_block is '9'"),
    "denoise, settings": (lambda: gearsig.denoise(RECORD, "a1", settings=5), r"settings is 5 \(allowed: Denoise"),
    "suggest_modes": (lambda: gearsig.suggest_modes(ARRAY[0], 1e4, penalties=5), r"penalties is 5"),
    "phase_plane": (
        lambda: gearsig.phase_plane(RECORD, "a1", quantity=5),
        r"quantity is 5 \(allowed: text, None\)",
    ),
    # Averages.
    "separate": (lambda: separate(ARRAY[0], 29), r"average is an array .*gearsig\.synchronous_average\("),
    "separate, teeth": (lambda: separate(AVERAGE, 29.5), r"teeth is 29\.5 \(allowed: a whole number"),
    "separate, text": (lambda: separate(AVERAGE, "29"), r"teeth is '29' \(allowed: a whole number"),
    "separate, gears": (lambda: separate(AVERAGE, [29, 30.5]), r"teeth is 30\.5 \(allowed: a whole number"),
    "separate, None": (lambda: separate(AVERAGE, None), r"teeth is None \(allowed: a list or tuple"),
    "band_passed_mesh": (lambda: band_passed_mesh(RECORD, 29), r"average is a Recording"),
    "average_lines": (lambda: average_lines(RECORD), r"is a Recording \(allowed: AngleSignal\).*resample_to_angle\("),
    "separate_shafts": (lambda: separate_shafts([AVERAGE], [29]), r"signals\[0\] is a SynchronousAverage"),
    "gear_indicators": (lambda: gearsig.gear_indicators(*[ARRAY[0]] * 3, teeth=29), r"average is an array"),
    "polar_figure": (lambda: polar_figure(ARRAY[0]), r"average is an array .*gearsig\.synchronous_average\("),
    "average_figure": (lambda: average_figure(AVERAGE), r"averages is a SynchronousAverage \(allowed: a list or tuple"),
}


@pytest.mark.parametrize("name", CASES)
def test_wrong_kinds_are_named_with_a_remedy(name):
    call, said = CASES[name]
    with pytest.raises(InputError, match=said) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_the_right_kinds_are_taken_in_any_dress():
    assert Recording(ARRAY.tolist(), np.float32(10_000), list(CHANNELS)).channels == CHANNELS
    assert Rig(shafts=[Shaft("input")]).shafts == (Shaft("input"),)
    assert len(gearsig.track_orders(RECORD, "a1", np.array([1, 2]))) == 2
    assert gearsig.amplitude_spectrum(ARRAY[0].tolist(), 10_000).values.shape == (10_001,)
    assert separate(AVERAGE, np.int64(29)).residual.kind == "residual"
