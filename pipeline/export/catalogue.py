"""The list of all files of a run folder, with the functions that write them."""

from __future__ import annotations

from pipeline.export.arrays import write_cloud, write_radius_map, write_rings
from pipeline.export.glb import write_model
from pipeline.export.pictures import write_overlays, write_unrolled
from pipeline.export.report import write_report_page
from pipeline.export.tables import write_centreline, write_defects, write_sections, write_trajectory
from pipeline.export.tileset import write_tileset
from pipeline.machine.run_folder import Exporter

EXPORTERS = (
    Exporter("rings.zarr", write_rings),
    Exporter("trajectory.csv", write_trajectory),
    Exporter("centreline", write_centreline),
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
