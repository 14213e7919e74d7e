"""Markers found in rendered pictures of the seed rig, before clutter, and where there are none.

Median and 95 % distance from the true image point in px, the ratio of errors to the standard
uncertainty that each sighting states (root mean square; 1 is right), and time a picture.
Run with ``python -m bench.detection [VIEWS]``.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator

import cv2
import numpy as np
from rich.console import Console
from rich.table import Table

from sheetoflight.imaging.markers import find_target
from sheetoflight.model.target import CollinearTarget, MarkerKind
from sheetoflight.simulation.picture import ViewOptions
from sheetoflight.simulation.render import RenderOptions, render
from sheetoflight.simulation.rig import SimulatedRig, paper_rig
from sheetoflight.simulation.views import blank_scene, picture_tasks, render_task

SEED = 2024
CLUTTER = 30


class Tally:
    """What was found in the pictures of one stage."""

    def __init__(self) -> None:
        self.pictures = self.found = self.invented = 0
        self.seconds = 0.0
        self.distances: list[float] = []
        self.pulls: list[float] = []

    def look(self, image: np.ndarray, target: CollinearTarget, truth: np.ndarray | None) -> None:
        """Search one picture; ``truth`` (M, 2) px, or None where there is no target."""
        start = time.perf_counter()
        sighting = find_target(image, target).sighting
        self.seconds += time.perf_counter() - start
        self.pictures += 1
        if sighting is None:
            return
        if truth is None:
            self.invented += 1
            return
        uv = sighting.uv
        if not sighting.ordered and np.linalg.norm(uv[0] - truth[0]) > np.linalg.norm(
            uv[-1] - truth[0]
        ):
            uv = uv[::-1]
        error = uv - truth
        distance = np.linalg.norm(error, axis=1)
        if distance.max() > target.marker_size_mm:
            self.invented += 1
            return
        self.found += 1
        self.distances += distance.tolist()
        self.pulls += (error / sighting.std[:, None]).ravel().tolist()

    def row(self) -> list[str]:
        """The tally as a line of the table."""
        median = p95 = pull = "–"
        if self.distances:
            median = f"{np.median(self.distances):.4f}"
            p95 = f"{np.percentile(self.distances, 95):.4f}"
            pull = f"{np.sqrt(np.mean(np.square(self.pulls))):.2f}"
        seconds = f"{self.seconds / max(self.pictures, 1):.2f}"
        return [str(self.pictures), str(self.found), median, p95, pull, str(self.invented), seconds]


def tallies(rig: SimulatedRig, views: int) -> Iterator[tuple[str, Tally]]:
    """A tally for each stage, laser off and on, and for the wall alone."""
    stages: dict[str, Tally] = {}
    for task in picture_tasks(rig, views, views, (), ViewOptions(clutter=CLUTTER), SEED):
        state = "on" if task.laser else "off"
        picture = render_task(task)
        tally = stages.setdefault(f"{task.stage}, line {state}", Tally())
        tally.look(picture.image, rig.target, np.array(picture.truth["markers_uv"]))
    yield from stages.items()
    empty = Tally()
    for i in range(views):
        scene = blank_scene(rig, ViewOptions(clutter=CLUTTER), i)
        rng = np.random.default_rng([SEED, i])
        empty.look(render(rig, scene, RenderOptions(), rng, laser=bool(i % 2)), rig.target, None)
    yield "no target", empty


def main(views: int = 10) -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    table = Table(title=f"Seed rig, {CLUTTER} things on the wall, one core")
    headings = ("marker", "stage", "pictures", "found", "median px", "95 % px", "pull", "invented",
                "s")  # fmt: skip
    for heading in headings:
        table.add_column(heading, justify="left" if heading in ("marker", "stage") else "right")
    kinds: tuple[MarkerKind, ...] = ("quadrant", "disc")
    for kind in kinds:
        for stage, tally in tallies(paper_rig(target=CollinearTarget(marker=kind)), views):
            table.add_row(kind, stage, *tally.row())
    Console(width=100).print(table)


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
