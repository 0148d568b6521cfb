"""How kernels that allocate nothing are compiled, and what several of them do."""

# mypy: allow-untyped-calls

from __future__ import annotations

from typing import Any

from numba.core.options import DefaultOptions

from gearsig.compiled import njit

UNCOUNTED: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
"""Options of `numba.njit` without the counting of references to arrays, an atomic operation wherever one is passed on,
which took a fifth of the time of short steps. An allocation in such a kernel is an error when it is compiled."""


@njit(cache=True, nogil=True)  # type: ignore[untyped-decorator,unused-ignore]
def copy(source, out):  # type: ignore[no-untyped-def]
    """Write a vector to the beginning of another; `out[:] = source` compiles for two seconds, for its error text."""
    for i in range(source.shape[0]):
        out[i] = source[i]
