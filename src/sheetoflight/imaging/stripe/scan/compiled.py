"""How the kernels of this package are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., object])

# "contract" lets a product and a sum become one instruction.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


def kernel(function: _Function) -> _Function:
    """Compile to machine code that runs without the interpreter's lock.

    The code is kept on disk for the next process, beside the source or in the user's cache
    folder; where neither can be written, it is compiled anew in each process.
    """
    try:
        return njit(cache=True, **_OPTIONS)(function)
    except RuntimeError:  # Numba found no folder to write to
        return njit(**_OPTIONS)(function)
