"""The report's tables: what was not used and why, what the motion showed, what made the result."""

from __future__ import annotations

from collections import Counter

import numpy as np

from pipeline.artefacts.measured import RingSamples, RingValidity
from pipeline.export.report.page import Table
from pipeline.export.report.summary import RunSummary
from pipeline.machine.outcome import WARNING, Number

REASONS = {
    RingValidity.VALID: "used",
    RingValidity.NO_LINE: "no laser line there",
    RingValidity.LOW_CONTRAST: "line too faint",
    RingValidity.SATURATED: "saturated",
    RingValidity.GLINT: "glint",
    RingValidity.GHOST: "second reflection",
    RingValidity.OUTLIER: "off the neighbouring line",
    RingValidity.OUT_OF_VIEW: "outside the picture",
    RingValidity.WIDTH: "line of implausible width",
    RingValidity.FRAME_REJECTED: "its whole frame was rejected",
}
_SHOWN = 24


def tables(summary: RunSummary) -> tuple[Table, ...]:
    """Return all tables below the pictures; those that have nothing to tell are left out."""
    made = (_frames(summary), _samples(summary.rings), _rejections(summary), _events(summary),
            _numbers(summary), _stages(summary), _versions(summary))  # fmt: skip
    return tuple(t for t in made if t is not None)


def _frames(summary: RunSummary) -> Table:
    """Account for every frame: rows add up to the recording's frames."""
    frames = summary.recording.frames
    rows = []
    for kind, count in sorted(Counter(map(str, frames.illumination)).items()):
        rows.append((f"lit by {kind}", str(count), ""))
    rows.append(("in the recording", str(len(frames.frame)), ""))
    if summary.trajectory is not None:
        lost = np.setdiff1d(frames.frame, summary.trajectory.frame)
        rows.append(("without a pose", str(len(lost)), _listed(lost)))
    if summary.rings is not None:
        whole = summary.rings.frame[~summary.rings.valid.any(1)]
        rows.append(("laser frames of which no sample was used", str(len(whole)), _listed(whole)))
    return Table("Frames", ("frames", "number", "which"), tuple(rows))


def _listed(frames: np.ndarray[tuple[int], np.dtype[np.int64]]) -> str:
    more = f" … and {len(frames) - _SHOWN} more" if len(frames) > _SHOWN else ""
    return ", ".join(str(f) for f in frames[:_SHOWN]) + more


def _samples(rings: RingSamples | None) -> Table | None:
    if rings is None or not rings.validity.size:
        return None
    counts = np.bincount(rings.validity.ravel(), minlength=len(RingValidity))
    total = rings.validity.size
    rows = [(REASONS[v], f"{counts[v]:,}", f"{100 * counts[v] / total:.2f} %") for v in RingValidity]
    rows = [r for r in rows if r[1] != "0"]
    return Table(
        "Ring samples", ("what became of it", "samples", "share"), (*rows, ("all", f"{total:,}", ""))
    )


def _rejections(summary: RunSummary) -> Table | None:
    rejected = [(stage, n) for stage, n in summary.numbers if n.name.startswith("rejected")]
    rows = tuple((stage, n.name.removeprefix("rejected").strip(": "), _value(n)) for stage, n in rejected)
    return Table("Not used, by stage and reason", ("stage", "reason", "count"), rows) if rows else None


def _events(summary: RunSummary) -> Table | None:
    if summary.trajectory is None:
        return None
    rows = tuple(
        (e.kind, f"{e.frame_from} – {e.frame_to}", f"{e.size:.3g} {e.unit}", e.note)
        for e in summary.trajectory.events
    )
    note = "" if rows else "No slip, stop, reversal, dropped or repeated frame, or lost track was seen."
    return Table("Events of the motion", ("event", "frames", "size", "note"), rows, note)


def _numbers(summary: RunSummary) -> Table | None:
    told = [(s, n) for s, n in summary.numbers if n.name != WARNING and not n.name.startswith("rejected")]
    rows = tuple((stage, n.name, _value(n)) for stage, n in told)
    return Table("What the stages measured", ("stage", "quantity", "value"), rows) if rows else None


def _value(number: Number) -> str:
    text = f"{number.value:.6g}" if isinstance(number.value, float) else str(number.value)
    return f"{text} {number.unit}".strip()


def _stages(summary: RunSummary) -> Table | None:
    rows = tuple(
        (s.name, s.version, s.state.value, f"{s.seconds:.1f} s", s.key[:16], s.problem)
        for s in summary.stages
    )
    header = ("stage", "version", "state", "time", "key", "note")
    return Table("Stages", header, rows) if rows else None


def _versions(summary: RunSummary) -> Table | None:
    rows = tuple(("version", name, value) for name, value in summary.versions)
    rows += tuple(("hash of the input", name, value) for name, value in summary.inputs)
    return Table("Versions and hashes", ("what", "of", "value"), rows) if rows else None
