"""Ring samples of the open recordings against rings computed from their true poses and walls.

The stated probe is off by a draw from its own uncertainty, which moves a ring smoothly. So low harmonics of
the azimuth are removed from each frame's errors before they are tested.
"""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from pipeline.adjustment.robust import robust_spread
from pipeline.instrument.probe_file import read_probe
from pipeline.recording import open_recording
from pipeline.recording.base import FrameTable
from stages.rings import RingParameters, extract_rings
from tests.quiet import quiet_context
from tests.shared_data import shared


class TrueRings:
    """Exact ring radii of a recording for its stated probe."""

    def __init__(self, folder, probe):
        truth, wall = json.loads((folder / "truth.json").read_text()), np.load(folder / "truth_wall.npz")
        self.poses, self.bend, self.probe = (
            np.array(truth["camera_pose_in_pipe"]),
            truth["pipe"]["bend"],
            probe,
        )
        self.distance, self.azimuth = wall["distance_mm"], wall["azimuth_rad"]
        self.wall = np.concatenate([wall["radius_mm"], wall["radius_mm"][:, :1]], 1).astype(float)

    def straightened(self, xyz_p):
        """Section coordinates and distance along the axis of a pipe bent to a circular arc."""
        curvature, towards = self.bend
        if curvature == 0:
            return xyz_p
        inward = np.array([np.cos(towards), np.sin(towards)])
        across, aside = xyz_p[:, :2] @ inward, xyz_p[:, :2] @ np.array([-inward[1], inward[0]])
        to_centre = 1 / curvature - across
        section = 1 / curvature - np.hypot(to_centre, xyz_p[:, 2])
        xy = section[:, None] * inward + aside[:, None] * np.array([-inward[1], inward[0]])
        return np.column_stack([xy, np.arctan2(xyz_p[:, 2], to_centre) / curvature])

    def outside(self, frame, psi, rho):
        """Distance, mm, by which laser points at image radius ``rho`` lie outside of the wall."""
        uv = self.probe.camera.centre_px + rho[:, None] * np.stack([np.cos(psi), np.sin(psi)], -1)
        pose = self.poses[frame]
        x, y, z = self.straightened(self.probe.triangulate(uv) @ pose[:, :3].T + pose[:, 3]).T
        row = (z - self.distance[0]) / (self.distance[1] - self.distance[0])
        column = np.mod(np.arctan2(y, x) - self.azimuth[0], 2 * np.pi) / (self.azimuth[1] - self.azimuth[0])
        return np.hypot(x, y) - map_coordinates(self.wall, [row, column], order=1, mode="nearest")

    def radius_px(self, frame, psi):
        """Return the exact ring, px, found by bisection."""
        low, high = np.full(psi.shape, 100.0), np.full(psi.shape, 560.0)
        for _ in range(32):
            middle = (low + high) / 2
            beyond = self.outside(frame, psi, middle) > 0
            low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
        return (low + high) / 2


def smooth_part_removed(error, psi):
    """Remove harmonics 0 to 4 from each row (F, A) by a robust fit."""
    waves = [np.ones_like(psi), *(f(m * psi) for m in (1, 2, 3, 4) for f in (np.cos, np.sin))]
    basis, out = np.stack(waves, 1), error.copy()
    for row in out:
        good = np.isfinite(row)
        for _ in range(4):
            rest = row - basis @ np.linalg.lstsq(basis[good], row[good], rcond=None)[0]
            good = np.abs(rest) < 4 * robust_spread(rest)
        row[:] = rest
    return out


def judged(name, every, count):
    """Extract ``count`` laser frames, one in ``every``; return samples and their errors, px."""
    folder = shared("recordings", name)
    recording = open_recording(folder)
    probe = read_probe(recording.probe_file)
    table = recording.frames
    lit = table.illumination != "led"
    chosen = np.flatnonzero(lit)[::every][:count]
    recording = replace(recording, frames=FrameTable(*(c[chosen] for c in (
        table.frame, table.time_s, table.illumination))))  # fmt: skip
    samples = extract_rings(recording, probe, RingParameters(), quiet_context())
    truth = TrueRings(folder, probe)
    exact = np.stack([truth.radius_px(f, samples.azimuth_rad) for f in samples.frame])
    error = np.where(samples.valid, samples.radius_px - exact, np.nan)
    return samples, smooth_part_removed(error, samples.azimuth_rad)


@pytest.mark.parametrize(
    ("name", "noise_px"), [("open-1-field", 0.085), ("open-3-field", 0.21)], ids=["laser only", "lit wall"]
)
def test_sigma_is_true_on_an_independent_rendering(name, noise_px):
    samples, error = judged(name, 6, 12)
    z = np.abs(error / samples.sigma_px)[np.isfinite(error)]
    assert samples.valid.mean() > 0.99
    assert 0.93 < np.mean(z < 1.96) < 0.97
    assert robust_spread(error) < noise_px


def test_clipped_rings_of_a_gauge_are_used():
    samples, error = judged("open-1-gauge", 2, 12)
    assert samples.valid.mean() > 0.95
    assert robust_spread(error) < 0.1
