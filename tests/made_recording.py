"""A tiny recording, 16 frames of 64 × 48 px, written in every container that boresight reads."""

from collections.abc import Callable, Mapping
from pathlib import Path

import av
import cv2
import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from pipeline.arrays import Image

COUNT, WIDTH, HEIGHT, RATE = 16, 64, 48, 30
LIGHTS = ["laser", "led"] * (COUNT // 2)
TIMES_S = [i / RATE for i in range(COUNT)]
READINGS = [(0.01 * i, 0.2 * i) for i in range(56)]
IMU = [(0.01 * i, 0.1, -0.2, 0.01 * i, 0.0, 0.5, -9.8) for i in range(56)]
START_NS = 1_700_000_000_000_000_000

PROBE = """\
camera: {model: kannala_brandt, image_size: [64, 48], focal_px: [15.0, 15.0], centre_px: [31.5, 23.5],
         distortion: [-0.01, 0.001, 0.0, 0.0]}
laser: {baseline_mm: 23.5, opening_angle_deg: 180.02, tilt_deg: 0.5, tilt_direction_deg: 120.0,
        line_sigma_mm: 0.15, wavelength_nm: 520}
shutter: {kind: global, exposure_s: 0.0015}
lighting: {kind: led_ring, leds: 8, radius_mm: 11.0, z_mm: -1.0}
standard_uncertainty: {focal_px: 0.06, centre_px: 0.05, distortion: [2.0e-4, 2.0e-4, 1.0e-4, 0.0],
                       baseline_mm: 0.008, tilt_deg: 0.006, opening_angle_deg: 0.012}
"""
SHARED_KEYS = """\
name: made
kind: inspection
frame_rate: 30.0
probe: probe.yaml
pipe: {nominal_diameter_mm: 101.6, wall_thickness_mm: 4.0}
"""
FOLDER_KEYS = SHARED_KEYS + "video: {video}\nframes: frames.csv\nencoder: encoder.csv\n"


def picture(number: int) -> Image:
    """Return frame ``number`` in BGR: ramps, and a square that moves."""
    image = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    image[..., 0] = np.linspace(0, 255, WIDTH)
    image[..., 1] = np.linspace(0, 255, HEIGHT)[:, None]
    image[..., 2] = 15 * number
    image[number : number + 8, 2 * number : 2 * number + 8] = 255
    return image


def write_video(
    file: Path, codec: str = "libx264", pix_fmt: str = "yuv444p", options: Mapping[str, str] | None = None
) -> None:
    """Encode the pictures into a video."""
    with av.open(str(file), "w") as container:
        stream = container.add_stream(codec, rate=RATE, options=dict(options or {}))
        stream.width, stream.height, stream.pix_fmt = WIDTH, HEIGHT, pix_fmt
        for number in range(COUNT):
            container.mux(stream.encode(av.VideoFrame.from_ndarray(picture(number), format="bgr24")))
        container.mux(stream.encode())


def write_tables(folder: Path) -> None:
    """Write frames.csv, encoder.csv and probe.yaml."""
    rows = "".join(f"{i},{TIMES_S[i]:.6f},{LIGHTS[i]}\n" for i in range(COUNT))
    (folder / "frames.csv").write_text("frame,time_s,illumination\n" + rows)
    (folder / "encoder.csv").write_text(
        "time_s,distance_mm\n" + "".join(f"{t:.4f},{d:.3f}\n" for t, d in READINGS)
    )
    (folder / "probe.yaml").write_text(PROBE)


def write_folder(folder: Path, video: str = "frames.mkv", **encoding: object) -> Path:
    """Write a recording folder; ``video`` may be a pattern such as ``frames/%06d.png``."""
    folder.mkdir(parents=True, exist_ok=True)
    write_tables(folder)
    (folder / "recording.yaml").write_text(FOLDER_KEYS.replace("{video}", f"'{video}'"))
    if "%" in video:
        (folder / video).parent.mkdir(exist_ok=True)
        for number in range(COUNT):
            cv2.imwrite(str(folder / (video % number)), picture(number))
    else:
        write_video(folder / video, **encoding)  # type: ignore[arg-type]
    return folder


def write_ros1(
    folder: Path, *, compressed: bool = False, lights: list[str] | None = LIGHTS, encoding: str = "bgr8"
) -> Path:
    """Write ``run.bag`` and its YAML file; with ``lights`` None there is no illumination topic."""
    file = _described(folder) / "run.bag"
    with rosbag1.Writer(file) as writer:
        store = get_typestore(Stores.ROS1_NOETIC)
        _write_messages(
            store,
            lambda topic, kind: writer.add_connection(topic, kind, typestore=store),
            lambda link, time, message, kind: writer.write(link, time, store.serialize_ros1(message, kind)),
            compressed, lights, encoding,
        )  # fmt: skip
    return file


def write_ros2(
    folder: Path, *, storage: str = "SQLITE3", compressed: bool = False, lights: list[str] | None = LIGHTS,
    encoding: str = "bgr8",
) -> Path:  # fmt: skip
    """Write the ROS 2 bag ``run`` and its YAML file beside it."""
    path = _described(folder) / "run"
    (folder / "recording.yaml").rename(folder / "run.recording.yaml")
    plugin = rosbag2.StoragePlugin[storage]
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        store = get_typestore(Stores.LATEST)
        _write_messages(
            store,
            lambda topic, kind: writer.add_connection(topic, kind, typestore=store),
            lambda link, time, message, kind: writer.write(link, time, store.serialize_cdr(message, kind)),
            compressed, lights, encoding,
        )  # fmt: skip
    return path


def write_mcap(
    folder: Path, *, ros1: bool = False, compressed: bool = False, lights: list[str] | None = LIGHTS,
    encoding: str = "bgr8",
) -> Path:  # fmt: skip
    """Write ``run.mcap``, messages in ROS 2's or ROS 1's encoding, and its YAML file."""
    file = _described(folder) / "run.mcap"
    store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.LATEST)
    serialize = store.serialize_ros1 if ros1 else store.serialize_cdr
    with file.open("wb") as opened:
        writer = McapWriter(opened)
        writer.start("ros1" if ros1 else "ros2")

        def connect(topic: str, kind: str) -> int:
            name = kind.replace("/msg/", "/") if ros1 else kind
            schema = writer.register_schema(name, "ros1msg" if ros1 else "ros2msg", b"")
            return int(writer.register_channel(topic, "ros1" if ros1 else "cdr", schema))

        def write(link: int, time: int, message: object, kind: str) -> None:
            writer.add_message(link, time, bytes(serialize(message, kind)), time)

        _write_messages(store, connect, write, compressed, lights, encoding)
        writer.finish()
    return file


def _described(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "probe.yaml").write_text(PROBE)
    (folder / "recording.yaml").write_text(SHARED_KEYS)
    return folder


def _write_messages(
    store, connect: Callable, write: Callable, compressed: bool, lights: list[str] | None, encoding: str
) -> None:
    """Write images, lights and encoder readings in order of time, 3 ms after each image was taken."""
    kind = "sensor_msgs/msg/CompressedImage" if compressed else "sensor_msgs/msg/Image"
    topic = "/camera/image/compressed" if compressed else "/camera/image_raw"
    image, encoder = connect(topic, kind), connect("/encoder/distance_mm", "std_msgs/msg/Float64")
    light = connect("/illumination", "std_msgs/msg/String") if lights is not None else None
    events = []
    for number in range(COUNT):
        taken = START_NS + round(TIMES_S[number] * 1e9)
        events.append((taken + 3_000_000, 1, image, _image(store, number, taken, kind, encoding), kind))
        if lights is not None and number < len(lights):
            word = store.types["std_msgs/msg/String"](data=lights[number])
            events.append((taken + 2_000_000, 0, light, word, "std_msgs/msg/String"))
    for time_s, distance_mm in READINGS:
        reading = store.types["std_msgs/msg/Float64"](data=distance_mm)
        events.append((START_NS + round(time_s * 1e9), 2, encoder, reading, "std_msgs/msg/Float64"))
    imu = connect("/imu/data", "sensor_msgs/msg/Imu")
    for time_s, *values in IMU:
        taken = START_NS + round(time_s * 1e9)
        events.append((taken + 1_000_000, 3, imu, _imu(store, taken, values), "sensor_msgs/msg/Imu"))
    for time, _, link, message, name in sorted(events, key=lambda e: e[:2]):
        write(link, time, message, name)


def _header(store, taken_ns: int, frame: str):
    stamp = store.types["builtin_interfaces/msg/Time"](sec=taken_ns // 10**9, nanosec=taken_ns % 10**9)
    extra = {"seq": 0} if "seq" in store.types["std_msgs/msg/Header"].__dataclass_fields__ else {}
    return store.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame, **extra)


def _imu(store, taken_ns: int, values: list[float]):
    vector, none = store.types["geometry_msgs/msg/Vector3"], np.zeros(9)
    return store.types["sensor_msgs/msg/Imu"](
        header=_header(store, taken_ns, "imu"),
        orientation=store.types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
        orientation_covariance=none, angular_velocity=vector(*values[:3]),
        angular_velocity_covariance=none, linear_acceleration=vector(*values[3:]),
        linear_acceleration_covariance=none,
    )  # fmt: skip


def _image(store, number: int, taken_ns: int, kind: str, encoding: str):
    header = _header(store, taken_ns, "camera")
    pixels = picture(number)
    if kind.endswith("CompressedImage"):
        data = cv2.imencode(".png", pixels)[1].reshape(-1)
        return store.types[kind](header=header, format="png", data=data)
    coded, step = _coded(pixels, encoding)
    return store.types[kind](
        header=header, height=HEIGHT, width=WIDTH, encoding=encoding, is_bigendian=0, step=step, data=coded
    )


def _coded(pixels: Image, encoding: str) -> tuple[Image, int]:
    """Return the bytes of an image, each row padded by 8 bytes, and the length of a row."""
    match encoding:
        case "bgr8":
            rows = pixels.reshape(HEIGHT, -1)
        case "rgb8":
            rows = pixels[..., ::-1].reshape(HEIGHT, -1)
        case "mono8":
            rows = pixels[..., 0]
        case "mono16":
            rows = (pixels[..., 0].astype("<u2") * 256 + 77).view(np.uint8)
        case "bayer_rggb8":
            rows = pixels[..., 1].copy()
            rows[0::2, 0::2], rows[1::2, 1::2] = pixels[0::2, 0::2, 2], pixels[1::2, 1::2, 0]
        case _:
            rows = pixels[..., 0]
    padded = np.pad(rows, ((0, 0), (0, 8)))
    return padded.reshape(-1).copy(), padded.shape[1]
