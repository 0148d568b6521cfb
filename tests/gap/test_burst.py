"""How a tooth's energy is spread over the pitches about its loudest part."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from gearsig.checks import FloatArray
from gearsig.gap import burst_features

TEETH, STEPS = 31, 128
PITCHES = np.arange(TEETH * STEPS) / STEPS
NOISE = 1e-9


def lines_of(wave: FloatArray) -> NDArray[np.complex128]:
    """Return those of one revolution up to ten mesh orders."""
    lines: NDArray[np.complex128] = np.fft.rfft(wave)[None, : 10 * TEETH + 1]
    return lines


def ringing(at_pitch: float, decay_pitches: float = 0.15, mesh_order: float = 5.3) -> FloatArray:
    """Return a burst that begins at a tooth and dies away."""
    since = PITCHES - at_pitch
    wave: FloatArray = np.where(
        since >= 0.0,
        np.exp(-np.maximum(since, 0.0) / decay_pitches) * np.sin(2.0 * np.pi * mesh_order * since),
        0.0,
    )
    return wave


def found(lines: NDArray[np.complex128]) -> dict[str, float]:
    return dict(burst_features(lines, np.full(lines.shape, NOISE), TEETH))


def test_a_short_burst_lies_in_the_quarters_after_its_beginning() -> None:
    features = found(lines_of(ringing(7.0)))
    shares = 10 ** (np.array([features[f"burst.plain.course.{i}"] for i in range(18)]) / 10)
    assert shares[6:8].sum() > 0.8  # 0 to 0.5 pitches
    assert shares.sum() == pytest.approx(1.0, abs=0.01)
    assert features["burst.plain.elsewhere"] < -13.0


@pytest.mark.parametrize(("turned_by", "within_db"), [(11.0, 1e-6), (29.75, 1e-6), (0.4, 2.0)])
def test_neither_the_tooth_nor_the_gain_counts(turned_by: float, within_db: float) -> None:
    """Between two of 64 steps per pitch the small shares before a steep beginning differ by a decibel or two."""
    lines = lines_of(ringing(7.0))
    turned = 3.0 * lines * np.exp(2j * np.pi * np.arange(lines.shape[1]) * turned_by / TEETH)
    for name, value in found(lines).items():
        assert found(turned)[name] == pytest.approx(value, abs=within_db), name


def test_a_second_burst_is_heard_as_an_echo_at_its_lag() -> None:
    alone, twice = found(lines_of(ringing(7.0))), found(lines_of(ringing(7.0) + 0.9 * ringing(8.2)))
    rises = [twice[f"burst.plain.echo.{i}"] - alone[f"burst.plain.echo.{i}"] for i in range(13)]
    assert np.argmax(rises) == 6  # 0.3 + 6·0.15 = 1.2 pitches
    assert rises[6] > 6.0
    assert max(rises[:3]) < 3.0


def test_even_magnitudes_hear_a_broad_burst_through_a_resonance() -> None:
    """A path with one sharp resonance smears a click; with magnitudes made even more of it is where it was."""
    orders = np.arange(10 * TEETH + 1)
    click = np.exp(-2j * np.pi * orders * 7.0 / TEETH)[None]
    resonance = 1.0 / (1.0 - (orders / (6.2 * TEETH)) ** 2 + 2j * 0.01 * orders / (6.2 * TEETH))
    features = found(click * resonance)
    loudest = {way: max(features[f"burst.{way}.course.{i}"] for i in range(18)) for way in ("plain", "even")}
    assert loudest["even"] > loudest["plain"] + 2.0


def test_lines_of_nothing_have_shares_as_well() -> None:
    features = found(np.zeros((2, 10 * TEETH + 1), dtype=np.complex128))
    assert np.isfinite(list(features.values())).all()


def test_a_gear_of_few_teeth_and_few_lines_is_read() -> None:
    rng = np.random.default_rng(0)
    lines = rng.normal(size=(1, 20)) + 1j * rng.normal(size=(1, 20))
    assert np.isfinite(list(dict(burst_features(lines, np.ones((1, 20)), 5)).values())).all()
