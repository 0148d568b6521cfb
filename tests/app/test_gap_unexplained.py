"""Strange families in a recording of gears are named beside the catalogue's causes."""

from __future__ import annotations

import numpy as np

from app.gap.unexplained import unexplained
from gearsig.checks import FloatArray
from tests.gap.synthetic import RIG, record, ringing

STRANGE = 5.148


def knocking(_time: FloatArray, revolutions: FloatArray) -> FloatArray:
    return np.asarray(3.0 * ringing(revolutions * STRANGE))


def test_impacts_at_a_strange_order_are_named_and_a_reference_that_has_them_silences_them() -> None:
    struck, sound = record(knocking), record(seed=1)
    texts = unexplained(struck, RIG, [sound], [RIG], "today")
    assert any("5.148" in text and "today" in text for text in texts)
    again = unexplained(struck, RIG, [record(knocking, seed=2)], [RIG], "today")
    assert not any("5.148" in text for text in again)


def test_sound_gears_have_nothing_strange() -> None:
    assert unexplained(record(), RIG, [], [], "today") == ()
