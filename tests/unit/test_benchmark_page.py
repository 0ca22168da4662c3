"""The benchmark page: the alternatives are set up in a way that works, and figures are as computed."""

import json

import numpy as np

from pipeline.instrument.camera.fisheye import KannalaBrandt
from tests.benchmarks.page.__main__ import write
from tests.benchmarks.page.odometry import odometry
from tests.benchmarks.page.section import Method, Quantity, Section
from tests.benchmarks.page.whole import _cylinder_radius

RADIUS = 50.0


class Probe:
    camera = KannalaBrandt((1600, 1200), (366.0, 366.0), (797.0, 592.0), (-0.012, 0.0008, 0.0, 0.0))


def pose(z, roll):
    T = np.eye(4)
    T[:2, :2] = [[np.cos(roll), -np.sin(roll)], [np.sin(roll), np.cos(roll)]]
    T[:3, 3] = 0.3 * np.sin(z), 0.2, z
    return T


def test_odometry_finds_the_motion_from_perfect_tracks():
    random = np.random.default_rng(2)
    psi, z = random.uniform(-np.pi, np.pi, 1500), random.uniform(20, 90, 1500)
    wall = np.stack([RADIUS * np.cos(psi), RADIUS * np.sin(psi), z, np.ones(1500)], -1)
    truth = np.array([pose(1.2 * k, 0.01 * k) for k in range(6)])
    frames = [np.full((8, 8), k, np.uint8) for k in range(6)]
    number = iter(range(5))

    def tracker(before, after, mask):
        k = next(number)
        return tuple(Probe.camera.project((wall @ np.linalg.inv(T).T)[:, :3]).uv for T in truth[k : k + 2])

    found = truth[0] @ odometry(frames, Probe, RADIUS, tracker)
    turned = found[:, :3, :3] @ truth[:, :3, :3].transpose(0, 2, 1)
    assert np.abs(turned - np.eye(3)).max() < 1e-4
    # The scale assumes a centred camera, which is off by 0.4 mm of 50.
    assert np.abs(found[:, 2, 3] - truth[:, 2, 3]).max() < 0.02 * 6


def test_the_cylinder_through_points_with_outliers_has_the_right_radius():
    random = np.random.default_rng(4)
    psi, z = random.uniform(-np.pi, np.pi, 4000), random.uniform(0, 200, 4000)
    points = np.stack([3 * np.cos(psi), 3 * np.sin(psi), z / 17], -1) + random.normal(0, 0.004, (4000, 3))
    points[::20] *= 1.3
    turn = np.linalg.qr(random.normal(size=(3, 3)))[0]
    centres = np.stack([0.1 * random.normal(size=30), 0 * np.arange(30), np.linspace(0, 9, 30)], -1)
    assert abs(_cylinder_radius(points @ turn, centres @ turn) - 3) < 0.003


def test_page_and_figures_agree(tmp_path):
    methods = (
        Method("boresight", {"wall_s": 2.0, "error": 0.5}),
        Method("other", {"wall_s": 5.0, "error": None}),
        Method("third", {}, "not installed"),
    )
    quantities = (Quantity("wall_s", "time", "s"), Quantity("error", "error", "mm"))
    write(
        [Section("one", "One", ("how",), quantities, methods, ("<svg>drawn</svg>",))],
        {"recording": "r"},
        tmp_path,
    )
    told = json.loads((tmp_path / "figures.json").read_text("utf-8"))["sections"][0]
    assert told["ratios_to_boresight"] == {"other": {"wall_s": 2.5}, "third": {}}
    assert told["methods"][1]["figures"] == {"wall_s": 5.0, "error": None}
    page = (tmp_path / "page.html").read_text("utf-8")
    assert "(2.5×)" in page
    assert "third: not installed" in page
    assert "<svg>drawn</svg>" in page


def test_the_page_says_where_boresight_is_behind():
    quantities = (
        Quantity("error", "error", "mm"),
        Quantity("rate", "rate", "1/s", "more"),
        Quantity("triangles", "triangles", better=None),
    )
    methods = (
        Method("boresight", {"error": 0.5, "rate": 9.0, "triangles": 7.0}),
        Method("other", {"error": 0.4, "rate": 8.0, "triangles": 3.0}),
        Method("third", {"error": None, "rate": 10.0}),
    )
    told = Section("one", "One", (), quantities, methods, why_behind={"rate": "It only measures."}).behind()
    assert told == (
        "error: better by other. The cause is not known.",
        "rate: better by third. It only measures.",
    )
    assert Section("one", "One", (), quantities, methods[:1]).behind() == ()
