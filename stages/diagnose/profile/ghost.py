"""A second, fainter line: light bounced across the bore, or a copy at a constant distance.

Light that crosses the bore meets the wall at a distance from the line along the axis of (shared PHYSICS
notes) tilt: 4 r φ cos(ψ − ψ₀) behind it, cone: 2 r ε₀ ahead of it. The line's own place does not matter, so
that this separates the laser's misalignment from the camera's.

φ is the sheet's inclination to the pipe. The probe's own adds to it, which poses would show and lines alone
do not: the bounced line of an aligned sheet lies under the line, and moves across it while the probe sways.
One of 1 % was not found in a gauge run that swayed by 1.3°, which moves it by 3 mm.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numba
import numpy as np

from pipeline.arrays import Bool, Float, Int
from stages.diagnose.profile.cells import Cells
from stages.diagnose.profile.finding import Tested, tested
from stages.diagnose.profile.matched_filter import STEP_PX, Responses

LARGEST_RAD, _TILT_STEP_RAD, _CONE_STEP_RAD = np.radians(1.2), np.radians(0.08), np.radians(0.16)
_LARGEST_MM, _COPY_STEP_MM = 5.0, 0.04
CLEAR_WIDTHS = 2.5
# Seen through a filter as wide as the line, a copy of it is 10 % high this many widths from its middle.
_OWN_WIDTHS = 3.0
# A part of the ring is used to compare the line's sides if it has this share of the best part's information.
_LEAST_SHARE = 0.1
_SHRINK, _HALVINGS = 0.5, 9
# One step moves a second line by 1 px on average; the filter sees the same light over 2 px.
_TRIES_A_STEP = 0.5


@dataclass(frozen=True)
class SecondLine:
    """A second line where one law puts it.

    Attributes
    ----------
    parameters : (P,)
        Of the law, with their covariance (P, P).
    relative, random, floor : float
        Height relative to the line, its random 1 σ, and the error by image formation at its distances.
    information : float
        How well the cells would show a line there; the misfit falls by relative² × information.
    groups : int
        Number of blocks, or of parts of the ring if fewer, from which σ is estimated.
    distance_px : (N,)
        From the line, in every cell.
    tries : float
        Number of independent hypotheses among which it was the best.
    """

    parameters: Float
    relative: float
    random: float
    floor: float
    information: float
    groups: int
    distance_px: Float
    parameter_covariance: Float
    tries: float = 1.0

    @property
    def test(self) -> Tested:
        """Height against its σ, corrected for the number of hypotheses (Bonferroni)."""
        one = tested(self.relative, self.random, self.floor, self.groups)
        return replace(one, p_value=min(1.0, self.tries * one.p_value))

    @property
    def misfit_drop(self) -> float:
        """By how much the weighted sum of squares falls."""
        return self.relative**2 * self.information


def bounced(found: Responses, cells: Cells, floor: float) -> SecondLine:
    """Return the best line bounced across the bore: parameters tan φ (along x, y) and ε₀, rad.

    ``floor`` is the relative height that ordinary image formation may leave at any distance.
    """
    w = cells.whole
    scale = cells.px_per_mm[w] * cells.radius_mm[w]
    psi = cells.azimuth_rad[w]
    design = np.stack([4 * scale * np.cos(psi), 4 * scale * np.sin(psi), -2 * scale], axis=1)
    tilt = np.arange(-LARGEST_RAD, LARGEST_RAD + 1e-9, _TILT_STEP_RAD)
    cone = np.arange(-LARGEST_RAD, LARGEST_RAD + 1e-9, _CONE_STEP_RAD)
    grid = np.stack(np.meshgrid(tilt, tilt, cone, indexing="ij"), -1).reshape(-1, 3)
    steps = np.array([_TILT_STEP_RAD, _TILT_STEP_RAD, _CONE_STEP_RAD])
    return _best(found, design, grid, steps, cells, floor)


def copied(found: Responses, cells: Cells, floor: float) -> SecondLine:
    """Return the best copy at a constant axial distance, mm, forward positive."""
    w = cells.whole
    grid = np.arange(-_LARGEST_MM, _LARGEST_MM + 1e-9, _COPY_STEP_MM)[:, None]
    design, steps = -cells.px_per_mm[w][:, None], np.array([_COPY_STEP_MM])
    return _best(found, design, grid, steps, cells, floor)


def _best(
    found: Responses, design: Float, grid: Float, steps: Float, cells: Cells, floor: float
) -> SecondLine:
    """Search the grid of parameters, then refine with decreasing steps; σ by leaving out blocks."""
    block, part = cells.block[cells.whole], cells.part[cells.whole]
    width_px = float(np.median(cells.width_px[cells.whole])) if len(block) else 0.0
    clear = CLEAR_WIDTHS * width_px

    def rated(parameters: Float) -> Float:
        return np.asarray(_rate(found.score, found.information, design, parameters, block, clear))

    rating = rated(grid)
    if not len(grid) or not np.isfinite(rating).any() or rating.max() <= 0:
        size = design.shape[1]
        return SecondLine(
            np.zeros(size), 0.0, 1.0, floor, 0.0, 0, np.zeros(len(design)), np.zeros((size, size))
        )
    best = grid[int(np.argmax(rating))]
    for _ in range(_HALVINGS):
        around = _around(best, steps)
        best = around[int(np.argmax(rated(around)))]
        steps = steps * _SHRINK
    line = _sized(found, design, best, block, part, floor)
    left = _skirt(found, line, width_px, part)
    return replace(line, floor=float(np.hypot(floor, left)), tries=_TRIES_A_STEP ** len(steps) * len(grid))


def _around(best: Float, steps: Float) -> Float:
    moves = np.stack(np.meshgrid(*[[-1, 0, 1]] * len(best), indexing="ij"), -1).reshape(-1, len(best))
    return np.asarray(best + moves * steps)


@numba.njit(cache=True, nogil=True)
def _rate(score, information, design, parameters, block, clear):  # type: ignore[no-untyped-def]
    """Σ score / √(Σ information) of parameters (K, P), without the block that supports them most.

    One block beside an edge of the bore must not decide. −1 where hardly any second line is clear of the
    line.
    """
    cells, distances = score.shape
    out = np.empty(len(parameters))
    middle = (distances - 1) / 2
    blocks = block.max() + 1
    for k in range(len(parameters)):
        s, i = np.zeros(blocks), np.zeros(blocks)
        apart = 0
        for n in range(cells):
            d = 0.0
            for j in range(design.shape[1]):
                d += design[n, j] * parameters[k, j]
            if abs(d) > clear:
                apart += 1
            at = middle + d / STEP_PX
            low = int(np.floor(at))
            if low < 0 or low >= distances - 1:
                continue
            f = at - low
            s[block[n]] += (1 - f) * score[n, low] + f * score[n, low + 1]
            i[block[n]] += (1 - f) * information[n, low] + f * information[n, low + 1]
        most = np.argmax(s)
        left = np.sum(i) - i[most]
        # A second line that is clear of the line in less than a fifth of the cells (chosen) may be the line's
        # foot.
        out[k] = (np.sum(s) - s[most]) / np.sqrt(left) if left > 0 and apart > 0.2 * cells else -1.0
    return out


def _sized(found: Responses, design: Float, best: Float, block: Int, part: Int, floor: float) -> SecondLine:
    """Return height, σ and the parameters' covariance at the best place.

    A second line has the same height in all frames and all round: differences between parts give the σ.
    """
    at = design @ best
    score, information = _at(found.score, found, at), _at(found.information, found, at)
    of_blocks, of_parts = (_jackknife(score, information, group) for group in (block, part))
    groups, height = min(of_blocks[1], of_parts[1]), float(score.sum() / information.sum())
    return SecondLine(
        best, height, float(np.hypot(of_blocks[0], of_parts[0])), floor, float(information.sum()), groups,
        at, _place_covariance(found, design, at, height, block),
    )  # fmt: skip


def _jackknife(score: Float, information: Float, group: Int) -> tuple[float, int]:
    """Return the σ of Σ score / Σ information by leaving out groups, and the number of groups."""
    parts = np.array([(score[g].sum(), information[g].sum()) for g in _each(group)])
    total = parts.sum(0)
    left = total - parts
    others = left[:, 0] / np.maximum(left[:, 1], 1e-12)
    count = len(parts)
    sigma = np.sqrt((count - 1) / count * np.sum((others - total[0] / total[1]) ** 2))
    return float(sigma), int(np.sum(parts[:, 1] > _LEAST_SHARE * parts[:, 1].max()))


def _skirt(found: Responses, line: SecondLine, width_px: float, part: Int) -> float:
    """Return the relative height, as 1 σ, of a second line that the line's own skirt may imitate.

    Compression and the lens leave a skirt around a bright line, higher on one side than on the other by up to
    its own height. Two quantities are measured at the second line's distances and combined: the height of the
    skirt, as mean over both sides all round (minus half of the second line's own height), and the difference
    of the sides in parts of the ring without a second line. On a gauge run without any second line, under
    four codecs, the best second line found was 0.3 to 1.4 times as high.
    """
    apart = np.abs(line.distance_px)
    clear = apart > CLEAR_WIDTHS * width_px
    if not clear.any():
        return 0.0
    off = np.abs(found.distance_px) - apart[:, None]
    copy = 0.5 * line.relative * np.exp(-0.25 * (off / width_px) ** 2)
    total = np.maximum(found.information.sum(0), 1e-12)
    height = (found.skirt - copy * found.information).sum(0) / total
    own = np.abs(off) < _OWN_WIDTHS * width_px
    beside = (np.where(own, 0.0, values) for values in (found.score, found.information))
    parts, known = (np.array([values[g].sum(0) for g in _each(part)]) for values in beside)
    measured = known > _LEAST_SHARE * known.max()
    uneven = np.where(measured, parts / np.maximum(known, 1e-12), 0.0)
    square = height**2 + (uneven**2).sum(0) / np.maximum(measured.sum(0), 1)
    level = np.interp(apart, found.distance_px, np.sqrt(square))
    weight = np.where(clear, _at(found.information, found, line.distance_px), 0.0)
    return float((weight * level).sum() / max(weight.sum(), 1e-12))


def _each(group: Int) -> list[Bool]:
    """Return, for each group, which cells (N,) are in it."""
    return [group == g for g in np.unique(group)]


def _at(values: Float, found: Responses, distance_px: Float) -> Float:
    """Return the values (N,) of responses (N, D) at a distance (N,) in each cell; 0 out of reach."""
    place = (distance_px - found.distance_px[0]) / STEP_PX
    low = np.clip(np.floor(place).astype(int), 0, len(found.distance_px) - 2)
    f, row = place - low, np.arange(len(place))
    inside = (place >= 0) & (place <= len(found.distance_px) - 1)
    return np.where(inside, (1 - f) * values[row, low] + f * values[row, low + 1], 0.0)


def _place_covariance(found: Responses, design: Float, at: Float, height: float, block: Int) -> Float:
    """Return the parameters' covariance from the fit's curvature and its slopes' scatter over blocks."""

    def gain(d: Float) -> Float:
        score, information = _at(found.score, found, d), _at(found.information, found, d)
        return np.asarray(height * score - 0.5 * height**2 * information)

    up, here, down = gain(at + STEP_PX), gain(at), gain(at - STEP_PX)
    slope, curvature = (up - down) / (2 * STEP_PX), (up - 2 * here + down) / STEP_PX**2
    bread = -design.T @ (curvature[:, None] * design)
    each = np.array([design[b].T @ slope[b] for b in _each(block)])
    spread = each - each.mean(0)
    inverse = np.linalg.pinv(bread)
    return np.asarray(inverse @ (spread.T @ spread) @ inverse)
