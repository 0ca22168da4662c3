"""The report of a diagnosis: diagnosis.html, one file that opens offline."""

from __future__ import annotations

import base64
from importlib.resources import files
from pathlib import Path

from jinja2 import Environment, StrictUndefined

from pipeline.commands.diagnose_figures import azimuth_figure, candidates_figure, frames_figure, wall_figure
from stages.diagnose.result import Diagnosis, Verdict, to_json

_HEADLINES = {
    Verdict.CONSISTENT: "The recording agrees with the stated instrument",
    Verdict.CLASS: "Something was left out; its kind is known, its name is not",
    Verdict.UNEXPLAINED: "Something was left out that no known effect explains",
    Verdict.NOT_IDENTIFIABLE: "This recording cannot tell",
}


def write_page(found: Diagnosis, consequence: str, folder: Path) -> None:
    """Write diagnosis.html; ``consequence`` says what the finding means for the inspection.

    Raises
    ------
    OSError
        When it cannot be written.
    """
    page = files("pipeline.commands.diagnose_page").joinpath("page.html").read_text("utf-8")
    environment = Environment(undefined=StrictUndefined, autoescape=True)
    text = environment.from_string(page).render(
        d=to_json(found), headline=headline(found), consequence=consequence, pictures=_pictures(found)
    )
    (folder / "diagnosis.html").write_text(text, "utf-8")


def headline(found: Diagnosis) -> str:
    """Return the answer in one line."""
    if found.verdict is Verdict.NAMED:
        return "Left out: " + " and ".join(e.name.replace("_", " ") for e in found.effects)
    return _HEADLINES[found.verdict]


def _pictures(found: Diagnosis) -> dict[str, str]:
    """Return the pictures that there is something for, as base64."""
    made: dict[str, bytes] = {}
    if found.ring_picture is not None:
        made["frames"] = frames_figure(found.ring_picture)
        made["azimuth"] = azimuth_figure(found.ring_picture)
    if found.wall_picture is not None:
        made["wall"] = wall_figure(found.wall_picture)
    if found.candidates:
        made["candidates"] = candidates_figure(found.candidates)
    return {name: base64.b64encode(png).decode("ascii") for name, png in made.items()}
