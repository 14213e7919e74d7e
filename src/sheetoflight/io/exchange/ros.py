"""ROS: ``sensor_msgs/CameraInfo`` as ``camera_calibration_parsers`` keeps it in YAML, and as a
message printed by ``rostopic echo`` or ``ros2 topic echo``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import yaml

from sheetoflight.errors import InputError
from sheetoflight.io.exchange.exchanged import Exchanged, Source, lost_planes, lost_uncertainty
from sheetoflight.io.exchange.values import (
    Document,
    brown,
    camera_of,
    counted_numbers,
    image_size,
    number,
    numbers,
)
from sheetoflight.io.quoting import shown
from sheetoflight.model.camera import Camera

ENDINGS = (".yaml", ".yml")

_LONG = {
    "width": "image_width",
    "height": "image_height",
    "K": "camera_matrix",
    "D": "distortion_coefficients",
    "R": "rectification_matrix",
    "P": "projection_matrix",
}
"""The parsers' names of what the message calls ``width``, ``K`` … (ROS 1) or ``k`` … (ROS 2)."""

_BROWN_MODELS = ("plumb_bob", "rational_polynomial")
_CAMERA_KEYS = ("image_width", "image_height", "camera_matrix", "distortion_coefficients")


def recognises(document: Document) -> bool:
    """Whether it is a camera and names its distortion model as CameraInfo does."""
    keys = _with_long_names(document)
    beside = {"rectification_matrix", "projection_matrix"}
    return "camera_matrix" in keys and "distortion_model" in keys and bool(beside & set(keys))


def read(document: Document, size: tuple[int, int] | None, chosen: str | None) -> Exchanged:
    """The camera of a CameraInfo.

    Parameters
    ----------
    document : mapping
    size, chosen
        The file says its size and holds one camera: both are refused where they disagree.

    Raises
    ------
    InputError
        If something is missing or wrong, the lens model is another, or the picture is binned
        or cut out.
    """
    info = _with_long_names(document)
    for key in _CAMERA_KEYS:
        if key not in info:
            raise InputError(f"'{key}' is missing", "add it")
    _refuse_other(info, chosen)
    found = image_size([info["image_width"], info["image_height"]], "image_width, image_height")
    if size not in (None, found):
        raise InputError(f"the pictures are {found} px by the file, {size} were given", "check it")
    matrix = counted_numbers(info["camera_matrix"], "camera_matrix", 9)
    distortion = brown(info["distortion_coefficients"], "distortion_coefficients")
    return Exchanged(
        camera=camera_of(found, matrix, distortion, "camera_matrix"),
        format="ros",
        notes=(
            "rectification and projection matrix are not held: they are those of rectified "
            "pictures, and the camera's own pictures are measured in here",
        ),
    )


def written(source: Source) -> tuple[str, tuple[str, ...]]:
    """A calibration's camera as CameraInfo YAML, and what is lost."""
    camera = source.camera
    width, height = camera.image_size
    document = {
        "image_width": width,
        "image_height": height,
        "camera_name": "camera",
        "camera_matrix": _matrix(camera.matrix.ravel().tolist(), 3),
        "distortion_model": "plumb_bob",
        "distortion_coefficients": _matrix(list(camera.distortion), 5),
        "rectification_matrix": _matrix([1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0], 3),
        "projection_matrix": _matrix(_projection(camera), 4),
    }
    notes = lost_planes(source) + lost_uncertainty(source)
    if camera.gamma:
        notes += ("camera_matrix holds the skew, which most of ROS ignores",)
    return yaml_text(document), notes


def yaml_text(document: Mapping[str, Any]) -> str:
    """A document as YAML: lists on one line, every number in full precision."""
    return yaml.safe_dump(dict(document), sort_keys=False, default_flow_style=None, width=100)


def _projection(camera: Camera) -> list[float]:
    return [value for row in camera.matrix.tolist() for value in (*row, 0.0)]


def _matrix(data: list[float], columns: int) -> dict[str, Any]:
    return {"rows": len(data) // columns, "cols": columns, "data": data}


def _with_long_names(document: Document) -> dict[str, Any]:
    short = {**_LONG, **{key.lower(): name for key, name in _LONG.items()}}
    return {short.get(key, key): value for key, value in document.items()}


def _refuse_other(info: Document, chosen: str | None) -> None:
    if chosen is not None:
        raise InputError(f"camera {shown(chosen)} was asked for", "the file holds one camera")
    model = info["distortion_model"]
    without = (
        model in ("", "none")
        and not numbers(info["distortion_coefficients"], "distortion_coefficients").any()
    )
    if model not in _BROWN_MODELS and not without:
        raise InputError(
            f"distortion_model is {shown(model)}, which has no place here",
            "calibrate again with plumb_bob",
        )
    for key in ("binning_x", "binning_y"):
        if number(info.get(key, 0), key) > 1:
            raise InputError(f"{key} is {shown(info[key])}", "give the unbinned camera")
    region = info.get("roi")
    for key, value in region.items() if isinstance(region, Mapping) else ():
        if key in ("x_offset", "y_offset", "width", "height") and number(value, f"roi.{key}"):
            raise InputError(f"roi.{key} is not 0", "give the camera of the whole picture")
