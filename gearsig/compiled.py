"""Numba's decorator, whose kept code stops nobody: damaged it is compiled anew, and a full disk just keeps none.

Numba itself ends with the error of the one or the other.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from numba import njit
from numba.core import dispatcher
from numba.core.caching import FunctionCache, NullCache

__all__ = ["njit"]


class _KeptCode(FunctionCache):  # type: ignore[misc,unused-ignore]
    """What is kept of one function: an index, and a file of each signature that it was called with."""

    def load_overload(self, signature: Any, target: Any) -> Any:
        try:
            return super().load_overload(signature, target)
        except Exception:  # noqa: BLE001 - damaged bytes make pickle and LLVM raise anything
            return None

    def save_overload(self, signature: Any, code: Any) -> None:
        with suppress(OSError):
            try:
                super().save_overload(signature, code)
            except OSError:
                raise
            except Exception:  # noqa: BLE001 - the index is damaged: begin another
                self.flush()
                super().save_overload(signature, code)


def _cache_of(function: Callable[..., Any]) -> Any:
    try:
        return _KeptCode(function)
    except RuntimeError:  # there is no room for so much as a folder
        return NullCache()


dispatcher.FunctionCache = _cache_of  # type: ignore[attr-defined,unused-ignore]
