"""How kernels that allocate nothing are compiled."""

# mypy: allow-untyped-calls

from __future__ import annotations

from typing import Any

from numba.core.options import DefaultOptions

UNCOUNTED: dict[str, Any] = {"_nrt": False} if hasattr(DefaultOptions, "_nrt") else {}
"""Options of `numba.njit` without the counting of references to arrays, an atomic operation wherever one is passed on,
which took a fifth of the time of short steps. An allocation in such a kernel is an error when it is compiled."""
