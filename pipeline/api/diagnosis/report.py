"""The report of a diagnosis: diagnosis.html, one file that opens offline."""

from __future__ import annotations

import base64
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pipeline.api.diagnosis.apply import GeometryChange, consequence
from pipeline.api.diagnosis.figures import (
    azimuth_figure,
    candidates_figure,
    frames_figure,
    image_figure,
    simulated_figure,
    wall_figure,
)
from pipeline.files.disk import replace_text
from pipeline.pages import page_template
from stages.diagnose.compared import OnImage
from stages.diagnose.resimulate import Resimulated
from stages.diagnose.result import Diagnosis, Verdict, to_json

_HEADLINES = {
    Verdict.CONSISTENT: "The recording agrees with the stated instrument",
    Verdict.CLASS: "Something was left out; its kind is known, its name is not",
    Verdict.UNEXPLAINED: "Something was left out that no known effect explains",
    Verdict.NOT_IDENTIFIABLE: "This recording cannot tell",
}


@dataclass(frozen=True)
class Shown:
    """What a page shows beside the answer; None where there is nothing to show."""

    simulated: Resimulated | None = None
    change: GeometryChange | None = None
    image: OnImage | None = None


def write_page(found: Diagnosis, shown: Shown, folder: Path) -> None:
    """Write diagnosis.html.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    change = shown.change
    text = page_template("diagnose").render(
        d=to_json(found), headline=headline(found), simulated=shown.simulated, change=change,
        consequence=consequence(change) if change is not None else "",
        hours=_by_hour(change) if change is not None else (), pictures=_pictures(found, shown),
    )  # fmt: skip
    replace_text(folder / "diagnosis.html", text)


def headline(found: Diagnosis) -> str:
    """Return the answer in one line."""
    if found.verdict is Verdict.NAMED:
        return "Left out: " + " and ".join(e.name.replace("_", " ") for e in found.effects)
    if found.verdict is Verdict.PARTLY:
        names = " and ".join(e.name.replace("_", " ") for e in found.effects)
        return f"Left out: {names}, and something more that has no name yet"
    return _HEADLINES[found.verdict]


def _by_hour(change: GeometryChange) -> list[tuple[int, float | None, float | None]]:
    """Return each clock position with mean and largest change, None where nothing was seen."""
    return [
        (k or 12, float(mean) if np.isfinite(mean) else None, float(most) if np.isfinite(most) else None)
        for k, (mean, most) in enumerate(zip(change.mean_mm, change.max_mm, strict=True))
    ]


def _pictures(found: Diagnosis, shown: Shown) -> dict[str, str]:
    """Return the pictures that there is something for, as base64."""
    made: dict[str, bytes] = {}
    if found.ring_picture is not None:
        made["frames"] = frames_figure(found.ring_picture)
        made["azimuth"] = azimuth_figure(found.ring_picture)
    if found.wall_picture is not None:
        made["wall"] = wall_figure(found.wall_picture)
    if shown.image is not None:
        made["image"] = image_figure(shown.image)
    if shown.simulated is not None:
        made["simulated"] = simulated_figure(shown.simulated)
    if found.candidates:
        made["candidates"] = candidates_figure(found.candidates)
    return {name: base64.b64encode(png).decode("ascii") for name, png in made.items()}
