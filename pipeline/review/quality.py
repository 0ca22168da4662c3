"""The content of the quality page: the quality of a run along the pipe, and reasons for unused samples."""

from __future__ import annotations

import re
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np

from pipeline.arrays import Float, Float32
from pipeline.artefacts.findings import Sections
from pipeline.artefacts.measured import RingSamples, RingValidity, Trajectory
from pipeline.artefacts.wall_map import WallMap
from pipeline.errors import InputError
from pipeline.export.report.tables import REASONS
from pipeline.review.documents import cleaned
from pipeline.review.run_files import RunFiles

# Points of a curve, about one for each pixel of its width; largest diagnosis page that is read, bytes.
_MOST_POINTS = 600
_LARGEST_PAGE = 64 << 20
_PICTURE = re.compile(r"data:image/(png|jpeg);base64,[A-Za-z0-9+/=]+")


def quality_document(files: RunFiles, wall: WallMap) -> dict[str, Any]:
    """Return plots along the pipe, ring samples by reason, facts of the instrument, diagnosis pictures."""
    rings, trajectory = files.artefact(RingSamples), files.artefact(Trajectory)
    return cleaned({
        "plots": [*_wall_plots(wall), _diameters(files.artefact(Sections)), _drift(trajectory), _lost(rings)],
        "samples": _samples(rings),
        "facts": _instrument(files),
        "pictures": _diagnosis_pictures(files.file("diagnosis.html")),
    })  # fmt: skip


def _plot(title: str, unit: str, x_label: str, x: Float, **curves: Float) -> dict[str, Any]:
    """Return curves thinned to the resolution of a screen."""
    step = max(-(-len(x) // _MOST_POINTS), 1)
    named = [{"name": n.replace("_", " "), "y": np.asarray(y, float)[::step]} for n, y in curves.items()]
    return {"title": title, "unit": unit, "x_label": x_label, "x": x[::step], "curves": named}


def _wall_plots(wall: WallMap) -> list[dict[str, Any]]:
    step = max(-(-len(wall.distance_mm) // _MOST_POINTS), 1)
    seen = np.isfinite(wall.radius_mm[::step]).mean(1)
    total, random = (_median_of_rows(a[::step]) for a in (wall.sigma_mm, wall.sigma_random_mm))
    s, where = wall.distance_mm[::step], "distance, mm"
    return [
        _plot("Wall seen", "%", where, s, seen=100 * seen),
        _plot("1 σ of the radius, median around", "mm", where, s, total=total, random_part=random),
    ]


def _median_of_rows(values: Float32) -> Float:
    out = np.full(len(values), np.nan)
    known = np.isfinite(values).any(1)
    out[known] = np.nanmedian(values[known], 1)
    return out


def _diameters(sections: Sections) -> dict[str, Any]:
    return _plot(
        "Diameter", "mm", "distance, mm", sections.distance_mm,
        mean=sections.mean_diameter_mm, smallest=sections.min_diameter_mm, largest=sections.max_diameter_mm,
    )  # fmt: skip


def _drift(trajectory: Trajectory) -> dict[str, Any]:
    """Return the uncertainty of the camera's position over the distance since the first frame."""
    sigma = np.sqrt(np.clip(np.diagonal(trajectory.covariance, axis1=1, axis2=2)[:, :3], 0, None))
    across = np.hypot(sigma[:, 0], sigma[:, 1])
    title = "Drift: 1 σ of the camera's position relative to the first frame"
    return _plot(title, "mm", "frame", trajectory.frame.astype(float), along=sigma[:, 2], across=across)


def _lost(rings: RingSamples) -> dict[str, Any]:
    share = 100 * (1 - rings.valid.mean(1))
    return _plot("Ring samples not used", "%", "frame", rings.frame.astype(float), not_used=share)


def _samples(rings: RingSamples) -> list[dict[str, Any]]:
    counts = np.bincount(rings.validity.ravel(), minlength=len(RingValidity))
    whole = int((~rings.valid.any(1)).sum())
    rows = [
        {"reason": REASONS[v], "count": int(counts[v]), "share_percent": 100 * counts[v] / counts.sum()}
        for v in RingValidity
        if counts[v]
    ]
    share = 100 * whole / max(len(rings.frame), 1)
    return [*rows, {"reason": "laser frames rejected whole", "count": whole, "share_percent": share}]


def _instrument(files: RunFiles) -> list[dict[str, Any]]:
    """Return the origin of the probe's parameters, and the age of its file."""
    file = Path(files.record()["probe"]["path"])
    try:
        probe = files.probe()
    except InputError as error:
        return [{"name": "probe file", "value": error.problem, "unit": ""}]
    written, made = (datetime.fromtimestamp(f.stat().st_mtime, UTC) for f in (file, files.file("run.json")))
    source = probe.calibrated_from or "a data sheet: not calibrated"
    # A copy or a clock set back dates the file after the run: its age is not known then.
    age = (made - written).days if written <= made else "unknown: dated after the run"
    return [
        {"name": "numbers from", "value": source, "unit": ""},
        {"name": "probe file written", "value": f"{written:%Y-%m-%d}", "unit": ""},
        {"name": "its age when the run was made", "value": age, "unit": "days" if written <= made else ""},
    ]


class _Pictures(HTMLParser):
    """Collects the pictures embedded in a page."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[dict[str, str]] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Store a picture's data and its text; anything else is ignored."""
        attributes = dict(attrs)
        source = (attributes.get("src") or "").strip()
        if tag == "img" and _PICTURE.fullmatch(source):
            self.found.append({"title": attributes.get("alt") or "", "source": source})


def _diagnosis_pictures(file: Path) -> list[dict[str, str]]:
    if not file.is_file() or file.stat().st_size > _LARGEST_PAGE:
        return []
    reader = _Pictures()
    reader.feed(file.read_text("utf-8", errors="replace"))
    return reader.found
