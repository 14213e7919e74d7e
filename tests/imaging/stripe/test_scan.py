"""Scans at the camera's rate: truth known, errors against their bound and their stated size.

Frames are drawn by the exact integral of a Gaussian over each pixel, with normal noise, rounded.
A line wanders slowly, so every sub-pixel phase occurs and neighbours belong together.
"""

from __future__ import annotations

import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from typing import get_args

import numpy as np
import pytest
from scipy.special import ndtr

from bench.stripe_speed import frames, shares
from sheetoflight.errors import InputError
from sheetoflight.imaging.stripe.scan.scanner import Detector, ScanOptions, scan

DETECTORS = get_args(Detector)
LEVEL = 30.0


def light(x, amplitude, centre, width):
    """Gaussian of unit-pixel samples x, integrated over each pixel."""
    right, left = (x + 0.5 - centre) / width, (x - 0.5 - centre) / width
    return amplitude * width * np.sqrt(2.0 * np.pi) * (ndtr(right) - ndtr(left))


def wave(count, height=97):
    """Centres that pass through every sub-pixel phase."""
    return height / 2.0 + 9.0 * np.sin(np.arange(count) / 97.3)


def drawn(centres, amplitude, width, noise, seed=1, height=97, level=LEVEL):
    rng = np.random.default_rng(seed)
    picture = level + light(np.arange(height)[:, None], amplitude, centres, width)
    noisy = picture + rng.normal(0.0, noise, picture.shape)
    return np.rint(np.clip(noisy, 0.0, 255.0)).astype(np.uint8)


def bound(amplitude, width, noise, height=97):
    """Cramér–Rao bound of the centre, amplitude, width and background unknown too, rms over the
    phases. Rounding to whole grey levels adds 1/12 to the variance."""
    x = np.arange(height)
    variances = []
    for phase in np.linspace(-0.5, 0.5, 20, endpoint=False):
        truth = np.array([amplitude, 48.0 + phase, width])
        steps = 1e-4 * np.eye(3)
        columns = [(light(x, *(truth + d)) - light(x, *(truth - d))) / 2e-4 for d in steps]
        jacobian = np.stack([*columns, np.ones(height)], axis=1)
        variances.append(np.linalg.inv(jacobian.T @ jacobian)[1, 1])
    return np.sqrt((noise**2 + 1.0 / 12.0) * np.mean(variances))


@pytest.mark.parametrize("width", [0.8, 1.5, 4.0])
@pytest.mark.parametrize(("amplitude", "noise"), [(60.0, 5.0), (60.0, 1.0), (220.0, 1.0)])
def test_gaussian_reaches_the_bound_without_bias(width, amplitude, noise):
    """8000 columns: the rms is known to 0.8 %, so 1.10 lies some ten standard deviations above 1;
    a mean over an eighth of the phases, to 1/31 of the rms, at most 0.0025 px."""
    centres = wave(8000)
    found = scan(drawn(centres, amplitude, width, noise))
    assert found.good.mean() > 0.99
    errors = (found.across - centres)[found.good]
    rms = np.sqrt(np.mean(errors**2))
    assert rms < 1.10 * bound(amplitude, width, noise)
    phases = (8.0 * (centres[found.good] % 1.0)).astype(int)
    biases = np.array([errors[phases == phase].mean() for phase in range(8)])
    assert np.abs(biases).max() < 0.005 + 3.0 * rms / np.sqrt(len(errors) / 8.0)


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("width", [1.0, 2.0, 3.0])
@pytest.mark.parametrize(("amplitude", "noise"), [(60.0, 5.0), (60.0, 1.0), (200.0, 5.0), (200, 1)])
def test_the_stated_uncertainty_is_true(detector, width, amplitude, noise):
    """Rms of error over uncertainty; 8000 columns know it to 0.8 % (steger, whose neighbours share
    noise, to 2 %), and the noise of the frame is estimated to 2 %."""
    centres = wave(8000)
    frame = drawn(centres, amplitude, width, noise, seed=2)
    found = scan(frame, ScanOptions(detector=detector))
    assert found.good.mean() > 0.99
    pulls = ((found.across - centres) / found.std)[found.good]
    assert 0.9 < np.sqrt(np.mean(pulls**2)) < 1.1


@pytest.mark.parametrize("noise", [0.5, 2.0, 6.0])
def test_noise_is_estimated_beside_the_line(noise):
    found = scan(drawn(wave(4000, 400), 200.0, 2.0, noise, height=400), ScanOptions("centroid"))
    assert found.noise_std == pytest.approx(np.sqrt(noise**2 + 1.0 / 12.0), rel=0.08)


@pytest.mark.parametrize("detector", DETECTORS)
def test_width_and_peak_are_those_of_the_line(detector):
    """Those of gaussian and steger to 1 %; the others take them from the brightest sample, which a
    pixel's width lowers by 1/24w² and noise raises."""
    found = scan(drawn(wave(2000), 150.0, 2.0, 1.0), ScanOptions(detector=detector))
    part = 0.01 if detector in ("gaussian", "steger") else 0.06
    assert np.nanmean(found.width) == pytest.approx(2.0, rel=part)
    assert np.nanmean(found.peak) == pytest.approx(150.0, rel=part)


@pytest.mark.parametrize("detector", DETECTORS)
def test_rows_are_columns_of_the_transposed_frame(detector):
    frame = drawn(wave(500), 120.0, 1.6, 3.0)
    by_columns = scan(frame, ScanOptions(detector=detector))
    turned = np.ascontiguousarray(frame.T)
    by_rows = scan(turned, ScanOptions(detector=detector, along="rows"))
    assert by_columns.good.all()
    assert np.array_equal(by_columns.good, by_rows.good)
    assert np.allclose(by_columns.across, by_rows.across, rtol=0.0, atol=1e-9)
    assert np.allclose(by_columns.width, by_rows.width, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("detector", ["centroid", "gaussian"])
def test_sixteen_bits_hold_the_same_line(detector):
    """The same frame 200 times as bright: the same centres, 200 times the peak and noise."""
    frame = drawn(wave(500), 120.0, 1.6, 3.0)
    options = ScanOptions(detector=detector)
    dim, bright = scan(frame, options), scan(frame.astype(np.uint16) * 200, options)
    assert np.allclose(bright.across, dim.across, rtol=0.0, atol=1e-4)
    assert np.allclose(bright.peak, 200.0 * dim.peak, rtol=1e-3)
    assert bright.noise_std == pytest.approx(200.0 * dim.noise_std, rel=0.02)


@pytest.mark.parametrize("detector", DETECTORS)
@pytest.mark.parametrize("last", [0.0, 82.0])
def test_a_line_that_leaves_the_frame_is_followed_to_its_edge(detector, last):
    """2000 columns, none of which may be off by five standard deviations or more; two in five
    lie further from the edge than the widest filter reaches."""
    centres = np.linspace(0.0, 14.0, 2000) + last
    found = scan(drawn(centres, 150.0, 1.5, 2.0), ScanOptions(detector=detector))
    assert found.good.mean() > 0.3
    assert np.nanmax(np.abs((found.across - centres) / found.std)) < 5.0


@pytest.mark.parametrize("along", ["columns", "rows"])
def test_the_brightest_sample_is_found_wherever_it_lies(along):
    """A line 1 px wide at every place of a frame whose size fits no block: away from the margin
    where the profile is cut off, every column has its own centre."""
    height, count = 1100, 300
    centres = np.linspace(5.0, height - 6.0, count)
    frame = drawn(centres, 150.0, 1.0, 2.0, height=height)
    frame = frame if along == "columns" else np.ascontiguousarray(frame.T)
    found = scan(frame, ScanOptions(along=along))
    assert found.good.all()
    assert np.abs(found.across - centres).max() < 0.1


@pytest.mark.parametrize("detector", DETECTORS)
def test_there_is_no_line_in_noise(detector):
    """The frames differ; 100 of them hold 50 million samples, a few of them over 5 sigma."""
    rng = np.random.default_rng(4)
    options = ScanOptions(detector=detector)
    for _ in range(100 if detector == "gaussian" else 20):
        noise = 30.0 + 5.0 * rng.standard_normal((1024, 512), np.float32)
        assert not scan(np.rint(noise).astype(np.uint8), options).good.any()


@pytest.mark.parametrize("detector", DETECTORS)
def test_columns_without_the_line_are_marked(detector):
    centres = wave(600)
    frame = drawn(centres, 120.0, 1.5, 3.0)
    dark = np.arange(600) // 100 % 2 == 1
    frame[:, dark] = drawn(centres, 0.0, 1.5, 3.0, seed=5)[:, dark]
    found = scan(frame, ScanOptions(detector=detector))
    # Smoothing along the line mixes light and dark within its reach of 5 px.
    lit = np.convolve(~dark, np.ones(11), "same")
    assert found.good[lit == 11].mean() > 0.99
    assert not found.good[lit == 0].any()
    for values in (found.across, found.std, found.width, found.peak):
        assert np.array_equal(np.isnan(values), ~found.good)


@pytest.mark.parametrize("detector", DETECTORS)
def test_hot_pixels_are_no_line(detector):
    frame = drawn(wave(300), 0.0, 1.5, 2.0)
    frame[np.arange(3, 97, 7), np.arange(5, 300, 22)] = 255
    assert not scan(frame, ScanOptions(detector=detector)).good.any()


@pytest.mark.parametrize("top", [255, 150])
def test_full_samples_do_not_move_a_gaussian(top):
    """Cut off at the type's full scale, and at a level that the frame itself shows."""
    centres = wave(2000)
    frame = np.minimum(drawn(centres, 180.0, 2.0, 2.0), 255)
    bright = np.rint(light(np.arange(97)[:, None], 500.0, centres, 2.0) + 30.0)
    frame = np.minimum(np.maximum(frame, bright), top).astype(np.uint8)
    found = scan(frame)
    assert found.good.mean() > 0.99
    errors = found.across - centres
    assert np.sqrt(np.nanmean(errors**2)) < 0.05
    assert np.nanmedian(found.peak) == pytest.approx(500.0, rel=0.1)


@pytest.mark.parametrize("detector", DETECTORS)
def test_full_samples_leave_the_middle_in_place(detector):
    centres = wave(2000)
    picture = light(np.arange(97)[:, None], 400.0, centres, 2.0) + 30.0
    noisy = picture + np.random.default_rng(6).normal(0.0, 2.0, picture.shape)
    frame = np.rint(np.clip(noisy, 0.0, 255.0)).astype(np.uint8)
    found = scan(frame, ScanOptions(detector=detector))
    assert found.good.mean() > 0.99
    assert np.sqrt(np.nanmean((found.across - centres) ** 2)) < 0.1


@pytest.mark.parametrize("detector", ["gaussian", "steger"])
@pytest.mark.parametrize("slope", [0.2, 0.8])
def test_a_slanting_line_is_wider_along_its_columns(detector, slope):
    """By 1/cos of its angle, which a pixel's width along the line raises a little."""
    count, width = 200, 2.0
    centres = 60.0 + slope * np.arange(count)
    wide = width * np.sqrt(1.0 + slope**2)
    found = scan(drawn(centres, 150.0, wide, 1.0, height=300), ScanOptions(detector=detector))
    inner = slice(10, -10)  # beyond the frame's sides nothing is known of the line
    assert found.good[inner].all()
    assert np.abs((found.across - centres)[inner].mean()) < 0.01
    assert found.width[inner].mean() == pytest.approx(wide, rel=0.02)


def test_frames_smaller_than_the_filters_are_left_without_a_line():
    options = ScanOptions(detector="steger", half_height=12, smoothing=3.0)
    frame = drawn(np.full(80, 12.0), 150.0, 1.5, 2.0, height=25)
    assert not scan(frame, options).good.any()


def test_threads_find_what_one_finds():
    stack = [drawn(wave(300), 120.0, 1.5, 3.0, seed=seed) for seed in range(8)]
    one = [scan(frame) for frame in stack]
    with ThreadPoolExecutor(2) as pool:
        two = list(pool.map(scan, stack))
    for left, right in zip(one, two, strict=True):
        assert np.array_equal(left.across, right.across, equal_nan=True)


def test_what_cannot_be_scanned_is_refused():
    frame = np.zeros((60, 40), np.uint8)
    for wrong in (frame.astype(float), frame[:, ::2], frame[:10], frame[0], frame.astype(">u2")):
        with pytest.raises(InputError):
            scan(wrong)
    with pytest.raises(InputError):
        scan(np.zeros((40, 10), np.uint8), ScanOptions(along="rows"))


@pytest.mark.parametrize(
    "wrong",
    [
        {"detector": "steeger"},
        {"along": "diagonals"},
        {"least_snr": 0.0},
        {"half_height": 4},
        {"smoothing": 5.0},
        {"half_height": 8, "smoothing": 3.0},
    ],
)
def test_options_out_of_bounds_are_refused(wrong):
    with pytest.raises(InputError):
        ScanOptions(**wrong)


def test_numba_waits_for_the_first_scan():
    program = (
        "import sys, sheetoflight.imaging.stripe.scan.scanner; sys.exit('numba' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_kernels_compile_where_nothing_can_be_kept():
    """A function without a file stands for an installation that nobody may write to."""
    from sheetoflight.imaging.stripe.scan.compiled import kernel

    space: dict[str, object] = {}
    exec(compile("def double(x):\n    return 2 * x\n", "<nowhere>", "exec"), space)
    assert kernel(space["double"])(21) == 42  # type: ignore[operator]


def test_scans_keep_up_with_reading():
    """At least half of what is aimed at, 45, 45, 30, 10 and 8 % of the speed of a maximum, which
    `bench.stripe_speed` measures: test machines are busy. Of processor time, for the same
    reason."""
    found = shares(frames(24), "columns", threads=2, rounds=5, clock=time.process_time)
    least = {"centroid": 0.22, "fir": 0.22, "parabola": 0.15, "gaussian": 0.05, "steger": 0.04}
    assert {name: share for name, share in found.items() if share < least[name]} == {}
