"""Pictures of findings for the papers: the wall's photo with the outline, and the cross-section there."""

from __future__ import annotations

from io import BytesIO

import cv2
import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from pipeline.arrays import Byte, Float
from pipeline.artefacts.model import Overlays
from pipeline.artefacts.wall_map import WallMap
from pipeline.review.decisions.replay import Finding
from pipeline.review.flat_tiles import PHOTO, FlatPicture, picture_of
from pipeline.review.run_files import RunFiles

_SIZE_PX, _QUALITY = 480, 90
_LEAST_HALF_MM = 8.0
_OUTLINE_BGR, _HALO_BGR = (0, 71, 179), (255, 255, 255)
_EXAGGERATION = 20.0


def finding_picture(files: RunFiles, finding: Finding, radius_mm: float) -> bytes:
    """Return the wall about a finding, outlined, as JPEG; distance to the right, clock downward."""
    photo = picture_of(files, PHOTO)
    outline = np.asarray(finding.outline)
    middle = outline.mean(0)
    half = max(
        0.8 * float(np.ptp(outline[:, 0])), 0.8 * float(np.ptp(outline[:, 1])) * radius_mm, _LEAST_HALF_MM
    )
    half = min(half, np.pi * radius_mm)
    grid = (np.arange(_SIZE_PX) + 0.5) / _SIZE_PX * 2 - 1
    per_mm = photo.width / (photo.distance_to_mm - photo.distance_from_mm)
    column = (middle[0] + half * grid - photo.distance_from_mm) * per_mm - 0.5
    turns = (middle[1] + half / radius_mm * grid - photo.azimuth_from_rad) / (2 * np.pi)
    picture = _seen(photo, column, np.mod(turns * photo.height - 0.5, photo.height))
    corner = (outline - middle) * [1, radius_mm] / half * _SIZE_PX / 2 + _SIZE_PX / 2
    for colour, thick in ((_HALO_BGR, 5), (_OUTLINE_BGR, 2)):
        cv2.polylines(picture, [np.round(corner * 8).astype(np.int32)], True, colour, thick, cv2.LINE_AA, 3)
    return _jpeg(picture)


def section_plot(wall: WallMap, overlays: Overlays, distance_mm: float, azimuth_rad: float) -> bytes:
    """Return the cross-section at a distance as SVG, deviations exaggerated twentyfold."""
    row = wall.row(distance_mm)
    nominal = overlays.nominal_radius_mm
    figure = Figure(figsize=(3.0, 3.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    for radius, colour, dashes in (
        (np.full(len(wall.azimuth_rad), nominal), "#6b7682", "--"),
        (overlays.reference_radius_mm, "#0a5ea8", "-"),
        (wall.radius_mm[row], "#16202b", "-"),
    ):
        shown = nominal + _EXAGGERATION * (np.append(radius, radius[:1]) - nominal)
        angle = np.append(wall.azimuth_rad, wall.azimuth_rad[:1])
        axes.plot(shown * np.cos(angle), shown * np.sin(angle), color=colour, ls=dashes, lw=1.0)
    axes.plot([0, nominal * np.cos(azimuth_rad)], [0, nominal * np.sin(azimuth_rad)], color="#b34700", lw=0.9)
    axes.set_aspect("equal")
    axes.invert_yaxis()
    axes.axis("off")
    return _svg(figure)


def _seen(photo: FlatPicture, column: Float, row: Float) -> Byte:
    """Return the picture at columns and rows, grey where nothing was textured."""
    x, y = np.meshgrid(column, row)
    first, last = int(np.clip(column.min() - 2, 0, photo.width - 1)), int(max(column.max() + 3, 1))
    part = photo.columns(first, last)
    seen = cv2.remap(
        np.concatenate([part, part[:1]]),
        (x - first).astype(np.float32),
        y.astype(np.float32),
        cv2.INTER_LINEAR,
    )
    alpha = seen[..., 3:].astype(float) / 255
    return np.ascontiguousarray(np.round(alpha * seen[..., :3] + (1 - alpha) * 200).astype(np.uint8))


def _jpeg(picture: Byte) -> bytes:
    encoded, jpeg = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])
    if not encoded:
        raise OSError("a picture of a finding cannot be encoded")
    return jpeg.tobytes()


def _svg(figure: Figure) -> bytes:
    out = BytesIO()
    with rc_context({"svg.hashsalt": "boresight"}):  # or names inside would be random
        figure.savefig(out, format="svg", metadata={"Date": None, "Creator": None})
    return out.getvalue()
