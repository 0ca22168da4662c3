"""A long wall is searched in stretches: findings do not depend on the cuts, nor the memory on the length."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import label

from pipeline.machine import scratch as scratch_module
from pipeline.machine.scratch import Scratch
from stages.defects import DefectParameters, along, find_defects, grow, segment
from stages.defects.detect import detect
from stages.defects.relief import smooth_shape_removed
from stages.defects.segment import Patches
from tests.quiet import quiet_context
from tests.synthetic_wall import DrawnDefect, bare_recording, grey_texture, relief, smooth_noise, wall_of

RADIUS, COLUMNS = 38.0, 240
AZIMUTH = -np.pi + np.arange(COLUMNS) * 2 * np.pi / COLUMNS
PARAMETERS = DefectParameters(draws=20)


def long_wall(drawn, length_mm=400.0, step_mm=0.5, seed=0):
    rng = np.random.default_rng(seed)
    distance = np.arange(0, length_mm, step_mm)
    slow = 0.2 * np.sin(distance / 70)[:, None] * np.cos(AZIMUTH) + 0.2 * np.cos(2 * AZIMUTH)
    noise = smooth_noise(rng, (len(distance), COLUMNS), 0.03, 1.0)
    changes = sum(relief(d, distance, AZIMUTH, RADIUS, rng) for d in drawn)
    return wall_of(distance, AZIMUTH, RADIUS + slow + noise + changes)


def search(wall, folder=None, texture=None):
    context = replace(quiet_context(), scratch=Scratch(folder))
    recording, texture = bare_recording(2 * RADIUS), texture or grey_texture(wall)
    return find_defects(recording, wall, texture, PARAMETERS, context)


def test_the_findings_do_not_depend_on_the_cuts(monkeypatch):
    drawn = (
        DrawnDefect("pit", 50.0, 3.14, 8.0, 8.0, 1.0),  # across cut and seam
        DrawnDefect("weld", 100.0, 0.0, 8.0, 0.0, -0.8),  # across a cut
        DrawnDefect("gouge", 250.0, 1.0, 220.0, 6.0, 0.6),  # longer than most stretches and their overlap
        DrawnDefect("dent", 380.0, -2.0, 30.0, 25.0, -1.0),
    )
    wall = long_wall(drawn)
    whole = search(wall)
    assert [d.kind for d in whole.items] == ["pit", "weld", "gouge", "dent"]
    for rows in (200, 101, 40):
        monkeypatch.setattr(along, "_ROWS", rows)
        cut = search(wall)
        assert [d.statement for d in cut.items] == [d.statement for d in whole.items]
        for mine, its in zip(cut.items, whole.items, strict=True):
            assert mine.depth_mm == pytest.approx(its.depth_mm, abs=1e-9)
            assert np.array_equal(mine.outline, its.outline)
            assert np.array_equal(mine.frames, its.frames)
        assert cut.detectable == whole.detectable


def test_water_along_a_fifth_of_the_wall_does_not_hide_what_is_elsewhere():
    """Its scores made the unit of all scores ten times as large: three of three defects were missed."""
    wall = long_wall((DrawnDefect("pit", 50.0, -1.5, 6.0, 6.0, 0.9),), 100.0)
    wet = np.abs(AZIMUTH - np.pi / 2) < 0.2 * np.pi
    wall.radius_map.radius_mm[:, wet] -= 9 * (1 - ((AZIMUTH[wet] - np.pi / 2) / (0.2 * np.pi)) ** 2)
    found = search(wall).items
    assert [d.kind for d in found if d.depth_mm > 0] == ["pit"]


def test_without_overlap_of_stretches_the_findings_change(monkeypatch):
    drawn = DrawnDefect("dent", 50.0, 1.0, 30.0, 25.0, -0.3)
    wall = smooth_shape_removed(long_wall((drawn,), 100.0).radius_map, PARAMETERS)
    whole = detect(wall, 0.05, Scratch(), lambda done, total: None)
    for overlapping in (True, False):
        monkeypatch.setattr(along, "_ROWS", 10)
        if not overlapping:
            monkeypatch.setattr(along, "widened", lambda own, rows, overlap: along.Stretch(own, own))
        cut = detect(wall, 0.05, Scratch(), lambda done, total: None)
        assert np.array_equal(cut.inward, whole.inward) == overlapping


def test_a_sample_of_a_long_wall_represents_all_of_it(monkeypatch):
    drawn = (DrawnDefect("pit", 80.0, 1.0, 8.0, 8.0, 0.6), DrawnDefect("dent", 300.0, 2.0, 30.0, 25.0, -1.0))
    wall = long_wall(drawn)
    wall.radius_map.radius_mm[400:560] = np.nan  # unmeasured parts are no sample
    whole = search(wall)
    monkeypatch.setattr(along, "_SAMPLED_ROWS", 320)
    sampled = search(wall)
    assert [d.kind for d in sampled.items] == [d.kind for d in whole.items] == ["pit", "dent"]
    for mine, its in zip(sampled.items, whole.items, strict=True):
        assert mine.depth_mm == pytest.approx(its.depth_mm, abs=its.depth_sigma_mm)
    assert sampled.detectable != whole.detectable  # otherwise nothing was sampled
    for mine, its in zip(sampled.detectable, whole.detectable, strict=True):
        assert mine.depth_mm == pytest.approx(its.depth_mm, rel=0.05)


def test_memory_does_not_grow_with_length(monkeypatch, tmp_path):
    monkeypatch.setattr(scratch_module, "_MAP_FROM_BYTES", 1 << 10)
    for name, value in (("_ROWS", 100), ("_SAMPLED_ROWS", 64), ("_BLOCKS", 2)):
        monkeypatch.setattr(along, name, value)

    def most(length_mm):
        wall = long_wall((DrawnDefect("pit", 100.0, 1.0, 8.0, 8.0, 0.6),), length_mm)
        texture = grey_texture(wall)
        tracemalloc.start()
        search(wall, tmp_path, texture)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak

    most(200.0)  # loaded once by libraries
    short, long = most(300.0), most(1200.0)
    one_map_of_singles = 4 * COLUMNS * 2 * (1200 - 300)
    assert long - short < 0.5 * one_map_of_singles


def test_a_coarse_map_shows_features_larger_than_its_cells():
    drawn = (DrawnDefect("dent", 200.0, 1.0, 60.0, 50.0, -1.5), DrawnDefect("pit", 401.0, 2.0, 3.0, 3.0, 0.8))
    found = search(long_wall(drawn, 800.0, 4.0)).items
    assert found[0].kind == "dent"
    assert found[0].depth_mm == pytest.approx(-1.5, abs=0.1)
    assert all(abs(d.distance_from_mm - 401.0) < 10 for d in found[1:])


def test_a_finding_longer_than_a_part_is_given_in_parts(monkeypatch):
    monkeypatch.setattr(segment, "_LONGEST_ROWS", 200)
    (first, *others) = search(long_wall((DrawnDefect("gouge", 200.0, 1.0, 240.0, 6.0, 0.6),))).items
    assert first.length_mm == pytest.approx(100.0, abs=3.0)  # the rim, joined to it, is a few rows wide
    assert len(others) == 2
    assert others[-1].distance_to_mm - first.distance_from_mm == pytest.approx(240.0, abs=10.0)


@pytest.mark.parametrize("rows", [1, 2, 7, 40])
def test_patches_equal_those_of_the_whole_map_closed_around(monkeypatch, rows):
    monkeypatch.setattr(along, "_ROWS", rows)
    mask = np.random.default_rng(rows).random((60, 30)) < 0.25
    patches = segment._patches(mask, (1.0, 1.0), 0.0, Scratch())
    there = np.concatenate([patches.of(slice(k, k + 9)) for k in range(0, 60, 9)])
    assert np.array_equal(there >= 0, mask)
    middle, _ = label(np.concatenate([mask] * 3, 1), grow._EIGHT)
    # of three copies side by side, two cells belong together where any of their copies do
    copies = [middle[:, k * 30 : (k + 1) * 30] for k in range(3)]
    for number in range(len(patches.extent)):
        cells = there == number
        inside = {int(c) for copy in copies for c in np.unique(copy[cells])}
        outside = {int(c) for copy in copies for c in np.unique(copy[mask & ~cells])}
        assert not inside & outside
        at = np.flatnonzero(cells.any(1))
        assert (patches.extent[number].start, patches.extent[number].stop) == (at[0], at[-1] + 1)
    assert isinstance(patches, Patches)
    assert len(patches.extent) == _periodic_count(mask)


def _periodic_count(mask):
    """Count patches by flood fill."""
    left, count = mask.copy(), 0
    while left.any():
        count += 1
        todo = [tuple(np.argwhere(left)[0])]
        while todo:
            i, j = todo.pop()
            if not left[i, j]:
                continue
            left[i, j] = False
            near = [(i + a, (j + b) % mask.shape[1]) for a in (-1, 0, 1) for b in (-1, 0, 1)]
            todo += [n for n in near if 0 <= n[0] < len(mask) and left[n]]
    return count
