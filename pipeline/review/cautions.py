"""What people are told of a finding beside its size: its label, and what is doubtful of it."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import lru_cache

from pipeline.artefacts.findings import DefectKind
from pipeline.artefacts.measured import Wall
from pipeline.pages import notation
from pipeline.review.decisions.replay import Finding, Measured
from pipeline.review.measuring import OutlineGauge
from pipeline.review.run_files import RunFiles, measured_findings

_MADE = {"m": "merged", "a": "added"}
_ID = re.compile(r"([ma]?)(\d+)(.*)")
_SURE_SIGMA = 2.0


def labels(findings: Iterable[Finding]) -> dict[str, str]:
    """Return what each finding is called, by its id: ``3``, ``4 (merged)``, ``5 (added)``, ``3.1 (split)``.

    Those made by hand are numbered on from the measured ones, in the order in which they were made;
    ``findings`` are all of a review, those that are gone too.
    """
    parts = {f.id: _parts(f.id) for f in findings}
    measured = max((number for made, number, _ in parts.values() if not made), default=0)
    by_hand = sorted({number for made, number, _ in parts.values() if made})
    counted = {number: measured + k for k, number in enumerate(by_hand, 1)}
    out = {}
    for name, (made, number, rest) in parts.items():
        how = "split" if rest else _MADE.get(made, "")
        out[name] = f"{counted[number] if made else number}{rest}" + (f" ({how})" if how else "")
    return out


def _parts(name: str) -> tuple[str, int, str]:
    found = _ID.fullmatch(name)
    assert found is not None, f"{name} is no id of a finding"
    return found[1], int(found[2]), found[3]


def cautions(files: RunFiles, finding: Finding) -> tuple[str, ...]:
    """Return in sentences what an inspector should know before relying on a finding as it stands."""
    return tuple(c for c in (contradiction(finding), _read_again(files, finding)) if c)


def contradiction(finding: Finding) -> str:
    """Return where the kind says one way and the measured depth the other, at 2 σ."""
    size, is_loss = finding.size, DefectKind(finding.kind).is_metal_loss
    into_wall = size.depth_mm if is_loss else -size.depth_mm
    if not into_wall < -_SURE_SIGMA * size.depth_sigma_mm:
        return ""
    way = "goes into the wall" if is_loss else "stands into the bore"
    read = notation.depth(size.depth_mm, size.depth_sigma_mm)
    return f"A {finding.kind} {way}, but this outline measures {read}. Check its kind and its outline."


def _read_again(files: RunFiles, finding: Finding) -> str:
    """Return why a measured finding's depth changed when its outline was drawn again."""
    if not finding.edited:
        return ""
    run = _as_measured(files, files.version).get(finding.original or 0)
    if run is None or run.outline == finding.outline:
        return ""
    same = OutlineGauge(files.artefact(Wall).radius_map).measure(run.outline)
    return (
        "The depth was read again because the outline was drawn again. "
        f"The run found {_depth(run.size)}, from single points of the rings against the fitted pipe. "
        "The review reads the map of the wall: the extreme of its means over 1 mm, against the wall within "
        f"6 mm around the outline. Read so, the run's own outline gives {_depth(same)}, the new one "
        f"{_depth(finding.size)}."
    )


def _depth(size: Measured) -> str:
    return notation.depth(size.depth_mm, size.depth_sigma_mm)


@lru_cache(maxsize=4)
def _as_measured(files: RunFiles, _version: str) -> dict[int, Finding]:
    found = measured_findings(files.defects_text(), files.path / "defects.json")
    return {f.original: f for f in found if f.original is not None}
