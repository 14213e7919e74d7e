"""How a sheet moves with its control points, and these with the noise of lines of light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.calibration.components import COMPONENTS, LINE, SHAPE, STRIPE
from sheetoflight.calibration.control_forms import FORMS
from sheetoflight.calibration.control_lines import line_shares
from sheetoflight.calibration.control_motions import plane_slopes
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.geometry.directions import Array, tangent_basis
from sheetoflight.geometry.planes import fitted_plane
from sheetoflight.model.board import Board
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import (
    observed_boards,
)
from sheetoflight.simulation.rig import SimulatedRig
from tests.calibration.boards import rig_of
from tests.calibration.older_methods import EACH, PINHOLE, assert_scatter_is_stated


def test_the_plane_moves_with_its_points_as_it_says() -> None:
    """Central differences of the total least-squares plane."""
    rng = np.random.default_rng(9)
    points = rng.normal(size=(12, 3)) * [90.0, 60.0, 4.0] + [30.0, -20.0, 700.0]
    normal, _ = fitted_plane(points)
    frame = frame_of(normal)
    slopes = plane_slopes(np.concatenate([points, np.full((1, 3), np.nan)]), frame)
    assert not slopes[:, -1].any()
    step = 1e-3
    for number, axis in np.ndindex(12, 3):
        ends = []
        for size in (step, -step):
            moved = points.copy()
            moved[number, axis] += size
            turned, distance = fitted_plane(moved)
            ends.append(np.append(turned @ frame[:, :2], distance))
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.allclose(slopes[:, number, axis], slope, rtol=1e-6, atol=1e-9)


def frame_of(normal: Array) -> Array:
    return np.stack([*tangent_basis(normal), normal], axis=1)


def without_scraps(views: BoardViews) -> BoardViews:
    """The views without pieces of the line that hardly touch a face."""
    kept = [own for own in views.line.groups() if len(own) > 5]
    return replace(views, line=views.line.take(np.sort(np.concatenate(kept))))


def state_of(truth: SimulatedRig, poses: tuple[Array, Array]) -> RigState:
    frames = np.array([frame_of(plane.normal) for plane in truth.light_planes])
    distances = np.array([plane.distance_mm for plane in truth.light_planes])
    placed = np.concatenate([poses[0], poses[1][..., None]], axis=2)
    return RigState(truth.camera, np.zeros(3), frames, distances, {"board": placed})


def winding(places: Array, rng: np.random.Generator) -> Array:
    """A curve of four random Legendre polynomials of rms 1, degrees 2 to 5."""
    found = np.zeros_like(places)
    for degree in (2, 3, 4, 5):
        polynomial = np.polynomial.Legendre.basis(degree)
        found += rng.normal() * np.sqrt(2 * degree + 1) * polynomial(places)
    return found


@EACH
@pytest.mark.parametrize("kind", [STRIPE, SHAPE, LINE], ids=[COMPONENTS[k] for k in (4, 6, 5)])
def test_the_lines_noise_does_what_it_is_said_to(
    kind: int, method: str, board: Board | None
) -> None:
    """Sheets from lines disturbed at random, and the covariance that is stated for them."""
    rng = np.random.default_rng([kind, len(method)])
    truth = board_rig(board, PINHOLE)
    assert truth.board is not None
    poses = board_poses(truth, truth.board, 6, rng)
    views = without_scraps(observed_boards(truth, truth.board, *poses, rng, line_points=40))
    state = state_of(truth, poses)
    rig = rig_of(truth, views, "none")
    form = FORMS[method](truth.board, views, truth.camera, state.poses["board"])
    slopes = plane_slopes(form.place(form.sights).points, state.frames[0])
    size = {STRIPE: 0.05, SHAPE: 0.05, LINE: 0.02}[kind]
    variances = np.where(np.arange(len(COMPONENTS)) == kind, size**2, 0.0)
    stated = line_shares(rig, 0, form, slopes, state, variances)[kind]
    squares = []
    for _ in range(200):
        uv = disturbed(truth, views.line, state, kind, size, rng)
        sheet = form.place(replace(form.sights, line_uv=uv))
        off = np.append(sheet.normal @ state.frames[0][:, :2], sheet.distance)
        off[2] -= state.distances[0]
        squares.append(float(off @ np.linalg.solve(stated, off)))
    assert_scatter_is_stated(squares, 3)


def disturbed(
    truth: SimulatedRig,
    line: LinePixels,
    state: RigState,
    kind: int,
    size: float,
    rng: np.random.Generator,
) -> Array:
    """The lines' pixels with noise of one kind."""
    uv = line.uv.copy()
    for own in line.groups():
        way = uv[own[-1]] - uv[own[0]]
        way = way / np.linalg.norm(way)
        at = (uv[own] - uv[own[0]]) @ way
        place = 2 * at / at[-1] - 1
        if kind == LINE:
            uv[own] = off_sheet(truth, state, line, own, size * rng.normal(size=2), place)
            continue
        shift = winding(place, rng) if kind == SHAPE else rng.normal(size=len(own))
        uv[own] += size * shift[:, None] * [-way[1], way[0]]
    return uv


def off_sheet(
    truth: SimulatedRig,
    state: RigState,
    line: LinePixels,
    own: np.ndarray,
    lifts: Array,
    place: Array,
) -> Array:
    """The picture of a line on a face whose ends lie off the sheet by two lifts, mm."""
    assert truth.board is not None
    pose = state.poses["board"][line.view[own[0]]]
    face = truth.board.faces[line.face[own[0]]]
    m = pose[:, :3] @ face[:3]
    c = face[3] + m @ pose[:, 3]
    n, d = truth.light_plane.normal, truth.light_plane.distance_mm
    rays = truth.camera.unproject(line.uv[own])
    along = np.cross(n, m)
    ends = []
    for lift, ray in zip(lifts, rays[[0, -1]], strict=True):
        point = ray * c / (m @ ray)
        ends.append(np.linalg.solve(np.stack([m, n, along]), [c, d + lift, along @ point]))
    first, last = (end / end[2] for end in ends)  # straight in the picture, too
    share = (1 + place[:, None]) / 2
    return truth.camera.project((1 - share) * first + share * last)
