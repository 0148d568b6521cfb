"""What the checks at the public functions take, and what they say of the rest."""

from collections.abc import Mapping
from os import PathLike
from pathlib import Path

import numpy as np
import pytest

from gearsig.checks import frozen_array, instance_of, known_name, listed, listed_numbers, number, positive, short
from gearsig.errors import InputError


@pytest.mark.parametrize(
    "value",
    ["1500", b"1500", True, np.True_, None, 1500 + 0j, np.complex128(1500), np.array([1500.0]), [1500.0], object()],
)
def test_what_is_no_number_is_refused_also_where_float_would_take_it(value):
    for check in (number, positive):
        with pytest.raises(InputError, match=r"^speed_rpm is .* \(allowed: a number\)"):
            check(value, "speed_rpm", "rpm")


@pytest.mark.parametrize("value", [1500, 1500.0, np.float32(1500), np.int16(1500), np.array(1500.0)])
def test_numbers_of_any_kind_are_taken(value):
    assert number(value, "speed_rpm") == positive(value, "speed_rpm") == 1500.0


def test_kinds_are_named_as_users_call_them():
    with pytest.raises(InputError, match=r"^rig is 5 \(allowed: text, path, array, Mapping, None\); do that$"):
        instance_of(5, str | PathLike | np.ndarray | Mapping | None, "rig", remedy="do that")
    assert instance_of("a", str | None, "rig") == "a"


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ("a1", r"channels is 'a1' \(allowed: a list or tuple of text\); write \['a1'\]"),
        (5, r"channels is 5 \(allowed: a list or tuple of text\)$"),
        (None, r"channels is None \(allowed"),
        (np.array("a1"), r"channels is an array of shape \(\) \(allowed"),
        (["a1", 2], r"channels\[1\] is 2 \(allowed: text\)"),
    ],
)
def test_a_text_or_a_single_value_is_not_several(values, said):
    with pytest.raises(InputError, match=said):
        listed(values, "channels", str)


def test_several_come_from_any_iterable():
    assert listed((name for name in "ab"), "channels", str) == ("a", "b")
    assert listed_numbers(np.array([2, 4.5]), "orders") == (2.0, 4.5)


@pytest.mark.parametrize("values", ["2,4", 10.0, None, [2, "4"], [2, None], [[2, 4]]])
def test_several_numbers(values):
    with pytest.raises(InputError, match=r"^orders(\[\d\])? is "):
        listed_numbers(values, "orders")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        (np.ones(3) + 0j, "x holds complex numbers"),
        (["1", "2"], "x holds text"),
        ("a.csv", "x is 'a.csv'"),
        (np.array(["2026-01-01"], dtype="M8[s]"), "x holds times"),
        ([[1, 2], [3]], "x does not hold numbers"),
        ([object()], "x does not hold numbers"),
        (np.ma.masked_greater([1.0, 2.0, 3.0], 1.5), r"x holds 2 masked value"),
    ],
)
def test_arrays_lose_nothing_in_silence(values, said):
    with pytest.raises(InputError, match=said):
        frozen_array(values, "x", ndim=1)


def test_arrays_of_plain_numbers_are_taken():
    for values in ([True, False], np.ma.masked_array([1.0, 2.0]), np.array([1, 2], dtype=object), range(2)):
        assert frozen_array(values, "x", ndim=1).dtype == np.float64


@pytest.mark.parametrize("name", [5, None, ["a1"], np.array(["a1", "a2"])])
def test_a_name_that_is_no_text_is_not_known(name):
    with pytest.raises(InputError, match=r"there is no such channel \(allowed: a1, a2\)"):
        known_name(name, ("a1", "a2"), "there is no such channel")


def test_values_are_shown_in_a_few_words():
    assert short(Path("a.csv")) == "'a.csv'"
    assert short(np.zeros((2, 20000))) == "an array of shape (2, 20000)"
    assert short(list(range(10**6))) == "a list of 1000000"
    assert short(InputError("x")) == "an InputError"
