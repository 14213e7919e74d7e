"""How the kernels of this package are compiled."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

_Function = TypeVar("_Function", bound=Callable[..., object])
# "contract" lets a product and a sum become one instruction.
_OPTIONS = {"nogil": True, "error_model": "numpy", "fastmath": {"contract"}}


def kernel(function: _Function) -> _Function:
    """Compile to machine code that runs without the interpreter's lock.

    The code is kept on disk for the next process, beside the source or in the user's cache
    folder; where neither can be written, it is compiled anew in each process. What is kept is
    dropped when the kernel's own file changes, not when that of a kernel it calls does: after
    such an edit, delete the ``*.nbi`` files.
    """
    try:
        return cast(_Function, njit(cache=True, **_OPTIONS)(function))
    except RuntimeError:  # Numba found no folder to write to
        return cast(_Function, njit(**_OPTIONS)(function))
