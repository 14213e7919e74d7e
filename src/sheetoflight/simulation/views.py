"""The pictures of a rig folder, one by one, with the truth of each.

Every picture has a random generator of its own, derived from the seed and the picture's place
in the folder: they may be rendered in any order, or in several processes, to the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.simulation.picture import PictureTask, SimulatedPicture, ViewOptions
from sheetoflight.simulation.render import render
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.scene import Scene
from sheetoflight.simulation.studio import Studio, backdrop


def rig_pictures(
    rig: SimulatedRig,
    camera_views: int,
    plane_views: int,
    segments: Sequence[float] = (),
    options: ViewOptions | None = None,
    seed: int = 0,
    board_views: int = 0,
    crossing_views: int = 0,
) -> Iterator[SimulatedPicture]:
    """The pictures of a rig folder, rendered one at a time; see `picture_tasks`."""
    for task in picture_tasks(
        rig, camera_views, plane_views, segments, options, seed, board_views, crossing_views
    ):
        yield render_task(task)


def render_task(task: PictureTask) -> SimulatedPicture:
    """Render one picture."""
    rng = np.random.default_rng(np.random.SeedSequence(task.seed, spawn_key=task.key))
    image = render(task.rig, task.scene, task.options, rng, laser=bool(task.laser))
    return SimulatedPicture(task.stage, task.name, image, task.truth)


def picture_tasks(
    rig: SimulatedRig,
    camera_views: int,
    plane_views: int,
    segments: Sequence[float] = (),
    options: ViewOptions | None = None,
    seed: int = 0,
    board_views: int = 0,
    crossing_views: int = 0,
) -> list[PictureTask]:
    """What is to be rendered for a rig folder.

    Parameters
    ----------
    rig : SimulatedRig
    camera_views : int
        Pictures of the target pivoting about marker 0, laser off (stage camera).
    plane_views : int
        Pairs of pictures, laser off and on, of the target lying in the sheet (stage plane).
    segments : sequence of float
        Length of each bar to be measured, mm: one pair of pictures each (stage measure).
    options : ViewOptions, optional
    seed : int
        The same seed gives the same pictures; views of one stage do not depend on the number
        of views in another.
    board_views : int
        Views of the rig's board held across the sheet (stage board).
    crossing_views : int
        Views of the target that the sheet crosses at one point (stage crossing).

    Raises
    ------
    InputError
        If so many views cannot be held wholly in the picture within the allowed tilt, or the rig
        has no flat board.
    """
    options = options or ViewOptions()
    studio = Studio(rig, backdrop(rig, segments, options, seed), options, seed)
    return [
        *studio.camera_tasks(camera_views),
        *studio.plane_tasks(plane_views),
        *studio.measure_tasks(segments),
        *studio.board_tasks(board_views),
        *studio.crossing_tasks(crossing_views),
    ]


def folder_truth(rig: SimulatedRig, tasks: Sequence[PictureTask]) -> dict[str, Any]:
    """The truth of a rig folder as plain lists and numbers, ready for JSON.

    Returns
    -------
    dict
        ``camera`` (image_size, matrix, distortion), ``light_plane`` (normal, distance_mm,
        of a curved one its curvature as in ``calibration.json``),
        ``projector_mm``, ``anchor_mm``, ``target`` (markers_mm), ``board`` where the rig has a
        flat one, and under ``views``, by stage and view name, the truth of each view.
    """
    views: dict[str, dict[str, Any]] = {}
    for task in tasks:
        views.setdefault(task.stage, {})[task.view] = task.truth
    camera, plane = rig.camera, rig.light_plane
    return {
        "camera": {
            "image_size": list(camera.image_size),
            "matrix": camera.matrix.tolist(),
            "distortion": list(camera.distortion),
        },
        "light_plane": {
            "name": plane.name,
            "normal": plane.normal.tolist(),
            "distance_mm": plane.distance_mm,
            **_curvature_truth(plane),
        },
        "projector_mm": rig.projector_mm.tolist(),
        "anchor_mm": rig.anchor_mm.tolist(),
        "target": {
            "markers_mm": list(rig.target.markers_mm),
            "marker": rig.target.marker,
            "marker_size_mm": rig.target.marker_size_mm,
        },
        **_board_truth(rig),
        "views": views,
    }


def _curvature_truth(plane: LightPlane) -> dict[str, Any]:
    bend = plane.curvature
    if bend is None:
        return {}
    parts = {"centre": bend.centre, "axes": bend.axes, "per_mm": bend.per_mm}
    return {"curvature": {name: values.tolist() for name, values in parts.items()}}


def _board_truth(rig: SimulatedRig) -> dict[str, Any]:
    return {"board": asdict(rig.board)} if isinstance(rig.board, PlanarBoard) else {}


def blank_scene(rig: SimulatedRig, options: ViewOptions | None = None, seed: int = 0) -> Scene:
    """The wall alone, with its clutter if any: what a detector must find nothing in."""
    return Scene((backdrop(rig, (), options or ViewOptions(), seed),))
