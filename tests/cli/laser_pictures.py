"""A small rig, and pictures of its laser line drawn from plane geometry alone, without noise
that could hide a fault: what tests of the commands that look for the line share."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from sheetoflight.cli.main import main
from sheetoflight.model.calibration import Calibration
from sheetoflight.model.camera import Camera
from sheetoflight.model.light_plane import LightPlane
from tests.known_lengths import calibrated

WIDTH, HEIGHT = 200, 160
CAMERA = Camera((WIDTH, HEIGHT), 500.0, 495.0, 98.3, 81.2)
SHEET = LightPlane(np.array([0.6, 0.0, 0.8]), 560.0)

Told = tuple[int, str, str]
Words = Callable[..., Told]


def calibration() -> Calibration:
    return calibrated(CAMERA, SHEET)


@pytest.fixture
def sol(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> Words:
    """Run a command; give its exit status, standard output and standard error.

    In one process: to start others takes longer than all the work here.
    """
    monkeypatch.setattr("sheetoflight.cli.telling.cores", lambda: 1)

    def run(*words: object) -> Told:
        status = main([str(word) for word in words])
        told = capsys.readouterr()
        return status, told.out, told.err

    return run


@pytest.fixture
def good(tmp_path: Path) -> Path:
    """A picture with a line."""
    return saved(tmp_path / "good.png", a_line())


def expect_error(result: Told, status: int, *said: str) -> None:
    """One line on standard error that says what and how to mend it, and nothing else."""
    found, out, error = result
    assert (found, out) == (status, ""), result
    assert error.startswith("error: ")
    assert error.count("\n") == 1
    assert " – " in error
    for words in said:
        assert words in error


def lit(first: np.ndarray, last: np.ndarray, seed: int = 0, height: float = 150.0) -> np.ndarray:
    """A picture of a line through two image points: a Gaussian across, some noise."""
    v, u = np.indices((HEIGHT, WIDTH))
    along = (last - first) / np.linalg.norm(last - first)
    across = (u - first[0]) * -along[1] + (v - first[1]) * along[0]
    noise = np.random.default_rng(seed).normal(0.0, 1.5, u.shape)
    light = 20.0 + height * np.exp(-0.5 * (across / 1.6) ** 2) + noise
    return np.clip(np.rint(light), 0, 255).astype(np.uint8)


def a_line(seed: int = 0) -> np.ndarray:
    """Any line."""
    return lit(np.array([60.0, 0.0]), np.array([105.0, 159.0]), seed)


def dark() -> np.ndarray:
    return lit(np.zeros(2), np.ones(2), 9, 0.0)


def saved(path: Path, picture: np.ndarray) -> Path:
    cv2.imwrite(str(path), picture)
    return path


def cut_short(path: Path, share: float = 0.6) -> Path:
    content = path.read_bytes()
    path.write_bytes(content[: int(share * len(content))])
    return path


def claiming(path: Path, width: int, height: int) -> Path:
    """A PNG whose header claims what its few bytes do not hold (ISO/IEC 15948)."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        checksum = struct.pack(">I", zlib.crc32(kind + content))
        return struct.pack(">I", len(content)) + kind + content + checksum

    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    packed = chunk(b"IDAT", zlib.compress(b"\0" * 99))
    content = chunk(b"IHDR", header) + packed + chunk(b"IEND", b"")
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + content)
    return path
