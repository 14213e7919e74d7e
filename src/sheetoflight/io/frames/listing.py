"""The frames that paths name, in order."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from pathlib import Path
from typing import overload

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.frames import hdf5_stack, tiff_stack
from sheetoflight.io.frames.frame import Frame
from sheetoflight.io.frames.kinds import STACK_ENDINGS, opened
from sheetoflight.io.frames.opened import refuse_no_file, refusing
from sheetoflight.io.pictures import (
    ENDINGS,
    MAX_PIXELS,
    PictureFile,
    in_order_of_names,
    picture_files,
)
from sheetoflight.io.quoting import file_name


@dataclass(frozen=True, slots=True)
class _Source:
    """A file of frames, or a single picture (`frames` None); pairs as in `Frame`."""

    name: str
    path: Path
    laser_off: Path | None = None
    inside: str = ""
    frames: int | None = None

    def frame(self, index: int) -> Frame:
        if self.frames is None:
            return Frame(self.name, self.path, None, self.laser_off, self.inside)
        return Frame(f"{self.name}[{index}]", self.path, index, self.laser_off, self.inside)


class FrameList(Sequence[Frame]):
    """Frames made when they are asked for: a million of them take no room.

    Parameters
    ----------
    sources : sequence
        Files of frames, in order.
    ends : array of int
        How many frames there are up to the end of each.
    which : range
        Which of all their frames.
    """

    def __init__(self, sources: Sequence[_Source], ends: array[int], which: range) -> None:
        self._sources, self._ends, self._which = sources, ends, which

    def __len__(self) -> int:
        return len(self._which)

    @property
    def files(self) -> list[Path]:
        """The files that are read, of a pair the one with the laser on first; those too from
        which a part of the list takes no frame."""
        pairs = ((source.path, source.laser_off) for source in self._sources)
        return [path for pair in pairs for path in pair if path]

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> FrameList: ...

    def __getitem__(self, index: int | slice) -> Frame | FrameList:
        if isinstance(index, slice):
            return FrameList(self._sources, self._ends, self._which[index])
        number = self._which[index]
        place = bisect_right(self._ends, number)
        return self._sources[place].frame(number - (self._ends[place - 1] if place else 0))


def list_frames(paths: Sequence[str | Path], max_pixels: int = MAX_PIXELS) -> FrameList:
    """The frames of pictures, folders, stacks and videos, in the order of the paths.

    ``NAME_off.*`` and ``NAME_on.*`` of one folder and kind are a pair, be they pictures or
    stacks. A folder's files come by name, numbers in names by their value: frame_2 before frame_10.
    Names that would not be unique get the path before them.

    Parameters
    ----------
    paths : sequence of path
        A picture, a folder of pictures and stacks, a TIFF of several pages, a ``.npy`` of shape
        (frames, height, width) or (frames, height, width, 3), an HDF5 file with one such data
        set or ``file.h5:/path/in/file``, a video.
    max_pixels : int
        Refuse stacks whose frames have more pixels than this.

    Raises
    ------
    FileError, InputError
        If a path is missing, a folder holds nothing to read, a stack cannot be opened, two files
        have the same name, or a pair of stacks has unequal lengths.
    """
    named = list(dict.fromkeys(Path(path) for path in paths))
    folders = {path for path in named if _is_folder(path)}
    single = _joined(path for path in named if path not in folders)
    sources: dict[_Source, None] = {}
    for path in named:
        found = _in_folder(path) if path in folders else [single[path]]
        sources |= dict.fromkeys(found)
    counted = [_counted(source, max_pixels) for source in _uniquely_named(sources)]
    counts = (1 if source.frames is None else source.frames for source in counted)
    ends = array("q", accumulate(counts))
    return FrameList(counted, ends, range(ends[-1] if ends else 0))


def _is_folder(path: Path) -> bool:
    with refusing(path):  # a folder above it that may not be entered, a name that is too long
        return path.is_dir()


def _in_folder(folder: Path) -> list[_Source]:
    with refusing(folder):
        paths = [
            path
            for path in sorted(folder.iterdir())
            if path.suffix.lower() in ENDINGS | STACK_ENDINGS
            and not path.name.startswith(".")
            and path.is_file()
        ]
    if not paths:
        raise InputError(
            f"{file_name(folder)} holds no picture, stack or video",
            f"put some there ({' '.join(sorted(ENDINGS | STACK_ENDINGS))})",
        )
    return sorted(set(_joined(paths).values()), key=lambda source: in_order_of_names(source.name))


def _joined(paths: Iterable[Path]) -> dict[Path, _Source]:
    """What each path belongs to: pairs joined within one folder and kind of file."""
    groups: dict[tuple[Path, str], list[Path]] = {}
    found: dict[Path, _Source] = {}
    for path in paths:
        file, inside = hdf5_stack.split_name(path)
        if inside:
            found[path] = _Source(f"{file.name}:{inside}", file, None, inside)
            continue
        ending = path.suffix.lower()
        kind = ending if ending in STACK_ENDINGS else ""
        groups.setdefault((path.parent, kind), []).append(path)
    for (_, kind), group in groups.items():
        for file in picture_files(group):
            source = _source(file, kind)
            found |= dict.fromkeys(filter(None, (file.path, file.laser_on)), source)
    return found


def _source(file: PictureFile, kind: str) -> _Source:
    if file.laser_on:
        return _Source(file.name + kind, file.laser_on, file.path)
    return _Source(file.path.name if kind else file.name, file.path)


def _uniquely_named(sources: Iterable[_Source]) -> Iterator[_Source]:
    sources = list(sources)
    met = Counter(source.name for source in sources)
    again: set[str] = set()
    for source in sources:
        name = source.name
        if met[name] > 1:
            name = str(source.path.parent / name)
        if name in again:
            raise InputError(
                f"{file_name(source.path)} is named twice, once with a partner and once without",
                "name it once",
            )
        again.add(name)
        yield replace(source, name=name)


def _counted(source: _Source, max_pixels: int) -> _Source:
    """With the number of its frames; what cannot be told from a picture is one."""
    refuse_no_file(source.path)
    ending = source.path.suffix.lower()
    if ending in tiff_stack.ENDINGS:
        if not tiff_stack.holds_stack(source.path):
            return source
        source = replace(source, name=_with_ending(source.name, source.path))
    elif ending not in STACK_ENDINGS:
        return source
    counts = [
        _count(path, source.inside, max_pixels) for path in (source.path, source.laser_off) if path
    ]
    if len(set(counts)) > 1:
        raise InputError(
            f"{file_name(source.path)} holds {counts[0] or 1} frames, its partner "
            f"{file_name(source.laser_off or '')} {counts[1] or 1}",
            "record both again, or give only whole pairs",
        )
    return replace(source, frames=counts[0])


def _with_ending(name: str, path: Path) -> str:
    return name if name.endswith(path.suffix) else name + path.suffix


def _count(path: Path, inside: str, max_pixels: int) -> int | None:
    with opened(path, inside, max_pixels) as stack:
        if stack.frames == 0:
            raise FileError(f"{file_name(path)} holds no whole frame", "record it again")
        return stack.frames
