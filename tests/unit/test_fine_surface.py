"""The local quadratic regression against plain NumPy, and its purpose: a peak keeps its height."""

from dataclasses import replace

import numpy as np

from pipeline.artefacts.cloud_along import cloud_along
from stages.defects.parameters import DefectParameters
from stages.defects.relief import smooth_shape_removed
from stages.defects.surface import deviation_points, fine_surface
from tests.synthetic_wall import wall_of

DISTANCE, AZIMUTH = np.arange(0, 40, 0.5), -np.pi + np.arange(360) * np.pi / 180
RADIUS = 25.0


def relief_and_points(radius, unsure=1.0):
    """Return relief and points; the σ of every third point is ``unsure`` times that of the others."""
    wall = wall_of(DISTANCE, AZIMUTH, radius, 0.02)
    sigma = wall.cloud.sigma_mm.copy()
    sigma[::3] *= unsure
    wall = replace(wall, cloud=replace(wall.cloud, sigma_mm=sigma))
    relief = smooth_shape_removed(wall.radius_map, DefectParameters()).rows(slice(0, len(DISTANCE)))
    cloud = cloud_along(wall.cloud)
    return relief, deviation_points(relief, cloud.between(-1.0, 41.0), cloud.ring_spacing_mm())


def surface_of(relief, points):
    return fine_surface(relief, points, relief.seen, np.full(relief.seen.shape, np.nan))


def reference(relief, points, row, column):
    s = (points.row - row) * relief.cell_mm[0]
    q = points.column - column
    q = (q - 360 * np.rint(q / 360)) * relief.cell_mm[1]
    along, around = points.kernel_mm
    # the same window of whole cells as the kernel takes
    reach = np.ceil(2.5 * along / relief.cell_mm[0]), np.ceil(2.5 * around / relief.cell_mm[1])
    near = (np.abs(s) <= (reach[0] + 0.1) * relief.cell_mm[0]) & (
        np.abs(q) <= (reach[1] + 0.1) * relief.cell_mm[1]
    )
    s, q, value = s[near], q[near], points.deviation_mm[near]
    weight = points.weight[near] * np.exp(-0.5 * ((s / along) ** 2 + (q / around) ** 2))
    basis = np.stack([np.ones_like(s), s, q, s * s, s * q, q * q], -1)
    normal = basis.T @ (weight[:, None] * basis) + 1e-4 * weight.sum() * np.eye(6)
    # 1 σ of the curvature along the pipe is that of a pit 1 mm deep and 3 mm across, before it is measured
    normal[3, 3] += (relief.typical.noise_mm * 1.5**2) ** 2
    found = np.linalg.solve(normal, basis.T @ (weight * value))
    return found[0] + (found[3] + found[5]) / 12


def test_the_regression_agrees_with_numpy_also_across_the_seam():
    radius = RADIUS + np.random.default_rng(0).normal(0, 0.1, (len(DISTANCE), len(AZIMUTH)))
    relief, points = relief_and_points(radius, unsure=2.5)
    assert np.unique(np.round(points.weight, 6)).tolist() == [0.16, 1.0]
    surface = surface_of(relief, points)
    for row, column in ((40, 180), (20, 0), (60, 359), (33, 1)):
        assert abs(surface[row, column] - reference(relief, points, row, column)) < 1e-9


def test_a_peak_keeps_the_height_of_its_millimetre_mean():
    s, psi = np.meshgrid(DISTANCE - 20, AZIMUTH, indexing="ij")
    q = (s / 2) ** 2 + (psi * RADIUS / 2) ** 2
    relief, points = relief_and_points(RADIUS + np.exp(-0.5 * q))
    fine = np.linspace(-0.5, 0.5, 101)
    true = np.exp(-0.5 * (fine / 2) ** 2).mean() ** 2
    # only the ridge of 1e-4 and terms of fourth order remain
    assert abs(surface_of(relief, points)[40, 180] - true) < 0.005
