"""Sheets from lines that the light draws on a plate moved by known steps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares

from sheetoflight.calibration.self_generated import self_generated_plane, sheet_of_stepped_lines
from sheetoflight.errors import InputError, UntrustworthyError
from tests.calibration.sheets import (
    DISTANCE,
    NORMAL,
    assert_exact,
    assert_noise_averages,
    common_line,
    light_on,
    project,
)

MIDDLE = np.array([20.0, 10.0, 520.0])
TRAVEL = np.array([-120.0, -70.0, 0.0, 40.0, 90.0, 150.0])


def unit(vector: np.ndarray) -> np.ndarray:
    return vector / np.linalg.norm(vector)


def plate(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """A plate's normal, and a direction of travel, both askew to everything."""
    rng = np.random.default_rng(seed)
    return unit(np.array([0.2, -0.5, 1.0]) + 0.3 * rng.normal(size=3)), unit(
        np.array([-0.3, 0.1, 1.0]) + 0.3 * rng.normal(size=3)
    )


def stepped(normal: np.ndarray, travel: np.ndarray, count: int = 10):
    """Image points of the lines on the plate, the stage's position of each, and the points."""
    points = np.concatenate(
        [light_on(normal, normal @ (MIDDLE + s * travel), MIDDLE, 50.0, count) for s in TRAVEL]
    )
    return project(points), np.repeat(TRAVEL, count), points


def spacing(normal: np.ndarray, travel: np.ndarray) -> float:
    """Distance between two of the lines in space, for one mm of travel."""
    first, along = common_line(normal, float(normal @ MIDDLE))
    second, _ = common_line(normal, float(normal @ (MIDDLE + 10.0 * travel)))
    return float(np.linalg.norm(np.cross(second - first, along))) / 10.0


@pytest.mark.parametrize("seed", range(8))
def test_exact_lines_with_their_spacing_give_the_exact_sheet(seed: int) -> None:
    normal, travel = plate(seed)
    xy, place, points = stepped(normal, travel)
    found = sheet_of_stepped_lines(xy, place, spacing(normal, travel))
    assert np.allclose(found.normal, NORMAL, rtol=0, atol=1e-9)
    assert found.distance == pytest.approx(DISTANCE, rel=1e-9)
    assert np.allclose(found.points, points, rtol=0, atol=1e-9 * 600)


def test_the_spacing_is_what_the_docstring_says() -> None:
    normal, travel = plate(3)
    slant = np.linalg.norm(np.cross(normal, NORMAL))
    assert spacing(normal, travel) == pytest.approx(abs(normal @ travel) / slant, rel=1e-9)
    in_sheet = unit(np.cross(np.cross(NORMAL, normal), NORMAL))  # across the lines
    assert spacing(normal, in_sheet) == pytest.approx(1.0, rel=1e-9)


def test_three_steps_are_enough_and_only_ratios_of_travel_enter_the_normal() -> None:
    normal, travel = plate(1)
    xy, place, _ = stepped(normal, travel, 2)
    some = np.isin(place, TRAVEL[[0, 2, 5]])
    found = sheet_of_stepped_lines(xy[some], 7.0 - 3.0 * place[some], 1.0)
    assert np.allclose(found.normal, NORMAL, rtol=0, atol=1e-9)


def test_another_sheet_can_look_the_same() -> None:
    """The same pictures of a plate tilted otherwise, and a sheet at 1.4 times the distance: no
    method can find the distance from the lines and their travels alone."""
    normal, travel = plate(2)
    c, q = float(normal @ MIDDLE), float(normal @ travel)
    across = normal - (normal @ NORMAL) * NORMAL
    far, near = q / DISTANCE, normal @ NORMAL - c / DISTANCE
    tilt, distance = 0.9, 1.4 * DISTANCE
    scale = np.linalg.norm(across) / np.sin(tilt)
    other = np.cos(tilt) * NORMAL + np.sin(tilt) * unit(across)
    other_c = distance * (np.cos(tilt) - near / scale)
    other_q = distance * far / scale
    assert abs(other_q) < 1.0  # some direction of travel does that
    xy, place, _ = stepped(normal, travel)
    for s in TRAVEL:
        point, along = common_line(other, other_c + s * other_q, NORMAL, distance)
        ends = project(np.array([point - 30.0 * along, point + 50.0 * along]))
        line = np.cross([*ends[0], 1.0], [*ends[1], 1.0])
        own = np.column_stack([xy[place == s], np.ones(10)])
        assert np.allclose(own @ line / np.linalg.norm(line[:2]), 0.0, atol=1e-12)
    slant = other_q / np.sin(tilt)
    assert sheet_of_stepped_lines(xy, place, abs(slant)).distance == pytest.approx(distance)


def test_noise_in_stepped_lines_averages_out() -> None:
    normal, travel = plate(4)
    known = spacing(normal, travel)
    xy, place, _ = stepped(normal, travel)

    def measured(repeats: int, rng: np.random.Generator):
        many = np.tile(xy, (repeats, 1))
        return sheet_of_stepped_lines(
            many + 2e-6 * rng.normal(size=many.shape), np.tile(place, repeats), known
        )

    assert_noise_averages(measured)


def best_normal(xy: np.ndarray, place: np.ndarray, start: np.ndarray) -> np.ndarray:
    """The normal of the lines nearest to the points in the image."""
    rays = np.column_stack([xy, np.ones(len(xy))])

    def distances(pencil: np.ndarray) -> np.ndarray:
        lines = 0.01 * place[:, None] * pencil[:3] - pencil[3:]
        return 1e3 * np.sum(lines * rays, axis=1) / np.linalg.norm(lines[:, :2], axis=1)

    fit = least_squares(distances, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    return unit(fit.x[:3]) * np.sign(fit.x[:3] @ NORMAL)


def test_noisy_lines_give_nearly_the_best_normal() -> None:
    """What the closed form loses is a small part of what noise costs the best fit."""
    lost, missed = [], []
    for seed in range(4):
        normal, travel = plate(seed)
        xy, place, _ = stepped(normal, travel)
        near = normal - normal @ MIDDLE / DISTANCE * NORMAL
        start = np.concatenate([100.0 * (normal @ travel) / DISTANCE * NORMAL, near])
        xy = xy + 3e-4 * np.random.default_rng(seed).normal(size=xy.shape)
        best = best_normal(xy, place, start)
        lost.append(sheet_of_stepped_lines(xy, place, 1.0).normal - best)
        missed.append(best - NORMAL)
    assert np.linalg.norm(lost) < 0.1 * np.linalg.norm(missed)


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_a_plate_that_moves_along_itself_gives_no_sheet(noise: float) -> None:
    normal, travel = plate(5)
    within = unit(np.cross(normal, travel))
    xy, place, _ = stepped(normal, within)
    xy = xy + noise * np.random.default_rng(6).normal(size=xy.shape)
    with pytest.raises(UntrustworthyError, match="does not move enough"):
        sheet_of_stepped_lines(xy, place, 1.0)


def test_two_places_of_the_stage_are_too_few() -> None:
    xy, place, _ = stepped(*plate(6))
    two = place < -60.0
    with pytest.raises(UntrustworthyError, match="2 places"):
        sheet_of_stepped_lines(xy[two], place[two], 1.0)


def test_travels_in_a_wrong_order_are_refused_or_miss() -> None:
    """Three lines fit any three travels: with these the infinite one runs between them."""
    xy, place, _ = stepped(*plate(7), 4)
    some = np.isin(place, TRAVEL[[0, 2, 5]])
    wrong = np.repeat([0.0, 100.0, 30.0], 4)
    with pytest.raises(UntrustworthyError, match="infinite travel"):
        sheet_of_stepped_lines(xy[some], wrong, 1.0)


@pytest.mark.parametrize("value", [0.0, -1.0, np.nan])
def test_a_spacing_must_be_above_zero(value: float) -> None:
    xy, place, _ = stepped(*plate(6))
    with pytest.raises(InputError, match="spacing"):
        sheet_of_stepped_lines(xy, place, value)


def grid(steps: int = 6) -> np.ndarray:
    """Ends of the line on a plate 80 mm wide, at every step."""
    y = np.linspace(-60.0, 60.0, steps)
    return np.array([[x, s] for s in y for x in (-40.0, 40.0)])


def in_space(flat: np.ndarray, turn: float = 0.7) -> np.ndarray:
    first = unit(np.cross(NORMAL, [np.sin(turn), np.cos(turn), 0.3]))
    return MIDDLE + flat[:, :1] * first + flat[:, 1:] * np.cross(NORMAL, first)


@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0, 4.0])
@pytest.mark.parametrize("mirrored", [False, True])
def test_points_of_known_places_give_the_exact_sheet(turn: float, mirrored: bool) -> None:
    flat = grid()
    points = in_space(flat, turn)
    given = flat * [1.0, -1.0] if mirrored else flat
    found = self_generated_plane(given, project(points))
    assert_exact(found)
    assert np.allclose(found.points, points, rtol=0, atol=1e-9 * 520)


def test_the_plane_is_that_of_opencvs_pose() -> None:
    flat = grid()
    xy = project(in_space(flat))
    board = np.column_stack([flat, np.zeros(len(flat))])
    _, turn, shift = cv2.solvePnP(board, xy, np.eye(3), np.zeros(0), flags=cv2.SOLVEPNP_IPPE)
    normal = cv2.Rodrigues(turn)[0][:, 2]
    found = self_generated_plane(flat, xy)
    assert abs(float(normal @ found.normal)) == pytest.approx(1.0, abs=1e-6)
    assert abs(float(normal @ shift[:, 0])) == pytest.approx(found.distance, rel=1e-5)


def test_noise_in_the_lines_ends_averages_out() -> None:
    flat = grid()
    xy = project(in_space(flat))

    def measured(repeats: int, rng: np.random.Generator):
        many = np.tile(xy, (repeats, 1))
        return self_generated_plane(
            np.tile(flat, (repeats, 1)), many + 5e-5 * rng.normal(size=many.shape)
        )

    assert_noise_averages(measured)


@pytest.mark.parametrize("change", [[[1.0, 0.0], [0.0, 0.9]], [[1.0, 0.0], [0.15, 1.0]]])
def test_coordinates_out_of_square_are_refused(change: list[list[float]]) -> None:
    """The stage travelled askew to the sheet, or to the line."""
    flat = grid()
    with pytest.raises(UntrustworthyError, match="out of square"):
        self_generated_plane(flat @ np.array(change), project(in_space(flat)))


def test_points_that_do_not_span_the_sheet_are_refused() -> None:
    flat = grid()
    xy = project(in_space(flat))
    for some in (slice(0, 3), slice(0, 12, 2)):
        with pytest.raises(UntrustworthyError, match="fewer than four"):
            self_generated_plane(flat[some], xy[some])
    with pytest.raises(InputError, match="shape"):
        self_generated_plane(flat[:4], xy)


def test_unseen_ends_are_left_out() -> None:
    flat = grid()
    xy = project(in_space(flat))
    xy[3] = np.nan
    found = self_generated_plane(flat, xy)
    assert_exact(found)
    assert np.isnan(found.points[3]).all()
