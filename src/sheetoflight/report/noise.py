"""What the noise was found to be, and what was stated of it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sheetoflight.model.calibration import Calibration
from sheetoflight.model.covariance import Covariance
from sheetoflight.model.target import CollinearTarget
from sheetoflight.report.budget import freedom_text
from sheetoflight.report.numbers import rounded, two_digits
from sheetoflight.report.point_groups import has_lines

COMPONENTS = {
    "pixel": ("image coordinates of markers and spots", "px"),
    "placement": ("ends of the target off the sheet of light, stage plane", "mm"),
    "marker": ("single markers off the sheet of light, stage plane", "mm"),
    "corner": ("image coordinates of a board's points", "px"),
    "stripe": ("points of a line on a board about the line", "px"),
    "line": ("whole lines on boards off the sheet of light", "mm"),
    "shape": ("windings of a line on a board", "px"),
}
"""Every noise component by its name in files, what it is the standard deviation of, its unit."""

ESTIMATED, STATED = "estimated from the residuals", "stated"
_NOT_FOUND = "none found, or stated as none"
_FOUND_NONE = "estimated from the residuals, which show none"
_STATED_NONE = "stated as none"
_BESIDE_STATED = "not sought where the placement error is stated"
_NOT_SOUGHT = "not sought by this method"
_NOT_RECORDED = "the file does not say where it comes from"
_IMAGE_POINTS = ("pixel", "corner")
_OFF_SHEET = ("placement", "marker")
NO_SIZE = ("–", "0")
"""What stands for the size of noise that there is none of."""

_STATED_PLACEMENT = "stated_placement_std_mm"
"""Key of the provenance that holds what ``rig.toml`` states of the placement error."""


@dataclass(frozen=True)
class NoiseRow:
    """One size of the noise as text, and where it comes from."""

    name: str
    meaning: str
    size: str
    std: str
    unit: str
    freedom: str
    origin: str


def noise_rows(calibration: Calibration) -> tuple[NoiseRow, ...]:
    """The noise components, then what was stated of the target."""
    rows = [_component(calibration, name) for name in COMPONENTS]
    rows += [_estimated(calibration.covariance, name)
             for name in calibration.covariance.components.names
             if name not in COMPONENTS]  # fmt: skip
    return (*filter(None, rows), *_of_target(calibration.target))


def image_noise(calibration: Calibration) -> str:
    """The component whose size is the calibration's ``pixel_std``."""
    return "corner" if _stages(calibration) == {"board"} else "pixel"


def noise_origin(calibration: Calibration, component: str) -> str:
    """Whether a component was estimated or stated, in a word or two."""
    covariance = calibration.covariance
    if component in covariance.components.names:
        return ESTIMATED
    if component in _OFF_SHEET and _STATED_PLACEMENT in calibration.provenance:
        return _off_sheet_origin(calibration, component)
    if not covariance.sources:
        return _NOT_RECORDED
    if component in _IMAGE_POINTS:
        return STATED
    if component not in _OFF_SHEET:
        return _FOUND_NONE
    return STATED if any(s.name == component for s in covariance.sources) else _NOT_FOUND


def _off_sheet_origin(calibration: Calibration, component: str) -> str:
    stated = _stated_placement(calibration)
    if stated is None:
        return _NOT_SOUGHT if calibration.method == "paper" else _FOUND_NONE
    if component == "marker":
        return _BESIDE_STATED
    return STATED if stated > 0 else _STATED_NONE


def _stated_placement(calibration: Calibration) -> float | None:
    """``placement_std_mm`` of the rig, mm; None where it was left to be estimated."""
    stated = calibration.provenance.get(_STATED_PLACEMENT)
    if isinstance(stated, bool) or not isinstance(stated, int | float):
        return None
    return float(stated) if math.isfinite(stated) and stated >= 0 else None


def _component(calibration: Calibration, name: str) -> NoiseRow | None:
    """A row; None for noise that nothing in the views could have shown."""
    if name in calibration.covariance.components.names:
        return _estimated(calibration.covariance, name)
    if not _acts(calibration, name):
        return None
    meaning, unit = COMPONENTS[name]
    return NoiseRow(
        name,
        meaning,
        _stated_size(calibration, name),
        "–",
        unit,
        "–",
        noise_origin(calibration, name),
    )


def _acts(calibration: Calibration, name: str) -> bool:
    """Whether the views are of the kind that such noise disturbs."""
    stages = _stages(calibration)
    if name == "pixel":
        return stages != {"board"}
    if name == "corner":
        return "board" in stages
    return "plane" in stages if name in _OFF_SHEET else has_lines(calibration)


def _stages(calibration: Calibration) -> set[str]:
    return {view.stage for view in calibration.residuals.views}


def _stated_size(calibration: Calibration, name: str) -> str:
    if name in _IMAGE_POINTS:
        return two_digits(calibration.pixel_std)
    stated = _stated_placement(calibration) if name == "placement" else None
    return NO_SIZE[0] if stated is None else two_digits(stated) if stated > 0 else NO_SIZE[1]


def _estimated(covariance: Covariance, name: str) -> NoiseRow:
    """A variance known to relative variance R has a root known to relative √R / 2."""
    components = covariance.components
    place = components.names.index(name)
    relative = float(components.relative_covariance[place, place])
    size, std = components.std[place], components.std[place] * math.sqrt(relative) / 2.0
    meaning, unit = COMPONENTS.get(name, ("", ""))
    freedom = freedom_text(2.0 / relative if relative > 0 else math.inf)
    return NoiseRow(name, meaning, *rounded(size, std), unit, freedom, ESTIMATED)


def _of_target(target: CollinearTarget | None) -> list[NoiseRow]:
    if target is None:
        return []
    tolerance = f"{target.tolerance_mm:g}" if target.tolerance_mm else "0"
    rows = [
        NoiseRow(
            "target length",
            "each marker's position along the target",
            tolerance,
            "–",
            "mm",
            "–",
            STATED if target.tolerance_mm else "the positions are taken as exact",
        )
    ]
    if target.expansion_per_K or target.warmer_by_K or target.warmer_by_std_K:
        rows.append(
            NoiseRow(
                "temperature",
                f"relative length of the target, {_warming(target)}",
                f"{target.thermal_std * 1e6:.2g}",
                "–",
                "µm/m",
                "–",
                STATED,
            )
        )
    return rows


def _warming(target: CollinearTarget) -> str:
    warmer = f"{target.warmer_by_K:g} ± {target.warmer_by_std_K:g} K"
    expansion = f"({target.expansion_per_K * 1e6:g} ± {target.expansion_std_per_K * 1e6:g})"
    return f"{warmer} warmer than measured, expansion {expansion} · 10⁻⁶ per K"
