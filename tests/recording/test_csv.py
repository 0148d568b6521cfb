"""Text files: layouts that are read, and what is said about those that are not."""

import gzip

import numpy as np
import pytest

from gearsig.errors import InputError
from gearsig.recording import read_recording
from gearsig.rig import Rig, Sensor, SpeedChannel

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
    assert "taken for the time" in r.warnings[0]


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
        (["when,a", "1/2/2024 00:00:01,2", "1/2/2024 00:00:02,2"], "line 2 begins .*date and time are read as 2026-01"),
        (["when,a", "2024-02-30T00:00:01,2", "2024-02-30T00:00:02,2"], "line 2 begins .*date and time are read as"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02Z,2", "2024-01-01T00:00:03,2"], "line 3, .*no date"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02,2", "2024-01-01T00:00:02,2"], "does not increase at"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02,x"], "line 3, column 'a': 'x' is not a number"),
        (["when,a", "1678-01-01T00:00:01,2", "2261-01-01T00:00:02,2", "1679-01-01T00:00:02,2"], "does not increase"),
        (["when,a", "2024-01-01T00:00:01,2", "2024-01-01T00:00:02,2", "2024-02-30T00:00:02,2"], "line 4, .*no date"),
        (["text,a", "b,2", "c,3"], "line 1 begins 'text,a'"),
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
    lines = ["timestamp,acc", *(f"01/01/2026 00:00:00.{i:06},{i}" for i in range(20_000))]
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
    with pytest.raises(InputError, match=r"line 3.*doubled"):
        read_recording(path)
