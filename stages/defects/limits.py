"""The smallest defects that the search finds, stretch by stretch, from noise, ring spacing and photo.

Enough independent rings must cross a defect, each where it still shows (`stages.defects.corroborate`): where
rings are far apart, a small defect is missed however deep it is. That limits the size. What rings show of it,
interpolated between them, must stand out of the noise as far as a finding must to be more likely real than
not, and be deep enough to be reported: that limits the depth. Where the photo shows a defect, one ring is
enough; what does not change the photo, as a dent often does not, needs two.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq
from scipy.spatial import KDTree
from scipy.special import ndtr

from pipeline.adjustment.robust import row_median
from pipeline.adjustment.shared_light import HeldOver
from pipeline.arrays import Float
from pipeline.artefacts.findings import Detectable
from pipeline.artefacts.measured import WallTexture
from stages.defects.along import stretches
from stages.defects.corroborate import DEPTH_SHARE, LEAST_RINGS, LEAST_SAMPLES, NOISE_SIGMAS, Evidence
from stages.defects.credibility import COUNTED, Credibility
from stages.defects.detect import ROUND_MM, Detection, Filter
from stages.defects.parameters import DefectParameters
from stages.defects.surface import MeasuredWall

# "Found" means nine of ten; half of the tenth that is lost may lie between rings, the other half in noise.
_FOUND, _CROSSED = 0.9, 0.95
# 1 σ over diameter of a round defect that falls off as exp(−(1.5 ρ)²) to its rim, as dents do: the slimmest
# of the usual shapes, of which rings see least.
_SLIM = 1 / math.sqrt(18)
# A ring shows such a defect up to this part of its diameter beside the middle.
REACH = _SLIM * math.sqrt(2 * math.log(1 / DEPTH_SHARE))
# Smaller ones are not examined: the diameter of the smallest template's bump.
LEAST_SIZE_MM = 3.0
# Stretches are composed of pieces as long as most defects; neighbours whose limits differ by less than half
# are one (both chosen).
_PIECE_MM, _ALIKE = 20.0, 1.5
# Up to so many rings in a row are tried until they are worth two independent ones (chosen).
_MOST_RINGS = 40
# Scores up to three times the threshold are tried (chosen): a finding that needs more does not count.
_HIGHEST = 3.0
# Deeper defects are not asked for: in pipes of the sizes that a probe passes, they are holes.
_DEEPEST_MM = 30.0
# What is deeper than so much of its diameter is a hole, and no ring shows its bottom; larger defects than the
# largest template's are not examined (both chosen).
_STEEP, _LARGEST_MM = 0.4, 48.0
# A narrower kernel, mm, leaves each row with its nearest ring.
_NARROWEST_MM = 1e-3
# Rows and rings this far off influence what the filters show of a defect: the reach of the largest template.
_MARGIN_MM = 28.0
# A row counts as measured if at least half of its circle was.
_MEASURED = 0.5


def rings_needed(held: HeldOver) -> int:
    """Return how many rings in a row are worth two independent ones."""
    enough = (n for n in range(LEAST_RINGS, _MOST_RINGS) if held.independent(n) >= LEAST_RINGS)
    return next(enough, _MOST_RINGS)


def widest_spacing_mm(size_mm: float, rings: int) -> float:
    """Return how far apart rings may lie for nearly all defects of a size to be crossed by so many."""
    return 2 * REACH * size_mm / (rings - 1 + 2 * (_CROSSED - 0.5))


@dataclass(frozen=True)
class _Along:
    """The rows of a map (S,) between its first and last ring, and what the limit depends on.

    Attributes
    ----------
    at_mm : (S,)
    ring_mm : (R,)
        Where rings lie, in order.
    kernel_mm : (S,)
        1 σ of the kernel by which rings were smoothed along the pipe.
    ways_mm : (S, 2)
        Way to the nearest ring, and to the one with which there are enough, to the farthest sample needed.
    noise : (S,)
        σ of the wall as a multiple of its typical σ.
    measured, photo : (S,)
        Shares of the circle.
    """

    at_mm: Float
    ring_mm: Float
    kernel_mm: Float
    ways_mm: Float
    noise: Float
    measured: Float
    photo: Float


@dataclass(frozen=True)
class _Search:
    """The search: its filters, least score and depth, mm, of a finding that counts, and the wall's σ, mm."""

    detection: Detection
    score: float
    least_mm: float
    sigma_mm: float


def detectable(
    wall: MeasuredWall,
    detection: Detection,
    credibility: Credibility,
    photo: WallTexture,
    held: HeldOver,
    parameters: DefectParameters,
) -> tuple[Detectable, ...]:
    """Return the limits of detection between the first and the last ring, in order of distance.

    There are none where all rings lie at one place.
    """
    along = _along(wall, photo, rings_needed(held))
    if along is None:
        return ()
    count = max(1, round(len(along.at_mm) * wall.relief.cell_mm[0] / _PIECE_MM))
    cuts = np.linspace(0, len(along.at_mm), count + 1).astype(int)
    score = _score_that_counts(credibility, detection.threshold)
    search = _Search(detection, score, parameters.min_depth_mm, wall.relief.typical.sigma_mm)
    pieces = [_limit(along, slice(int(a), int(b)), search) for a, b in pairwise(cuts) if b > a]
    return tuple(_joined(pieces))


def _score_that_counts(credibility: Credibility, threshold: float) -> float:
    """Return the score, σ, from which a finding of two rings, not shown by the photo, counts."""
    score = threshold
    while credibility.chance_against_clutter(Evidence(LEAST_RINGS, False, score)) < COUNTED:
        score *= 1.02
        if score > _HIGHEST * threshold:
            return math.inf
    return score


def _along(wall: MeasuredWall, photo: WallTexture, needed: int) -> _Along | None:
    """Return what the limit depends on, for the rows between the first and the last ring, if any."""
    s, ring_mm = wall.relief.radius_map.distance_mm, np.sort(wall.cloud.rings()[1])
    measured, sigma = np.zeros(len(s)), np.zeros(len(s))
    for part in stretches(len(s)):
        rows = wall.relief.rows(part.own)
        measured[part.own], sigma[part.own] = rows.seen.mean(1), row_median(rows.sigma_mm)
    within = slice(*np.searchsorted(s, ring_mm[[0, -1]]))
    if within.start == within.stop:
        return None
    # So far from its middle, a ring still has enough samples side by side on a defect.
    around = LEAST_SAMPLES / 2 * _pitch_mm(wall, float(measured[within].mean()), len(ring_mm))
    ways = np.hypot(KDTree(ring_mm[:, None]).query(s[within, None], k=[1, needed])[0], around)
    noise = np.nan_to_num(sigma[within] / wall.relief.typical.sigma_mm, nan=1.0)
    shown = _photo_share(photo, s[within])
    kernel = np.maximum(wall.relief.radius_map.kernel_in(within), _NARROWEST_MM)
    return _Along(s[within], ring_mm, kernel, ways, noise, measured[within], shown)


def _pitch_mm(wall: MeasuredWall, measured: float, rings: int) -> float:
    """Return the mean distance of samples around the measured share of a ring, mm."""
    return 2 * math.pi * wall.relief.radius_mm * measured * rings / len(wall.cloud.cloud.frame)


def _photo_share(photo: WallTexture, at_mm: Float) -> Float:
    """Return which share of the circle the photo shows at places (n,) along the pipe."""
    row = np.rint((at_mm - photo.distance_from_mm) / photo.mm_per_px).astype(int)
    known = (row >= 0) & (row < len(photo.bgra))
    share = np.zeros(len(at_mm))
    share[known] = [float(np.mean(photo.bgra[k, :, 3] > 0)) for k in row[known]]
    return share


def _limit(along: _Along, rows: slice, search: _Search) -> Detectable:
    """Return the limit of detection on some rows."""
    from_mm, to_mm = float(along.at_mm[rows][0]), float(along.at_mm[rows][-1])
    with_photo, crossed = (_size(way) for way in along.ways_mm[rows].T)
    size, depth = _size_and_depth(along, rows, crossed, search)
    gap = np.searchsorted(along.ring_mm, along.at_mm[rows], "right").clip(1, len(along.ring_mm) - 1)
    spacing = float(np.median(along.ring_mm[gap] - along.ring_mm[gap - 1]))
    shares = (float(share[rows].mean()) for share in (along.measured, along.photo))
    return Detectable(from_mm, to_mm, spacing, size, depth, with_photo, *shares)


def _size(way_mm: Float) -> float:
    """Return the smallest diameter, mm, at which rings that far off (n,) show nearly all defects."""
    way = float(np.quantile(way_mm, _CROSSED, method="higher"))
    return max(LEAST_SIZE_MM, math.ceil(way / REACH * 2) / 2) if math.isfinite(way) else math.inf


def _size_and_depth(along: _Along, rows: slice, size_mm: float, search: _Search) -> tuple[float, float]:
    """Return the smallest diameter from ``size_mm`` on, mm, and depth of defects that are found; else inf.

    In noise, small defects would have to be deeper than wide: then larger ones are tried. No size is found
    where less than half of each circle was measured.
    """
    while size_mm <= _LARGEST_MM and (along.measured[rows] >= _MEASURED).any():
        depth = _depth(along, rows, size_mm, search)
        if depth <= _STEEP * size_mm:
            return size_mm, depth
        size_mm = math.ceil(2.4 * size_mm) / 2
    return math.inf, math.inf


def _depth(along: _Along, rows: slice, size_mm: float, search: _Search) -> float:
    """Return the depth, mm, from which nine of ten defects of a size are found on some rows.

    Filters are linear: the score of a defect is the wall's own, as often as that occurs, and what the defect
    adds. The lower half of the wall's scores are of the other sign, and make a defect look shallower.
    """
    width = _SLIM * size_mm
    used, height, score = _responses(along, rows, width, search.detection)
    shown = np.exp(-0.5 * (along.ways_mm[rows, 1] / width) ** 2)
    noise = float(np.median(along.noise[rows]))
    adds = (score / noise)[:, None, None] * used.gain[:, None]
    # A depth is a mean over 1 mm, as narrow as the smallest template.
    one_sigma = search.detection.filters[0].height_sigma_mm * noise
    unevenness = search.sigma_mm * noise

    def found(depth_mm: float) -> float:
        high = (depth_mm * adds + used.noise > search.score).mean((1, 2))
        deep = ndtr((depth_mm * height - search.least_mm) / one_sigma)
        clear = ndtr((depth_mm * shown - NOISE_SIGMAS * search.sigma_mm) / unevenness)
        return float(np.mean(high * deep * clear * (shown >= DEPTH_SHARE)))

    if found(_DEEPEST_MM) < _FOUND:
        return math.inf
    return float(brentq(lambda depth: found(depth) - _FOUND, 0.0, _DEEPEST_MM, xtol=1e-4))


def _responses(along: _Along, rows: slice, width: float, detection: Detection) -> tuple[Filter, Float, Float]:
    """Return the best filter for a defect of unit depth, the defect's top in the map, and its score, σ.

    Both (n,) are for a defect in the middle of each of some rows.
    """
    at = along.at_mm[rows]
    near = (np.abs(along.at_mm - at.mean()) < _far(at)) & (along.measured >= _MEASURED)
    s, kernel = along.at_mm[near], along.kernel_mm[near]
    rings = along.ring_mm[np.abs(along.ring_mm - at.mean()) < _far(at) + _PIECE_MM]
    # The nearest ring always has weight, however far it is.
    off2 = (s[:, None] - rings) ** 2
    weight = np.exp(-0.5 * (off2 - off2.min(1, keepdims=True)) / kernel[:, None] ** 2)
    mapped = weight / weight.sum(1, keepdims=True) @ np.exp(-0.5 * ((rings[:, None] - at) / width) ** 2)
    filters = detection.filters[: len(ROUND_MM)]
    scores = [_score(s, mapped, width, t) / f.height_sigma_mm for t, f in zip(ROUND_MM, filters, strict=True)]
    best = int(np.argmax(np.mean(scores, axis=1)))
    return filters[best], mapped.max(0), scores[best]


def _score(s: Float, mapped: Float, width: float, template_mm: float) -> Float:
    """Return the height (n,) that a template measures of bumps ``mapped`` (S, n) on rows at ``s`` (S,)."""
    bump = np.exp(-0.5 * ((s[:, None] - s) / template_mm) ** 2)
    power = (bump**2).sum(1)
    around = width * math.sqrt(2 / (width**2 + template_mm**2))
    return np.asarray((bump @ mapped / np.sqrt(power * np.median(power))[:, None]).max(0) * around)


def _far(at_mm: Float) -> float:
    """Return how far from their middle something influences the scores at places (n,) along the pipe."""
    return float(np.ptp(at_mm)) / 2 + _MARGIN_MM


def _joined(pieces: Sequence[Detectable]) -> Iterator[Detectable]:
    """Yield neighbours with about the same limit as one, with the larger of their limits."""
    run = pieces[0]
    for piece in pieces[1:]:
        if not _alike(run, piece):
            yield run
            run = piece
            continue
        run = _one(run, piece)
    yield run


def _one(run: Detectable, piece: Detectable) -> Detectable:
    """Return two neighbouring stretches as one."""
    both = (run, piece)
    lengths = [max(d.to_mm - d.from_mm, 1e-9) for d in both]

    def mean(name: str) -> float:
        return float(np.average([getattr(d, name) for d in both], weights=lengths))

    return Detectable(
        run.from_mm, piece.to_mm, mean("ring_spacing_mm"), max(d.size_mm for d in both),
        max(d.depth_mm for d in both), max(d.photo_size_mm for d in both), mean("measured"), mean("photo"),
    )  # fmt: skip


def _alike(one: Detectable, other: Detectable) -> bool:
    pairs = ((one.size_mm, other.size_mm), (one.depth_mm, other.depth_mm))
    return all(a == b or max(a, b) < _ALIKE * min(a, b) for a, b in pairs)
