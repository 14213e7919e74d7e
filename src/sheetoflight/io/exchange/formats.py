"""The table of formats, and the two verbs: read what another tool wrote, write what it reads."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

from sheetoflight.errors import InputError
from sheetoflight.io.atomic import write_whole
from sheetoflight.io.documents import read_json
from sheetoflight.io.exchange import bouguet, halcon, kalibr, mat_reading, opencv, ros
from sheetoflight.io.exchange.exchanged import Exchanged, Source, with_lens_checked
from sheetoflight.io.exchange.foreign_xml import xml_document
from sheetoflight.io.exchange.foreign_yaml import yaml_document
from sheetoflight.io.exchange.halcon import PIXEL_UM
from sheetoflight.io.exchange.values import named
from sheetoflight.io.quoting import file_name, one_line, shown
from sheetoflight.io.reading import TEXT_LIMIT_BYTES, naming, read_bytes, read_text

_TEXT_LIMIT_BYTES = 1024 * 1024
"""A camera's parameters take some kilobytes; OpenCV's files may hold image points beside them."""

_OURS = "sheetoflight.calibration"
_OWN_FORMAT = re.compile(rb'"format"\s*:\s*"sheetoflight\.calibration"')

_Writer = Callable[[Source, str, float], tuple[str | bytes, tuple[str, ...]]]


@dataclass(frozen=True)
class _Format:
    endings: tuple[str, ...]
    expected: str
    write: _Writer


_FORMATS: dict[str, _Format] = {
    "opencv": _Format(
        opencv.ENDINGS,
        "camera_matrix of OpenCV",
        lambda source, ending, _: opencv.written(source, ending),
    ),
    "ros": _Format(
        ros.ENDINGS,
        "camera_matrix, distortion_model and projection_matrix of ROS",
        lambda source, *_: ros.written(source),
    ),
    "kalibr": _Format(
        kalibr.ENDINGS,
        "cam0 with camera_model of Kalibr",
        lambda source, *_: kalibr.written(source),
    ),
    "halcon": _Format(
        halcon.ENDINGS,
        "Focus, Sx, Sy … of HALCON",
        lambda source, _, pixel_um: halcon.written(source, pixel_um),
    ),
    "bouguet": _Format(
        bouguet.ENDINGS,
        "a MATLAB file with fc and cc of Bouguet's toolbox",
        lambda source, *_: bouguet.written(source),
    ),
}

_DOCUMENTS: tuple[ModuleType, ...] = (ros, kalibr, opencv)
"""Formats of documents, in the order in which they are asked; ROS has OpenCV's names and more."""

EXCHANGE_FORMATS = tuple(_FORMATS)
"""Names of the formats."""


def exchange_format(path: str | Path) -> str:
    """The format that a file's ending names.

    Raises
    ------
    InputError
        If the ending names none, or several.

    Examples
    --------
    >>> exchange_format("Calib_Results.mat")
    'bouguet'
    """
    ending = Path(path).suffix.lower()
    names = [name for name, one in _FORMATS.items() if ending in one.endings]
    if len(names) != 1 or ending == ".json":
        several = f"'{file_name(ending)}' is the ending of {', '.join(names)}"
        none = f"'{file_name(ending)}' is the ending of no format" if ending else "no ending"
        raise InputError(
            f"{file_name(path)}: {several if names else none}",
            f"say which is meant: {', '.join(EXCHANGE_FORMATS)}",
        )
    return names[0]


def read_exchange(
    path: str | Path,
    *,
    image_size: tuple[int, int] | None = None,
    camera: str | None = None,
    pose: str | Path | None = None,
) -> Exchanged:
    """The camera, and the light planes if there are any, that another tool wrote.

    The format is told by the content, whatever the file's name is.

    Parameters
    ----------
    path : str or Path
    image_size : (int, int), optional
        Width and height of the pictures in px, for files that do not say it.
    camera : str, optional
        Which is meant where the file holds several: ``cam1`` (Kalibr), ``2`` for M2, D2 (OpenCV).
    pose : str or Path, optional
        A HALCON pose file with the light plane, for a HALCON camera file.

    Raises
    ------
    FileError
        If a file cannot be read, is damaged, or larger than cameras' files are.
    InputError
        If no format is recognised, a value is missing or wrong, or the lens model is another;
        file and key are named.
    """
    data = read_bytes(path, mat_reading.LIMIT_BYTES)
    if pose is not None and (data.startswith(mat_reading.MAGIC) or not _is_halcon(path, data)):
        raise InputError(
            f"{file_name(path)} is no HALCON file, and a pose file was given", "leave it out"
        )
    if data.startswith(mat_reading.MAGIC):
        _refuse_choice(path, camera)
        with named(path):
            return with_lens_checked(bouguet.read(data, image_size))
    text = read_text(path, _TEXT_LIMIT_BYTES)
    if halcon.recognises(text):
        _refuse_choice(path, camera)
        with named(path):
            return halcon.read(text, image_size, pose)
    with named(path):
        document = _document(path, text)
        return with_lens_checked(_recognised(document).read(document, image_size, camera))


def write_exchange(
    path: str | Path, source: Source, to: str, *, pixel_um: float = PIXEL_UM
) -> tuple[str, ...]:
    """Write camera and light planes for another tool, whole or not at all.

    Parameters
    ----------
    path : str or Path
        For ``opencv`` the ending chooses YAML (.yml, .yaml), XML or JSON.
    source : Calibration or Exchanged
    to : str
        One of `EXCHANGE_FORMATS`.
    pixel_um : float
        Width of a pixel in µm, for ``halcon``, whose files state it.

    Returns
    -------
    notes : tuple of str
        What has no place in the file, what was assumed, and how far a fitted lens model is off.

    Raises
    ------
    InputError
        If the format is another, or cannot hold the camera.
    FileError
        If the file cannot be written.
    """
    if to not in _FORMATS:
        raise InputError(f"there is no format {shown(to)}", f"choose {', '.join(EXCHANGE_FORMATS)}")
    with naming(path):
        content, notes = _FORMATS[to].write(source, Path(path).suffix.lower(), pixel_um)
    write_whole(path, content)
    return notes


def is_calibration(path: str | Path) -> bool:
    """Whether a file is a ``calibration.json`` of this package.

    Raises
    ------
    FileError
        If it cannot be read.
    """
    return bool(_OWN_FORMAT.search(read_bytes(path, TEXT_LIMIT_BYTES)))


def _is_halcon(path: str | Path, data: bytes) -> bool:
    return len(data) <= _TEXT_LIMIT_BYTES and halcon.recognises(read_text(path, _TEXT_LIMIT_BYTES))


def _document(path: str | Path, text: str) -> Mapping[str, Any]:
    """The document of a text; XML, JSON or YAML by its first character."""
    begin = text.lstrip()[:1]
    if begin == "<":
        return xml_document(text)
    document = read_json(path) if begin == "{" and _is_json(text) else yaml_document(text)
    if not isinstance(document, Mapping):
        raise InputError(f"it holds {shown(document)}, and no camera", _expected())
    return document


def _is_json(text: str) -> bool:
    """Whether a text in braces goes on as JSON must: YAML has braces too."""
    return text.lstrip()[1:].lstrip()[:1] in ('"', "}", "")


def _recognised(document: Mapping[str, Any]) -> ModuleType:
    if document.get("format") == _OURS:
        raise InputError(
            "this is a calibration of this package, not another tool's", "load it as it is"
        )
    for module in _DOCUMENTS:
        if module.recognises(document):
            return module
    keys = one_line(", ".join(document))
    raise InputError(f"no camera is recognised in it (keys: {keys})", _expected())


def _expected() -> str:
    return f"expected {'; or '.join(one.expected for one in _FORMATS.values())}"


def _refuse_choice(path: str | Path, camera: str | None) -> None:
    if camera is not None:
        raise InputError(
            f"{file_name(path)} holds one camera, and camera {shown(camera)} was asked for",
            "leave the choice out",
        )
