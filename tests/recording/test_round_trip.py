"""What is written is read back the same."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from gearsig.errors import InputError
from gearsig.recording import Channel, Recording, read_recording, write_recording
from gearsig.rig import QUANTITIES, ConstantSpeed, EncoderChannel, PulseTimes, SpeedChannel, TachometerChannel

EXTENSIONS = (".csv", ".h5", ".parquet", ".wav", ".mat")
TEXTS = st.text(st.characters(exclude_categories=("Cs",)), max_size=12)
FINITE = st.floats(0.001, 1e6)
SPEEDS = st.one_of(
    st.none(),
    st.builds(ConstantSpeed, FINITE, TEXTS),
    st.builds(PulseTimes, st.lists(FINITE, min_size=1, max_size=5).map(np.array), st.integers(1, 60), TEXTS),
    st.builds(TachometerChannel, TEXTS, st.integers(1, 60), st.none() | FINITE, st.none() | FINITE),
    st.builds(EncoderChannel, TEXTS, FINITE, st.booleans()),
    st.builds(SpeedChannel, TEXTS, FINITE),
)
TRUTHS = st.none() | st.dictionaries(TEXTS, st.integers(-5, 5) | st.lists(FINITE, max_size=3) | TEXTS, max_size=3)


@st.composite
def recordings(draw, dtypes=(np.float32, np.float64)):
    n_channels = draw(st.integers(1, 4))
    dtype = draw(st.sampled_from(dtypes))
    width = np.dtype(dtype).itemsize * 8
    values = st.floats(allow_nan=False, allow_infinity=False, width=width)
    samples = draw(arrays(dtype, (n_channels, draw(st.integers(1, 12))), elements=values))
    names = draw(st.lists(TEXTS, min_size=n_channels, max_size=n_channels, unique=True))
    channels = tuple(Channel(n, draw(st.sampled_from(QUANTITIES)), draw(TEXTS), draw(TEXTS)) for n in names)
    rate_hz = draw(st.floats(1.0, 1e8))
    return Recording(
        samples,
        rate_hz,
        channels,
        speed=draw(SPEEDS),
        truth=draw(TRUTHS),
        warnings=tuple(draw(st.lists(TEXTS, max_size=2))),
    )


def assert_same(a, b):
    np.testing.assert_array_equal(a.samples, b.samples)
    assert a.sampling_rate_hz == b.sampling_rate_hz
    assert a.channels == b.channels
    assert a.warnings == b.warnings
    assert (a.truth is None) == (b.truth is None)
    assert dict(a.truth or {}) == dict(b.truth or {})
    if isinstance(a.speed, PulseTimes):
        np.testing.assert_array_equal(a.speed.times_s, b.speed.times_s)
        assert (a.speed.pulses_per_revolution, a.speed.shaft) == (b.speed.pulses_per_revolution, b.speed.shaft)
    else:
        assert a.speed == b.speed


@pytest.mark.parametrize("extension", EXTENSIONS)
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.data())
def test_round_trip(tmp_path, extension, data):
    recording = data.draw(recordings((np.float32,) if extension == ".wav" else (np.float32, np.float64)))
    back = read_recording(write_recording(recording, tmp_path / f"r{extension}"))
    assert back.samples.dtype == recording.samples.dtype
    assert_same(recording, back)
    assert [p.name for p in tmp_path.iterdir()] == [f"r{extension}"]


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_many_samples_and_a_long_description(tmp_path, extension):
    rng = np.random.default_rng(3)
    r = Recording(
        rng.standard_normal((3, 50_000)).astype(np.float32),
        51200.5,
        (Channel("a"), Channel("b"), Channel("1")),
        speed=PulseTimes(np.cumsum(rng.uniform(0.01, 0.02, 30_000))),
        truth={"crack": np.float64(0.5), "teeth": np.arange(3)},
    )
    back = read_recording(write_recording(r, tmp_path / f"r{extension}"))
    np.testing.assert_array_equal(back.samples, r.samples)
    np.testing.assert_array_equal(back.speed.times_s, r.speed.times_s)
    assert back.truth["teeth"] == [0, 1, 2]


def test_wav_rounds_to_single(tmp_path):
    r = Recording(np.array([[0.1, 1 / 3]]), 10.5, (Channel("a", "acceleration", "m/s^2"),))
    back = read_recording(write_recording(r, tmp_path / "r.wav"))
    np.testing.assert_array_equal(back.samples, r.samples.astype(np.float32))
    with pytest.raises(InputError, match="float32"):
        write_recording(Recording(np.array([[1e300]]), 10.0, (Channel("a"),)), tmp_path / "s.wav")
    with pytest.raises(InputError, match="Hz"):
        write_recording(Recording(np.array([[1.0]]), 0.1, (Channel("a"),)), tmp_path / "s.wav")


def test_nothing_half_written(tmp_path):
    r = Recording(np.zeros((1, 4)), 10.0, (Channel("a"),), truth={"bad": object()})
    (tmp_path / "r.csv").write_text("before")
    for extension in EXTENSIONS:
        with pytest.raises(InputError, match="truth"):
            write_recording(r, tmp_path / f"r{extension}")
    assert [p.name for p in tmp_path.iterdir()] == ["r.csv"]
    assert (tmp_path / "r.csv").read_text() == "before"


def test_where_nothing_can_be_written(tmp_path):
    r = Recording(np.zeros((1, 4)), 10.0, (Channel("a"),))
    with pytest.raises(InputError, match=r"'\.xyz' cannot be written \(allowed: \.csv"):
        write_recording(r, tmp_path / "r.xyz")
    with pytest.raises(InputError, match="does not exist"):
        write_recording(r, tmp_path / "none" / "r.csv")
    (tmp_path / "dir.csv").mkdir()
    with pytest.raises(InputError, match="cannot be written"):
        write_recording(r, tmp_path / "dir.csv")


@pytest.mark.parametrize("damage", [lambda t: t.replace("channels", "chanels"), lambda t: t.replace("{", "[", 1)])
def test_damaged_description(tmp_path, damage):
    r = Recording(np.zeros((1, 4)), 10.0, (Channel("a"),))
    path = write_recording(r, tmp_path / "r.csv")
    path.write_text(damage(path.read_text()))
    with pytest.raises(InputError, match=r"r\.csv: gearsig's description"):
        read_recording(path)


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("most_bytes", [0, 3_000, 40_000])
def test_a_full_disk_is_said_and_leaves_nothing(extension, most_bytes, tmp_path):
    resource = pytest.importorskip("resource")
    x = np.random.default_rng(0).normal(size=(2, 20_000)).astype(np.float32)
    recording = Recording(x, 1000.0, (Channel("a", "acceleration", "g"), Channel("b", "acceleration", "g")))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most_bytes, before[1]))  # as if no more room were left
    try:
        with pytest.raises(InputError, match=r"cannot be written \(File too large\); make room"):
            write_recording(recording, tmp_path / f"x{extension}")
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert not any(tmp_path.iterdir())
