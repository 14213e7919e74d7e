"""Boards simulated again: what moves, by how much, and together with what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import Legendre

from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.geometry.planes import fitted_plane
from sheetoflight.measurement.resimulation import Resimulation, resimulation
from sheetoflight.model.board import Board, PlanarBoard, SolidTarget
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import photographed_boards, placed_boards
from tests.calibration.boards import rig_of, seen_boards

DRAWS = 400
CHANCE = 4.5
"""Standard errors that a sample variance may lie off; one of a hundred does so with odds 7e-4."""

COARSE = PlanarBoard("chessboard", 5, 4, (40.0, 40.0))
PINHOLE = (0.0, 0.0, 0.0, 0.0, 0.0)


def roof() -> SolidTarget:
    """Two boards that meet at an angle, with a size that is not sure."""
    x, y = (values.ravel() * 40.0 for values in np.meshgrid(np.arange(4), np.arange(4)))
    sides = [
        np.stack([sign * (x * np.cos(0.6) + 10.0), y, x * np.sin(0.6) + 30.0], axis=1)
        for sign in (-1, 1)
    ]
    faces = (tuple(range(16)), tuple(range(16, 32)))
    return SolidTarget(np.concatenate(sides), faces, scale_std=0.01)


def calibrated(board: Board = COARSE, views: int = 8, seed: int = 5) -> tuple[Rig, Calibration]:
    """A rig that sees a board with the line across it, and its calibration."""
    rng = np.random.default_rng(seed)
    truth, seen = seen_boards(rng, views, 0.1, 0.2, board, line_points=60, distortion=PINHOLE)
    rig = rig_of(truth, seen, "none")
    return rig, calibrate(rig)


def quiet(source: Resimulation, **sizes: float) -> Resimulation:
    """Without any noise but what is given; the board is as it should be."""
    assert source.boards is not None
    boards = replace(source.boards, std=0.0 * source.boards.std, printed_mm=np.zeros(3))
    boards = replace(boards, board=replace(boards.board, scale_std=0.0))
    return replace(source, boards=boards, sizes=dict.fromkeys(source.sizes, 0.0) | sizes)


def drawn(source: Resimulation, rng: np.random.Generator) -> BoardViews:
    """The boards of one trial."""
    return source.drawn(rng).observations.board


def faces(board: Board, calibration: Calibration) -> list[list[tuple[Array, float]]]:
    """For each view the planes of the faces, by the points that the calibration found."""
    which = [range(len(board.points))] if isinstance(board, PlanarBoard) else board.face_points
    return [
        [fitted_plane(view.xyz[list(numbers)]) for numbers in which]
        for view in calibration.residuals.views
    ]


def on_their_faces(rig: Rig, calibration: Calibration, views: BoardViews) -> Array:
    """Where the rays of the lines' points meet the calibrated faces ``(P, 3)``, mm."""
    assert rig.board is not None
    planes = faces(rig.board, calibration)
    rays = calibration.camera.unproject(views.line.uv)
    found = []
    for ray, view, face in zip(rays, views.line.view, views.line.face, strict=True):
        normal, distance = planes[view][face]
        found.append(ray * distance / (ray @ normal))
    return np.array(found)


@pytest.mark.parametrize("board", [COARSE, roof()], ids=["board", "body"])
def test_without_noise_points_are_the_fitted_ones_and_lines_lie_in_face_and_sheet(
    board: Board,
) -> None:
    rig, calibration = calibrated(board)
    views = drawn(quiet(resimulation(rig, calibration)), np.random.default_rng(0))
    for view in calibration.residuals.views:
        uv = views.uv[views.names.index(view.view)]
        assert uv == pytest.approx(view.uv - view.residuals, abs=1e-7)
    sheet = calibration.light_plane
    off = on_their_faces(rig, calibration, views) @ sheet.normal - sheet.distance_mm
    assert off == pytest.approx(np.zeros(len(off)), abs=1e-7)
    # each beside a point that was seen: the noise was 0.2 px across the line
    seen = rig.observations.board.line.uv
    apart = np.linalg.norm(views.line.uv[:, None] - seen, axis=-1).min(axis=1)
    assert apart.max() < 1.5


def test_points_scatter_with_the_estimated_noise_in_the_stated_proportions() -> None:
    rig, _ = calibrated()
    views = rig.observations.board
    std = np.where(np.arange(views.uv.shape[1]) % 2, 0.3, 0.1)
    noisy = replace(views, std=np.broadcast_to(std, views.uv.shape[:2]))
    rig = replace(rig, observations=replace(rig.observations, board=noisy))
    calibration = calibrate(rig)
    source = resimulation(rig, calibration)
    rng = np.random.default_rng(1)
    uv = np.array([drawn(source, rng).uv for _ in range(DRAWS)])
    spread = uv.var(axis=0, ddof=1).mean(axis=(0, 2))
    expected = calibration.pixel_std**2 * std**2 / np.mean(std**2)
    chance = CHANCE * np.sqrt(2 / (DRAWS * len(views) * 2))
    assert spread == pytest.approx(expected, rel=chance)


def test_line_points_scatter_across_their_line_with_the_estimated_noise() -> None:
    rig, calibration = calibrated()
    source = resimulation(rig, calibration)
    sizes = {**source.sizes, "line": 0.0, "shape": 0.0}
    source, rng = replace(source, sizes=sizes), np.random.default_rng(2)
    still = drawn(quiet(source), rng).line
    uv = np.array([drawn(source, rng).line.uv for _ in range(100)]) - still.uv
    # normalised noise of all points of all draws: chi-squared, its mean's standard error √(2/n)
    squares = np.sum(uv**2, axis=-1) / sizes["stripe"] ** 2
    assert squares.mean() == pytest.approx(1.0, abs=CHANCE * np.sqrt(2 / squares.size))
    for own in still.groups():
        way = normalised(still.uv[own[-1]] - still.uv[own[0]])
        assert uv[:, own] @ way == pytest.approx(np.zeros((100, len(own))), abs=1e-9)


def test_a_lines_ends_lie_off_the_sheet_independently_and_it_stays_straight() -> None:
    rig, calibration = calibrated()
    source = quiet(resimulation(rig, calibration), line=0.2)
    rng = np.random.default_rng(3)
    sheet, ends = calibration.light_plane, []
    for _ in range(60):
        views = drawn(source, rng)
        points = on_their_faces(rig, calibration, views)
        off = points @ sheet.normal - sheet.distance_mm
        for own in views.line.groups():
            way = (points[own] - points[own[0]]) @ normalised(points[own[-1]] - points[own[0]])
            line = np.polynomial.Polynomial.fit(way, off[own], 1)
            assert off[own] == pytest.approx(line(way), abs=2e-3)  # moved by 0.2 mm: second order
            ends.append((line(way.min()), line(way.max())))
    chance = CHANCE * 0.2**2 * np.sqrt(2 / len(ends))
    assert np.cov(np.transpose(ends)) == pytest.approx(0.2**2 * np.eye(2), abs=chance)


def test_lines_wind_by_the_legendre_polynomials_of_degree_two_to_five() -> None:
    rig, calibration = calibrated()
    source = quiet(resimulation(rig, calibration), shape=0.3)
    rng = np.random.default_rng(4)
    still = drawn(quiet(source), rng).line
    found = []
    for _ in range(60):
        moved = drawn(source, rng).line.uv - still.uv
        for own in still.groups():
            way = normalised(still.uv[own[-1]] - still.uv[own[0]])
            place, across = still.uv[own] @ way, np.array([-way[1], way[0]])
            found.append(Legendre.fit(place, moved[own] @ across, 7).coef)
    degree = np.arange(8)
    wanted = np.where((degree >= 2) & (degree <= 5), 0.3**2 * (2 * degree + 1), 0.0)
    chance = CHANCE * np.sqrt(2 / len(found))
    scale = np.sqrt(np.maximum(wanted, 1e-6))
    spread = np.cov(np.transpose(found)) / np.outer(scale, scale)
    assert spread == pytest.approx(np.diag((wanted > 0).astype(float)), abs=chance)


@pytest.mark.parametrize("windings", [0.0, 0.4])
def test_lines_wind_as_far_as_they_did(windings: float) -> None:
    """16 lines with four degrees each: the size is known to 1/√128, 9 %. None are found where
    there are none but for one rig in forty (score 1.96); this one is none of those."""
    rng = np.random.default_rng(6)
    truth, views = seen_boards(rng, 16, 0.1, 0.2, COARSE, line_points=200, distortion=PINHOLE)
    uv = np.array(views.line.uv)
    for own in views.line.groups():
        way = normalised(uv[own[-1]] - uv[own[0]])
        size = windings * np.sqrt(2 * np.arange(6) + 1) * (np.arange(6) > 1)
        place = np.linspace(-1.0, 1.0, len(own))
        bent = Legendre(size * rng.standard_normal(6))(place)
        uv[own] += bent[:, None] * np.array([-way[1], way[0]])
    rig = rig_of(truth, replace(views, line=replace(views.line, uv=uv)), "none")
    source = resimulation(rig, calibrate(rig))
    assert source.sizes["shape"] == pytest.approx(windings, rel=CHANCE * 0.09, abs=1e-9)


def in_the_board(source: Resimulation, calibration: Calibration, uv: Array) -> Array:
    """Image points ``(N, M, 2)`` as places on the calibrated boards ``(N, M, 2)``, mm."""
    board = source.rig.board
    assert isinstance(board, PlanarBoard)
    found = []
    for view, own in zip(calibration.residuals.views, uv, strict=True):
        normal, distance = fitted_plane(view.xyz)
        rays = calibration.camera.unproject(own)
        points = rays * (distance / (rays @ normal))[:, None]
        axes = np.stack([view.xyz[1] - view.xyz[0], view.xyz[board.columns] - view.xyz[0]])
        found.append((points - view.xyz[0]) @ normalised(axes).T)
    return np.array(found)


def test_a_boards_points_lie_off_alike_in_all_views_and_each_trial_has_a_board_of_its_own() -> None:
    rig, calibration = calibrated()
    assert rig.board is not None
    source = quiet(resimulation(rig, calibration))
    assert source.boards is not None
    source = replace(source, boards=replace(source.boards, printed_mm=np.array([0.1, 0.2, 0.0])))
    rng = np.random.default_rng(7)
    places = np.array(
        [in_the_board(source, calibration, drawn(source, rng).uv) for _ in range(DRAWS)]
    )
    offsets = places - rig.board.points[:, :2]
    alike = np.broadcast_to(offsets[:, :1], offsets.shape)
    assert offsets == pytest.approx(alike, abs=1e-6)
    chance = CHANCE * np.sqrt(2 / (DRAWS * len(rig.board.points)))
    spread = offsets[:, 0].reshape(-1, 2).std(axis=0)
    assert spread == pytest.approx([0.1, 0.2], rel=chance)


def test_a_boards_points_lie_out_of_its_plane_alike_in_all_views() -> None:
    rig, calibration = calibrated()
    source = quiet(resimulation(rig, calibration))
    assert source.boards is not None
    source = replace(source, boards=replace(source.boards, printed_mm=np.array([0.0, 0.0, 0.1])))
    uv = drawn(source, np.random.default_rng(8)).uv
    found = []
    for view, own in zip(calibration.residuals.views, uv, strict=True):
        base = calibration.camera.project(view.xyz)
        third = np.cross(view.xyz[1] - view.xyz[0], view.xyz[5] - view.xyz[0])
        motion = (calibration.camera.project(view.xyz + 1e-3 * normalised(third)) - base) / 1e-3
        found.append(np.sum((own - base) * motion, axis=-1) / np.sum(motion**2, axis=-1))
    spread = np.std(found[0])
    assert spread == pytest.approx(0.1, rel=CHANCE / np.sqrt(2 * 20))
    assert np.array(found) == pytest.approx(np.tile(found[0], (len(found), 1)), abs=1e-3)


def test_what_the_print_explains_is_not_drawn_a_second_time() -> None:
    """Points printed 0.1 mm off, which is 0.2 px: the scatter of all draws together is what the
    residuals have. It is a mean over independent trials, whose own scatter tells its error."""
    rng = np.random.default_rng(9)
    truth = board_rig(COARSE)
    poses = board_poses(truth, COARSE, 10, rng)
    placed = placed_boards(truth, COARSE, *poses, line_points=60)
    off = COARSE.points + 0.1 * rng.standard_normal(COARSE.points.shape)
    moved = off @ np.swapaxes(poses[0], 1, 2) + poses[1][:, None]
    views = photographed_boards(truth.camera, replace(placed, points=moved), rng, 0.1, 0.2)
    rig = rig_of(truth, views, "none")
    calibration = calibrate(rig)
    source = resimulation(rig, calibration)
    assert source.boards is not None
    assert source.boards.printed_mm == pytest.approx(np.full(3, 0.1), rel=0.7)
    # within: 2·20·10 coordinates less 60 for poses and 60 for places, known to 1/√560, 4.2 %
    assert source.boards.std == pytest.approx(np.full((10, 20), 0.1), rel=CHANCE * 0.042)
    still = drawn(quiet(source), rng).uv
    squares = [np.mean((drawn(source, rng).uv - still) ** 2) for _ in range(DRAWS)]
    chance = CHANCE * np.std(squares) / np.sqrt(DRAWS)
    # second order in 0.1 mm of 1000 mm is far below
    assert np.mean(squares) == pytest.approx(calibration.pixel_std**2, abs=chance)


def test_a_stated_tolerance_is_drawn_as_stated() -> None:
    rig, calibration = calibrated(replace(COARSE, tolerance_mm=0.05))
    source = resimulation(rig, calibration)
    assert source.boards is not None
    assert source.boards.printed_mm == pytest.approx(np.full(3, 0.05))


def test_an_uncertain_size_scales_the_board() -> None:
    rig, calibration = calibrated()
    assert rig.board is not None
    source = quiet(resimulation(rig, calibration))
    assert source.boards is not None
    grown = replace(source.boards, board=replace(COARSE, scale_std=0.01))
    source, rng = replace(source, boards=grown), np.random.default_rng(10)
    sizes = []
    for _ in range(DRAWS):
        places = in_the_board(source, calibration, drawn(source, rng).uv)
        ratio = places[:, 1:, :].max(axis=(1, 2)) / rig.board.points.max()
        assert ratio == pytest.approx(np.full(len(ratio), ratio[0]))
        sizes.append(ratio[0] - 1.0)
    assert np.std(sizes) == pytest.approx(0.01, rel=CHANCE / np.sqrt(2 * DRAWS))


def test_the_line_on_a_grown_body_lies_on_its_grown_faces_and_in_the_sheet() -> None:
    body = roof()
    rig, calibration = calibrated(body)
    source = quiet(resimulation(rig, calibration))
    assert source.boards is not None
    source = replace(source, boards=replace(source.boards, board=body))
    rng, sheet = np.random.default_rng(11), calibration.light_plane
    views = drawn(source, rng)
    points = calibration.triangulate(views.line.uv)
    # the size drawn, by the distance of two images' points: what face it is on then follows
    size = _drawn_size(source, calibration, views)
    assert abs(size) > 1e-3
    planes = faces(body, calibration)
    origin = [view.xyz[0] for view in calibration.residuals.views]
    for k, own in enumerate(views.line.groups()):
        view, face = int(views.line.view[own[0]]), int(views.line.face[own[0]])
        normal, _ = planes[view][face]
        above = points[own] @ normal
        assert np.ptp(above) == pytest.approx(0.0, abs=1e-6), k
        corner = body.points[body.face_points[face][0]] - body.points[0]
        turned = _turned(body, calibration, view) @ ((1.0 + size) * corner + size * body.points[0])
        assert above[0] == pytest.approx((origin[view] + turned) @ normal, abs=1e-6)
    assert points @ sheet.normal == pytest.approx(np.full(len(points), sheet.distance_mm))


def _turned(body: SolidTarget, calibration: Calibration, view: int) -> Array:
    """Rotation of a view, by least squares on what the calibration found."""
    found = calibration.residuals.views[view].xyz
    matrix = np.linalg.lstsq(body.points - body.points[0], found - found[0], rcond=None)[0]
    return matrix.T


def _drawn_size(source: Resimulation, calibration: Calibration, views: BoardViews) -> float:
    """The relative growth with which a drawn point is seen where it is."""
    view = calibration.residuals.views[0]
    body = source.rig.board
    assert isinstance(body, SolidTarget)
    arm = _turned(body, calibration, 0) @ body.points[-1]
    base, step = calibration.camera.project(view.xyz[-1:]), 1e-4
    shift = views.uv[0, -1] - base[0]
    size = 0.0
    for _ in range(5):  # Newton: perspective is not linear in the size
        now = calibration.camera.project((view.xyz[-1] + size * arm)[None])[0]
        more = calibration.camera.project((view.xyz[-1] + (size + step) * arm)[None])[0]
        slope = (more - now) / step
        size += float((base[0] + shift - now) @ slope / (slope @ slope))
    return size


def test_a_known_camera_is_drawn_from_its_own_covariance() -> None:
    rig, calibration = calibrated()
    names = ("camera.u0", "camera.alpha")
    matrix = np.array([[4.0, 1.0], [1.0, 9.0]])
    held = replace(rig, camera=calibration.camera, camera_covariance=Covariance(names, matrix, ()))
    source = resimulation(held, calibrate(held))
    rng, found = np.random.default_rng(12), []
    for _ in range(DRAWS):
        camera = source.drawn(rng).camera
        assert camera is not None
        found.append(camera.parameters - calibration.camera.parameters)
    spread = np.cov(np.transpose(found))
    where = [calibration.camera.PARAMETERS.index(name) for name in ("u0", "alpha")]
    assert spread[np.ix_(where, where)] == pytest.approx(
        matrix, abs=CHANCE * 9.0 * np.sqrt(2 / DRAWS)
    )
    spread[np.ix_(where, where)] = 0.0
    assert not spread.any()
    exact = replace(held, camera_covariance=None)
    assert resimulation(exact, calibrate(exact)).drawn(rng).camera is exact.camera


def test_what_was_not_seen_or_not_used_stays_away() -> None:
    rig, _ = calibrated()
    views = rig.observations.board
    uv = np.array(views.uv)
    uv[2, 7] = np.nan
    line_uv = np.array(views.line.uv)
    lost = np.flatnonzero(views.line.view == 3)
    line_uv[lost] += [60.0, -45.0]
    broken = replace(views, uv=uv, line=replace(views.line, uv=line_uv))
    rig = replace(rig, observations=replace(rig.observations, board=broken))
    calibration = calibrate(rig)
    kept = tuple(v for v in calibration.residuals.views if v.view != views.names[5])
    some = replace(calibration, residuals=replace(calibration.residuals, views=kept))
    seen = drawn(resimulation(rig, some), np.random.default_rng(0))
    assert views.names[5] not in seen.names
    assert not seen.seen[seen.names.index(views.names[2]), 7]
    assert seen.seen.sum() == 7 * 20 - 1
    lines = {seen.names[view] for view in seen.line.view}
    assert lines == set(views.names) - {views.names[3], views.names[5]}


def test_another_rigs_calibration_is_refused() -> None:
    rig, calibration = calibrated()
    other = replace(calibration, residuals=replace(calibration.residuals, views=()))
    with pytest.raises(InputError, match="no view of the rig"):
        resimulation(rig, other)
