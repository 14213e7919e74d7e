"""``sol detect``."""

from __future__ import annotations

from pathlib import Path

from sheetoflight.cli.telling import AsJson, on_all_cores, tell, tell_json, warn
from sheetoflight.workflow.rig_folder import POINTS, STAGES
from sheetoflight.workflow.rig_folder import detect as detect_folder


def detect(folder: Path, /, *, json: AsJson = False) -> None:
    """Find the target in a rig folder's pictures and write points.csv there.

    Parameters
    ----------
    folder
        The rig folder, with rig.toml and pictures in camera/, plane/, crossing/ or board/.
    json
        Print the result as JSON.
    """
    with on_all_cores() as run:
        detection = detect_folder(folder, run)
    observations = detection.rig.observations
    counts = observations.counts()
    if json:
        missed = [
            {"stage": missed.stage, "view": missed.view, "reason": missed.reason}
            for missed in detection.missed
        ]
        tell_json({"file": str(folder / POINTS), "seen": counts, "missed": missed})
        return
    for stage in STAGES:
        if stage not in counts and "board" not in counts:
            warn(f"{folder} has no folder {stage}/ with pictures")
    for missed in detection.missed:
        warn(missed.in_words)
    for stage, count in counts.items():
        lost = sum(missed.stage == stage for missed in detection.missed)
        if stage in detection.kept:
            tell(f"{stage}: {count} {'view' if count == 1 else 'views'} kept from {POINTS}")
        else:
            tell(f"{stage}: {_SEEN[stage]} found in {count} of {count + lost} pictures")
    lined = len(set(observations.board.line.view.tolist()))
    if lined:
        tell(f"board: the laser's line in {lined} of them")
    tell(f"written to {folder / POINTS}")


_SEEN = {
    "camera": "target",
    "plane": "target",
    "crossing": "target and spot",
    "board": "board",
}
