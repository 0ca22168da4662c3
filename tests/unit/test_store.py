"""Results are read exactly as they were written, and incomplete ones are never returned."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, make_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from pipeline.errors import InputError
from pipeline.files.codec import NOT_STORED, canonical, decode, digest, encode, is_digest_of
from pipeline.machine.outcome import Number
from pipeline.machine.stage import Parameters
from pipeline.machine.store import Provenance, Store
from pipeline.recording.checks import CheckedFrames
from tests.disk_limit import file_size_limit
from tests.toy_stages import DrawParameters, Mood


@dataclass(frozen=True)
class Leaf:
    name: str
    size: float
    array: NDArray[Any]


@dataclass(frozen=True)
class Tree:
    leaf: Leaf | None
    leaves: tuple[Leaf, ...]
    mood: Mood
    count: int
    flag: bool
    mixed: tuple[float | int | str | bool | None, ...]
    array: NDArray[Any]
    moods: Mapping[Mood, float] = field(default_factory=dict)
    chosen: Parameters = field(default_factory=DrawParameters)


KEY = "ab" * 32
PROVENANCE = Provenance("grow", "1", KEY, 1.5, (Number("rejected: dry", 3, "leaves"),))

dtypes = st.sampled_from([np.dtype(d) for d in ("f8", "f4", "i8", "u1", "?", "<U5", ">f4")])
shapes = hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=4)
arrays = dtypes.flatmap(lambda d: hnp.arrays(d, shapes))
texts = st.text(st.characters(codec="utf-8"), max_size=8)
leaves = st.builds(Leaf, name=texts, size=st.floats(), array=arrays)
trees = st.builds(
    Tree,
    leaf=st.none() | leaves,
    leaves=st.lists(leaves, max_size=3).map(tuple),
    mood=st.sampled_from(Mood),
    count=st.integers(),
    flag=st.booleans(),
    mixed=st.lists(st.floats() | st.integers() | texts | st.booleans() | st.none(), max_size=4).map(tuple),
    array=arrays,
    moods=st.dictionaries(st.sampled_from(Mood), st.floats(allow_nan=False)),
    chosen=st.builds(DrawParameters, count=st.integers(1, 9), mood=st.sampled_from(Mood)),
)


def same(a: Any, b: Any) -> bool:
    """Return whether two values are equal to the last bit.

    Types, dtypes, NaN and the sign of zero included.
    """
    if type(a) is not type(b):
        return False
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    if is_dataclass(a):
        return all(same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, tuple):
        return len(a) == len(b) and all(map(same, a, b))
    if isinstance(a, float):
        return (math.isnan(a) and math.isnan(b)) or (a == b and math.copysign(1, a) == math.copysign(1, b))
    return bool(a == b)


def tree() -> Tree:
    leaf = Leaf("oak", 2.5, np.arange(12.0).reshape(3, 4))
    return Tree(leaf, (leaf, leaf), Mood.WILD, 3, True, (1, 1.0, "x", None, True), np.arange(1000))


@given(trees)
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_what_is_read_is_what_was_written(tmp_path: Path, artefact: Tree) -> None:
    store = Store(tmp_path)
    store.write(artefact, PROVENANCE)
    stored = store.read("grow", KEY, Tree)
    assert stored is not None
    assert same(stored.artefact, artefact)
    assert stored.provenance == PROVENANCE
    assert digest(stored.artefact) == digest(artefact)


def test_big_arrays_are_memory_mapped_and_all_are_read_only(tmp_path: Path) -> None:
    big = Leaf("big", 0.0, np.arange(1_000_000.0))
    Store(tmp_path).write(Tree(big, (), Mood.CALM, 0, False, (), np.arange(3)), PROVENANCE)
    stored = Store(tmp_path).read("grow", KEY, Tree)
    assert stored is not None
    assert isinstance(stored.artefact.leaf.array.base, np.memmap)
    for array in (stored.artefact.leaf.array, stored.artefact.array):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1


@pytest.mark.parametrize("value", [{"a"}, {"a": [1]}, [1], b"x", np.array([object()]), 1j, Path("x")])
def test_what_cannot_be_stored_is_refused_with_its_name(value: object) -> None:
    with pytest.raises(TypeError, match=r"^leaf\.array"):
        encode(Tree(Leaf("a", 0.0, value), (), Mood.CALM, 0, True, (), np.arange(1)))  # type: ignore[arg-type]


@pytest.mark.parametrize("change", [{"count": 4}, {"flag": 1}, {"mood": Mood.CALM}, {"mixed": (1.0, 1)}])
def test_other_content_has_another_digest(change: dict[str, Any]) -> None:
    assert digest(tree()) == digest(tree())
    assert digest(replace(tree(), **change)) != digest(tree())
    assert digest(replace(tree(), array=np.arange(1000, dtype=np.int32))) != digest(tree())


def test_a_digest_made_before_a_class_had_a_field_is_still_recognised() -> None:
    older = make_dataclass("Grown", ["size"], frozen=True)
    newer = make_dataclass("Grown", ["size", ("more", object, None)], frozen=True)
    for recorded in (digest(older(1)), digest(newer(1))):
        assert is_digest_of(recorded, newer(1))
        assert not is_digest_of(recorded, newer(2))
        assert not is_digest_of(recorded, newer(1, 2)), "a value that is set counts"


def truncate(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-2])


def flip_bit(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


def empty(path: Path) -> None:
    path.write_bytes(b"")


@pytest.mark.parametrize("damage", [truncate, flip_bit, empty, Path.unlink])
@pytest.mark.parametrize("name", ["manifest.json", "array.npy", "leaf.array.npy"])
def test_damaged_results_are_discarded(tmp_path: Path, damage: Callable[[Path], None], name: str) -> None:
    store = Store(tmp_path)
    store.write(tree(), PROVENANCE)
    folder = tmp_path / f"grow-{KEY[:12]}"
    damage(folder / name)
    assert store.read("grow", KEY, Tree) is None
    assert not folder.exists()
    store.write(tree(), PROVENANCE)
    assert store.read("grow", KEY, Tree) is not None


def test_the_result_of_another_key_or_class_is_discarded(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(tree(), PROVENANCE)
    assert store.read("grow", KEY[:-1] + "c", Tree) is None
    store.write(tree(), PROVENANCE)
    assert store.read("grow", KEY, Leaf) is None


@pytest.mark.parametrize("gone", ["tests.unit.gone:Tree", "tests.unit.test_store:Gone"])
def test_a_result_whose_class_has_moved_counts_as_absent_and_is_no_error(tmp_path: Path, gone: str) -> None:
    store = Store(tmp_path)
    store.write(tree(), PROVENANCE)
    file = next(tmp_path.rglob("manifest.json"))
    older = json.loads(file.read_text().replace(f"{Tree.__module__}:Tree", gone))
    del older["sha256"]
    file.write_text(json.dumps(older | {"sha256": hashlib.sha256(canonical(older)).hexdigest()}))
    assert store.has("grow", KEY), "control: except for its class it is complete"
    assert store.look("grow", KEY, Tree) is None
    assert store.borrow("grow", KEY, Tree) is None
    assert store.read("grow", KEY, Tree) is None


def test_a_result_with_fields_that_its_class_has_lost_is_read_without_them(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(tree(), PROVENANCE)
    file = next(tmp_path.rglob("manifest.json"))
    older = json.loads(file.read_text().replace('"fields": {', '"fields": {"gone": 3.5, '))
    del older["sha256"]
    file.write_text(json.dumps(older | {"sha256": hashlib.sha256(canonical(older)).hexdigest()}))
    assert "gone" in file.read_text()
    found = store.look("grow", KEY, Tree)
    assert found is not None
    assert digest(found) == digest(tree())


@pytest.mark.parametrize("change", [{"size": np.zeros(3)}, {"array": 0.0}])
def test_a_number_in_place_of_an_array_or_the_reverse_is_no_result(
    tmp_path: Path, change: dict[str, Any]
) -> None:
    store, other = Store(tmp_path), replace(Leaf("a", 1.0, np.zeros(3)), **change)
    store.write(other, PROVENANCE)
    assert store.look("grow", KEY, Leaf) is None
    assert store.read("grow", KEY, Leaf) is None


@pytest.mark.parametrize("limit", [0, 100, 5000])
def test_a_full_disk_is_reported_and_leaves_nothing_that_looks_complete(tmp_path: Path, limit: int) -> None:
    store = Store(tmp_path)
    with file_size_limit(limit), pytest.raises(InputError, match="cannot be written"):
        store.write(tree(), PROVENANCE)
    assert store.read("grow", KEY, Tree) is None
    assert not list(tmp_path.iterdir())
    store.write(tree(), PROVENANCE)
    assert store.read("grow", KEY, Tree) is not None


def test_looking_for_a_result_returns_complete_ones_and_never_discards(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.write(tree(), PROVENANCE)
    assert same(store.look("grow", KEY, Tree), tree())
    assert store.look("grow", "ab" * 6 + "cd" * 26, Tree) is None, "the result of another key"
    array = next(tmp_path.rglob("array.npy"))
    content = array.read_bytes()
    array.write_bytes(content[:-8])
    assert store.look("grow", KEY, Tree) is None
    array.write_bytes(content)
    assert same(store.look("grow", KEY, Tree), tree()), "files being written are left to their writer"


@dataclass(frozen=True)
class Watched:
    """An artefact that also holds something of its computation."""

    leaf: Leaf
    watch: Callable[[], None] = field(default=print, metadata=NOT_STORED)


def test_an_array_at_several_places_is_written_once(tmp_path: Path) -> None:
    once = np.arange(6.0)
    leaf = Leaf("a", 1.0, once)
    tree = Tree(leaf, (leaf, Leaf("b", 2.0, once)), Mood.CALM, 1, True, (), once.copy())
    Store(tmp_path).write(tree, PROVENANCE)
    assert len(list(tmp_path.rglob("*.npy"))) == 2
    stored = Store(tmp_path).read("grow", KEY, Tree)
    assert stored is not None
    assert digest(stored.artefact) == digest(tree)


def test_values_of_the_computation_are_not_stored(tmp_path: Path) -> None:
    Store(tmp_path).write(Watched(Leaf("a", 1.0, np.zeros(2)), lambda: None), PROVENANCE)
    stored = Store(tmp_path).read("grow", KEY, Watched)
    assert stored is not None
    assert stored.artefact.watch is print


def test_a_result_made_before_its_class_moved_is_read() -> None:
    frames = CheckedFrames(np.arange(3), np.arange(3.0), np.array(["led"] * 3))
    stored, arrays = encode(frames)
    older = json.loads(json.dumps(stored).replace("recording.checks:", "recording.checked_frames:"))
    assert older != stored
    assert digest(decode(older, arrays.__getitem__, CheckedFrames)) == digest(frames)
