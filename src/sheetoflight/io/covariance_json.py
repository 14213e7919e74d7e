"""The table ``covariance`` of ``calibration.json``: how well the parameters are known, and why."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.io.calibration_schema import CovariancePart, NoisePart, SourcePart
from sheetoflight.io.quoting import one_line, shown
from sheetoflight.model.covariance import Covariance, NoiseComponents, Source

TOLERANCE = 1e-6
"""How far, on the scale of correlations, a covariance may lie from symmetric, from positive
semi-definite and from the sum of its sources: an ill-conditioned inverse is no better."""

_DAMAGED = "the file is damaged: calibrate again"


def covariance_document(covariance: Covariance) -> dict[str, Any]:
    """A covariance as ``calibration.json`` holds it; what is not known of it is left out."""
    components = covariance.components
    document: dict[str, Any] = {
        "parameters": covariance.parameters,
        "matrix": covariance.matrix,
    }
    if covariance.sources:
        document["sources"] = [
            {"name": source.name, "component": source.component, "matrix": source.matrix}
            for source in covariance.sources
        ]
    if components.names:
        document["noise"] = {
            "components": components.names,
            "std": components.std,
            "relative_covariance": components.relative_covariance,
        }
    return document


@np.errstate(over="ignore")  # differences of huge numbers are infinite, and refused
def covariance_from(part: CovariancePart) -> Covariance:
    """The covariance that a file holds.

    Raises
    ------
    InputError
        If a matrix has another shape than its names say, is not symmetric or not positive
        semi-definite, or the sources do not add up to the whole; the key is named.
    """
    names = part.parameters
    _refuse_twice(names, "covariance.parameters")
    matrix = _checked(part.matrix, names, "covariance.matrix")
    noise = _noise(part.noise)
    sources = tuple(
        _source(source, f"covariance.sources[{i}]", matrix, names, noise)
        for i, source in enumerate(part.sources)
    )
    if sources:
        _check_sum(sources, matrix, names)
    return Covariance(tuple(names), matrix, sources, noise)


def _noise(part: NoisePart) -> NoiseComponents:
    names = part.components
    _refuse_twice(names, "covariance.noise.components")
    if len(part.std) != len(names):
        raise InputError(
            f"covariance.noise.std has {len(part.std)} entries for {len(names)} components",
            "give one standard deviation for each component",
        )
    relative = _checked(part.relative_covariance, names, "covariance.noise.relative_covariance")
    return NoiseComponents(tuple(names), tuple(part.std), relative)


def _source(
    part: SourcePart, key: str, whole: Array, names: list[str], noise: NoiseComponents
) -> Source:
    if part.component is not None and part.component not in noise.names:
        raise InputError(
            f"{key}.component is {shown(part.component)}, which covariance.noise does not name",
            "name it there, or give null where its size was stated",
        )
    share = _checked(part.matrix, names, f"{key}.matrix", whole)
    return Source(part.name, share, part.component)


def _check_sum(sources: Sequence[Source], whole: Array, names: list[str]) -> None:
    total = np.sum([source.matrix for source in sources], axis=0)
    excess = np.abs(total - whole) > TOLERANCE * _scale(whole)
    if excess.any():
        row, column = np.argwhere(excess)[0]
        raise InputError(
            f"covariance.sources do not add up to covariance.matrix: for {one_line(names[row])} "
            f"and {one_line(names[column])} they give {total[row, column]:.9g}, the matrix "
            f"{whole[row, column]:.9g}",
            _DAMAGED,
        )


def _checked(
    rows: Sequence[Sequence[float]], names: list[str], key: str, whole: Array | None = None
) -> Array:
    """The rows as a covariance of the named quantities, on its own scale or that of a whole.

    A covariance is symmetric, and no combination of quantities has a negative variance. A share
    of a whole may miss that by a rounding error of the whole.
    """
    size = len(names)
    if len(rows) != size or any(len(row) != size for row in rows):
        raise InputError(
            f"{key} does not have {size} rows of {size} numbers",
            "give one row and column for each name",
        )
    matrix = np.array(rows, dtype=float).reshape(size, size)
    _refuse_negative(matrix, names, key, whole)
    scale = _scale(matrix if whole is None else whole)
    _refuse_asymmetric(matrix, scale, key)
    larger = (np.abs(matrix) - scale > TOLERANCE * scale).any()
    if larger and whole is not None:
        raise InputError(f"{key} is larger than covariance.matrix, which it is part of", _DAMAGED)
    if larger or not _positive(matrix, scale):
        raise InputError(
            f"{key} is not positive semi-definite: some combination has a negative variance",
            _DAMAGED,
        )
    return matrix


def _positive(matrix: Array, scale: Array) -> bool:
    """Whether the matrix is positive semi-definite to within rounding on a scale."""
    correlation = np.divide(matrix, scale, out=np.zeros_like(matrix), where=scale > 0)
    return bool(np.linalg.eigvalsh(correlation).min(initial=0.0) >= -TOLERANCE)


def _refuse_asymmetric(matrix: Array, scale: Array, key: str) -> None:
    excess = np.abs(matrix - matrix.T) > TOLERANCE * scale
    if excess.any():
        row, column = np.argwhere(excess)[0]
        raise InputError(
            f"{key} is not symmetric: [{row}][{column}] is {matrix[row, column]:.9g}, "
            f"[{column}][{row}] is {matrix[column, row]:.9g}",
            _DAMAGED,
        )


def _refuse_negative(matrix: Array, names: list[str], key: str, whole: Array | None) -> None:
    variances = np.diag(matrix)
    lowest = 0.0 if whole is None else -TOLERANCE * np.diag(whole)
    negative = np.flatnonzero(variances < lowest)
    if negative.size:
        index = negative[0]
        raise InputError(
            f"{key}[{index}][{index}], the variance of {one_line(names[index])}, "
            f"is {variances[index]:.6g}",
            f"a variance is 0 or more: {_DAMAGED}",
        )


def _scale(whole: Array) -> Array:
    """What a correlation of 1 would be, ``(P, P)``."""
    std = np.sqrt(np.diag(whole))
    return np.outer(std, std)


def _refuse_twice(names: list[str], key: str) -> None:
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"{key} names {shown(twice)} twice", "name every one once")
