"""A calibration with stated uncertainties, and segments of known length, that tests share."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.model.calibration import Calibration, Residuals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.poses import segments_in_sheet
from sheetoflight.simulation.rig import paper_rig

RIG = paper_rig()
PIXEL_STD = 0.1
CAMERA_STD = np.array([1.5, 1.5, 2.0, 2.0])
TILT_STD, DISTANCE_STD_MM = 3e-4, 0.4
FREE = (0, 1, 3, 4)
"""Places of alpha, beta, u0, v0 among the camera's parameters."""

TANGENTS = np.stack(tangent_basis(RIG.light_plane.normal), axis=1)


def stated_covariance() -> Covariance:
    """Focal lengths, principal point and sheet, independent of each other."""
    names = ("alpha", "beta", "u0", "v0")
    matrix = np.zeros((8, 8))
    matrix[:4, :4] = np.diag(CAMERA_STD**2)
    matrix[4:7, 4:7] = TILT_STD**2 * TANGENTS @ TANGENTS.T
    matrix[7, 7] = DISTANCE_STD_MM**2
    plane = tuple(f"laser.{part}" for part in ("nx", "ny", "nz", "d"))
    return Covariance((*(f"camera.{name}" for name in names), *plane), matrix)


def calibrated(
    camera: Camera = RIG.camera,
    plane: LightPlane = RIG.light_plane,
    covariance: Covariance | None = None,
) -> Calibration:
    """The paper's rig, calibrated with the stated covariance."""
    return Calibration(
        method="joint",
        camera=camera,
        light_planes=(plane,),
        covariance=covariance or stated_covariance(),
        residuals=Residuals(PIXEL_STD, 1.0),
        target=None,
        pixel_std=PIXEL_STD,
    )


def drawn_calibration(rng: np.random.Generator) -> Calibration:
    """A calibration that errs as its covariance says."""
    parameters = RIG.camera.parameters.copy()
    parameters[list(FREE)] += CAMERA_STD * rng.normal(size=4)
    plane = RIG.light_plane
    normal = plane.normal + TILT_STD * TANGENTS @ rng.normal(size=2)
    distance = plane.distance_mm + DISTANCE_STD_MM * float(rng.normal())
    drawn = LightPlane(normal / np.linalg.norm(normal), distance, plane.name)
    return calibrated(RIG.camera.with_parameters(parameters), drawn)


def true_ends(lengths_mm: list[float], seed: int = 1) -> np.ndarray:
    """Image points ``(N, 2, 2)`` of segments of these lengths, without noise."""
    rng = np.random.default_rng(seed)
    points = [segments_in_sheet(RIG, length, 1, rng, margin_px=5.0)[0] for length in lengths_mm]
    return RIG.camera.project(np.stack(points))


def write_segments(path: Path, ends: np.ndarray, columns: dict[str, list[object]]) -> None:
    """A ``segments.csv`` with segments s0, s1 … and further columns."""
    lines = [",".join(["segment,u1,v1,u2,v2", *columns])]
    for number, uv in enumerate(ends):
        cells = [f"s{number}", *map(repr, uv.ravel().tolist())]
        lines.append(",".join([*cells, *(str(column[number]) for column in columns.values())]))
    path.write_text("\n".join(lines) + "\n")
