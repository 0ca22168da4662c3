"""Every file of a run folder and who writes it, in one place."""

from __future__ import annotations

from pipeline.export.exporter import Exporter
from pipeline.export.radius_map import write_radius_map
from pipeline.export.report import write_report_page
from pipeline.export.rings import write_rings
from pipeline.export.trajectory import write_trajectory

EXPORTERS = (
    Exporter("rings.zarr", write_rings),
    Exporter("trajectory.csv", write_trajectory),
    Exporter("radius_map.npz", write_radius_map),
    Exporter("report.html", write_report_page),
)
