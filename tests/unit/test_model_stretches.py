"""A model that boresight did not write is refused by name, whatever is wrong in it."""

import json
import struct
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pipeline.errors import InputError
from pipeline.geometry.axis import from_pipe, to_pipe
from pipeline.review.model_stretches import read_model
from tests.fuzz.targets import TARGETS
from tests.truth_run import true_axis

GOOD = TARGETS["model.glb"].seed()
HEAD = 20


def document() -> dict[str, Any]:
    length = struct.unpack("<I", GOOD[12:16])[0]
    return json.loads(GOOD[HEAD : HEAD + length])  # type: ignore[no-any-return]


def written(folder: Path, tree: dict[str, Any]) -> Path:
    length = struct.unpack("<I", GOOD[12:16])[0]
    text = json.dumps(tree).encode()
    file = folder / "model.glb"
    file.write_bytes(GOOD[:12] + struct.pack("<2I", len(text), 0x4E4F534A) + text + GOOD[HEAD + length :])
    return file


def test_a_good_model_gives_its_stretch(tmp_path: Path) -> None:
    model = read_model(written(tmp_path, document()), true_axis(0.0, 0.0))
    (stretch,) = model.stretches()
    assert (stretch.from_mm, stretch.to_mm, stretch.triangles) == pytest.approx((0, 1000, 1))
    assert model.stretch(0)[:4] == b"glTF"


def test_the_box_of_a_stretch_in_a_bend_contains_its_corners(tmp_path: Path) -> None:
    """A bend of 300 mm, and a piece of wall 100 mm along it and 40 mm around its axis."""
    axis, tree = true_axis(1 / 300, 0.4), document()
    corners = from_pipe(axis, np.array([100.0, 200.0])[:, None], np.linspace(0, 6, 12), np.array(20.0))
    low, high = (f(corners.reshape(-1, 3), axis=0) / 1000 for f in (np.min, np.max))
    tree["accessors"][0].update(min=low.tolist(), max=high.tolist())
    (stretch,) = read_model(written(tmp_path, tree), axis).stretches()
    box = 1000 * np.array(list(product(*zip(low, high, strict=True))))
    exact = to_pipe(axis, box)[0]
    assert (stretch.from_mm, stretch.to_mm) == pytest.approx((exact.min(), exact.max()), abs=1.0)


def all_of(file: Path) -> tuple[object, ...]:
    model = read_model(file, true_axis(0.0, 0.0))
    return model.stretches(), model.stretch(0)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: d["accessors"][0].pop("min"),
        # The corners of a box in 40 dimensions would fill any memory.
        lambda d: d["accessors"][0].update(min=[0] * 40, max=[1] * 40),
        lambda d: d["accessors"].clear(),
        lambda d: d["meshes"][0]["primitives"][0].update(attributes=[0]),
        lambda d: d["meshes"][0]["primitives"][0].update(indices="x"),
        lambda d: d.update(materials=None),
        lambda d: d["bufferViews"][0].update(byteOffset={}),
        lambda d: d["images"][0].update(bufferView=7),
    ],
)
def test_an_inconsistent_model_is_refused(tmp_path: Path, spoil: Any) -> None:
    tree = document()
    spoil(tree)
    with pytest.raises(InputError, match=r"model\.glb: is not a model of boresight"):
        all_of(written(tmp_path, tree))
