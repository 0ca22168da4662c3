"""report.html, written from the results of a completed run: one self-contained page that opens offline."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from pipeline.artefacts.findings import Defect, Defects, Sections
from pipeline.artefacts.measured import RingSamples, Trajectory, Wall, WallTexture
from pipeline.artefacts.model import Overlays
from pipeline.export.report.page import Curve, Finding, Page, Plot, plot
from pipeline.export.report.pictures import Gallery, gallery
from pipeline.export.report.tables import RunSummary, cards, tables, verdict
from pipeline.files.codec import digest
from pipeline.files.installed import program_version
from pipeline.instrument.probe import Probe
from pipeline.machine.outcome import Results, warnings_of
from pipeline.pages import notation
from pipeline.recording.base import Recording
from pipeline.recording.checks import CheckedFrames

# Libraries on which the results depend, named with their versions.
_STANDS_ON = ("numpy", "scipy", "opencv-contrib-python-headless", "av")
# Number of findings with pictures: about 5 MB of a page that should open anywhere.
_PICTURED = 60
# Higher probabilities are not confirmed: of findings in drawn recordings that were stated at 0.95 or more
# (0.98 on average), 0.90 were real (`python -m tests.benchmarks.bench_findings`).
_TOLD_APART = 0.9


def write_report_page(results: Results, recording: Recording, probe: Probe, folder: Path) -> None:
    """Write ``report.html`` from the results of a completed run."""
    write_report(_summary(results, recording, probe), folder)


def _summary(results: Results, recording: Recording, probe: Probe) -> RunSummary:
    checked = results.of(CheckedFrames)
    return RunSummary(
        recording=recording if checked is None else checked.applied_to(recording),
        probe=probe,
        created=datetime.now(UTC).isoformat(timespec="minutes"),
        rings=results.of(RingSamples),
        trajectory=results.of(Trajectory),
        wall=results.of(Wall),
        texture=results.of(WallTexture),
        overlays=results.of(Overlays),
        sections=results.of(Sections),
        defects=results.of(Defects),
        stages=results.outcome.stages,
        versions=(("boresight", program_version()), *((p, version(p)) for p in _STANDS_ON)),
        inputs=(("recording", recording.content_key), ("probe", digest(probe))),
    )


def write_report(summary: RunSummary, folder: Path) -> None:
    """Write ``report.html`` into ``folder``: one file without scripts that needs no network.

    Raises
    ------
    OSError
        When a picture cannot be encoded or the file cannot be written.
    """
    environment = Environment(
        loader=PackageLoader("pipeline.export.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template("report.html").render(page=page_of(summary))
    (folder / "report.html").write_text(text, encoding="utf-8")


def page_of(summary: RunSummary) -> Page:
    """Return the content of the page on a run."""
    pictures = gallery(summary)
    found = summary.defects
    findings = _findings(found.items if found else (), pictures)
    left_out = len(findings) - _PICTURED
    note = f"Pictures of the {_PICTURED} largest only; {left_out} more without." if left_out > 0 else ""
    return Page(
        title=f"Pipe inspection {summary.recording.name}",
        verdict=verdict(summary),
        cards=cards(summary),
        findings=findings,
        findings_note=note,
        unconfirmed=_findings(found.unconfirmed if found else (), pictures),
        flats=pictures.flats(),
        plots=_plots(summary.sections, summary.recording.pipe.nominal_diameter_mm),
        tables=tables(summary),
        warnings=(*summary.recording.warnings, *warnings_of(summary.stages)),
    )


def _findings(found: Sequence[Defect], pictures: Gallery) -> tuple[Finding, ...]:
    largest = {d.id for d in sorted(found, key=lambda d: -abs(d.depth_mm))[:_PICTURED]}
    return tuple(_finding(d, *(pictures.crops(d) if d.id in largest else ("", ""))) for d in found)


def _finding(defect: Defect, photo: str, deviation: str) -> Finding:
    codes = (
        f"POF: {defect.pof_class}" if defect.pof_class else "",
        f"PACP, suggested: {defect.pacp_suggestion}" if defect.pacp_suggestion else "",
        f"EN 13508-2, suggested: {defect.en13508_suggestion}" if defect.en13508_suggestion else "",
    )
    return Finding(
        number=defect.id,
        kind=defect.kind,
        distance=notation.distance(defect.peak_distance_mm, defect.distance_from_mm, defect.distance_to_mm),
        clock=notation.clock_extent(defect.clock_from, defect.clock_to),
        length=f"{defect.length_mm:.1f} mm",
        width=f"{defect.width_mm:.1f} mm",
        depth=notation.depth(defect.depth_mm, defect.depth_sigma_mm),
        wall_loss=_wall_loss(defect),
        probability=_probability(defect.probability),
        codes=tuple(c for c in codes if c),
        frames=_ranges(defect.frames.tolist()),
        statement=defect.statement,
        photo=photo,
        deviation=deviation,
        description=f"{defect.kind} {defect.id} at {defect.peak_distance_mm:.0f} mm",
    )


def _wall_loss(defect: Defect) -> str:
    if np.isfinite(defect.wall_loss_percent):
        sigma = abs(defect.wall_loss_percent / defect.depth_mm) * defect.depth_sigma_mm
        return notation.measured(defect.wall_loss_percent, sigma, "%")
    return "thickness unknown" if defect.pof_class else "–"


def _probability(probability: float) -> str:
    """Return a probability in words, no finer than its calibration on drawn recordings allows."""
    if np.isnan(probability):
        return "not known"
    return "above 90 %" if probability > _TOLD_APART else f"about {100 * probability:.0f} %"


def _ranges(frames: list[int]) -> tuple[str, ...]:
    """Return frames as ranges, in which a few frames may be of the other light."""
    parts: list[list[int]] = []
    for frame in frames:
        if parts and frame - parts[-1][1] <= 4:
            parts[-1][1] = frame
        else:
            parts.append([frame, frame])
    return tuple(f"{a}" if a == b else f"{a} – {b}" for a, b in parts[:6])


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
        (Curve("(D max − D min) / D nominal ± 1 σ", "a",
               100 * s.ovality_nominal, 100 * s.ovality_nominal_sigma),
         Curve("largest |D − D mean| / D mean (ASTM F1216)", "b", 100 * s.ovality_astm_f1216)),
    )  # fmt: skip
    return tuple(p for p in (diameters, ovality) if p is not None)
