"""Plausible calibrations of the paper's rig, and a picture measured with one of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sheetoflight.geometry.directions import tangent_basis
from sheetoflight.measurement.comparison import MeasuredSegment
from sheetoflight.model.calibration import Calibration, Residuals, ViewResiduals
from sheetoflight.model.camera import Camera
from sheetoflight.model.covariance import PLANE_PARTS, Covariance, NoiseComponents, Source
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.line_piece import LinePiece
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.contents import MeasuredPicture
from sheetoflight.simulation.poses import (
    PlacedTargets,
    Recording,
    in_plane_poses,
    pivot_poses,
    placed_targets,
    segments_in_sheet,
)
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.visible import target_points

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


RIG_OF_TWO = replace(
    paper_rig(),
    light_planes=(
        replace(RIG.light_plane, name="left"),
        LightPlane(np.array([-0.88, 0.1, 0.46]), 610.0, "right"),
    ),
    target=CollinearTarget(
        tolerance_mm=0.02, expansion_per_K=11.5e-6, warmer_by_K=4.0, warmer_by_std_K=0.5
    ),
)
SHARES = {
    "camera": "pixel",
    "sheet": "pixel",
    "crossing": "pixel",
    "placement": "placement",
    "target length": None,
    "temperature": None,
}
"""Sources and the noise component that each goes with."""


def calibration_of_two_lasers(**changes: Any) -> Calibration:
    """Two lasers, crossing views, and a covariance that is the sum of its sources."""
    rig = RIG_OF_TWO
    made = Calibration(
        method="joint",
        camera=rig.camera,
        light_planes=rig.light_planes,
        covariance=covariance_by_source(rig),
        residuals=Residuals(NOISE_PX, 1.0, crossing_views(rig)),
        target=rig.target,
        pixel_std=NOISE_PX,
    )
    return replace(made, **changes)


def crossing_views(rig: SimulatedRig) -> tuple[ViewResiduals, ...]:
    """Views of all stages; one spot of each crossing view is not seen."""
    rng = np.random.default_rng(20110902)
    placed: PlacedTargets = placed_targets(rig, Recording(8, 5, 4), rng)
    crossing = np.concatenate([placed.crossing, placed.spots], axis=1)
    views = []
    for stage, groups in (
        ("camera", placed.camera),
        ("plane", placed.plane),
        ("crossing", crossing),
    ):
        for number, xyz in enumerate(groups):
            residuals = rng.normal(scale=NOISE_PX, size=(len(xyz), 2))
            residuals[~np.isfinite(xyz).all(axis=1)] = np.nan
            uv = rig.camera.project(xyz) + residuals
            where = np.where(np.isfinite(xyz), xyz, xyz[0])  # a place that means nothing
            views.append(ViewResiduals(stage, f"{stage}{number:02d}", uv, residuals, where))
    return tuple(views)


def covariance_by_source(rig: SimulatedRig) -> Covariance:
    """Each source moves all parameters in three random ways."""
    rng = np.random.default_rng(20110903)
    names = [f"camera.{name}" for name in ("alpha", "beta", "u0", "v0")]
    scales = [1.0, 1.0, 1.5, 1.5]
    for plane in rig.light_planes:
        names += [f"{plane.name}.{part}" for part in PLANE_PARTS]
        scales += [2e-4, 2e-4, 2e-4, 0.2]
    sources = []
    for name, component in SHARES.items():
        ways = np.array(scales)[:, None] * rng.normal(size=(len(names), 3))
        sources.append(Source(name, ways @ ways.T, component))
    sources.insert(4, Source("placement", 0.1 * sources[0].matrix, "marker"))
    whole = np.sum([source.matrix for source in sources], axis=0)
    relative = np.diag([0.01, 0.2, 2.0])
    components = NoiseComponents(("pixel", "placement", "marker"), (0.1, 0.3, 0.05), relative)
    return Covariance(tuple(names), whole, tuple(sources), components)


def measured_picture(
    name: str = "bar.png", calibration: Calibration | None = None
) -> MeasuredPicture:
    """A dim picture with one whole piece 150 mm long, and one that leaves the picture."""
    calibration = calibration or example_calibration()
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
    return MeasuredPicture(name, image, binary, pieces, measured(calibration, pieces[:1]))


def picture_pieces(laser: str) -> tuple[LinePiece, ...]:
    """Three pieces of 150 mm in the sheet of one of two lasers, seen without error."""
    rng = np.random.default_rng(11)
    number = [plane.name for plane in RIG_OF_TWO.light_planes].index(laser)
    ends = segments_in_sheet(RIG_OF_TWO, 150.0, 3, rng, margin_px=40.0, laser=number)
    return tuple(line_piece(pair) for pair in RIG_OF_TWO.camera.project(ends))


def measured(
    calibration: Calibration, pieces: tuple[LinePiece, ...], laser: str | None = None
) -> tuple[MeasuredSegment, ...]:
    """Pieces and their lengths, the first called bar-1."""
    return tuple(
        MeasuredSegment(
            f"bar-{number}",
            piece.ends,
            calibration.length(*piece.ends, std_px=0.25, laser=laser),
            laser,
        )
        for number, piece in enumerate(pieces, start=1)
    )


def line_piece(ends: np.ndarray, whole: bool = True) -> LinePiece:
    """Points one pixel apart between two ends."""
    count = int(np.linalg.norm(ends[1] - ends[0])) + 1
    uv = ends[0] + np.linspace(0.0, 1.0, count)[:, None] * (ends[1] - ends[0])
    return LinePiece(uv, np.full(count, 0.05), ends, np.array([0.3, 0.2]), whole)
