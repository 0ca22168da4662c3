"""Boresight compared with what people would use instead: one page and one file of figures.

usage: python -m tests.benchmarks.page -o DIR [--recording DIR] [--parts PART ...] [--colmap-limit S]
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import tempfile
from collections.abc import Callable
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

import pipeline.pages
from pipeline.files.provenance import library_versions
from tests.benchmarks.page import meshing, motion, rings, texture, whole
from tests.benchmarks.page.colmap import installed
from tests.benchmarks.page.inputs import prepare
from tests.benchmarks.page.section import Section
from tests.shared_data import PROJECT_ROOT

PARTS = ("rings", "motion", "mesh", "texture", "whole")


def main() -> None:
    arguments = _arguments()
    arguments.output.mkdir(parents=True, exist_ok=True)
    made = _machine() | {"recording": arguments.recording.name}
    with tempfile.TemporaryDirectory() as name:
        work = Path(name)
        print("boresight runs, twice", flush=True)
        inputs = prepare(arguments.recording, work)
        compared = {
            "rings": lambda: rings.section(inputs),
            "motion": lambda: motion.section(inputs),
            "mesh": lambda: meshing.section(inputs),
            "texture": lambda: texture.section(inputs, work / "texture"),
            "whole": lambda: whole.section(inputs, work / "colmap", arguments.colmap_limit),
        }
        sections = [_made(part, compared[part]) for part in arguments.parts]
    write(sections, made, arguments.output)
    print(arguments.output / "page.html")


def _made(part: str, compare: Callable[[], Section]) -> Section:
    print(part, flush=True)
    return compare()


def write(sections: list[Section], made: dict[str, str], folder: Path) -> None:
    """Write ``figures.json`` and ``page.html``."""
    tree = {"made": made, "sections": [_tree(s) for s in sections]}
    (folder / "figures.json").write_text(json.dumps(tree, indent=1, ensure_ascii=False) + "\n", "utf-8")
    places = [Path(__file__).parent, Path(pipeline.pages.__file__).parent]
    environment = Environment(loader=FileSystemLoader(places), undefined=StrictUndefined, autoescape=True)
    environment.filters |= {"figure": _figure, "safe_svg": Markup}
    text = environment.get_template("page.html").render(sections=sections, made=made)
    (folder / "page.html").write_text(text, "utf-8")


def _tree(section: Section) -> dict[str, object]:
    tree = asdict(section)
    del tree["charts"]
    return tree | {"ratios_to_boresight": section.ratios(), "behind": section.behind()}


def _figure(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _machine() -> dict[str, str]:
    info = Path("/proc/cpuinfo")
    lines = info.read_text("ascii").splitlines() if info.exists() else []
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), "unknown")
    others = {"pycolmap": version("pycolmap")} if installed() else {}
    versions = ", ".join(f"{name} {version}" for name, version in (library_versions() | others).items())
    return {
        "when": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "processor": f"{model}, {len(os.sched_getaffinity(0))} cores used",
        "load before": f"{os.getloadavg()[1]:.1f} processes wanting a core over 5 minutes",
        "system": platform.platform(),
        "libraries": versions,
    }


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.page", description=__doc__)
    default = PROJECT_ROOT.parent / "shared" / "recordings" / "open-1-field"
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="DIR")
    parser.add_argument(
        "--recording", type=Path, default=default, metavar="DIR", help="a recording with truth"
    )
    parser.add_argument("--parts", nargs="+", choices=PARTS, default=PARTS, help="all unless named")
    parser.add_argument("--colmap-limit", type=float, default=900.0, metavar="SECONDS")
    return parser.parse_args()


if __name__ == "__main__":
    main()
