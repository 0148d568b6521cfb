"""Compilation of kernels: numba's decorator with a cache that never fails.

Damaged cache files are compiled again and a full disk caches nothing; numba itself raises an error in both cases.
"""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.options import DefaultOptions


def njit(*, cache: bool = False, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return the decorator `numba.njit` with these options and a fault-tolerant cache.

    Parameters
    ----------
    cache : bool
        Whether to keep compiled code on disk.
    **options
        Passed to numba.
    """
    compiled = numba.njit(**options)

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = compiled(function)
        if cache:
            with suppress(RuntimeError):  # the disk has no room even for a folder
                dispatcher._cache = _KeptCode(function)
        return dispatcher

    return decorate


class _KeptCode(FunctionCache):  # type: ignore[misc,unused-ignore]
    """The cache of one function: an index, and a file for each signature that it was called with."""

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
            except Exception:  # noqa: BLE001 - the index is damaged: start a new one
                self.flush()
                super().save_overload(signature, code)


UNCOUNTED: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
"""Options of `numba.njit` that turn off reference counting of arrays, an atomic operation whenever an array is passed
on, which took a fifth of the time of short steps. A kernel with these options that allocates arrays cannot compile."""


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def copy(source, out):  # type: ignore[no-untyped-def]
    """Copy a vector to the beginning of another; `out[:] = source` takes two seconds to compile, for its error text."""
    for i in range(source.shape[0]):
        out[i] = source[i]
