"""From a scene to a recording and, apart from it, its truth."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.errors import InputError
from pipeline.files.disk import disk_errors_named
from pipeline.simulator.build import plain_truth
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.switch import switches_from_mapping
from pipeline.simulator.premises.base import Premise
from pipeline.simulator.premises.check import require_recording, require_scene
from pipeline.simulator.record import write_recording
from pipeline.simulator.render import Renderer, renderer_of
from pipeline.simulator.scene import Scene
from pipeline.simulator.seal import seal_truth
from pipeline.simulator.truth import SceneTruth
from pipeline.simulator.truth_files import write_truth


@dataclass(frozen=True)
class Places:
    """Where a recording and its truth go; ``sealed`` tells whether hashes go out with the recording."""

    recording: Path
    truth: Path
    sealed: bool = False


def beside(recording: Path) -> Path:
    """Return the folder of a recording's truth where none is named: beside it, never inside."""
    return recording.with_name(f"{recording.name}-truth")


@dataclass(frozen=True)
class Order:
    """A scene, where it was read from (a photograph is looked for beside it), and where it is to go."""

    scene: Scene
    file: Path
    places: Places


def produce(orders: Sequence[Order], progress: Callable[[Order, int], None]) -> list[tuple[Premise, ...]]:
    """Render recordings that belong together, each with its truth; return what was checked of each.

    All scenes are checked before the first is rendered. Where one cannot be rendered, none is left.

    Parameters
    ----------
    orders : sequence of Order
    progress : callable
        Told how many frames of an order are done.

    Raises
    ------
    InputError
        When a scene or a place cannot be used.
    UnusableError
        When a scene cannot show what it is meant to show.
    """
    for order in orders:
        _require_apart(order.places)
    checked = [_checked(order) for order in orders]
    with ExitStack() as stack:
        new = [stack.enter_context(_whole_or_nothing(order.places)) for order in orders]
        return [
            _rendered(order, one, places, progress)
            for order, one, places in zip(orders, checked, new, strict=True)
        ]


@dataclass(frozen=True)
class _Checked:
    """A scene that can be rendered, and what was checked of it."""

    truth: SceneTruth
    renderer: Renderer
    premises: tuple[Premise, ...]


def _checked(order: Order) -> _Checked:
    plain = plain_truth(order.scene, order.file)
    switches = switches_from_mapping(order.scene.effects, order.file)
    truth = switch_on(plain, switches)
    renderer = renderer_of(truth)
    return _Checked(truth, renderer, tuple(require_scene(plain, switches, renderer)))


def _rendered(
    order: Order, one: _Checked, new: Places, progress: Callable[[Order, int], None]
) -> tuple[Premise, ...]:
    """Render a scene, check the recording, write its truth, seal it."""
    scene = order.scene
    write_recording(
        one.renderer, new.recording, scene.codec, scene.quality, lambda done, _: progress(order, done)
    )
    premises = (*one.premises, *require_recording(new.recording, one.truth))
    write_truth(scene, one.truth, [p.record for p in premises], new.truth)
    if new.sealed:
        seal_truth(new.truth, new.recording)
    return premises


@contextmanager
def _whole_or_nothing(places: Places) -> Iterator[Places]:
    """Lend folders to write to, which take their names at the end, or are removed when something fails."""
    new = replace(places, recording=_partial(places.recording), truth=_partial(places.truth))
    pairs = ((new.recording, places.recording), (new.truth, places.truth))
    try:
        with disk_errors_named(places.recording):
            for part, _ in pairs:
                shutil.rmtree(part, ignore_errors=True)
            yield new
            for part, whole in pairs:
                if whole.exists():
                    whole.rmdir()
                part.rename(whole)
    finally:
        for part, _ in pairs:
            shutil.rmtree(part, ignore_errors=True)


def _partial(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}.partial")


def _require_apart(places: Places) -> None:
    inside, outside = places.truth.resolve(), places.recording.resolve()
    if inside == outside or outside in inside.parents:
        raise InputError(
            places.truth, "lies inside the recording, where the truth would go out with it",
            hint="name a folder beside it with --truth",
        )  # fmt: skip
    for folder in (places.recording, places.truth):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(folder, "is there already", expected="a folder that is not there, or empty")
