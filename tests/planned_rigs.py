"""A rig described for planning, that tests share."""

from __future__ import annotations

from pathlib import Path

RIG_TOML = """
[target]
markers_mm = [0.0, 200.0, 400.0]
tolerance_mm = 0.05

[camera]
image_size = [1392, 1040]

[noise]
pixel_std = 0.1
placement_std_mm = 0

[plan]
focal_mm = 14.835
pixel_um = 6.45
sheet_angle_deg = 24
sheet_roll_deg = 5
working_distance_mm = 1386
depth_mm = [900, 1300]
pivot_mm = [0, -120, 1000]
"""
"""About the paper's rig, everything stated."""


def write_rig(folder: Path, text: str = RIG_TOML) -> Path:
    """A ``rig.toml`` in a folder."""
    path = folder / "rig.toml"
    path.write_text(text)
    return path
