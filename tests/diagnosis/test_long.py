"""Records in blocks: figures and spectra as of all at once; parts that are chosen for what they show."""

import numpy as np
import pytest

from gearsig.diagnosis import Analysis, LongAnalysis, analyze_file, long_overview
from gearsig.errors import InputError
from gearsig.recording import Channel, Recording, n_samples_of, read_recording, write_recording
from gearsig.rig import ConstantSpeed, PulseTimes
from gearsig.spectra import power_density

RATE = 4096.0
RNG = np.random.default_rng(0)
X = RNG.standard_normal((2, 200_000)).astype(np.float32)
X[0, 123_456] = 60.0
X[1, 150_000:160_000] *= 3
LONG = Recording(X, RATE, (Channel("a", "acceleration", "m/s^2"), Channel("b", "acceleration", "g")))


@pytest.mark.parametrize("ending", [".h5", ".parquet", ".wav"])
def test_part_of_a_file_is_that_part_of_the_whole(tmp_path, ending):
    path = write_recording(LONG, tmp_path / f"x{ending}")
    assert n_samples_of(path) == 200_000
    part = read_recording(path, part=slice(70_000, 70_100))
    np.testing.assert_array_equal(part.samples, read_recording(path).samples[:, 70_000:70_100])
    assert part.channels == LONG.channels
    assert part.sampling_rate_hz == RATE


def test_part_of_tdms_and_of_foreign_layouts(tmp_path):
    import h5py
    import pyarrow as pa
    from nptdms import ChannelObject, TdmsWriter
    from pyarrow import parquet

    with TdmsWriter(tmp_path / "x.tdms") as writer:
        for half in np.split(X[0], 2):
            writer.write_segment([ChannelObject("g", "a", half, {"wf_increment": 1 / RATE})])
    with h5py.File(tmp_path / "x.h5", "w") as file:
        file["a"], file["m"], file["fs"] = X[0], X.T, RATE
    table = pa.table({"a": X[0], "text": ["x"] * len(X[0])})
    parquet.write_table(table, tmp_path / "x.parquet", row_group_size=999)
    for name in ("x.tdms", "x.h5", "x.parquet"):
        part = read_recording(tmp_path / name, part=slice(99_000, 101_000), sampling_rate_hz=RATE)
        assert n_samples_of(tmp_path / name) == 200_000
        np.testing.assert_array_equal(part.values("a"), X[0, 99_000:101_000])


def test_pulse_times_go_with_their_part(tmp_path):
    pulses = Recording(X, RATE, LONG.channels, speed=PulseTimes(np.arange(0.0, 48.0, 0.1), 1, ""))
    path = write_recording(pulses, tmp_path / "x.h5")
    part = read_recording(path, part=slice(40_960, 81_920))  # from 10 to 20 s
    assert part.speed.times_s[0] == pytest.approx(0.0)
    assert len(part.speed.times_s) == 101


def test_text_has_no_parts(tmp_path):
    path = write_recording(LONG.between(0, 1), tmp_path / "x.csv")
    assert n_samples_of(path) is None
    with pytest.raises(InputError, match="only read whole"):
        read_recording(path, part=slice(0, 5))


@pytest.mark.parametrize("block", [30_000, 1 << 22])
def test_overview_is_that_of_the_whole_record(monkeypatch, block):
    monkeypatch.setattr("gearsig.diagnosis._long.BLOCK_SAMPLES", block)

    def read(part):
        return Recording(X[:, part], RATE, LONG.channels)

    found = long_overview(read(slice(0, 100)), X.shape[1], read)
    for i, name in enumerate(LONG.channel_names):
        whole = power_density(LONG, name, n_per_block=8192)
        np.testing.assert_allclose(found.densities[i].values, whole.values, rtol=1e-5)
        second = X[i, 4096 * 30 : 4096 * 31].astype(float)
        second -= second.mean()
        assert found.rms[i, 30] == pytest.approx(second.std(), rel=1e-5)
        assert found.peak[i, 30] == pytest.approx(np.abs(second).max(), rel=1e-5)
        assert found.kurtosis[i, 30] == pytest.approx(np.mean(second**4) / np.mean(second**2) ** 2, rel=1e-4)
    assert len(found.time_s) == 49  # 48.8 s


def test_parts_are_the_usual_the_loudest_and_the_most_impulsive(tmp_path, monkeypatch):
    monkeypatch.setattr("gearsig.diagnosis._long.PART_SAMPLES", 8192)
    monkeypatch.setattr("gearsig.diagnosis._long.BYTES_PER_SAMPLE", 24_000.0)
    path = write_recording(LONG, tmp_path / "x.h5")
    found = analyze_file(path, speed=ConstantSpeed(600.0), memory_bytes=1e9)
    assert isinstance(found, LongAnalysis)
    reasons = {part.reason.split(",")[0]: part for part in found.parts}
    assert set(reasons) == {"the usual level", "the highest level", "the most impulsive second"}
    assert reasons["the most impulsive second"].start_s < 123_456 / RATE < reasons["the most impulsive second"].end_s
    assert 150_000 / RATE - 1 < reasons["the highest level"].start_s < 160_000 / RATE
    assert "48.83" in found.verdict
    assert isinstance(analyze_file(path, memory_bytes=1e12), Analysis)


def test_a_record_that_does_not_fit_and_cannot_be_parted_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("gearsig.diagnosis._long.BYTES_PER_SAMPLE", 1e6)
    path = write_recording(LONG.between(0, 5), tmp_path / "x.csv")
    with pytest.raises(InputError, match="--memory"):
        analyze_file(path)
