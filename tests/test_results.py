"""What every result offers: a `repr` of a few lines, a table for pandas."""

import importlib
import pkgutil
import subprocess
import sys
from dataclasses import dataclass, fields

import numpy as np
import pytest

import gearsig
from gearsig.angle import ShaftAngle
from gearsig.errors import InputError
from gearsig.orders import OrderMap, SynchronousAverage
from gearsig.recording import Channel, Recording
from gearsig.results import Result, to_frame, verdict_html

RATE_HZ = 1000.0


def tone(*frequencies_hz: float) -> np.ndarray:
    t = np.arange(8000) / RATE_HZ
    return sum((3.0 * np.sin(2 * np.pi * f * t) for f in frequencies_hz), np.zeros(len(t)))


def all_results() -> set[type[Result]]:
    for module in pkgutil.iter_modules(gearsig.__path__):
        importlib.import_module(f"gearsig.{module.name}")
    return {sub for sub in Result.__subclasses__() if sub.__module__.startswith("gearsig.")}


def test_the_declared_columns_of_every_result_are_there() -> None:
    for cls in all_results():
        names = {f.name for f in fields(cls)}
        declared = {cls._rows, *cls._columns, *(name.removesuffix(".T") for name in cls._matrix or ())} - {""}
        assert not {name for name in declared if name not in names and not hasattr(cls, name)}, cls


def test_no_result_spells_its_arrays_out() -> None:
    x, time_s = tone(50.0), np.array([0.0, 8.0])
    angle = ShaftAngle("input", time_s, 10.0 * time_s, np.full(2, 10.0), "constant")
    results = (
        angle,
        gearsig.amplitude_spectrum(x, RATE_HZ),
        gearsig.stft(x, RATE_HZ),
        gearsig.kurtogram(x + np.random.default_rng(0).normal(size=len(x)), RATE_HZ),
        gearsig.synchronous_average(x, RATE_HZ, shaft_angle=angle),
        gearsig.delay_embedding(x, RATE_HZ, delay_samples=5, dimension=3),
    )
    for result in results:
        assert len(repr(result)) < 1000
        assert repr(result).startswith(type(result).__name__)


def test_a_spectrum_becomes_a_table_with_the_name_of_its_axis() -> None:
    spectrum = gearsig.amplitude_spectrum(tone(50.0), RATE_HZ)
    table = spectrum.to_frame()
    assert list(table.columns) == ["frequency_hz", "values"]
    peak = table.loc[table["values"].idxmax()]
    assert peak["frequency_hz"] == pytest.approx(50.0)
    assert peak["values"] == pytest.approx(3.0)


def test_a_map_runs_down_along_time_and_across_over_its_lines() -> None:
    """Square, so that nothing but the declared axes can tell rows from columns."""
    values = np.array([[1.0, 2.0], [3.0, 4.0]])
    axes = np.array([0.0, 1.0]), np.array([10.0, 11.0]), np.array([600.0, 660.0])
    table = OrderMap(values, *axes, "order", "amplitude peak", "g", 1.0, "a", "s").to_frame()
    assert (table.index.name, table.columns.name) == ("time_s", "order")
    assert table.loc[10.0, 1.0] == 2.0
    coefficients = gearsig.stft(tone(50.0), RATE_HZ, window_length=0.1, highest=100.0)
    table = coefficients.to_frame()
    assert table.shape == (len(coefficients.at), len(coefficients.positions))
    assert np.abs(table).iloc[4000].idxmax() == pytest.approx(50.0)


def test_results_in_a_sequence_are_told_apart_by_what_differs() -> None:
    angle = ShaftAngle("s", np.array([0.0, 8.0]), np.array([0.0, 80.0]), np.full(2, 10.0), "constant")
    recording = Recording(tone(50.0, 80.0)[None], RATE_HZ, (Channel("a1", unit="g"),))
    tracked = gearsig.track_orders(gearsig.resample_to_angle(recording, angle, channels=["a1"]), "a1", [5.0, 8.0])
    table = to_frame(tracked)
    assert list(table.columns) == ["order", "time_s", "speed_rpm", "amplitude", "phase_rad"]
    assert table.groupby("order")["amplitude"].median().to_list() == pytest.approx([3.0, 3.0], rel=1e-3)


def test_findings_and_parameters_are_rows() -> None:
    @dataclass(frozen=True)
    class Item:
        name: str
        value: float
        samples: np.ndarray

    @dataclass(frozen=True)
    class Items(Result, rows="items"):
        items: tuple[Item, ...]

    table = Items((Item("a", 1.0, np.zeros(3)), Item("b", 2.0, np.zeros(5)))).to_frame()
    assert table.to_dict("list") == {"name": ["a", "b"], "value": [1.0, 2.0]}


def test_a_part_that_some_items_lack_is_no_column_of_its_own() -> None:
    @dataclass(frozen=True)
    class Strength:
        value: float

    @dataclass(frozen=True)
    class Item:
        name: str
        strength: Strength | None
        note: str | None = None

    table = to_frame((Item("a", None), Item("b", Strength(2.0))))
    assert list(table.columns) == ["name", "note", "strength.value"]
    assert table["strength.value"].isna().to_list() == [True, False]


def test_signals_by_name_are_columns_of_a_subclass_too() -> None:
    @dataclass(frozen=True)
    class Run(Result, columns=("time_s", "signals")):
        time_s: np.ndarray
        signals: dict[str, np.ndarray]

    @dataclass(frozen=True)
    class LongRun(Run):
        n_steps: int = 0

    table = LongRun(np.arange(3.0), {"x": np.ones(3), "y": np.zeros(3)}).to_frame()
    assert list(table.columns) == ["time_s", "x", "y"]


def test_an_average_is_a_table_over_its_revolution() -> None:
    average = SynchronousAverage(np.arange(4.0), np.zeros(4), 3, "s", "a", "g", "average", 2.0)
    assert average.to_frame()["revolutions"].to_list() == [0.0, 0.25, 0.5, 0.75]


def test_what_has_no_table_is_refused() -> None:
    with pytest.raises(InputError):
        to_frame(3.0)


def test_notebooks_show_a_table_in_which_names_are_text():
    @dataclass(frozen=True)
    class Levels(Result):
        values: np.ndarray
        source: str

    html = Levels(np.arange(3.0), "<script>")._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html
    assert html.count("<tr>") == 3  # the head, and two fields


def test_a_notebook_shows_what_is_said_first() -> None:
    @dataclass(frozen=True)
    class Told(Result):
        verdict: str
        n_tried: int

    assert repr(Told("the <b> stands out", 3)).splitlines() == ["the <b> stands out", "Told: n_tried 3"]
    assert repr(Told("regular", 3)) == "Told: verdict 'regular', n_tried 3"  # a word needs no line of its own
    html = verdict_html(["a < b"], ("cause",), [("<i>",)])
    assert "a &lt; b" in html
    assert "&lt;i&gt;" in html
    shown = Recording(np.zeros((1, 8)), 4.0, (Channel("<x>", "acceleration", "g"),))._repr_html_()
    assert "&lt;x&gt;" in shown
    assert "2 s at 4 Hz" in shown


@pytest.mark.slow
def test_figures_are_part_of_the_vocabulary() -> None:
    """As somebody writes who has imported nothing else."""
    code = "import gearsig, numpy; print(len(gearsig.plot.amplitude_spectrum(numpy.ones(64), 64.0).axes))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "1\n"
