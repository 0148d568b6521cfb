"""Every binary format, on files made by its own library."""

import gc
import struct
import wave
from dataclasses import replace

import h5py
import numpy as np
import pyarrow as pa
import pytest
import pyuff
from nptdms import ChannelObject, RootObject, TdmsWriter
from pyarrow import parquet
from scipy.io import loadmat, savemat, wavfile
from scipy.sparse import csc_array

from gearsig.errors import InputError
from gearsig.recording import parse_lea, read_recording, variables
from gearsig.rig import (
    ConstantSpeed,
    GearPair,
    OperatingPoint,
    PulseTimes,
    Rig,
    Sensor,
    Shaft,
    SpeedChannel,
    TachometerChannel,
)

RNG = np.random.default_rng(7)
X = RNG.standard_normal(1000)
Y = RNG.standard_normal(1000).astype(np.float32)


class TestMat5:
    @pytest.mark.parametrize("shape", [(-1, 1), (1, -1), (-1,)])
    @pytest.mark.parametrize("packed", [True, False])
    def test_vectors_and_rate(self, tmp_path, shape, packed):
        savemat(tmp_path / "x.mat", {"a": X.reshape(shape), "Fs": 100.0}, do_compression=packed)
        r = read_recording(tmp_path / "x.mat")
        assert r.channel_names == ("a",)
        assert r.sampling_rate_hz == 100
        np.testing.assert_array_equal(r.samples[0], X)

    @pytest.mark.parametrize(("name", "value"), [("sr", 50), ("SampFreq", 50.0), ("dt", 0.02), ("samplingRate", 50)])
    def test_rate_names_in_structs_single_kept(self, tmp_path, name, value):
        savemat(tmp_path / "x.mat", {"run": {"acc": Y, "head": {name: value}, "note": "text"}})
        r = read_recording(tmp_path / "x.mat")
        assert r.sampling_rate_hz == 50
        assert r.channel_names == ("acc",)
        assert r.samples.dtype == np.float32

    @pytest.mark.parametrize("orient", [lambda m: m, lambda m: m.T])
    def test_matrix(self, tmp_path, orient):
        savemat(tmp_path / "x.mat", {"m": orient(np.stack([X, Y])), "fs": 1.0})
        r = read_recording(tmp_path / "x.mat")
        assert r.channel_names == ("m_1", "m_2")
        np.testing.assert_array_equal(r.samples, np.stack([X, Y]))

    def test_a_variable_called_as_its_file_has_the_same_channels_in_each(self, tmp_path):
        for name in ("C0A_200", "C1A_200"):
            savemat(tmp_path / f"{name}.mat", {name: np.stack([X, Y], axis=1)})
            assert read_recording(tmp_path / f"{name}.mat", sampling_rate_hz=1.0).channel_names == ("ch1", "ch2")
            savemat(tmp_path / f"{name}.mat", {name: X})
            assert read_recording(tmp_path / f"{name}.mat", sampling_rate_hz=1.0).channel_names == ("ch1",)

    def test_time_vector_and_speed(self, tmp_path):
        contents = {"t": np.arange(1000) / 50, "a": X, "X097RPM": 1796, "BPFO": 81.1, "win": [1, 2, 3]}
        savemat(tmp_path / "x.mat", contents)
        r = read_recording(tmp_path / "x.mat")
        assert r.sampling_rate_hz == pytest.approx(50)
        assert r.speed == ConstantSpeed(1796.0)
        assert any("win" in w for w in r.warnings)
        savemat(tmp_path / "y.mat", contents | {"X098RPM": 1772})  # which of them?
        assert read_recording(tmp_path / "y.mat").speed is None
        savemat(tmp_path / "z.mat", {"a": X, "fs": 50.0, "rate": 25.0})  # Hz or rpm?
        assert read_recording(tmp_path / "z.mat").speed is None

    def test_stated_speed_goes_before_a_rigs_but_not_before_what_measures_it(self, tmp_path):
        savemat(tmp_path / "x.mat", {"DE_time": X, "tacho": Y, "RPM": 1772, "fs": 50.0})
        constant = Rig(shafts=(Shaft("motor"),), speed=ConstantSpeed(1797.0, "motor"))
        assert read_recording(tmp_path / "x.mat", rig=constant).speed == ConstantSpeed(1772.0, "motor")
        measured = Rig(speed=TachometerChannel("tacho"))
        assert read_recording(tmp_path / "x.mat", rig=measured).speed_source == TachometerChannel("tacho")

    def test_a_given_speed_that_file_or_rig_contradict_is_said(self, tmp_path):
        savemat(tmp_path / "x.mat", {"DE_time": X, "RPM": 1796, "fs": 50.0})
        rig = Rig(shafts=(Shaft("motor"),), speed=ConstantSpeed(1750.0, "motor"))
        r = read_recording(tmp_path / "x.mat", rig=rig, speed=ConstantSpeed(1500.0))
        assert r.speed == ConstantSpeed(1500.0)
        conflict = "the speed 1500 rpm was given and taken; the file states 1796 rpm and the rig states 1750 rpm"
        assert conflict in r.warnings
        r = read_recording(tmp_path / "x.mat", speed=ConstantSpeed(1796.5))  # as the file, but for its digits
        assert not any("1796" in warning for warning in r.warnings)

    def test_a_given_speed_only_checks_a_measured_one(self, tmp_path):
        savemat(tmp_path / "x.mat", {"DE_time": X, "tacho": Y, "fs": 50.0})
        pair = GearPair("stage", "in", "out", 20, 40)
        point = OperatingPoint("out", torque_nm=5.0)
        rig = Rig(shafts=(Shaft("in"), Shaft("out")), pairs=(pair,), operating_point=point)
        measured = replace(rig, speed=TachometerChannel("tacho", shaft="in"))
        r = read_recording(tmp_path / "x.mat", rig=measured, speed=ConstantSpeed(1500.0))
        assert r.speed_source == TachometerChannel("tacho", shaft="in")
        assert r.rig.operating_point == replace(point, speed_rpm=750.0)
        assert "the speed is taken from channel 'tacho'; the stated 1500 rpm is compared with it" in r.warnings
        absent = replace(rig, speed=TachometerChannel("elsewhere", shaft="in"))
        r = read_recording(tmp_path / "x.mat", rig=absent, speed=ConstantSpeed(1500.0))
        assert r.speed_source == ConstantSpeed(1500.0)

    def test_times_beside_their_channels(self, tmp_path):
        t = np.arange(1000) / 50
        names = {"Data1_AI_1": X, "Data1_time_AI_1": t, "Data1_AI_2": Y, "Data1_time_AI_2": t}
        savemat(tmp_path / "x.mat", names)
        r = read_recording(tmp_path / "x.mat")
        assert (r.channel_names, r.sampling_rate_hz) == (("Data1_AI_1", "Data1_AI_2"), pytest.approx(50))
        savemat(tmp_path / "y.mat", names | {"Data1_time_AI_1": 736000 + t / 86400, "Sample_rate": 50.0})  # days
        assert read_recording(tmp_path / "y.mat").sampling_rate_hz == 50.0

    @pytest.mark.parametrize("together", [True, False])
    def test_columns_beside_a_time_are_channels_or_conditions(self, tmp_path, together):
        rng, n = np.random.default_rng(1), 20_000
        tone, noise = np.sin(0.2 * np.arange(n)), rng.standard_normal(n)
        runs = [tone + (0.5 * noise if together else 0) + rng.standard_normal(n) for _ in range(3)]
        matrix = np.stack([np.arange(n) / 5120, *runs], axis=1)
        savemat(tmp_path / "x.mat", {"m": matrix})
        r = read_recording(tmp_path / "x.mat")
        assert r.channel_names == ("m_1", "m_2", "m_3")
        assert r.sampling_rate_hz == pytest.approx(5120)
        assert any("#3" in w for w in r.warnings) is not together
        assert any(w.endswith("was taken as the time in seconds; the others are m_1 to m_3") for w in r.warnings)
        np.savetxt(tmp_path / "x.csv", matrix, fmt="%.9g")
        for name in ("x.mat#2", "x.csv#2"):
            second = read_recording(tmp_path / name)
            assert second.channel_names == ("vibration",)
            assert second.name == name
            np.testing.assert_allclose(second.samples[0], runs[1], rtol=1e-7)
        with pytest.raises(InputError, match="condition 4"):
            read_recording(tmp_path / "x.mat#4")
        (tmp_path / "x.mat").rename(tmp_path / "x#2.mat")
        assert len(read_recording(tmp_path / "x#2.mat").channels) == 3

    def test_of_several_measurements_one_is_read_with_its_own_speed(self, tmp_path):
        rng = np.random.default_rng(1)
        of = {number: rng.standard_normal(5000 + number) for number in (98, 99)}
        speeds = {"X098RPM": 1797.0, "X099RPM": 1772.0}
        savemat(tmp_path / "x.mat", {**{f"X0{n}_{p}_time": x for n, x in of.items() for p in ("DE", "FE")}, **speeds})
        (tmp_path / "98.mat").write_bytes((tmp_path / "x.mat").read_bytes())
        for name, number in (("x.mat", 99), ("98.mat", 98), ("x.mat#98", 98), ("98.mat#99", 99)):
            r = read_recording(tmp_path / name, sampling_rate_hz=12_000)
            assert r.channel_names == (f"X0{number}_DE_time", f"X0{number}_FE_time")
            np.testing.assert_array_equal(r.samples[0], of[number])
            assert r.speed == ConstantSpeed(speeds[f"X0{number}RPM"])
            assert any("#" in w for w in r.warnings) is ("#" not in name)
        with pytest.raises(InputError, match="#98, #99"):
            read_recording(tmp_path / "x.mat#97", sampling_rate_hz=12_000)

    def test_numbers_of_channels_are_no_measurements(self, tmp_path):
        rng = np.random.default_rng(1)
        savemat(tmp_path / "x.mat", {f"ch{i:02}_acc": rng.standard_normal(5000) for i in (1, 2)} | {"rpm": 1500.0})
        assert len(read_recording(tmp_path / "x.mat", sampling_rate_hz=12_000).channels) == 2

    @pytest.mark.parametrize("zero_first", [True, False])
    def test_doubled_variables(self, tmp_path, zero_first):
        copies = [np.zeros_like(X), X] if zero_first else [X, np.zeros_like(X)]
        for i, values in enumerate(copies):
            savemat(tmp_path / f"{i}.mat", {"a": values, "h": {"fs": 0 if values is not X else 10}})
        data = (tmp_path / "0.mat").read_bytes() + (tmp_path / "1.mat").read_bytes()[128:]
        (tmp_path / "x.mat").write_bytes(data)
        r = read_recording(tmp_path / "x.mat")
        np.testing.assert_array_equal(r.samples[0], X)
        assert r.sampling_rate_hz == 10
        assert "more than once" in r.warnings[0]

    @pytest.mark.parametrize("packed", [True, False])
    def test_values_are_those_of_scipy(self, tmp_path, packed):
        kinds = ("i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8", "c16")
        numbers = {f"v{kind}": np.array([[1, 2, 3], [4, 5, 100]], kind) for kind in kinds}
        nested = {"text": "Prüfstand", "cell": np.array([np.arange(3.0), "b"], dtype=object), "empty": np.zeros((0, 3))}
        savemat(tmp_path / "x.mat", {**numbers, "s": {**nested, "flag": True}}, do_compression=packed)
        ours, theirs = dict(variables(tmp_path / "x.mat")), loadmat(tmp_path / "x.mat")
        for name in numbers:
            np.testing.assert_array_equal(ours[name], theirs[name])
            assert ours[name].dtype == theirs[name].dtype
        struct_, reference = ours["s"], theirs["s"][0, 0]
        assert struct_["text"] == reference["text"][0]
        np.testing.assert_array_equal(struct_["cell"][0], reference["cell"][0, 0])
        assert struct_["cell"][1] == "b"
        assert struct_["empty"].shape == (0, 3)
        assert struct_["flag"] == reference["flag"]

    def test_struct_arrays_and_sparse(self, tmp_path):
        runs = np.array([(X, 1.0), (X + 1, 2.0)], dtype=[("a", object), ("q", object)])
        savemat(tmp_path / "x.mat", {"runs": runs, "w": csc_array(np.eye(3)), "fs": 5.0})
        r = read_recording(tmp_path / "x.mat")
        assert r.channel_names == ("runs(1).a", "runs(2).a")
        assert "sparse" in r.warnings[0]

    def test_channels_are_called_by_what_their_structs_say(self, tmp_path):
        fields = [("Name", object), ("Data", object), ("Unit", object)]
        slow = X[:500] + 1500.0
        y = np.array([("vib", X[None], "g"), ("speed", slow[None], "rpm"), ("force", slow[None], "N")], dtype=fields)
        x = np.array([("Time", np.arange(n)[None] / hz, "s") for n, hz in ((1000, 100.0), (500, 50.0))], dtype=fields)
        savemat(tmp_path / "x.mat", {"run": {"X": x, "Y": y, "Info": {"by": "me"}}})
        r = read_recording(tmp_path / "x.mat")
        assert ([(c.name, c.unit) for c in r.channels], r.sampling_rate_hz) == ([("vib", "g"), ("speed", "rpm")], 100)
        np.testing.assert_array_equal(r.values("speed")[:-1:2], slow)
        assert r.speed == SpeedChannel("speed")
        assert any("left out: force" in w for w in r.warnings)

    @pytest.mark.parametrize("label", ["s", "Hz"])
    def test_functions_over_an_axis(self, tmp_path, label):
        axis = {"start_value": 0.0, "increment": 0.01, "number_of_values": 1000.0, "quantity": {"label": label}}
        names = np.array(["DE:+X", "NDE:+Z"], dtype=object)
        signal = {"x_values": axis, "y_values": {"values": np.array([X, Y]).T, "quantity": {"label": "g"}}}
        savemat(tmp_path / "x.mat", {"Signal": {**signal, "function_record": {"name": names}}})
        if label == "Hz":
            with pytest.raises(InputError, match="spectrum"):
                read_recording(tmp_path / "x.mat")
            return
        r = read_recording(tmp_path / "x.mat")
        assert [(c.name, c.unit) for c in r.channels] == [("DE:+X", "g"), ("NDE:+Z", "g")]
        assert r.sampling_rate_hz == pytest.approx(100)

    def test_times_of_pulses_beside_the_signal(self, tmp_path):
        times_s = 0.05 + 0.2 * np.arange(50)
        savemat(tmp_path / "x.mat", {"vibration": X, "tach": times_s[:, None], "fs": 100.0})
        assert "pulses_per_revolution" in " ".join(read_recording(tmp_path / "x.mat").warnings)
        r = read_recording(tmp_path / "x.mat", rig=Rig(speed=TachometerChannel("tach", 2)))
        assert isinstance(r.speed, PulseTimes)
        assert r.speed.pulses_per_revolution == 2
        np.testing.assert_array_equal(r.speed.times_s, times_s)

    def test_big_endian(self, tmp_path):
        savemat(tmp_path / "x.mat", {"a": X, "fs": 5.0})
        data = (tmp_path / "x.mat").read_bytes()
        words = struct.pack(">II8s", 6, 8, bytes([0, 0, 0, 6, 0, 0, 0, 0]))
        words += struct.pack(">IIii", 5, 8, 1, 3) + struct.pack(">HH4s", 1, 1, b"b\0\0\0")
        words += struct.pack(">II3d", 9, 24, 1.5, 2.5, 3.5)
        (tmp_path / "y.mat").write_bytes(data[:124] + b"\x01\x00MI" + struct.pack(">II", 14, len(words)) + words)
        r = read_recording(tmp_path / "y.mat", sampling_rate_hz=1)
        np.testing.assert_array_equal(r.values("b"), [1.5, 2.5, 3.5])

    def test_two_rates(self, tmp_path):
        savemat(tmp_path / "x.mat", {"a": X, "b": {"fs": 1.0}, "c": {"fs": 2.0}})
        with pytest.raises(InputError, match=r"several sampling rates: b\.fs = 1 Hz, c\.fs = 2 Hz"):
            read_recording(tmp_path / "x.mat")

    def test_unequal_lengths_and_no_signal(self, tmp_path):
        savemat(tmp_path / "x.mat", {"a": X, "b": X[:500], "fs": 1.0})
        with pytest.raises(InputError, match="differ in length: 'a' 1000, 'b' 500"):
            read_recording(tmp_path / "x.mat")
        savemat(tmp_path / "y.mat", {"fs": 1.0, "s": "text"})
        with pytest.raises(InputError, match="no signal"):
            read_recording(tmp_path / "y.mat")
        savemat(tmp_path / "z.mat", {"a": X * 1j, "fs": 1.0})
        with pytest.raises(InputError, match="complex"):
            read_recording(tmp_path / "z.mat")

    @pytest.mark.parametrize("rate", [0.0, -1.0, np.nan])
    def test_bad_rate(self, tmp_path, rate):
        savemat(tmp_path / "x.mat", {"a": X, "fs": rate})
        with pytest.raises(InputError, match=r"x\.mat: sampling rate in the file"):
            read_recording(tmp_path / "x.mat")
        savemat(tmp_path / "x.mat", {"a": X, "dt": rate})
        with pytest.raises(InputError, match="sampling interval"):
            read_recording(tmp_path / "x.mat")


class TestMat73AndHdf5:
    def matlab_file(self, path):
        """Make a file as MATLAB does: HDF5 behind a 512-byte header, arrays transposed, classes as attributes."""
        with h5py.File(path, "w", userblock_size=512) as f:
            group = f.create_group("run")
            for name, value, kind in (
                ("a", X.reshape(1, -1), b"double"),
                ("m", np.stack([X, X + 1]), b"double"),
                ("fs", np.array([[512.0]]), b"double"),
                ("label", np.frombuffer("Prüfstand".encode("utf-16-le"), "<u2").reshape(-1, 1), b"char"),
            ):
                group.create_dataset(name, data=value).attrs["MATLAB_class"] = np.bytes_(kind)
        with path.open("r+b") as f:
            f.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM")

    def test_mat73(self, tmp_path):
        self.matlab_file(tmp_path / "x.mat")
        r = read_recording(tmp_path / "x.mat")
        assert r.channel_names == ("a", "m_1", "m_2")
        assert r.sampling_rate_hz == 512
        np.testing.assert_array_equal(r.values("m_2"), X + 1)

    def test_foreign_hdf5(self, tmp_path):
        with h5py.File(tmp_path / "x.h5", "w") as f:
            f.attrs["sampling_rate"] = 64.0
            f.create_dataset("rig/a", data=X).attrs["unit"] = "m/s^2"
            f["rig/b"] = Y
            f["text"] = "hello"
        r = read_recording(tmp_path / "x.h5")
        assert [(c.name, c.unit) for c in r.channels] == [("a", "m/s^2"), ("b", "")]
        assert r.sampling_rate_hz == 64

    def test_a_program_error_does_not_blame_the_file(self, tmp_path, monkeypatch):
        def broken(*_, **__):
            raise AssertionError

        with h5py.File(tmp_path / "x.h5", "w") as f:
            f["a"] = X
        monkeypatch.setattr(h5py, "File", broken)
        with pytest.raises(AssertionError):
            read_recording(tmp_path / "x.h5")

    def test_links_out_of_the_file_are_not_followed(self, tmp_path):
        with h5py.File(tmp_path / "secret.h5", "w") as f:
            f["s"] = X
        layout = h5py.VirtualLayout((1000,), "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "secret.h5"), "s", (1000,))
        (tmp_path / "raw").write_bytes(X.tobytes())
        with h5py.File(tmp_path / "x.h5", "w") as f:
            f["a"] = Y
            f["fs"] = 8.0
            f["link"] = h5py.ExternalLink(str(tmp_path / "secret.h5"), "s")
            f["soft"] = h5py.SoftLink("/a")
            f.create_virtual_dataset("virtual", layout)
            f.create_dataset("outside", (1000,), "f8", external=[(str(tmp_path / "raw"), 0, 8000)])
        r = read_recording(tmp_path / "x.h5")
        assert r.channel_names == ("a",)
        assert all(name in r.warnings[0] for name in ("link", "soft", "virtual", "outside"))

    def test_allocated_but_never_written(self, tmp_path):
        with h5py.File(tmp_path / "x.h5", "w") as f:
            f.create_dataset("a", (1000,), "f8")
        with pytest.raises(InputError, match="never written"):
            read_recording(tmp_path / "x.h5", sampling_rate_hz=1)

    def test_larger_than_memory(self, tmp_path):
        with h5py.File(tmp_path / "x.h5", "w") as f:
            f.create_dataset("a", (1 << 40,), "f8", chunks=(1 << 20,), compression="gzip")[:1] = 1
        with pytest.raises(InputError, match="200 times"):
            read_recording(tmp_path / "x.h5", sampling_rate_hz=1)


class TestWav:
    @pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.int32, np.float32, np.float64])
    def test_codings(self, tmp_path, dtype):
        info = None if np.dtype(dtype).kind == "f" else np.iinfo(dtype)
        values = np.array([[-1, -0.5], [0, 0.5]]) if info is None else np.array([[info.min, 0], [info.max, 1]])
        wavfile.write(tmp_path / "x.wav", 8000, values.astype(dtype))
        r = read_recording(tmp_path / "x.wav")
        zero, full = (0, 1) if info is None else (128 if dtype == np.uint8 else 0, 2.0 ** (info.bits - 1))
        np.testing.assert_array_equal(r.samples, (values.T - float(zero)) / full)
        assert [(c.name, c.unit) for c in r.channels] == [("ch1", "FS"), ("ch2", "FS")]
        assert r.samples.dtype == (np.float64 if dtype in (np.int32, np.float64) else np.float32)

    def test_24_bit(self, tmp_path):
        with wave.open(str(tmp_path / "x.wav"), "wb") as f:
            f.setnchannels(1)
            f.setsampwidth(3)
            f.setframerate(100)
            f.writeframes(b"".join(int(v).to_bytes(3, "little", signed=True) for v in (-(2**23), 1, 2**23 - 1)))
        np.testing.assert_array_equal(read_recording(tmp_path / "x.wav").samples[0], [-1, 2.0**-23, 1 - 2.0**-23])

    def test_speed_channel_by_rig(self, tmp_path):
        wavfile.write(tmp_path / "x.wav", 8000, np.array([[0, 16384], [5, 16384]], np.int16))
        sensors = (Sensor("ch2", "rotational_speed", "rpm", scale=6000.0),)
        r = read_recording(tmp_path / "x.wav", rig=Rig(sensors=sensors, speed=SpeedChannel("ch2")))
        np.testing.assert_array_equal(r.values("ch2"), [3000, 3000])
        assert r.speed_source == SpeedChannel("ch2")

    def test_unknown_chunk_is_no_matter_but_a_cut_file_is(self, tmp_path):
        wavfile.write(tmp_path / "x.wav", 8000, np.arange(100, dtype=np.int16))
        data = (tmp_path / "x.wav").read_bytes()
        (tmp_path / "y.wav").write_bytes(data + b"abcd" + struct.pack("<I", 4) + b"1234")
        assert read_recording(tmp_path / "y.wav").n_samples == 100
        for tail in (b"VENDOR 4711: not a chunk", b"\xff" * 3, b"LIST" + struct.pack("<I", 10**6) + b"short"):
            for n_riff in (len(data) - 8, len(data) + len(tail) - 8):  # counted in by some, by others not
                (tmp_path / "y.wav").write_bytes(data[:4] + struct.pack("<I", n_riff) + data[8:] + tail)
                r = read_recording(tmp_path / "y.wav")
                np.testing.assert_array_equal(r.samples[0] * 2**15, np.arange(100))
                assert f"{len(tail)} bytes after the audio" in r.warnings[0]
        (tmp_path / "z.wav").write_bytes(data[:-50])
        with pytest.raises(InputError, match=r"z\.wav: chunk 'data'.*50 are missing"):
            read_recording(tmp_path / "z.wav")
        (tmp_path / "z.wav").write_bytes(data[:36])
        with pytest.raises(InputError, match="no samples"):
            read_recording(tmp_path / "z.wav")

    def test_lea_chunk(self, tmp_path):
        def entry(i, scale, name, unit):
            body = struct.pack("<f", scale)
            for text in (name, unit):
                body += struct.pack("<H", len(text)) + text
            body += struct.pack("<ff", 0, 1)
            return b"le%02d" % i + struct.pack("<I", len(body)) + body

        chunk = entry(0, 2.0, b"mic", b"Pa") + entry(1, 5000.0, b"mic_RPM", b"tr/min")
        wavfile.write(tmp_path / "x.wav", 8000, np.array([[16384, 16384]] * 3, np.int16))
        with (tmp_path / "x.wav").open("ab") as f:
            f.write(b"LEA " + struct.pack("<I", len(chunk)) + chunk)
        r = read_recording(tmp_path / "x.wav")
        np.testing.assert_array_equal(r.samples, [[1.0] * 3, [2500.0] * 3])
        assert [c.quantity for c in r.channels] == ["sound_pressure", "rotational_speed"]
        assert r.speed == SpeedChannel("mic_RPM")
        for cut in range(1, len(chunk)):
            assert len(parse_lea(chunk[:cut])) in (0, 1)


class TestParquet:
    def test_units_rate_and_text_column(self, tmp_path):
        fields = [
            pa.field("a", pa.float64(), metadata={"unit": "m/s^2"}),
            pa.field("b [Pa]", pa.float32()),
            pa.field("s", pa.string()),
        ]
        schema = pa.schema(fields, metadata={"fs": "128"})
        parquet.write_table(
            pa.table([pa.array(X), pa.array(Y), pa.array(["q"] * 1000)], schema=schema), tmp_path / "x.parquet"
        )
        r = read_recording(tmp_path / "x.parquet")
        assert [(c.name, c.unit) for c in r.channels] == [("a", "m/s^2"), ("b", "Pa")]
        assert r.sampling_rate_hz == 128
        assert "s" in r.warnings[0]

    def test_missing_values_and_cut_file(self, tmp_path):
        parquet.write_table(pa.table({"a": pa.array([1, None, 3])}), tmp_path / "x.parquet")
        with pytest.raises(InputError, match=r"NaN.*sample 1"):
            read_recording(tmp_path / "x.parquet", sampling_rate_hz=1)
        (tmp_path / "y.parquet").write_bytes((tmp_path / "x.parquet").read_bytes()[:-20])
        with pytest.raises(InputError, match="cannot be read as Parquet"):
            read_recording(tmp_path / "y.parquet", sampling_rate_hz=1)


class TestTdms:
    def write(self, path, **properties):
        with TdmsWriter(path) as f:
            f.write_segment(
                [
                    RootObject({"operator": "<b>x</b>"}),
                    ChannelObject("g", "acc.x", X, {"unit_string": "g", **properties}),
                ]
            )
            f.write_segment([ChannelObject("g", "acc.x", X)])

    def test_rate_and_unit(self, tmp_path):
        self.write(tmp_path / "x.tdms", wf_increment=1 / 2048)
        r = read_recording(tmp_path / "x.tdms")
        assert [(c.name, c.unit, c.quantity) for c in r.channels] == [("acc_x", "g", "acceleration")]
        assert r.sampling_rate_hz == pytest.approx(2048)
        np.testing.assert_array_equal(r.samples[0], np.concatenate([X, X]))

    def test_bad_increment_and_cut_file(self, tmp_path):
        self.write(tmp_path / "x.tdms", wf_increment=-1.0)
        with pytest.raises(InputError, match="wf_increment"):
            read_recording(tmp_path / "x.tdms")
        self.write(tmp_path / "x.tdms", wf_increment=1.0)
        (tmp_path / "y.tdms").write_bytes((tmp_path / "x.tdms").read_bytes()[:-100])
        with pytest.raises(InputError, match="cut off"):
            read_recording(tmp_path / "y.tdms")


class TestUff58:
    # pyuff's writer leaves its file to the garbage collector.
    @pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
    @pytest.mark.parametrize("binary", [0, 1])
    def test_time_response(self, tmp_path, binary):
        for node, values in ((3, X), (4, X + 1)):
            facts = {
                "type": 58,
                "binary": binary,
                "func_type": 1,
                "rsp_node": node,
                "rsp_dir": 3,
                "ref_node": 1,
                "ref_dir": 1,
                "data": values,
                "x": np.arange(1000) / 256,
                "ordinate_spec_data_type": 12,
                "id1": "run",
                "ordinate_axis_units_lab": "m/s^2",
                "abscissa_spec_data_type": 17,
                "orddenom_spec_data_type": 0,
            }
            pyuff.UFF(str(tmp_path / "x.uff")).write_sets(facts, mode="add")
        r = read_recording(tmp_path / "x.uff")
        assert [(c.name, c.unit, c.quantity) for c in r.channels] == [
            ("3+Z", "m/s^2", "acceleration"),
            ("4+Z", "m/s^2", "acceleration"),
        ]
        assert r.sampling_rate_hz == pytest.approx(256)
        np.testing.assert_allclose(r.samples, [X, X + 1], rtol=1e-5, atol=1e-5)


class TestMf4:
    @pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # asammdf's, of a damaged file
    @pytest.mark.parametrize("version", ["3.30", "4.10"])
    def test_channels_at_the_fastest_times(self, tmp_path, version):
        asammdf = pytest.importorskip("asammdf", reason="the extra gearsig[mf4] is not installed")
        t = np.arange(1000) / 500
        with asammdf.MDF(version=version) as file:
            file.append([asammdf.Signal(v, t, unit, name) for name, v, unit in (("a1", X, "g"), ("a2", Y, "m/s^2"))])
            file.append([asammdf.Signal(X[:20], t[:20] * 50, "degC", "oil")])
            saved = file.save(tmp_path / ("x.mf4" if version[0] == "4" else "x.mdf"))
        r = read_recording(saved)
        assert [(c.name, c.unit) for c in r.channels] == [("a1", "g"), ("a2", "m/s^2")]
        assert r.sampling_rate_hz == pytest.approx(500)
        np.testing.assert_allclose(r.samples, [X, Y])
        assert any("oil" in w for w in r.warnings)
        data = saved.read_bytes()
        damaged = [data[: len(data) // 3]]
        if (group := data.find(b"##CG")) > 0:  # which says how many samples there are: half a gigabyte of them
            damaged.append(data[: group + 80] + (30_000_000).to_bytes(8, "little") + data[group + 88 :])
        for content in damaged:
            saved.write_bytes(content)
            with pytest.raises(InputError, match="MF4"):
                read_recording(saved)
        gc.collect()
