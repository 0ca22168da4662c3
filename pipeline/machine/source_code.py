"""The program text that a stage's result depends on, so that no result outlives the code that made it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from pipeline.files.codec import OWN_PACKAGES

_IMPORT = re.compile(
    r"^[ \t]*(?:from\s+([\w.]+)\s+import\s+(\([^)]*\)|[^\n]*)|import\s+([^\n]*))", re.MULTILINE
)


def source_digest(function: Callable[..., Any]) -> str:
    """Return a SHA-256 of a function's module and of all modules of this program that it imports.

    Only what lies in the packages ``pipeline``, ``stages`` and the function's own counts: libraries are
    pinned by the lock file. Imports are followed as written, also those inside functions.
    """
    packages = {*OWN_PACKAGES, function.__module__.partition(".")[0]}
    texts: dict[str, str] = {}
    waiting = [function.__module__]
    while waiting:
        name = waiting.pop()
        if name in texts or name.partition(".")[0] not in packages:
            continue
        text = _source(name)
        if text is not None:
            texts[name] = text
            waiting.extend([name.rpartition(".")[0], *_imported(text)])
    total = hashlib.sha256()
    for name, text in sorted(texts.items()):
        total.update(name.encode() + b"\0" + hashlib.sha256(text.encode()).digest())
    return total.hexdigest()


def _source(module: str) -> str | None:
    """Return a module's text; None when there is no such module, or no text of it."""
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):
        return None
    if spec is None or spec.origin is None or not spec.origin.endswith(".py"):
        return None
    return Path(spec.origin).read_text(encoding="utf-8")


def _imported(text: str) -> Iterator[str]:
    """Yield the modules, and what may be modules, that a text imports."""
    for package, names, modules in _IMPORT.findall(text):
        yield from re.findall(r"[\w.]+", modules)
        if package:
            yield package
            yield from (f"{package}.{name}" for name in re.findall(r"\w+", names))
