"""Where the directories of a TIFF's pages lie.

Only their chain is followed, and nothing decoded: a stack of many thousand pages is listed in a
blink, and a chain that breaks off is told from one that ends.

References
----------
TIFF, revision 6.0 (Adobe, 1992), section 2; BigTIFF: the same with wider fields.
"""

from __future__ import annotations

import struct
from array import array
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import BinaryIO

_SUBFILE_TYPE, _REDUCED = 254, 1
_MOST_TAGS = 4096


@dataclass(frozen=True)
class Directories:
    """The pages of full size, thumbnails left out.

    Parameters
    ----------
    offsets : array of int
        Where in the file each page's directory lies.
    numbers : array of int
        Its place in the chain, thumbnails counted.
    broken : bool
        Whether the chain leads to where no directory can be.
    """

    offsets: array[int] = field(default_factory=lambda: array("Q"))
    numbers: array[int] = field(default_factory=lambda: array("Q"))
    broken: bool = False


@dataclass(frozen=True)
class _Form:
    """Widths of the fields, as `struct` names them."""

    order: str
    count: str
    entry: str
    offset: str

    def read(self, file: BinaryIO, kind: str) -> int:
        """One field, where the file stands."""
        form = self.order + kind
        return struct.unpack(form, file.read(struct.calcsize(form)))[0]


def directories(path: Path) -> Directories:
    """The directories of a file; none where it is no TIFF.

    Raises
    ------
    OSError
        If the file cannot be read.
    """
    state = path.stat()
    return _directories(path, state.st_size, state.st_mtime_ns)


@lru_cache(maxsize=2)  # a pair of stacks: every block of their frames asks again
def _directories(path: Path, size: int, _changed: int) -> Directories:
    with path.open("rb") as file:
        try:
            form, place = _start(file)
        except struct.error:
            return Directories()
        return _followed(file, form, place, size)


def _start(file: BinaryIO) -> tuple[_Form, int]:
    """The form of the fields, and where the first directory lies (0: no TIFF)."""
    kinds = {b"II*\0": "<", b"MM\0*": ">", b"II+\0": "<big", b"MM\0+": ">big"}
    kind = kinds.get(file.read(4), "")
    if not kind:
        return _Form("<", "H", "HHII", "I"), 0
    big = kind.endswith("big")
    form = _Form(kind[0], "Q", "HHQQ", "Q") if big else _Form(kind[0], "H", "HHII", "I")
    if big:
        file.seek(8)
    return form, form.read(file, form.offset)


def _followed(file: BinaryIO, form: _Form, place: int, size: int) -> Directories:
    offsets, numbers, seen, number = array("Q"), array("Q"), set[int](), 0
    while place:
        if place >= size or place in seen:
            return Directories(offsets, numbers, broken=True)
        seen.add(place)
        try:
            reduced, following = _directory(file, form, place)
        except struct.error:
            return Directories(offsets, numbers, broken=True)
        if not reduced:
            offsets.append(place)
            numbers.append(number)
        place, number = following, number + 1
    return Directories(offsets, numbers)


def _directory(file: BinaryIO, form: _Form, place: int) -> tuple[bool, int]:
    """Whether the page is a thumbnail, and where the next directory lies."""
    file.seek(place)
    count = form.read(file, form.count)
    if count > _MOST_TAGS:
        raise struct.error
    entry = struct.Struct(form.order + form.entry)
    tags = file.read(entry.size * count)
    reduced = False
    for tag, _, _, value in entry.iter_unpack(tags):
        if tag == _SUBFILE_TYPE:
            reduced = bool(value & _REDUCED)
    return reduced, form.read(file, form.offset)
