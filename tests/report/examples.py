"""Plausible calibrations of the paper's rig, and a picture measured with one of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.simulation.poses import (
    in_plane_poses,
    pivot_poses,
    segments_in_sheet,
    target_points,
)
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

NOISE_PX = 0.1
CAMERA_STD = {"alpha": 4.2, "beta": 4.1, "u0": 3.3, "v0": 2.7, "k1": 0.0021}
TILT_STD, DISTANCE_STD_MM = 3e-4, 0.43
NO_COVARIANCE = Covariance((), np.empty((0, 0)))
RIG = paper_rig(distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))


def example_calibration(**changes: Any) -> Calibration:
    """A calibration of the paper's rig with any field replaced; `views` replaces its views."""
    views = changes.pop("views", None)
    chi2 = changes.pop("chi2_per_dof", 1.0132)
    made = Calibration(
        method="joint",
        camera=RIG.camera,
        light_planes=(RIG.light_plane,),
        covariance=plausible_covariance(RIG),
        residuals=Residuals(NOISE_PX, chi2, simulated_views(RIG) if views is None else views),
        target=RIG.target,
        pixel_std=NOISE_PX,
        warnings=("Few views reach into the corners.",),
        provenance={"rig": "rig/", "options": {"distortion": "radial1"}, "files": ["a", "b"]},
    )
    return replace(made, **changes)


def facing_calibration(focal_px: float) -> Calibration:
    """A camera that looks straight at a sheet one metre away, known without error."""
    return example_calibration(
        camera=Camera((1392, 1040), focal_px, focal_px, 695.5, 519.5),
        light_planes=(LightPlane(np.array([0.0, 0.0, 1.0]), 1000.0),),
        covariance=Covariance(("camera.alpha",), np.zeros((1, 1))),
        target=CollinearTarget(),
        views=(),
    )


def simulated_views(rig: SimulatedRig) -> tuple[ViewResiduals, ...]:
    """Twelve pivoting and ten in-plane views with normal residuals."""
    rng = np.random.default_rng(20110901)
    positions = rig.target.positions
    pivot = target_points(*pivot_poses(rig, 12, rng), positions)
    lying = target_points(*in_plane_poses(rig, 10, rng), positions)
    views = []
    for stage, groups in (("camera", pivot), ("plane", lying)):
        for number, xyz in enumerate(groups):
            residuals = rng.normal(scale=NOISE_PX, size=(len(xyz), 2))
            uv = rig.camera.project(xyz) + residuals
            views.append(ViewResiduals(stage, f"{stage}{number:02d}", uv, residuals, xyz))
    return tuple(views)


def plausible_covariance(rig: SimulatedRig) -> Covariance:
    """Independent camera parameters and distance; the normal moves on the unit sphere only."""
    names = [f"camera.{name}" for name in CAMERA_STD]
    matrix = np.zeros((len(names) + 4, len(names) + 4))
    matrix[: len(names), : len(names)] = np.diag([s**2 for s in CAMERA_STD.values()])
    tangents = np.stack(tangent_basis(rig.light_plane.normal), axis=1)
    matrix[-4:-1, -4:-1] = TILT_STD**2 * tangents @ tangents.T
    matrix[-1, -1] = DISTANCE_STD_MM**2
    laser = [f"laser.{name}" for name in ("nx", "ny", "nz", "d")]
    return Covariance((*names, *laser), matrix)


def measured_picture(name: str = "bar.png") -> MeasuredPicture:
    """A dim picture with one whole piece 150 mm long, and one that leaves the picture."""
    rng = np.random.default_rng(7)
    ends = RIG.camera.project(segments_in_sheet(RIG, 150.0, 1, rng, margin_px=40.0)[0])
    width, height = RIG.camera.image_size
    leaving = np.array([[300.0, 20.0], [420.0, -0.5]])
    pieces = (line_piece(ends), line_piece(leaving, whole=False))
    image = rng.integers(0, 30, (height, width)).astype(np.uint8)
    binary = np.zeros((height, width), dtype=bool)
    for piece in pieces:
        u, v = np.clip(np.round(piece.uv).astype(int), 0, (width - 1, height - 1)).T
        image[v, u] = 220
        binary[v, u] = True
    return MeasuredPicture(name, image, binary, pieces)


def line_piece(ends: np.ndarray, whole: bool = True) -> LinePiece:
    """Points one pixel apart between two ends."""
    count = int(np.linalg.norm(ends[1] - ends[0])) + 1
    uv = ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])
    return LinePiece(uv, np.full(count, 0.05), ends, np.array([0.3, 0.2]), whole)
