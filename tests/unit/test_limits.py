"""Inputs beyond the limits that the README states are refused by name, and others are accepted."""

from __future__ import annotations

import json
import os
import re
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.export.run_record import read_run_record
from pipeline.files.json_yaml import LARGEST_JSON_BYTES, LARGEST_YAML_BYTES
from pipeline.instrument.camera.formats import read_camera
from pipeline.instrument.camera.mapping import LARGEST_SIDE_PX
from pipeline.instrument.probe_file import read_probe
from pipeline.recording import tables
from pipeline.recording.tables import read_encoder, read_frame_table, read_imu
from pipeline.review import guard, model_stretches, quality
from pipeline.review.decisions import action_of
from pipeline.review.model_stretches import read_model
from pipeline.review.run_files import RunFiles, measured_findings
from pipeline.review.server import PostedAction, PostedPoints, PostedSignature, parsed
from stages.compare import reference
from stages.compare.reference import read_wall_map
from tests.fuzz.targets import TARGETS
from tests.shared_data import PROJECT_ROOT
from tests.truth_run import true_axis

MIB = 1 << 20
STATED = {
    "YAML": f"{LARGEST_YAML_BYTES // 1_000_000} MB",
    "tables": f"{tables.LARGEST_BYTES // MIB} MiB",
    "JSON": f"{LARGEST_JSON_BYTES // MIB} MiB",
    "arrays": f"{reference.LARGEST_UNPACKED_BYTES >> 30} GiB",
    "pictures": f"{LARGEST_SIDE_PX} px",
    "model": f"{model_stretches._LARGEST_DOCUMENT // MIB} MiB",
    "diagnosis page": f"{quality._LARGEST_PAGE // MIB} MiB",
    "request": f"{guard._LARGEST_BODY // MIB} MiB",
}


@pytest.mark.parametrize(("what", "limit"), STATED.items())
def test_the_readme_states_the_limits_of_the_program(what: str, limit: str) -> None:
    section = re.split(r"\n#+ ", (PROJECT_ROOT / "README.md").read_text("utf-8").split("## Limits")[1])[0]
    (row,) = [line for line in section.splitlines() if line.startswith(f"| {what}")]
    assert limit in row


def hollow(file: Path, size: int) -> Path:
    """Make a file of a given size that takes no room on the disk."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.touch()
    os.truncate(file, size)
    return file


def bomb(file: Path) -> Path:
    """Write an archive of some kilobytes whose directory states that it unpacks to five gigabytes."""
    np.savez_compressed(file, distance_mm=np.zeros(4), azimuth_rad=np.zeros(4), radius_mm=np.zeros((4, 4)))
    content = bytearray(file.read_bytes())
    at = content.rindex(b"PK\x01\x02")
    content[at + 24 : at + 28] = (0xFFFFFFF0).to_bytes(4, "little")
    at = content.index(b"PK\x01\x02")
    content[at + 24 : at + 28] = (0xFFFFFFF0).to_bytes(4, "little")
    file.write_bytes(content)
    with zipfile.ZipFile(file) as archive:
        assert sum(entry.file_size for entry in archive.infolist()) > 5e9
    return file


TOO_LARGE: dict[str, tuple[Callable[[Path], Path], Callable[[Path], object], str]] = {
    "probe.yaml": (lambda d: hollow(d / "p.yaml", 1_000_001), read_probe, "1000001 bytes"),
    "camera.yml": (lambda d: hollow(d / "c.yml", 1_000_001), read_camera, "bytes"),
    "frames.csv": (lambda d: hollow(d / "f.csv", 256 * MIB + 1), read_frame_table, "268435457 bytes"),
    "encoder.csv": (lambda d: hollow(d / "e.csv", 256 * MIB + 1), read_encoder, "268435457 bytes"),
    "imu.csv": (lambda d: hollow(d / "i.csv", 256 * MIB + 1), read_imu, "268435457 bytes"),
    "run.json": (lambda d: hollow(d / "run.json", 256 * MIB + 1).parent, read_run_record, "not the record"),
    "reviewed run.json": (
        lambda d: hollow(d / "run.json", 256 * MIB + 1).parent, lambda d: RunFiles(d).record(), "268435457",
    ),
    "radius_map.npz": (lambda d: bomb(d / "radius_map.npz"), read_wall_map, r"unpacks to \d{10} bytes"),
}  # fmt: skip


@pytest.mark.parametrize("name", TOO_LARGE)
def test_too_large_a_file_is_refused_unread(tmp_path: Path, name: str) -> None:
    make, read, told = TOO_LARGE[name]
    with pytest.raises(InputError, match=told):
        read(make(tmp_path))


def test_a_model_with_too_large_a_header_is_refused(tmp_path: Path) -> None:
    head = np.array([0x46546C67, 2, 0, 257 * MIB, 0x4E4F534A], "<u4").tobytes()
    (tmp_path / "model.glb").write_bytes(head)
    with pytest.raises(InputError, match="not a binary glTF"):
        read_model(tmp_path / "model.glb", true_axis(0.0, 0.0))


DEEP = "[" * 100_000


@pytest.mark.parametrize("target", ["run record", "stored result", "defects", "review request",
                                    "review action", "configuration", "probe.yaml"])  # fmt: skip
def test_a_file_nested_too_deeply_counts_as_damaged(target: str) -> None:
    try:
        TARGETS[target].take(DEEP.encode())
    except InputError:
        pass
    else:
        assert target in ("stored result", "review request"), "these return None, or were refused inside"


def test_findings_nested_too_deeply_are_refused() -> None:
    with pytest.raises(InputError, match="nested too deeply"):
        measured_findings(DEEP, Path("defects.json"))


SIGNING = {"name": "x", "standard": "x" * 200, "remarks": "x" * 4000, "revision": 0}
OUTLINE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]


ACTIONS: dict[str, Callable[[int], dict[str, object]]] = {
    "text": lambda n: {"do": "comment", "finding": "1", "text": "x" * n},
    "points": lambda n: {"do": "add", "kind": "pit", "outline": OUTLINE[:1] * n},
    "findings": lambda n: {"do": "merge", "findings": [str(k) for k in range(n)]},
    "outlines": lambda n: {"do": "split", "finding": "1", "outlines": [OUTLINE] * n},
}


@pytest.mark.parametrize(
    ("name", "most"), [("text", 4000), ("points", 2000), ("findings", 50), ("outlines", 20)]
)
def test_an_action_longer_than_stated_is_refused(name: str, most: int) -> None:
    action_of(json.dumps(ACTIONS[name](most)))
    with pytest.raises(InputError):
        action_of(json.dumps(ACTIONS[name](most + 1)))


@pytest.mark.parametrize(
    ("kind", "most", "over"),
    [
        (PostedAction, {"action": {}, "who": "x" * 200, "revision": 2**53}, {"who": "x" * 201}),
        (PostedAction, {"action": {}, "who": "x", "revision": 2**53}, {"revision": 2**53 + 1}),
        (PostedSignature, SIGNING, {"standard": "x" * 201}),
        (PostedSignature, SIGNING, {"remarks": "x" * 4001}),
        (PostedPoints, {"tool": "area", "points": [[0, 0]] * 2000}, {"points": [[0, 0]] * 2001}),
    ],
)  # fmt: skip
def test_a_request_longer_than_stated_is_refused(
    kind: type, most: dict[str, object], over: dict[str, object]
) -> None:
    parsed(kind, json.dumps(most).encode())
    with pytest.raises(InputError):
        parsed(kind, json.dumps(most | over).encode())
