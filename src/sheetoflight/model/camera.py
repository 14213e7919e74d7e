"""The camera: pinhole with skew and Brown's lens distortion."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sheetoflight.errors import InputError
from sheetoflight.geometry.directions import Array
from sheetoflight.model import lens

DISTORTION_MODELS: dict[str, tuple[str, ...]] = {
    "none": (),
    "radial1": ("k1",),
    "radial2": ("k1", "k2"),
    "brown": ("k1", "k2", "p1", "p2", "k3"),
}
"""Coefficients that each distortion model estimates."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera with lens distortion.

    With ``x = X/Z``, ``y = Y/Z``, ``r² = x² + y²`` and ``ρ = 1 + k1 r² + k2 r⁴ + k3 r⁶``::

        x' = ρ x + 2 p1 x y + p2 (r² + 2 x²)        u = alpha x' + gamma y' + u0
        y' = ρ y + p1 (r² + 2 y²) + 2 p2 x y        v = beta y' + v0

    The letters of K are the paper's (eq. 1); distortion is Brown, "Close-range camera
    calibration", Photogrammetric Engineering 37(8), 1971, in OpenCV's order and formula.

    Parameters
    ----------
    image_size : (int, int)
        Width and height in px.
    alpha, beta : float
        Focal length along u and v in px.
    u0, v0 : float
        Principal point in px; (0, 0) is the centre of the top-left pixel.
    gamma : float
        Skew of the image axes in px.
    distortion : (k1, k2, p1, p2, k3)

    Raises
    ------
    InputError
        If a parameter is not finite or a focal length is not positive.
    """

    image_size: tuple[int, int]
    alpha: float
    beta: float
    u0: float
    v0: float
    gamma: float = 0.0
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    PARAMETERS = ("alpha", "beta", "gamma", "u0", "v0", "k1", "k2", "p1", "p2", "k3")

    def __post_init__(self) -> None:
        coefficients = tuple(float(c) for c in self.distortion)
        if len(coefficients) != 5:
            raise InputError(
                f"the distortion has {len(coefficients)} coefficients, expected 5",
                "give [k1, k2, p1, p2, k3]",
            )
        object.__setattr__(self, "distortion", coefficients)
        object.__setattr__(self, "image_size", tuple(int(n) for n in self.image_size))
        if not np.isfinite(self.parameters).all():
            raise InputError(
                f"a camera parameter is not a finite number: {self.parameters.tolist()}",
                "give finite numbers for K and the distortion",
            )
        if self.alpha <= 0 or self.beta <= 0:
            raise InputError(
                f"the focal lengths are {self.alpha} and {self.beta} px", "both must be positive"
            )
        if len(self.image_size) != 2 or min(self.image_size) < 1:
            raise InputError(
                f"image_size is {list(self.image_size)}", "give [width, height] in pixels"
            )

    @classmethod
    def from_matrix(
        cls,
        image_size: tuple[int, int],
        matrix: Array,
        distortion: Iterable[float] = (0.0, 0.0, 0.0, 0.0, 0.0),
    ) -> Camera:
        """Camera from ``K = [[alpha, gamma, u0], [0, beta, v0], [0, 0, 1]]``."""
        k = np.asarray(matrix, dtype=float)
        if k.shape != (3, 3) or k[1, 0] != 0 or not np.array_equal(k[2], [0, 0, 1]):
            raise InputError(
                f"the camera matrix is {k.tolist()}",
                "expected [[alpha, gamma, u0], [0, beta, v0], [0, 0, 1]]",
            )
        return cls(
            image_size=image_size,
            alpha=float(k[0, 0]),
            beta=float(k[1, 1]),
            gamma=float(k[0, 1]),
            u0=float(k[0, 2]),
            v0=float(k[1, 2]),
            distortion=tuple(distortion),  # pyright: ignore[reportArgumentType] – checked above
        )

    @cached_property
    def parameters(self) -> Array:
        """All ten parameters in `PARAMETERS` order."""
        return np.array(
            [self.alpha, self.beta, self.gamma, self.u0, self.v0, *self.distortion], dtype=float
        )

    def with_parameters(self, values: Array) -> Camera:
        """The same picture size with all ten parameters replaced."""
        alpha, beta, gamma, u0, v0, k1, k2, p1, p2, k3 = np.asarray(values, dtype=float).tolist()
        return Camera(self.image_size, alpha, beta, u0, v0, gamma, (k1, k2, p1, p2, k3))

    @cached_property
    def matrix(self) -> Array:
        """Camera matrix K ``(3, 3)``."""
        return np.array(
            [[self.alpha, self.gamma, self.u0], [0.0, self.beta, self.v0], [0.0, 0.0, 1.0]]
        )

    @property
    def distorts(self) -> bool:
        """Whether any distortion coefficient differs from zero."""
        return any(self.distortion)

    def project(self, points: Array) -> Array:
        """Image points ``(..., 2)`` px of points ``(..., 3)`` mm in the camera frame.

        NaN for points that are not in front of the camera.
        """
        points = np.asarray(points, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse_z = np.where(points[..., 2] > 0, 1.0 / points[..., 2], np.nan)
        return self.pixels_of(points[..., :2] * inverse_z[..., None])

    def project_with_jacobians(
        self, points: Array, parameters: Sequence[int] = range(10)
    ) -> tuple[Array, Array, Array]:
        """`project`, and its derivatives.

        Parameters
        ----------
        points : (..., 3) array
            mm, camera frame.
        parameters : sequence of int
            Places in `PARAMETERS` of those to derive by; all ten by default.

        Returns
        -------
        uv : (..., 2) px
        by_point : (..., 2, 3) px per mm
        by_parameter : (..., 2, len(parameters)) px per unit of each parameter
        """
        points = np.asarray(points, dtype=float)
        with np.errstate(divide="ignore", invalid="ignore"):
            inverse_z = np.where(points[..., 2] > 0, 1.0 / points[..., 2], np.nan)
        x, y = points[..., 0] * inverse_z, points[..., 1] * inverse_z
        if self.distorts:
            bent = lens.distorted_with_jacobian(self.distortion, x, y)
        else:
            bent = lens.Bent(x, y, np.ones_like(x), np.zeros_like(x), np.ones_like(x))
        uv = np.empty((*x.shape, 2))
        uv[..., 0] = self.alpha * bent.x + self.gamma * bent.y + self.u0
        uv[..., 1] = self.beta * bent.y + self.v0

        by_point = np.empty((*x.shape, 2, 3))
        by_point[..., 0, 0] = (self.alpha * bent.xx + self.gamma * bent.xy) * inverse_z
        by_point[..., 0, 1] = (self.alpha * bent.xy + self.gamma * bent.yy) * inverse_z
        by_point[..., 1, 0] = self.beta * bent.xy * inverse_z
        by_point[..., 1, 1] = self.beta * bent.yy * inverse_z
        for row in (0, 1):
            by_point[..., row, 2] = -(x * by_point[..., row, 0] + y * by_point[..., row, 1])
        return uv, by_point, self._by_parameter(x, y, bent, parameters)

    def _by_parameter(
        self, x: Array, y: Array, bent: lens.Bent, parameters: Sequence[int]
    ) -> Array:
        """Derivatives ``(..., 2, len(parameters))`` of the image points by the parameters."""
        by_parameter = np.zeros((*x.shape, 2, len(parameters)))
        for column, index in enumerate(parameters):
            if index in _LINEAR_PARTS:
                row, source = _LINEAR_PARTS[index]
                by_parameter[..., row, column] = 1.0 if source is None else bent[source]
            else:
                across, down = lens.by_coefficient(index - 5, x, y)
                by_parameter[..., 0, column] = self.alpha * across + self.gamma * down
                by_parameter[..., 1, column] = self.beta * down
        return by_parameter

    def pixels_of(self, normal_xy: Array) -> Array:
        """Image points ``(..., 2)`` px of ideal normalised coordinates ``(..., 2)``."""
        distorted = self._distorted(normal_xy) if self.distorts else normal_xy
        return distorted @ self.matrix[:2, :2].T + self.matrix[:2, 2]

    def unproject(self, uv: Array) -> Array:
        """Rays ``(..., 3)`` with z = 1 through image points ``(..., 2)`` px.

        NaN where the distortion has no inverse: the point lies beyond the lens model's turning
        point, so no ray of the model's own branch reaches it.
        """
        pixels = np.asarray(uv, dtype=float)
        u, v = pixels[..., 0].ravel(), pixels[..., 1].ravel()
        rays = np.ones((u.size, 3))
        for start in range(0, u.size, lens.CHUNK):
            part = slice(start, start + lens.CHUNK)
            y = (v[part] - self.v0) / self.beta
            x = (u[part] - self.u0 - self.gamma * y) / self.alpha
            if self.distorts:
                x, y = lens.undistorted(self.distortion, x, y)
            rays[part, 0], rays[part, 1] = x, y
        return rays.reshape(*pixels.shape[:-1], 3)

    def unproject_with_jacobians(self, uv: Array) -> tuple[Array, Array, Array]:
        """`unproject`, and the derivatives of the rays' x and y.

        Returns
        -------
        rays : (..., 3)
        by_pixel : (..., 2, 2) per px
        by_parameter : (..., 2, 10)
            How the ray of a fixed pixel moves with each of `PARAMETERS`.
        """
        rays = self.unproject(uv)
        _, by_point, by_parameter = self.project_with_jacobians(rays)
        by_pixel = _inverse_2x2(by_point[..., :2])
        return rays, by_pixel, -by_pixel @ by_parameter

    def _distorted(self, normal_xy: Array) -> Array:
        x, y = normal_xy[..., 0], normal_xy[..., 1]
        return np.stack(lens.distorted(self.distortion, x, y), axis=-1)


_LINEAR_PARTS: dict[int, tuple[int, int | None]] = {
    0: (0, 0),  # alpha: u moves with x'
    1: (1, 1),  # beta: v with y'
    2: (0, 1),  # gamma: u with y'
    3: (0, None),  # u0
    4: (1, None),  # v0
}
"""Of each entry of K: the image coordinate that it moves, and the coordinate it multiplies."""


def _inverse_2x2(matrices: Array) -> Array:
    a, b = matrices[..., 0, 0], matrices[..., 0, 1]
    c, d = matrices[..., 1, 0], matrices[..., 1, 1]
    inverse = np.empty_like(matrices)
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / (a * d - b * c)
    inverse[..., 0, 0] = d * scale
    inverse[..., 0, 1] = -b * scale
    inverse[..., 1, 0] = -c * scale
    inverse[..., 1, 1] = a * scale
    return inverse
