"""The older methods for boards: exact rigs, true uncertainties, refusals in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.calibration.board_screening import screened_boards
from sheetoflight.calibration.control_forms import FORMS
from sheetoflight.calibration.methods import METHODS, CalibrationOptions, calibrate
from sheetoflight.calibration.noise import noise_model
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.screening import Screened
from sheetoflight.errors import UntrustworthyError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.board import Board, SolidTarget
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.board_poses import board_poses, board_rig
from sheetoflight.simulation.board_views import (
    observed_boards,
    photographed_boards,
    placed_boards,
)
from sheetoflight.simulation.rig import SimulatedRig
from tests.calibration.boards import rig_of, seen_boards, without_lines
from tests.calibration.older_methods import BOOK, EACH, PINHOLE, assert_scatter_is_stated
from tests.second_opinions import rod_and_board


def assert_true(found: Calibration, truth: SimulatedRig) -> None:
    for plane, true in zip(found.light_planes, truth.light_planes, strict=True):
        assert np.allclose(plane.normal, true.normal, rtol=0, atol=1e-9)
        assert plane.distance_mm == pytest.approx(true.distance_mm, abs=1e-6)


def distance2(found: Calibration, truth: SimulatedRig) -> tuple[float, int]:
    """Squared Mahalanobis distance of all parameters, sheet and camera, from the truth, and its
    degrees of freedom: the sheet's four parts have three."""
    true = np.concatenate([truth.camera.parameters, plane_parts(truth.light_plane)])
    shift = np.concatenate([found.camera.parameters, plane_parts(found.light_plane)]) - true
    names = [f"camera.{name}" for name in found.camera.PARAMETERS]
    names += [f"laser.{part}" for part in ("nx", "ny", "nz", "d")]
    chosen = [names.index(name) for name in found.covariance.parameters]
    size = np.sqrt(np.diag(found.covariance.matrix))
    values, vectors = np.linalg.eigh(found.covariance.matrix / np.outer(size, size))
    free = values > 1e-9 * values[-1]
    along = vectors.T @ (shift[chosen] / size)
    return float(np.sum(along[free] ** 2 / values[free])), int(free.sum())


def plane_parts(plane: LightPlane) -> Array:
    return np.append(plane.normal, plane.distance_mm)


@EACH
def test_exact_pictures_give_the_exact_sheet(method: str, board: Board | None) -> None:
    truth, views = seen_boards(np.random.default_rng(3), 8, board=board)
    found = calibrate(rig_of(truth, views), method)
    assert found.method == method
    assert_true(found, truth)
    assert found.camera.parameters == pytest.approx(truth.camera.parameters, rel=1e-6, abs=1e-6)


@EACH
def test_stated_uncertainties_are_those_of_repeated_calibrations(
    method: str, board: Board | None
) -> None:
    """Camera and sheet together, their correlation among them."""
    squares, freedom = [], 0
    for seed in range(10):
        rng = np.random.default_rng([7, seed])
        truth, views = seen_boards(rng, 8, 0.05, 0.1, board, 60)
        square, freedom = distance2(calibrate(rig_of(truth, views), method), truth)
        squares.append(square)
    assert freedom == 6 + 3
    assert_scatter_is_stated(squares, freedom)


@EACH
def test_a_held_camera_brings_its_own_errors(method: str, board: Board | None) -> None:
    """Each trial holds a camera that is off as its covariance says."""
    squares, freedom = [], 0
    for seed in range(10):
        rng = np.random.default_rng([8, seed])
        truth, views = seen_boards(rng, 10, 0.05, 0.1, board, 60)
        camera = calibrate(rig_of(truth, without_lines(views)))
        assert truth.board is not None
        poses = board_poses(truth, truth.board, 6, rng)
        again = observed_boards(truth, truth.board, *poses, rng, 0.05, 0.1, 60)
        held = replace(
            rig_of(truth, again), camera=camera.camera, camera_covariance=camera.covariance
        )
        found = calibrate(held, method)
        assert found.camera == camera.camera
        assert "known camera" in {source.name for source in found.covariance.sources}
        square, freedom = distance2(found, truth)
        squares.append(square)
    assert freedom == 6 + 3
    assert_scatter_is_stated(squares, freedom)


def test_an_exact_camera_leaves_the_sheet_alone_uncertain() -> None:
    truth, views = seen_boards(np.random.default_rng(4), 4, 0.05, 0.05)
    found = calibrate(replace(rig_of(truth, views), camera=truth.camera), "planar-lines")
    assert found.covariance.parameters == ("laser.nx", "laser.ny", "laser.nz", "laser.d")
    free = calibrate(rig_of(truth, views), "planar-lines")
    assert found.covariance.std("laser.d") < free.covariance.std("laser.d")


@EACH
def test_the_boards_size_is_a_pure_scale(method: str, board: Board | None) -> None:
    truth, views = seen_boards(np.random.default_rng(5), 8, 0.05, 0.05, board)
    rig = rig_of(truth, views)
    assert rig.board is not None
    known, sized = (
        calibrate(replace(rig, board=replace(rig.board, scale_std=std)), method)
        for std in (0.0, 0.002)
    )
    grown = sized.covariance.std("laser.d") ** 2 - known.covariance.std("laser.d") ** 2
    assert np.sqrt(grown) == pytest.approx(0.002 * known.light_plane.distance_mm, rel=1e-6)
    assert sized.covariance.std("laser.nx") == pytest.approx(known.covariance.std("laser.nx"))


def outcome(rig: Rig, method: str) -> Outcome:
    found = Screened(rig, None, start=screened_boards(rig).state)
    return METHODS[method](found, noise_model(rig, found.start), CalibrationOptions())


@EACH
def test_a_misprinted_board_moves_the_sheet_as_it_is_said_to(
    method: str, board: Board | None
) -> None:
    """All points off at random by a little, in pictures without noise."""
    rng = np.random.default_rng(9)
    truth = board_rig(board, PINHOLE)
    assert truth.board is not None
    turns, shifts = board_poses(truth, truth.board, 8, rng)
    placed = placed_boards(truth, truth.board, turns, shifts, 60)
    off = 1e-3 * rng.normal(size=truth.board.points.shape)
    printed = replace(placed, points=placed.points + off @ np.swapaxes(turns, 1, 2))
    told = replace(truth.board, tolerance_mm=1.0)
    plain, moved = (
        outcome(replace(rig_of(truth, views, "none"), board=told), method)
        for views in (photographed_boards(truth.camera, seen, rng) for seen in (placed, printed))
    )
    stated = -np.einsum("pmk,mk->p", plain.influence.by_print, off)
    frame = plain.state.frames[0]
    camera = moved.state.camera.parameters - plain.state.camera.parameters
    shift = np.array([
        *camera[[0, 1, 3, 4]],
        *(frame[:, :2].T @ moved.state.frames[0][:, 2]),
        moved.state.distances[0] - plain.state.distances[0],
    ])  # fmt: skip
    assert len(stated) == len(shift)
    assert np.allclose(stated, shift, rtol=0.01, atol=0.002 * np.abs(shift)[[4, 5]].max())


def test_several_sheets_are_each_found() -> None:
    truth = board_rig(None, PINHOLE)
    other = LightPlane(np.array([0.6, 0.1, np.sqrt(1 - 0.37)]), 700.0, "second")
    truth = replace(truth, light_planes=(truth.light_plane, other))
    assert truth.board is not None
    rng = np.random.default_rng(6)
    held = [board_poses(truth, truth.board, 5, rng, laser=laser) for laser in (0, 1)]
    turns, shifts = (np.concatenate(parts) for parts in zip(*held, strict=True))
    exact = observed_boards(truth, truth.board, turns, shifts, rng)
    rig = replace(rig_of(truth, exact, "none"), lasers=("laser", "second"))
    for method in ("planar-lines", "cross-ratio"):
        assert_true(calibrate(rig, method), truth)
    noisy = observed_boards(truth, truth.board, turns, shifts, rng, 0.05, 0.05)
    both = calibrate(
        replace(rig, observations=Observations(board=noisy)), "planar-lines"
    ).covariance
    # the camera is common to both, so they are off together
    across = both.matrix[both.parameters.index("laser.d"), both.parameters.index("second.d")]
    assert abs(across) > 0.01 * both.std("laser.d") * both.std("second.d")


def test_rods_are_not_looked_at() -> None:
    _, rig = rod_and_board(0)
    alone = replace(rig, observations=Observations(board=rig.observations.board))
    one, other = (calibrate(each, "planar-lines") for each in (rig, alone))
    assert plane_parts(one.light_plane) == pytest.approx(plane_parts(other.light_plane), rel=1e-6)


def refused(rig: Rig, method: str) -> str:
    with pytest.raises(UntrustworthyError) as told:
        calibrate(rig, method)
    return str(told.value)


@pytest.mark.parametrize("method", FORMS)
def test_rigs_that_do_not_fit_are_refused_in_words(method: str) -> None:
    truth, views = seen_boards(np.random.default_rng(11), 8, 0.05, 0.05)
    rig = rig_of(truth, views)
    _, rods = rod_and_board(0)
    seen = replace(rods.observations, board=BoardViews())
    assert f"method {method} works on the line of light across boards" in refused(
        replace(rods, board=None, observations=seen), method
    )
    unlit = replace(rig, observations=Observations(board=without_lines(views)))
    assert "no board shows the line" in refused(unlit, method)
    second = refused(replace(rig, lasers=("laser", "blue")), method)
    assert "blue" in second


def test_targets_that_a_method_cannot_use_are_refused_in_words() -> None:
    truth, views = seen_boards(np.random.default_rng(12), 8, 0.05, 0.05)
    said = refused(rig_of(truth, views), "zigzag")
    assert "has no ridge" in said
    assert "--method planar-lines" in said
    scattered = BOOK.points[[0, 3, 12, 16, 24, 29, 36, 41, 48]]
    body = SolidTarget(scattered, [(0, 1, 2, 3), (5, 6, 7, 8)])
    truth, views = seen_boards(np.random.default_rng(13), 8, 0.05, 0.05, body)
    said = refused(rig_of(truth, views), "cross-ratio")
    assert "three known points on one straight line" in said


def test_too_few_spots_are_refused_in_words() -> None:
    truth, views = seen_boards(np.random.default_rng(3), 8, 0.05, 0.05, BOOK)
    known = replace(rig_of(truth, views), camera=truth.camera)
    for number in range(7):
        seen = views.take(np.arange(number, number + 2))
        said = refused(replace(known, observations=Observations(board=seen)), "zigzag")
        assert "at least 3 are needed" in said


def test_boards_in_one_plane_are_refused_in_words() -> None:
    """With a known camera one view gives a pose; its plane fits every sheet through the line."""
    truth, views = seen_boards(np.random.default_rng(14), 8, 0.05, 0.05)
    one = replace(rig_of(truth, views.take(np.arange(1))), camera=truth.camera)
    for method in ("planar-lines", "cross-ratio"):
        assert " – " in refused(one, method)
