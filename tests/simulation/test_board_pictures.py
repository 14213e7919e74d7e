"""Pictures of boards across the sheet, and of targets that cross it, with their truth."""

from __future__ import annotations

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from sheetoflight.errors import InputError
from sheetoflight.model.board import PlanarBoard, SolidTarget
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.picture import ViewOptions
from sheetoflight.simulation.render import RenderOptions
from sheetoflight.simulation.views import folder_truth, picture_tasks, render_task

BOARD = PlanarBoard("chessboard", 6, 5, (14.0, 12.0))
QUIET = ViewOptions(render=RenderOptions(noise=False))


@pytest.fixture
def rig(small_rig):
    return replace(small_rig, board=BOARD)


@pytest.fixture
def tasks(rig):
    return picture_tasks(rig, 0, 0, board_views=8, crossing_views=8, seed=5)


def of_stage(tasks, stage, laser=True):
    return [task for task in tasks if task.stage == stage and task.laser is laser]


def test_names_of_pairs_and_of_single_pictures(rig):
    pairs = picture_tasks(rig, 1, 0, board_views=1, crossing_views=1)
    assert [(t.stage, t.name, t.laser) for t in pairs] == [
        ("camera", "camera00", None),
        ("board", "board00_off", False),
        ("board", "board00_on", True),
        ("crossing", "crossing00_off", False),
        ("crossing", "crossing00_on", True),
    ]
    single = picture_tasks(
        rig, 1, 1, options=ViewOptions(pairs=False), board_views=1, crossing_views=1
    )
    assert [(t.name, t.laser) for t in single] == [
        ("camera00", None),
        ("plane00_off", False),
        ("plane00_on", True),
        ("board00", True),
        ("crossing00", True),
    ]


def test_truth_of_a_board_is_its_pose(rig, tasks):
    """The pose turns and shifts the board's points to those of the truth; OpenCV projects them to
    its image points."""
    for task in of_stage(tasks, "board"):
        pose = task.truth["camera_from_target"]
        turn, at = np.array(pose["rotation"]), np.array(pose["translation_mm"])
        uv, _ = cv2.projectPoints(
            BOARD.points, cv2.Rodrigues(turn)[0], at, rig.camera.matrix, np.zeros(5)
        )
        np.testing.assert_allclose(task.truth["points_uv"], uv[:, 0], atol=1e-9)
        np.testing.assert_allclose(task.truth["points_xyz"], BOARD.points @ turn.T + at)


def test_truth_of_a_board_holds_the_ends_of_its_line(rig, tasks):
    """On the sheet, and on the rim of the outline one pitch beyond the points."""
    sheet = rig.light_plane
    for task in of_stage(tasks, "board"):
        pose = task.truth["camera_from_target"]
        ends = np.array(task.truth["line_xyz"])
        np.testing.assert_allclose(ends @ sheet.normal, sheet.distance_mm, atol=1e-9)
        at = (ends - pose["translation_mm"]) @ np.array(pose["rotation"])
        np.testing.assert_allclose(at[:, 2], 0.0, atol=1e-9)
        to_rim = np.column_stack([at[:, 0] + 14, 84 - at[:, 0], at[:, 1] + 12, 60 - at[:, 1]])
        np.testing.assert_allclose(to_rim.min(axis=1), 0.0, atol=1e-9)


def test_whole_boards_are_in_the_picture(rig, tasks):
    size = np.array(rig.camera.image_size) - 1
    for task in of_stage(tasks, "board"):
        sheet = task.scene.surfaces[0]
        half = np.array([sheet.half_length, sheet.half_width])
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        uv = rig.camera.project(sheet.centre + (signs * half) @ sheet.axes)
        assert uv.min() > 0
        assert (size - uv).min() > 0


def test_spots_are_where_the_sheet_meets_bare_paper(rig, tasks):
    """On the sheet and on the straight line through the markers, between the first and the last,
    and a marker's whole size away from the middle of each."""
    sheet, size = rig.light_plane, rig.target.marker_size_mm
    for task in of_stage(tasks, "crossing"):
        (spot,) = np.array(task.truth["spots_xyz"])
        markers = np.array(task.truth["markers_xyz"])
        assert spot @ sheet.normal == pytest.approx(sheet.distance_mm)
        along = (markers[-1] - markers[0]) / rig.target.length_mm
        place = float((spot - markers[0]) @ along)
        np.testing.assert_allclose(markers[0] + place * along, spot, atol=1e-9)
        assert 0.0 < place < rig.target.length_mm
        assert np.abs(place - rig.target.positions).min() >= size - 1e-9
        np.testing.assert_array_equal(task.truth["spots_uv"], rig.camera.project(np.array([spot])))


def test_the_laser_shines_on_the_axis_at_the_spot_only(rig, tasks):
    """On minus off along the target's axis, from marker to marker: brightest within a pixel of
    the true spot, and dark 12 px from it."""
    for index in range(3):
        off, on = (
            render_task(replace(task, options=QUIET.lit("crossing"))).image.astype(float)
            for task in tasks
            if task.view == f"crossing{index:02d}"
        )
        truth = of_stage(tasks, "crossing")[index].truth
        first, *_, last = np.array(truth["markers_uv"])
        steps = int(2 * np.linalg.norm(last - first))
        axis = np.linspace(first, last, steps)
        u, v = np.rint(axis).astype(int).T
        added = (on - off)[v, u]
        away = np.linalg.norm(axis - truth["spots_uv"][0], axis=1)
        assert added.max() > 255 / 16
        assert away[added.argmax()] < 1.5
        assert added[away > 12.0].max() <= 1


def test_the_line_on_a_board_runs_from_end_to_end(rig, tasks):
    """On minus off along the true line: bright on some fields all along it. In the white border,
    beyond the outline and so beyond the line's ends, it still shines."""
    off, on = (
        render_task(replace(task, options=QUIET.lit("board"))).image.astype(float)
        for task in tasks
        if task.view == "board00"
    )
    first, last = np.array(of_stage(tasks, "board")[0].truth["line_uv"])
    line = np.linspace(first, last, 200)
    u, v = np.rint(line).astype(int).T
    added = (on - off)[v, u].reshape(4, 50)
    assert (added.max(axis=1) > 255 / 8).all()
    for end, out in ((first, first - last), (last, last - first)):
        u, v = np.rint(end + 1.5 * out / np.linalg.norm(out)).astype(int)
        assert (on - off)[v, u] > 255 / 16


def test_nothing_reaches_through_the_wall(rig):
    for task in picture_tasks(rig, 0, 0, board_views=20, crossing_views=20, seed=3):
        surface, wall = task.scene.surfaces
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        half = np.array([surface.half_length, surface.half_width])
        corners = surface.centre + (signs * half) @ surface.axes
        normal, distance = wall.plane
        assert (corners @ normal).max() < distance


def test_stages_do_not_depend_on_each_other(rig):
    few = {t.name: t for t in picture_tasks(rig, 1, 1, board_views=1, crossing_views=2, seed=5)}
    many = {t.name: t for t in picture_tasks(rig, 3, 2, board_views=4, crossing_views=3, seed=5)}
    for name, task in few.items():
        assert many[name].truth == task.truth
        assert many[name].key == task.key
    assert len({task.key for task in many.values()}) == len(many)


def test_the_board_is_told_with_the_truth(rig, tasks):
    truth = json.loads(json.dumps(folder_truth(rig, tasks)))
    assert truth["board"]["kind"] == "chessboard"
    assert truth["board"]["pitch_mm"] == [14.0, 12.0]
    assert {stage: len(views) for stage, views in truth["views"].items()} == {
        "board": 8,
        "crossing": 8,
    }
    assert "board" not in folder_truth(replace(rig, board=None), [])


@pytest.mark.parametrize("board", [None, SolidTarget(np.vstack([np.eye(3), -np.eye(3)]))])
def test_only_flat_boards_are_pictured(small_rig, board):
    with pytest.raises(InputError, match="give a flat board"):
        picture_tasks(replace(small_rig, board=board), 0, 0, board_views=1)


def test_a_charuco_board_without_codes_is_refused(small_rig):
    rig = replace(small_rig, board=PlanarBoard("charuco", 6, 5, (14.0, 14.0)))
    with pytest.raises(InputError, match="0 codes are given"):
        picture_tasks(rig, 0, 0, board_views=1)


def test_markers_too_close_for_a_spot_are_refused(rig):
    crowded = CollinearTarget((0.0, 40.0, 80.0), marker_size_mm=20.0)
    with pytest.raises(InputError, match="no bare paper"):
        picture_tasks(replace(rig, target=crowded), 0, 0, crossing_views=1)
