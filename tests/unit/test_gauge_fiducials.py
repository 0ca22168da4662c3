"""Fiducials of a gauge: swapped, of another size, mirrored, invisible or crowded."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import nullcontext
from dataclasses import replace

import cv2
import numpy as np
import pytest

from pipeline.arrays import Image
from pipeline.errors import UnusableError
from pipeline.geometry.rigid import inverse, transform
from pipeline.recording.base import Illumination, Planes, Recording
from stages.calibrate.gauge import premises
from stages.calibrate.gauge.edges import Sighting, find_fiducials
from stages.calibrate.gauge.geometry import Gauge, gauge_of
from stages.calibrate.gauge.poses import first_pose, posed_frames
from tests.gauge_runs import (
    USUAL,
    GaugeRun,
    driven,
    facts,
    made_run,
    stated_probe,
)


@pytest.fixture(scope="module")
def run() -> GaugeRun:
    return made_run(1)


def _sightings(gauge: Gauge, seen: Gauge | None = None, least: int = 20) -> list[Sighting]:
    """Return corners of ``seen`` as the stated camera sees them, with the names of ``gauge``."""
    seen = seen or gauge
    camera, out = stated_probe().camera, []
    centre = np.array([m.distance_mm for m in gauge.fiducials.markers])
    for k, T_pc in enumerate(driven(least, np.random.default_rng(0))):
        marker = np.flatnonzero((centre > T_pc[2, 3] + 15) & (centre < T_pc[2, 3] + 60))
        uv = camera.project(transform(inverse(T_pc), seen.corners(marker))).uv
        out.append(Sighting(k, marker, uv, np.zeros(0, np.int64)))
    return out


def _posed(sightings: Sequence[Sighting], gauge: Gauge, run: GaugeRun):  # type: ignore[no-untyped-def]
    random = np.random.default_rng(0)
    poses = [first_pose(s, gauge, stated_probe().camera, random) for s in sightings]
    return posed_frames(run.recording, sightings, poses)


def test_one_swapped_pair_among_fifty_fiducials_is_rejected(run: GaugeRun) -> None:
    markers = list(run.gauge.fiducials.markers)
    markers[3], markers[5] = replace(markers[5], id=3), replace(markers[3], id=5)
    swapped = replace(run.gauge, fiducials=replace(run.gauge.fiducials, markers=tuple(markers)))
    posed = _posed(_sightings(swapped, run.gauge), swapped, run)
    assert swapped.ids[premises.outvoted_fiducials(posed, swapped)].tolist() == [3, 5]
    assert premises.outvoted_fiducials(_posed(_sightings(run.gauge), run.gauge, run), run.gauge).size == 0


def _with_fiducials(gauge: Gauge, **changes: object) -> Gauge:
    return replace(gauge, fiducials=replace(gauge.fiducials, **changes))  # type: ignore[arg-type]


def test_fiducials_of_another_size_are_refused(run: GaugeRun) -> None:
    larger = _with_fiducials(run.gauge, size_mm=10.0)
    dim = replace(run.recording, source=Pictures(np.full((1200, 1600), 180, np.uint8)))
    sightings = _sightings(larger, run.gauge)
    posed = _posed(sightings, larger, run)
    with pytest.raises(UnusableError, match=r"measure (8\.9|9\.0|9\.1)\d* mm where .* says 10 mm"):
        premises.require_poses(dim, posed, sightings, larger, stated_probe().camera, USUAL)
    right = _sightings(run.gauge)
    posed = _posed(right, run.gauge, run)
    premises.require_poses(run.recording, posed, right, run.gauge, stated_probe().camera, USUAL)


@pytest.mark.parametrize(
    ("moved_px", "grey", "refused"),
    [(0.75, 255, False), (1.5, 255, True), (-0.75, 255, True), (0.75, 180, True)],
)
def test_fiducials_that_overexposure_makes_smaller_by_a_pixel_are_not_of_another_size(
    run: GaugeRun, moved_px: float, grey: int, refused: bool
) -> None:
    """Overexposed white made fiducials of 25 px .7 px smaller on each side.

    The advice was "measure 4.75 mm", not 5 mm. A first mend accepted as much without overexposure, and larger
    ones: 20 % of a fiducial of 10 px.
    """
    recording = replace(run.recording, source=Pictures(np.full((1200, 1600), grey, np.uint8)))
    small, smaller = _with_fiducials(run.gauge, size_mm=3.0), []
    for one in _sightings(small):
        inward = one.corner_px.mean(1, keepdims=True) - one.corner_px
        inward *= moved_px * np.sqrt(2) / np.linalg.norm(inward, axis=-1, keepdims=True)
        smaller.append(replace(one, corner_px=one.corner_px + inward))
    posed = _posed(smaller, small, run)
    with pytest.raises(UnusableError, match="measure") if refused else nullcontext():
        premises.require_poses(recording, posed, smaller, small, stated_probe().camera, USUAL)


def test_mirrored_places_of_fiducials_are_refused(run: GaugeRun) -> None:
    markers = tuple(replace(m, azimuth_deg=-m.azimuth_deg) for m in run.gauge.fiducials.markers)
    mirrored = _with_fiducials(run.gauge, markers=markers)
    sightings = _sightings(mirrored, run.gauge)
    posed = posed_frames(
        run.recording, sightings,
        [first_pose(s, mirrored, stated_probe().camera, np.random.default_rng(0)) for s in sightings],
    )  # fmt: skip
    with pytest.raises(UnusableError, match="mirrored, swapped or placed otherwise"):
        premises.require_poses(run.recording, posed, sightings, mirrored, stated_probe().camera, USUAL)


class Pictures:
    """A frame source with the same picture in every frame."""

    def __init__(self, image: Image) -> None:
        self._image = image
        self.image_size = (image.shape[1], image.shape[0])

    def read(self, frames: Sequence[int], planes: Planes) -> Iterator[tuple[int, Image | None]]:
        colours = cv2.cvtColor(self._image, cv2.COLOR_GRAY2BGR)
        yield from ((int(f), self._image if planes == "grey" else colours) for f in frames)


def _picture(dictionary: int, numbers: Sequence[int]) -> Image:
    image = np.full((420, 700), 255, np.uint8)
    known = cv2.aruco.getPredefinedDictionary(dictionary)
    for k, number in enumerate(numbers):
        row, column = divmod(k, 3)
        marker = cv2.aruco.generateImageMarker(known, number, 120)
        image[60 + 180 * row : 180 + 180 * row, 60 + 200 * column : 180 + 200 * column] = marker
    return image


@pytest.mark.parametrize(
    ("image", "said"),
    [
        (_picture(cv2.aruco.DICT_5X5_100, range(6)), "DICT_5X5_1000 are seen instead of DICT_4X4"),
        (np.ascontiguousarray(_picture(cv2.aruco.DICT_4X4_100, range(6))[:, ::-1]), "mirrored"),
        (_picture(cv2.aruco.DICT_4X4_100, range(80, 86)), "other numbers are seen: 80, 81"),
        (np.full((420, 700), 90, np.uint8), "in only 0 of 30 lit frames$|in only 0 of 30 lit frames\n"),
    ],
)
def test_invisible_fiducials_are_refused_with_the_likely_cause(
    run: GaugeRun, image: Image, said: str
) -> None:
    recording: Recording = replace(run.recording, source=Pictures(image))
    lit = recording.frames.of(Illumination.LED)
    sightings = [s for s, _ in find_fiducials(recording.read(lit, "grey"), run.gauge)]
    with pytest.raises(UnusableError, match=said):
        premises.require_fiducials(recording, run.gauge, sightings, USUAL)


@pytest.mark.parametrize("spread_px", [0.0, 1e-3])
def test_fiducials_that_crowd_into_one_place_give_no_pose(spread_px: float) -> None:
    random = np.random.default_rng(0)
    crowded = Sighting(0, np.arange(6), 800 + random.normal(0, spread_px, (6, 4, 2)), np.zeros(0, np.int64))
    assert first_pose(crowded, gauge_of(facts(), facts().fiducials), stated_probe().camera, random) is None
