"""Renders recordings from a script, in the same way as `boresight simulate`."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from pipeline.api.diagnosis.simulated import switches_of
from pipeline.api.like import MEASURED, Changed, scene_like
from pipeline.drill.cases import ANSWER
from pipeline.files.installed import PRIORS, SCENES, file_or_shipped
from pipeline.simulator.effects.switch import Switch, parse_switches
from pipeline.simulator.premises import Premise
from pipeline.simulator.prior import draw_pair, read_prior
from pipeline.simulator.produce import Order, Places, beside, produce
from pipeline.simulator.scene import Scene, read_scene

# Receives the name of a scene, the number of rendered frames, and the number of all.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Simulated:
    """A rendered recording.

    Attributes
    ----------
    recording : Path
        Folder that `run`, `calibrate` and `diagnose` take.
    truth : Path
        Folder with all that was drawn or chosen: wall, motion, instrument, effects.
    frames : int
    sealed : bool
        Whether the recording holds hashes of its truth.
    premises : tuple of Premise
        Checks that the scene shows its effects.
    """

    recording: Path
    truth: Path
    frames: int
    sealed: bool
    premises: tuple[Premise, ...]


def simulate(
    scene: Path | str,
    recording: Path | str,
    *,
    truth: Path | str | None = None,
    effects: Sequence[str] = (),
    seed: int | None = None,
    frames: int | None = None,
    seal: bool = False,
    progress: Progress | None = None,
) -> Simulated:
    """Render the recording of a scene, with its truth apart.

    Parameters
    ----------
    scene : path or str
        A scene file, or the name of a shipped one (`shipped_names`).
    recording : path
        Folder of the recording, which must not exist yet.
    truth : path, optional
        Folder of the truth; by default beside the recording, with ``-truth`` added to its name.
    effects : sequence of str
        Effects to switch on, each as on the command line: ``laser_tilt`` at its typical size, or with its
        sizes, such as ``laser_tilt=0.6@40``.
    seed : int, optional
        Seed instead of the scene's.
    frames : int, optional
        Render only the first ``frames`` frames.
    seal : bool
        Add hashes of the truth to the recording, so that the truth can be checked later.
    progress : callable, optional
        Receives the scene's name, the number of rendered frames and the number of all.

    Raises
    ------
    InputError
        When the scene, an effect or a folder cannot be used.
    UnusableError
        When the scene cannot show its effects; says what to change.
    """
    file = file_or_shipped(Path(scene), SCENES)
    described = read_scene(file)
    switched = {s.key: s.numbers for s in parse_switches(effects)}
    changes: dict[str, object] = {"effects": {**described.effects, **switched}}
    if seed is not None:
        changes["seed"] = seed
    changed = _shortened(described.model_copy(update=changes), frames)
    folder = Path(recording)
    places = Places(folder, beside(folder) if truth is None else Path(truth), seal)
    (made,) = _produced([Order(changed, file, places)], progress)
    return made


def simulate_like(
    run: Path | str,
    recording: Path | str,
    *,
    truth: Path | str | None = None,
    effects: Sequence[str] = (),
    speed: float = 1.0,
    probe: Path | str | None = None,
    defects: Sequence[str] = (),
    seed: int = 0,
    frames: int | None = None,
    progress: Progress | None = None,
) -> Simulated:
    """Render a recording of a run's pipe with its probe and its light, with the requested changes.

    The truth holds the scene and the measured pipe, so that `simulate` can render it again.

    Parameters
    ----------
    run : path
        Folder of a completed run, whose recording still exists.
    recording : path
        Folder of the recording, which must not exist yet.
    truth : path, optional
        As in `simulate`.
    effects : sequence of str
        Effects to switch on, as in `simulate`; the folder of a diagnosis means all effects that it found.
    speed : float
        Factor on the speed of the probe.
    probe : path, optional
        File of another probe.
    defects : sequence of str
        Defects to add: each ``KIND,DISTANCE,AZIMUTH,LENGTH,WIDTH,DEPTH`` in mm and deg.
    seed : int
        Seed of the noise and of the defects' shapes.
    frames : int, optional
        Render only so many, from the first.
    progress : callable, optional
        As in `simulate`.

    Raises
    ------
    InputError
        When run, probe, diagnosis, effect, defect or folder cannot be used.
    UnusableError
        When the run does not contain enough information, or the scene cannot show its effects.
    """
    folder = Path(recording)
    places = Places(folder, beside(folder) if truth is None else Path(truth))
    changed = Changed(speed, None if probe is None else Path(probe), defects)
    with TemporaryDirectory(dir=_existing(folder.parent), prefix=".like-") as temporary:
        room = Path(temporary)
        scene = scene_like(Path(run), folder.name, room, changed)
        update: dict[str, object] = {"seed": seed, "effects": {s.key: s.numbers for s in _switched(effects)}}
        scene = _shortened(scene.model_copy(update=update), frames)
        (made,) = _produced([Order(scene, room / "scene.yaml", places)], progress)
        shutil.copy2(room / MEASURED, places.truth / MEASURED)
    return made


def _existing(folder: Path) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _switched(effects: Sequence[str]) -> tuple[Switch, ...]:
    """Return the switches of texts; the folder of a diagnosis means the effects that it found."""
    found: list[Switch] = []
    for text in effects:
        answer = Path(text) / ANSWER
        found += switches_of(answer).found if answer.is_file() else parse_switches([text])
    return parse_switches([s.text for s in found])


def simulate_pairs(
    prior: Path | str,
    folder: Path | str,
    count: int,
    *,
    first: int = 0,
    truth: Path | str | None = None,
    seed: int = 0,
    frames: int | None = None,
    seal: bool = False,
    progress: Progress | None = None,
) -> Iterator[tuple[Simulated, Simulated]]:
    """Draw probes with concealed effects; yield the gauge run and the inspection of each, rendered.

    Parameters
    ----------
    prior : path or str
        The prior: a file, or the name of a shipped one (`shipped_names`).
    folder : path
        Folder of the recordings, each in its own folder.
    count, first : int
        Draw ``count`` pairs, from pair number ``first`` on.
    truth : path, optional
        Folder of all truths; by default beside ``folder``.
    seed : int
        Seed of the draw; the same seed draws the same pairs.
    frames, seal, progress
        As in `simulate`.

    Raises
    ------
    InputError
        When the prior, a scene or a folder cannot be used.
    UnusableError
        When a scene cannot show its effects; says what to change.
    """
    file = file_or_shipped(Path(prior), PRIORS)
    drawn_from, recordings = read_prior(file), Path(folder)
    truths = beside(recordings) if truth is None else Path(truth)
    for index in range(first, first + count):
        pair = draw_pair(drawn_from, file, seed, index)
        orders = [
            Order(
                _shortened(scene, frames),
                pair.folder / "scene.yaml",
                Places(recordings / scene.name, truths / scene.name, seal),
            )
            for scene in (pair.gauge, pair.field)
        ]
        gauge, field = _produced(orders, progress)
        yield gauge, field


def _shortened(scene: Scene, frames: int | None) -> Scene:
    return scene if frames is None else scene.model_copy(update={"frames": min(frames, scene.frames)})


def _produced(orders: Sequence[Order], progress: Progress | None) -> list[Simulated]:
    def tell(order: Order, done: int) -> None:
        if progress is not None:
            progress(order.scene.name, done, order.scene.frames)

    found = produce(orders, tell)
    return [
        Simulated(o.places.recording, o.places.truth, o.scene.frames, o.places.sealed, premises)
        for o, premises in zip(orders, found, strict=True)
    ]
