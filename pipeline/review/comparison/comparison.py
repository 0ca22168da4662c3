"""A run compared with an earlier one of the same pipe."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import RingSamples, Trajectory, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.geometry.axis import distance_along
from pipeline.review.comparison.changes import Change, changes
from pipeline.review.comparison.growth import Resolution, Value
from pipeline.review.comparison.paired import PairedWalls
from pipeline.review.comparison.pictures import DifferenceLayers, difference_layers
from pipeline.review.comparison.places import put_together
from pipeline.review.comparison.registration import register
from pipeline.review.comparison.surface import Surface
from pipeline.review.decisions.replay import GONE, REJECTED, Finding
from pipeline.review.flat_tiles import FlatPicture, layers_of, overlay_picture, picture_of
from pipeline.review.measuring.wall import MeasuredWall
from pipeline.review.review import Review, State

_ROWS_AT_ONCE = 512
_CORRELATED_MM = 10.0
DIFFERENCE = ("difference", "difference_sigma")
EARLIER = "earlier-"


@dataclass(frozen=True)
class Comparison:
    """A review's run and an earlier run; everything is worked out when asked for, and again when a run was.

    Attributes
    ----------
    now, earlier : Review
    years : float or None
        Time between them, where it is known.
    """

    now: Review
    earlier: Review
    years: float | None = None

    @property
    def versions(self) -> tuple[str, str]:
        """Those of both runs' results."""
        return self.now.files.version, self.earlier.files.version

    @property
    def pair(self) -> PairedWalls:
        """Both walls and how they lie on each other.

        Raises
        ------
        UnusableError
            When the runs do not show the same wall.
        """
        return _pair(self, self.versions)

    @property
    def earlier_findings(self) -> tuple[Finding, ...]:
        """The earlier run's findings as its own review left them."""
        return _standing(self.earlier.state())

    @property
    def diameter(self) -> Value:
        """Growth of the mean diameter over all rings that both saw, mm."""
        return _diameter(self, self.versions)

    @property
    def wall_thickness_mm(self) -> float | None:
        """As assumed in the review, else as the recording says; None where unknown."""
        assumed = self.now.state().assumed.wall_thickness_mm
        if assumed:
            return assumed
        pipe = self.now.files.pipe()
        return pipe.wall_thickness_mm if pipe is not None else None

    def changes(self) -> tuple[Change, ...]:
        """Return what became of every finding of either run as it stands."""
        return _changes(self, self.versions, (self.now.state().revision, self.earlier.state().revision))

    def difference_layers(self) -> DifferenceLayers:
        """Return the walls' difference as overlays."""
        return _difference_layers(self, self.versions)

    def layers(self) -> tuple[str, ...]:
        """Return the names of the layers that it adds to those of the later run."""
        return (*DIFFERENCE, *(EARLIER + name for name in layers_of(self.earlier.files)))

    def picture(self, layer: str) -> FlatPicture:
        """Return a layer: one of the difference, of the earlier run, or of the later one.

        Raises
        ------
        InputError
            When there is none of that name.
        """
        if layer in DIFFERENCE:
            found = self.difference_layers()
            overlays = self.now.files.artefact(Overlays)
            return overlay_picture(overlays, found.difference if layer == DIFFERENCE[0] else found.sigma)
        if layer.startswith(EARLIER):
            return picture_of(self.earlier.files, layer.removeprefix(EARLIER))
        return picture_of(self.now.files, layer)

    @property
    def is_one_calibration(self) -> bool:
        """Whether both runs were measured with the same numbers, whose error then drops out.

        A run that found its instrument to differ from what is stated has numbers of its own.
        """
        both = (self.now, self.earlier)
        probes = {r.files.record()["input_sha256"]["probe"] for r in both}
        return len(probes) == 1 and all(r.files.artefact(Trajectory).instrument is None for r in both)

    def resolution(self, radius_mm: float) -> Resolution:
        """Return what limits the reading of depths."""
        own = max(_smoothing_mm(r) for r in (self.now, self.earlier))
        spacing = max(_ring_spacing_mm(r) for r in (self.now, self.earlier))
        along = float(np.hypot(own, spacing / np.sqrt(6)))
        relative = _calibration_mm(self.pair.now) / radius_mm
        return Resolution(along, own, relative, self.is_one_calibration)


# Results are kept with the versions of the runs they were made of, which callers give.
@lru_cache(maxsize=2)
def _pair(comparison: Comparison, _versions: tuple[str, str]) -> PairedWalls:
    before, after = _surface(comparison.earlier), _surface(comparison.now)
    welds = [_middle_mm(f) for f in comparison.earlier_findings if f.kind == DefectKind.WELD]
    return PairedWalls(before.wall, after.wall, register(before, after, np.array(welds)))


@lru_cache(maxsize=2)
def _changes(
    comparison: Comparison, _versions: tuple[str, str], _revisions: tuple[int, int]
) -> tuple[Change, ...]:
    pair = comparison.pair
    radius = float(np.nanmedian(pair.now.radius_mm[:: max(len(pair.now.distance_mm) // 200, 1)]))
    standing = _standing(comparison.now.state())
    places = put_together(comparison.earlier_findings, standing, pair.registration, radius)
    return changes(places, pair, comparison.resolution(radius))


@lru_cache(maxsize=1)
def _difference_layers(comparison: Comparison, _versions: tuple[str, str]) -> DifferenceLayers:
    return difference_layers(comparison.pair, comparison.now.files.artefact(Overlays))


@lru_cache(maxsize=2)
def _diameter(comparison: Comparison, _versions: tuple[str, str]) -> Value:
    wall = comparison.pair.now
    grown = np.concatenate([
        comparison.pair.stretch(i, i + _ROWS_AT_ONCE).diameter_mm
        for i in range(0, len(wall.distance_mm), _ROWS_AT_ONCE)
    ])  # fmt: skip
    known = grown[np.isfinite(grown)]
    wander = float(known.std()) / np.sqrt(max(len(known) * wall.step_mm / _CORRELATED_MM, 1.0))
    systematic = 2 * np.sqrt(2) * _calibration_mm(wall)
    return Value(
        float(np.median(known)), float(np.hypot(wander, 0.0 if comparison.is_one_calibration else systematic))
    )


def _surface(review: Review) -> Surface:
    return Surface(review.wall(), review.files.artefact(WallTexture))


def _standing(state: State) -> tuple[Finding, ...]:
    return tuple(f for f in state.findings if f.status not in (GONE, REJECTED))


def _middle_mm(finding: Finding) -> float:
    return (finding.size.distance_from_mm + finding.size.distance_to_mm) / 2


def _smoothing_mm(review: Review) -> float:
    """Return the 1 σ with which a run's map was smoothed, as its record says."""
    return float(review.files.record()["configuration"]["accumulate"]["smoothing_mm"])


def _ring_spacing_mm(review: Review) -> float:
    """Return the median distance between neighbouring rings; a triangle of that foot joins them."""
    trajectory, rings = review.files.artefact(Trajectory), review.files.artefact(RingSamples)
    of_rings = trajectory.T_pc[np.isin(trajectory.frame, rings.frame)]
    step = np.abs(np.diff(distance_along(trajectory.axis, of_rings)))
    moving = step[step > 0]
    return float(np.median(moving)) if len(moving) else 0.0


def _calibration_mm(wall: MeasuredWall) -> float:
    """Return the median of the radius' 1 σ from calibration."""
    thin = slice(None, None, max(len(wall.distance_mm) // 200, 1))
    total, random = (np.asarray(v[thin], float) for v in (wall.sigma_mm, wall.sigma_random_mm))
    return float(np.sqrt(np.nanmedian(np.maximum(total**2 - random**2, 0.0))))
