"""Clock positions, and the files of sections and defects."""

import csv
import json
from dataclasses import fields

import numpy as np
import pytest

from pipeline.export.findings import write_defects, write_sections
from pipeline.findings import Defect, Defects, Sections, azimuth_of_clock, clock_of_azimuth

ASKED = (
    "id", "kind", "distance_from_mm", "distance_to_mm", "clock_from", "clock_to", "length_mm", "width_mm",
    "depth_mm", "depth_sigma_mm", "wall_loss_percent", "confidence", "frames",
)  # fmt: skip


def a_defect(**changes):
    base = {
        "id": 1, "kind": "pit", "distance_from_mm": 10.0, "distance_to_mm": 14.0, "clock_from": 11.5,
        "clock_to": 0.5, "length_mm": 4.0, "width_mm": 5.0, "depth_mm": 0.7, "depth_sigma_mm": 0.03,
        "wall_loss_percent": float("nan"), "confidence": 0.9, "frames": np.array([3, 5]),
        "outline": np.array([[10.0, -1.7], [14.0, -1.7], [14.0, -1.4]]), "pof_class": "pinhole",
        "pacp_suggestion": "SCP", "en13508_suggestion": "BAF", "statement": 'Pit, "deep"',
    }  # fmt: skip
    return Defect(**{**base, **changes})


@pytest.mark.parametrize(
    ("azimuth_deg", "hours"), [(-90, 0), (0, 3), (90, 6), (180, 9), (-180, 9), (-105, 11.5), (255, 11.5)]
)
def test_clock_runs_clockwise_from_twelve_at_minus_y(azimuth_deg, hours):
    assert clock_of_azimuth(np.radians(azimuth_deg)) == pytest.approx(hours, abs=1e-9)


def test_clock_stays_below_twelve_and_comes_back():
    azimuth = np.linspace(-7, 7, 1001)
    hours = clock_of_azimuth(azimuth)
    assert np.all((hours >= 0) & (hours < 12))
    assert np.allclose(np.exp(1j * azimuth_of_clock(hours)), np.exp(1j * azimuth))


def test_defects_file_has_the_agreed_keys_and_null_for_unknown(tmp_path):
    write_defects(Defects((a_defect(), a_defect(id=2, wall_loss_percent=14.0)), 0.05, 0.3), tmp_path)
    records = json.loads((tmp_path / "defects.json").read_text(encoding="utf-8"))
    assert all(set(ASKED) <= set(r) for r in records)
    assert records[0]["wall_loss_percent"] is None
    assert records[1]["wall_loss_percent"] == 14.0
    assert records[0]["frames"] == [3, 5]
    with (tmp_path / "defects.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert set(ASKED) <= set(rows[0])
    assert rows[0]["wall_loss_percent"] == ""
    assert rows[0]["frames"] == "3 5"
    assert rows[0]["statement"] == 'Pit, "deep"'


def test_no_defects_is_an_empty_list(tmp_path):
    write_defects(Defects((), 0.05, 0.3), tmp_path)
    assert json.loads((tmp_path / "defects.json").read_text()) == []


def test_sections_file_leaves_unmeasured_cells_empty(tmp_path):
    columns = np.arange(2.0) + np.arange(len(fields(Sections)))[:, None]
    columns[2:, 1] = np.nan
    write_sections(Sections(*columns), tmp_path)
    with (tmp_path / "sections.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert float(rows[0]["mean_diameter_mm"]) == 2
    assert rows[1]["mean_diameter_mm"] == ""
    assert float(rows[1]["coverage"]) == 2
    assert float(rows[0]["major_axis_deg"]) == pytest.approx(np.degrees(columns[16, 0]), rel=1e-5)
