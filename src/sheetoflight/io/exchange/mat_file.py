"""Variables of MATLAB files, version 5, each checked for its size before it is unpacked."""

from __future__ import annotations

import io
import warnings
import zlib
from collections.abc import Callable, Collection
from typing import Any

import numpy as np

from sheetoflight.errors import FileError, InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.quoting import one_line

LIMIT_BYTES = 64 * 1024 * 1024
MAGIC = b"MATLAB "

_VERSION_5 = b"MATLAB 5.0 MAT-file"
_MOST_NUMBERS = 1_000_000
_HEADER_BYTES = 116
_DAMAGED = "the file is damaged or cut short: save it again with save -v6"


def mat_shapes(data: bytes) -> dict[str, tuple[int, ...]]:
    """Shapes of all variables by name.

    Raises
    ------
    FileError
        If the data are no MATLAB file of version 5, or damaged.
    """
    if not data.startswith(_VERSION_5):
        raise FileError(
            f"this is no MATLAB file of version 5 ({one_line(repr(data[:20]))})",
            "save it with save -v6",
        )
    from scipy.io import whosmat

    listed = _careful(lambda: whosmat(io.BytesIO(data)))
    return {name: tuple(shape) for name, shape, _ in listed}


def mat_variables(data: bytes, names: Collection[str]) -> dict[str, Any]:
    """The named variables that are there; numbers as double-precision arrays ``(M, N)``.

    Raises
    ------
    FileError
        If the data are no MATLAB file of version 5, or damaged.
    InputError
        If a variable is larger than a million numbers.
    """
    shapes = mat_shapes(data)
    wanted = [name for name in names if name in shapes]
    for name in wanted:
        if min(shapes[name], default=0) < 0 or np.prod(shapes[name], dtype=float) > _MOST_NUMBERS:
            raise InputError(
                f"{one_line(name)} has the shape {shapes[name]}", "check that it is the right file"
            )
    if not wanted:
        return {}
    from scipy.io import loadmat

    found = _careful(lambda: loadmat(io.BytesIO(data), variable_names=wanted))
    return {name: found[name] for name in wanted if name in found}


def real_numbers(variables: dict[str, Any], name: str) -> Array:
    """A variable as real numbers ``(M, N)``, which may be NaN.

    Raises
    ------
    InputError
        If it is missing or something else.
    """
    if name not in variables:
        raise InputError(f"'{name}' is missing", "add it")
    value = np.asarray(variables[name])
    if value.dtype.kind not in "iufb" or value.ndim != 2:
        raise InputError(f"{name} is no matrix of real numbers", "correct it")
    return value.astype(float)


def mat_bytes(variables: dict[str, Any]) -> bytes:
    """Variables as a MATLAB file of version 5; the same variables give the same bytes."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    savemat(buffer, variables, format="5", oned_as="column")
    data = buffer.getvalue()
    # SciPy's header states the time of writing
    return (_VERSION_5 + b", written by sheetoflight").ljust(_HEADER_BYTES) + data[_HEADER_BYTES:]


def _careful(read: Callable[[], Any]) -> Any:
    """What a reader of SciPy gives; whatever it raises or warns of means a damaged file."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return read()
    except MemoryError as error:
        raise FileError("the MATLAB file claims more than the memory holds", _DAMAGED) from error
    except (Exception, zlib.error) as error:
        raise FileError(
            f"the MATLAB file cannot be read ({one_line(str(error))})", _DAMAGED
        ) from error
