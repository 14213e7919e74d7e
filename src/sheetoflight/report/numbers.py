"""The calibration's numbers as text, rounded to what their uncertainty allows."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sheetoflight.geometry.directions import Array, normalised
from sheetoflight.measurement.triangulation import triangulate
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import CURVATURE_PARTS, Covariance
from sheetoflight.model.light_plane import LightPlane

_MOST_DECIMALS = 9
_USUAL_SPREADS = 4.0
NO_UNCERTAINTY = "not given"

_CAMERA_MEANING = {
    "alpha": ("α", "focal length along u", "px"),
    "beta": ("β", "focal length along v", "px"),
    "gamma": ("γ", "skew of the image axes", "px"),
    "u0": ("u0", "principal point", "px"),
    "v0": ("v0", "principal point", "px"),
    "k1": ("k1", "radial distortion", ""),
    "k2": ("k2", "radial distortion", ""),
    "p1": ("p1", "tangential distortion", ""),
    "p2": ("p2", "tangential distortion", ""),
    "k3": ("k3", "radial distortion", ""),
}


@dataclass(frozen=True)
class Quantity:
    """One number of the report as text: symbol, meaning, value, standard uncertainty, unit."""

    symbol: str
    meaning: str
    value: str
    std: str
    unit: str = ""


def rounded(value: float, std: float) -> tuple[str, str]:
    """A value and its standard uncertainty, both to the uncertainty's second digit.

    Examples
    --------
    >>> rounded(2298.7113, 1.2345)
    ('2298.7', '1.2')
    >>> rounded(450.0, 0.0)
    ('450', '0')
    """
    if not (math.isfinite(std) and std > 0):
        return f"{value:.7g}", f"{std:g}"
    places = decimals(std)
    return f"{value:.{places}f}", f"{std:.{places}f}"


def decimals(std: float) -> int:
    """Decimal places that show a standard uncertainty to its second digit; 0 where it is 0."""
    if not (math.isfinite(std) and std > 0):
        return 0
    return min(max(1 - math.floor(math.log10(std)), 0), _MOST_DECIMALS)


def two_digits(std: float) -> str:
    """A standard uncertainty to its second digit."""
    return rounded(std, std)[1]


def parameter_unit(name: str) -> str:
    """Unit of a parameter of a covariance, "" where it is one."""
    owner, _, part = name.rpartition(".")
    if owner == "camera":
        return _CAMERA_MEANING[part][2] if part in _CAMERA_MEANING else ""
    return "mm" if part == "d" else "1/mm" if part in CURVATURE_PARTS else ""


def camera_quantities(calibration: Calibration) -> tuple[Quantity, ...]:
    """The ten camera parameters with their standard uncertainties."""
    covariance = calibration.covariance
    values = zip(calibration.camera.PARAMETERS, calibration.camera.parameters, strict=True)
    rows = []
    for name, value in values:
        symbol, meaning, unit = _CAMERA_MEANING[name]
        text, std = _with_std(covariance, f"camera.{name}", float(value))
        rows.append(Quantity(symbol, meaning, text, std, unit))
    return tuple(rows)


def plane_quantities(calibration: Calibration, plane: LightPlane) -> tuple[Quantity, ...]:
    """Normal and distance of a light plane, and its curvature where it has one, with their
    standard uncertainties."""
    covariance = calibration.covariance
    rows = []
    for axis, component in zip("xyz", plane.normal, strict=True):
        text, std = _with_std(covariance, f"{plane.name}.n{axis}", float(component))
        rows.append(Quantity(f"n{axis}", f"normal, {axis}", text, std))
    text, std = _with_std(covariance, f"{plane.name}.d", plane.distance_mm)
    rows.append(Quantity("d", "distance from the camera", text, std, "mm"))
    slope = math.degrees(math.asin(min(abs(float(plane.normal[2])), 1.0)))
    tilt = _tilt_std(covariance, plane)
    rows.append(Quantity("", "tilt against the optical axis", f"{slope:.3f}", tilt, "°"))
    return (*rows, *_curvature_quantities(covariance, plane))


def _curvature_quantities(covariance: Covariance, plane: LightPlane) -> Iterator[Quantity]:
    if plane.curvature is None:
        return
    meanings = ("along its first axis", "twist", "along its second axis")
    for part, meaning, value in zip(CURVATURE_PARTS, meanings, plane.curvature.per_mm, strict=True):
        text, std = _with_std(covariance, f"{plane.name}.{part}", float(value))
        yield Quantity(part, f"curvature, {meaning}", text, std, "1/mm")


def bend_in_words(calibration: Calibration, plane: LightPlane, seen: Array) -> str:
    """How far a curved sheet is from its plane, and from the plane nearest to it, at points
    ``(N, 3)`` of it, in a sentence; empty of a flat one.

    The uncertainty is that of the height at the point where it is greatest: ``hᵀ C h``, with h its
    derivatives by kxx, kxy, kyy and C their covariance.
    """
    if plane.curvature is None:
        return ""
    said = "The sheet is curved: n · X = d touches it amid the targets, and it bends away from that"
    if not len(seen):
        return f"{said}."
    heights = plane.curvature.heights(seen)
    most = int(np.argmax(np.abs(heights)))
    by_curvature = plane.curvature.heights_by_per_mm(seen[most])
    names = tuple(f"{plane.name}.{part}" for part in CURVATURE_PARTS)
    variance = by_curvature @ calibration.covariance.block(names) @ by_curvature
    value, std = rounded(abs(float(heights[most])), math.sqrt(max(float(variance), 0.0)))
    known = f" ± {std}" if float(std) > 0 else ""
    least = float(np.abs(_off_nearest_plane(seen)).max())
    return (
        f"{said}, by {value}{known} mm at most where targets met it; from the plane nearest to it, "
        f"by {least:.2g} mm."
    )


def _off_nearest_plane(points: Array) -> Array:
    """Distances ``(N,)`` of points from their least-squares plane."""
    away = points - points.mean(axis=0)
    return away @ np.linalg.svd(away)[2][2]


def _tilt_std(covariance: Covariance, plane: LightPlane) -> str:
    """Standard uncertainty of that angle: asin|nz| changes by dnz / √(1 − nz²)."""
    name = f"{plane.name}.nz"
    across = math.hypot(float(plane.normal[0]), float(plane.normal[1]))
    if name not in covariance.parameters or across == 0:
        return _missing(covariance)
    return f"{math.degrees(covariance.std(name) / across):.2g}"


def paper_equation(plane: LightPlane) -> str:
    """The plane as the paper writes it, ``aX + bY + cZ + 1000 = 0``, camera frame, mm."""
    a, b, c = (f"{-1000.0 * float(x) / plane.distance_mm:.4f}" for x in plane.normal)
    terms = f"{a} X + {b} Y + {c} Z + 1000 = 0"
    return terms.replace("+ -", "− ").replace("-", "−")


def view_quantities(calibration: Calibration) -> tuple[Quantity, ...]:
    """What the camera sees: its angles, and each sheet's pixels in mm at the picture's middle."""
    width, height = calibration.camera.image_size
    u, v = (width - 1) / 2, (height - 1) / 2
    across = _angle(calibration, (-0.5, v), (width - 0.5, v))
    down = _angle(calibration, (u, -0.5), (u, height - 0.5))
    rows = [
        Quantity("", "field of view, horizontal", _finite(across, ".2f"), "", "°"),
        Quantity("", "field of view, vertical", _finite(down, ".2f"), "", "°"),
    ]
    several = len(calibration.light_planes) > 1
    for plane in calibration.light_planes:
        laser = f"{plane.name}: " if several else ""
        by_u, by_v, depth = _middle_of_picture(calibration, plane, u, v)
        rows += [
            Quantity("Z", f"{laser}depth of the sheet there", _finite(depth, ".1f"), "", "mm"),
            Quantity("", f"{laser}one pixel along u there", _finite(by_u, ".4f"), "", "mm"),
            Quantity("", f"{laser}one pixel along v there", _finite(by_v, ".4f"), "", "mm"),
        ]
    return tuple(rows)


def _middle_of_picture(
    calibration: Calibration, plane: LightPlane, u: float, v: float
) -> tuple[float, float, float]:
    """A pixel's size on the sheet along u and along v, and the sheet's depth; mm."""
    pixels = np.array([[u - 0.5, v], [u + 0.5, v], [u, v - 0.5], [u, v + 0.5], [u, v]])
    xyz = triangulate(calibration, pixels, plane.name)
    return _distance(xyz[:2]), _distance(xyz[2:4]), float(xyz[4, 2])


def noise_in_words(calibration: Calibration) -> str:
    """What χ²/dof says about the residuals, in a sentence."""
    chi2 = calibration.residuals.chi2_per_dof
    if math.isclose(chi2, 1.0, abs_tol=1e-9):
        return "The noise was estimated from the residuals themselves, so χ²/dof is 1."
    if abs(chi2 - 1.0) <= _usual_reach(calibration):
        return "The residuals agree with this noise."
    if chi2 > 1.0:
        return (
            "The residuals are larger than the noise explains: something is not modelled, or the "
            "stated noise is too small. Look for views that stand out below."
        )
    if chi2 < 1.0:
        return (
            "The residuals are smaller than the stated noise: the uncertainties here are on the "
            "safe side."
        )
    return "Whether the residuals agree with this noise is not known."


def residuals_exceed_noise(calibration: Calibration) -> bool:
    """Whether χ²/dof lies farther above 1 than noise of the stated size brings it."""
    return calibration.residuals.chi2_per_dof > 1.0 + _usual_reach(calibration)


def _usual_reach(calibration: Calibration) -> float:
    """How far from 1 chance alone brings χ²/dof."""
    seen = sum(int(np.isfinite(v.residuals).sum()) for v in calibration.residuals.views)
    # About half of the observed coordinates are degrees of freedom: the rest went into poses.
    return _USUAL_SPREADS * math.sqrt(2.0 / max(seen / 2.0, 1.0))


def flat(mapping: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, str]]:
    """Nested mappings as ``a.b`` and text, in their own order."""
    for key, value in mapping.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        elif isinstance(value, Sequence) and not isinstance(value, str):
            yield f"{prefix}{key}", ", ".join(str(item) for item in value)
        else:
            yield f"{prefix}{key}", _in_words(value)


def _in_words(value: object) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return str(value)


def _with_std(covariance: Covariance, parameter: str, value: float) -> tuple[str, str]:
    if parameter not in covariance.parameters:
        return f"{value:.7g}", _missing(covariance)
    return rounded(value, covariance.std(parameter))


def _missing(covariance: Covariance) -> str:
    """A parameter without covariance was held fixed – unless the method gives none at all."""
    return "fixed" if covariance.parameters else NO_UNCERTAINTY


def _angle(
    calibration: Calibration, first: tuple[float, float], second: tuple[float, float]
) -> float:
    rays: Array = normalised(calibration.camera.unproject(np.array([first, second])))
    cross = float(np.linalg.norm(np.cross(rays[0], rays[1])))
    return math.degrees(math.atan2(cross, float(rays[0] @ rays[1])))


def _distance(points: Array) -> float:
    return float(np.linalg.norm(points[1] - points[0]))


def _finite(value: float, spec: str) -> str:
    return f"{value:{spec}}" if math.isfinite(value) else "–"
