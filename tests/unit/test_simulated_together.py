"""Recordings that belong together are rendered all or none: there is never half a pair."""

from pathlib import Path

import pytest

from pipeline.errors import UnusableError
from pipeline.simulator import produce as production
from pipeline.simulator.produce import Order, Places, produce
from tests.simulated import SCENES, shipped, smaller


def pair(folder: Path) -> list[Order]:
    scene = smaller(shipped("straight-4-inch"), 4, 4)
    named = [scene.model_copy(update={"name": name}) for name in ("gauge", "field")]
    places = [Places(folder / s.name, folder / f"{s.name}-truth") for s in named]
    return [Order(s, SCENES / "scene.yaml", p) for s, p in zip(named, places, strict=True)]


def refuse_field(monkeypatch: pytest.MonkeyPatch, check: str, told: list[str]) -> None:
    """Let the check of the second recording refuse it."""
    sound = getattr(production, check)

    def refusing(*arguments: object) -> object:
        told.append(check)
        if told.count(check) == 2:
            raise UnusableError("simulate", "its effect would not show")
        return sound(*arguments)

    monkeypatch.setattr(production, check, refusing)


def test_both_recordings_are_rendered_if_both_are_valid(tmp_path: Path) -> None:
    done: list[str] = []
    found = produce(pair(tmp_path), lambda order, frames: done.append(order.scene.name))
    assert len(found) == 2
    assert {p.name for p in tmp_path.iterdir()} == {"gauge", "gauge-truth", "field", "field-truth"}
    assert set(done) == {"gauge", "field"}


@pytest.mark.parametrize("check", ["require_scene", "require_recording"])
def test_no_recording_is_left_if_the_second_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, check: str
) -> None:
    rendered: list[str] = []
    refuse_field(monkeypatch, check, [])
    with pytest.raises(UnusableError, match="would not show"):
        produce(pair(tmp_path), lambda order, frames: rendered.append(order.scene.name))
    assert list(tmp_path.iterdir()) == []
    # errors that can be found without rendering are reported before the first recording is rendered
    assert bool(rendered) == (check == "require_recording")
