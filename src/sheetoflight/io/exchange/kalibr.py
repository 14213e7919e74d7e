"""Kalibr's ``camchain.yaml``: pinhole cameras with radial-tangential distortion."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.io.exchange.exchanged import (
    Exchanged,
    Source,
    lost_planes,
    lost_uncertainty,
    skew_lost_px,
)
from sheetoflight.io.exchange.lens_fit import fitted_brown, rays_over_picture
from sheetoflight.io.exchange.ros import yaml_text
from sheetoflight.io.exchange.values import (
    Document,
    camera_of,
    counted_numbers,
    image_size,
    numbers,
)
from sheetoflight.io.quoting import one_line, shown
from sheetoflight.model.camera import Camera

ENDINGS = (".yaml", ".yml")

_HELD = {"camera_model", "intrinsics", "distortion_model", "distortion_coeffs", "resolution"}
_FOUR = (0, 1, 2, 3)
"""Places of k1, k2, p1, p2, all that ``radtan`` has."""


def recognises(document: Document) -> bool:
    """Whether it has tables that name a ``camera_model``."""
    return bool(_cameras(document))


def read(document: Document, size: tuple[int, int] | None, chosen: str | None) -> Exchanged:
    """One camera of a chain.

    Parameters
    ----------
    document : mapping
    size : (int, int), optional
        Refused where it is not the one in the file.
    chosen : str, optional
        ``cam0`` …; may be left out where there is one.

    Raises
    ------
    InputError
        If something is missing or wrong, the lens model is another, or several cameras are there
        and none is chosen.
    """
    name = _chosen(list(_cameras(document)), chosen)
    part = _cameras(document)[name]
    for key in sorted(_HELD - {"distortion_coeffs"}):
        if key not in part:
            raise InputError(f"{name}: '{key}' is missing", "add it")
    found = image_size(part["resolution"], f"{name}.resolution")
    if size not in (None, found):
        raise InputError(f"the pictures are {found} px by the file, {size} were given", "check it")
    if part["camera_model"] != "pinhole":
        _refuse_model(f"{name}.camera_model", part["camera_model"], "pinhole")
    fu, fv, pu, pv = counted_numbers(part["intrinsics"], f"{name}.intrinsics", 4).tolist()
    matrix = np.array([fu, 0, pu, 0, fv, pv, 0, 0, 1.0])
    others = one_line(", ".join(key for key in part if key not in _HELD))
    return Exchanged(
        camera=camera_of(found, matrix, _distortion(name, part), f"{name}.intrinsics"),
        format="kalibr",
        notes=(f"not held of {name}: {others}",) if others else (),
    )


def written(source: Source) -> tuple[str, tuple[str, ...]]:
    """A calibration's camera as cam0 of a chain, and what is lost.

    ``radtan`` has no k3: where there is one, the other four are fitted over the picture.

    Raises
    ------
    InputError
        If no four coefficients come within 0.5 px of the camera.
    """
    camera, notes = _four_coefficients(source.camera)
    part = {
        "cam_overlaps": [],
        "camera_model": "pinhole",
        "distortion_coeffs": list(camera.distortion[:4]),
        "distortion_model": "radtan",
        "intrinsics": [camera.alpha, camera.beta, camera.u0, camera.v0],
        "resolution": list(camera.image_size),
        "rostopic": "/cam0/image_raw",
    }
    lost = lost_planes(source) + lost_uncertainty(source)
    return yaml_text({"cam0": part}), notes + lost


def _four_coefficients(camera: Camera) -> tuple[Camera, tuple[str, ...]]:
    """The camera without skew and k3, and what that costs."""
    if not (camera.gamma or camera.distortion[4]):
        return camera, ()
    square = Camera(camera.image_size, camera.alpha, camera.beta, camera.u0, camera.v0)
    close, misfit = fitted_brown(square, rays_over_picture(camera), _FOUR)
    notes: tuple[str, ...] = ()
    if camera.distortion[4]:
        notes += ("k3 has no place in it: k1, k2, p1 and p2 were fitted over the picture",)
    if camera.gamma:
        notes += (f"the skew, up to {skew_lost_px(camera):.3g} px, has no place in it",)
    return close, (*notes, f"largest difference from the camera as it was: {misfit:.3g} px")


def _cameras(document: Document) -> dict[str, Mapping[str, object]]:
    parts = document.items()
    return {k: v for k, v in parts if isinstance(v, Mapping) and "camera_model" in v}


def _chosen(names: list[str], chosen: str | None) -> str:
    listed = one_line(" or ".join(names))
    if chosen is None and len(names) > 1:
        raise InputError(f"the file holds {len(names)} cameras", f"say which is meant: {listed}")
    if chosen is not None and chosen not in names:
        raise InputError(f"there is no camera {shown(chosen)}", f"choose {listed}")
    return names[0] if chosen is None else chosen


def _distortion(name: str, part: Mapping[str, object]) -> tuple[float, ...]:
    key, model = f"{name}.distortion_coeffs", part["distortion_model"]
    values = part.get("distortion_coeffs", [])
    if model == "none" and not numbers(values, key).any():
        return (0.0,) * 5
    if model != "radtan":
        _refuse_model(f"{name}.distortion_model", model, "radtan")
    return (*counted_numbers(values, key, 4).tolist(), 0.0)


def _refuse_model(key: str, model: object, known: str) -> None:
    raise InputError(
        f"{key} is {shown(model)}, a lens model that has no place here",
        f"calibrate again with {known}",
    )
