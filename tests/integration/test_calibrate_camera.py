"""`boresight calibrate-camera`: from rendered pictures to a camera, its files and page.

It also tests refused inputs.
"""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest
import typer
import yaml
from typer.testing import CliRunner

from pipeline.commands.calibrate_camera import calibrate_camera
from pipeline.errors import InputError, UnusableError
from pipeline.instrument.camera.fisheye import KannalaBrandt
from pipeline.instrument.camera.formats import read_camera, write_camera
from pipeline.instrument.camera.mapping import camera_from_mapping
from stages.calibrate.boards.detect import Charuco
from tests.board_scene import chessboard_picture, facing_pose, render

CAMERA = KannalaBrandt((640, 480), (184.0, 183.6), (318.6, 240.9), (-0.0118, 0.0008, -0.0008, 0.0001))
PX_PER_MM = 4.0
SQUARES = ["--columns", "8", "--rows", "6", "--square-mm", "20"]
CHESSBOARD = [*SQUARES, "--board-shape", "flat", "--folds", "3"]
POSES = [
    ([0.0, 0.0, 1.0], 100.0, [0.3, 0.1, 0.0]),
    ([0.3, 0.1, 1.0], 120.0, [-0.3, 0.3, 0.2]),
    ([-0.4, 0.2, 1.0], 110.0, [0.1, -0.5, 0.1]),
    ([0.1, -0.4, 1.0], 100.0, [0.4, 0.1, -0.3]),
    ([0.7, 0.4, 1.0], 130.0, [0.2, 0.2, 0.9]),
    ([-0.8, -0.3, 1.0], 130.0, [-0.4, 0.1, 0.3]),
    ([0.0, 0.6, 1.0], 90.0, [0.1, 0.4, -0.2]),
    ([1.2, -0.1, 1.0], 140.0, [0.2, -0.2, 0.1]),
]


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = tmp_path_factory.mktemp("boards")
    face, _ = chessboard_picture(8, 6, 80, 60)
    random = np.random.default_rng(0)
    for i, pose in enumerate(POSES):
        cv2.imwrite(str(folder / f"{i}.png"), render(CAMERA, facing_pose(*pose), face, PX_PER_MM, random))
    return folder


def run(*arguments):
    app = typer.Typer()
    app.command()(calibrate_camera)
    return CliRunner().invoke(app, [str(a) for a in arguments], catch_exceptions=False)


def test_pictures_rendered_with_a_camera_give_that_camera(pictures, tmp_path):
    (pictures / "notes.txt").write_text("not a picture, not looked at")
    result = run(pictures, *CHESSBOARD, "--model", "kannala_brandt", "-o", tmp_path / "out")
    assert result.exit_code == 0
    written = read_camera(tmp_path / "out" / "camera.yaml")
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert len(document["views"]) == len(POSES)
    assert document["rms_px"] < 0.15
    sigma = {p["name"]: p["sigma"] for p in document["parameters"]}
    for name, found, true in zip(CAMERA.parameter_names, written.parameters, CAMERA.parameters, strict=True):
        assert abs(found - true) < 5 * sigma[name], name
    uv = np.array([[320.0, 240.0], [120, 100], [560, 380]])
    np.testing.assert_allclose(written.project(CAMERA.unproject(uv).ray).uv, uv, rtol=0, atol=0.8)


def test_the_camera_file_is_a_section_of_a_probe_file(pictures, tmp_path):
    run(pictures, *CHESSBOARD, "--model", "equidistant", "-o", tmp_path / "out")
    section = yaml.safe_load((tmp_path / "out" / "camera.yaml").read_text())["camera"]
    assert camera_from_mapping(section, tmp_path / "out" / "camera.yaml").model == "equidistant"


def test_the_page_needs_no_other_file_and_a_second_run_writes_the_same(pictures, tmp_path):
    other = tmp_path / "other.yaml"
    write_camera(replace(CAMERA, centre=(320.0, 240.0)), other, "opencv")
    options = ["--compare", other, "--format", "kalibr", "--model", "kannala_brandt"]
    for name in ("one", "two"):
        assert run(pictures, *CHESSBOARD, *options, "-o", tmp_path / name).exit_code == 0
    page = (tmp_path / "one" / "calibration.html").read_text()
    assert "Against other.yaml" in page
    assert page.count("data:image/png;base64,") == 3
    assert "http://" not in page
    assert "https://" not in page
    assert read_camera(tmp_path / "one" / "camera-kalibr.txt").model == "kannala_brandt"
    files = [f for f in (tmp_path / "one").iterdir() if f.is_file() and f.name != "run.json"]
    assert len(files) == 4
    for file in files:
        assert file.read_bytes() == (tmp_path / "two" / file.name).read_bytes(), file.name


def test_pictures_without_a_board_are_named(pictures, tmp_path):
    files = sorted(pictures.glob("*.png"))
    grey, broken = tmp_path / "grey.png", tmp_path / "broken.png"
    cv2.imwrite(str(grey), np.full((480, 640), 90, np.uint8))
    broken.write_bytes(files[0].read_bytes()[:200])
    run(*files, grey, broken, *CHESSBOARD, "--model", "kannala_brandt", "-o", tmp_path / "out")
    document = json.loads((tmp_path / "out" / "calibration.json").read_text())
    assert {r["name"]: r["reason"] for r in document["rejected"]} == {
        "grey.png": "fewer than 12 corners of the board found",
        "broken.png": "not a picture that can be read",
    }


def test_all_models_are_compared(pictures, tmp_path):
    run(pictures, *SQUARES, "-o", tmp_path)
    document = json.loads((tmp_path / "calibration.json").read_text())
    assert document["board"]["shape"] in ("bent", "surveyed")
    assert document["board"]["largest_offset_mm"] < 0.3
    assert {m["model"] for m in document["models"]} == {
        "kannala_brandt", "scaramuzza", "unified", "equidistant", "pinhole",
    }  # fmt: skip
    held_out = [m["held_out_rms_px"] for m in document["models"] if m["held_out_rms_px"] is not None]
    assert held_out == sorted(held_out)
    assert document["camera"]["model"] == document["models"][0]["model"]
    assert document["comparison"]["median_px"] >= 0


def test_charuco_boards(tmp_path):
    board = Charuco(9, 7, 20.0, 14.0, "DICT_4X4_50")
    face = np.pad(board.board(False).generateImage((720, 560)), 40, constant_values=255)
    random = np.random.default_rng(0)
    for i, pose in enumerate(POSES[:6]):
        cv2.imwrite(str(tmp_path / f"{i}.png"), render(CAMERA, facing_pose(*pose), face, PX_PER_MM, random))
    result = run(
        tmp_path, "--board", "charuco", "--columns", 9, "--rows", 7, "--square-mm", 20, "--marker-mm", 14,
        "--dictionary", "DICT_4X4_50", "--model", "kannala_brandt", "-o", tmp_path / "out",
    )  # fmt: skip
    assert result.exit_code == 0
    camera = read_camera(tmp_path / "out" / "camera.yaml")
    np.testing.assert_allclose(camera.parameters[:4], CAMERA.parameters[:4], rtol=0, atol=2.0)


def test_one_picture_many_times_is_refused(pictures, tmp_path):
    for i in range(6):
        (tmp_path / f"{i}.png").write_bytes((pictures / "0.png").read_bytes())
    with pytest.raises(UnusableError, match="parallel planes"):
        run(tmp_path, *CHESSBOARD, "-o", tmp_path / "out")
    assert not (tmp_path / "out" / "camera.yaml").exists()


def test_a_board_of_another_size_is_refused_with_a_hint(pictures, tmp_path):
    wrong = ["--columns", "13", "--rows", "11", "--square-mm", "20"]
    with pytest.raises(UnusableError, match="inner corners, one fewer than squares"):
        run(pictures / "0.png", *wrong, "-o", tmp_path)


def test_pictures_of_two_sizes_are_refused(pictures, tmp_path):
    small = tmp_path / "small.png"
    cv2.imwrite(str(small), cv2.resize(cv2.imread(str(pictures / "0.png")), (320, 240)))
    with pytest.raises(InputError, match="320 × 240 px"):
        run(pictures / "0.png", small, *CHESSBOARD, "-o", tmp_path / "out")


def test_an_input_without_pictures_is_refused(tmp_path):
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="holds no picture"):
        run(tmp_path / "empty", *CHESSBOARD)
    with pytest.raises(InputError, match="does not exist"):
        run(tmp_path / "absent", *CHESSBOARD)
    (tmp_path / "a.png").write_bytes(b"")
    with pytest.raises(InputError, match="no other file is"):
        run(tmp_path / "a.png", *CHESSBOARD, "-o", tmp_path / "out")


@pytest.mark.parametrize(
    ("options", "problem"),
    [
        (["--marker-mm", "14", "--dictionary", "DICT_4X4_5"], "did you mean DICT_4X4_50"),
        (["--dictionary", "DICT_4X4_50"], "--marker-mm: is missing"),
        (["--marker-mm", "20", "--dictionary", "DICT_4X4_50"], "smaller than the square"),
        (["--marker-mm", "14", "--dictionary", "DICT_4X4_50", "--columns", "30"], "too few markers"),
    ],
)
def test_impossible_charuco_boards_are_refused(options, problem, pictures):
    with pytest.raises(InputError, match=problem):
        run(pictures, *CHESSBOARD, "--board", "charuco", *options)
