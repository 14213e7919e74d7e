"""The tables of ``rig.toml`` that say how a rig is meant to be built."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

from pydantic import Field

from sheetoflight.errors import InputError
from sheetoflight.io.schema import StrictModel
from sheetoflight.model.nominal import NominalGeometry, SheetGeometry

_Positive = Annotated[float, Field(gt=0)]
_UM_PER_MM = 1000.0


class SheetTable(StrictModel):
    """Keys of a sheet of light, in ``[plan]`` for all lasers or in a ``[[laser]]`` for its own."""

    sheet_angle_deg: float | None = None
    sheet_roll_deg: float | None = None
    working_distance_mm: float | None = None

    @property
    def stated(self) -> dict[str, float]:
        """What is said of the sheet."""
        return self.model_dump(include=set(SheetTable.model_fields), exclude_none=True)


class PlanTable(SheetTable):
    """``[plan]``."""

    focal_px: _Positive | None = None
    focal_mm: _Positive | None = None
    pixel_um: _Positive | None = None
    depth_mm: Annotated[list[_Positive], Field(min_length=2, max_length=2)] | None = None
    pivot_mm: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None


def planned_geometry(
    table: PlanTable | None, lasers: Sequence[tuple[str, SheetTable]]
) -> NominalGeometry | None:
    """The rig of ``[plan]``; None where there is no such table.

    Parameters
    ----------
    table : PlanTable, optional
    lasers : sequence of (str, SheetTable)
        Each laser's name, and what its table says of its sheet.

    Raises
    ------
    InputError
        If the focal length or a sheet is not given, or given twice; the key is named.
    """
    if table is None:
        stray = next((name for name, own in lasers if own.stated), None)
        if stray is not None:
            raise InputError(
                f"laser {stray} has a sheet, but there is no [plan]",
                "add [plan] with the focal length",
            )
        return None
    depth, pivot = table.depth_mm, table.pivot_mm
    return NominalGeometry(
        _focal_px(table),
        tuple(_sheet(name, table.stated | own.stated) for name, own in lasers),
        (depth[0], depth[1]) if depth else None,
        (pivot[0], pivot[1], pivot[2]) if pivot else None,
    )


def _focal_px(table: PlanTable) -> float:
    by_lens = (table.focal_mm, table.pixel_um)
    if table.focal_px is not None and by_lens == (None, None):
        return table.focal_px
    if table.focal_px is None and table.focal_mm is not None and table.pixel_um is not None:
        return _UM_PER_MM * table.focal_mm / table.pixel_um
    given = [key for key in ("focal_px", "focal_mm", "pixel_um") if getattr(table, key) is not None]
    raise InputError(
        f"[plan] gives {' and '.join(given) or 'no focal length'}",
        "give focal_px alone, or focal_mm and pixel_um, the width of a pixel",
    )


def _sheet(laser: str, stated: dict[str, float]) -> SheetGeometry:
    for key in ("sheet_angle_deg", "working_distance_mm"):
        if key not in stated:
            raise InputError(
                f"'{key}' of laser {laser} is missing", "add it to [plan], or to its [[laser]]"
            )
    return SheetGeometry(
        stated["sheet_angle_deg"], stated.get("sheet_roll_deg", 0.0), stated["working_distance_mm"]
    )
