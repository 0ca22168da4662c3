"""Camera files: what is written is read back the same.

Wrong files are refused with the place of the error.
"""

import cv2
import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.instrument.camera.fisheye import Equidistant, KannalaBrandt
from pipeline.instrument.camera.formats import FORMATS, WRITTEN, read_camera, write_camera
from pipeline.instrument.camera.formats.document import CameraDocument
from pipeline.instrument.camera.formats.ocamcalib import inverse_disagreement_px, read_polynomials
from pipeline.instrument.camera.mapping import camera_from_mapping, camera_to_mapping
from pipeline.instrument.camera.plumb_bob import Pinhole, Unified
from pipeline.instrument.camera.scaramuzza import Scaramuzza
from tests.shared_data import shared
from tests.unit.camera_samples import CAMERAS, GOOD, KALIBR, sample_directions

HELD = {
    "boresight": (KannalaBrandt, Equidistant, Scaramuzza, Unified, Pinhole),
    "opencv": (KannalaBrandt, Equidistant, Pinhole),
    "kalibr": (KannalaBrandt, Equidistant, Unified),
    "ocamcalib": (Scaramuzza,),
}
PAIRS = [(f, name) for f, kinds in HELD.items() for name, c in CAMERAS.items() if isinstance(c, kinds)]


@pytest.mark.parametrize(("format_name", "name"), PAIRS)
def test_written_and_read_back_projects_the_same(tmp_path, format_name, name):
    camera = CAMERAS[name]
    write_camera(camera, tmp_path / "camera", format_name)
    back = read_camera(tmp_path / "camera")
    ray = sample_directions(camera, 0.9)
    assert back.image_size == camera.image_size
    np.testing.assert_allclose(back.project(ray).uv, camera.project(ray).uv, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", list(CAMERAS))
def test_each_file_is_recognised_by_one_format_only(tmp_path, name):
    for written in WRITTEN:
        if isinstance(CAMERAS[name], HELD[written]) and not (
            written == "kalibr" and isinstance(CAMERAS[name], Pinhole)
        ):
            write_camera(CAMERAS[name], tmp_path / "camera", written)
            document = CameraDocument.open(tmp_path / "camera")
            assert [f.name for f in FORMATS if not f.refusal(document)] == [written]


def test_opencv_itself_reads_what_is_written(tmp_path):
    camera = CAMERAS["kannala_brandt"]
    write_camera(camera, tmp_path / "camera.yaml", "opencv")
    storage = cv2.FileStorage(str(tmp_path / "camera.yaml"), cv2.FILE_STORAGE_READ)
    matrix = storage.getNode("camera_matrix").mat()
    np.testing.assert_array_equal(matrix, [[366.1, 0, 796.9], [0, 365.2, 591.8], [0, 0, 1]])
    np.testing.assert_array_equal(storage.getNode("distortion_coefficients").mat()[:, 0], camera.distortion)


def test_reads_what_opencv_itself_writes(tmp_path):
    path = tmp_path / "camera.yml"
    storage = cv2.FileStorage(str(path), cv2.FILE_STORAGE_WRITE)
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_matrix", np.array([[500.5, 0, 320], [0, 501, 240.25], [0, 0, 1]]))
    storage.write("distortion_coefficients", np.array([[-0.3, 0.1, 1e-5, -2e-7, 0.0]]))
    storage.release()
    expected = Pinhole((640, 480), (500.5, 501.0), (320.0, 240.25), (-0.3, 0.1, 1e-5, -2e-7, 0.0))
    assert read_camera(path) == expected


def test_ros_camera_info_is_read(tmp_path):
    info = {
        "image_width": 640, "image_height": 480, "camera_name": "probe", "distortion_model": "equidistant",
        "camera_matrix": {"rows": 3, "cols": 3, "data": [300.0, 0, 320, 0, 301.0, 240, 0, 0, 1]},
        "distortion_coefficients": {"rows": 1, "cols": 4, "data": [0.1, 0.01, 0.0, 0.0]},
    }  # fmt: skip
    (tmp_path / "info.yaml").write_text(yaml.safe_dump(info))
    expected = KannalaBrandt((640, 480), (300.0, 301.0), (320.0, 240.0), (0.1, 0.01, 0.0, 0.0))
    assert read_camera(tmp_path / "info.yaml") == expected


def test_kalibr_camchain_is_read(tmp_path):
    (tmp_path / "camchain.yaml").write_text(KALIBR)
    expected = Unified((1280, 800), 1.4, (900.0, 901.0), (640.5, 400.5), (-0.3, 0.1, 0.001, -0.002))
    assert read_camera(tmp_path / "camchain.yaml") == expected


WRONG = [
    ("opencv", "fisheye_model: 1\n", "", "fisheye_model: 1"),
    ("opencv", "image_width: 640", "image_width: -640", "image_width"),
    ("opencv", "image_width: 640", "", "image_width"),
    ("opencv", " 300., 0.", " 0., 0.", "camera_matrix"),
    ("opencv", " 300., 0.", " 300., 3.", "not a camera matrix"),
    ("opencv", "1.e-01", ".nan", "distortion_coefficients"),
    ("opencv", "0., 0. ]\nfish", "0., 0., 0.3 ]\nfish", "holds 5 coefficients"),
    ("opencv", "fisheye_model: 1", "fisheye_model: yes please", "fisheye_model"),
    ("kalibr", "radtan", "fov", "distortion_model"),
    ("kalibr", "omni", "eucm", "camera_model"),
    ("kalibr", "900.0, ", "", "intrinsics"),
    ("kalibr", "900.0", "-900.0", "intrinsics"),
    ("kalibr", "[1.4", "[-1.4", "mirror"),
    ("kalibr", "rostopic: /camera", "rostopic: /camera\ncam1: {}", "2 cameras: cam0, cam1"),
    ("ocamcalib", "5 -520", "6 -520", "direct polynomial"),
    ("ocamcalib", "-520.5652", "520.5652", "negative"),
    ("ocamcalib", "-520.5652", "-430.5652", "differ by"),
    ("ocamcalib", "-520.5652", "nan", "not finite"),
    ("ocamcalib", "1080 1920", "1080.5 1920", "image size"),
    ("ocamcalib", "1080 1920", "", "4 lines of numbers"),
    ("ocamcalib", "553.766179 ", "", "centre"),
    ("ocamcalib", "1.000305", "-1.000305", "affine"),
    ("camodocal", "KANNALA_BRANDT", "KANALA", "KANNALA_BRANDT"),
    ("camodocal", "mu: 2.7299e+02", "mu: 0.0", "mu"),
    ("camodocal", "   k5: 3.5386e-04\n", "", "k5"),
]


@pytest.mark.parametrize("name", list(GOOD))
def test_the_unspoiled_files_are_read(tmp_path, name):
    (tmp_path / "camera").write_text(GOOD[name])
    assert read_camera(tmp_path / "camera").image_size[0] > 0


@pytest.mark.parametrize(("name", "right", "wrong", "named"), WRONG)
def test_wrong_files_are_refused_naming_the_place(tmp_path, name, right, wrong, named):
    assert right in GOOD[name]
    (tmp_path / "camera").write_text(GOOD[name].replace(right, wrong))
    with pytest.raises(InputError, match="camera") as raised:
        read_camera(tmp_path / "camera")
    assert named in str(raised.value)


@pytest.mark.parametrize("content", [b"", b"\x00\xff\xfe", b"hello", b"a: 1", b"- 1\n- 2"])
def test_for_unknown_files_the_error_lists_the_formats_tried(tmp_path, content):
    (tmp_path / "camera").write_bytes(content)
    with pytest.raises(InputError) as raised:
        read_camera(tmp_path / "camera")
    assert "not text" in str(raised.value) or all(f"  {f.name}: " in str(raised.value) for f in FORMATS)


def test_absent_file_and_folder_are_refused(tmp_path):
    for path in (tmp_path / "nothing", tmp_path):
        with pytest.raises(InputError, match="cannot be read"):
            read_camera(path)


def test_a_format_that_cannot_hold_the_model_is_refused(tmp_path):
    with pytest.raises(InputError, match="cannot hold a scaramuzza camera"):
        write_camera(CAMERAS["scaramuzza"], tmp_path / "camera", "opencv")
    with pytest.raises(InputError, match="cannot hold a pinhole camera"):
        write_camera(CAMERAS["pinhole"], tmp_path / "camera", "kalibr")
    assert not (tmp_path / "camera").exists()


@pytest.mark.parametrize("name", list(CAMERAS))
def test_probe_section_holds_every_camera(name, tmp_path):
    mapping = camera_to_mapping(CAMERAS[name])
    through_yaml = yaml.safe_load(yaml.safe_dump(mapping))
    assert camera_from_mapping(through_yaml, tmp_path / "probe.yaml") == CAMERAS[name]


PROBE_MISTAKES = [
    ({"model": "kannala_brand"}, "did you mean kannala_brandt"),
    ({"model": None}, "model"),
    ({"model": 3}, "model"),
    ({"distorsion": [0, 0, 0, 0]}, "did you mean distortion"),
    ({"focal_px": [0.0, 366.0]}, "focal_px[0]"),
    ({"focal_px": [366.0, -1]}, "focal_px[1]"),
    ({"focal_px": 366.0}, "focal_px"),
    ({"centre_px": [float("nan"), 3.0]}, "centre_px[0]"),
    ({"centre_px": ["1e3", 3.0]}, "1000.0"),
    ({"centre_px": [10**400, 3.0]}, "centre_px[0]"),
    ({"distortion": [0.0, 0.0, 0.0]}, "4 numbers"),
    ({"distortion": [0.0, 0.0, 0.0, True]}, "distortion[3]"),
    ({"image_size": [1600, 0]}, "image_size"),
    ({"image_size": [1600.0, 1200]}, "image_size"),
    ({"image_size": [1600]}, "image_size"),
]


@pytest.mark.parametrize(("change", "named"), PROBE_MISTAKES)
def test_mistakes_in_the_probe_section_are_named(change, named, tmp_path):
    mapping = camera_to_mapping(CAMERAS["kannala_brandt"]) | change
    with pytest.raises(InputError, match=r"probe\.yaml") as raised:
        camera_from_mapping(mapping, tmp_path / "probe.yaml")
    assert named in str(raised.value)


@pytest.mark.parametrize("key", ["model", "image_size", "focal_px", "centre_px", "distortion"])
def test_missing_keys_of_the_probe_section_are_named(key, tmp_path):
    mapping = camera_to_mapping(CAMERAS["kannala_brandt"])
    del mapping[key]
    with pytest.raises(InputError, match=key):
        camera_from_mapping(mapping, tmp_path / "probe.yaml")


fuzz = settings(max_examples=120, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
junk = st.one_of(
    st.sampled_from(
        ["", "nan", ".inf", "-1", "0", "1e400", "9" * 400, "[", "{", "]", "null", "&a", "*a", "\n", ":"]
    ),
    st.text(max_size=8),
)


@fuzz
@given(name=st.sampled_from(list(GOOD)), where=st.floats(0, 1), length=st.integers(0, 12), put=junk)
def test_spoiled_files_are_read_or_refused(tmp_path, name, where, length, put):
    text = GOOD[name]
    at = int(where * len(text))
    _read_or_refuse(tmp_path, (text[:at] + put + text[at + length :]).encode("utf-8", "surrogatepass"))


@fuzz
@given(content=st.binary(max_size=200))
def test_random_bytes_are_refused(tmp_path, content):
    _read_or_refuse(tmp_path, content)


values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner, max_size=3),
    max_leaves=8,
)


@fuzz
@given(name=st.sampled_from(list(CAMERAS)), data=st.data())
def test_any_value_in_the_probe_section_is_read_or_refused(tmp_path, name, data):
    mapping = camera_to_mapping(CAMERAS[name])
    mapping[data.draw(st.sampled_from(list(mapping)))] = data.draw(values)
    try:
        camera = camera_from_mapping(mapping, tmp_path / "probe.yaml")
    except InputError:
        return
    assert np.isfinite(camera.parameters).all()


def _read_or_refuse(folder, content):
    (folder / "camera").write_bytes(content)
    try:
        camera = read_camera(folder / "camera")
    except InputError:
        return
    assert np.isfinite(camera.parameters).all()
    assert min(camera.image_size) > 0


def test_published_ocamcalib_polynomials_agree_with_each_other():
    """Round trip of the published polynomials: 0.002 px rms up to 470 px, most where the axis is."""
    camera, inverse = read_polynomials(CameraDocument.open(shared("real", "ocam_umh", "calib_results.txt")))
    rho = np.linspace(1, 470, 2000)
    elevation = np.arctan2(-camera.depth(rho), rho)
    error = np.polynomial.polynomial.polyval(elevation, inverse) - rho
    assert np.sqrt(np.mean(error**2)) <= 0.002
    assert inverse_disagreement_px(camera, inverse) < 0.01
    uv = np.stack([camera.centre[0] + rho, np.full(rho.shape, camera.centre[1])], -1)
    np.testing.assert_allclose(camera.project(camera.unproject(uv).ray).uv, uv, rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    ("parts", "model"),
    [
        (("ocam_umh", "calib_results_frontal.txt"), "scaramuzza"),
        (("ocam_umh", "calib_results_rear.txt"), "scaramuzza"),
        (("ocam_single_matsuren", "calib_results_0.txt"), "scaramuzza"),
        (("pipeblaser_cmu", "config", "v2_calib.yaml"), "kannala_brandt"),
        (("pipeblaser_cmu", "config", "iros2021_vins.yaml"), "kannala_brandt"),
        (("pipeblaser_cmu", "config", "v1_vins.yaml"), "unified"),
        (("pipeblaser_cmu", "config", "v2_vins.yaml"), "unified"),
    ],
)
def test_published_files_are_read(parts, model):
    assert read_camera(shared("real", *parts)).model == model
