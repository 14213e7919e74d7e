"""Observations in, `Calibration` out.

Closed forms (`camera_closed_form`, `target_triangulation`, `paper_plane`) and the refinement
(`adjustment`) are peers that do not know each other; `methods` joins them.
"""
