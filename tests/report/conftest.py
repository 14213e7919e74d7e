"""A plausible calibration of the paper's rig, and a picture measured with it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.model.calibration import Calibration, Covariance, Residuals, ViewResiduals
from sheetoflight.model.line_piece import LinePiece
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


@pytest.fixture(scope="session")
def rig() -> SimulatedRig:
    return paper_rig(distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))


@pytest.fixture(scope="session")
def make_calibration(rig: SimulatedRig) -> Callable[..., Calibration]:
    """Make a calibration whose views, warnings and provenance can be chosen."""

    def make(
        views: tuple[ViewResiduals, ...] | None = None,
        warnings: tuple[str, ...] = ("Few views reach into the corners.",),
        provenance: dict[str, object] | None = None,
        covariance: Covariance | None = None,
        chi2_per_dof: float = 1.0132,
    ) -> Calibration:
        chosen = simulated_views(rig) if views is None else views
        return Calibration(
            method="joint",
            camera=rig.camera,
            light_planes=(rig.light_plane,),
            covariance=covariance or plausible_covariance(rig),
            residuals=Residuals(NOISE_PX, chi2_per_dof, chosen),
            target=rig.target,
            pixel_std=NOISE_PX,
            warnings=warnings,
            provenance=provenance
            or {"rig": "rig/", "options": {"distortion": "radial1"}, "files": ["a.png", "b.png"]},
        )

    return make


@pytest.fixture(scope="session")
def calibration(make_calibration: Callable[..., Calibration]) -> Calibration:
    return make_calibration()


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


@pytest.fixture(scope="session")
def picture(rig: SimulatedRig) -> MeasuredPicture:
    """A dim picture with one whole piece 150 mm long, and one that leaves the picture."""
    rng = np.random.default_rng(7)
    ends = rig.camera.project(segments_in_sheet(rig, 150.0, 1, rng, margin_px=40.0)[0])
    width, height = rig.camera.image_size
    leaving = np.array([[300.0, 20.0], [420.0, -0.5]])
    pieces = (line_piece(ends), line_piece(leaving, whole=False))
    image = rng.integers(0, 30, (height, width)).astype(np.uint8)
    binary = np.zeros((height, width), dtype=bool)
    for piece in pieces:
        u, v = np.clip(np.round(piece.uv).astype(int), 0, (width - 1, height - 1)).T
        image[v, u] = 220
        binary[v, u] = True
    return MeasuredPicture("bar.png", image, binary, pieces)


def line_piece(ends: np.ndarray, whole: bool = True) -> LinePiece:
    """Points one pixel apart between two ends."""
    count = int(np.linalg.norm(ends[1] - ends[0])) + 1
    uv = ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])
    return LinePiece(uv, np.full(count, 0.05), ends, np.array([0.3, 0.2]), whole)
