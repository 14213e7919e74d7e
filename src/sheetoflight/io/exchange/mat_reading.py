"""Variables of MATLAB files, version 5, read without trust.

SciPy's reader ends the whole program at some damaged files. This one knows only what is needed
here, real matrices and cell arrays of text, by "MAT-File Format" of The MathWorks, chapter 1.
A variable is unpacked when it is asked for, and never more of it than it may hold.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from sheetoflight.errors import FileError, InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.quoting import one_line

LIMIT_BYTES = 64 * 1024 * 1024
MAGIC = b"MATLAB "

Value = Array | list[str] | None
"""Real numbers ``(M, N)``, texts of a cell array, or something else."""

_VERSION_5 = b"MATLAB 5.0 MAT-file"
_HEADER_BYTES = 128
_MOST_BYTES = 16 * 1024 * 1024
"""Of one variable; a million corners take as much."""

_MOST_BYTES_IN_ALL = 16 * _MOST_BYTES

_ENOUGH_FOR_NAME = 1024
_MATRIX, _COMPRESSED = 14, 15
_CELL, _CHAR = 1, 4
_NUMERIC_CLASSES = range(6, 16)
_COMPLEX = 0x0800
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4"} | {
    7: "f4",
    9: "f8",
    12: "i8",
    13: "u8",
}
"""NumPy's names of the storage types."""

_ENCODINGS = {1: "latin-1", 2: "latin-1", 4: "utf-16", 16: "utf-8", 17: "utf-16", 18: "utf-32"}


class _DamagedError(Exception):
    """The bytes are not what the format allows."""


@dataclass(frozen=True)
class _Bytes:
    """A part of the file, and whether its numbers begin with the lowest byte."""

    data: bytes
    little: bool

    @property
    def order(self) -> str:
        """The byte order as NumPy and struct name it."""
        return "<" if self.little else ">"

    def elements(self, padded: bool = True) -> Iterator[tuple[int, _Bytes]]:
        """Storage type and content of each element in turn."""
        at = 0
        while at + 8 <= len(self.data):
            kind, count = struct.unpack_from(f"{self.order}II", self.data, at)
            begin = at + 8
            if kind >> 16:  # up to four bytes stand in the place of the count
                kind, count, begin = kind & 0xFFFF, kind >> 16, at + 4
                at += 8
            else:
                at = begin + count + (-count % 8 if padded and kind != _COMPRESSED else 0)
            if begin + count > len(self.data) or (begin + 4 == at and count > 4):
                raise _DamagedError("an element is cut short")
            yield kind, _Bytes(self.data[begin : begin + count], self.little)


def mat_names(data: bytes) -> list[str]:
    """Names of all variables.

    Raises
    ------
    FileError
        If the data are no MATLAB file of version 5, or damaged.
    """
    _check_version(data)
    try:
        return [name for name, _ in _variables(data)]
    except (_DamagedError, struct.error, zlib.error, ValueError) as error:
        raise _damaged(error) from error


def mat_variables(data: bytes, names: Collection[str]) -> dict[str, Value]:
    """The named variables that are there.

    Raises
    ------
    FileError
        If the data are no MATLAB file of version 5, or damaged.
    """
    _check_version(data)
    wanted = set(names)
    try:
        return _values((name, part) for name, part in _variables(data) if name in wanted)
    except RecursionError as error:
        raise _damaged(_DamagedError("cells in cells without end")) from error
    except (_DamagedError, struct.error, zlib.error, ValueError) as error:
        raise _damaged(error) from error


def _values(packed: Iterable[tuple[str, _Bytes]]) -> dict[str, Value]:
    found: dict[str, Value] = {}
    held = 0
    for name, part in packed:
        value = found[name] = _value(part)
        held += value.nbytes if isinstance(value, np.ndarray) else 0
        if held > _MOST_BYTES_IN_ALL:
            raise _DamagedError("its variables are larger than those of cameras and corners")
    return found


def real_numbers(variables: dict[str, Value], name: str) -> Array:
    """A variable as real numbers ``(M, N)``, which may be NaN.

    Raises
    ------
    InputError
        If it is missing or something else.
    """
    if name not in variables:
        raise InputError(f"'{name}' is missing", "add it")
    value = variables[name]
    if not isinstance(value, np.ndarray):
        raise InputError(f"{name} is no matrix of real numbers", "correct it")
    return value


def _damaged(error: Exception) -> FileError:
    return FileError(
        f"the MATLAB file is damaged or cut short ({one_line(str(error))})",
        "save it again with save -v6",
    )


def _check_version(data: bytes) -> None:
    if not data.startswith(_VERSION_5) or _ends(data) not in (b"IM", b"MI"):
        raise FileError(
            f"this is no MATLAB file of version 5 ({one_line(repr(data[:20]))})",
            "save it with save -v6",
        )


def _ends(data: bytes) -> bytes:
    """What tells the byte order."""
    return data[_HEADER_BYTES - 2 : _HEADER_BYTES]


def _variables(data: bytes) -> Iterator[tuple[str, _Bytes]]:
    """Name and packed content of each variable in turn."""
    whole = _Bytes(data[_HEADER_BYTES:], _ends(data) == b"IM")
    end = 0
    for kind, content in whole.elements():
        end += 1
        packed = kind == _COMPRESSED
        if kind != _MATRIX and not packed:
            raise _DamagedError(f"variable {end} is of the unknown type {kind}")
        begin = _matrix(_unpacked(content, _ENOUGH_FOR_NAME)) if packed else content
        yield _header(begin)[2], content if not packed else _Packed(content.data, content.little)
    if not end:
        raise _DamagedError("there are no variables in it")


@dataclass(frozen=True)
class _Packed(_Bytes):
    """A variable that has to be unpacked first."""


def _unpacked(content: _Bytes, most: int) -> _Bytes:
    return _Bytes(zlib.decompressobj().decompress(content.data, most), content.little)


def _matrix(element: _Bytes) -> _Bytes:
    """The content of the one matrix that was packed, as far as it is there."""
    kind, _ = struct.unpack_from(f"{element.order}II", element.data)
    if kind != _MATRIX:
        raise _DamagedError("no matrix was packed")
    return _Bytes(element.data[8:], element.little)


def _header(content: _Bytes) -> tuple[int, tuple[int, ...], str, Iterator[tuple[int, _Bytes]]]:
    """Class with its flags, shape and name of a matrix, and the elements that follow."""
    elements = content.elements()
    try:
        (_, flags), (_, shape), (_, name) = (next(elements) for _ in range(3))
    except RuntimeError as error:  # a generator's end within another
        raise _DamagedError("a variable has no header") from error
    (kind,) = struct.unpack_from(f"{content.order}I", flags.data)
    sides = np.frombuffer(shape.data, f"{content.order}i4").tolist()
    if len(sides) < 2 or min(sides) < 0:
        raise _DamagedError("a variable has no shape")
    return kind, tuple(sides), name.data.decode("latin-1").rstrip("\0"), elements


def _value(part: _Bytes) -> Value:
    if isinstance(part, _Packed):
        unpacked = _unpacked(part, _MOST_BYTES + 1)
        if len(unpacked.data) > _MOST_BYTES:
            raise _DamagedError("a variable is larger than those of cameras and corners")
        part = _matrix(unpacked)
    kind, shape, _, elements = _header(part)
    if kind & 0xFF == _CELL:
        return [_text(content) for _, content in elements]
    if kind & 0xFF not in _NUMERIC_CLASSES or kind & _COMPLEX or len(shape) != 2:
        return None
    return _real(shape, next(elements, None))


def _real(shape: tuple[int, ...], element: tuple[int, _Bytes] | None) -> Array:
    if element is None or element[0] not in _NUMBERS:
        raise _DamagedError("a matrix has no numbers")
    stored, content = element
    values = np.frombuffer(content.data, f"{content.order}{_NUMBERS[stored]}").astype(float)
    if values.size != shape[0] * shape[1]:
        raise _DamagedError(f"a matrix of {shape[0]} x {shape[1]} holds {values.size} numbers")
    return values.reshape(shape, order="F")


def _text(content: _Bytes) -> str:
    """The text of a cell; empty where it holds something else."""
    kind, _, _, elements = _header(content)
    stored, letters = next(elements, (0, content))
    if kind & 0xFF != _CHAR or stored not in _ENCODINGS:
        return ""
    encoding = _ENCODINGS[stored]
    if encoding in ("utf-16", "utf-32"):
        encoding += "-le" if content.little else "-be"
    return letters.data.decode(encoding)
