"""What a trial of a Monte Carlo is asked: parameters and lengths, and what is stated of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sheetoflight.geometry.directions import Array
from sheetoflight.measurement.field_lengths import FieldSegment
from sheetoflight.measurement.length import coverage_factor, lengths
from sheetoflight.model.calibration import Calibration


@dataclass(frozen=True, eq=False)
class Results:
    """What a calibration says of Q quantities: parameters, then lengths.

    Parameters
    ----------
    values, std, factors : (Q,) arrays
        Values, their standard uncertainties, and half widths of their 95 % intervals in units
        of these.
    degrees_of_freedom : (Q,) array
        Effective ones of the standard uncertainties.
    """

    values: Array
    std: Array
    factors: Array
    degrees_of_freedom: Array


def results(calibration: Calibration, segments: Sequence[FieldSegment]) -> Results:
    """Parameters and lengths of a calibration with their stated uncertainties.

    The segments' ends are exact: what the lengths are uncertain by is the calibration's part.

    Raises
    ------
    InputError
        If an end does not lie on the sheet.
    """
    rows = [*_parameters(calibration), *_lengths(calibration, segments)]
    values, std, freedom = np.array(rows).T
    factors = np.array([coverage_factor(float(one)) for one in freedom])
    return Results(values, std, factors, freedom)


def _parameters(calibration: Calibration) -> list[tuple[float, float, float]]:
    covariance = calibration.covariance
    values = dict(
        zip(
            (f"camera.{name}" for name in calibration.camera.PARAMETERS),
            calibration.camera.parameters.tolist(),
            strict=True,
        )
    )
    for plane in calibration.light_planes:
        values |= plane.parameters
    rows = []
    for index, name in enumerate(covariance.parameters):
        shares: dict[str, float] = {}
        for source in covariance.sources:
            if source.component:
                part = float(source.matrix[index, index])
                shares[source.component] = shares.get(source.component, 0.0) + part
        std = covariance.std(name)
        freedom = covariance.components.degrees_of_freedom(std**2, shares)
        rows.append((values[name], std, freedom))
    return rows


def _lengths(
    calibration: Calibration, segments: Sequence[FieldSegment]
) -> list[tuple[float, float, float]]:
    rows: dict[int, tuple[float, float, float]] = {}
    for laser in dict.fromkeys(segment.laser for segment in segments):
        own = [i for i, segment in enumerate(segments) if segment.laser == laser]
        ends = np.array([segments[i].uv for i in own])
        names = tuple(segments[i].name for i in own)
        for i, one in zip(
            own, lengths(calibration, ends, np.zeros(len(own)), names, laser), strict=True
        ):
            rows[i] = (one.value, one.std, one.degrees_of_freedom)
    return [rows[i] for i in range(len(segments))]
