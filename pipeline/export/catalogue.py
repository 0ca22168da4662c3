"""Every file of a run folder and who writes it, in one place."""

from __future__ import annotations

from pipeline.export.cloud import write_cloud
from pipeline.export.exporter import Exporter
from pipeline.export.findings import write_defects, write_sections
from pipeline.export.glb import write_model
from pipeline.export.overlays import write_overlays
from pipeline.export.radius_map import write_radius_map
from pipeline.export.report import write_report_page
from pipeline.export.rings import write_rings
from pipeline.export.tileset import write_tileset
from pipeline.export.trajectory import write_trajectory
from pipeline.export.unrolled import write_unrolled

EXPORTERS = (
    Exporter("rings.zarr", write_rings),
    Exporter("trajectory.csv", write_trajectory),
    Exporter("radius_map.npz", write_radius_map),
    Exporter("cloud.ply", write_cloud),
    Exporter("model.glb", write_model),
    Exporter("tileset", write_tileset),
    Exporter("overlays", write_overlays),
    Exporter("unrolled.png", write_unrolled),
    Exporter("sections.csv", write_sections),
    Exporter("defects.json", write_defects),
    Exporter("report.html", write_report_page),
)
