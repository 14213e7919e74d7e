"""Method self-generated: the sheet of a known camera from places that a stage tells."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.stats import chi2

from sheetoflight.calibration.methods import calibrate
from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.model.board import PlanarBoard
from sheetoflight.model.board_views import BoardViews, LinePixels
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.light_plane import LightPlane
from sheetoflight.model.observations import Observations
from sheetoflight.model.rig import Rig
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.stepped_plate import SteppedPlate, stepped_plate_views

TRUTH = paper_rig((-0.1, 0.05, 0.0, 0.0, 0.0))
PLATE = SteppedPlate()
PLANE = tuple(f"laser.{part}" for part in ("nx", "ny", "nz", "d"))
UNCERTAIN = ("alpha", "beta", "u0", "v0", "k1", "k2")


def known_camera() -> Covariance:
    """Of a camera as boards give it: alpha and beta nearly the same error."""
    std = np.array([2.0, 2.0, 3.0, 3.0, 0.004, 0.02])
    matrix = np.diag(std**2)
    matrix[0, 1] = matrix[1, 0] = 3.9
    return Covariance(tuple(f"camera.{name}" for name in UNCERTAIN), matrix)


def rig_with(views: BoardViews, truth: SimulatedRig = TRUTH, **known: object) -> Rig:
    given: dict[str, object] = {"camera": truth.camera, "pixel_std": 0.1} | known
    seen = Observations(board=views)
    return Rig(truth.target, truth.camera.image_size, observations=seen, **given)  # pyright: ignore[reportArgumentType]


def stepped(seed: int, pixel_std: float = 0.1, plate: SteppedPlate = PLATE) -> BoardViews:
    return stepped_plate_views(TRUTH, plate, np.random.default_rng(seed), pixel_std)


def found_from(views: BoardViews, **known: object) -> Calibration:
    return calibrate(rig_with(views, TRUTH, **known), "self-generated")


def with_line(views: BoardViews, **changed: object) -> BoardViews:
    return replace(views, line=replace(views.line, **changed))


def error(found: Calibration) -> np.ndarray:
    plane, true = found.light_plane, TRUTH.light_plane
    return np.append(plane.normal - true.normal, plane.distance_mm - true.distance_mm)


def square(found: Calibration) -> float:
    """The error's squared Mahalanobis distance: three numbers, the normal being of length 1."""
    inverse = np.linalg.pinv(found.covariance.block(PLANE), rcond=1e-12, hermitian=True)
    return float(error(found) @ inverse @ error(found))


def test_exact_points_give_the_exact_sheet() -> None:
    found = found_from(stepped(0, 0.0))
    assert np.allclose(error(found), 0.0, rtol=0, atol=1e-9)
    assert found.camera == TRUTH.camera
    assert found.method == "self-generated"
    assert found.residuals.rms_px < 1e-9
    assert found.warnings == ()
    truth = PLATE.points(TRUTH)
    assert np.allclose([view.xyz for view in found.residuals.views], truth, rtol=0, atol=1e-8)


def test_it_is_what_another_minimiser_finds() -> None:
    """Over the two angles of the normal, the distance, and the places' shift and turn in it."""
    views, camera = stepped(1), TRUTH.camera
    found = found_from(views)

    def residuals(x: np.ndarray, mirror: float) -> np.ndarray:
        normal = np.array([np.sin(x[0]) * np.cos(x[1]), np.sin(x[1]), np.cos(x[0]) * np.cos(x[1])])
        right = np.cross([0.0, 1.0, 0.0], normal)
        right /= np.linalg.norm(right)
        down = np.cross(normal, right)
        along = np.cos(x[5]) * right + np.sin(x[5]) * down
        ahead = mirror * (np.cos(x[5]) * down - np.sin(x[5]) * right)
        spots = x[2] * normal + x[3] * right + x[4] * down + views.line.places @ [along, ahead]
        return (camera.project(spots) - views.line.uv).ravel()

    n, best = TRUTH.light_plane.normal, None
    for mirror in (1.0, -1.0):
        for turn in np.arange(0.0, 6.2, 0.7):
            start = [np.arctan2(n[0], n[2]), np.arcsin(n[1]), 562.0, -700.0, 0.0, turn]
            scale = [0.01, 0.01, 1, 1, 1, 0.01]
            attempt = least_squares(residuals, start, x_scale=scale, args=(mirror,))
            if best is None or attempt.cost < best.cost:
                best = attempt
    assert best is not None
    x = best.x
    normal = [np.sin(x[0]) * np.cos(x[1]), np.sin(x[1]), np.cos(x[0]) * np.cos(x[1])]
    assert np.allclose(found.light_plane.normal, normal, rtol=0, atol=1e-6)
    assert found.light_plane.distance_mm == pytest.approx(x[2], abs=1e-3)
    squares = np.concatenate([view.residuals for view in found.residuals.views]) ** 2
    assert np.sum(squares) == pytest.approx(2 * best.cost, rel=1e-6)


@pytest.mark.parametrize("camera", ["exact", "uncertain"])
@pytest.mark.parametrize("noise", ["stated", "estimated"])
def test_stated_uncertainty_is_that_of_many_trials(camera: str, noise: str) -> None:
    """60 trials of three numbers leave the interval once in 5000 by chance. With 40 points the
    noise is estimated so well (74 numbers) that its own error hardly shows."""
    plate = replace(
        PLATE, edges_mm=(-100.0, -30.0, 30.0, 100.0), travel_mm=np.arange(-150, 151, 33)
    )
    known = known_camera() if camera == "uncertain" else None
    places = [TRUTH.camera.PARAMETERS.index(name) for name in UNCERTAIN]
    total, exact, trials = 0.0, 0.0, 60
    for seed in range(trials):
        held = TRUTH.camera
        if known:
            off = np.random.default_rng([7, seed]).multivariate_normal(np.zeros(6), known.matrix)
            values = held.parameters.copy()
            values[places] += off
            held = held.with_parameters(values)
        views = stepped(seed, 0.1, plate)
        rig = rig_with(views, camera=held, camera_covariance=known)
        rig = replace(rig, pixel_std=0.1 if noise == "stated" else None)
        total += square(calibrate(rig, "self-generated"))
        exact += square(calibrate(replace(rig, camera_covariance=None), "self-generated"))
    low, high = chi2.ppf([1e-4, 1 - 1e-4], 3 * trials)
    assert low < total < high
    if known:
        assert exact > 2 * high  # a camera that is not as exact as said


def test_noise_is_estimated_from_what_the_pose_leaves() -> None:
    """ν s² / σ² of 60 trials is chi-squared with 60 ν degrees of freedom."""
    total, freedom = 0.0, 0.0
    for seed in range(60):
        found = found_from(stepped(seed), pixel_std=None)
        ((relative,),) = found.covariance.components.relative_covariance
        freedom += 2.0 / relative
        total += 2.0 / relative * (found.pixel_std / 0.1) ** 2
    assert freedom == pytest.approx(60 * 14)  # ten points, less a pose
    low, high = chi2.ppf([1e-4, 1 - 1e-4], freedom)
    assert low < total < high


def test_a_camera_s_error_does_not_pass_for_noise() -> None:
    """k1 off by ten of what the pictures would tell bends the residuals; said, it is excused."""
    std = 0.05
    known = Covariance(("camera.k1",), np.array([[std**2]]))
    off = np.where(np.array(TRUTH.camera.PARAMETERS) == "k1", std, 0.0)
    held = TRUTH.camera.with_parameters(TRUTH.camera.parameters + off)
    views = stepped(3)
    excused = found_from(views, camera=held, camera_covariance=known)
    assert excused.warnings == ()
    assert excused.pixel_std == 0.1
    blamed = found_from(views, camera=held)
    assert any("times as large as the stated noise" in told for told in blamed.warnings)
    assert blamed.pixel_std > 0.15
    told = found_from(views, camera=held, camera_covariance=known, pixel_std=None)
    assert 0.05 < told.pixel_std < 0.15


def test_sources_add_up_and_the_camera_s_covariance_is_carried_on() -> None:
    known = known_camera()
    found = found_from(stepped(4), camera_covariance=known)
    covariance = found.covariance
    assert covariance.parameters == (*known.parameters, *PLANE)
    assert np.allclose(covariance.block(known.parameters), known.matrix)
    assert [source.name for source in covariance.sources] == ["board", "known camera"]
    assert np.allclose(sum(s.matrix for s in covariance.sources), covariance.matrix)


def test_the_order_of_points_and_the_origin_and_sense_of_places_do_not_matter() -> None:
    views = stepped(5)
    first = found_from(views)
    order = np.random.default_rng(5).permutation(len(views.line))
    moved = with_line(views, place=views.line.places * [-1.0, 1.0] + [700.0, -40.0])
    for other in (replace(views, line=views.line.take(order)), moved):
        found = found_from(other)
        assert np.allclose(error(found), error(first), rtol=0, atol=1e-6)
        assert np.allclose(found.covariance.matrix, first.covariance.matrix, rtol=1e-5, atol=1e-12)


def test_places_twice_as_large_are_a_sheet_twice_as_far() -> None:
    views = stepped(6)
    first = found_from(views)
    twice = found_from(with_line(views, place=2.0 * views.line.places))
    assert np.allclose(twice.light_plane.normal, first.light_plane.normal, rtol=0, atol=1e-8)
    assert twice.light_plane.distance_mm == pytest.approx(2 * first.light_plane.distance_mm)
    assert twice.covariance.std("laser.d") == pytest.approx(2 * first.covariance.std("laser.d"))


def test_a_point_s_std_is_its_weight() -> None:
    views = stepped(7)
    uv, std = views.line.uv.copy(), np.full(len(views.line), 0.1)
    uv[2] += [3.0, -2.0]
    std[2] = 100.0
    weighed = found_from(with_line(views, uv=uv, std=std), pixel_std=None)
    left = found_from(replace(views, line=views.line.take(np.arange(len(std)) != 2)))
    assert np.allclose(error(weighed), error(left), rtol=0, atol=1e-3)


def test_a_wrong_place_is_named() -> None:
    views = stepped(8)
    place = views.line.places.copy()
    place[3, 1] += 3.0
    found = found_from(with_line(views, place=place))
    u, v = views.line.uv[3]
    assert any("residuals are" in told and "stated noise" in told for told in found.warnings)
    doubt = f"the point at ({u:.6g}, {v:.6g}) of view step01 does not fit"
    assert any(told.startswith(doubt) for told in found.warnings)


def test_what_plays_no_part_is_told() -> None:
    views = stepped(9)
    place = views.line.places.copy()
    place[0] = np.nan
    found = found_from(with_line(views, place=place))
    assert found.warnings == ("not used: 1 of 10 points of the line, whose place is not known",)


REFUSED: dict[str, tuple[dict[str, object], str]] = {
    "no camera": ({"camera": None}, "needs a camera that is known.* --camera"),
    "two lasers": ({"lasers": ("a", "b")}, "one sheet, and the rig has 2 lasers – give each"),
    "a board": ({"board": PlanarBoard("chessboard", 4, 3, (9.0, 9.0))}, "has a .board. – leave"),
}


@pytest.mark.parametrize(("known", "message"), REFUSED.values(), ids=REFUSED)
def test_rigs_of_another_kind_are_refused(known: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message):
        found_from(stepped(10), **known)


def test_points_that_tell_no_sheet_are_refused() -> None:
    views = stepped(11)
    with pytest.raises(InputError, match="places in the sheet are known, and there are none"):
        found_from(with_line(views, place=None))
    with pytest.raises(InputError, match="and there are none – give rows of stage board"):
        found_from(BoardViews())
    for kept in (np.arange(3), np.arange(len(views.line)) % 2 == 0):  # three, and one edge
        with pytest.raises(UntrustworthyError, match="fewer than four, or lie on one line"):
            found_from(replace(views, line=views.line.take(kept)))
    with pytest.raises(UntrustworthyError, match="out of square by"):
        found_from(with_line(views, place=views.line.places * [1.0, 1.3]))
    uv = views.line.uv.copy()
    uv[4] = [1500.0, 20.0]
    with pytest.raises(
        InputError, match=r"view step02: a point of the line at .1500, 20. lies out"
    ):
        found_from(with_line(views, uv=uv))
    small = replace(PLATE, edges_mm=(-3.0, 3.0), travel_mm=(-3.0, 3.0))
    with pytest.raises(UntrustworthyError, match="fit two sheets, one the other's mirror image"):
        found_from(stepped(11, 0.5, small), pixel_std=0.5)


def test_a_sheet_that_is_known_too_badly_is_refused() -> None:
    """A camera that is known to 13 % alone tells neither its tilt nor its distance."""
    facing = replace(TRUTH, light_planes=(LightPlane(np.array([0.3, 0.0, 1.0]), 1000.0),))
    small = replace(PLATE, edges_mm=(-20.0, 20.0), travel_mm=(-20.0, 0.0, 20.0))
    views = stepped_plate_views(facing, small, np.random.default_rng(0), 0.1)
    known = Covariance(("camera.alpha",), np.array([[300.0**2]]))
    with pytest.raises(
        UntrustworthyError, match=r"leave the direction of the sheet uncertain by \d+%"
    ):
        found_from(views, camera_covariance=known)


def test_too_few_points_for_the_noise_are_refused_unless_it_is_stated() -> None:
    four = replace(PLATE, travel_mm=(-100.0, 100.0))
    views = stepped(12, 0.1, four)
    assert found_from(views).pixel_std == 0.1
    with pytest.raises(UntrustworthyError, match=r"too few points .* state pixel_std under"):
        found_from(views, pixel_std=None, camera_covariance=known_camera())


@pytest.mark.parametrize("method", ["joint", "two-step", "paper", "planar-lines", "zigzag"])
def test_other_methods_name_the_one_that_uses_places(method: str) -> None:
    with pytest.raises(InputError, match=r"places in the sheet.*--method self-generated with"):
        calibrate(rig_with(stepped(13)), method)


def test_places_are_checked() -> None:
    line = LinePixels(np.zeros((2, 2)), np.full(2, np.nan), *np.zeros((3, 2)))
    assert np.isnan(line.places).all()
    with pytest.raises(InputError, match=r"places of 2 points of a line have shape .3, 2."):
        replace(line, place=np.zeros((3, 2)))
    with pytest.raises(InputError, match="are infinite"):
        replace(line, place=np.full((2, 2), np.inf))
