"""One self-contained report page that opens offline."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from pipeline.artefacts import Wall
from pipeline.findings import Defect, Sections
from pipeline.model import Overlay
from pipeline.review import cards, flat
from pipeline.review.accounts import tables
from pipeline.review.page import Finding, Flat, Legend, Mark, Page, Strip
from pipeline.review.plots import Curve, Plot, Tick, plot, round_ticks
from pipeline.review.summary import RunSummary

_PIXELS = 1_100_000
_CROP_PX = 180
_PICTURED = 60


def write_report(summary: RunSummary, folder: Path) -> None:
    """Write ``report.html`` into ``folder``: one file without scripts that needs no network.

    Raises
    ------
    OSError
        When a picture cannot be encoded or the file cannot be written.
    """
    environment = Environment(
        loader=PackageLoader("pipeline.review", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template("report.html").render(page=page_of(summary))
    (folder / "report.html").write_text(text, encoding="utf-8")


def page_of(summary: RunSummary) -> Page:
    """Return what the page shows of a run."""
    findings = _findings(summary)
    left_out = len(findings) - _PICTURED
    note = f"Pictures of the {_PICTURED} largest only; {left_out} more without." if left_out > 0 else ""
    return Page(
        title=f"Pipe inspection {summary.recording.name}",
        verdict=cards.verdict(summary),
        cards=cards.cards(summary),
        findings=findings,
        findings_note=note,
        flats=_flats(summary),
        plots=_plots(summary.sections, summary.recording.pipe.nominal_diameter_mm),
        tables=tables(summary),
        warnings=summary.recording.warnings,
    )


def _defects(summary: RunSummary) -> tuple[Defect, ...]:
    return summary.defects.items if summary.defects is not None else ()


def _findings(summary: RunSummary) -> tuple[Finding, ...]:
    found = _defects(summary)
    largest = sorted(found, key=lambda d: -abs(d.depth_mm))[:_PICTURED]
    pictured = {d.id for d in largest}
    return tuple(_finding(d, summary, d.id in pictured) for d in found)


def _finding(defect: Defect, summary: RunSummary, pictured: bool) -> Finding:
    photo, deviation = _crops(defect, summary) if pictured else ("", "")
    codes = (
        f"POF: {defect.pof_class}" if defect.pof_class else "",
        f"PACP, suggested: {defect.pacp_suggestion}",
        f"EN 13508-2, suggested: {defect.en13508_suggestion}",
    )
    all_round = defect.clock_to - defect.clock_from == 12
    return Finding(
        number=defect.id,
        kind=defect.kind,
        distance=f"{defect.distance_from_mm:.1f} – {defect.distance_to_mm:.1f} mm",
        clock="all round" if all_round else f"{_dial(defect.clock_from)} – {_dial(defect.clock_to)}",
        length=f"{defect.length_mm:.1f} mm",
        width=f"{defect.width_mm:.1f} mm",
        depth=f"{abs(defect.depth_mm):.2f} ± {defect.depth_sigma_mm:.2f} mm",
        way="into the wall" if defect.depth_mm > 0 else "inward",
        wall_loss=_wall_loss(defect),
        confidence=f"{100 * defect.confidence:.0f} %",
        codes=tuple(c for c in codes if c),
        frames=_ranges(defect.frames.tolist()),
        statement=defect.statement,
        photo=photo,
        deviation=deviation,
        description=f"{defect.kind} {defect.id} at {defect.distance_from_mm:.0f} mm",
    )


def _wall_loss(defect: Defect) -> str:
    if np.isfinite(defect.wall_loss_percent):
        return f"{defect.wall_loss_percent:.0f} %"
    return "thickness unknown" if defect.pof_class else "–"


def _dial(hours: float) -> str:
    """Return a clock position as on a dial, to 6 minutes, which is 3°."""
    tenths = round(hours * 10) % 120
    return f"{tenths // 10 or 12}:{6 * (tenths % 10):02d}"


def _ranges(frames: list[int]) -> tuple[str, ...]:
    """Return frames as ranges, where a few frames in between may be of the other light."""
    parts: list[list[int]] = []
    for frame in frames:
        if parts and frame - parts[-1][1] <= 4:
            parts[-1][1] = frame
        else:
            parts.append([frame, frame])
    return tuple(f"{a}" if a == b else f"{a} – {b}" for a, b in parts[:6])


def _crops(defect: Defect, summary: RunSummary) -> tuple[str, str]:
    """Return photo and deviation around a defect, as addresses; empty where there is none."""
    if summary.wall is None:
        return "", ""
    window = flat.window_about(defect, _radius(summary.wall), _CROP_PX)
    images = (
        flat.photo(summary.texture) if summary.texture is not None else None,
        flat.overlay_image(summary.overlays, summary.overlays.deviation) if summary.overlays else None,
    )
    photo, deviation = (flat.data_uri(flat.seen_through(i, window)) if i else "" for i in images)
    return photo, deviation


def _radius(wall: Wall) -> float:
    return float(np.nanmedian(wall.radius_map.radius_mm))


def _flats(summary: RunSummary) -> tuple[Flat, ...]:
    if summary.wall is None or not np.isfinite(summary.wall.radius_map.radius_mm).any():
        return ()
    rows = summary.wall.radius_map.distance_mm[np.isfinite(summary.wall.radius_map.radius_mm).any(1)]
    shown = flat.windows(float(rows[0]), float(rows[-1]), _radius(summary.wall), _PIXELS)
    out = []
    if summary.texture is not None:
        strips = _strips(flat.photo(summary.texture), shown, "photo of the wall", _defects(summary))
        out.append(Flat("The wall, unrolled", strips, None))
    for overlay in summary.overlays.pictures if summary.overlays is not None else ():
        image = flat.overlay_image(summary.overlays, overlay)
        out.append(
            Flat(overlay.title, _strips(image, shown, overlay.title, _defects(summary)), _legend(overlay))
        )
    return tuple(out)


def _strips(
    image: flat.FlatImage, shown: tuple[flat.Window, ...], what: str, found: tuple[Defect, ...]
) -> tuple[Strip, ...]:
    strips = []
    for window in shown:
        first, last = window.distance_from_mm, window.distance_to_mm
        marks = tuple(
            _mark(d, window) for d in found if first <= d.distance_to_mm and d.distance_from_mm <= last
        )
        values = round_ticks(first, last, 8)
        ticks = tuple(Tick(window.x_percent(float(v)), f"{v:g}") for v in values)
        picture = flat.data_uri(flat.seen_through(image, window))
        text = f"{what}, {first:.0f} to {last:.0f} mm"
        strips.append(Strip(picture, text, window.width_px / window.height_px, marks, ticks))
    return tuple(strips)


def _mark(defect: Defect, window: flat.Window) -> Mark:
    first, last = float(defect.outline[:, 1].min()), float(defect.outline[:, 1].max())
    turn = 2 * np.pi * np.floor((0.5 * (first + last) - window.azimuth_from_rad) / (2 * np.pi))
    left, right = (
        float(np.clip(window.x_percent(s), 0, 100)) for s in (defect.distance_from_mm, defect.distance_to_mm)
    )
    top, bottom = (float(np.clip(window.y_percent(a - turn), 0, 100)) for a in (first, last))
    if last - first > np.pi:
        top, bottom = 0.0, 100.0
    return Mark(defect.id, left, top, right - left, bottom - top)


def _legend(overlay: Overlay) -> Legend:
    stops = ", ".join("rgb({2},{1},{0})".format(*overlay.palette_bgr[k]) for k in range(1, 256, 16))
    middle = (overlay.low_mm + overlay.high_mm) / 2
    note = f"{100 * overlay.beyond:.1f} % of the wall lies beyond the ends" if overlay.beyond > 0 else ""
    low, mid, high = (f"{v:.3g} mm" for v in (overlay.low_mm, middle, overlay.high_mm))
    return Legend(stops, low, mid, high, note)


def _plots(sections: Sections | None, nominal_mm: float) -> tuple[Plot, ...]:
    if sections is None:
        return ()
    s = sections
    diameters = plot(
        "Diameter", "mm", s.distance_mm,
        (Curve("largest", "b", s.max_diameter_mm), Curve("smallest", "c", s.min_diameter_mm),
         Curve("mean ± 1 σ", "a", s.mean_diameter_mm, s.mean_diameter_sigma_mm)),
    )  # fmt: skip
    ovality = plot(
        f"Ovality (nominal diameter {nominal_mm:g} mm)", "%", s.distance_mm,
        (Curve("(D max − D min) / D nominal ± 1 σ", "a", 100 * s.ovality_nominal, 100 * s.ovality_nominal_sigma),
         Curve("largest |D − D mean| / D mean (ASTM F1216)", "b", 100 * s.ovality_astm_f1216)),
    )  # fmt: skip
    return tuple(p for p in (diameters, ovality) if p is not None)


__all__ = ["page_of", "write_report"]
