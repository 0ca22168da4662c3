"""The review and the assessment of its findings as plain data for the page; unknown values are None."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import Trajectory
from pipeline.artefacts.model import Overlay, Overlays
from pipeline.artefacts.wall_map import WallMap
from pipeline.files.json_yaml import parse_json, read_json
from pipeline.pages.notation import figure_name, stage_title
from pipeline.review.decisions.ledger import Entry
from pipeline.review.decisions.replay import GONE, Finding, covered, labels
from pipeline.review.flat_tiles import WALL_LOSS, FlatPicture, full_range_mm, overlay_of
from pipeline.review.measuring import cautions
from pipeline.review.model_stretches import StretchedModel
from pipeline.review.review import Seal, State
from pipeline.review.run_files import RunFiles

# Number of colours of a legend's gradient.
_LEGEND_STEPS = 64
# Entries of a measured finding that the page needs; the rest comes with the state.
_COPIED = ("id", "statement", "pof_class", "pacp_suggestion", "en13508_suggestion")
_FLOW_ABOVE_YIELD_MPA = 69.0  # 10 ksi: flow stress of the modified method of ASME B31G
# Beyond this share of the wall neither criterion applies.
LARGEST_LOSS = 0.8
ASSUMPTIONS = (
    "the pipe data given, sound steel that fails by plastic flow, internal pressure alone, a defect by itself"
    "; the criteria's own scatter against burst tests is not included"
)


@dataclass(frozen=True)
class Strength:
    """Estimated failure pressure, MPa, by both criteria, and its assumptions.

    It is stated without ±: the σ of the depth would give a few kPa, while burst tests scatter about both
    criteria by far more (W. Zhou, G. Huang, S. Zhang, Model error assessment of burst capacity models for
    corroded pipes, IPC2012-90335), and that scatter is not known for the pipe at hand.
    """

    b31g_mpa: float
    modified_mpa: float
    assumptions: str = ASSUMPTIONS


def strength(
    depth_mm: float, length_mm: float, bore_mm: float, wall_mm: float, yield_mpa: float
) -> Strength | None:
    """Return the failure pressure of metal loss in a pipe of inner diameter ``bore_mm``.

    None where the criteria do not apply: without loss, or beyond `LARGEST_LOSS`.
    """
    if not 0 < depth_mm <= LARGEST_LOSS * wall_mm:
        return None
    outer = bore_mm + 2 * wall_mm
    loss, z, barlow = depth_mm / wall_mm, length_mm**2 / (outer * wall_mm), 2 * wall_mm / outer
    return Strength(
        b31g(loss, z) * 1.1 * yield_mpa * barlow,
        modified_b31g(loss, z) * (yield_mpa + _FLOW_ABOVE_YIELD_MPA) * barlow,
    )


def b31g(loss: float, z: float) -> float:
    """Return failure over flow stress for relative depth ``loss`` and z = L²/(D t)."""
    if z > 20:
        return 1 - loss
    bulging = np.sqrt(1 + 0.8 * z)
    return float((1 - 2 / 3 * loss) / (1 - 2 / 3 * loss / bulging))


def modified_b31g(loss: float, z: float) -> float:
    """Return failure over flow stress by the modified criterion."""
    bulging = np.sqrt(1 + 0.6275 * z - 0.003375 * z**2) if z <= 50 else 0.032 * z + 3.3
    return float((1 - 0.85 * loss) / (1 - 0.85 * loss / bulging))


def run_document(files: RunFiles) -> dict[str, Any]:
    """Return the data that does not change as long as the run does not."""
    record = files.record()
    overlays = files.artefact(Overlays)
    pipe = files.pipe()
    return {
        "name": record["recording"]["name"],
        "metrics": _named(record["metrics"]),
        "numbers": [
            {"stage": stage_title(s["name"]), "numbers": _named(s["numbers"])} for s in record["stages"]
        ],
        "warnings": [*record["reader_warnings"], *record.get("warnings", ())],
        "program": record["program"],
        "inputs": record["input_sha256"],
        "has_recording": pipe is not None,
        "nominal_diameter_mm": 2 * overlays.nominal_radius_mm,
        "wall_thickness_mm": pipe.wall_thickness_mm if pipe is not None else None,
        "distance_mm": [float(overlays.distance_mm[0]), float(overlays.distance_mm[-1])],
        "radius_mm": float(np.median(overlays.reference_radius_mm)),
        "overlays": [*_value_layers(files, overlays)],
        "defects": [{k: d.get(k, "") for k in _COPIED} for d in parse_json(files.defects_text())],
        "unconfirmed": files.unconfirmed(),
        "kinds": [kind.value for kind in DefectKind],
        "axis": _axis(files.artefact(Trajectory)),
        "diagnosis": _diagnosis(files),
        "version": files.version,
    }


def _named(numbers: list[dict[str, Any]]) -> list[dict[str, Any]]:
    return [n | {"name": figure_name(n["name"])} for n in numbers]


def seal_document(seal: Seal, files: RunFiles) -> dict[str, Any]:
    """Return the version of the review, by which the page detects changes, and whether it is signed."""
    return asdict(seal) | {"signed": seal.signed, "run_version": files.version}


def state_document(state: State, files: RunFiles) -> dict[str, Any]:
    """Return the current findings."""
    standing, called = [f for f in state.findings if f.status != GONE], labels(state.findings)
    bore_mm = 2 * files.artefact(Overlays).nominal_radius_mm  # once: a long run has thousands of findings
    return {
        "revision": state.revision,
        "findings": [
            _finding(f, state, files, bore_mm) | {"label": called[f.id], "covers": _covers(f, standing)}
            for f in state.findings
        ],
        "may_undo": state.may_undo,
        "may_redo": state.may_redo,
        "lost": [_entry(e) for e in state.lost],
        "assumed": state.assumed.model_dump(exclude={"do"}),
        "described": state.described.model_dump(exclude={"do"}),
        "history": [_entry(e) for e in state.entries],
    }


def layer_document(picture: FlatPicture) -> dict[str, Any]:
    """Return a layer's size and place."""
    return {
        "levels": picture.levels,
        "width": picture.width,
        "height": picture.height,
        "distance_mm": [picture.distance_from_mm, picture.distance_to_mm],
        "azimuth_rad": picture.azimuth_from_rad,
    }


def model_document(model: StretchedModel) -> list[dict[str, Any]]:
    """Return place and size of each stretch of the model."""
    return [asdict(stretch) for stretch in model.stretches()]


def section_document(wall: WallMap, overlays: Overlays, distance_mm: float) -> dict[str, Any]:
    """Return the cross-section next to a distance, with the fitted pipe and the nominal circle."""
    row = wall.row(distance_mm)
    return cleaned({
        "distance_mm": float(wall.distance_mm[row]),
        "azimuth_rad": wall.azimuth_rad,
        "radius_mm": wall.radius_mm[row],
        "sigma_mm": wall.sigma_mm[row],
        "fitted_mm": overlays.reference_radius_mm,
        "nominal_mm": overlays.nominal_radius_mm,
    })  # fmt: skip


def profile_document(wall: WallMap, distance_mm: float, azimuth_rad: float, half_mm: float) -> dict[str, Any]:
    """Return the radius along the pipe and around it through a point, minus the median of each."""
    rows = wall.rows(distance_mm - half_mm, distance_mm + half_mm)
    column, row = wall.column(azimuth_rad), wall.row(distance_mm)
    radius = float(np.nanmedian(wall.radius_mm[row]))
    reach = max(int(half_mm / (radius * wall.step_rad)), 2)
    columns = (column + np.arange(-reach, reach + 1)) % len(wall.azimuth_rad)
    along, around = wall.radius_mm[rows, column], wall.radius_mm[row, columns]
    return cleaned({
        "along": {
            "mm": wall.distance_mm[rows] - distance_mm,
            "depth_mm": along - np.nanmedian(along),
            "sigma_mm": wall.sigma_random_mm[rows, column],
        },
        "around": {
            "mm": np.arange(-reach, reach + 1) * wall.step_rad * radius,
            "depth_mm": around - np.nanmedian(around),
            "sigma_mm": wall.sigma_random_mm[row, columns],
        },
    })  # fmt: skip


def cleaned(tree: dict[str, Any]) -> dict[str, Any]:
    """Return plain data fit for JSON: arrays as lists, None for numbers that are not finite."""
    return {k: _plain(v) for k, v in tree.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return cleaned(value)
    if isinstance(value, list | tuple | np.ndarray):
        return [_plain(v) for v in value]
    if isinstance(value, np.generic):
        return _plain(value.item())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _finding(finding: Finding, state: State, files: RunFiles, bore_mm: float) -> dict[str, Any]:
    size, wall = finding.size, state.assumed.wall_thickness_mm
    is_loss = DefectKind(finding.kind).is_metal_loss
    loss = 100 * size.depth_mm / wall if wall and is_loss and size.depth_mm > 0 else None
    remaining = None
    if wall and state.assumed.yield_mpa and is_loss:
        remaining = strength(size.depth_mm, size.length_mm, bore_mm, wall, state.assumed.yield_mpa)
    judged = {
        "size": vars(size),
        "wall_loss_percent": loss,
        "wall_loss_sigma_percent": 100 * size.depth_sigma_mm / wall if loss is not None and wall else None,
        "strength": vars(remaining) if remaining else None,
        "cautions": cautions(files, finding),
    }
    # A long pipe has thousands of outlines: they are known to be finite and are not copied.
    return vars(finding) | cleaned(judged) | {"remarks": [vars(r) for r in finding.remarks]}


def _covers(finding: Finding, standing: list[Finding]) -> tuple[str, ...]:
    return covered(finding, standing) if finding.edited and finding.status != GONE else ()


def _entry(entry: Entry) -> dict[str, Any]:
    return {"id": entry.id, "who": entry.who, "at": entry.at, "action": entry.action.model_dump()}


def overlay_document(overlay: Overlay) -> dict[str, Any]:
    """Return the data of an overlay for its legend."""
    at = np.linspace(1, 255, _LEGEND_STEPS).round().astype(int)
    return {
        "name": overlay.name,
        "title": overlay.title,
        "low_mm": overlay.low_mm,
        "high_mm": overlay.high_mm,
        "colours": [f"#{r:02x}{g:02x}{b:02x}" for b, g, r in overlay.palette_bgr[at]],
    }


def _value_layers(files: RunFiles, overlays: Overlays) -> Iterator[dict[str, Any]]:
    """Yield the overlays of a run with their full range, and wall loss, for which the page needs the wall."""
    for overlay in overlays.pictures:
        yield overlay_document(overlay) | {"full_mm": full_range_mm(files, overlay.name)}
    loss = overlay_document(overlay_of(overlays, WALL_LOSS))
    full = (0.0, max(full_range_mm(files, "deviation")[1], 0.0))  # of the same values
    yield loss | {"name": WALL_LOSS, "title": "Wall loss", "low_mm": 0.0, "high_mm": full[1], "full_mm": full}


def _diagnosis(files: RunFiles) -> dict[str, Any] | None:
    """Return the content of a diagnosis in the run folder, None without one."""
    file = files.file("diagnosis.json")
    if not file.is_file():
        return None
    try:
        diagnosis = dict(read_json(file))
    except (OSError, ValueError, TypeError) as error:
        return {"verdict": "unreadable", "statement": f"diagnosis.json: {error}", "effects": []}
    effects = diagnosis.get("effects", [])
    words = [str(e.get("statement", e.get("name", ""))) for e in effects]
    statement = " ".join(words) or str(diagnosis.get("identifiable") or diagnosis.get("record_next") or "")
    return {"verdict": str(diagnosis.get("verdict", "")), "statement": statement,
            "effects": [str(e.get("name", "")) for e in effects]}  # fmt: skip


def _axis(trajectory: Trajectory) -> dict[str, Any]:
    axis = trajectory.axis
    step = max(len(axis.distance_mm) // 2000, 1)
    return {
        "distance_mm": axis.distance_mm[::step].tolist(),
        "origin_p": axis.origin_p[::step].tolist(),
        "x_p": axis.R_pa[::step, :, 0].tolist(),
        "y_p": axis.R_pa[::step, :, 1].tolist(),
    }
