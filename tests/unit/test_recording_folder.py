from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.instrument.probe_file import read_probe, write_probe
from pipeline.recording import open_recording
from pipeline.recording.base import InspectionFacts
from pipeline.recording.checks import check_probe_fits
from tests.made_recording import COUNT, LIGHTS, READINGS, TIMES_S, picture, write_folder
from tests.shared_data import shared


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_folder(tmp_path_factory.mktemp("made") / "r")


@pytest.fixture
def copy(folder: Path, tmp_path: Path) -> Path:
    """Return a copy of the recording, to be spoiled."""
    target = tmp_path / "r"
    target.mkdir()
    for file in folder.iterdir():
        (target / file.name).write_bytes(file.read_bytes())
    return target


def test_a_folder_lists_its_contents(folder: Path) -> None:
    recording = open_recording(folder)
    assert (recording.name, recording.kind, recording.frame_rate) == ("made", "inspection", 30.0)
    assert recording.frames.illumination.tolist() == LIGHTS
    np.testing.assert_allclose(recording.frames.time_s, TIMES_S, atol=1e-6)
    np.testing.assert_allclose(recording.encoder.distance_mm, [d for _, d in READINGS])
    assert recording.pipe.nominal_diameter_mm == 101.6
    assert recording.pipe.wall_thickness_mm == 4.0
    assert recording.probe_file == folder / "probe.yaml"
    assert recording.warnings == ()


def test_imu_plan_and_mount_are_read(copy: Path) -> None:
    (copy / "imu.csv").write_text("time_s,gx,gy,gz,ax,ay,az\n0.0,0.1,0,0,0,0,-9.8\n0.01,0.2,0,0,0,0,-9.8\n")
    text = (
        (copy / "recording.yaml")
        .read_text()
        .replace("wall_thickness_mm: 4.0", "plan: [{length_mm: 800}, {bend_deg: 90, radius_mm: 150}]")
    )
    (copy / "recording.yaml").write_text(text + "imu: imu.csv\n")
    recording = open_recording(copy)
    assert recording.imu is not None
    np.testing.assert_array_equal(recording.imu.rate_rad_s[:, 0], [0.1, 0.2])
    assert [(round(p.length_mm), p.bend_deg) for p in recording.pipe.plan] == [(800, 0.0), (236, 90.0)]
    mount = "imu: {R_ci: [[0, 0, 1], [1, 0, 0], [0, 1, 0]], gyroscope_noise_density: 1.0e-3}\n"
    (copy / "probe.yaml").write_text((copy / "probe.yaml").read_text() + mount)
    probe = read_probe(copy / "probe.yaml")
    write_probe(probe, copy / "again.yaml")
    for found in (probe.imu, read_probe(copy / "again.yaml").imu):
        assert found.gyroscope_noise_density == 1e-3
        np.testing.assert_array_equal(found.R_ci @ [1, 0, 0], [0, 1, 0])
    (copy / "probe.yaml").write_text((copy / "probe.yaml").read_text().replace("[0, 0, 1]", "[0, 0, -1]"))
    with pytest.raises(InputError, match="not a rotation"):
        read_probe(copy / "probe.yaml")


def test_the_facts_of_a_gauge_are_read() -> None:
    pipe = open_recording(shared("recordings", "open-1-gauge")).pipe
    assert [(b.length_mm, b.diameter_mm) for b in pipe.bore] == [(42.0, 101.6), (42.0, 84.0), (42.0, 70.0)]
    assert pipe.bore_tolerance_mm == 0.01
    assert pipe.fiducials is not None
    assert (pipe.fiducials.dictionary, pipe.fiducials.size_mm) == ("DICT_4X4_100", 9.0)
    assert pipe.fiducials.markers[0].azimuth_deg == -180.0


@pytest.mark.parametrize("pattern", ["frames/%06d.png", "%d.jpg", "frames/f_%04d.bmp"])
def test_image_sequences(tmp_path: Path, pattern: str) -> None:
    recording = open_recording(write_folder(tmp_path / "r", pattern))
    images = dict(recording.read(range(COUNT), "bgr"))
    assert list(images) == list(range(COUNT))
    exact = not pattern.endswith("jpg")
    for number, image in images.items():
        off = np.abs(image.astype(int) - picture(number))
        assert off.max() == 0 if exact else off.mean() < 10
    assert [n for n, _ in recording.read([1, 5, 15], "grey")] == [1, 5, 15]


def test_damaged_and_missing_images_are_none(tmp_path: Path) -> None:
    made = write_folder(tmp_path / "r", "frames/%06d.png")
    (made / "frames" / "000003.png").unlink()
    short = made / "frames" / "000005.png"
    short.write_bytes(short.read_bytes()[:200])
    (made / "frames" / "000007.png").write_bytes(b"")
    recording = open_recording(made)
    assert recording.warnings == ("1 images are missing between the first and the last",)
    lost = [n for n, image in recording.read(range(COUNT), "grey") if image is None]
    assert lost == [3, 5, 7]


def test_images_with_other_numbers_than_the_table_are_refused(tmp_path: Path) -> None:
    made = write_folder(tmp_path / "r", "frames/%06d.png")
    (made / "frames" / "000000.png").unlink()
    with pytest.raises(InputError, match="table of frames starts at 0"):
        open_recording(made)


@pytest.mark.parametrize("pattern", ["frames/%06d_%d.png", "%s.png", "none/%06d.png", "%06d/a.png"])
def test_wrong_patterns_are_refused(copy: Path, pattern: str) -> None:
    described = copy / "recording.yaml"
    described.write_text(described.read_text().replace("video: 'frames.mkv'", f"video: '{pattern}'"))
    with pytest.raises(InputError, match=r"pattern|fits no image"):
        open_recording(copy)


def test_the_content_key_depends_on_the_bytes_only(folder: Path, copy: Path) -> None:
    key = open_recording(folder).content_key
    assert open_recording(copy).content_key == key
    for name in ("recording.yaml", "frames.csv", "encoder.csv", "frames.mkv"):
        file = copy / name
        whole = file.read_bytes()
        file.write_bytes(whole + b"\n")
        assert open_recording(copy).content_key != key, name
        file.write_bytes(whole)
    assert open_recording(copy).content_key == key


def test_with_a_shorter_table_of_frames_the_common_part_is_used(copy: Path) -> None:
    table = copy / "frames.csv"
    table.write_text("".join(table.read_text().splitlines(keepends=True)[:11]))
    recording = open_recording(copy)
    assert recording.frames.frame.size == 10
    assert recording.warnings[0].startswith("there are 16 images, the table of frames lists 10")


@pytest.mark.parametrize(
    ("edit", "warning"),
    [
        (lambda rows: rows[:20], "the encoder ends 0.32 s before the last frame"),
        (lambda rows: rows[:1] + rows[30:], "the encoder begins 0.29 s after the first frame"),
        (lambda rows: [*rows[:30], "0.29,25.8", *rows[31:]], "the encoder jumps by up to 20.2 mm at 0.28 s"),
        (lambda rows: [*rows[:40], "9.0,8.0"], "the encoder has no readings for up to 8.62 s"),
    ],
)
def test_suspicious_encoders_are_named(copy: Path, edit, warning: str) -> None:
    table = copy / "encoder.csv"
    table.write_text("\n".join(edit(table.read_text().splitlines())) + "\n")
    warnings = open_recording(copy).warnings
    assert any(w.startswith(warning) for w in warnings), warnings


@pytest.mark.parametrize("backward", [False, True])
def test_a_restarted_counter_counts_on(copy: Path, backward: bool) -> None:
    """It moved poses by .8 mm across and 1.2° of roll."""
    whole = 0.02 + 0.05 * np.arange(400) * (-1 if backward else 1)
    for distance, counts in ((whole % 4.0, True), (whole + 4.0 * (whole > 10), False)):
        rows = (f"{0.0025 * k:.4f},{d:.3f}" for k, d in enumerate(distance))
        (copy / "encoder.csv").write_text("\n".join(["time_s,distance_mm", *rows]) + "\n")
        recording = open_recording(copy)
        assert recording.encoder is not None
        found = recording.encoder.distance_mm
        told = [w for w in recording.warnings if "times, after 4 mm each" in w]
        assert len(told) == counts
        np.testing.assert_allclose(
            found - found[0], whole - whole[0] if counts else distance - distance[0], atol=2e-3
        )


def test_a_run_without_encoder_or_probe_file_is_opened(copy: Path) -> None:
    (copy / "encoder.csv").unlink()
    (copy / "probe.yaml").unlink()
    recording = open_recording(copy)
    assert recording.encoder is None
    assert recording.probe_file is None
    assert len(recording.warnings) == 2


def test_images_of_another_size_than_the_cameras_are_refused(folder: Path) -> None:
    recording, probe = open_recording(folder), read_probe(folder / "probe.yaml")
    check_probe_fits(recording, probe)
    other = replace(probe, camera=replace(probe.camera, image_size=(1600, 1200)))
    with pytest.raises(InputError, match="64 x 48 pixels\nExpected: 1600 x 1200"):
        check_probe_fits(recording, other)


@pytest.mark.parametrize(
    ("size", "hint"),
    [((48, 64), "rotate the pictures back by 90°"), ((64, 60), "cut rows off"), ((80, 48), "cut columns off"),
     ((32, 24), "at this resolution"), ((128, 96), "at this resolution")],
)  # fmt: skip
def test_for_rotated_or_cropped_images_the_error_says_so(
    folder: Path, size: tuple[int, int], hint: str
) -> None:
    recording, probe = open_recording(folder), read_probe(folder / "probe.yaml")
    other = replace(probe, camera=replace(probe.camera, image_size=size))
    with pytest.raises(InputError, match=hint):
        check_probe_fits(recording, other)


# File, what is replaced, by what, and what the complaint must say.
SPOILED = {
    "missing key": ("recording.yaml", "kind: inspection\n", "", r"key kind: is missing"),
    "mistyped key": ("recording.yaml", "kind:", "knid:", r"knid: is not a key.*\n.*\n.*did you mean kind"),
    "empty key": ("recording.yaml", "frame_rate: 30.0", "frame_rate:", r"key frame_rate: is empty"),
    "empty file": ("recording.yaml", None, "", r"holds nothing at its top level"),
    "a list": ("recording.yaml", None, "- 1\n- 2\n", r"holds a list at its top level"),
    "no YAML": ("recording.yaml", None, "a: [1, 2\n", r"line 2: is not valid YAML"),
    "repeated key": ("recording.yaml", "kind:", "name: again\nkind:", r"line 2: .*'name' occurs twice"),
    "unsafe tag": ("recording.yaml", "name: made", "name: !!python/object:os.system x", r"line 1: .*YAML"),
    "alias": ("recording.yaml", "name: made", "name: &a made\nkind: *a", r"line 2: .*aliases"),
    "wrong kind": ("recording.yaml", "inspection", "inspektion", r"one of.*\n.*did you mean inspection"),
    "not a number": ("recording.yaml", "30.0", "fast", r"key frame_rate: is 'fast'"),
    "NaN": ("recording.yaml", "30.0", ".nan", r"key frame_rate: is nan"),
    "truth value": ("recording.yaml", "30.0", "true", r"key frame_rate: is True"),
    "zero rate": ("recording.yaml", "30.0", "0", r"frame_rate: is 0\nExpected: .*greater than 0"),
    "negative diameter": ("recording.yaml", "101.6", "-101.6", r"pipe.nominal_diameter_mm: is -101.6"),
    "exponent as text": ("recording.yaml", "101.6", "1e2", r"is '1e2'\n.*\n.*write 100.0 without quotes"),
    "pipe no mapping": ("recording.yaml", "{nominal_diameter_mm: 101.6, ", "3 #", r"key pipe: is 3"),
    "mistyped pipe": ("recording.yaml", "wall_thickness_mm", "wall_thicknes_mm", r"did you mean wall_thick"),
    "video elsewhere": (
        "recording.yaml",
        "video: 'frames.mkv'",
        "video: ../x.mkv",
        r"inside the recording's",
    ),
    "video missing": ("recording.yaml", "video: 'frames.mkv'", "video: x.mkv", r"x.mkv: is missing, but"),
    "no columns": ("frames.csv", "frame,time_s,illumination\n", "", r"line 1: has no column frame"),
    "semicolons": ("encoder.csv", "time_s,distance_mm", "time_s;distance_mm", "separated by semicolons"),
    "mistyped column": ("frames.csv", "illumination", "ilumination", r"is ilumination meant"),
    "table empty": ("frames.csv", None, "", r"has no column frame"),
    "frames past the end": ("frames.csv", None, "frame,time_s,illumination\n16,0.1,led\n", r"only 16 images"),
    "no frames": ("frames.csv", None, "frame,time_s,illumination\n", r"lists no frames"),
    "unknown light": ("frames.csv", "3,0.100000,led", "3,0.100000,ledd", r"line 5: .*'ledd'(.|\n)*mean led"),
    "time NaN": ("frames.csv", "0.100000", "nan", r"line 5: time_s is 'nan'"),
    "time no number": ("frames.csv", "0.100000", "soon", r"line 5: time_s is 'soon'"),
    "time back": ("frames.csv", "3,0.100000", "3,0.010000", r"reading 4: time_s goes from 0.0666"),
    "time stands": ("frames.csv", "3,0.100000", "3,0.066667", r"reading 4: time_s goes from 0.0666"),
    "number back": ("frames.csv", "3,0.100000", "1,0.100000", r"reading 4: frame goes from 2 to 1"),
    "number negative": ("frames.csv", "3,0.100000", "-3,0.100000", r"line 5: frame is '-3'"),
    "cut line": ("frames.csv", "3,0.100000,led", "3,0.10", r"line 5: has 2 cells"),
    "not text": ("frames.csv", None, "\udcff\udcfe", r"frames.csv: is not UTF-8"),
    "encoder empty": ("encoder.csv", None, "time_s,distance_mm\n", r"encoder.csv: has 0 readings"),
    "encoder back": ("encoder.csv", "0.0300,", "0.0100,", r"reading 4: time_s goes from 0.02 to 0.01"),
    "encoder NaN": ("encoder.csv", "0.0300,0.600", "0.0300,nan", r"line 5: distance_mm is 'nan'"),
}


@pytest.mark.parametrize("case", SPOILED)
def test_spoiled_recordings_are_refused_with_the_place_of_the_error(copy: Path, case: str) -> None:
    name, old, new, complaint = SPOILED[case]
    file = copy / name
    text = file.read_text()
    assert old is None or old in text
    file.write_bytes((new if old is None else text.replace(old, new, 1)).encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=complaint) as caught:
        open_recording(copy)
    assert name in str(caught.value) or "x.mkv" in str(caught.value)


def test_too_large_a_yaml_file_is_refused_unread(copy: Path) -> None:
    (copy / "recording.yaml").write_text("#" * 1_000_001)
    with pytest.raises(InputError, match="bytes long"):
        open_recording(copy)


def test_client_and_method_of_the_inspection_are_read_where_stated(folder: Path, copy: Path) -> None:
    assert open_recording(folder).inspection == InspectionFacts()
    with (copy / "recording.yaml").open("a") as file:
        file.write("\ninspection: {client: Water Works, line: A 12, date: 2026-05-31}\n")
    stated = open_recording(copy).inspection
    assert stated == InspectionFacts(client="Water Works", line="A 12", date="2026-05-31")


@pytest.mark.parametrize(
    ("stated", "complaint"),
    [("{cleint: W}", "did you mean client"), ("{date: yesterday}", "a date such as 2026-05-31")],
)
def test_wrong_facts_of_an_inspection_are_refused(copy: Path, stated: str, complaint: str) -> None:
    with (copy / "recording.yaml").open("a") as file:
        file.write(f"\ninspection: {stated}\n")
    with pytest.raises(InputError, match=complaint):
        open_recording(copy)
