"""Files that are not what they say: each ends in one line that names file, place, allowed and remedy."""

import gzip
import json
import os
import pickle
import subprocess
import sys
import time
import tracemalloc
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest
from scipy.io import savemat, wavfile

from gearsig.errors import InputError
from gearsig.recording import Channel, Recording, read_pulse_times, read_recording, write_recording
from gearsig.rig import rig_file_beside

EXTENSIONS = (".csv", ".txt", ".csv.gz", ".mat", ".wav", ".h5", ".parquet", ".tdms", ".uff")


class Trap:
    """A pickle that would leave a mark if it were opened."""

    def __init__(self, mark):
        self.mark = mark

    def __reduce__(self):
        return os.mkdir, (self.mark,)


def refused(path, match=None, **more):
    with pytest.raises(InputError, match=match) as caught:
        read_recording(path, sampling_rate_hz=100, **more)
    error = caught.value
    assert path.name in str(error)
    assert "\n" not in str(error)
    assert error.allowed
    assert error.remedy
    return error


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_empty_file(tmp_path, extension):
    path = tmp_path / f"x{extension}"
    path.touch()
    refused(path, "is empty")


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_two_gigabytes_of_zeros(tmp_path, extension):
    path = tmp_path / f"x{extension}"
    with path.open("wb") as file:
        file.truncate(2 << 30)
    tracemalloc.start()
    begin = time.perf_counter()
    refused(path, "zero bytes")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 5e6
    assert time.perf_counter() - begin < 2


def test_zeros_behind_a_good_beginning(tmp_path):
    savemat(tmp_path / "x.mat", {"a": np.arange(100.0)})
    wavfile.write(tmp_path / "x.wav", 100, np.arange(100, dtype=np.int16))
    (tmp_path / "x.csv").write_text("a,b\n1,2\n3,4\n" * 3)
    for name in ("x.mat", "x.csv"):
        with (tmp_path / name).open("r+b") as file:
            file.truncate(2 << 30)
        refused(tmp_path / name, "zero bytes")


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
def test_pickle_is_never_opened(tmp_path, extension, protocol):
    path, mark = tmp_path / f"x{extension}", tmp_path / "mark"
    path.write_bytes(pickle.dumps(Trap(str(mark)), protocol))
    refused(path, "pickle")
    assert not mark.exists()


def test_numpy_files_are_not_read(tmp_path):
    np.save(tmp_path / "x.npy", np.zeros(5))
    refused(tmp_path / "x.npy", "NumPy array")
    (tmp_path / "x.npy").replace(tmp_path / "x.csv")
    refused(tmp_path / "x.csv", "NumPy array")
    (tmp_path / "y.npy").write_bytes(pickle.dumps([1]))
    refused(tmp_path / "y.npy", "pickle")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"PK\x03\x04" + b"x" * 50, "ZIP"),
        (b"<!DOCTYPE html><p>404", "HTML"),
        (b"%PDF-1.4", "PDF"),
        (b"time,a\n0,1\n1,2\n", "CSV text"),
        (os.urandom(3) + bytes(range(32)) * 8, "binary data"),
    ],
)
@pytest.mark.parametrize("extension", [".mat", ".wav", ".h5", ".parquet", ".tdms", ".uff"])
def test_content_of_another_kind(tmp_path, extension, content, said):
    path = tmp_path / f"x{extension}"
    path.write_bytes(content)
    refused(path, f"the extension says .*, but the content is .*{said}")


def test_names_that_are_no_files(tmp_path):
    (tmp_path / "recording.csv").write_text("a\n1\n2\n")
    assert "did you mean recording.csv?" in str(refused_missing(tmp_path / "recordng.csv"))
    unlike = str(refused_missing(tmp_path / "machine12.csv"))
    assert "did you mean" not in unlike
    assert str(tmp_path) in unlike
    refused(tmp_path, "is a folder.*gearsig report")
    os.mkfifo(tmp_path / "pipe.csv")
    refused(tmp_path / "pipe.csv", "no regular file")
    (tmp_path / "x.xyz").write_text("1,2\n")
    refused(tmp_path / "x.xyz", r"extension '\.xyz' is not known")
    refused_missing(tmp_path / "nul\0l.csv")
    refused_missing(tmp_path / ".." / "none" / "x.csv")


def refused_missing(path):
    with pytest.raises(InputError, match="cannot be opened") as caught:
        read_recording(path)
    return caught.value


def test_gzip_that_is_cut_damaged_or_a_bomb(tmp_path):
    good = gzip.compress(b"a,b\n" + b"1.25,2\n" * 10_000)
    path = tmp_path / "x.csv.gz"
    path.write_bytes(good[:-30])
    refused(path, "damaged or cut off")
    path.write_bytes(good[:40] + b"\xff\xff\xff" + good[43:])
    refused(path)
    with gzip.open(path, "wb", compresslevel=9) as file:
        for _ in range(100):
            file.write(b"0,0\n" * (1 << 18))
    refused(path, "200 times")
    path.write_bytes(gzip.compress(bytes(1 << 26)))
    refused(path, "zero bytes")
    path.replace(tmp_path / "x.mat.gz")
    refused(tmp_path / "x.mat.gz", "only text files are read compressed")


def make(path):
    x = np.random.default_rng(1).standard_normal(5000)
    if path.suffix == ".mat":
        savemat(path, {"a": x, "s": {"b": x, "fs": 100.0}}, do_compression="z" in path.stem)
    elif path.suffix == ".h5":
        with h5py.File(path, "w") as file:
            file["a"] = x
    else:
        wavfile.write(path, 100, x.astype(np.float32))
    return path


@pytest.mark.parametrize("name", ["x.mat", "z.mat", "x.h5", "x.wav"])
@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.9, 0.999])
def test_truncated(tmp_path, name, share):
    path = make(tmp_path / name)
    data = path.read_bytes()
    path.write_bytes(data[: max(1, int(share * len(data)))])
    refused(path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["x.mat", "z.mat", "x.h5", "x.wav"])
def test_flipped_bytes_give_a_recording_or_one_line(tmp_path, name):
    data = make(tmp_path / name).read_bytes()
    rng = np.random.default_rng(5)
    for i in range(150):
        broken = bytearray(data)
        for at in rng.integers(0, min(len(data), 3000 if i % 2 else len(data)), 3):
            broken[at] = rng.integers(256)
        path = tmp_path / f"b{name}"
        path.write_bytes(broken)
        try:
            read_recording(path, sampling_rate_hz=100)
        except InputError as error:
            assert path.name in str(error)  # noqa: PT017  either outcome is right, anything else is not


def test_packed_bomb_in_mat(tmp_path, monkeypatch):
    monkeypatch.setattr("gearsig.recording._limits.available_memory_bytes", lambda: 1 << 24)
    savemat(tmp_path / "x.mat", {"s": {"a": np.zeros(1 << 21)}, "fs": 1.0}, do_compression=True)
    assert (tmp_path / "x.mat").stat().st_size < 1 << 15
    refused(tmp_path / "x.mat", "of memory")


TABLE = "1.0,2.0\n1.5,2.5\n" * 20


@pytest.mark.parametrize("sign", ["1", " ", "\t", "[", "(", "= ", "a(", '"', ":"])
@pytest.mark.parametrize("ending", ["", "x", "b,c"])
def test_long_runs_of_one_sign_cost_no_more_than_their_length(tmp_path, sign, ending):
    path = tmp_path / "x.csv"
    path.write_text("a" + sign * 100_000 + ending + "\n" + TABLE)
    begin = time.process_time()
    for read in (read_recording, read_pulse_times):
        with suppress(InputError):
            read(path)
    assert time.process_time() - begin < 5  # the square of it would be hours


def test_many_lines_of_digits_that_are_no_table(tmp_path):
    path = tmp_path / "x.csv"
    path.write_text(("1" * 200 + "x\n") * 5000 + TABLE)
    begin = time.process_time()
    with pytest.raises(InputError, match="no line of numbers"):
        read_recording(path)
    assert time.process_time() - begin < 5


def test_gzip_without_content_and_a_bare_return_in_quotes(tmp_path):
    (tmp_path / "x.csv.gz").write_bytes(gzip.compress(b""))
    refused(tmp_path / "x.csv.gz", "empty")
    (tmp_path / "x.csv").write_text('"1\r2",3\n' * 9, newline="")
    refused(tmp_path / "x.csv")


@pytest.mark.parametrize(
    "change",
    [
        {"truth": 5},
        {"truth": [1]},
        {"sampling_rate_hz": 10**400},
        {"speed": {"kind": "constant", "speed_rpm": 10**400}},
        {"speed": {"kind": "pulse_times", "times_s": 5, "pulses_per_revolution": 10**400, "shaft": 5}},
        {"channels": 5},
    ],
)
def test_description_that_is_not_what_was_written(tmp_path, change):
    path = write_recording(Recording(np.zeros((1, 9)), 1.0, (Channel("a"),)), tmp_path / "x.csv")
    first, rest = path.read_text().split("\n", 1)
    facts = json.loads(first.removeprefix("# gearsig: ")) | change
    path.write_text(f"# gearsig: {json.dumps(facts)}\n{rest}")
    refused(path)


def test_text_beside_numbers_is_not_unpacked(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    texts = pa.DictionaryArray.from_arrays(pa.array(np.zeros(40_000, np.int32)), pa.array(["x" * 50_000]))
    parquet.write_table(pa.table({"a": -np.arange(40_000.0), "text": texts}), tmp_path / "x.parquet")
    most = pa.default_memory_pool().max_memory()
    assert read_recording(tmp_path / "x.parquet", sampling_rate_hz=1.0).channel_names == ("a",)
    assert pa.default_memory_pool().max_memory() < most + 50e6  # the texts are 2 GB


@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_types_that_contradict_the_rest_of_the_file_do_not_end_the_process(tmp_path, ending):
    import pyarrow as pa
    from pyarrow import parquet

    path, x = tmp_path / f"x{ending}", np.random.default_rng(0).standard_normal(40)
    if ending == ".h5":
        with h5py.File(path, "w") as file:
            file["a"] = x
            file["a"].attrs["unit"] = "m/s^2"
        # Of class 9, of any length: a text becomes what there is not.
        right, wrong = b"\x19\x01\x01\x00\x10\x00", b"\x19\x2d\x01\x00\x10\x00"
    else:
        parquet.write_table(pa.table({"a": x}), path)
        # A column that may be null becomes one that may not, but has counts of nulls.
        right, wrong = b"\x15\x0a\x25\x02\x18\x01a", b"\x15\x0a\x25\x00\x18\x01a"
    content = path.read_bytes()
    assert content.count(right) == 1
    path.write_bytes(content.replace(right, wrong))
    script = f"from gearsig.recording import read_recording; read_recording({str(path)!r}, sampling_rate_hz=1.0)"
    run = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False)
    assert run.returncode == (0 if ending == ".h5" else 1), run.stderr
    assert ending == ".h5" or "x.parquet: cannot be read as Parquet" in run.stderr


@pytest.mark.parametrize("damage", ["endless", "huge"])
def test_units_in_a_damaged_heap_of_texts(tmp_path, damage):
    path = tmp_path / "x.h5"
    with h5py.File(path, "w") as file:
        file["a"] = np.random.default_rng(0).standard_normal(40)
        file["a"].attrs["unit"] = "m/s^2"
    assert read_recording(path, sampling_rate_hz=1.0).channels[0].unit == "m/s^2"
    content = bytearray(path.read_bytes())
    if damage == "endless":  # what follows the text is zero bytes long
        at = content.index(b"GCOL") + 16 + 16 + 8 + 8
        content[at : at + 8] = bytes(8)
    else:  # the reference says 4 GB
        at = content.index(b"\x05\0\0\0", content.index(b"unit\0"))
        content[at : at + 4] = b"\xf0\xff\xff\xff"
    path.write_bytes(content)
    begin = time.process_time()  # of this process: the other one is ended after two seconds of its own
    refused(path)
    assert time.process_time() - begin < 2


@pytest.mark.parametrize("part", [None, slice(0, 9)])
@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_numbers_that_are_packed_to_almost_nothing(tmp_path, ending, part):
    import pyarrow as pa
    from pyarrow import parquet

    path = tmp_path / f"x{ending}"
    if ending == ".h5":
        with h5py.File(path, "w") as file:
            file.create_dataset("a", (1 << 28,), "f4", chunks=(1 << 20,), compression="gzip")[:9] = 1
            file["again"] = file["a"]
    else:
        parquet.write_table(pa.table({"a": np.zeros(1 << 25, np.float32)}), path)
    refused(path, "200 times", part=part)


@pytest.mark.parametrize("part", [None, slice(0, 9)])
def test_small_dataset_in_a_huge_chunk(tmp_path, part):
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file.create_dataset("a", (300,), "f8", chunks=(1 << 28,), maxshape=(None,), compression="gzip")
    refused(tmp_path / "x.h5", "200 times", part=part)


@pytest.mark.parametrize("ending", [".h5", ".parquet"])
def test_a_part_takes_the_memory_of_what_is_unpacked_with_it(tmp_path, ending, monkeypatch):
    import pyarrow as pa
    from pyarrow import parquet

    path, x = tmp_path / f"x{ending}", np.random.default_rng(0).standard_normal(1 << 17)
    monkeypatch.setattr("gearsig.recording._limits.free_memory_bytes", lambda: 1e6)  # whole, it takes 4 MB
    for n, fits in ((1 << 17, False), (1 << 10, True)):
        if ending == ".h5":
            with h5py.File(path, "w") as file:
                file.create_dataset("a", data=x, chunks=(n,), compression="gzip")
        else:
            parquet.write_table(pa.table({"a": x}), path, row_group_size=n)
        if fits:
            assert read_recording(path, sampling_rate_hz=1.0, part=slice(5, 9)).n_samples == 4
        else:
            refused(path, "of memory", part=slice(5, 9))


def test_name_that_is_no_utf8_and_one_as_long_as_names_can_be(tmp_path):
    path = Path(os.fsdecode(os.fsencode(tmp_path) + b"/a\xff.csv"))
    path.write_text(TABLE)
    read_recording(path, sampling_rate_hz=1.0).name.encode()
    path = path.replace(tmp_path / ("x" * 251 + ".csv"))
    assert rig_file_beside(path) is None
    assert read_recording(path, sampling_rate_hz=1.0).n_samples == 40
    refused_missing(tmp_path / ("x" * 300 + ".csv"))
    refused_missing(tmp_path / ("x" * 300 + ".csv#2"))


def test_time_that_falls_back_is_found_in_little_memory(tmp_path):
    path, time_s = tmp_path / "x.h5", np.arange(1 << 19) / 100.0
    time_s[1000] = 0.0
    with h5py.File(path, "w") as file:
        file["time"], file["a"] = time_s, np.random.default_rng(0).standard_normal(1 << 19)
    refused(path)
    tracemalloc.start()
    refused(path, "does not increase at sample 1000")
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 7 * time_s.nbytes
