"""How well the parameters of a calibration are known, and what that comes from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model.camera import Camera

PLANE_PARTS = ("nx", "ny", "nz", "d")
"""Parameters of a light plane, after its name and a dot."""

CURVATURE_PARTS = ("kxx", "kxy", "kyy")
"""Those that a curved sheet has beside them, 1/mm."""

SHEET_MAP_PARTS = ("a", "b", "c", "l1", "l2")
"""Parameters of a sheet map, after its name and a dot."""

_SHEET_PARTS = (*PLANE_PARTS, *CURVATURE_PARTS, *SHEET_MAP_PARTS)


@dataclass(frozen=True, eq=False)
class Source:
    """One independent cause of uncertainty.

    Parameters
    ----------
    name : str
        What it is: ``camera``, ``sheet`` and ``crossing`` (the noise of the image points in
        these stages), ``placement``, ``target length``, ``temperature``.
    matrix : (P, P) array
        Its share of the covariance.
    component : str, optional
        The noise component that it is proportional to; None where its size was stated.
    """

    name: str
    matrix: Array
    component: str | None = None


@dataclass(frozen=True, eq=False)
class NoiseComponents:
    """Sizes of the noise that were estimated from the residuals, and how well.

    Parameters
    ----------
    names : tuple of str
        ``pixel``: of the image coordinates; ``placement``: of the target's ends off the sheet;
        ``marker``: of single markers off the sheet.
    std : tuple of float
        Standard deviations: px for ``pixel``, mm for the others.
    relative_covariance : (K, K) array
        Covariance of the components' variances, over the product of these variances: 2/ν on the
        diagonal for a variance known from ν degrees of freedom.
    """

    names: tuple[str, ...] = ()
    std: tuple[float, ...] = ()
    relative_covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))

    def __post_init__(self) -> None:
        matrix = np.array(self.relative_covariance, dtype=float)
        size = len(self.names)
        if matrix.shape != (size, size) or len(self.std) != size or not np.isfinite(matrix).all():
            raise InputError(
                f"{size} noise components have {len(self.std)} standard deviations and a "
                f"covariance of shape {matrix.shape}",
                "give one of each, finite, for every component",
            )
        matrix.setflags(write=False)
        object.__setattr__(self, "relative_covariance", matrix)

    def degrees_of_freedom(self, variance: float, shares: Mapping[str, float]) -> float:
        """Effective degrees of freedom of a variance that is partly estimated.

        Satterthwaite, Biometrics Bulletin 2(6), 1946, with components that need not be
        independent: ``ν = 2 u⁴ / (cᵀ R c)`` (GUM, G.4.1, where R is diagonal).

        Parameters
        ----------
        variance : float
            The whole variance u².
        shares : mapping from component to float
            Its parts that are proportional to a component's variance.
        """
        parts = np.array([shares.get(name, 0.0) for name in self.names])
        spread = float(parts @ self.relative_covariance @ parts)
        return 2.0 * variance**2 / spread if spread > 0 else np.inf


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of named parameters.

    Parameters
    ----------
    parameters : tuple of str
        ``camera.alpha`` …, ``laser.nx``, ``laser.ny``, ``laser.nz``, ``laser.d`` (with the
        light plane's name in place of ``laser``), of a curved sheet ``laser.kxx``,
        ``laser.kxy``, ``laser.kyy`` too; px, mm, 1/mm.
    matrix : (P, P) array
    sources : tuple of Source
        Independent causes whose shares add up to `matrix`; empty where they are not known.
    components : NoiseComponents
        What was estimated of the noise; empty where all of it was stated.

    Raises
    ------
    InputError
        If a shape is wrong or a number not finite.
    """

    parameters: tuple[str, ...]
    matrix: Array
    sources: tuple[Source, ...] = ()
    components: NoiseComponents = field(default_factory=NoiseComponents)

    def __post_init__(self) -> None:
        matrix = np.array(self.matrix, dtype=float)
        size = len(self.parameters)
        for part in (matrix, *(source.matrix for source in self.sources)):
            if np.shape(part) != (size, size) or not np.isfinite(part).all():
                raise InputError(
                    f"the covariance of {size} parameters has shape {np.shape(part)} or is not "
                    "finite",
                    "give one finite row and column for each parameter",
                )
        matrix.setflags(write=False)
        object.__setattr__(self, "matrix", matrix)

    def std(self, parameter: str) -> float:
        """Standard uncertainty of one parameter; 0 where it was held fixed.

        Raises
        ------
        InputError
            If no calibration has a parameter of that name.
        """
        if parameter not in self.parameters:
            _refuse_unknown(parameter)
            return 0.0
        index = self.parameters.index(parameter)
        return float(np.sqrt(max(self.matrix[index, index], 0.0)))

    def parts(self) -> tuple[Source, ...]:
        """The sources, or the whole covariance as one where they are not known."""
        return self.sources or (Source("calibration", self.matrix),)

    def block(self, parameters: tuple[str, ...], matrix: Array | None = None) -> Array:
        """Covariance of the given parameters; zero rows for those that were held fixed.

        Parameters
        ----------
        parameters : tuple of str
        matrix : (P, P) array, optional
            A source's share, to take the block from it.
        """
        whole = self.matrix if matrix is None else matrix
        places = [(row, self.parameters.index(name)) for row, name in enumerate(parameters)
                  if name in self.parameters]  # fmt: skip
        block = np.zeros((len(parameters), len(parameters)))
        if places:
            here, there = np.array(places).T
            block[np.ix_(here, here)] = whole[np.ix_(there, there)]
        return block


def _refuse_unknown(parameter: str) -> None:
    owner, _, part = parameter.rpartition(".")
    known = Camera.PARAMETERS if owner == "camera" else _SHEET_PARTS
    if not owner or part not in known:
        raise InputError(
            f"there is no parameter '{parameter}'",
            "use camera.alpha … camera.k3, or a light plane's name with .nx, .ny, .nz, .d, or of "
            "a curved one .kxx, .kxy, .kyy",
        )
