"""Pictures without a laser line: noise of several kinds, with and without things to mistake."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from sheetoflight.geometry.directions import Array

SHAPE = (160, 240)
LEVEL = 60.0

Drawing = Callable[[np.random.Generator], NDArray[np.generic]]


def white(std: float) -> Drawing:
    """Normal noise, 8 bits."""
    return lambda rng: _bytes(LEVEL + rng.normal(0.0, std, SHAPE))


def white_16_bit(rng: np.random.Generator) -> NDArray[np.uint16]:
    """Normal noise, 16 bits."""
    noisy = 40.0 * LEVEL + rng.normal(0.0, 150.0, SHAPE)
    return np.clip(np.rint(noisy), 0, 65535).astype(np.uint16)


def coloured(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Normal noise in three channels."""
    return _bytes(LEVEL + rng.normal(0.0, 4.0, (*SHAPE, 3)))


def gradient(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise on a smooth quadric of up to 150 grey levels."""
    y, x = _unit_places()
    a = rng.uniform(-1.0, 1.0, 5)
    shape = a[0] * x + a[1] * y + a[2] * x * x + a[3] * x * y + a[4] * y * y
    shape = (shape - shape.min()) / np.ptp(shape)
    return _bytes(20.0 + rng.uniform(20.0, 150.0) * shape + rng.normal(0.0, 3.0, SHAPE))


def spots(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise and 6 round spots of 0.7 to 5 px and 20 to 180 grey levels that stand alone: each in
    a field of the picture of its own."""
    fields = rng.permutation(6)
    places = [
        (80 * (f // 3) + rng.uniform(25, 55), 80 * (f % 3) + rng.uniform(25, 55)) for f in fields
    ]
    return _spotted(rng, places, 5.0)


def crowded_spots(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise and 15 round spots anywhere, up to 8 px: neighbours run together."""
    places = [(rng.uniform(0, SHAPE[0]), rng.uniform(0, SHAPE[1])) for _ in range(15)]
    return _spotted(rng, places, 8.0)


def step(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise and a straight step of up to 120 grey levels, sharp or soft."""
    return _stepped(rng, 1)


def three_steps(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise and three steps: between two of them a bright stripe may remain."""
    return _stepped(rng, 3)


def salt(rng: np.random.Generator) -> NDArray[np.uint8]:
    """Noise and hot pixels, one in 1000 to one in 50."""
    picture = LEVEL + rng.normal(0.0, 3.0, SHAPE)
    hot = rng.uniform(size=SHAPE) < 10.0 ** rng.uniform(-3.0, -1.7)
    return _bytes(np.where(hot, rng.uniform(100.0, 255.0, SHAPE), picture))


DARK_PICTURES: dict[str, Drawing] = {
    **{f"white, std {std:g}": white(std) for std in (0.3, 1.0, 3.0, 10.0, 30.0)},
    "white, 16 bit": white_16_bit,
    "colour": coloured,
    "smooth gradient": gradient,
    "spots": spots,
    "step": step,
    "salt": salt,
}
"""What no line may be seen in."""

HARD_PICTURES: dict[str, Drawing] = {"crowded spots": crowded_spots, "three steps": three_steps}
"""Where a bright stripe may be in truth: shown, and nothing promised."""


def _spotted(
    rng: np.random.Generator, places: list[tuple[float, float]], widest: float
) -> NDArray[np.uint8]:
    rows, columns = np.indices(SHAPE)
    picture = LEVEL / 2.0 + rng.normal(0.0, 3.0, SHAPE)
    for v, u in places:
        width = rng.uniform(0.7, widest)
        distance2 = (rows - v) ** 2 + (columns - u) ** 2
        picture += rng.uniform(20.0, 180.0) * np.exp(-0.5 * distance2 / width**2)
    return _bytes(picture)


def _stepped(rng: np.random.Generator, count: int) -> NDArray[np.uint8]:
    rows, columns = np.indices(SHAPE)
    picture = 20.0 + rng.normal(0.0, 3.0, SHAPE)
    for _ in range(count):
        angle, softness = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.3, 3.0)
        u, v = rng.uniform(0, SHAPE[1]), rng.uniform(0, SHAPE[0])
        t = (columns - u) * np.cos(angle) + (rows - v) * np.sin(angle)
        height = rng.uniform(20.0, 120.0)
        picture += height / (1.0 + np.exp(-np.clip(t / softness, -50.0, 50.0)))
    return _bytes(picture)


def _unit_places() -> tuple[Array, Array]:
    y, x = np.indices(SHAPE, dtype=float)
    return 2.0 * y / SHAPE[0] - 1.0, 2.0 * x / SHAPE[1] - 1.0


def _bytes(picture: Array) -> NDArray[np.uint8]:
    return np.clip(np.rint(picture), 0, 255).astype(np.uint8)
