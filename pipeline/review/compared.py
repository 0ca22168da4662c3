"""A review's run compared with an earlier one: inputs of the comparison, and its content for the page."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np

from pipeline.artefacts.cloud_along import cloud_along
from pipeline.artefacts.comparison import (
    FAMILY_ERROR,
    Change,
    Comparison,
    Fate,
    FindingPair,
    OutlinedFinding,
    RegisteredWalls,
    Registration,
    SurveyedWall,
    WallPair,
)
from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.errors import InputError
from pipeline.files.codec import digest
from pipeline.files.provenance import MadeBy
from pipeline.review.decisions.replay import GONE, REJECTED, Finding
from pipeline.review.documents import cleaned, overlay_document
from pipeline.review.flat_tiles import FlatPicture, Limits, layers_of, overlay_picture, picture_of
from pipeline.review.review import Review, State, open_review
from pipeline.review.run_files import RunFiles
from pipeline.review.tables import GROWTH_COLUMNS, csv_text, growth_rows

DIFFERENCE = ("difference", "difference_sigma")
EARLIER = "earlier-"
_TABLES = {"growth.csv": "text/csv", "growth.json": "application/json"}
# A place is shown with at least so much wall to each side, as wide as the review shows a finding.
_HALF_VIEW_MM = 12.0


@dataclass(frozen=True)
class RunPair:
    """A review's run and an earlier run of the same pipe, as inputs of a comparison."""

    now: Review
    earlier: Review

    @property
    def state(self) -> tuple[str, str, int, int]:
        """Return a value that changes whenever a run was computed again or a decision was taken."""
        both = (self.now, self.earlier)
        versions, revisions = [r.files.version for r in both], [r.ledger.revision() for r in both]
        return versions[0], versions[1], revisions[0], revisions[1]

    def walls(self) -> WallPair:
        """Return both walls, and the welds that were not rejected in the earlier run's review."""
        welds = [f for f in _standing(self.earlier.state()) if f.kind == DefectKind.WELD]
        middles = [(f.size.distance_from_mm + f.size.distance_to_mm) / 2 for f in welds]
        return WallPair(
            _surveyed(self.earlier), _surveyed(self.now), np.array(middles), self.is_one_calibration
        )

    def walls_key(self, found: WallPair) -> str:
        """Return a hash of ``found``, the result of `walls`, from the keys of its parts."""
        facts = (found.welds_mm, found.is_one_calibration)
        keys = [r.files.stage_key(kind) for r in (self.earlier, self.now) for kind in (Wall, WallTexture)]
        return digest((facts, tuple(keys)))

    def findings(self) -> FindingPair:
        """Return the findings of both after their reviews, without the rejected ones."""
        before, after = (tuple(_outlined(f) for f in _standing(r.state())) for r in (self.earlier, self.now))
        return FindingPair(before, after)

    @property
    def is_one_calibration(self) -> bool:
        """Whether both runs used one calibration; a run that corrected its probe has its own."""
        both = (self.now, self.earlier)
        probes = {r.files.record()["input_sha256"]["probe"] for r in both}
        return len(probes) == 1 and all(r.files.artefact(Trajectory).instrument is None for r in both)


@dataclass(frozen=True)
class Compared:
    """A comparison as documents, pictures and tables.

    Attributes
    ----------
    pair : RunPair
    compute : callable
        Returns the current comparison of the pair; stores computed results.
    years : float or None
        Time between the runs, if known.
    """

    pair: RunPair
    compute: Callable[[RunPair], tuple[RegisteredWalls, Comparison]] = field(repr=False)
    years: float | None = None

    @property
    def walls(self) -> RegisteredWalls:
        """Registration of the two walls, and their difference."""
        return _result(self, self.pair.state)[0]

    @property
    def changes(self) -> tuple[Change, ...]:
        """The change of every finding of either run after the reviews."""
        return _result(self, self.pair.state)[1].changes

    @property
    def line(self) -> str:
        """The registration, in one line of text."""
        found = self.walls.registration
        low, high = found.overlap_mm
        return (
            f"Compared with {self.pair.earlier.files.path.name}: {found.agreeing} of {found.blocks} pieces "
            f"of wall agree; both runs saw {low:.0f} to {high:.0f} mm."
        )

    @property
    def tables(self) -> tuple[str, ...]:
        """File names of its tables."""
        return tuple(_TABLES)

    def document(self) -> dict[str, Any]:
        """Return registration, diameter, layers' legends and every change, for the page."""
        changes = self.changes
        return cleaned({
            "earlier": self.pair.earlier.files.record()["recording"]["name"],
            "years": self.years,
            "family_error": FAMILY_ERROR,
            "statement": _statement(changes),
            "registration": _registration(self.walls.registration),
            "diameter": vars(self.walls.diameter),
            "one_calibration": self.pair.is_one_calibration,
            "overlays": [overlay_document(self._overlay(name)) for name in DIFFERENCE],
            "changes": [r | _shown(c) for r, c in zip(self._rows(changes), changes, strict=True)],
        })  # fmt: skip

    def layers(self) -> tuple[str, ...]:
        """Return the names of the layers that it adds to those of the later run."""
        return (*DIFFERENCE, *(EARLIER + name for name in layers_of(self.pair.earlier.files)))

    def picture(self, layer: str, limits: Limits | None = None) -> FlatPicture:
        """Return a layer: one of the difference, of the earlier run, or of the later one.

        Limits apply to both runs; the difference has its own.

        Raises
        ------
        InputError
            When there is none of that name.
        """
        if layer in DIFFERENCE:
            return overlay_picture(self.pair.now.files.artefact(Overlays), self._overlay(layer))
        if layer.startswith(EARLIER):
            return picture_of(self.pair.earlier.files, layer.removeprefix(EARLIER), limits)
        return picture_of(self.pair.now.files, layer, limits)

    def table(self, name: str) -> tuple[str, bytes]:
        """Return a table's media type and content.

        Raises
        ------
        InputError
            When there is none of that name.
        """
        if name not in _TABLES:
            raise InputError("tables", f"there is no {name[:40]!r}", expected=", ".join(_TABLES))
        if name == "growth.csv":
            return _TABLES[name], csv_text(self._rows(self.changes), GROWTH_COLUMNS).encode("utf-8-sig")
        return _TABLES[name], json.dumps(self._document(), indent=1, ensure_ascii=False).encode()

    def _document(self) -> dict[str, Any]:
        """Return the table of changes, and the registration on which they are based."""
        document = self.document()
        head = {k: document[k] for k in ("earlier", "years", "family_error", "registration", "diameter")}
        runs = {"run": self.pair.now.files.version, "earlier": self.pair.earlier.files.version}
        made_by = MadeBy("review --compare", runs).document()
        return head | {"made_by": made_by, "changes": self._rows(self.changes)}

    def _rows(self, changes: tuple[Change, ...]) -> list[dict[str, Any]]:
        return growth_rows(changes, self.years, self._wall_thickness_mm)

    def _overlay(self, layer: str) -> Overlay:
        """Return a layer of the difference in the run's own colours."""
        walls, own = self.walls, self.pair.now.files.artefact(Overlays)
        if layer == DIFFERENCE[0]:
            return _overlay(
                own.deviation, layer, "Radius, later minus earlier", -walls.limit_mm, walls.limit_mm,
                walls.difference_level,
            )  # fmt: skip
        return _overlay(
            own.uncertainty, layer, "1 σ of the difference", 0.0, walls.limit_mm / 2, walls.sigma_level
        )

    @property
    def _wall_thickness_mm(self) -> float | None:
        """Wall thickness assumed in the review, else that of the recording, mm; None if unknown."""
        assumed = self.pair.now.state().assumed.wall_thickness_mm
        pipe = self.pair.now.files.pipe()
        return assumed or (pipe.wall_thickness_mm if pipe is not None else None)


@lru_cache(maxsize=2)
def _result(compared: Compared, _state: tuple[str, str, int, int]) -> tuple[RegisteredWalls, Comparison]:
    return compared.compute(compared.pair)


def run_pair(review: Review, earlier: RunFiles) -> RunPair:
    """Return a review's run beside an earlier one.

    Raises
    ------
    InputError
        When the earlier run cannot be read.
    """
    return RunPair(review, open_review(earlier))


def _standing(state: State) -> tuple[Finding, ...]:
    return tuple(f for f in state.findings if f.status not in (GONE, REJECTED))


def _outlined(finding: Finding) -> OutlinedFinding:
    size = finding.size
    return OutlinedFinding(
        finding.id, DefectKind(finding.kind), finding.outline, size.depth_mm, size.depth_sigma_mm
    )


def _surveyed(review: Review) -> SurveyedWall:
    smoothing = float(review.files.record()["configuration"]["accumulate"]["smoothing_mm"])
    texture = review.files.artefact(WallTexture)
    wall = review.files.artefact(Wall)
    return SurveyedWall(wall.radius_map, texture, smoothing, cloud_along(wall.cloud).ring_spacing_mm())


def _overlay(
    like: Overlay, name: str, title: str, low_mm: float, high_mm: float, level: np.ndarray[Any, Any]
) -> Overlay:
    beyond = float(np.isin(level, [1, 255]).sum() / max((level > 0).sum(), 1))
    return Overlay(name, title, like.colour_map, low_mm, high_mm, beyond, like.palette_bgr, level)


def _shown(change: Change) -> dict[str, Any]:
    """Return the data for showing a place: its middle, outlines of both runs, size of the view."""
    return {
        "azimuth_rad": change.place.middle[1],
        "half_mm": max(float(np.ptp(change.place.corners[:, 0])), _HALF_VIEW_MM),
        "outlines": change.place.outlines,
        "changed": change.fate.is_change,
    }


def _registration(found: Registration) -> dict[str, Any]:
    fields = vars(found)
    return fields | {
        "welds": [vars(w) for w in found.welds],
        "shift_range_mm": [found.shift_mm.min(), found.shift_mm.max()],
        "roll_range_rad": [found.roll_rad.min(), found.roll_rad.max()],
    }


def _statement(found: tuple[Change, ...]) -> str:
    count = {fate: sum(c.fate is fate for c in found) for fate in Fate if fate.is_change}
    tested = sum(c.growth is not None for c in found)
    words = ", ".join(f"{n} {fate}" for fate, n in count.items())
    return (
        f"{tested} findings compared on both walls: {words}. If nothing has changed, the chance that any "
        f"of these is declared a change is {FAMILY_ERROR:.0%}."
    )
