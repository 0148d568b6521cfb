"""The event is found at its angle, and gains do not matter."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gearsig.severity import (
    FEATURES,
    Conditions,
    ShaftLines,
    band_envelopes,
    feature_vector,
    find_event,
    mesh_energies,
    n_bands,
)
from tests.severity.averages import N_ORDERS, TEETH, flat_pulse, mesh_lines, shaft, teeth_pattern

CONDITIONS = Conditions(2.0, 50.0, 575.0)


def features_of(average: ShaftLines, mesh: ShaftLines | None = None) -> dict[str, float]:
    energies = mesh_energies(mesh or average, n_bands(average))
    vector = feature_vector(average, average, energies, find_event(average), CONDITIONS)
    return dict(zip(FEATURES, vector.tolist(), strict=True))


@given(st.floats(0.0, 0.999))
def test_event_is_found_where_it_is(centre_rev: float) -> None:
    event = find_event(shaft(mesh_lines() + teeth_pattern(1) + flat_pulse(centre_rev, 0.2)))
    off = (event.centre_rev - centre_rev + 0.5) % 1.0 - 0.5
    assert abs(off) < 0.5 / TEETH
    assert event.prominence > 10


def test_without_an_event_nothing_is_prominent() -> None:
    prominences = [find_event(shaft(mesh_lines() + teeth_pattern(seed))).prominence for seed in range(8)]
    assert max(prominences) < 4.0


def test_envelopes_keep_the_energy_of_their_lines() -> None:
    average = shaft(mesh_lines() + teeth_pattern(3))
    envelope = band_envelopes(average)[2, 0]
    orders = np.arange(2 * TEETH - TEETH // 2, 2 * TEETH + TEETH // 2 + 1)
    kept = orders[np.abs(orders - 2 * TEETH) > 2]
    assert envelope.mean() == pytest.approx(np.sum(np.abs(average.lines[0, kept]) ** 2), rel=1e-9)


@given(st.floats(0.01, 100.0), st.floats(0.01, 100.0))
def test_no_feature_depends_on_the_gain_of_a_channel(first: float, second: float) -> None:
    a = mesh_lines() + teeth_pattern(4) + flat_pulse(0.4, 0.2)
    b = mesh_lines((1.0, 2.0, 0.5, 0.5, 0.3, 0.3, 0.3)) + teeth_pattern(5) + flat_pulse(0.4, 0.1)
    plain, scaled = features_of(shaft(a, b)), features_of(shaft(first * a, second * b))
    assert list(scaled.values()) == pytest.approx(list(plain.values()), rel=1e-6, abs=1e-6)


def test_excess_over_the_mesh_grows_with_the_logarithm_of_the_energy() -> None:
    small, large = (
        features_of(shaft(mesh_lines() + teeth_pattern(6, 1e-5) + flat_pulse(0.3, size)), shaft(mesh_lines()))
        for size in (0.1, 0.2)
    )
    assert large["band_excess"] - small["band_excess"] == pytest.approx(np.log(4.0), abs=1e-3)
    assert large["line_excess"] - small["line_excess"] == pytest.approx(np.log(4.0), abs=1e-3)


def test_bands_end_at_the_highest_order() -> None:
    assert n_bands(shaft(mesh_lines())) == (N_ORDERS - TEETH // 2) // TEETH
