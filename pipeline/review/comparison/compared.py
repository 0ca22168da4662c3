"""What the review's page, server and export ask of a comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.errors import InputError
from pipeline.review.comparison.comparison import Comparison
from pipeline.review.comparison.documents import comparison_document, growth_csv, growth_json
from pipeline.review.flat_tiles import FlatPicture
from pipeline.review.review import Review, open_review
from pipeline.review.run_files import RunFiles

_TABLES = {"growth.csv": ("text/csv", growth_csv), "growth.json": ("application/json", growth_json)}


@dataclass(frozen=True)
class Compared:
    """A comparison as documents, pictures and tables; ``line`` says in a line how the runs lie."""

    comparison: Comparison
    line: str

    @property
    def tables(self) -> tuple[str, ...]:
        """File names of its tables."""
        return tuple(_TABLES)

    def document(self) -> dict[str, Any]:
        """Return everything for the page."""
        return comparison_document(self.comparison)

    def layers(self) -> tuple[str, ...]:
        """Return the names of the layers that it adds to those of the later run."""
        return self.comparison.layers()

    def picture(self, layer: str) -> FlatPicture:
        """Return a layer of the flat view, by the names of `layers` or of the later run."""
        return self.comparison.picture(layer)

    def table(self, name: str) -> tuple[str, bytes]:
        """Return a table's media type and content.

        Raises
        ------
        InputError
            When there is none of that name.
        """
        if name not in _TABLES:
            raise InputError("tables", f"there is no {name[:40]!r}", expected=", ".join(_TABLES))
        media_type, make = _TABLES[name]
        return media_type, make(self.comparison).encode("utf-8-sig" if media_type == "text/csv" else "utf-8")


def laid_on(review: Review, earlier: RunFiles, years: float | None) -> Compared:
    """Return a review's run laid on an earlier one.

    Raises
    ------
    InputError
        When the earlier run cannot be read.
    UnusableError
        When the two do not show the same wall.
    """
    comparison = Comparison(review, open_review(earlier), years)
    found = comparison.pair.registration
    low, high = found.overlap_mm
    return Compared(
        comparison,
        f"Laid on {earlier.path.name}: {found.agreeing} of {found.blocks} pieces of wall agree, "
        f"{low:.0f} to {high:.0f} mm seen by both.",
    )
