"""The layers ("floors") of the program, and the imports that break their order, read from the source text."""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

# From bottom to top. A room may import itself and the rooms of lower floors, never another room of its own
# floor.
# A new room gets a place here and in ARCHITECTURE.md, which shows the same table.
FLOORS: tuple[tuple[str, tuple[str, ...]], ...] = (
    ("words", ("pipeline", "stages", "pipeline.errors", "pipeline.arrays", "pipeline.pages")),
    ("disk and system", ("pipeline.files", "pipeline.system")),
    ("machine and geometry", ("pipeline.machine", "pipeline.geometry")),
    ("adjustment", ("pipeline.adjustment",)),
    ("what is measured, what is known", ("pipeline.artefacts", "pipeline.physics")),
    ("instrument", ("pipeline.instrument",)),
    ("recording", ("pipeline.recording",)),
    ("simulator", ("pipeline.simulator",)),
    (
        "steps of a run",
        (
            "stages.premises", "stages.rings", "stages.triangulate", "stages.accumulate", "stages.texture",
            "stages.mesh", "stages.sections", "stages.defects", "stages.overlays",
        ),
    ),
    (
        "steps built on others",
        ("stages.motion", "stages.calibrate", "stages.preview", "stages.compare"),
    ),
    ("diagnosis", ("stages.diagnose",)),
    ("recorded against re-rendered", ("stages.twin",)),
    ("order of the steps", ("stages.catalogue",)),
    ("files for people", ("pipeline.export",)),
    ("review", ("pipeline.review",)),
    ("many runs", ("pipeline.batch", "pipeline.drill")),
    ("public face", ("pipeline.api",)),
    ("commands", ("pipeline.commands",)),
    ("command line", ("pipeline.cli",)),
)  # fmt: skip
# Only these rooms of `pipeline` put stages together with the rest, so only they import stages.
PUT_TOGETHER = ("pipeline.api", "pipeline.commands", "pipeline.cli")
# Exceptions that are still to be removed, with the day each was noted. Whoever removes one removes its line
# as well:
# an exception that is no longer needed fails the test.
IMPORTS_STILL_THERE: Mapping[tuple[str, str], str] = {}


PRIVATE_STILL_THERE: Mapping[tuple[str, str], str] = {}
_PACKAGES = ("pipeline", "stages")


@dataclass(frozen=True)
class Import:
    """One import: the module that contains it, its line, the imported module, and the imported name."""

    module: str
    line: int
    target: str
    name: str = ""


def imports_below(root: Path) -> list[Import]:
    """Return every import of `pipeline` and `stages` in these two packages below ``root``."""
    files = {_module(f, root): f for package in _PACKAGES for f in root.glob(f"{package}/**/*.py")}
    texts = {module: file.read_text("utf-8") for module, file in sorted(files.items())}
    found = (i for module, text in texts.items() for i in _imports(module, text, set(files)))
    return [i for i in found if i.target.partition(".")[0] in _PACKAGES]


def against_the_floors(imports: list[Import], allowed: Mapping[tuple[str, str], str]) -> list[str]:
    """Return a line for every forbidden import, and one for every exception that is no longer needed."""
    height = {room: floor for floor, (_, rooms) in enumerate(FLOORS) for room in rooms}
    unknown = {room_of(i.module) for i in imports} - set(height)
    wrong = {
        (i.module, i.target): f"{i.module}, line {i.line}: imports {i.target}"
        for i in imports
        if room_of(i.module) in height and not _may(room_of(i.module), room_of(i.target), height)
    }
    return [
        *(f"{room}: this room has no floor: add it to FLOORS in tests/floors.py" for room in sorted(unknown)),
        *(line for pair, line in wrong.items() if pair not in allowed),
        *(f"{m} no longer imports {t}: remove this line here" for m, t in allowed if (m, t) not in wrong),
    ]


def private_names(imports: list[Import], allowed: Mapping[tuple[str, str], str]) -> list[str]:
    """Return a line for every use of another module's private name.

    As in `against_the_floors`, exceptions that are no longer needed get a line too.
    """
    wrong = {
        (i.module, i.name or i.target): f"{i.module}, line {i.line}: takes {i.name} of {i.target}"
        for i in imports
        if any(_is_private(part) for part in (*i.target.split("."), i.name)) and i.target != i.module
    }
    return [
        *(line for pair, line in wrong.items() if pair not in allowed),
        *(f"{m} no longer takes {n}: remove this line here" for m, n in allowed if (m, n) not in wrong),
    ]


def room_of(module: str) -> str:
    """Return the room of a module: its first two names."""
    return ".".join(module.split(".")[:2])


def _may(room: str, other: str, height: Mapping[str, int]) -> bool:
    if other.startswith("stages.") and room.startswith("pipeline") and room not in PUT_TOGETHER:
        return False
    return room == other or height.get(other, len(height)) < height.get(room, len(height))


def _module(file: Path, root: Path) -> str:
    parts = file.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _imports(module: str, text: str, modules: set[str]) -> Iterator[Import]:
    """Yield a module's imports, also those inside functions, and names read from imported modules."""
    bound: dict[str, str] = {}
    tree = ast.parse(text)
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            for alias in node.names:
                bound[alias.asname or alias.name] = alias.name
                yield Import(module, node.lineno, alias.name)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                if whole in modules:
                    bound[alias.asname or alias.name] = whole
                    yield Import(module, node.lineno, whole)
                else:
                    yield Import(module, node.lineno, str(node.module), alias.name)
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in bound:
            yield Import(module, node.lineno, bound[ast.unparse(node.value)], node.attr)


def _is_private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__")
