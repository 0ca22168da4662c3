"""The live page: the preliminary diameter of a recording that is still being written."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Protocol

from pipeline.files.disk import disk_errors_named
from pipeline.pages import page_template

_WIDTH, _HEIGHT, _SHOWN = 1000, 260, 2000


class Shown(Protocol):
    """What the page shows of a section."""

    @property
    def frame(self) -> int:
        """Number of the frame."""

    @property
    def time_s(self) -> float:
        """Time of the frame, s."""

    @property
    def distance_mm(self) -> float:
        """Reading of the encoder, mm; NaN without one."""

    @property
    def diameter_mm(self) -> float:
        """Diameter of the circle through the ring, mm."""

    @property
    def diameter_sigma_mm(self) -> float:
        """1 σ of the diameter, mm."""

    @property
    def seen(self) -> float:
        """Share of the ring with a usable line."""


def write_live_page(name: str, sections: Sequence[Shown], state: str, folder: Path) -> None:
    """Replace ``live.html`` at one stroke; it loads itself anew every two seconds while it is growing.

    Raises
    ------
    InputError
        When the disk is full or cannot be written.
    """
    text = page_template("pipeline.follow").render(
        name=name, state=state, growing=state == "growing", last=sections[-1] if sections else None,
        count=len(sections), chart=_chart(sections), width=_WIDTH, height=_HEIGHT,
    )  # fmt: skip
    with disk_errors_named(folder):
        folder.mkdir(parents=True, exist_ok=True)
        temporary = folder / ".new-live.html"
        temporary.write_text(text, "utf-8")
        temporary.replace(folder / "live.html")


def _chart(sections: Sequence[Shown]) -> dict[str, object] | None:
    """Return the diameter over time as points of a polyline, thinned to what a screen shows."""
    thinned = sections[:: max(1, len(sections) // _SHOWN)]
    if len(thinned) < 2:
        return None
    times, diameters = [s.time_s for s in thinned], [s.diameter_mm for s in thinned]
    low, high = min(diameters), max(diameters)
    margin = max(0.05 * (high - low), 0.05)
    low, high = low - margin, high + margin
    across = _WIDTH / max(times[-1] - times[0], 1e-9)
    points = [
        f"{(t - times[0]) * across:.1f},{_HEIGHT * (high - d) / (high - low):.1f}"
        for t, d in zip(times, diameters, strict=True)
    ]
    return {
        "points": " ".join(points), "low": low, "high": high, "from": times[0], "to": times[-1],
    }  # fmt: skip
