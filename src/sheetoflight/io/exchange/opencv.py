"""OpenCV's FileStorage in YAML, XML and JSON, and the spellings seen in the wild.

As ``samples/cpp/source.cpp`` of OpenCV writes it: ``image_width``, ``image_height``,
``camera_matrix``, ``distortion_coefficients``. Light planes are an entry of our own.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

import numpy as np

from sheetoflight.errors import FileError, InputError
from sheetoflight.io.exchange.exchanged import Exchanged, Source, lost_curvature, lost_uncertainty
from sheetoflight.io.exchange.foreign_xml import xml_document
from sheetoflight.io.exchange.foreign_yaml import yaml_document
from sheetoflight.io.exchange.values import (
    Document,
    brown,
    camera_of,
    counted_numbers,
    image_size,
    number,
)
from sheetoflight.io.quoting import one_line, shown
from sheetoflight.io.reading import naming
from sheetoflight.model.light_plane import LightPlane

ENDINGS = (".yml", ".yaml", ".xml", ".json")

_MATRIX = {"cameramatrix", "intrinsicmatrix", "k", "m", "mtx", "mat"}
_DISTORTION = {
    *("distortioncoefficients", "distortioncoeffs", "distcoeffs", "distcoeff"),
    *("distortion", "dist", "d", "coef"),
}
_SIZE = {"imagesize", "imagesizepx", "resolution", "size", "framesize"}
_WIDTH, _HEIGHT = {"imagewidth", "width"}, {"imageheight", "height"}
_FISHEYE = {"fisheyemodel", "fisheye"}
_MODEL = {"distortionmodel", "cameramodel", "model", "lensmodel"}
_PINHOLE = {"", "pinhole", "plumbbob", "radtan", "brown", "brownconrady", "opencv", "standard"}
_PLANES = "light_planes"
_LONGEST_NAME = 200


def recognises(document: Document) -> bool:
    """Whether the document has a camera matrix by one of OpenCV's names."""
    return any(_stem(key) in _MATRIX for key in document)


def read(document: Document, size: tuple[int, int] | None, chosen: str | None) -> Exchanged:
    """The camera of an OpenCV document.

    Parameters
    ----------
    document : mapping
    size : (int, int), optional
        Width and height of the pictures in px, where the document may not say it.
    chosen : str, optional
        Of several cameras the number: ``1`` for M1 and D1.

    Raises
    ------
    InputError
        If something is missing, wrong, or another lens model's.
    """
    _refuse_other_models(document)
    number_ = _camera_number(document, chosen)
    matrix_key = _only(document, _MATRIX, number_)
    assert matrix_key is not None  # its number was taken from the keys
    distortion_key = _only(document, _DISTORTION, number_)
    notes = [f"further entries are not held: {others}"] if (others := _others(document)) else []
    distortion: tuple[float, ...] = (0.0,) * 5
    if distortion_key is None:
        notes.append("no distortion coefficients in it: taken as zero")
    else:
        distortion = brown(document[distortion_key], distortion_key)
        if _plain(distortion_key) != "distortioncoefficients":
            notes.append(f"'{distortion_key}' taken in OpenCV's order k1, k2, p1, p2, k3")
    matrix = counted_numbers(document[matrix_key], matrix_key, 9)
    return Exchanged(
        camera=camera_of(_size(document, size), matrix, distortion, matrix_key),
        light_planes=_light_planes(document.get(_PLANES, [])),
        format="opencv",
        notes=tuple(notes),
    )


def written(source: Source, ending: str) -> tuple[str, tuple[str, ...]]:
    """The text that OpenCV's own FileStorage makes of a calibration, and what is lost.

    Raises
    ------
    InputError
        If a light plane's name cannot be said in such a file, or the ending names no form of it.
    """
    if ending not in ENDINGS:
        raise InputError(
            f"OpenCV writes no '{one_line(ending)}'", f"end the name in {', '.join(ENDINGS)}"
        )
    _refuse_unsayable(source)
    text = _stored(source, ending)
    _check_names(source, text, ending)
    notes = lost_curvature(source) + lost_uncertainty(source)
    if source.camera.gamma:
        notes += ("camera_matrix holds the skew, which OpenCV's own functions ignore",)
    return text, notes


def _stored(source: Source, ending: str) -> str:
    import cv2

    camera = source.camera
    storage = cv2.FileStorage(ending, cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for key, value in zip(("image_width", "image_height"), camera.image_size, strict=True):
        storage.write(key, value)
    storage.write("camera_matrix", camera.matrix)
    storage.write("distortion_coefficients", np.array(camera.distortion).reshape(5, 1))
    if source.light_planes:
        storage.startWriteStruct(_PLANES, cv2.FileNode_SEQ)
    for plane in source.light_planes:
        storage.startWriteStruct("", cv2.FileNode_MAP)
        storage.write("name", plane.name)
        storage.write("normal", plane.normal.reshape(3, 1))
        storage.write("distance_mm", plane.distance_mm)
        storage.endWriteStruct()
    if source.light_planes:
        storage.endWriteStruct()
    return storage.releaseAndGetString()


def _refuse_unsayable(source: Source) -> None:
    """Names at which OpenCV's writer fails."""
    for plane in source.light_planes:
        if not plane.name.isprintable() or len(plane.name) > _LONGEST_NAME:
            _refuse_name(plane)


def _check_names(source: Source, text: str, ending: str) -> None:
    """OpenCV does not quote all that YAML reads in another way; such a name would be lost."""
    try:
        document = xml_document(text) if ending == ".xml" else yaml_document(text)
        found = [part["name"] for part in document.get(_PLANES, [])]
    except FileError:
        found = [None] * len(source.light_planes)
    for plane, name in zip(source.light_planes, found, strict=True):
        if plane.name != name:
            _refuse_name(plane)


def _refuse_name(plane: LightPlane) -> None:
    raise InputError(
        f"the light plane's name {shown(plane.name)} cannot be said in an OpenCV file",
        "name the laser with plain letters and digits",
    )


def _plain(key: str) -> str:
    return re.sub(r"[^a-z0-9]", "", key.lower())


def _stem(key: str) -> str:
    """A key without case, separators, and the camera's number at its end."""
    return re.sub(r"[0-9]\Z", "", _plain(key))


def _number_of(key: str) -> str:
    found = re.search(r"[0-9]\Z", _plain(key))
    return found.group() if found else ""


def _camera_number(document: Document, chosen: str | None) -> str:
    """The number at the end of the chosen camera's keys; empty where they have none."""
    there = [_number_of(key) for key in document if _stem(key) in _MATRIX]
    wanted = chosen if chosen is None else _number_of(chosen)
    if wanted is not None and wanted not in there:
        raise InputError(
            f"there is no camera {shown(chosen)}", f"choose {' or '.join(sorted(set(there)))}"
        )
    if wanted is None and len(set(there)) > 1:
        raise InputError(
            f"the file holds {len(there)} cameras",
            f"say which is meant: {' or '.join(sorted(set(there)))}",
        )
    return there[0] if wanted is None else wanted


def _only(document: Document, names: set[str], number_: str) -> str | None:
    """The one key of these names and of the camera's number; None if there is none."""
    keys = [key for key in document if _stem(key) in names and _number_of(key) == number_]
    if len(keys) > 1:
        raise InputError(
            f"{one_line(' and '.join(keys))} say the same thing", "keep the one that is right"
        )
    return keys[0] if keys else None


def _others(document: Document) -> str:
    known = _MATRIX | _DISTORTION | _SIZE | _WIDTH | _HEIGHT | _FISHEYE | _MODEL
    return one_line(", ".join(k for k in document if _stem(k) not in known and k != _PLANES))


def _size(document: Document, given: tuple[int, int] | None) -> tuple[int, int]:
    both, width, height = (_only(document, names, "") for names in (_SIZE, _WIDTH, _HEIGHT))
    if both:
        found = image_size(document[both], both)
    elif width and height:
        found = image_size([document[width], document[height]], f"{width}, {height}")
    elif given is None:
        raise InputError("the size of the pictures is not in it", "give image_size, in px")
    else:
        return given
    if given not in (None, found):
        raise InputError(
            f"the pictures are {found[0]} x {found[1]} px by the file, {given} were given",
            "give image_size only where the file does not say it",
        )
    return found


def _refuse_other_models(document: Document) -> None:
    for key in document:
        value = document[key]
        if _plain(key) in _FISHEYE and value not in (0, "0", False, None):
            _refuse_model(key, "a fisheye lens")
        if _plain(key) in _MODEL and not (isinstance(value, str) and _plain(value) in _PINHOLE):
            _refuse_model(key, shown(value))


def _refuse_model(key: str, model: str) -> None:
    raise InputError(
        f"{one_line(key)} says {model}, a lens model that has no place here",
        "calibrate again with OpenCV's standard model k1, k2, p1, p2, k3",
    )


def _light_planes(entries: object) -> tuple[LightPlane, ...]:
    if not isinstance(entries, Iterable) or isinstance(entries, str | Mapping):
        raise InputError(f"{_PLANES} is {shown(entries)}, expected a list", "correct it")
    planes = tuple(_light_plane(entry, f"{_PLANES}[{i}]") for i, entry in enumerate(entries))
    if len({plane.name for plane in planes}) < len(planes):
        raise InputError(f"{_PLANES}: two planes share a name", "give each a name of its own")
    return planes


def _light_plane(entry: object, key: str) -> LightPlane:
    if not isinstance(entry, Mapping) or not {"name", "normal", "distance_mm"} <= set(entry):
        raise InputError(
            f"{key} is {shown(entry)}", "give a table with name, normal and distance_mm"
        )
    normal = counted_numbers(entry["normal"], f"{key}.normal", 3)
    distance = number(entry["distance_mm"], f"{key}.distance_mm")
    with naming(key):
        return LightPlane(normal, distance, str(entry["name"]))
