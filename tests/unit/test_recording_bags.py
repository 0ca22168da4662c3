from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import open_recording
from tests.made_recording import (
    COUNT,
    IMU,
    LIGHTS,
    READINGS,
    TIMES_S,
    picture,
    write_mcap,
    write_ros1,
    write_ros2,
)

WRITERS = {
    "ros1": write_ros1,
    "ros2 sqlite3": write_ros2,
    "ros2 mcap": lambda folder, **kw: write_ros2(folder, storage="MCAP", **kw),
    "mcap": write_mcap,
    "mcap ros1": lambda folder, **kw: write_mcap(folder, ros1=True, **kw),
}


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", WRITERS)
def test_every_bag_contains_what_was_written(tmp_path: Path, kind: str, compressed: bool) -> None:
    recording = open_recording(WRITERS[kind](tmp_path, compressed=compressed))
    assert recording.name == "made"
    assert recording.warnings == ()
    assert recording.probe_file == tmp_path / "probe.yaml"
    assert recording.frame_rate == 30
    assert recording.frames.illumination.tolist() == LIGHTS
    np.testing.assert_allclose(recording.frames.time_s, TIMES_S, atol=1e-9)
    np.testing.assert_allclose(recording.encoder.time_s, [r[0] for r in READINGS], atol=1e-9)
    np.testing.assert_allclose(recording.encoder.distance_mm, [r[1] for r in READINGS])
    found = np.column_stack([recording.imu.time_s, recording.imu.rate_rad_s, recording.imu.force_m_s2])
    np.testing.assert_allclose(found, IMU, atol=1e-9)
    images = dict(recording.read(range(COUNT), "bgr"))
    assert list(images) == list(range(COUNT))
    assert all(np.array_equal(images[n], picture(n)) for n in images)


@pytest.mark.parametrize("kind", WRITERS)
def test_bag_frames_by_number_equal_the_same_frames_in_order(tmp_path: Path, kind: str) -> None:
    source = open_recording(WRITERS[kind](tmp_path)).source
    whole = dict(source.read(range(COUNT), "grey"))
    for chosen in ([0], [15], [3, 4, 11], [2, 15]):
        some = dict(source.read(chosen, "grey"))
        assert list(some) == chosen
        assert all(np.array_equal(some[n], whole[n]) for n in chosen)
    assert dict(source.read([COUNT + 2], "grey")) == {COUNT + 2: None}


@pytest.mark.parametrize("encoding", ["mono8", "mono16", "rgb8", "bayer_rggb8"])
def test_raw_encodings(tmp_path: Path, encoding: str) -> None:
    source = open_recording(write_mcap(tmp_path, encoding=encoding)).source
    ((_, grey),) = source.read([5], "grey")
    ((_, bgr),) = source.read([5], "bgr")
    if encoding == "rgb8":
        np.testing.assert_array_equal(bgr, picture(5))
    elif encoding == "bayer_rggb8":
        # Interpolation is exact where colours are constant or linear: red is constant outside the square.
        np.testing.assert_array_equal(bgr[30:40, 30:50, 2], picture(5)[30:40, 30:50, 2])
    else:
        np.testing.assert_array_equal(grey, picture(5)[..., 0])
        np.testing.assert_array_equal(bgr[..., 2], grey)


def test_the_light_holds_until_the_next_message(tmp_path: Path) -> None:
    recording = open_recording(write_ros1(tmp_path, lights=["laser", "both"]))
    assert recording.frames.illumination.tolist() == ["laser"] + ["both"] * (COUNT - 1)


def test_the_light_follows_a_stated_pattern(tmp_path: Path) -> None:
    bag = write_ros2(tmp_path, lights=None)
    with pytest.raises(InputError, match="key illumination: is missing"):
        open_recording(bag)
    described = tmp_path / "run.recording.yaml"
    described.write_text(described.read_text() + "illumination: [led, laser, both]\n")
    lights = open_recording(bag).frames.illumination.tolist()
    assert lights[:4] == ["led", "laser", "both", "led"]


def test_an_unknown_light_is_refused_with_its_message(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="message 3: is 'uv'"):
        open_recording(write_mcap(tmp_path, lights=["laser", "led", "uv"]))


def test_a_named_topic_that_does_not_exist_is_refused(tmp_path: Path) -> None:
    bag = write_ros1(tmp_path)
    described = tmp_path / "recording.yaml"
    described.write_text(described.read_text() + "topics: {image: /camera/image_rw}\n")
    with pytest.raises(InputError, match="did you mean /camera/image_raw"):
        open_recording(bag)


def test_for_a_bag_without_description_the_error_names_the_file_to_write(tmp_path: Path) -> None:
    bag = write_mcap(tmp_path)
    (tmp_path / "recording.yaml").unlink()
    with pytest.raises(InputError, match=r"run\.recording\.yaml or recording\.yaml"):
        open_recording(bag)


@pytest.mark.parametrize("kind", WRITERS)
def test_a_truncated_bag_is_refused(tmp_path: Path, kind: str) -> None:
    path = WRITERS[kind](tmp_path)
    files = [path] if path.is_file() else [f for f in path.iterdir() if f.suffix in (".db3", ".mcap")]
    for file in files:
        file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
    with pytest.raises(InputError, match="cannot be read as a bag"):
        open_recording(path)


def test_refusals_list_what_was_tried(tmp_path: Path) -> None:
    file = tmp_path / "notes.txt"
    file.write_text("nothing")
    with pytest.raises(InputError) as caught:
        open_recording(file)
    refused = "its first bytes are not those of one"
    for tried in ("recording folder: it is not a folder", f"ROS 1 bag: {refused}", f"MCAP file: {refused}"):
        assert tried in str(caught.value)
    with pytest.raises(InputError, match="does not exist"):
        open_recording(tmp_path / "nowhere")
