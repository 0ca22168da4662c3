"""Names that standards give to what was found: POF dimension classes, and suggested inspection codes."""

from __future__ import annotations

import numpy as np

from pipeline.artefacts.findings import DefectKind

_LONGITUDINAL, _CIRCUMFERENTIAL = np.radians(30), np.radians(60)

_PACP = {
    DefectKind.PIT: "SCP (surface damage, corrosion)",
    DefectKind.CORROSION: "SCP (surface damage, corrosion)",
    DefectKind.GOUGE: "SZ (surface damage, other)",
    DefectKind.DENT: "D (deformed)",
    DefectKind.DEPOSIT: "DAZ (deposits attached, other)",
    DefectKind.WELD: "MGO (general observation: weld bead)",
}
_EN13508 = {
    DefectKind.PIT: "BAF (surface damage)",
    DefectKind.CORROSION: "BAF (surface damage)",
    DefectKind.GOUGE: "BAF (surface damage)",
    DefectKind.CRACK: "BAB (fissure)",
    DefectKind.DENT: "BAA (deformation)",
    DefectKind.DEPOSIT: "BBB (attached deposits)",
    DefectKind.WELD: "BDB (general remark: weld bead)",
}


def pof_class(length_mm: float, width_mm: float, wall_thickness_mm: float | None) -> str:
    """Return the dimension class of a metal loss (POF 100, Specifications and requirements for ILI, 2021).

    A is the wall thickness, but at least 10 mm; L along the pipe, W around it.
    """
    a = max(wall_thickness_mm or 0.0, 10.0)
    long, wide, ratio = length_mm / a, width_mm / a, length_mm / width_mm
    rules = (
        ("general", wide >= 3 and long >= 3),
        ("pinhole", wide < 1 and long < 1),
        ("axial slotting", wide < 1),
        ("circumferential slotting", long < 1),
        ("pitting", wide < 6 and long < 6 and 0.5 < ratio < 2),
        ("axial grooving", ratio >= 2),
        ("circumferential grooving", True),
    )
    return next(name for name, holds in rules if holds)


def pacp_suggestion(kind: DefectKind, direction_rad: float) -> str:
    """Return a PACP code that an inspector may choose."""
    if kind is not DefectKind.CRACK:
        return _PACP[kind]
    if direction_rad < _LONGITUDINAL:
        return "CL (crack, longitudinal)"
    return "CC (crack, circumferential)" if direction_rad > _CIRCUMFERENTIAL else "CS (crack, spiral)"


def en13508_suggestion(kind: DefectKind) -> str:
    """Return an EN 13508-2 main code that an inspector may choose."""
    return _EN13508[kind]
