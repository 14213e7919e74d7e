"""A judge of laser lines that shares nothing with the code: straight lines of coloured pixels."""

from __future__ import annotations

import cv2
import numpy as np

NARROW_PX, BROAD_PX = 1.5, 10.0
CLEAR = 6.0  # medians of the row's answers
REACH_PX, LEAST_ROWS, DRAWS, MOST_LINES = 1.5, 80, 400, 4
LEAST_FILLED = 0.6


def coloured_columns(picture, channel):
    """Rows and columns where one channel's excess over the others' mean peaks along a row, two
    in a row at the most."""
    excess = picture[..., channel] - np.delete(picture, channel, axis=2).astype(float).mean(axis=2)
    narrow, broad = (
        cv2.GaussianBlur(excess, (0, 0), sigmaX=s, sigmaY=NARROW_PX) for s in (NARROW_PX, BROAD_PX)
    )
    answer = narrow - broad
    rows, columns = [], []
    for row, values in enumerate(answer):
        left = values.copy()
        for _ in range(2):
            column = int(np.argmax(left))
            if left[column] > CLEAR * np.median(np.abs(values)) + 1.0:
                rows.append(row)
                columns.append(column)
            left[max(0, column - 10) : column + 11] = 0.0
    return np.array(rows), np.array(columns)


def straight_lines(rows, columns, rng):
    """Slope, level, first and last row of the steep straight lines most points agree on.

    A line must hold points in most rows of its longest stretch.
    """
    lines = []
    while len(rows) >= LEAST_ROWS and len(lines) < MOST_LINES:
        best = np.zeros(len(rows), dtype=bool)
        for first, second in rng.integers(0, len(rows), (DRAWS, 2)):
            if abs(rows[second] - rows[first]) < LEAST_ROWS // 2:
                continue
            slope = (columns[second] - columns[first]) / (rows[second] - rows[first])
            offset = columns - columns[first] - slope * (rows - rows[first])
            near = np.abs(offset) < REACH_PX
            if abs(slope) < 1.0 and near.sum() > best.sum():
                best = near
        if best.sum() < LEAST_ROWS:
            break
        slope, level = np.polyfit(rows[best], columns[best], 1)
        first, last = _longest_stretch(rows[best])
        held = np.unique(rows[best & (rows >= first) & (rows <= last)])
        if len(held) >= max(LEAST_ROWS, LEAST_FILLED * (last - first + 1)):
            lines.append((slope, level, first, last))
        rows, columns = rows[~best], columns[~best]
    return lines


def _longest_stretch(rows):
    rows = np.unique(rows)
    parts = np.split(rows, np.flatnonzero(np.diff(rows) > 15) + 1)
    longest = max(parts, key=len)
    return int(longest[0]), int(longest[-1])
