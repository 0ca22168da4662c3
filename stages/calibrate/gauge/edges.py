"""Finds fiducials in the lit frames, and measures offsets across their borders to sub-pixel accuracy.

Refining a corner alone displaces it where the marker is foreshortened. A straight stretch of edge has no such
error, because blur is the same on both of its sides.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from scipy.special import erf

from pipeline.arrays import Bool, Float, Image, Int
from pipeline.geometry.rigid import inverse, transform
from pipeline.instrument.camera import Camera
from pipeline.system.parallel import in_threads
from stages.calibrate.gauge.geometry import Gauge
from stages.calibrate.gauge.state import GaugeParameters
from stages.calibrate.gauge.white import BELOW_WHITE_GREY

# Samples of a profile across an edge.
_PROFILE = 21
_SIDES = np.array([[0.0, -1.0], [1.0, 0.0], [0.0, 1.0], [-1.0, 0.0]])
# Part of an edge, from its middle, along which profiles are taken. Debt: data/debts.md.
_SPAN = 0.7
# The detector's contour passes through the middles of the outermost black pixels, on average this far inside
# the border, px: drawn sides of 16 to 60 px on a grey wall were .7 to 1.9 px short, 1.2 in the mean, those of
# 27, 37 and 60 px in rendered gauge runs 1.2.
_CONTOUR_PX = 0.5
# A profile is used if its step is at least so high, its place within this part of the profile, its noise
# below this part of the step, and its blur in this range, px. With half and twice of each, at most 2 % of
# 3703 edges of open-1's gauge run are left out.
_LEAST_STEP_GREY, _INSIDE, _MOST_NOISE, _BLUR_PX = 8.0, 0.6, 0.12, (0.3, 2.5)
# White ends where it falls by this part of the step (chosen: noise of 1 % of it seldom makes that fall).
_WHITE_ENDS = 0.03
# Least σ, and the part of the border over which a profile reaches. Debt: data/debts.md.
_LEAST_SIGMA_PX, _OF_BORDER = 0.03, 0.85
# Markers are drawn in cells; the outermost is black all round.
_BORDER_CELLS = 2
_THREADS, _SMALL = 2, 1e-3


@dataclass(frozen=True)
class Sighting:
    """Fiducials of the gauge seen in one frame.

    Attributes
    ----------
    frame : int
    marker : (M,) int
        Indices in the gauge's list.
    corner_px : (M, 4, 2)
        Corners, clockwise from the pattern's top left, to about a pixel.
    strangers : (K,) int
        Numbers of seen markers that do not belong to the gauge.
    """

    frame: int
    marker: Int
    corner_px: Float
    strangers: Int


def detector(dictionary: str) -> cv2.aruco.ArucoDetector:
    """Return a detector of the markers of OpenCV's ``dictionary``.

    It looks for them in three sizes. Six, every 8 px, take twice the time and find 423 markers in 48 pictures
    of four gauges where three find 421. Of drawn markers of 16 px, blurred by 1 px, half of which are lost to
    either, six find 90 and three 80.
    """
    parameters = cv2.aruco.DetectorParameters()
    parameters.adaptiveThreshWinSizeMin = 7
    parameters.adaptiveThreshWinSizeMax = 47
    parameters.adaptiveThreshWinSizeStep = 20
    known = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))
    return cv2.aruco.ArucoDetector(known, parameters)


def find_fiducials(
    images: Iterable[tuple[int, Image | None]], gauge: Gauge
) -> Iterator[tuple[Sighting, Image]]:
    """Yield the fiducials seen in each readable image, and the image."""
    finder = detector(gauge.fiducials.dictionary)
    place = {int(number): k for k, number in enumerate(gauge.ids)}
    readable = ((frame, image) for frame, image in images if image is not None)
    found = in_threads(lambda seen: (*seen, *detect(finder, seen[1])), readable, _THREADS)
    for frame, image, numbers, corners in found:
        known = np.array([int(n) in place for n in numbers], bool)
        marker = np.array([place[int(n)] for n in numbers[known]], np.int64)
        yield Sighting(frame, marker, corners[known], numbers[~known]), image


def detect(finder: cv2.aruco.ArucoDetector, image: Image) -> tuple[Int, Float]:
    """Return numbers (M,) and corners (M, 4, 2) of the markers in an image."""
    corners, numbers, _ = finder.detectMarkers(image)
    if numbers is None or not len(numbers):
        return np.zeros(0, np.int64), np.zeros((0, 4, 2))
    return np.ravel(numbers).astype(np.int64), _grown(np.array(corners, float).reshape(-1, 4, 2), _CONTOUR_PX)


def _grown(corner_px: Float, by_px: float) -> Float:
    """Return quadrilaterals (M, 4, 2), clockwise in the image, with every side moved outward."""
    side = np.roll(corner_px, -1, 1) - corner_px
    after = np.stack([side[..., 1], -side[..., 0]], -1) / np.linalg.norm(side, axis=-1, keepdims=True)
    before = np.roll(after, 1, 1)
    aslant = 1 + np.sum(before * after, -1, keepdims=True)
    return np.asarray(corner_px + by_px * (before + after) / aslant)


@dataclass(frozen=True)
class Edges:
    """Measured points of fiducial borders.

    Attributes
    ----------
    frame, marker, side : (M,) int
        Index of the frame in the recording, index of the fiducial in the gauge's list, edge 0 to 3.
    xyz_p, outward_p : (M, 3)
        Point of the border on the wall, and unit direction along the wall out of the fiducial, in P.
    uv : (M, 2)
        Measured pixel; only its place along ``normal`` is used.
    normal : (M, 2)
        Unit direction across the edge in the image, out of the fiducial.
    sigma_px : (M,)
    """

    frame: Int
    marker: Int
    side: Int
    xyz_p: Float
    outward_p: Float
    uv: Float
    normal: Float
    sigma_px: Float

    def select(self, keep: Bool) -> Edges:
        """Return the edges where ``keep`` (M,) is true."""
        return Edges(**{k: v[keep] for k, v in vars(self).items()})


def joined(parts: list[Edges]) -> Edges:
    """Return all parts as one."""
    return Edges(**{k: np.concatenate([getattr(p, k) for p in parts]) for k in vars(parts[0])})


def measure_edges(
    image: Image,
    index: int,
    marker: Int,
    T_pc: Float,
    camera: Camera,
    gauge: Gauge,
    parameters: GaugeParameters,
    white: int,
) -> tuple[Edges, int]:
    """Measure the borders of fiducials (M,) in an image of the frame ``index``, near where they should be.

    ``white`` is the grey level at which pictures are clipped: see `stages.calibrate.gauge.white.clip_level`.

    Also return the number of edges left out because the white beside them is overexposed: its blur is cut
    off at the brightest level, so that the edge seems to lie inside the black square.
    """
    predicted, border_px, half = predicted_edges(index, marker, T_pc, camera, gauge, parameters)
    keep = (border_px >= parameters.least_border_px) & _inside(predicted.uv, image.shape, half)
    predicted, half = predicted.select(keep), half[keep]
    if not len(predicted.uv):
        return predicted, 0
    t = half[:, None] * np.linspace(-1, 1, _PROFILE)
    at = predicted.uv[:, None] + t[..., None] * predicted.normal[:, None]
    grey = cv2.remap(
        image, at[..., 0].astype(np.float32), at[..., 1].astype(np.float32), cv2.INTER_CUBIC
    ).astype(float)
    offset, sigma = fit_steps(t, grey)
    overexposed = (grey >= white - BELOW_WHITE_GREY).any(1)
    uv = predicted.uv + offset[:, None] * predicted.normal
    measured = Edges(**(vars(predicted) | {"uv": uv, "sigma_px": sigma}))
    clear = np.isfinite(offset)
    return measured.select(clear & ~overexposed), int((clear & overexposed).sum())


def fit_steps(t: Float, grey: Float) -> tuple[Float, Float]:
    """Return place and 1 σ (M,) of blurred steps in profiles (M, K) at ``t`` (M, K); NaN where none is clear.

    Model: (a + b Φ((t - δ) / w)) (1 + s t), dark before bright; s is the slope of the light.
    """
    half, used = t[:, -1], _before_white_ends(grey)
    third = t.shape[1] // 3
    low, high = grey[:, :third].mean(1), grey[:, -third:].mean(1)
    p = np.stack([low, high - low, 0 * low, 0 * low, np.full(len(t), 0.9)], -1)
    for _ in range(12):
        residual, jacobian = _step_model(p, t, grey, used)
        normal = np.einsum("mki,mkj->mij", jacobian, jacobian)
        normal += 1e-6 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(5) / 5
        step = np.linalg.solve(normal, -np.einsum("mki,mk->mi", jacobian, residual)[..., None])[..., 0]
        step[:, 3] = np.clip(step[:, 3], -0.5, 0.5)
        step[:, 4] = np.clip(step[:, 4], -0.3, 0.3)
        p = p + step
        p[:, 4] = np.clip(p[:, 4], 0.25, 3.0)
        p[:, 3] = np.clip(p[:, 3], -half, half)
    residual, jacobian = _step_model(p, t, grey, used)
    noise = np.sqrt(np.sum(residual**2, 1) / (used.sum(1) - 5))
    normal = np.einsum("mki,mkj->mij", jacobian, jacobian)
    normal += 1e-9 * np.trace(normal, axis1=1, axis2=2)[:, None, None] * np.eye(5)
    sigma = noise * np.sqrt(np.linalg.inv(normal)[:, 3, 3])
    clear = (p[:, 1] > _LEAST_STEP_GREY) & (np.abs(p[:, 3]) < _INSIDE * half)
    clear &= (
        (noise < _MOST_NOISE * p[:, 1])
        & (p[:, 4] > _BLUR_PX[0])
        & (p[:, 4] < _BLUR_PX[1])
        & np.isfinite(sigma)
    )
    return np.where(clear, p[:, 3], np.nan), np.hypot(np.where(clear, sigma, np.nan), _LEAST_SIGMA_PX)


def _before_white_ends(grey: Float) -> Bool:
    """Return the samples (M, K) up to where the white ends, before a darker wall beyond a narrow border."""
    smooth = (grey[:, :-2] + grey[:, 1:-1] + grey[:, 2:]) / 3
    top, bright = smooth.max(1), grey.shape[1] // 2 + smooth[:, grey.shape[1] // 2 - 1 :].argmax(1)
    ends = top - smooth[:, -1] > _WHITE_ENDS * (top - smooth[:, 0])
    return np.asarray(np.arange(grey.shape[1]) <= np.where(ends, bright, np.inf)[:, None])


def _step_model(p: Float, t: Float, grey: Float, used: Bool) -> tuple[Float, Float]:
    """Return residuals (M, K) and their derivatives (M, K, 5); 0 where a sample is not ``used``."""
    a, b, s, d, w = (x[:, None] for x in p.T)
    x = (t - d) / w
    phi, density = 0.5 * (1 + erf(x / np.sqrt(2))), np.exp(-0.5 * x * x) / np.sqrt(2 * np.pi)
    light = 1 + s * t
    value = (a + b * phi) * light
    by = [light, phi * light, (a + b * phi) * t, -b * density / w * light, -b * density * x / w * light]
    return np.where(used, value - grey, 0.0), np.where(used[..., None], np.stack(by, -1), 0.0)


def predicted_edges(
    index: int, marker: Int, T_pc: Float, camera: Camera, gauge: Gauge, parameters: GaugeParameters
) -> tuple[Edges, Float, Float]:
    """Return predicted border points, the width of the border there and the half profile length, px."""
    along = np.linspace(-_SPAN, _SPAN, parameters.edge_samples)
    m, side, k = (x.ravel() for x in np.meshgrid(marker, np.arange(4), np.arange(len(along)), indexing="ij"))
    outward = _SIDES[side]
    tangent = np.stack([-outward[:, 1], outward[:, 0]], -1)
    local = outward + along[k][:, None] * tangent
    T_cp = inverse(T_pc)
    points = [gauge.on_marker(m, x) for x in (local, local + _SMALL * tangent, local + _SMALL * outward)]
    uv, uv_along, uv_out = (camera.project(transform(T_cp, x)).uv for x in points)
    direction = uv_along - uv
    length = np.linalg.norm(direction, axis=1)
    normal = np.stack([direction[:, 1], -direction[:, 0]], -1) / np.maximum(length, 1e-12)[:, None]
    across = np.einsum("mi,mi->m", uv_out - uv, normal)
    normal, across = normal * np.sign(across)[:, None], np.abs(across)
    border_px = 2 * across / _SMALL / _cells(gauge)
    half = np.minimum(parameters.edge_half_px, _OF_BORDER * border_px)
    outward_p = points[2] - points[0]
    outward_p /= np.linalg.norm(outward_p, axis=1)[:, None]
    edges = Edges(np.full(len(m), index), m, side, points[0], outward_p, uv, normal, 0 * across)
    return edges, border_px, half


def _cells(gauge: Gauge) -> int:
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, gauge.fiducials.dictionary))
    return int(dictionary.markerSize) + _BORDER_CELLS


def _inside(uv: Float, shape: tuple[int, ...], margin: Float) -> Bool:
    size = np.array([shape[1], shape[0]])
    with np.errstate(invalid="ignore"):
        inside = (uv > margin[:, None] + 2) & (uv < size - 3 - margin[:, None])
    return np.asarray(inside.all(1))
