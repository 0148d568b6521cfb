"""Text files: layouts that are read, and what is said about those that are not."""

import gzip

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import read_recording
from gearsig.rig import ConstantSpeed, OperatingPoint, Rig, Sensor, SpeedChannel, TachometerChannel

FS_HZ = 25600.0


def rows(n=50, rate_hz=FS_HZ):
    t = np.arange(n) / rate_hz
    return [(float(t[i]), float(np.sin(i)), float(np.cos(i))) for i in range(n)]


def write(path, lines, *, newline="\n"):
    path.write_bytes((newline.join(lines) + newline).encode())
    return path


@pytest.mark.parametrize("separator", [",", ";", "\t", " ", ", ", "   "])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_separators(tmp_path, separator, newline):
    lines = [separator.join(["time", "a1", "a2"]), *(separator.join(map(repr, r)) for r in rows())]
    r = read_recording(write(tmp_path / "x.csv", lines, newline=newline))
    assert r.channel_names == ("a1", "a2")
    assert r.sampling_rate_hz == pytest.approx(FS_HZ, rel=1e-12)
    np.testing.assert_array_equal(r.samples, np.array(rows()).T[1:])
    assert r.warnings == ()


@pytest.mark.parametrize("separator", [";", "\t", " "])
def test_decimal_comma(tmp_path, separator):
    lines = [
        separator.join(["Zeit[s]", "a1[g]", "a2"]),
        *(separator.join(map(repr, r)).replace(".", ",") for r in rows()),
    ]
    r = read_recording(write(tmp_path / "x.csv", lines))
    np.testing.assert_array_equal(r.samples, np.array(rows()).T[1:])
    assert (r.channels[0].unit, r.channels[0].quantity) == ("g", "acceleration")


def test_units_in_header_and_in_a_row_of_their_own(tmp_path):
    lines = ["Time (ms),acc [m/s^2],tacho (V),left (top)"]
    lines += [f"{1000 * t!r},{a!r},{b!r},1" for t, a, b in rows()]
    r = read_recording(write(tmp_path / "x.csv", lines))
    assert [(c.name, c.unit, c.quantity) for c in r.channels] == [
        ("acc", "m/s^2", "acceleration"),
        ("tacho", "V", "tachometer"),
        ("left (top)", "", "unknown"),
    ]
    assert r.sampling_rate_hz == pytest.approx(FS_HZ)
    r = read_recording(
        write(tmp_path / "y.tsv", ["t\tacc\tmic", "s\tm/s^2\tPa", *("\t".join(map(repr, q)) for q in rows())])
    )
    assert [(c.name, c.unit) for c in r.channels] == [("acc", "m/s^2"), ("mic", "Pa")]


def test_preamble_comments_and_stated_rate(tmp_path):
    lines = ["# made by a logger", "Date: 2024-01-01", "Sampling rate: 25.6 kHz", "", "a,b", "1,2", "3.5,4", "5,6"]
    r = read_recording(write(tmp_path / "x.csv", lines))
    assert r.sampling_rate_hz == 25600
    assert r.channel_names == ("a", "b")
    np.savetxt(tmp_path / "y.txt", np.array(rows()), header="time a1 a2")
    assert read_recording(tmp_path / "y.txt").channel_names == ("a1", "a2")


@pytest.mark.parametrize("line", ["% fs = 1000", "sampling rate,1000", "Abtastrate: 1 kHz", "# sample_rate_hz;1e3"])
def test_stated_rate_is_no_header(tmp_path, line):
    for rows_ in (["1,2.5", "3,4"], ["1 2.5 3", "4 5 6"]):
        r = read_recording(write(tmp_path / "x.csv", [line, *rows_]))
        assert r.sampling_rate_hz == 1000
        assert r.channel_names[0] == "ch1"


def test_headerless(tmp_path):
    r = read_recording(write(tmp_path / "x.csv", [f"{a!r},{b!r}" for _, a, b in rows()]), sampling_rate_hz=10)
    assert r.channel_names == ("ch1", "ch2")
    assert r.sampling_rate_hz == 10
    r = read_recording(write(tmp_path / "y.csv", [f"{t!r},{b!r}" for t, _, b in rows()]))
    assert r.sampling_rate_hz == pytest.approx(FS_HZ)
    assert r.warnings[0] == "the first column increases uniformly and was taken as the time in seconds"


def test_row_counter_is_left_out(tmp_path):
    r = read_recording(write(tmp_path / "x.csv", [",a", *(f"{i},{i % 7}.5" for i in range(20))]), sampling_rate_hz=10)
    assert r.channel_names == ("a",)
    assert "only counts" in r.warnings[0]


def test_signs_bom_trailing_separator_quotes_and_utf16(tmp_path):
    text = '\ufeff"acc, x [g]";"b";\r\n+1.5;2;\r\n-1e-3;.5;\r\n 3. ; 4 ;\r\n'
    expected = [[1.5, -1e-3, 3.0], [2, 0.5, 4]]
    for encoding in ("utf-8", "utf-16"):
        (tmp_path / "x.csv").write_bytes(text.lstrip("\ufeff" if encoding == "utf-16" else "").encode(encoding))
        r = read_recording(tmp_path / "x.csv", sampling_rate_hz=1)
        assert r.channel_names == ("acc, x", "b")
        np.testing.assert_array_equal(r.samples, expected)


def test_gzip_and_one_column(tmp_path):
    with gzip.open(tmp_path / "x.csv.gz", "wb") as f:
        f.write(b"a\n1.25\n2.5\n")
    np.testing.assert_array_equal(read_recording(tmp_path / "x.csv.gz", sampling_rate_hz=2).samples, [[1.25, 2.5]])


def test_rate_precedence(tmp_path):
    path = write(tmp_path / "x.csv", ["time,a", *(f"{t!r},{a!r}" for t, a, _ in rows())])
    r = read_recording(path, sampling_rate_hz=1000)
    assert r.sampling_rate_hz == 1000
    assert "25600" in r.warnings[0]
    assert read_recording(path, sampling_rate_hz=25601).warnings == ()
    r = read_recording(path, sampling_rate_hz=25601, rig=Rig(sampling_rate_hz=1000))
    assert r.warnings == ("the sampling rate given, 25601 Hz, was taken; the rig file states 1000 Hz",)
    r = read_recording(path, rig=Rig(sampling_rate_hz=1000))
    assert r.sampling_rate_hz == pytest.approx(25600)
    assert "rig" in r.warnings[0]
    bare = write(tmp_path / "y.csv", ["a", "1.5", "2", "0.25"])
    assert read_recording(bare, rig=Rig(sampling_rate_hz=1000)).sampling_rate_hz == 1000
    with pytest.raises(InputError, match="--fs"):
        read_recording(bare)
    for bad in (0, -5, float("nan"), float("inf")):
        with pytest.raises(InputError, match=r"y\.csv.*Hz"):
            read_recording(bare, sampling_rate_hz=bad)


def test_rig_is_applied_and_provenance_names_the_file_only(tmp_path):
    path = write(tmp_path / "x.csv", ["a,n [rpm]", "1.5,100", "2,100", "0.25,100"])
    r = read_recording(path, rig=Rig(sensors=(Sensor("a", "acceleration", "g", "top", scale=2.0),)), sampling_rate_hz=1)
    np.testing.assert_array_equal(r.values("a"), [3, 4, 0.5])
    assert r.channels[0].position == "top"
    assert r.provenance.source == "x.csv"
    assert len(r.provenance.sha256) == 64
    assert r.speed == SpeedChannel("n")
    assert "taken as the shaft speed" in r.warnings[0]


@pytest.mark.parametrize(("digits", "n", "said"), [(".6f", 5000, 0), (".6g", 5000, 0), (".6g", 300_000, 1)])
def test_time_printed_with_few_digits_is_uniform(tmp_path, digits, n, said):
    """Counted from the point or from the first digit; where they hide steps, that is said."""
    lines = [f"{i / FS_HZ:{digits}},{i % 3}" for i in range(n)]
    recording = read_recording(write(tmp_path / "x.csv", ["time,a", *lines]))
    assert recording.sampling_rate_hz == pytest.approx(FS_HZ, rel=1e-5)
    assert [("missing samples would not show" in w) for w in recording.warnings] == [True] * said
    if n < 10_000:
        del lines[2500:2503]
        with pytest.raises(InputError, match="a gap of"):
            read_recording(write(tmp_path / "y.csv", ["time,a", *lines]))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda t: t.__setitem__(slice(30, None), t[30:] + 5), "a gap of .* before line 32"),
        (lambda t: t.__setitem__(20, t[19]), "does not increase at line 22"),
        (lambda t: t.__setitem__(20, t[18]), "does not increase at line 22"),
        (lambda t: t.__setitem__(20, t[20] + 0.37), "not uniform.*line 22"),
        (lambda t: t.__imul__(1 + 0.01 * np.linspace(0, 1, len(t))), "not uniform"),
    ],
)
def test_time_that_is_not_uniform(tmp_path, change, said):
    t = np.arange(50.0)
    change(t)
    with pytest.raises(InputError, match=rf"x\.csv, column 'time': .*{said}"):
        read_recording(write(tmp_path / "x.csv", ["time,a", *(f"{v!r},1.5" for v in t.tolist())]))


def test_jitter_below_one_percent_is_fine(tmp_path):
    t = np.arange(500) + np.random.default_rng(1).uniform(-0.007, 0.007, 500)
    t[[0, -1]] = 0, 499
    r = read_recording(write(tmp_path / "x.csv", ["time,a", *(f"{v!r},1.5" for v in t.tolist())]))
    assert r.sampling_rate_hz == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["a,b", "1,2", "3,x", "5,6"], "line 3, column 'b': 'x' is not a number"),
        (["a,b", "1,2", "", "3,4", "5,", "5,6"], "line 5, column 'b': the field is empty"),
        (["a,b", "1,2", "3,4", "5"], "line 4 has 1 of 2 columns.*cut off"),
        (["a,b", "1,2", "3,4", "5,6,7"], "line 4 has 3 of 2 columns"),
        (["a,b", "1,2", "3,4", "5,nan"], "'b' holds 1 NaN.*line 4"),
        (["a,b", "1,2", "3,4", "inf,6"], "'a' holds 1 NaN.*line 4"),
        (["a,b"], "no line of numbers"),
        (["<html><body>1,2"], "HTML"),
        (["time", "1", "2", "3"], "only column"),
        (["when,a", "1/2/24 00:00:01,2", "1/2/24 00:00:02,2"], "line 2 begins .*date and time are read as 2026-01"),
        (["when,a", "2024-02-30T00:00:01,2", "2024-02-30T00:00:02,2"], "line 2 begins .*date and time are read as"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02Z,2", "2024-01-01T00:00:03,2"], "line 3, .*a date"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02,2", "2024-01-01T00:00:02,2"], "does not increase at"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02,x"], "line 3, column 'a': 'x' is not a number"),
        (["when,a", "1678-01-01T00:00:01,2", "2261-01-01T00:00:02,2", "1679-01-01T00:00:02,2"], "does not increase"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02,2", "2024-02-30T00:00:02,2"], "line 4, .*not a date"),
        (["text,a", "b,2", "c,3"], "line 1 begins 'text,a'"),
        (["a;b", "999,5;2", "1.000,5;2", "3,5;4"], "line 3, column 'a': .* thousands separators"),
        (["a b", "1 2", "3 4", "5 1_0"], "line 4, column 'b': '1_0'"),
    ],
)
def test_broken_text(tmp_path, lines, said):
    with pytest.raises(InputError, match=said) as caught:
        read_recording(write(tmp_path / "x.csv", lines), sampling_rate_hz=1)
    text = str(caught.value)
    assert text.startswith("x.csv")
    assert "\n" not in text
    assert caught.value.allowed
    assert caught.value.remedy


def test_markup_in_names_stays_text(tmp_path):
    name = "<img src=x onerror=alert(1)>"
    r = read_recording(write(tmp_path / "x.csv", [f"a,{name}", "1,2", "3,4"]), sampling_rate_hz=1)
    assert r.channel_names[1] == name


def test_axes_before_names_and_units(tmp_path):
    lines = ["Serial Number:\t12345", "X:Time (Seconds)\tY:(g)", *("\t".join(map(repr, row[:2])) for row in rows())]
    r = read_recording(write(tmp_path / "x.csv", lines))
    assert (r.channel_names, r.channels[0].unit) == (("column 2",), "g")
    assert r.sampling_rate_hz == pytest.approx(FS_HZ)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("zone", ["", "Z", "+01:00"])
@pytest.mark.parametrize("between", ["T", " "])
@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("name", ["timestamp", "when", None])
def test_dates_and_times_are_the_time(tmp_path, separator, zone, between, quote, name):
    start = np.datetime64("2026-01-01T23:59:59.9", "us")  # over midnight
    stamps = [str(start + np.timedelta64(round(1e6 * t), "us")).replace("T", between) for t, _, _ in rows(5000)]
    lines = [] if name is None else [separator.join([name, "acc (g)"])]
    values = [a for _, a, _ in rows(5000)]
    lines += [f"{quote}{stamp}{zone}{quote}{separator}{a!r}" for stamp, a in zip(stamps, values, strict=True)]
    r = read_recording(write(tmp_path / "x.csv", lines))
    assert r.sampling_rate_hz == pytest.approx(FS_HZ, rel=1e-5)  # stamps are rounded to a microsecond
    np.testing.assert_array_equal(r.samples, [values])
    if name is not None:
        assert [(c.name, c.unit) for c in r.channels] == [("acc", "g")]


def test_the_first_bad_line_is_named_not_the_last_of_a_sample(tmp_path):
    lines = ["timestamp,acc", *(f"01/01/26 00:00:00.{i:06},{i}" for i in range(20_000))]
    with pytest.raises(InputError, match="line 2 begins"):
        read_recording(write(tmp_path / "x.csv", lines))


@pytest.mark.parametrize("decimal", [".", ","])
def test_export_with_events_above_the_table(tmp_path, decimal):
    head = [
        *("Data info", "File name: run_0001.dxd", "Start time: 2/16/2024 11:20:33.000", "Number of channels: 2"),
        *("Sample rate: 25600", "Store type: always fast", "", "Events", "Event Type\tEvent\tTime\tComment"),
        *("1\tstoring started at\t11:20:33.500\t", "2\tstoring stopped at\t11:20:43.500\t", "", "Data1"),
    ]
    numbers = ["\t".join(map(repr, row)).replace(".", decimal) for row in rows()]
    r = read_recording(write(tmp_path / "x.txt", [*head, "Time (s)\tAI 1 (m/s2)\tAI 2 (V)", *numbers]))
    assert [(c.name, c.unit) for c in r.channels] == [("AI 1", "m/s2"), ("AI 2", "V")]
    assert r.sampling_rate_hz == 25600


def test_rows_that_stand_twice_are_no_rounded_time(tmp_path):
    time_s = np.repeat(np.arange(0, 2000, 2) / 1e4, 2)
    path = tmp_path / "doubled.csv"
    path.write_text("time,a1\n" + "".join(f"{t:.4f},{np.sin(300 * t):.6f}\n" for t in time_s))
    with pytest.raises(InputError, match=r"line 3.*duplicate"):
        read_recording(path)


def read_text(tmp_path, text, name="x.csv", **more):
    (tmp_path / name).write_bytes(text.encode("cp1252"))
    return read_recording(tmp_path / name, **more)


def table(columns, separator=";", decimal=",", n=50):
    """Return rows: the time from 0 in steps of a millisecond, and a different wave in each further column."""
    numbers = [[f"{i / 1000:.6f}", *(f"{np.sin(i + k):.5f}" for k in range(columns))] for i in range(n)]
    return "".join(separator.join(row).replace(".", decimal) + "\r\n" for row in numbers)


def described(recording):
    return [(c.name, c.unit) for c in recording.channels], recording.sampling_rate_hz


@pytest.mark.parametrize(
    ("head", "found"),
    [
        ("Zeit;a;b\r\ns;m/s²;µm\r\n", [("a", "m/s²"), ("b", "µm")]),
        ("Zeit  1 - Standardmessrate [s];a [m/s²];b [V];\r\n", [("a", "m/s²"), ("b", "V")]),
        ("Zeit;a;b\r\ns;g;g\r\nT0 = 1.1.26;T0 = 1.1.26;T0 = 1.1.26\r\nNAME=Z;SN=1;SN=2\r\n", [("a", "g"), ("b", "g")]),
        ("Name;a;b\r\nSample rate;1000;1000\r\nTime [s];a [g];a [g]\r\n", [("a (2)", "g"), ("a (3)", "g")]),
        ("Sampling frequency (Hz):;1000\r\nY unit:;g;mm/s\r\n\r\nX;a;b\r\n", [("a", "g"), ("b", "mm/s")]),
        ("Amplitude Units: G-s\r\nTime(s);a;b\r\n", [("a", "G-s"), ("b", "G-s")]),
    ],
)  # fmt: skip
def test_headers_of_measurement_programs(tmp_path, head, found):
    assert described(read_text(tmp_path, head + table(2))) == (found, pytest.approx(1000))


@pytest.mark.parametrize("times", ["One", "No"])
@pytest.mark.parametrize("decimal", [".", ","])
def test_labview_measurement(tmp_path, times, decimal):
    head = [
        *("LabVIEW Measurement\t", "Separator\tTab", "Date\t2026/01/31", "***End_of_Header***\t", "\t\t\t"),
        *("Channels\t2\t\t", "Samples\t50\t50\t", "Y_Unit_Label\tg\tVolts\t", "X_Dimension\tTime\tTime\t"),
        *(f"Delta_X\t1{decimal}0E-3\t1{decimal}0E-3\t", "***End_of_Header***\t\t\t", "X_Value\tAcc\tTacho\tComment"),
    ]
    rows_ = table(2, "\t", decimal).splitlines()
    if times == "No":
        rows_ = ["\t" + line.partition("\t")[2] for line in rows_]
    r = read_text(tmp_path, "\r\n".join([*head, *rows_]), "x.lvm")
    assert described(r) == ([("Acc", "g"), ("Tacho", "Volts")], pytest.approx(1000))
    assert r.samples.shape == (2, 50)


def test_rows_are_counted_before_the_time(tmp_path):
    lines = [f"{i}\t{(i - 1) * 1e-3:.7E}\t{np.sin(i):.6E}" for i in range(1, 51)]
    r = read_text(tmp_path, "\n".join(["X-axis unit:\t s", "Amplitude unit:\t m/s^2", "", *lines]))
    assert described(r) == ([("ch3", "m/s^2")], pytest.approx(1000))


def test_a_speed_in_the_name_is_offered_where_nothing_tells_it(tmp_path):
    text = table(2, ",", ".")
    read, nominal = read_text(tmp_path, text, "a_1000rpm.csv"), OperatingPoint(speed_rpm=990)
    assert read.speed_source is None
    assert [w for w in read.warnings if "--speed-rpm 1000 " in w]
    for known in ({"speed": ConstantSpeed(990)}, {"rig": Rig(operating_point=nominal)}):
        read = read_recording(tmp_path / "a_1000rpm.csv", **known)
        assert read.speed_source == ConstantSpeed(990)
        assert not [w for w in read.warnings if "1000" in w]


def clock(i, hour):
    """Return second `i` after a minute before the full hour."""
    return f"{hour + i // 60}:{(59, 0)[i // 60]:02d}:{i % 60:02d}"


@pytest.mark.parametrize(
    ("stamp", "rate_hz"),
    [
        (lambda i: f"31.01.2026 23:59:{59 + i / 100:05.2f}".replace(".", ",", 3).replace(",", ".", 2), 100),
        (lambda i: f"1.3.2026 9:05:{i / 100:06.3f}", 100),
        (lambda i: f"2026/01/31;14:22:{i / 100:06.3f}", 100),
        (lambda i: f"14:22:{i / 100:06.3f}", 100),
        (lambda i: f"{('31/1', '1/2')[i // 60]}/2026;{clock(i, 23).replace('24:', '0:')}", 1),
        (lambda i: f"{('1/31', '2/1')[i // 60]}/2026 {clock(i, 11)} {'PA'[i // 60]}M", 1),
        (lambda i: f"{1 + i // 60}/2/2026 {clock(i, 11)} {'PA'[i // 60]}M", 1),
        (lambda i: f"{clock(i, 11)} {'AP'[i // 60]}M", 1),
        (lambda i: f"{clock(i, 12).replace('13:', '1:')}pm", 1),
    ],
)
@pytest.mark.parametrize("head", ["", "Date;Time;a\n"])
def test_dates_as_people_write_them(tmp_path, stamp, rate_hz, head):
    lines = [f"{stamp(i)};{np.sin(i):.4f}" for i in range(90)]
    if head and lines[0].count(";") == 1:
        head = "when;a\n"
    r = read_text(tmp_path, head + "\n".join(lines))
    assert r.sampling_rate_hz == pytest.approx(rate_hz, rel=1e-6)
    assert r.samples.shape == (1, 90)
    lines[40] = lines[40].replace(":", ":x")
    with pytest.raises(InputError, match=f"line {41 + bool(head)}"):
        read_text(tmp_path, head + "\n".join(lines))


@pytest.mark.parametrize(("separator", "form"), [(",", "d"), (";", ".5g")])
def test_hour_minute_second_and_microseconds_are_the_time(tmp_path, separator, form):
    t = 34779.965 + np.arange(500) / 25600  # into the next second
    parts = [(9, 39, int(s) % 60, round(s % 1 * 1e6) % 1_000_000) for s in t]
    fraction = [f"{p[3]:{form}}" for p in parts]
    waves = [(f"{np.sin(i):.4f}", "0.5") for i in range(500)]
    lines = [separator.join((*map(str, p[:3]), f, *w)) for p, f, w in zip(parts, fraction, waves, strict=True)]
    r = read_text(tmp_path, "\n".join(lines))
    assert (r.channel_names, r.sampling_rate_hz) == (("ch5", "ch6"), pytest.approx(25600, rel=1e-3))


@pytest.mark.parametrize(
    "head",
    [
        *(
            "Frequency (Hz),Amplitude (mm/s RMS)\n",
            "Freq(CPM),Amplitude\n",
            "Ordnung [-],a [g]\n",
            "X-axis unit: Hz\nx,y\n",
        ),
        "",
    ],
)
def test_a_spectrum_is_no_signal(tmp_path, head):
    lines = "\n".join(f"{0.64 * i:.2f},{abs(np.sin(i)):.5f}" for i in range(400))
    with pytest.raises(InputError, match="spectrum"):
        read_text(tmp_path, head + lines, sampling_rate_hz=1000.0)


def test_what_has_no_ending_is_known_by_its_content(tmp_path):
    text = "\n".join(f"{np.sin(i):.3f}\t{np.cos(i):.3f}" for i in range(50))
    for name in ("2004.02.12.10.32.39", "run", "7"):
        assert read_text(tmp_path, text, name, sampling_rate_hz=20_000.0).samples.shape == (2, 50)
    with pytest.raises(InputError, match="not known"):
        read_text(tmp_path, text, "run.a39", sampling_rate_hz=20_000.0)


def test_pulses_are_a_tachometer_whatever_they_are_called(tmp_path):
    rng, n = np.random.default_rng(1), 4000
    turns = np.arange(n) / 80
    pulses = np.where(turns % 1 < 0.1, 4.6, -0.5) + 0.03 * rng.standard_normal(n)
    impacts = rng.standard_normal(n) + np.where(turns % 1 < 0.03, 25.0, 0.0) * rng.random(n)
    columns = np.array([pulses, impacts, np.clip(impacts, -0.8, 0.8), np.sign(np.sin(0.3 * turns)) * 2.0]).T
    np.savetxt(tmp_path / "x.csv", columns, delimiter=",", fmt="%.5g")
    r = read_recording(tmp_path / "x.csv", sampling_rate_hz=4000.0)
    assert [c.quantity for c in r.channels] == ["tachometer", "unknown", "unknown", "tachometer"]
    assert any("ch1" in w and "pulses_per_revolution" in w for w in r.warnings)
    r = read_recording(tmp_path / "x.csv", rig=Rig(speed=TachometerChannel("ch1")), sampling_rate_hz=4000.0)
    assert not any("pulses_per_revolution" in w for w in r.warnings)


def test_the_channel_that_tells_the_speed_is_no_vibration(tmp_path):
    path = write(tmp_path / "x.csv", ["a,n", *(f"{np.sin(i):.4f},{1500 + np.cos(i):.4f}" for i in range(50))])
    told = [None, Rig(speed=SpeedChannel("n"))]
    names = [read_recording(path, rig=rig, sampling_rate_hz=10.0).vibration_names() for rig in told]
    assert names == [("a", "n"), ("a",)]
