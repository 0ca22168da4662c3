"""Profiles averaged over blocks of neighbouring frames, and what is left of them beside a Gaussian line."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.adjustment.robust import robust_spread
from pipeline.arrays import Bool, Float, Int
from stages.diagnose.profile.geometry import LineGeometry
from stages.diagnose.profile.measure import LineProfiles

BLOCK_FRAMES, LEAST_FRAMES = 12, 6
CORE_REACH = 3.5
_LEAST_HEIGHT = 600.0
_SECOND_LINE = 3.0
_SECOND_LINE_FLOOR = 5e-4
_ODD = 5.0
_STEPS = 12


@dataclass(frozen=True)
class Cells:
    """Profiles of N cells: a block of frames by an azimuth sector.

    Attributes
    ----------
    offset_px : (B,)
    block, sector : (N,) int
    profile : (N, B)
        Light over the line's height; NaN where nothing is seen.
    centre_px, width_px : (N,)
        Of the Gaussian fitted to the profile.
    rest : (N, B)
        Profile less that Gaussian, over the Gaussian's height.
    whole : (N,) bool
        Whether the line's middle is seen unclipped; without it only tails are.
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
        """Return the cells of blocks ``first`` to before ``end`` alone."""
        k = (self.block >= first) & (self.block < end)
        return Cells(
            self.offset_px, self.block[k] - first, self.sector[k], self.profile[k], self.centre_px[k],
            self.width_px[k], self.rest[k], self.whole[k], self.azimuth_rad[k], self.px_per_mm[k],
            self.radius_mm[k], self.height[k], self.frames[first:end],
        )  # fmt: skip


def make_cells(profiles: LineProfiles, geometry: LineGeometry) -> Cells:
    """Average profiles over blocks of steady frames; frames with a step's second line are left out."""
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


def fit_gaussians(profile: Float, offset_px: Float, start_px: float = 1.2) -> tuple[Float, Float, Float]:
    """Return centre, width and height (N,) of Gaussians fitted to the middle of profiles (N, B), px."""
    n = len(profile)
    centre, log_width, peak = np.zeros(n), np.full(n, np.log(start_px)), np.ones(n)
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
    return centre, np.exp(log_width), np.where(np.abs(peak) > 1e-3, peak, 1.0)


def _second_lines(profiles: LineProfiles) -> Bool:
    """Return (F,) whether more light is beside the line than in nearly all frames: an edge of the bore."""
    far = np.abs(profiles.offset_px) > 8
    light, height = profiles.light[..., far].sum((1, 2)), profiles.height[..., far].sum((1, 2))
    share = light / np.maximum(height, 1e-9)
    usual = np.median(share)
    spread = robust_spread(share - usual)
    limit = max((_SECOND_LINE - 1) * usual, _ODD * spread) + _SECOND_LINE_FLOOR
    return np.asarray(share - usual > limit)


def _blocks(good: Bool) -> list[Int]:
    """Return runs of neighbouring good frames, of about `BLOCK_FRAMES` each, none below `LEAST_FRAMES`."""
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
