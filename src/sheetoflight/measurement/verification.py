"""Measured lengths against known ones: verdict, and statistics that know what lengths share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from sheetoflight.errors import InputError, UntrustworthyError
from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.measurement.comparison import (
    Comparison,
    KnownLength,
    MeasuredSegment,
    PermissibleError,
)
from sheetoflight.measurement.error_statistics import ErrorStatistics, error_statistics
from sheetoflight.measurement.triangulation import parameter_names, triangulate_with_jacobians
from sheetoflight.model.calibration import AnyCalibration


@dataclass(frozen=True, eq=False)
class Verification:
    """What comparing measured with known lengths gave.

    Parameters
    ----------
    comparisons : tuple of Comparison
        The segments whose length is known.
    not_judged : tuple of MeasuredSegment
        The others.
    limit : PermissibleError, optional
    statistics : ErrorStatistics
    image_size : (int, int)
        Width and height of the picture that the segments lie in, px.
    warnings : tuple of str
        What a careful user should know before trusting the verdict.
    provenance : mapping
        What was compared: files and versions.
    """

    comparisons: tuple[Comparison, ...]
    not_judged: tuple[MeasuredSegment, ...]
    limit: PermissibleError | None
    statistics: ErrorStatistics
    image_size: tuple[int, int]
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[Comparison, ...]:
        """The comparisons that do not pass."""
        return tuple(one for one in self.comparisons if not one.passed)

    @property
    def passed(self) -> bool:
        """Whether every comparison passes."""
        return not self.failed

    @property
    def explained(self) -> int:
        """Number of comparisons whose error the stated uncertainties explain."""
        return sum(one.explained for one in self.comparisons)

    @property
    def findings(self) -> tuple[str, ...]:
        """What stands out, in sentences."""
        odd = self.statistics.odd_one
        if odd is None:
            return self.statistics.findings
        name = self.comparisons[odd].segment.name
        return (
            f"Segment {name} does not agree with the others: its error is "
            f"{abs(self.statistics.disagreement[odd]):.1f} standard deviations from what they let "
            "expect. Check its ends and its known length.",
            *self.statistics.findings,
        )

    @property
    def worst(self) -> Comparison:
        """The comparison whose error is the largest share of what is allowed."""
        return max(self.comparisons, key=lambda one: one.severity or 0.0)


def verify_lengths(
    calibration: AnyCalibration,
    segments: Sequence[MeasuredSegment],
    known: Mapping[str, KnownLength],
    limit: PermissibleError | None = None,
) -> Verification:
    """Compare measured segments with known lengths.

    Parameters
    ----------
    calibration : Calibration
        What the segments were measured with.
    segments : sequence of MeasuredSegment
    known : mapping from segment to KnownLength
        Segments without a known length are listed and not judged.
    limit : PermissibleError, optional
        Without one, a segment passes where the error lies within its expanded uncertainty.

    Raises
    ------
    InputError
        If no segment has a known length.
    UntrustworthyError
        If there is neither a limit nor an uncertainty to judge a segment by.
    """
    judged = [one for one in segments if one.name in known]
    if not judged:
        raise InputError(
            f"none of the {len(segments)} segments has a known length",
            "give --known, or a column known_mm in segments.csv",
        )
    comparisons = tuple(
        Comparison(one, known[one.name], limit.at(known[one.name].value) if limit else None)
        for one in judged
    )
    for one in comparisons:
        if one.severity is None:
            raise UntrustworthyError(
                "verify",
                f"neither the measured nor the known length of segment '{one.segment.name}' has "
                "an uncertainty to judge its error by",
                "give a maximum permissible error, or known_std_mm",
            )
    lengths = [one.known for one in comparisons]
    covariance = length_covariance(calibration, judged) + known_covariance(lengths)
    return Verification(
        comparisons,
        tuple(one for one in segments if one.name not in known),
        limit,
        error_statistics(
            np.array([one.error for one in comparisons]),
            np.array([one.value for one in lengths]),
            covariance,
        ),
        calibration.image_size,
    )


def length_covariance(calibration: AnyCalibration, segments: Sequence[MeasuredSegment]) -> Array:
    """Covariance ``(N, N)`` of measured lengths, mm².

    The calibration's error is in all of them, ``J C Jᵀ``; what else makes up a length's variance
    is its own.

    Raises
    ------
    InputError
        If the calibration has no laser of a segment's name, or several and none is named.
    """
    every = (parameter_names(calibration.sheet(laser)) for laser in calibration.lasers)
    names = tuple(dict.fromkeys(name for names in every for name in names))
    by_parameter = np.zeros((len(segments), len(names)))
    for row, segment in zip(by_parameter, segments, strict=True):
        own = parameter_names(calibration.sheet(segment.laser))
        row[[names.index(name) for name in own]] = _by_parameter(calibration, segment)
    shared = by_parameter @ calibration.covariance.block(names) @ by_parameter.T
    variances = np.array([segment.length.std**2 for segment in segments])
    return shared + np.diag(np.maximum(variances - np.diag(shared), 0.0))


def _by_parameter(calibration: AnyCalibration, segment: MeasuredSegment) -> Array:
    """Derivatives of a length by the parameters of camera and sheet."""
    points = triangulate_with_jacobians(calibration, segment.ends, segment.laser)
    direction = normalised(points.xyz[1] - points.xyz[0])
    return direction @ (points.by_parameter[1] - points.by_parameter[0])


def known_covariance(known: Sequence[KnownLength]) -> Array:
    """Covariance ``(N, N)`` of known lengths, mm².

    Equal lengths with equal uncertainties are one artefact in several positions: its error is
    the same in all of them.
    """
    std = np.array([one.std for one in known])
    same = np.array([[one == other for other in known] for one in known])
    return same * np.outer(std, std)
