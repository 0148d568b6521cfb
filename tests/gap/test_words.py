"""Features in words."""

from __future__ import annotations

from gearsig.gap import family_of, feature_words, gear_frame, load_learned
from tests.gap.synthetic import RIG


def test_every_feature_has_words_of_its_own_and_a_family() -> None:
    names = load_learned().change_names
    words = [feature_words(name, gear_frame(RIG)) for name in names]
    assert len(set(words)) == len(names)
    assert all(family_of(name) for name in names)
