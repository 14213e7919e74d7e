"""What the uncertainty comes from: against dense algebra, re-solved calibrations, textbooks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import norm
from scipy.stats import t as student

from sheetoflight.calibration.adjustment import Adjustment
from sheetoflight.calibration.fit import Fit
from sheetoflight.calibration.methods import METHODS, CalibrationOptions, calibrate
from sheetoflight.calibration.noise import NoiseModel, noise_model
from sheetoflight.calibration.outcome import Outcome
from sheetoflight.calibration.rig_state import RigState
from sheetoflight.calibration.screening import Screened
from sheetoflight.estimation.block_least_squares import solve
from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.length import IMAGE_POINTS, Length, lengths
from sheetoflight.model.covariance import NoiseComponents
from sheetoflight.model.rig import Rig
from sheetoflight.model.target import CollinearTarget
from sheetoflight.simulation.poses import Recording, recorded, segments_in_sheet
from sheetoflight.simulation.rig import SimulatedRig, paper_rig

UNEVEN = (0.0, 100.0, 250.0, 400.0)
STEEL = CollinearTarget(
    UNEVEN,
    expansion_per_K=11.5e-6,
    warmer_by_K=4.0,
    warmer_by_std_K=1.5,
    expansion_std_per_K=1e-6,
)


def example(
    pixel_std: float = 0.1,
    placement_mm: float = 0.0,
    stated: bool = True,
    target: CollinearTarget | None = None,
) -> tuple[SimulatedRig, Rig]:
    truth = paper_rig(target=target or CollinearTarget(UNEVEN))
    recording = Recording(12, 8, 5, pixel_std, placement_mm)
    seen = recorded(truth, recording, np.random.default_rng(0))
    rig = Rig(
        truth.target,
        truth.camera.image_size,
        pixel_std=(pixel_std or 0.1) if stated else None,
        placement_std=placement_mm if stated else None,
        observations=seen,
    )
    return truth, rig


def outcome(rig: Rig, method: str = "joint") -> tuple[Outcome, NoiseModel]:
    noise = noise_model(rig)
    return METHODS[method](Screened(rig, None), noise, CalibrationOptions()), noise


def dense_covariance(fit: Fit) -> Array:
    """Of all shared parameters: every pose stays in, and the whole design is triangulated."""
    blocks = fit.noise.adjustment(
        fit.rig, fit.adjustment.stages, fit.adjustment.parameters, fit.state
    ).blocks(fit.state)
    size = fit.adjustment.shared_size
    shared = []
    for block in blocks:
        rows = np.zeros((block.residuals.size, size))
        rows[:, block.columns] = block.by_shared.reshape(-1, len(block.columns))
        shared.append(rows)
    parts = [part for block in blocks for part in block.by_local]
    own = np.zeros(np.sum([part.shape for part in parts], axis=0))
    row = column = 0
    for part in parts:
        own[row : row + len(part), column : column + part.shape[1]] = part
        row, column = row + len(part), column + part.shape[1]
    design = np.hstack([np.concatenate(shared), own])
    lengths_of_columns = np.linalg.norm(design, axis=0)
    triangle = np.linalg.qr(design / lengths_of_columns, mode="r")
    root = np.linalg.inv(triangle)[:size] / lengths_of_columns[:size, None]
    return root @ root.T


@pytest.mark.parametrize("placement_mm", [0.0, 0.3])
def test_the_sources_add_up_to_the_inverse_information(placement_mm: float) -> None:
    _, rig = example(placement_mm=placement_mm)
    found, _ = outcome(rig)
    whole = sum(part for _, _, part in found.influence.noise)
    (fit,) = found.fits
    chosen = fit.adjustment.columns_of(found.influence.names)
    expected = dense_covariance(fit)[np.ix_(chosen, chosen)]
    scale = np.sqrt(np.diag(expected))
    assert whole / np.outer(scale, scale) == pytest.approx(
        expected / np.outer(scale, scale), abs=1e-6
    )
    names = {name for name, _, _ in found.influence.noise}
    assert names == {"camera", "sheet", "crossing"} | ({"placement"} if placement_mm else set())


@pytest.mark.parametrize("method", ["joint", "two-step"])
def test_the_shares_of_a_calibration_add_up(method: str) -> None:
    target = replace(STEEL, tolerance_mm=0.05)
    _, rig = example(placement_mm=0.3, stated=False, target=target)
    covariance = calibrate(rig, method).covariance
    whole = sum(source.matrix for source in covariance.sources)
    assert np.allclose(whole, covariance.matrix, rtol=1e-9, atol=1e-15)
    for source in covariance.sources:
        values = np.linalg.eigvalsh(source.matrix)
        assert values[0] > -1e-9 * values[-1]
    assert {"target length", "temperature"} <= {source.name for source in covariance.sources}


def estimates(state: RigState, about: RigState, names: tuple[str, ...]) -> Array:
    """Shared parameters as steps from a state."""
    camera = state.camera.parameters - about.camera.parameters
    values = {f"camera.{n}": v for n, v in zip(state.camera.PARAMETERS, camera, strict=True)}
    values["sheet0.tilt1"], values["sheet0.tilt2"] = (
        about.frames[0][:, :2].T @ state.frames[0][:, 2]
    )
    values["sheet0.d"] = state.distances[0] - about.distances[0]
    return np.array([values[name] for name in names])


@pytest.mark.parametrize("marker", range(4))
def test_the_markers_influence_is_that_of_re_solved_calibrations(marker: int) -> None:
    """Central differences; marker 0 may move along the target while its other points pivot."""
    _, rig = example(0.0)
    found, noise = outcome(rig)
    (fit,) = found.fits
    stages, names = fit.adjustment.stages, found.influence.names
    std = {stage: noise.std(stage) for stage in stages}
    delta = 0.01
    sides = []
    for step in (delta, -delta):
        positions = rig.target.positions.copy()
        positions[marker] += step
        again = Adjustment(positions, stages, std, fit.adjustment.parameters)
        sides.append(estimates(solve(again, fit.state).state, fit.state, names))
    slope = (sides[0] - sides[1]) / (2.0 * delta)
    expected = found.influence.by_marker[:, marker]
    scale = np.sqrt(np.diag(sum(part for _, _, part in found.influence.noise)))
    assert expected / scale == pytest.approx(slope / scale, abs=1e-4 * np.abs(slope / scale).max())


@pytest.mark.parametrize("method", ["joint", "two-step"])
@pytest.mark.parametrize("marker", [1, 2, 3])
def test_the_methods_move_with_the_markers_as_they_say(method: str, marker: int) -> None:
    """From points without noise; a hundredth of a millimetre is too little to be screened."""
    _, rig = example(0.0)
    found, _ = outcome(rig, method)
    delta = 0.01
    sides = []
    for step in (delta, -delta):
        positions = np.array(UNEVEN)
        positions[marker] += step
        moved = replace(rig, target=CollinearTarget(tuple(positions)))
        state = outcome(moved, method)[0].state
        sides.append(estimates(state, found.state, found.influence.names))
    # the sheet's own directions are free: only its normal and distance are compared
    slope = (sides[0] - sides[1]) / (2.0 * delta)
    scale = np.sqrt(np.diag(sum(part for _, _, part in found.influence.noise)))
    expected = found.influence.by_marker[:, marker] / scale
    assert expected == pytest.approx(slope / scale, abs=2e-3 * np.abs(slope / scale).max())


def a_length(truth: SimulatedRig, rig: Rig, method: str = "joint") -> Length:
    ends = truth.camera.project(segments_in_sheet(truth, 300.0, 1, np.random.default_rng(5)))
    return lengths(calibrate(rig, method), ends, np.array([1e-9]))[0]


@pytest.mark.parametrize("method", ["joint", "two-step"])
def test_temperature_is_a_pure_scale(method: str) -> None:
    truth, rig = example(target=STEEL)
    found = calibrate(rig, method)
    (source,) = (s for s in found.covariance.sources if s.name == "temperature")
    std = np.sqrt(np.maximum(np.diag(source.matrix), 0.0))
    own = dict(zip(found.covariance.parameters, std, strict=True))
    expected = np.hypot(11.5e-6 * 1.5, 1e-6 * 4.0)
    assert own.pop("laser.d") == pytest.approx(found.light_plane.distance_mm * expected, rel=1e-3)
    for name, value in own.items():
        assert value < 1e-3 * found.covariance.std(name), name
    measured = a_length(truth, rig, method)
    assert dict(measured.budget)["temperature"] == pytest.approx(
        measured.value * expected, rel=1e-3
    )


def test_a_common_error_of_all_markers_is_a_scale() -> None:
    """``Σ s_i ∂/∂s_i``: the scale changes the sheet's distance in proportion, and nothing else."""
    _, rig = example(0.0)
    found, _ = outcome(rig)
    by_scale = found.influence.by_marker @ rig.target.positions
    scale = np.sqrt(np.diag(sum(part for _, _, part in found.influence.noise)))
    expected = np.zeros(len(by_scale))
    expected[found.influence.names.index("sheet0.d")] = found.state.distances[0]
    assert by_scale / scale == pytest.approx(
        expected / scale, abs=1e-6 * np.abs(expected / scale).max()
    )


# --- Degrees of freedom ---------------------------------------------------------------------------


def components(*freedoms: float) -> NoiseComponents:
    names = ("pixel", "placement")[: len(freedoms)]
    return NoiseComponents(names, (0.1,) * len(freedoms), np.diag([2.0 / f for f in freedoms]))


def test_effective_degrees_of_freedom_are_satterthwaites() -> None:
    """GUM, G.4.1: ν = u⁴ / Σ u_i⁴/ν_i."""
    one, two = components(40.0), components(40.0, 7.0)
    assert one.degrees_of_freedom(3.0, {"pixel": 3.0}) == pytest.approx(40.0)
    assert one.degrees_of_freedom(6.0, {"pixel": 3.0}) == pytest.approx(160.0)
    assert one.degrees_of_freedom(3.0, {}) == np.inf
    welch = 5.0**2 / (2.0**2 / 40.0 + 3.0**2 / 7.0)
    assert two.degrees_of_freedom(5.0, {"pixel": 2.0, "placement": 3.0}) == pytest.approx(welch)


def test_components_that_are_known_together_count_together() -> None:
    """Fully correlated, two parts are as one."""
    both = NoiseComponents(("pixel", "placement"), (0.1, 0.1), np.full((2, 2), 2.0 / 9.0))
    shares = {"pixel": 2.0, "placement": 3.0}
    assert both.degrees_of_freedom(5.0, shares) == pytest.approx(9.0)


def test_intervals_are_students_where_the_noise_was_estimated() -> None:
    truth, rig = example(stated=False)
    rig = replace(rig, placement_std=0.0)
    found = a_length(truth, rig)
    freedom = 2 * (12 * 4 + 8 * 4 + 5 * 5) - 12 * 2 - 8 * 3 - 5 * 5 - 4 - 3 - 3
    assert found.degrees_of_freedom == pytest.approx(freedom)
    low, high = found.interval
    assert high - low == pytest.approx(2.0 * student.ppf(0.975, freedom) * found.std)
    assert low + high == pytest.approx(2.0 * found.value)


def test_intervals_are_normal_where_the_noise_was_stated() -> None:
    truth, rig = example()
    found = a_length(truth, rig)
    assert found.degrees_of_freedom == np.inf
    low, high = found.interval
    assert high - low == pytest.approx(2.0 * norm.ppf(0.975) * found.std)


def test_a_stated_tolerance_has_no_scatter_of_its_own() -> None:
    """Beside a large stated part, the estimated part's degrees of freedom hardly matter."""
    exact, vague = (
        a_length(*example(stated=False, target=CollinearTarget(UNEVEN, tolerance_mm=tolerance)))
        for tolerance in (0.0, 1.0)
    )
    whole, own = vague.std**2, vague.std**2 - dict(vague.budget)["target length"] ** 2
    own -= dict(vague.budget)[IMAGE_POINTS] ** 2
    assert vague.degrees_of_freedom == pytest.approx(
        exact.degrees_of_freedom * (whole / own) ** 2, rel=1e-3
    )
