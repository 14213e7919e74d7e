"""Targets, boards and bars held before a wall, stage by stage."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.model.board import PlanarBoard
from sheetoflight.simulation.board_lines import face_outlines, line_ends
from sheetoflight.simulation.board_poses import BoardHolding, board_poses, placed_points
from sheetoflight.simulation.board_surface import board_border, board_surface
from sheetoflight.simulation.clutter import clutter
from sheetoflight.simulation.curved_lines import spots_of_light
from sheetoflight.simulation.holding import Holding, held
from sheetoflight.simulation.picture import PictureTask, ViewOptions
from sheetoflight.simulation.poses import (
    crossing_poses,
    in_plane_poses,
    pivot_poses,
    segments_in_sheet,
    target_points,
)
from sheetoflight.simulation.rig import SimulatedRig
from sheetoflight.simulation.scene import (
    Scene,
    Surface,
    bar_surface,
    facing_direction,
    target_surface,
    wall_surface,
)

_STAGES = ("camera", "plane", "measure", "wall", "board", "crossing")
"""Their order fixes every random number."""
_POSES, _NOISE = 0, 1


class Studio:
    """Holds targets and bars before the wall and describes the pictures taken of them.

    Parameters
    ----------
    rig : SimulatedRig
    wall : Surface
        What stands behind them; see `backdrop`.
    options : ViewOptions
    seed : int
        Fixes the poses, and the noise of every picture.
    """

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

    def board_tasks(self, count: int) -> list[PictureTask]:
        """The rig's board is held across the sheet; laser off and on, or on alone."""
        rig, board = self._rig, self._rig.board
        if not count:
            return []
        if not isinstance(board, PlanarBoard):
            raise InputError(
                "views of a board are asked for, and the rig has none to paint", "give a flat board"
            )
        border = board_border(board) * rig.camera.alpha / rig.depth_mm[0]
        holding = BoardHolding(
            max_tilt_deg=self._options.max_board_tilt_deg,
            margin_px=self._options.margin_px + border,
            whole=True,
            max_roll_deg=self._options.max_board_roll_deg,
            farthest_mm=self._farthest,
        )
        rng = _generator(self._seed, _STAGES.index("board"), _POSES)
        poses = zip(*board_poses(rig, board, count, rng, holding), strict=True)
        return [
            self._board_task(i, board, *pose, laser)
            for i, pose in enumerate(poses)
            for laser in self._lasers
        ]

    def crossing_tasks(self, count: int) -> list[PictureTask]:
        """The sheet crosses the target between two markers; laser off and on, or on alone."""
        rng = _generator(self._seed, _STAGES.index("crossing"), _POSES)
        positions, size = self._rig.target.positions, self._rig.target.marker_size_mm
        gap = float(np.diff(positions).max())
        if count and gap <= 2.0 * size:
            raise InputError(
                f"markers of {size:g} mm are up to {gap:g} mm apart: the sheet crosses no bare "
                "paper between them",
                "use smaller markers, or greater distances",
            )

        def draw(n: int) -> Array:
            points = target_points(*crossing_poses(self._rig, n, rng), positions)
            return points[self._spots_are_clear(points)]

        poses = held(self._rig, count, draw, self._target(True), "crossing views")
        return [
            self._target_task("crossing", i, points, laser)
            for i, points in enumerate(poses)
            for laser in self._lasers
        ]

    @property
    def _lasers(self) -> tuple[bool, ...]:
        return (False, True) if self._options.pairs else (True,)

    @property
    def _farthest(self) -> float:
        """Greatest Z, mm, at which nothing reaches through the wall."""
        return float(self._wall.centre[2]) - self._options.wall_gap_mm

    def _spots_are_clear(self, points: Array) -> np.ndarray:
        """Mask of the targets ``(n, M, 3)`` on which the sheet meets bare paper before the wall."""
        away = np.linalg.norm(points - self._spots(points)[:, None, :], axis=-1)
        clear = away.min(axis=1) >= self._rig.target.marker_size_mm
        return np.asarray(clear & (points[..., 2].max(axis=1) <= self._farthest))

    def _spots(self, points: Array) -> Array:
        """Where the sheet meets targets ``(n, M, 3)``: ``(n, 3)``, mm."""
        along = normalised(points[:, -1] - points[:, 0])
        return spots_of_light(self._rig, 0, points[:, 0], along)

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
        truth = self._seen("markers", points)
        if stage == "crossing":
            truth |= self._seen("spots", self._spots(points[None]))
        return self._task(stage, index, f"{stage}{index:02d}", laser, strip, truth)

    def _board_task(
        self, index: int, board: PlanarBoard, rotation: Array, translation: Array, laser: bool
    ) -> PictureTask:
        pose = rotation[None], translation[None]
        (outline,) = face_outlines(board)
        ends = line_ends(placed_points(outline, *pose)[0], self._rig)
        truth = {
            "camera_from_target": {
                "rotation": rotation.tolist(),
                "translation_mm": translation.tolist(),
            },
            **self._seen("points", placed_points(board.points, *pose)[0]),
            **self._seen("line", ends),
        }
        sheet = board_surface(board, rotation, translation, self._options.codes)
        return self._task("board", index, f"board{index:02d}", laser, sheet, truth)

    def _seen(self, what: str, points: Array) -> dict[str, Any]:
        uv = self._rig.camera.project(points)
        return {f"{what}_uv": uv.tolist(), f"{what}_xyz": points.tolist()}

    def _bar_task(self, index: int, ends: Array, laser: bool) -> PictureTask:
        facing = facing_direction(self._rig, ends.mean(axis=0), laser=True)
        bar = bar_surface(ends, facing, self._options.bar_width_mm)
        truth = {
            **self._seen("ends", ends),
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
            pair=self._options.pairs or stage not in ("board", "crossing"),
        )


def backdrop(
    rig: SimulatedRig, segments: Sequence[float], options: ViewOptions, seed: int
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
        _generator(seed, _STAGES.index("wall")),
    )
    return wall_surface(rig, distance, paint)


def _generator(seed: int, *key: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=key))
