"""The section ``pipe`` of recording.yaml."""

from __future__ import annotations

from pipeline.files.yaml_file import Section
from pipeline.recording.base import BoreSection, Fiducials, Marker, PipeFacts

_PIPE_KEYS = ("nominal_diameter_mm", "wall_thickness_mm", "bore", "bore_tolerance_mm", "fiducials")
_FIDUCIAL_KEYS = ("dictionary", "size_mm", "columns_along", "rows_along", "markers")


def pipe_facts(section: Section) -> PipeFacts:
    """Return what a recording's ``pipe`` section says; raises `InputError` at the key at fault."""
    section.refuse_unknown(_PIPE_KEYS)
    has = section.has
    return PipeFacts(
        nominal_diameter_mm=section.number("nominal_diameter_mm", above=0),
        wall_thickness_mm=section.number("wall_thickness_mm", above=0) if has("wall_thickness_mm") else None,
        bore=tuple(map(_bore, section.sections("bore"))) if has("bore") else (),
        bore_tolerance_mm=section.number("bore_tolerance_mm", least=0) if has("bore_tolerance_mm") else 0.0,
        fiducials=_fiducials(section.section("fiducials")) if has("fiducials") else None,
    )


def _bore(section: Section) -> BoreSection:
    section.refuse_unknown(("length_mm", "diameter_mm"))
    return BoreSection(section.number("length_mm", above=0), section.number("diameter_mm", above=0))


def _fiducials(section: Section) -> Fiducials:
    section.refuse_unknown(_FIDUCIAL_KEYS)
    return Fiducials(
        dictionary=section.text("dictionary"),
        size_mm=section.number("size_mm", above=0),
        columns_along=section.choice("columns_along", ("+azimuth", "-azimuth")),
        rows_along=section.choice("rows_along", ("+distance", "-distance")),
        markers=tuple(map(_marker, section.sections("markers"))),
    )


def _marker(section: Section) -> Marker:
    section.refuse_unknown(("id", "distance_mm", "azimuth_deg"))
    return Marker(
        section.integer("id", least=0), section.number("distance_mm"), section.number("azimuth_deg")
    )
