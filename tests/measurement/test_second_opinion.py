"""Rod and board, each solved alone: agreement by chance, a board of the wrong size, refusals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2, kstest

from sheetoflight.calibration.methods import calibrate
from sheetoflight.measurement.second_opinion import second_opinion
from sheetoflight.model.board_views import BoardViews
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.model.second_opinion import SecondOpinion
from sheetoflight.simulation.board_poses import SHEET_OF_PAPER, board_poses
from sheetoflight.simulation.board_views import observed_boards
from sheetoflight.simulation.poses import Recording, recorded
from tests.calibration.boards import without_lines
from tests.calibration.examples import two_lasers
from tests.second_opinions import rod_and_board

SEEDS = 20
NONE = np.arange(0)


def told(rig: Rig) -> SecondOpinion:
    found = second_opinion(rig, calibrate)
    assert found is not None
    return found


@pytest.fixture(scope="module")
def opinions() -> list[SecondOpinion]:
    return [told(rod_and_board(seed)[1]) for seed in range(SEEDS)]


def test_differences_are_as_large_as_is_said(opinions: list[SecondOpinion]) -> None:
    """Standard normal z of ten parameters and of the scale: each sum of 20 squares leaves these
    bounds with odds of 2e-5, one of eleven with 2e-4 – a little more, as the noise is estimated
    from some 300 degrees of freedom. Odds are uniform."""
    z = np.array([[one.z for one in found.parameters] for found in opinions])
    scales = [found.scale for found in opinions if found.scale]
    scale = np.array([one.relative / one.std for one in scales])
    squares = np.sum(np.column_stack([z, scale]) ** 2, axis=0)
    assert squares.shape == (11,)
    assert (squares > chi2.ppf(1e-5, SEEDS)).all()
    assert (squares < chi2.isf(1e-5, SEEDS)).all()
    assert {found.degrees_of_freedom for found in opinions} == {
        9
    }  # 6 of the camera, 3 of the sheet
    assert kstest([found.odds for found in opinions], "uniform").pvalue > 1e-3
    assert kstest([one.odds for one in scales], "uniform").pvalue > 1e-3
    assert kstest([one.rest_odds for one in scales], "uniform").pvalue > 1e-3


def test_millimetres_are_as_many_as_is_said(opinions: list[SecondOpinion]) -> None:
    """The mean of the squares, each a weighted sum of squared normals with mean 1, scatters no
    more than one squared normal: odds below 2e-4."""
    ratios = [sheet.rms_mm / sheet.std_mm for found in opinions for sheet in found.sheets]
    assert len(ratios) == SEEDS
    total = float(np.sum(np.square(ratios)))
    assert chi2.ppf(1e-4, SEEDS) < total < chi2.isf(1e-4, SEEDS)


def test_a_known_camera_is_compared_in_its_sheets_only() -> None:
    names = ("camera.alpha", "camera.beta", "camera.u0", "camera.v0")
    known = Covariance(names, np.diag([0.3, 0.3, 0.3, 0.3]) ** 2)
    truth, rig = rod_and_board(3, crossing_views=4)
    found = told(replace(rig, camera=truth.camera, camera_covariance=known))
    assert found.rod.determines == found.board.determines == ("laser",)
    assert {one.name.partition(".")[0] for one in found.parameters} == {"laser"}
    assert found.degrees_of_freedom == 3
    assert found.agrees  # odds of 2e-3 to be told otherwise


@pytest.mark.parametrize("size", [1.01, 0.995])
def test_a_board_of_the_wrong_size_is_named(size: float) -> None:
    """The ratio within five of its standard uncertainties."""
    found = told(rod_and_board(1, board_size=size)[1])
    assert found.scale is not None
    assert not found.agrees
    assert found.scale_only
    assert abs(found.scale.relative - (1.0 / size - 1.0)) < 5.0 * found.scale.std
    assert found.scale.std < 5e-4
    what = f"{abs(size - 1.0):.1%}"
    assert ("larger" if size > 1 else "smaller") in found.scale.in_words
    assert f"{abs(1.0 / (1.0 + found.scale.relative) - 1.0):.1%}" == what


def test_exact_pictures_agree() -> None:
    found = told(rod_and_board(2, noise=0.0)[1])
    assert found.agrees
    assert found.sheets[0].largest_mm < 1e-6


def test_one_kind_has_no_second_opinion() -> None:
    _, rig = rod_and_board(0)
    for seen in (
        replace(rig.observations, board=BoardViews()),
        Observations(board=rig.observations.board),
    ):
        assert second_opinion(replace(rig, observations=seen), calibrate) is None


def test_boards_without_lines_are_compared_by_their_camera() -> None:
    _, rig = rod_and_board(0)
    seen = rig.observations
    found = told(replace(rig, observations=replace(seen, board=without_lines(seen.board))))
    assert found.board.determines == ("camera",)
    assert found.board.refusal == ""
    assert {one.name.partition(".")[0] for one in found.parameters} == {"camera"}
    assert (found.sheets, found.scale) == ((), None)
    assert found.agrees


def test_a_rod_with_too_few_views_in_the_sheet_says_why() -> None:
    _, rig = rod_and_board(0)
    seen = rig.observations
    few = replace(seen, plane=seen.plane.take(np.arange(1)))
    found = told(replace(rig, observations=few))
    assert found.rod.determines == ("camera",)
    assert "1 usable position" in found.rod.refusal
    assert found.board.determines == ("camera", "laser")
    assert found.degrees_of_freedom == 6
    assert any("1 usable position" in sentence for sentence in found.verdict)


def test_a_rod_that_determines_no_camera_leaves_nothing_to_compare() -> None:
    _, rig = rod_and_board(0)
    every = rig.observations
    seen = replace(every, camera=every.camera.take(NONE), plane=every.plane.take(np.arange(1)))
    found = told(replace(rig, observations=seen))
    assert found.rod.determines == ()
    assert found.rod.refusal
    assert not found.compared
    assert "nothing in common" in found.verdict[0]


@pytest.mark.parametrize("lit", [0, 1])
def test_each_laser_is_compared_that_both_saw(lit: int) -> None:
    """Two sheets, the boards in one of them, in the first or the second."""
    rng = np.random.default_rng(5)
    truth = two_lasers()
    poses = board_poses(truth, SHEET_OF_PAPER, 10, rng, laser=lit)
    shines = np.tile(np.arange(2) == lit, (10, 1))
    boards = observed_boards(truth, SHEET_OF_PAPER, *poses, rng, 0.1, 0.1, 100, shines)
    rod = recorded(truth, Recording(30, 8, 6, 0.1), rng)
    rig = Rig(
        truth.target,
        truth.camera.image_size,
        "brown",
        lasers=("left", "right"),
        board=SHEET_OF_PAPER,
        observations=replace(rod, board=boards),
    )
    found = told(rig)
    assert found.rod.determines == ("camera", "left", "right")
    assert found.board.determines == ("camera", rig.lasers[lit])
    assert [sheet.laser for sheet in found.sheets] == [rig.lasers[lit]]
    assert found.degrees_of_freedom == 9 + 3
    assert found.agrees  # odds of 2e-3 to be told otherwise
