"""Records in blocks: figures and spectra as of all at once; parts that are chosen for what they show."""

from dataclasses import replace

import numpy as np
import pytest

from gearsig.angle import find_shaft_angle, resample_to_angle
from gearsig.diagnosis import (
    Analysis,
    LongAnalysis,
    RecordBlocks,
    analyze,
    analyze_file,
    long_overview,
    read_reference,
)
from gearsig.errors import InputError
from gearsig.orders import order_map, synchronous_average
from gearsig.recording import Channel, Recording, n_samples_of, read_recording, write_recording
from gearsig.rig import ConstantSpeed, PulseTimes, TachometerChannel
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
    with pytest.raises(InputError, match="only be read whole"):
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


def test_overview_of_a_record_that_is_dead_for_a_while():
    x = np.where(np.arange(X.shape[1]) < 100_000, 0, X).astype(np.float32)
    x[1] = 0.5
    found = long_overview(LONG, x.shape[1], lambda part: Recording(x[:, part], RATE, LONG.channels))
    for figures in (found.rms, found.peak, found.crest_factor, found.kurtosis):
        assert not figures[0, :24].any()
        assert np.all(figures[0, 26:] > 0)
        assert not figures[1].any()


@pytest.mark.slow
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


@pytest.fixture(params=[20_000, 1 << 20])
def blocks(request, monkeypatch):
    """Return what opens a recording in blocks: many, or one that holds all of it."""
    monkeypatch.setattr("gearsig.diagnosis._blocks.BLOCK_SAMPLES", request.param)

    def opened(recording):
        def read(part):
            start = (part.start or 0) / RATE
            own = recording.speed
            if isinstance(own, PulseTimes):
                own = PulseTimes(own.times_s[own.times_s >= start] - start, own.pulses_per_revolution, own.shaft)
            return replace(recording, samples=recording.samples[:, part], speed=own)

        return RecordBlocks(read(slice(0, 64)), recording.n_samples, read)

    return opened


@pytest.mark.parametrize("n_columns", [7, 1000])
def test_a_map_in_blocks_is_that_of_the_whole_record(blocks, n_columns):
    found = blocks(LONG).frequency_map("a", n_per_block=1024, n_columns_max=n_columns)
    n_spectra = (200_000 - 1024) // 512 + 1
    k = -(-n_spectra // n_columns)
    assert len(found.time_s) == -(-n_spectra // k) <= n_columns
    for column in (0, 3, len(found.time_s) - 1):
        first, last = column * k, min((column + 1) * k, n_spectra)
        x = X[0, first * 512 : (last - 1) * 512 + 1024]
        np.testing.assert_allclose(found.values[column], power_density(x, RATE, n_per_block=1024).values, rtol=1e-5)
        assert found.time_s[column] == pytest.approx((first * 512 + len(x) / 2) / RATE)


def test_an_envelope_in_blocks_is_that_of_the_whole_record(blocks):
    found = blocks(LONG).envelope_density("a", (400.0, 700.0), n_per_block=512)
    n = len(X[0])
    frequency = np.arange(n // 2 + 1) * RATE / n
    inside = np.clip(np.minimum(frequency - 400.0, 700.0 - frequency) / 30.0, 0.0, 1.0)
    lines = np.zeros(n, complex)
    lines[: n // 2 + 1] = 2.0 * np.fft.rfft(X[0].astype(float)) * np.sin(np.pi / 2 * inside) ** 2
    squared = np.abs(np.fft.ifft(lines))[::3] ** 2
    whole = power_density(squared, RATE / 3, n_per_block=512)
    np.testing.assert_allclose(found.positions, whole.positions)
    # The whole record's transform goes round its ends, where that of blocks sees nothing.
    np.testing.assert_allclose(found.values, whole.values, rtol=2e-3, atol=1e-12)


def _turning(speed):
    t = np.arange(200_000) / RATE
    turns = 20.0 * t + 0.05 * t**2
    waves = np.cos(2 * np.pi * 7 * turns) + 0.3 * np.sin(2 * np.pi * 30 * turns)
    tacho = (turns % 1.0 < 0.3).astype(np.float32)
    x = np.stack([waves + X[1], tacho]).astype(np.float32)
    channels = (Channel("a", "acceleration", "m/s^2"), Channel("tacho", "tachometer", "V"))
    if isinstance(speed, PulseTimes):
        speed = PulseTimes(np.interp(np.arange(1, int(turns[-1])), turns, t), 1, "")
    return Recording(x, RATE, channels, speed=speed)


@pytest.mark.parametrize(
    "speed", [ConstantSpeed(1200.0), PulseTimes(np.arange(2.0), 1, ""), TachometerChannel("tacho")], ids=repr
)
def test_an_average_in_blocks_is_that_of_the_whole_record(blocks, speed):
    recording = _turning(speed)
    angle = find_shaft_angle(recording)
    signal = resample_to_angle(recording, angle, channels=("a",), samples_per_revolution=256)
    whole = synchronous_average(signal, "a")
    found = blocks(recording).average("a", samples_per_revolution=256)
    assert found.n_revolutions == whole.n_revolutions
    np.testing.assert_allclose(found.values, whole.values, atol=2e-5)
    np.testing.assert_allclose(found.standard_error, whole.standard_error, rtol=1e-3, atol=1e-6)
    if not isinstance(speed, ConstantSpeed):
        assert abs(found.lines()[7]) == pytest.approx(1.0, abs=0.03)


def test_a_speed_from_the_vibration_gives_no_average_in_blocks(blocks):
    with pytest.raises(InputError, match="constant speed or tachometer"):
        blocks(LONG).average("a")


def test_the_density_of_the_whole_record_in_blocks(blocks):
    found = blocks(LONG).power_density("a", n_per_block=1024)
    whole = power_density(LONG, "a", n_per_block=1024)
    np.testing.assert_allclose(found.values, whole.values, rtol=1e-5)
    assert (found.unit, found.noise_bandwidth) == (whole.unit, whole.noise_bandwidth)


@pytest.mark.parametrize("n_columns", [9, 1000])
def test_an_order_map_in_blocks_is_that_of_the_whole_record(blocks, n_columns):
    recording = _turning(TachometerChannel("tacho"))
    signal = resample_to_angle(recording, find_shaft_angle(recording), channels=("a",), samples_per_revolution=256)
    found = blocks(recording).order_map("a", n_columns_max=n_columns, samples_per_revolution=256)
    whole = order_map(signal, "a", n_blocks_max=10_000)
    k = -(-len(whole.time_s) // n_columns)
    assert len(found.time_s) == -(-len(whole.time_s) // k)
    for column in (0, len(found.time_s) // 2, len(found.time_s) - 1):
        own = slice(column * k, column * k + k)
        n_lines = found.values.shape[1]
        rms = np.sqrt(np.mean(whole.values[own, :n_lines] ** 2, axis=0))
        np.testing.assert_allclose(found.values[column], rms, rtol=1e-3, atol=1e-4)
        assert found.time_s[column] == pytest.approx(whole.time_s[own].mean(), abs=0.02)
        assert found.speed_rpm[column] == pytest.approx(whole.speed_rpm[own].mean(), rel=2e-3)
    assert found.positions[np.argmax(found.values.mean(axis=0))] == pytest.approx(7.0)


@pytest.fixture
def short_memory(monkeypatch):
    """As if a sample took a hundred times the memory: 48 s do not fit, parts of 2 s do."""
    monkeypatch.setattr("gearsig.diagnosis._long.PART_SAMPLES", 8192)
    monkeypatch.setattr("gearsig.diagnosis._long.BYTES_PER_SAMPLE", 24_000.0)


@pytest.mark.usefixtures("short_memory")
def test_a_long_record_as_one_analysis_says_of_which_part_it_is(tmp_path):
    path = write_recording(LONG, tmp_path / "x.h5")
    found = analyze_file(path, speed=ConstantSpeed(600.0), memory_bytes=1e9)
    one = found.as_one()
    told = next(finding for finding in one.findings if finding.code == "part-of-long-record")
    assert "48.828 s" in told.title
    assert len(told.evidence) == len(found.parts) - 1 + 2
    assert one.outcome is found.outcome
    usual = next(part for part in found.parts if part.reason == "the usual level")
    assert one.indicators == usual.analysis.indicators
    assert one.recording.n_samples == 8192


@pytest.mark.slow
@pytest.mark.usefixtures("short_memory")
def test_a_long_record_is_compared_part_by_part_with_a_part_of_a_long_reference(tmp_path):
    quiet = replace(LONG, samples=0.1 * RNG.standard_normal(X.shape).astype(np.float32))
    now, then = write_recording(LONG, tmp_path / "now.h5"), write_recording(quiet, tmp_path / "then.h5")
    healthy = read_reference(then, speed=ConstantSpeed(600.0), memory_bytes=1e9)
    assert healthy.recording.n_samples == 8192
    assert read_reference(then, speed=ConstantSpeed(600.0), memory_bytes=1e9) is healthy
    found = analyze_file(now, speed=ConstantSpeed(600.0), memory_bytes=1e9, reference=healthy)
    for part in found.parts:
        assert part.analysis.reference is found.parts[0].analysis.reference
        overall = [c for c in part.analysis.level_changes if c.kind == "noise"]
        assert overall
        assert min(c.level_db - c.reference_db for c in overall) > 15.0  # ten times


@pytest.mark.usefixtures("short_memory")
def test_reports_and_fleets_of_long_records_stay_in_memory(tmp_path, monkeypatch):
    from gearsig.batch import report_many
    from gearsig.fleet import open_fleet

    def whole(recording, *args, **more):
        assert recording.n_samples <= 8192
        return analyze(recording, *args, **more)

    monkeypatch.setattr("gearsig.diagnosis._long.analyze", whole)
    (tmp_path / "data").mkdir()
    path = write_recording(replace(LONG, speed=ConstantSpeed(600.0)), tmp_path / "data" / "pump.h5")
    made = report_many([path], tmp_path / "report", n_processes=1, memory_bytes=1e9)
    assert [failure.reason for failure in made.failures] == []
    page = (tmp_path / "report" / made.entries[0].page).read_text(encoding="utf-8")
    assert "48.828" in page
    fleet = open_fleet(tmp_path / "store", create=True)
    fleet.add(tmp_path / "data", n_processes=1, memory_bytes=1e9)
    row = fleet.recordings().iloc[0]
    assert row["duration_s"] == pytest.approx(200_000 / RATE)
    assert row["outcome"] in ("fault", "suspicion", "cannot tell", "no fault")
