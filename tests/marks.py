"""Marks that many tests give."""

from typing import Any

import pytest


def further(*values: object) -> Any:
    """Return values of a parametrised test that hold once more what the others hold: on demand, a study."""
    return pytest.param(*values, marks=pytest.mark.study)
