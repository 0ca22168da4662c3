"""Every constant that affects a result says beside it where it comes from, or is listed in data/debts.md."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.shared_data import PROJECT_ROOT

# Units, signs, layouts and limits on time: no measurement and no finding depends on them.
NO_DECISIONS = {
    "_AZIMUTH", "_BIN_LEVELS", "_BUSY_S", "_INCH_MM", "_LEFT", "_OUTSIDE", "_QUARTER_TURNS", "_REFERENCE_MM",
    "_SIDES", "_STEP_MM", "_TIME", "_UNITS_MM", "_WAVES", "_WIDTH", "_ZERO", "DIRECTION", "HALF_TURN_ABOUT_X",
    "WIDTH",
}  # fmt: skip
# Values that need no reason where something is compared with them.
PLAIN = (0.5, 1.0, 2.0, 1.4826)
NAME = re.compile(r"_?[A-Z][A-Z0-9_]*")


def unexplained(text: str, listed: set[str]) -> Iterator[str]:
    """Yield constants of a module that hold a decimal number without a reason beside them or in the list."""
    lines = text.splitlines()
    for node in ast.parse(text).body:
        if not isinstance(node, ast.Assign) or not any(is_decimal(part) for part in ast.walk(node.value)):
            continue
        names = {n.id for target in node.targets for n in ast.walk(target) if isinstance(n, ast.Name)}
        if all(NAME.fullmatch(n) for n in names) and not names & listed and not is_explained(node, lines):
            yield f"{node.lineno}: {', '.join(sorted(names))}"


def unexplained_limits(text: str) -> Iterator[str]:
    """Yield decimals that a function compares with, without a comment on their line or on the one above.

    Halves, ones and twos, guards of divisions (below 1e-5) and 1.4826 (MAD to σ) need none.
    """
    lines = text.splitlines()
    functions = [n for n in ast.walk(ast.parse(text)) if isinstance(n, ast.FunctionDef)]
    compared = {c for f in functions for c in ast.walk(f) if isinstance(c, ast.Compare)}
    for part in {p for c in compared for p in ast.walk(c) if is_decimal(p)}:
        value = abs(ast.literal_eval(part))
        explained = any("#" in line for line in lines[part.lineno - 2 : part.lineno])
        if value >= 1e-5 and value not in PLAIN and not explained:
            yield f"{part.lineno}: {value}"


def is_decimal(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, float)


def is_explained(node: ast.Assign, lines: list[str]) -> bool:
    """Return whether there is a comment in its lines or above its block, or a docstring below it."""
    above = node.lineno - 2
    while above >= 0 and re.match(r"_?[A-Z][A-Z0-9_]*( = |, )", lines[above]):
        above -= 1
    own, below = lines[node.lineno - 1 : node.end_lineno], lines[node.end_lineno or 0 :][:1]
    return (
        any("#" in line for line in own)
        or (above >= 0 and lines[above].startswith("#"))
        or any(line.startswith('"""') for line in below)
    )


def test_every_decimal_constant_has_its_reason() -> None:
    debts = (PROJECT_ROOT / "data" / "debts.md").read_text("utf-8")
    listed = NO_DECISIONS | set(re.findall(r"`(_?[A-Z][A-Z0-9_]*)`", debts))
    files = [f for package in ("pipeline", "stages") for f in (PROJECT_ROOT / package).rglob("*.py")]
    found = [
        f"{f.relative_to(PROJECT_ROOT)}:{c}" for f in files for c in unexplained(f.read_text("utf-8"), listed)
    ]
    assert found == [], "write its source beside it, or list it in data/debts.md"


def test_every_limit_inside_a_function_has_its_reason() -> None:
    files = [f for package in ("pipeline", "stages") for f in (PROJECT_ROOT / package).rglob("*.py")]
    found = [
        f"{f.relative_to(PROJECT_ROOT)}:{c}" for f in files for c in unexplained_limits(f.read_text("utf-8"))
    ]
    assert found == [], "write above it where the number comes from, or give it a name"


def test_a_planted_limit_without_a_reason_is_found() -> None:
    assert list(unexplained_limits("def f(x):\n    return x > 0.3 * 7\n")) == ["2: 0.3"]
    for line in ("x > 0.3  # chosen", "x > 0.5", "x < 1e-9", "0.3 * x"):
        assert list(unexplained_limits(f"def f(x):\n    return {line}\n")) == []


def test_every_listed_debt_is_of_an_existing_constant() -> None:
    debts = (PROJECT_ROOT / "data" / "debts.md").read_text("utf-8")
    files = [f for package in ("pipeline", "stages") for f in (PROJECT_ROOT / package).rglob("*.py")]
    there = set(NAME.findall("\n".join(f.read_text("utf-8") for f in files)))
    assert sorted(set(re.findall(r"`(_?[A-Z][A-Z0-9_]*)`", debts)) - there) == [], "remove its row"


def absent_debts(debts: str, files: list[Path]) -> Iterator[str]:
    """Yield listed constants that none of the files or folders in their row contains."""
    for row in (line.split("|") for line in debts.splitlines()):
        places = re.findall(r"`([\w/]+(?:\.py|/|/\*\.py))`", row[2]) if len(row) > 4 else []
        ends = tuple(f"/{place.removesuffix('*.py')}" for place in places)
        own = [f for f in files if any(f"/{f.parent}/".endswith(e) or f"/{f}".endswith(e) for e in ends)]
        there = set(NAME.findall("\n".join((PROJECT_ROOT / f).read_text("utf-8") for f in own)))
        if places:
            yield from sorted(set(re.findall(r"`(_?[A-Z][A-Z0-9_]*)`", row[1])) - there)


def test_every_listed_debt_stands_in_the_files_of_its_row() -> None:
    debts = (PROJECT_ROOT / "data" / "debts.md").read_text("utf-8")
    files = [
        f.relative_to(PROJECT_ROOT) for p in ("pipeline", "stages") for f in (PROJECT_ROOT / p).rglob("*.py")
    ]
    assert list(absent_debts(debts, files)) == [], "remove the row, or name the file of the constant"
    planted = "| `_BELL` 3 | `rings/kernels.py` | nothing | M |"
    assert list(absent_debts(planted, files)) == ["_BELL"]


def test_a_planted_constant_without_a_reason_is_found() -> None:
    assert list(unexplained("import math\n_LIMIT = 0.3\n", set())) == ["2: _LIMIT"]
    assert list(unexplained("_A, _B = 1, math.radians(1.2)\n", set())) == ["1: _A, _B"]
    for text in ("# Chosen.\n_LIMIT = 0.3\n", "_LIMIT = 0.3  # chosen\n", '_LIMIT = 0.3\n"""Chosen."""\n'):
        assert list(unexplained(text, set())) == []
    assert list(unexplained("_LIMIT = 0.3\n", {"_LIMIT"})) == []


def test_the_list_of_debts_names_existing_files() -> None:
    rows = [r.split("|") for r in (PROJECT_ROOT / "data" / "debts.md").read_text("utf-8").splitlines()]
    named = {n for row in rows if len(row) > 4 for n in re.findall(r"`([\w/]+\.py)`", row[2])}
    there = [str(Path("/") / f.relative_to(PROJECT_ROOT)) for f in PROJECT_ROOT.glob("[ps]*/**/*.py")]
    assert named > {"claims.py"}
    assert [n for n in sorted(named) if not any(f.endswith(f"/{n}") for f in there)] == []
