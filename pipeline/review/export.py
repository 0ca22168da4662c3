"""A review as a folder of files that opens without a server: the same page, read-only."""

from __future__ import annotations

import base64
import json
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pipeline.artefacts.model import Overlays
from pipeline.errors import InputError
from pipeline.review import documents
from pipeline.review.flat_tiles import TILE_PX, FlatPicture, layers_of, picture_of
from pipeline.review.frames import UnseenError, finder_of
from pipeline.review.model_stretches import model_of
from pipeline.review.papers import PAPERS, paper_of
from pipeline.review.quality import quality_document
from pipeline.review.review import Review, State

if TYPE_CHECKING:
    from pipeline.review.compared import Compared

# Cross-sections written along the pipe, and bytes of the largest model that is put into one page.
_SECTIONS = 400
_LARGEST_MODEL = 200 << 20


def export_review(
    review: Review, page: Path, folder: Path, compared: Compared | None = None, twin: Path | None = None
) -> None:
    """Write the page, its data, pictures and papers into a new or empty ``folder``.

    Raises
    ------
    InputError
        When the folder holds something else, or the model is too large for one page.
    """
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "is not empty", hint="state a new folder")
    temporary = folder.with_name(f".new-{folder.name}")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir(parents=True)
    try:
        _write(review, page, temporary, compared, twin)
        if folder.exists():
            folder.rmdir()
        temporary.rename(folder)
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _write(review: Review, page: Path, folder: Path, compared: Compared | None, twin: Path | None) -> None:
    state = review.state()
    shutil.copytree(page / "assets", folder / "assets")
    index = (page / "index.html").read_text("utf-8")
    own = '<script defer src="assets/data.js"></script>\n<script defer src="assets/page.js"></script>'
    index = index.replace('<script defer src="assets/page.js"></script>', own)
    (folder / "index.html").write_text(index, "utf-8")
    data = _data(review, state, folder)
    data["run"]["twin"] = twin is not None
    if twin is not None:
        shutil.copyfile(twin, folder / "twin.html")
    if compared is not None:
        _add_comparison(data, compared, folder)
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    (folder / "assets" / "data.js").write_text(f"window.BORESIGHT={text};\n", "utf-8")
    for name in PAPERS:
        (folder / name).write_bytes(paper_of(name, review, state).content)


def _data(review: Review, state: State, folder: Path) -> dict[str, Any]:
    overlays = review.files.artefact(Overlays)
    pictures = {name: picture_of(review.files, name) for name in layers_of(review.files)}
    return {
        "run": documents.run_document(review.files),
        "state": documents.state_document(state, review.files),
        "seal": documents.seal_document(review.seal(state), review.files),
        "quality": quality_document(review.files, review.wall()),
        "sections": [documents.section_document(review.wall(), overlays, s) for s in _stations(overlays)],
        "layers": {name: _tiles(name, picture, folder) for name, picture in pictures.items()},
        "model": _model(review),
        "spots": list(_spots(review, state, folder)),
    }


def _add_comparison(data: dict[str, Any], compared: Compared, folder: Path) -> None:
    """Add the content of the comparison, and write its tables and the tiles of its layers."""
    data["comparison"] = compared.document()
    data["layers"] |= {name: _tiles(name, compared.picture(name), folder) for name in compared.layers()}
    for name in compared.tables:
        (folder / name).write_bytes(compared.table(name)[1])


def _stations(overlays: Overlays) -> list[float]:
    s = overlays.distance_mm
    return [float(v) for v in np.linspace(s[0], s[-1], min(len(s), _SECTIONS))]


def _tiles(name: str, picture: FlatPicture, folder: Path) -> dict[str, Any]:
    for level in range(picture.levels):
        size = TILE_PX << level
        for column in range(-(-picture.width // size)):
            for row in range(-(-picture.height // size)):
                file = folder / "tiles" / name / str(level) / str(column) / f"{row}.png"
                file.parent.mkdir(parents=True, exist_ok=True)
                file.write_bytes(picture.tile(level, column, row))
    return documents.layer_document(picture)


def _model(review: Review) -> dict[str, Any]:
    file, model = review.files.file("model.glb"), model_of(review.files)
    if file.stat().st_size > _LARGEST_MODEL:
        raise InputError(file, "is too large for a page without a server", hint="use boresight review")
    stretches = documents.model_document(model)
    parts = [base64.b64encode(model.stretch(k)).decode("ascii") for k in range(len(stretches))]
    return {"stretches": stretches, "parts": parts}


def _spots(review: Review, state: State, folder: Path) -> Iterator[dict[str, Any]]:
    """Yield the frames and profiles of every finding, the frames' pictures written beside the page."""
    (folder / "frames").mkdir()
    for finding in state.findings:
        distance, azimuth = (float(v) for v in np.mean(np.asarray(finding.outline), axis=0))
        half = min(max(finding.size.length_mm, finding.size.width_mm) / 2 + 8, 40.0)
        yield {
            "distance_mm": distance,
            "azimuth_rad": azimuth,
            "sights": _sights(review, distance, azimuth, folder),
            "profile": documents.profile_document(review.wall(), distance, azimuth, half),
        }


def _sights(review: Review, distance_mm: float, azimuth_rad: float, folder: Path) -> list[dict[str, Any]]:
    """Return the frames that show a spot; none when the recording was moved."""
    try:
        finder = finder_of(review.files)
        sights = finder.sights(distance_mm, azimuth_rad)
        for sight in sights:
            (folder / "frames" / f"{sight.frame}.jpg").write_bytes(finder.picture(sight.frame))
    except UnseenError:
        return []
    return [documents.cleaned(vars(s)) for s in sights]
