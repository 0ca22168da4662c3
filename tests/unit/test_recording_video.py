from pathlib import Path

import av
import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.recording import open_recording
from pipeline.recording.images import luma_of_white
from pipeline.recording.video import VideoSource, open_video
from tests.made_recording import COUNT, HEIGHT, WIDTH, picture, write_folder, write_video

GOP4 = {"g": "4", "sc_threshold": "0"}
HEVC4 = {"x265-params": "log-level=none:keyint=4:min-keyint=4:scenecut=0"}
# Container, codec, pixel format, options, largest difference from the picture: 0 for lossless ones.
ENCODINGS = {
    "H.264 4:4:4 MKV": ("mkv", "libx264", "yuv444p", GOP4),
    "H.264 4:2:0 MP4": ("mp4", "libx264", "yuv420p", GOP4),
    "H.264 10 bit MKV": ("mkv", "libx264", "yuv420p10le", GOP4),
    "H.264 4:2:0 AVI, no times of presentation": ("avi", "libx264", "yuv420p", GOP4),
    "HEVC MKV": ("mkv", "libx265", "yuv420p", HEVC4),
    "HEVC MP4": ("mp4", "libx265", "yuv444p", HEVC4),
    "MJPEG AVI": ("avi", "mjpeg", "yuvj420p", {}),
    "MJPEG 4:4:4 MKV": ("mkv", "mjpeg", "yuvj444p", {}),
    "FFV1 MKV": ("mkv", "ffv1", "bgr0", {}),
    "FFV1 grey AVI": ("avi", "ffv1", "gray", {}),
    "FFV1 4:4:4 MKV": ("mkv", "ffv1", "yuv444p", {}),
}


def _made(folder: Path, name: str) -> VideoSource:
    ext, codec, pix_fmt, options = ENCODINGS[name]
    write_video(folder / f"v.{ext}", codec, pix_fmt, options)
    return open_video(folder / f"v.{ext}")


@pytest.mark.parametrize("name", ENCODINGS)
def test_only_lossy_codecs_that_predict_pictures_may_repeat_light(tmp_path: Path, name: str) -> None:
    assert _made(tmp_path, name).index.predicted == name.startswith(("H.264", "HEVC"))


@pytest.mark.parametrize("group", ["1", "4"])
def test_a_recording_states_whether_its_pictures_are_predicted(tmp_path: Path, group: str) -> None:
    """H.264 that codes each picture alone repeats nothing."""
    folder = write_folder(tmp_path / "r", "v.mkv")
    write_video(folder / "v.mkv", "libx264", "yuv420p", {"g": group})
    assert open_recording(folder).predicted == (group != "1")


def _decoded(path: Path) -> list[av.VideoFrame]:
    with av.open(str(path)) as container:
        return list(container.decode(video=0))


@pytest.mark.parametrize("name", ENCODINGS)
def test_every_codec_shows_the_pictures_in_order(tmp_path: Path, name: str) -> None:
    source = _made(tmp_path, name)
    assert (source.count, source.image_size) == (COUNT, (WIDTH, HEIGHT))
    images = dict(source.read(range(COUNT), "bgr"))
    for number, image in images.items():
        # Lossy coding of so small a picture costs a few levels; red of adjacent frames differs by 15.
        assert image.shape == (HEIGHT, WIDTH, 3)
        if "grey" not in name:
            red = image[30:, :10, 2].astype(float).mean()
            assert abs(red - picture(number)[30:, :10, 2].mean()) < 7
    assert len(images) == COUNT


@pytest.mark.parametrize("name", ENCODINGS)
def test_the_luma_of_white_follows_from_the_range_of_the_video(tmp_path: Path, name: str) -> None:
    source = _made(tmp_path, name)
    (_, grey), (_, bgr) = (next(source.read([2], planes)) for planes in ("grey", "bgr"))
    full = "MJPEG" in name or "grey" in name or "bgr0" in ENCODINGS[name]
    assert luma_of_white(grey, bgr) == (255 if full else 235)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("colour", [(30, 80, 180), (50, 70, 190), (70, 150, 60), (200, 200, 200)])
def test_luma_of_white_does_not_depend_on_the_colour_of_the_wall(
    colour: tuple[int, int, int], full: bool
) -> None:
    """With BT.601 weights, red wall in a BT.709 video seemed of full range, and green wall of limited."""
    wall = np.random.default_rng(3).uniform(0.7, 1.2, (HEIGHT, WIDTH, 1)) * colour
    weights, black, white = np.array([0.0722, 0.7152, 0.2126]), 0 if full else 16, 255 if full else 219
    luma = np.rint(black + white / 255 * (wall @ weights)).astype(np.uint8)
    assert luma_of_white(luma, wall.astype(np.uint8)) == (255 if full else 235)


@pytest.mark.parametrize("name", ENCODINGS)
def test_colours_equal_those_of_swscale(tmp_path: Path, name: str) -> None:
    source = _made(tmp_path, name)
    for (number, image), frame in zip(source.read(range(COUNT), "bgr"), _decoded(source.path), strict=True):
        want = frame.to_ndarray(format="bgr24").astype(int)
        assert np.abs(image - want).max() <= 1, number


@pytest.mark.parametrize("name", [n for n in ENCODINGS if ENCODINGS[n][2] != "bgr0" and "10 bit" not in n])
def test_grey_is_the_luma_plane(tmp_path: Path, name: str) -> None:
    source = _made(tmp_path, name)
    for (number, image), frame in zip(source.read(range(COUNT), "grey"), _decoded(source.path), strict=True):
        plane = frame.planes[0]
        luma = np.frombuffer(bytes(plane), np.uint8).reshape(HEIGHT, plane.line_size)[:, :WIDTH]
        np.testing.assert_array_equal(image, luma, str(number))


def test_grey_of_ten_bits_has_the_range_of_eight(tmp_path: Path) -> None:
    ten, eight = _made(tmp_path, "H.264 10 bit MKV"), _made(tmp_path, "H.264 4:2:0 MP4")
    ((_, a),), ((_, b),) = ten.read([8], "grey"), eight.read([8], "grey")
    # Black stays 16 in both; stretching to 0 to 255 would move it by 16 levels.
    assert abs(float(a.astype(float).mean() - b.astype(float).mean())) < 1.5


@pytest.mark.parametrize(("colorspace", "full"), [(1, False), (5, False), (1, True), (5, True)])
def test_matrix_and_range_are_those_named_by_the_stream(tmp_path: Path, colorspace: int, full: bool) -> None:
    file = tmp_path / "v.mkv"
    params = f"colormatrix={'bt709' if colorspace == 1 else 'bt470bg'}:fullrange={'on' if full else 'off'}"
    write_video(file, "libx264", "yuv444p", {"x264-params": params})
    frame = _decoded(file)[7]
    assert (frame.colorspace, frame.color_range) == (colorspace, 2 if full else 1)
    ((_, image),) = open_video(file).read([7], "bgr")
    assert np.abs(image.astype(int) - frame.to_ndarray(format="bgr24")).max() <= 1


@pytest.mark.parametrize("name", ENCODINGS)
def test_frames_by_number_equal_the_same_frames_in_order(tmp_path: Path, name: str) -> None:
    source = _made(tmp_path, name)
    whole = {n: image.copy() for n, image in source.read(range(COUNT), "grey")}
    rng = np.random.default_rng(3)
    chosen = [np.array([15]), np.array([0, 15]), np.arange(1, COUNT, 2)]
    chosen += [np.sort(rng.choice(COUNT, rng.integers(1, COUNT), replace=False)) for _ in range(12)]
    for numbers in chosen:
        some = {n: image.copy() for n, image in source.read(numbers, "grey")}
        assert list(some) == numbers.tolist()
        assert all(np.array_equal(some[n], whole[n]) for n in some)


def test_numbers_must_ascend_and_frames_past_the_end_are_none(tmp_path: Path) -> None:
    source = _made(tmp_path, "H.264 4:4:4 MKV")
    for wrong in ([3, 2], [1, 1], [-1, 0]):
        with pytest.raises(ValueError, match="ascend"):
            list(source.read(wrong, "grey"))
    assert [i is None for _, i in source.read([14, 15, 16, 40], "grey")] == [False, False, True, True]
    assert list(source.read([], "bgr")) == []


@pytest.mark.parametrize("packet", [5, 7, 9])
@pytest.mark.parametrize("name", ["H.264 4:4:4 MKV", "H.264 4:2:0 MP4", "HEVC MKV", "MJPEG AVI", "FFV1 MKV"])
def test_damage_loses_frames_and_changes_none(tmp_path: Path, name: str, packet: int) -> None:
    source = _made(tmp_path, name)
    whole = {n: image.copy() for n, image in source.read(range(COUNT), "grey")}
    packet += name == "HEVC MKV" and packet == 5  # at that place a packet of zeros happens to decode
    with av.open(str(source.path)) as container:
        hit = [p for p in container.demux(video=0) if p.size][packet]
    data = bytearray(source.path.read_bytes())
    data[hit.pos + hit.size // 3 : hit.pos + hit.size] = bytes(hit.size - hit.size // 3)
    source.path.write_bytes(data)
    number, keys = int(np.searchsorted(source.index.pts, hit.pts)), source.index.keyframes
    images = dict(open_video(source.path).read(range(COUNT), "grey"))
    lost = [n for n, image in images.items() if image is None]
    assert number in lost
    later_keys = [k for k in keys.tolist() if source.index.coded[k] > packet]
    assert max(lost) < later_keys[0]
    assert all(np.array_equal(images[n], whole[n]) for n in images if n not in lost)


def test_a_truncated_video_gives_the_frames_it_has(tmp_path: Path) -> None:
    folder = write_folder(tmp_path / "r", options=GOP4)
    video = folder / "frames.mkv"
    video.write_bytes(video.read_bytes()[: video.stat().st_size * 6 // 10])
    recording = open_recording(folder)
    held = recording.source.count
    assert 0 < held < COUNT
    assert recording.frames.frame.tolist() == list(range(held))
    assert any(f"there are {held} images, the table of frames lists 16" in w for w in recording.warnings)
    readable = [n for n, image in recording.read(recording.frames.frame, "grey") if image is not None]
    assert readable


GOP8_NO_B = {"g": "8", "sc_threshold": "0", "bf": "0"}


@pytest.mark.parametrize(("lost", "end"), [(1, 2), (4, 8), (5, 6), (6, 7), (9, 11)])
@pytest.mark.parametrize(
    ("codec", "options"),
    [("mjpeg", {}), ("libx264", GOP4), ("libx264", GOP8_NO_B), ("libx265", HEVC4), ("ffv1", {})],
)
def test_packets_lost_in_writing_neither_shift_nor_change_other_frames(
    tmp_path: Path, codec: str, options: dict[str, str], lost: int, end: int
) -> None:
    pix_fmt = "yuvj420p" if codec == "mjpeg" else "yuv420p"
    folder = write_folder(tmp_path / "r", codec=codec, pix_fmt=pix_fmt, options=options)
    source = open_recording(folder).source
    whole = {n: image.copy() for n, image in source.read(range(COUNT), "grey")}
    with av.open(str(source.path)) as full, av.open(str(tmp_path / "gap.mkv"), "w") as cut:
        stream = cut.add_stream_from_template(full.streams.video[0])
        for place, packet in enumerate(p for p in full.demux(video=0) if p.size):
            if not lost <= place < end:
                packet.stream = stream
                cut.mux(packet)
    (tmp_path / "gap.mkv").rename(source.path)
    recording = open_recording(folder)
    images = dict(recording.read(range(COUNT), "grey"))
    gone = {n for n in range(COUNT) if lost <= source.index.coded[n] < end}
    given_up = {n for n, image in images.items() if image is None}
    assert gone <= given_up
    groups = {source.index.key_of[n] for n in gone} | {source.index.key_of[max(min(gone) - 1, 0)]}
    assert {source.index.key_of[n] for n in given_up} <= groups
    assert all(np.array_equal(images[n], whole[n]) for n in images if n not in given_up)
    assert recording.warnings == (f"{end - lost} images are missing between the first and the last",)


@pytest.mark.parametrize("ext", ["mkv", "mp4"])
def test_frames_that_no_other_needs_are_skipped_and_change_none(tmp_path: Path, ext: str) -> None:
    file = tmp_path / f"v.{ext}"
    options = {"g": "8", "x264-params": "log-level=none:bframes=2:b-adapt=0:b-pyramid=none:scenecut=0"}
    write_video(file, "libx264", "yuv420p", options)
    source = open_video(file)
    kinds = np.array([frame.pict_type for frame in _decoded(file)])
    between = kinds == av.video.frame.PictureType.B
    assert 3 <= between.sum() < COUNT
    np.testing.assert_array_equal(source.index.expendable, between)
    whole = {n: image.copy() for n, image in source.read(range(COUNT), "grey")}
    for wanted in (np.flatnonzero(~between), np.flatnonzero(between)[1::2], np.arange(1, COUNT, 3)):
        images = dict(source.read(wanted, "grey"))
        assert list(images) == wanted.tolist()
        assert all(np.array_equal(image, whole[n]) for n, image in images.items())


def test_frames_without_lengths_are_all_decoded(tmp_path: Path) -> None:
    write_video(tmp_path / "v.avi", "libx264", "yuv420p", GOP4)
    assert not open_video(tmp_path / "v.avi").index.expendable.any()


@pytest.mark.parametrize("content", [b"", b"not a video at all", b"\x1aE\xdf\xa3" + bytes(500)])
def test_a_file_that_is_not_a_video_is_refused(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "v.mkv"
    file.write_bytes(content)
    with pytest.raises(InputError, match=r"v\.mkv"):
        open_video(file)


def test_a_file_with_sound_only_is_not_a_video(tmp_path: Path) -> None:
    file = tmp_path / "v.mkv"
    with av.open(str(file), "w") as container:
        stream = container.add_stream("pcm_s16le", rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 800), np.int16), format="s16", layout="mono")
        sound.sample_rate = 8000
        container.mux(stream.encode(sound))
    with pytest.raises(InputError, match="no video stream"):
        open_video(file)
