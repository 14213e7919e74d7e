"""HALCON's interior camera parameters, as ``write_cam_par`` keeps them, and light planes.

Read are the file of the operators ``write_cam_par`` and ``read_cam_par``, lines of
``Name value``, and the tuple as HDevelop shows it. Light planes stand in comments, which
``read_cam_par`` skips, as poses to be pasted into a program.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from pathlib import Path

from sheetoflight.errors import InputError
from sheetoflight.io.exchange.exchanged import (
    Exchanged,
    Source,
    lost_curvature,
    lost_uncertainty,
    skew_lost_px,
)
from sheetoflight.io.exchange.halcon_lens import (
    HalconCamera,
    camera_from_halcon,
    halcon_from_camera,
)
from sheetoflight.io.exchange.halcon_pose import light_plane_of, pose_numbers, pose_of, read_pose
from sheetoflight.io.exchange.values import image_size, number
from sheetoflight.io.quoting import one_line, shown
from sheetoflight.model.light_plane import LightPlane

ENDINGS = (".dat",)

PIXEL_UM = 5.0
"""Width of a pixel where nobody says another: that of many industrial sensors."""

_DIVISION = ("Focus", "Kappa", "Sx", "Sy", "Cx", "Cy", "ImageWidth", "ImageHeight")
_POLYNOMIAL = ("Focus", "K1", "K2", "K3", "P1", "P2", *_DIVISION[2:])
_ORDERS = {"area_scan_division": _DIVISION, "area_scan_polynomial": _POLYNOMIAL}
_TYPE = "CameraType"

_OTHER_NAMES = {
    **{f"poly{i + 1}": name for i, name in enumerate(_POLYNOMIAL[1:6])},
    **{name.lower(): name for name in (*_DIVISION, *_POLYNOMIAL, _TYPE)},
    "camtype": _TYPE,
}
"""Each parameter by its name in small letters; the file calls K1 to P2 Poly1 to Poly5."""

_ENTRY = re.compile(r"([A-Za-z]\w*)\s*(?::\s*\w+\s*)?[:=\s]\s*(['\"]?)([-+.\w]+)\2\s*;?\s*\Z")
_KINDS = {"BOOL", "XBOOL", "INT", "FLOAT", "DOUBLE", "STRING", "FILE_SELECTOR", "ParGroup"}
_PLANE = re.compile(r'#\s*LightPlanePose\s+("(?:[^"\\]|\\.)*")\s*:=\s*(\[.*\])\s*\Z')

_ABOUT = {
    "Focus": ("foc", "DOUBLE:0.0:", "Focal length of the lens [meter]"),
    "Kappa": ("kappa", "DOUBLE::", "Radial distortion coefficient [1/(meter*meter)]"),
    "Sx": ("sx", "DOUBLE:0.0:", "Width of a cell on the sensor [meter]"),
    "Sy": ("sy", "DOUBLE:0.0:", "Height of a cell on the sensor [meter]"),
    "Cx": ("cx", "DOUBLE::", "X-coordinate of the image center [pixel]"),
    "Cy": ("cy", "DOUBLE::", "Y-coordinate of the image center [pixel]"),
    "ImageWidth": ("imgw", "INT:1:32767", "Width of the images [pixel]"),
    "ImageHeight": ("imgh", "INT:1:32767", "Height of the images [pixel]"),
}


def recognises(text: str) -> bool:
    """Whether the text is a tuple of a known camera type, or has an entry Focus."""
    if text.lstrip().startswith("["):
        return True
    return bool(re.search(r"(?m)^\s*Focus\b", text, re.IGNORECASE))


def read(text: str, size: tuple[int, int] | None, pose: str | Path | None) -> Exchanged:
    """The camera, and the light planes of the comments or of a pose file.

    Parameters
    ----------
    text : str
    size : (int, int), optional
        Refused where it is not the one in the file.
    pose : str or Path, optional
        A file with the light plane's pose in the camera frame.

    Raises
    ------
    InputError
        If a parameter is missing, wrong or of another camera type, or Brown's model does not
        come within 0.5 px of the camera.
    FileError
        If the pose file cannot be read.
    """
    found = _tuple(text) if text.lstrip().startswith("[") else _entries(text)
    halcon = _camera(found)
    if size not in (None, halcon.image_size):
        raise InputError(
            f"the pictures are {halcon.image_size} px by the file, {size} were given", "check it"
        )
    camera, misfit = camera_from_halcon(halcon)
    notes = (
        f"Sx is {1e6 * halcon.sx:.9g} µm: only Focus/Sx is held, give pixel_um to write it again",
    )
    if any(halcon.coefficients):
        notes += (
            f"distortion fitted over the picture: largest difference from HALCON's {misfit:.2g} px",
        )
    planes = (read_pose(pose),) if pose is not None else _light_planes(text)
    return Exchanged(camera=camera, light_planes=planes, format="halcon", notes=notes)


def written(source: Source, pixel_um: float = PIXEL_UM) -> tuple[str, tuple[str, ...]]:
    """A calibration as ``write_cam_par`` would write it, and what is lost or assumed.

    Raises
    ------
    InputError
        If neither of HALCON's lens models comes within 0.5 px of the camera.
    """
    halcon, misfit = halcon_from_camera(source.camera, pixel_um)
    notes = (f"Sx was taken as {pixel_um:g} µm: only Focus/Sx is known",)
    if any(halcon.coefficients):
        model = "division" if len(halcon.coefficients) == 1 else "polynomial"
        notes += (f"distortion by HALCON's {model} model: largest difference {misfit:.2g} px",)
    if source.light_planes:
        notes += ("the light planes stand in comments, as poses",)
    if source.camera.gamma:
        skew = skew_lost_px(source.camera)
        notes += (f"the skew, up to {skew:.3g} px, has no place in it",)
    planes = [_plane_line(plane) for plane in source.light_planes]
    body = ["# INTERNAL CAMERA PARAMETERS", *planes, "", "ParGroup: Camera: Parameter;"]
    body += ['  "Internal camera parameters";', "", *_parameter_lines(halcon)]
    return "\n".join(body) + "\n", notes + lost_curvature(source) + lost_uncertainty(source)


def _parameter_lines(halcon: HalconCamera) -> list[str]:
    order = _DIVISION if len(halcon.coefficients) == 1 else _POLYNOMIAL
    values = (halcon.focus, *halcon.coefficients, halcon.sx, halcon.sy, halcon.cx, halcon.cy)
    lines = []
    for place, (name, value) in enumerate(zip(order, (*values, *halcon.image_size), strict=True)):
        called = name if name in _ABOUT else f"Poly{place}"
        short, kind, about = _ABOUT.get(
            name, (f"poly{place}", "DOUBLE::", f"Polynomial distortion coefficient {name}")
        )
        lines += [f"{called}:{short}: {value!r};", f"  {kind};", f'  "{about}";', ""]
    return lines


def _plane_line(plane: LightPlane) -> str:
    pose = pose_of(plane).tolist()
    numbers = ", ".join(repr(value) for value in pose[:6])
    return f"# LightPlanePose {json.dumps(plane.name)} := [{numbers}, 0]"


def _light_planes(text: str) -> tuple[LightPlane, ...]:
    planes = []
    for line in text.splitlines():
        found = _PLANE.match(line.strip())
        if found:
            planes.append(light_plane_of(pose_numbers(found[2]), _name(found[1])))
    if len({plane.name for plane in planes}) < len(planes):
        raise InputError("two light planes share a name", "give each a name of its own")
    return tuple(planes)


def _name(quoted: str) -> str:
    try:
        return str(json.loads(quoted))
    except ValueError as error:
        raise InputError(
            f"a light plane has the name {one_line(quoted)}", "write it again"
        ) from error


def _entries(text: str) -> dict[str, object]:
    """Values by name, of a parameter file or of lines ``Name value``."""
    found: dict[str, object] = {}
    for count, line in enumerate(text.splitlines(), 1):
        entry = _ENTRY.match(line.strip())
        if not entry or entry[1] in _KINDS:
            continue
        name = _OTHER_NAMES.get(entry[1].lower())
        if name is None:
            raise InputError(
                f"line {count}: {shown(entry[1])} is a parameter of another kind of camera",
                f"give one of {' or '.join(_ORDERS)}",
            )
        if name in found:
            raise InputError(f"line {count}: {name} is given twice", "keep one of the two")
        found[name] = entry[3] if name == _TYPE else _number(entry[3], f"line {count}: {name}")
    return found


def _tuple(text: str) -> dict[str, object]:
    """Values by name, of a tuple; the type may be left out as before HALCON 13."""
    words = [word.strip() for word in text.strip().strip("[]").split(",")]
    kind = words.pop(0).strip("'\"") if words[0][:1] in ("'", '"') else None
    if kind is None:
        kind = next((name for name, order in _ORDERS.items() if len(order) == len(words)), "")
    order = _ORDERS.get(kind)
    if order is None or len(order) != len(words):
        raise InputError(
            f"a tuple of {len(words)} numbers and of type {shown(kind)} is no area scan camera",
            "expected 8 numbers for the division model, 12 for the polynomial",
        )
    values = [_number(word, name) for name, word in zip(order, words, strict=True)]
    return dict(zip(order, values, strict=True))


def _number(word: str, key: str) -> float:
    try:
        return number(float(word), key)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{key} is {shown(word)}, expected a number", "correct it") from error


def _camera(found: Mapping[str, object]) -> HalconCamera:
    kind = found.get(_TYPE)
    if kind is not None and kind not in _ORDERS:
        raise InputError(
            f"{_TYPE} is {shown(kind)}, which has no place here", f"give {' or '.join(_ORDERS)}"
        )
    order = _DIVISION if "Kappa" in found else _POLYNOMIAL
    for name in order:
        if name not in found:
            raise InputError(f"'{name}' is missing", "add it")
    foreign = sorted(set(found) - {*order, _TYPE})
    if foreign:
        raise InputError(f"Kappa and {foreign[0]} are of two lens models", "keep one model")
    focus, *coefficients, sx, sy, cx, cy = (number(found[name], name) for name in order[:-2])
    size = image_size([found[name] for name in order[-2:]], "ImageWidth, ImageHeight")
    return HalconCamera(focus, tuple(coefficients), sx, sy, cx, cy, size)
