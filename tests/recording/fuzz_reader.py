"""Mutates small files that are made here and reads each: run as a process, so that its memory and time are its own.

    python fuzz_reader.py KIND N_FILES SEED FOLDER

It prints a line for each file that ends in anything but a result or an error of gearsig, takes over 5 s of processor
time, or more than twice its decoded size and 200 MB; the file stays in the folder. A hang of two minutes, more than a
reader's own process is waited for, or a crash ends the process.
"""

import faulthandler
import gzip
import io
import struct
import sys
import time
import traceback
import warnings
from contextlib import suppress
from pathlib import Path

import numpy as np

from gearsig.errors import GearsigError
from gearsig.recording import Channel, Recording, read_pulse_times, read_recording, write_recording
from gearsig.rig import ConstantSpeed, PulseTimes, TachometerChannel, read_rig
from sims.presets import read_preset

LONGEST_S = 5.0
SPARE_BYTES = 200e6


def recording(n=400, **more):
    rng = np.random.default_rng(0)
    channels = (Channel("a [1]", "acceleration", "m/s^2", "left"), Channel("tacho", "tachometer", "V"))
    x = rng.standard_normal((2, n)).astype(np.float32)
    return Recording(x, 1000.0, channels, truth={"crack": [1, {"mm": 2.0}]}, warnings=("one",), **more)


def written(ending, folder, **more):
    return write_recording(recording(**more), folder / f"seed{ending}").read_bytes()


def csv_seeds(folder):
    rows = "".join(f"0,{i:02};{i % 7},5;{-i}e-3\n" for i in range(60))
    yield f"# fs = 25600\nName: x\nzeit [s];a (g);b [mm/s]\n{rows}".encode()
    yield b"time,a,b\n[s],[g],(m)\n" + b"".join(b"%.2f,%d,2e1\n" % (i, i) for i in range(60))
    yield b"".join(b" %d   %.3f\t%d \r\n" % (i, i / 7, i) for i in range(60))
    rows = "".join(f"\t0,{i % 9}\t{5 * (i % 8 > 5)}\n" for i in range(120))
    yield f"Y_Unit_Label\tg\tV\nDelta_X\t1,0E-3\t1,0E-3\nX_Value\tm/s²\tTacho\tComment\n{rows}".encode("cp1252")
    yield b"Date;Time;a;b\n" + b"".join(b"31.01.2026;9:59:59,%02d;%d;1\n" % (i, i % 5) for i in range(60))
    yield b"".join(b"9,39,59,%d,%d,0.5\n" % (39 * i, i % 5) for i in range(60))
    yield written(".csv", folder, speed=PulseTimes(np.arange(5.0), 1, "s"))
    yield written(".csv", folder, n=30).decode().encode("utf-16")


def gzip_seeds(folder):
    yield from (gzip.compress(seed) for seed in csv_seeds(folder) if b"\0" not in seed)


def mat_seeds(folder):
    from scipy.io import savemat

    x = np.arange(200.0)
    cell = np.array([x, "text", np.array([[1, 2]])], dtype=object)
    contents = {"a": x, "fs": 100.0, "s": {"b": x, "unit": "g", "t": {"u": x}}, "c": cell, "i": x.astype(np.int8)}
    fields = [("Name", object), ("Data", object), ("Unit", object)]
    channels = [("v", x, "g"), ("n", x[::4], "rpm"), ("Time", x, "s"), ("Time", x[::4], "s"), ("tach", x[:9], "s")]
    axis = {"x_values": {"increment": 0.1, "quantity": {"label": "s"}}, "function_record": {"name": cell[1:2]}}
    axis |= {"y_values": {"values": x, "quantity": {"label": "g"}}}
    for held in (contents, {"Y": np.array(channels, fields)}, {"f": axis}):
        for packed in (False, True):
            stream = io.BytesIO()
            savemat(stream, held, do_compression=packed)
            yield stream.getvalue()
    yield written(".mat", folder)
    header = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    yield header.ljust(512, b"\0") + hdf5_bytes(folder, userblock=True)[512:]


def hdf5_bytes(folder, *, userblock=False):
    import h5py

    x = np.arange(400.0, dtype=np.float32)
    path = folder / "seed.hdf"
    with h5py.File(path, "w", userblock_size=512 if userblock else 0) as file:
        file["group/a"] = x
        packed = file.create_dataset("b", data=np.stack([x, -x]), chunks=(1, 50), compression="gzip", shuffle=True)
        packed.attrs["unit"], file.attrs["fs"] = "m/s^2", 100.0
        packed.attrs["MATLAB_class"] = b"double"
        file["text"] = "words"
        file["link"] = h5py.SoftLink("/b")
    return path.read_bytes()


def hdf5_seeds(folder):
    yield hdf5_bytes(folder)
    yield written(".h5", folder, speed=TachometerChannel("tacho", 1))


def parquet_seeds(folder):
    import pyarrow as pa
    from pyarrow import parquet

    x = np.arange(300)
    table = pa.table({"t [s]": x / 100, "a (g)": (x % 5).astype(np.float32), "n": x, "text": [str(i) for i in x]})
    for packed in ("snappy", "zstd", "none"):
        stream = io.BytesIO()
        parquet.write_table(table.replace_schema_metadata({"fs": "100"}), stream, compression=packed, row_group_size=99)
        yield stream.getvalue()
    yield written(".parquet", folder)


def wav_seeds(folder):
    from scipy.io import wavfile

    for kind in (np.int16, np.int32, np.uint8, np.float32, np.float64):
        stream = io.BytesIO()
        wavfile.write(stream, 1000, np.arange(300).reshape(-1, 2).astype(kind))
        yield stream.getvalue()
    lea = b"".join(
        b"le%02d" % i + struct.pack("<IfH1sH1sff", 4 + 2 + 1 + 2 + 1 + 8, 2.0, 1, b"%d" % i, 1, b"g", 0.0, 1.0)
        for i in range(2)
    )
    yield stream.getvalue() + b"LEA " + struct.pack("<I", len(lea)) + lea
    yield written(".wav", folder, speed=ConstantSpeed(600.0))


def tdms_seeds(folder):
    from nptdms import ChannelObject, RootObject, TdmsWriter

    for n_segments in (1, 3):
        stream = io.BytesIO()
        with TdmsWriter(stream) as writer:
            for i in range(n_segments):
                channel = ChannelObject("group", "a", np.arange(100.0) + i, {"wf_increment": 0.01, "unit_string": "g"})
                texts = ChannelObject("group", "t", ["x", "yy"])
                writer.write_segment([RootObject({"fs": 100.0}), channel, *([texts] if n_segments == 1 else [])])
        yield stream.getvalue()


def uff_seeds(folder):
    import pyuff

    x = np.arange(60.0)
    for binary in (0, 1):
        path = folder / "seed.uff"
        path.unlink(missing_ok=True)
        signal = {
            "type": 58,
            "binary": binary,
            "func_type": 1,
            "rsp_node": 1,
            "rsp_dir": 3,
            "ref_node": 1,
            "ref_dir": 1,
            "ordinate_spec_data_type": 12,
            "abscissa_spec_data_type": 17,
            "orddenom_spec_data_type": 0,
            "data": np.sin(x),
            "x": x / 100,
            "id1": "run",
        }
        pyuff.UFF(str(path)).write_sets(signal, "add")
        yield path.read_bytes()


def mf4_seeds(folder):
    from asammdf import MDF, Signal

    t = np.arange(100) / 100
    for version, ending in (("4.10", "mf4"), ("3.30", "mdf")):
        with MDF(version=version) as file:
            file.append([Signal(np.sin(t), t, name="a", unit="g"), Signal((t * 100).astype(np.int16), t, name="b")])
            path = Path(file.save(folder / f"seed.{ending}", overwrite=True))
        yield path.read_bytes()


def pulse_seeds(folder):
    yield b"pulse [ms]\n" + b"".join(b"%d.25\n" % i for i in range(80))
    yield b"".join(b"%d.5 \r\n" % i for i in range(80))


def toml_seeds(folder):
    import sims.presets
    from gearsig.rig import read_rig

    example = Path(__file__).parents[2] / "app" / "cli" / "example_rig.toml"
    read_rig(example)
    yield example.read_bytes()
    presets = Path(sims.presets.__file__).parent
    yield from (path.read_bytes() for path in sorted(presets.rglob("*.toml"))[:4])


def read_any(path):
    return read_recording(path, sampling_rate_hz=1000.0)


def read_tables(path):
    try:
        read_rig(path)
    except GearsigError:
        return read_preset(path)


KINDS = {
    "csv": (csv_seeds, ".csv", read_any),
    "gzip": (gzip_seeds, ".csv.gz", read_any),
    "mat": (mat_seeds, ".mat", read_any),
    "hdf5": (hdf5_seeds, ".h5", read_any),
    "parquet": (parquet_seeds, ".parquet", read_any),
    "wav": (wav_seeds, ".wav", read_any),
    "tdms": (tdms_seeds, ".tdms", read_any),
    "uff": (uff_seeds, ".uff", read_any),
    "mf4": (mf4_seeds, ".mf4", read_any),
    "pulses": (pulse_seeds, ".txt", read_pulse_times),
    "toml": (toml_seeds, ".toml", read_tables),
}

WORDS = (
    *(
        b"\0",
        b"\xff" * 4,
        b"\xff\xff\xff\x7f",
        b"\0\0\0\x80",
        b"nan",
        b"1e999",
        b"-",
        b'"',
        b"\r",
        b"\n",
        b",,",
        b";",
        b"[",
    ),
    *(
        b"]",
        b"(",
        b" " * 9,
        b"\t\t",
        b"9" * 400,
        b"= ",
        b"#",
        b"{",
        b"}",
        b"null",
        b"\xef\xbb\xbf",
        b"\xed\xa0\x80",
        b"a." * 20,
    ),
)


def mutated(data, rng):
    """Return a file with one to six changes: bits, words, numbers, parts taken out, doubled, moved or repeated."""
    data = bytearray(data)
    for _ in range(int(rng.integers(1, 7))):
        if not data:
            break
        # Headers matter more than numbers.
        at = int(rng.integers(len(data) if rng.random() < 0.5 else min(len(data), 600)))
        span = min(int(2 ** rng.uniform(0, 10)), len(data) - at)
        match int(rng.integers(9)):
            case 0:
                data[at] ^= 1 << int(rng.integers(8))
            case 1:
                data[at] = int(rng.integers(256))
            case 2:
                word = WORDS[int(rng.integers(len(WORDS)))]
                data[at : at + len(word)] = word
            case 3:
                word = WORDS[int(rng.integers(len(WORDS)))]
                data[at:at] = word * int(2 ** rng.uniform(0, 14 if rng.random() < 0.1 else 3))
            case 4:
                del data[at : at + span]
            case 5:
                data[at:at] = data[at : at + span]
            case 6:
                to = int(rng.integers(len(data)))
                data[to : to + span] = data[at : at + span]
            case 7:
                width = int(rng.choice([2, 4, 8]))
                number = int(rng.integers(-3, 4)) + (1 << int(rng.integers(8 * width)))
                data[at : at + width] = (number % (1 << 8 * width)).to_bytes(width, str(rng.choice(["little", "big"])))
            case 8:
                if rng.random() < 0.3:
                    del data[at:]
                else:
                    data[at:at] = data[at : at + min(span, 40)] * int(2 ** rng.uniform(0, 11))
    return bytes(data)


def memory_bytes(process, what):
    """Return VmRSS or VmHWM (the most there was since the last reset) of a process; 0 where it is gone."""
    try:
        status = Path(f"/proc/{process}/status").read_text()
    except OSError:
        return 0
    return 1024 * int([*status.partition(f"{what}:")[2].split(), "0"][0])


def reset_peaks():
    """Begin anew for this process and those in which it lets others' readers run; return what each takes now."""
    processes, running = ["self"], {}
    for children in Path("/proc/self/task").glob("*/children"):
        with suppress(OSError):  # the thread has ended
            processes += children.read_text().split()
    for process in processes:
        with suppress(OSError):  # the process has ended
            Path(f"/proc/{process}/clear_refs").write_text("5")
            running[process] = memory_bytes(process, "VmRSS")
    return {process: n_bytes for process, n_bytes in running.items() if n_bytes}


def decoded_bytes(path, result):
    decoded = result.samples.nbytes if isinstance(result, Recording) else 0
    unpacked = 0
    if path.suffix == ".gz":
        try:
            unpacked = len(gzip.decompress(path.read_bytes()))
        except Exception:
            unpacked = 1 << 26  # below which the ratio is not looked at
    return max(decoded, unpacked, path.stat().st_size)


def main(kind, n_files, seed, folder):
    make, ending, read = KINDS[kind]
    folder.mkdir(parents=True, exist_ok=True)
    seeds = list(make(folder))
    path = folder / f"file{ending}"
    for data in seeds:  # each is read as it is
        path.write_bytes(data)
        if kind != "toml":
            read(path)
    rng = np.random.default_rng(seed)
    n_read = 0
    slowest = most = 0.0
    for i in range(n_files):
        data = seeds[i % len(seeds)]
        # A stream that is damaged never gets as far as its text.
        inside = kind == "gzip" and i % 8
        path.write_bytes(gzip.compress(mutated(gzip.decompress(data), rng)) if inside else mutated(data, rng))
        faulthandler.dump_traceback_later(120, exit=True)
        before, begin, wrong, result = reset_peaks(), time.process_time(), "", None
        try:
            result = read(path)
            n_read += 1
        except GearsigError as error:
            if "\n" in str(error):
                wrong = "the error has several lines"
        except BaseException:
            wrong = traceback.format_exc()
        taken = time.process_time() - begin
        grown = sum(max(0, memory_bytes(process, "VmHWM") - now) for process, now in before.items())
        slowest, most = max(slowest, taken), max(most, grown)
        if taken > LONGEST_S:
            wrong += f"{taken:.1f} s"
        if grown > 2 * decoded_bytes(path, result) + SPARE_BYTES:
            wrong += f"{grown / 1e6:.0f} MB for {decoded_bytes(path, result) / 1e6:.3g} MB"
        if wrong:
            kept = path.with_name(f"wrong-{kind}-{seed}-{i}{ending}")
            path.replace(kept)
            print(f"WRONG {kept}: {wrong}", flush=True)
    faulthandler.cancel_dump_traceback_later()
    print(f"{kind}: {n_files} files, {n_read} read, slowest {slowest:.2f} s, most {most / 1e6:.0f} MB", flush=True)


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    main(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), Path(sys.argv[4]))
