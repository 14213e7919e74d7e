"""The noise on the page: what was estimated, what was stated, and of what size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from sheetoflight.model.covariance import NoiseComponents
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.noise import ESTIMATED, STATED, NoiseRow, noise_origin, noise_rows
from tests.report.examples import NO_COVARIANCE, calibration_of_two_lasers, facing_calibration


def test_estimated_components_carry_their_size_and_how_well_it_is_known():
    """The root of a variance estimated from ν values scatters by 1 / √(2 ν) of itself."""
    rows = {row.name: row for row in noise_rows(calibration_of_two_lasers())}
    pixel = rows["pixel"]
    assert (float(pixel.size), pixel.unit, pixel.origin) == (0.1, "px", ESTIMATED)
    assert pixel.freedom == "200"
    assert float(pixel.std) == pytest.approx(0.1 / np.sqrt(2 * 200), rel=0.05)
    rng = np.random.default_rng(5)
    roots = 0.3 * np.sqrt(rng.chisquare(10, size=20_000) / 10)
    assert rows["placement"].freedom == "10"
    # A root of few values is a little narrower than the first-order rule says.
    assert float(rows["placement"].std) == pytest.approx(roots.std(), rel=0.05)


def test_what_the_rig_states_is_told_as_stated():
    calibration = calibration_of_two_lasers()
    stated = replace(calibration, covariance=without_components(calibration))
    rows = {row.name: row for row in noise_rows(stated)}
    assert rows["pixel"].origin == STATED
    assert float(rows["pixel"].size) == 0.1
    assert rows["placement"].origin == STATED
    assert "none found" in rows["marker"].origin
    assert rows["target length"].size == "0.02"
    assert float(rows["temperature"].size) == pytest.approx(11.5 * 0.5, rel=0.05)
    assert "4 ± 0.5 K" in rows["temperature"].meaning


def without_components(calibration):
    covariance = calibration.covariance
    sources = tuple(replace(source, component=None) for source in covariance.sources)
    return replace(covariance, sources=sources, components=NoiseComponents())


def placement_row(stated: object) -> NoiseRow:
    calibration = calibration_of_two_lasers(provenance={"stated_placement_std_mm": stated})
    free = replace(calibration, covariance=without_components(calibration))
    return {row.name: row for row in noise_rows(free)}["placement"]


def test_a_stated_placement_error_is_told_with_its_size():
    assert (placement_row(0.25).size, placement_row(0.25).origin) == ("0.25", STATED)
    assert (placement_row(0.0).size, placement_row(0.0).origin) == ("0", "stated as none")
    assert "show none" in placement_row(None).origin


@pytest.mark.parametrize("nonsense", [True, "0.25", -1.0, [0.25], float("inf")], ids=repr)
def test_a_provenance_that_holds_no_size_is_not_taken_for_one(nonsense: object):
    assert placement_row(nonsense).size == "–"


def test_the_estimate_goes_before_what_was_stated():
    calibration = calibration_of_two_lasers(provenance={"stated_placement_std_mm": None})
    rows = {row.name: row for row in noise_rows(calibration)}
    assert rows["placement"].origin == ESTIMATED
    assert float(rows["placement"].size) == pytest.approx(0.3, rel=0.05)


def test_a_file_that_does_not_say_is_not_interpreted():
    calibration = replace(calibration_of_two_lasers(), covariance=NO_COVARIANCE)
    assert "does not say" in noise_origin(calibration, "pixel")


def test_an_exact_target_is_told_as_exact():
    calibration = facing_calibration(2000.0)
    rows = {row.name: row for row in noise_rows(replace(calibration, target=CollinearTarget()))}
    assert set(rows) == {"pixel", "target length"}
    assert "exact" in rows["target length"].origin
