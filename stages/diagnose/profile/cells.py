"""Place and motion of the line by frame and sector, and its profiles averaged over neighbouring frames."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.interpolate import CubicSpline

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Float32, Int, runs_of
from pipeline.artefacts.measured import RingSamples
from pipeline.instrument.probe import Probe
from stages.diagnose.profile.measure import LineProfiles

BLOCK_FRAMES, LEAST_FRAMES = 12, 6
# 30° of the ring: several of the codec's blocks of 16 px, within which its errors are correlated.
_SECTORS_A_PART = 6
CORE_REACH = 3.5
_LEAST_HEIGHT = 600.0
_SECOND_LINE = 3.0
_SECOND_LINE_FLOOR = 5e-4
_ODD = 5.0
_STEPS = 12
_JUMP, _BEFORE, _AFTER = 0.006, 2, 3
_MOTION_ORDER = 3
_CLIPPED_SHARE = 0.2


@dataclass(frozen=True)
class LineGeometry:
    """The line by frame and sector, (F, S) each; NaN without enough samples.

    Attributes
    ----------
    azimuth_rad : (S,)
    radius_px, width_px, height
        Medians of the ring samples; width and height of samples that did not clip.
    radius_mm, theta_rad
        Distance from the optical axis; polar angle.
    px_per_mm
        Outward shift of the image for a step of 1 mm back along the axis: positive.
    speed_px_s
        Of the line's radius.
    steady : (F,) bool
        Whether the ring does not jump between bores around this frame.
    """

    azimuth_rad: Float
    radius_px: Float
    width_px: Float
    height: Float
    radius_mm: Float
    theta_rad: Float
    px_per_mm: Float
    speed_px_s: Float
    steady: Bool


def line_geometry(
    rings: RingSamples, rows: Int, time_s: Float, azimuth_rad: Float, clipped: Float, probe: Probe
) -> LineGeometry:
    """Return the geometry of the ring samples in ``rows``; ``clipped`` (F, S) is the share that clips."""
    sectors = len(azimuth_rad)
    valid = rings.valid[rows]
    radius = _medians(rings.radius_px[rows], valid, sectors)
    width = _medians(rings.width_px[rows], valid, sectors)
    height = _medians(rings.amplitude[rows], valid, sectors)
    direction = np.stack([np.cos(azimuth_rad), np.sin(azimuth_rad)], -1)
    xyz = probe.triangulate(rings.centre_px + radius[..., None] * direction)
    by_point = probe.camera.project_jacobian(xyz).by_point
    inward = -np.einsum("fsi,si->fs", by_point[..., 2], direction)
    middle = np.nanmedian(radius, axis=1)
    steady = _steady(middle)
    return LineGeometry(
        azimuth_rad, radius, np.where(clipped > _CLIPPED_SHARE, np.nan, width), height,
        np.hypot(xyz[..., 0], xyz[..., 1]), np.arctan2(np.hypot(xyz[..., 0], xyz[..., 1]), xyz[..., 2]),
        inward, _speed(radius, time_s, azimuth_rad, steady), steady,
    )  # fmt: skip


def _medians(values: Float32, valid: Bool, sectors: int) -> Float:
    """Return medians (F, S) over the valid values (F, A) in each of S sectors; A is at least S."""
    seen = np.where(valid, values, np.nan).astype(float)
    sector = np.arange(seen.shape[1]) * sectors // seen.shape[1]
    first = np.searchsorted(sector, np.arange(1, sectors))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return np.stack([np.nanmedian(part, axis=1) for part in np.split(seen, first, axis=1)], axis=1)


def _steady(middle: Float) -> Bool:
    """Return False around frames (F,) between which the ring's median radius jumps."""
    steady = np.isfinite(middle)
    for k in np.flatnonzero(np.abs(np.diff(middle)) > _JUMP * middle[:-1]):
        steady[max(k - _BEFORE, 0) : k + _AFTER + 1] = False
    return steady


def _speed(radius: Float, time_s: Float, azimuth_rad: Float, steady: Bool) -> Float:
    """Return the speed (F, S), px/s: splines through the low harmonics of every run of steady frames."""
    orders = np.arange(1, _MOTION_ORDER + 1)
    waves = np.outer(azimuth_rad, orders)
    basis = np.concatenate([np.ones((len(azimuth_rad), 1)), np.cos(waves), np.sin(waves)], axis=1)
    out = np.full(radius.shape, np.nan)
    # With 0.3 of a ring missing, its low harmonics can hardly be separated (chosen).
    for run in runs_of(steady & (np.isfinite(radius).mean(1) > 0.7)):
        if run.stop - run.start < 4:
            continue
        parts = [
            np.linalg.lstsq(basis[g], r[g], rcond=None)[0] for r in radius[run] for g in [np.isfinite(r)]
        ]
        out[run] = CubicSpline(time_s[run], np.array(parts))(time_s[run], 1) @ basis.T
    return out


@dataclass(frozen=True)
class Cells:
    """Profiles of N cells; a cell is a block of frames in one azimuth sector.

    Attributes
    ----------
    offset_px : (B,)
    block, sector : (N,) int
    profile : (N, B)
        Light over the line's height; NaN where nothing is seen.
    centre_px, width_px : (N,)
        Of the Gaussian fitted to the profile.
    rest : (N, B)
        Profile minus that Gaussian, over the Gaussian's height.
    whole : (N,) bool
        Whether the line's middle is unclipped; otherwise only its tails are used.
    azimuth_rad, px_per_mm, radius_mm, height : (N,)
        Means over the block.
    frames : tuple of (K,) int
        Rows of each block.
    """

    offset_px: Float
    block: Int
    sector: Int
    profile: Float
    centre_px: Float
    width_px: Float
    rest: Float
    whole: Bool
    azimuth_rad: Float
    px_per_mm: Float
    radius_mm: Float
    height: Float
    frames: tuple[Int, ...]

    def of_blocks(self, first: int, end: int) -> Cells:
        """Return only the cells of blocks ``first`` up to, but not including, ``end``."""
        k = (self.block >= first) & (self.block < end)
        shared = ("offset_px", "frames")
        own = {f.name: getattr(self, f.name)[k] for f in fields(self) if f.name not in shared}
        own["block"] = own["block"] - first
        return replace(self, **own, frames=self.frames[first:end])

    @property
    def part(self) -> Int:
        """(N,) part of the ring that each cell is in; errors of different parts are independent."""
        return self.sector // _SECTORS_A_PART

    def block_of_frames(self, count: int) -> Int:
        """Return the block (F,) of each of ``count`` frames; −1 for frames in no block."""
        block = np.full(count, -1)
        for k, rows in enumerate(self.frames):
            block[rows] = k
        return block

    def less(self, light: Float) -> Cells:
        """Return the cells minus a light (M, B), relative to the line's height, in those that are whole."""
        profile, rest = self.profile.copy(), self.rest.copy()
        profile[self.whole] -= light
        rest[self.whole] -= light
        return replace(self, profile=profile, rest=rest)


def make_cells(profiles: LineProfiles, geometry: LineGeometry) -> Cells:
    """Average profiles over blocks of steady frames, without frames that show a second line at a step."""
    blocks = _blocks(geometry.steady & ~_second_lines(profiles))
    sectors = len(profiles.azimuth_rad)
    bins = len(profiles.offset_px)
    light = np.array([profiles.light[b].sum(0) for b in blocks], float).reshape(-1, bins)
    height = np.array([profiles.height[b].sum(0) for b in blocks], float).reshape(-1, bins)
    with np.errstate(invalid="ignore", divide="ignore"):
        profile = np.where(height > 0, light / height, np.nan)
    whole: Bool = np.all(height[:, np.abs(profiles.offset_px) < 5] > _LEAST_HEIGHT, axis=1)
    centre, width, peak = fit_gaussians(np.where(whole[:, None], profile, 0.0), profiles.offset_px)
    gauss = np.exp(-0.5 * ((profiles.offset_px - centre[:, None]) / width[:, None]) ** 2)
    return Cells(
        profiles.offset_px, np.repeat(np.arange(len(blocks)), sectors),
        np.tile(np.arange(sectors), len(blocks)),
        profile, centre, width, np.where(whole[:, None], profile / peak[:, None] - gauss, np.nan), whole,
        np.tile(profiles.azimuth_rad, len(blocks)),
        _block_means(geometry.px_per_mm, blocks), _block_means(geometry.radius_mm, blocks),
        _block_means(geometry.height, blocks), tuple(blocks),
    )  # fmt: skip


def fit_gaussians(profile: Float, offset_px: Float) -> tuple[Float, Float, Float]:
    """Return centre, width and height (N,) of Gaussians fitted to the middle of profiles (N, B), px."""
    n = len(profile)
    centre, log_width, peak = np.zeros(n), np.full(n, np.log(1.2)), np.ones(n)
    near = np.abs(offset_px) < 12
    t, p = offset_px[near], profile[:, near]
    for _ in range(_STEPS):
        width = np.exp(log_width)[:, None]
        x = (t - centre[:, None]) / width
        e = np.exp(-0.5 * x * x) * (np.abs(x) < CORE_REACH)
        seen = np.abs(x) < CORE_REACH
        jacobian = np.stack([e, peak[:, None] * e * x / width, peak[:, None] * e * x * x], -1)
        normal = np.einsum("nbi,nbj->nij", jacobian, jacobian) + 1e-9 * np.eye(3)
        step = np.linalg.solve(
            normal, np.einsum("nbi,nb->ni", jacobian, seen * (p - peak[:, None] * e))[..., None]
        )[..., 0]
        peak = peak + step[:, 0]
        centre = np.clip(centre + np.clip(step[:, 1], -0.5, 0.5), -4, 4)
        log_width = np.clip(log_width + np.clip(step[:, 2], -0.3, 0.3), np.log(0.4), np.log(4.0))
    # Without a line, a height of 1 keeps divisions finite.
    return centre, np.exp(log_width), np.where(np.abs(peak) > 1e-3, peak, 1.0)


def _second_lines(profiles: LineProfiles) -> Bool:
    """Return frames (F,) with more light beside the line than nearly all others: an edge of the bore."""
    far = np.abs(profiles.offset_px) > 8
    light, height = profiles.light[..., far].sum((1, 2)), profiles.height[..., far].sum((1, 2))
    share = light / np.maximum(height, 1e-9)
    usual = np.median(share)
    spread = robust_spread(share - usual)
    limit = max((_SECOND_LINE - 1) * usual, _ODD * spread) + _SECOND_LINE_FLOOR
    return np.asarray(share - usual > limit)


def _blocks(good: Bool) -> list[Int]:
    """Return runs of neighbouring good frames, about `BLOCK_FRAMES` each and at least `LEAST_FRAMES`."""
    index = np.flatnonzero(good)
    if not len(index):
        return []
    runs = np.split(index, np.flatnonzero(np.diff(index) > 2) + 1)
    parts = [p for r in runs for p in np.array_split(r, max(1, round(len(r) / BLOCK_FRAMES)))]
    return [p for p in parts if len(p) >= LEAST_FRAMES]


def _block_means(values: Float, blocks: list[Int]) -> Float:
    """Return (N,) means over each block of values (F, S)."""
    seen = np.isfinite(values)
    filled = np.where(seen, values, 0.0)
    means = [filled[b].sum(0) / np.where(seen[b].any(0), seen[b].sum(0), np.nan) for b in blocks]
    return np.array(means, float).reshape(-1)
