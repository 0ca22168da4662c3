"""Which findings an outline drawn by hand, or the hull of merged ones, covers besides its own."""

from __future__ import annotations

from collections.abc import Iterable

import cv2
import numpy as np

from pipeline.review.decisions.replay import Finding, Outline, beside


def covered(finding: Finding, others: Iterable[Finding]) -> tuple[str, ...]:
    """Return the other findings whose outlines reach into the finding's own."""
    return tuple(f.id for f in others if f.id != finding.id and _near(finding, f) and _meet(finding, f))


def _near(one: Finding, other: Finding) -> bool:
    a, b = one.size, other.size
    return a.distance_from_mm <= b.distance_to_mm and b.distance_from_mm <= a.distance_to_mm


def _meet(one: Finding, other: Finding) -> bool:
    """Return whether a corner of one lies inside the other; outlines that only cross do not count."""
    moved = beside(other.outline, one.outline)
    return _any_inside(moved, one.outline) or _any_inside(one.outline, moved)


def _any_inside(points: Outline, outline: Outline) -> bool:
    scale = np.array([1.0, 100.0])  # about mm both ways; what is inside does not depend on it
    polygon = (np.asarray(outline) * scale).astype(np.float32)
    return any(
        cv2.pointPolygonTest(polygon, tuple(map(float, p * scale)), False) > 0 for p in np.asarray(points)
    )
