"""The pictures of a rig folder, one by one, with the truth of each.

Every picture has a random generator of its own, derived from the seed and the picture's place
in the folder: they may be rendered in any order, or in several processes, to the same bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.simulation.clutter import clutter
from sheetoflight.simulation.holding import Holding, held
from sheetoflight.simulation.poses import (
    in_plane_poses,
    pivot_poses,
    segments_in_sheet,
    target_points,
)
from sheetoflight.simulation.render import Picture, RenderOptions, render
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.scene import (
    Scene,
    Surface,
    bar_surface,
    facing_direction,
    target_surface,
    wall_surface,
)

_STAGES = ("camera", "plane", "measure")
_CLUTTER = len(_STAGES)
_POSES, _NOISE = 0, 1


@dataclass(frozen=True)
class ViewOptions:
    """How targets and bars are held before the camera, and lit in each stage.

    Parameters
    ----------
    render : RenderOptions
        Its ``ambient_level`` is replaced by the stage's.
    camera_ambient, plane_ambient, measure_ambient : float
        Brightness of white paint without laser, as a share of full scale. Where the laser is
        on, ambient light is dimmed so that the line stands out and does not saturate.
    max_tilt_deg : float
        Largest angle between a strip's surface normal and the direction to the camera – and,
        where the laser is on, to the projector. People do not hold a target edge-on.
    margin_px : float
        Least distance of every marker's rim, and of a bar's ends, from the picture's edge, px.
    wall_gap_mm : float
        Distance of the wall behind the farthest point a target or bar may reach, mm.
    bar_width_mm : float
        Width of the measured bars, mm.
    clutter : int
        Number of things painted on the wall.
    """

    render: RenderOptions = field(default_factory=RenderOptions)
    camera_ambient: float = 180 / 255
    plane_ambient: float = 0.33
    measure_ambient: float = 0.12
    max_tilt_deg: float = 60.0
    margin_px: float = 10.0
    wall_gap_mm: float = 100.0
    bar_width_mm: float = 30.0
    clutter: int = 0

    def lit(self, stage: str) -> RenderOptions:
        """How the pictures of a stage are rendered."""
        levels = {
            "camera": self.camera_ambient,
            "plane": self.plane_ambient,
            "measure": self.measure_ambient,
        }
        return replace(self.render, ambient_level=levels[stage])


@dataclass(frozen=True, eq=False)
class SimulatedPicture:
    """A rendered picture and what it shows.

    Parameters
    ----------
    stage : {"camera", "plane", "measure"}
    name : str
        File name without ending; pairs end in ``_off`` and ``_on``.
    image : (height, width) array of uint8 or uint16
    truth : dict
        See `PictureTask`.
    """

    stage: str
    name: str
    image: Picture
    truth: dict[str, Any]


@dataclass(frozen=True, eq=False)
class PictureTask:
    """All that is needed to render one picture, also in another process.

    Parameters
    ----------
    stage, view : str
        The view's name is common to both pictures of a pair.
    laser : bool or None
        On or off in a pair; None in a single picture without laser.
    rig : SimulatedRig
    scene : Scene
    options : RenderOptions
    seed : int
    key : tuple of int
        The picture's place in the folder, which with the seed fixes its noise.
    truth : dict
        Plain lists and numbers: ``markers_uv`` (px) and ``markers_xyz`` (mm) of a target, or
        ``ends_uv``, ``ends_xyz`` and ``length_mm`` of a bar.
    """

    stage: str
    view: str
    laser: bool | None
    rig: SimulatedRig
    scene: Scene
    options: RenderOptions
    seed: int
    key: tuple[int, ...]
    truth: dict[str, Any]

    @property
    def name(self) -> str:
        """File name without ending."""
        return self.view if self.laser is None else f"{self.view}_{'on' if self.laser else 'off'}"


def rig_pictures(
    rig: SimulatedRig,
    camera_views: int,
    plane_views: int,
    segments: Sequence[float] = (),
    options: ViewOptions | None = None,
    seed: int = 0,
) -> Iterator[SimulatedPicture]:
    """The pictures of a rig folder, rendered one at a time; see `picture_tasks`."""
    for task in picture_tasks(rig, camera_views, plane_views, segments, options, seed):
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

    Raises
    ------
    InputError
        If so many views cannot be held wholly in the picture within the allowed tilt.
    """
    options = options or ViewOptions()
    wall = _wall(rig, segments, options, _generator(seed, _CLUTTER))
    studio = _Studio(rig, wall, options, seed)
    return [
        *studio.camera_tasks(camera_views),
        *studio.plane_tasks(plane_views),
        *studio.measure_tasks(segments),
    ]


def folder_truth(rig: SimulatedRig, tasks: Sequence[PictureTask]) -> dict[str, Any]:
    """The truth of a rig folder as plain lists and numbers, ready for JSON.

    Returns
    -------
    dict
        ``camera`` (image_size, matrix, distortion), ``light_plane`` (normal, distance_mm),
        ``projector_mm``, ``anchor_mm``, ``target`` (markers_mm), and under ``views``, by stage
        and view name, the truth of each view.
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
        },
        "projector_mm": rig.projector_mm.tolist(),
        "anchor_mm": rig.anchor_mm.tolist(),
        "target": {
            "markers_mm": list(rig.target.markers_mm),
            "marker": rig.target.marker,
            "marker_size_mm": rig.target.marker_size_mm,
        },
        "views": views,
    }


def blank_scene(rig: SimulatedRig, options: ViewOptions | None = None, seed: int = 0) -> Scene:
    """The wall alone, with its clutter if any: what a detector must find nothing in."""
    return Scene((_wall(rig, (), options or ViewOptions(), _generator(seed, _CLUTTER)),))


class _Studio:
    """Holds targets and bars before the wall and describes the pictures taken of them."""

    def __init__(self, rig: SimulatedRig, wall: Surface, options: ViewOptions, seed: int) -> None:
        self._rig, self._wall, self._options, self._seed = rig, wall, options, seed

    def camera_tasks(self, count: int) -> list[PictureTask]:
        """The target pivots about marker 0; no laser."""
        rng = _generator(self._seed, _STAGES.index("camera"), _POSES)

        def draw(n: int) -> Array:
            return target_points(*pivot_poses(self._rig, n, rng), self._rig.target.positions)

        return [
            self._target_task("camera", i, points, laser=None)
            for i, points in enumerate(
                held(self._rig, count, draw, self._target(False), "pivot views")
            )
        ]

    def plane_tasks(self, count: int) -> list[PictureTask]:
        """The target lies in the sheet; laser off and on."""
        rng = _generator(self._seed, _STAGES.index("plane"), _POSES)

        def draw(n: int) -> Array:
            return target_points(*in_plane_poses(self._rig, n, rng), self._rig.target.positions)

        poses = held(self._rig, count, draw, self._target(True), "in-plane views")
        return [
            self._target_task("plane", i, points, laser)
            for i, points in enumerate(poses)
            for laser in (False, True)
        ]

    def measure_tasks(self, lengths: Sequence[float]) -> list[PictureTask]:
        """A bar of each length lies in the sheet; laser off and on."""
        return [
            self._bar_task(i, ends, laser)
            for i, length in enumerate(lengths)
            for ends in self._bar_ends(i, length)
            for laser in (False, True)
        ]

    def _target(self, laser: bool) -> Holding:
        return self._holding(self._rig.target.marker_size_mm / 2, laser)

    def _holding(self, radius_mm: float, laser: bool) -> Holding:
        return Holding(self._options.max_tilt_deg, self._options.margin_px, radius_mm, laser)

    def _bar_ends(self, index: int, length: float) -> list[Array]:
        rng = _generator(self._seed, _STAGES.index("measure"), _POSES, index)

        def draw(n: int) -> Array:
            return segments_in_sheet(self._rig, length, n, rng)

        holding = self._holding(self._options.bar_width_mm / 2, laser=True)
        return held(self._rig, 1, draw, holding, f"bars of {length:g} mm")

    def _target_task(
        self, stage: str, index: int, points: Array, laser: bool | None
    ) -> PictureTask:
        facing = facing_direction(self._rig, (points[0] + points[-1]) / 2, laser is not None)
        direction = normalised(points[-1] - points[0])
        strip = target_surface(self._rig.target, points[0], direction, facing)
        uv = self._rig.camera.project(points)
        truth = {"markers_uv": uv.tolist(), "markers_xyz": points.tolist()}
        return self._task(stage, index, f"{stage}{index:02d}", laser, strip, truth)

    def _bar_task(self, index: int, ends: Array, laser: bool) -> PictureTask:
        facing = facing_direction(self._rig, ends.mean(axis=0), laser=True)
        bar = bar_surface(ends, facing, self._options.bar_width_mm)
        truth = {
            "ends_uv": self._rig.camera.project(ends).tolist(),
            "ends_xyz": ends.tolist(),
            "length_mm": float(np.linalg.norm(ends[1] - ends[0])),
        }
        return self._task("measure", index, f"bar{index:02d}", laser, bar, truth)

    def _task(
        self,
        stage: str,
        index: int,
        view: str,
        laser: bool | None,
        surface: Surface,
        truth: dict[str, Any],
    ) -> PictureTask:
        return PictureTask(
            stage=stage,
            view=view,
            laser=laser,
            rig=self._rig,
            scene=Scene((surface, self._wall)),
            options=self._options.lit(stage),
            seed=self._seed,
            key=(_STAGES.index(stage), _NOISE, index, int(bool(laser))),
            truth=truth,
        )


def _wall(
    rig: SimulatedRig, segments: Sequence[float], options: ViewOptions, rng: np.random.Generator
) -> Surface:
    """The wall behind everything, far enough that nothing reaches through it."""
    longest = max(rig.target.length_mm / 2, *(length / 2 for length in segments), 0.0)
    reach = max(rig.depth_mm[1] + longest, float(rig.anchor_mm[2]) + rig.target.length_mm)
    distance = reach + options.wall_gap_mm
    width, height = rig.camera.image_size
    paint = clutter(
        distance * width / rig.camera.alpha / 2,
        distance * height / rig.camera.beta / 2,
        options.clutter,
        rng,
    )
    return wall_surface(rig, distance, paint)


def _generator(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
