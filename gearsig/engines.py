"""Other programs that compute the same result, loaded only when they are chosen by `engine=`."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType

from gearsig.errors import GearsigError, InputError


@contextmanager
def engine_module(name: str) -> Iterator[ModuleType]:
    """Load an optional engine and turn whatever it raises into one sentence.

    Parameters
    ----------
    name : str
        Name of the package, which is the engine's name too.

    Raises
    ------
    InputError
        If the package cannot be loaded, or fails inside the block; the remedy names gearsig's own engine.
    """
    try:
        module = import_module(name)
    except Exception as error:  # a package may also break on its own dependencies, with any exception
        raise InputError(
            f"the engine {name} cannot be loaded ({error})",
            where="engine",
            remedy=f'install it with "pip install {name}", or choose engine="gearsig"',
        ) from error
    try:
        yield module
    except GearsigError:
        raise
    except Exception as error:
        raise InputError(
            f"the engine {name} failed ({type(error).__name__}: {error})",
            where="engine",
            remedy='choose engine="gearsig", or a shorter signal',
        ) from error
