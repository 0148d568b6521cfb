"""How kernels are compiled: numba's decorator, whose kept code stops nobody: damaged it is compiled anew.

A full disk just keeps none; numba itself ends with the error of the one or the other.
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
    """Return `numba.njit` with these options.

    Parameters
    ----------
    cache : bool
        Whether compiled code is kept on disk.
    **options
        Numba's.
    """
    compiled = numba.njit(**options)

    def decorate(function: Callable[..., Any]) -> Any:
        dispatcher = compiled(function)
        if cache:
            with suppress(RuntimeError):  # there is no room for so much as a folder
                dispatcher._cache = _KeptCode(function)
        return dispatcher

    return decorate


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


UNCOUNTED: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
"""Options of `numba.njit` without the counting of references to arrays, an atomic operation wherever one is passed on,
which took a fifth of the time of short steps. An allocation in such a kernel is an error when it is compiled."""


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def copy(source, out):  # type: ignore[no-untyped-def]
    """Write a vector to the beginning of another; `out[:] = source` compiles for two seconds, for its error text."""
    for i in range(source.shape[0]):
        out[i] = source[i]
