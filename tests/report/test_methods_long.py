"""Methods of files: what fits is looked at whole, what does not in blocks, and what has no blocks is refused before."""

from dataclasses import replace

import numpy as np
import pytest

from app.cli.main import main
from gearsig.errors import InputError
from gearsig.methods import METHODS, apply_method, apply_method_to_file
from gearsig.recording import Channel, Recording, read_recording, write_recording
from gearsig.rig import ConstantSpeed, GearPair, Rig, Shaft

RATE_HZ, N = 4096.0, 200_000
RIG = Rig(
    "pair",
    shafts=(Shaft("input"), Shaft("output")),
    pairs=(GearPair("stage 1", "input", "output", 20, 40),),
    speed=ConstantSpeed(600.0),
)
BAND_HZ = (800.0, 1200.0)


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A mesh of amplitude 3 at order 20, 200 Hz, and 5 bursts a second at 1 kHz, in noise of 0.1."""
    t = np.arange(N) / RATE_HZ
    bursts = 4.0 * np.exp(-((t % 0.2) * 300.0)) * np.sin(2 * np.pi * 1000.0 * (t % 0.2))
    x = 3.0 * np.cos(2 * np.pi * 200.0 * t) + bursts + 0.1 * np.random.default_rng(0).normal(size=N)
    recording = Recording(
        x[None].astype(np.float32), RATE_HZ, (Channel("a1", "acceleration", "m/s^2"),), speed=ConstantSpeed(600.0)
    )
    return write_recording(recording, tmp_path_factory.mktemp("long") / "long.h5")


@pytest.fixture
def little(monkeypatch):
    """As if a sample took a hundred times the memory: the record does not fit, 10 s of it do."""
    for name, method in METHODS.items():
        monkeypatch.setitem(METHODS, name, replace(method, bytes_per_sample=40_000.0))


def read_parts_only(monkeypatch):
    """Let nothing read all of a recording."""

    def read(path, *, part, **given):
        assert part is not None
        assert part.stop - part.start < N
        return read_recording(path, part=part, **given)

    monkeypatch.setattr("gearsig.diagnosis._blocks.read_recording", read)


@pytest.mark.slow
def test_what_fits_is_as_if_it_had_been_read_before(path):
    found = apply_method_to_file("density", path, RIG, start_s=10.0, end_s=30.0)
    whole = apply_method("density", read_recording(path, rig=RIG), start_s=10.0, end_s=30.0)
    for title, column in whole.table.items():
        np.testing.assert_array_equal(found.table[title], column)


@pytest.mark.usefixtures("little")
@pytest.mark.parametrize("name", [name for name, method in METHODS.items() if method.in_blocks is not None])
def test_in_blocks_a_method_shows_the_same(name, path, monkeypatch):
    monkeypatch.setattr("gearsig.diagnosis._blocks.BLOCK_SAMPLES", 50_000)
    options = {"band_hz": BAND_HZ} if name == "envelope" else {}
    read_parts_only(monkeypatch)
    found = apply_method_to_file(name, path, RIG, **options)
    assert found.method == name
    assert any("in blocks" in note for note in found.notes)
    if name == "average":
        _, values, *_ = found.table.values()
        lines = 2.0 * np.abs(np.fft.rfft(values)) / len(values)
        assert np.argmax(lines[1:]) + 1 == 20
        assert lines[20] == pytest.approx(3.0, rel=0.01)
        assert found.numbers["n_revolutions"] >= N / RATE_HZ * 10 - 2
    elif name in ("order-map", "frequency-map"):
        levels, lines = found.matrices["levels"], found.axes["order" if name == "order-map" else "frequency"]
        at = np.argmax(levels.mean(axis=0))
        assert lines[at] == pytest.approx(20.0 if name == "order-map" else 200.0, abs=0.6)
        assert levels[:, at] == pytest.approx(np.full(len(levels), 3.0), rel=0.02)
        assert found.axes["speed (rpm)"] == pytest.approx(np.full(len(levels), 600.0), rel=1e-3)
    else:
        hz, density = found.table.values()
        top = hz[5:][np.argmax(density[5:])]
        assert top % 5.0 == pytest.approx(0.0, abs=0.6) if name == "envelope" else top == pytest.approx(200.0, abs=1.0)


@pytest.mark.usefixtures("little")
def test_of_what_does_not_fit_a_part_is_looked_at(path):
    found = apply_method_to_file("spectrum", path, RIG, start_s=20.0, end_s=30.0)
    hz, amplitude = found.table.values()
    assert hz[np.argmax(amplitude)] == pytest.approx(200.0, abs=0.1)
    assert amplitude.max() == pytest.approx(3.0, rel=0.01)


@pytest.mark.usefixtures("little")
def test_without_blocks_it_is_refused_before_anything_is_read(path, monkeypatch, capsys):
    read_parts_only(monkeypatch)
    for name in ("spectrum", "kurtogram", "modes"):
        with pytest.raises(InputError, match=r"GB.*--from 0s --to [\d.]+s.*--memory.*density"):
            apply_method_to_file(name, path, RIG)
    with pytest.raises(InputError, match="no band is given"):
        apply_method_to_file("envelope", path, RIG)
    with pytest.raises(SystemExit) as ended:
        main(["show", "spectrum", str(path), "--memory", "0.3"])
    assert ended.value.code == 2
    assert "--to" in capsys.readouterr().err


@pytest.mark.usefixtures("little")
def test_text_is_read_whole_and_then_refused(path, tmp_path):
    text = write_recording(read_recording(path), tmp_path / "long.csv")
    with pytest.raises(InputError, match="convert it to HDF5"):
        apply_method_to_file("density", text, RIG)


def test_a_method_that_costs_more_by_its_options_says_so():
    orders = METHODS["vold-kalman"].bytes_per_sample
    assert orders({"orders": (1.0,) * 8}) > 2 * orders({"orders": ()})
