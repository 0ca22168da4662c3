"""Run a recording and read what was measured: python measure.py RECORDING RUN."""

import sys

import boresight
import numpy as np

recording, folder = sys.argv[1:3]
# Few azimuths and coarse texels are quick. Leave the settings out to measure with all that is there.
run = boresight.run(recording, folder, settings=["rings.azimuths=360", "mesh.texel_mm=1.0"])

for number in run.numbers:
    print(f"{number.name}: {number.value} {number.unit}")
for warning in run.warnings:
    print(f"warning: {warning}")

radius = run.wall.radius_map  # (S, A) over distance and azimuth, mm; NaN where nothing was seen
seen = np.isfinite(radius.radius_mm)
mean_mm, sigma_mm = radius.radius_mm[seen].mean(), np.median(radius.sigma_mm[seen])
print(f"mean radius {mean_mm:.3f} mm, median 1 σ of a cell {sigma_mm:.3f} mm")

for finding in run.findings():
    size = finding.size
    depth = f"{size.depth_mm:.2f} ± {size.depth_sigma_mm:.2f} mm deep"
    print(f"{finding.kind} at {size.distance_from_mm:.0f} mm, {depth}")
