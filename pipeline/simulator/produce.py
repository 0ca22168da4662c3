"""From a scene to a recording and, apart from it, its truth."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.disk import disk_errors_named
from pipeline.errors import InputError
from pipeline.simulator.build import plain_truth
from pipeline.simulator.effects.catalogue import switch_on
from pipeline.simulator.effects.switch import switches_from_mapping
from pipeline.simulator.premises.base import Premise
from pipeline.simulator.premises.check import require_recording, require_scene
from pipeline.simulator.record import write_recording
from pipeline.simulator.render import renderer_of
from pipeline.simulator.scene import Scene
from pipeline.simulator.seal import seal_truth
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


def produce(
    scene: Scene, file: Path, places: Places, progress: Callable[[int, int], None]
) -> tuple[Premise, ...]:
    """Check a scene, render it, check the recording, write its truth, seal it; return what was checked.

    Parameters
    ----------
    scene : Scene
    file : Path
        Where it was read from; a photograph is looked for beside it.
    places : Places
    progress : callable
        Told the frames done, of how many.

    Raises
    ------
    InputError
        When the scene or a place cannot be used.
    UnusableError
        When the scene cannot show what it is meant to show.
    """
    _require_apart(places)
    plain = plain_truth(scene, file)
    switches = switches_from_mapping(scene.effects, file)
    truth = switch_on(plain, switches)
    renderer = renderer_of(truth)
    before = require_scene(plain, switches, renderer)
    with _whole_or_nothing(places) as new:
        write_recording(renderer, new.recording, scene.codec, scene.quality, progress)
        after = require_recording(new.recording, truth)
        write_truth(scene, truth, [p.record for p in (*before, *after)], new.truth)
        if places.sealed:
            seal_truth(new.truth, new.recording)
    return (*before, *after)


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
