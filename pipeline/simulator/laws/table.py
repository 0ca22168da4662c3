"""Table of agreement between the laws of the physics notes and what was traced or rendered.

``python -m pipeline.simulator.laws.table [FILE]`` writes it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

from pipeline.simulator.laws import EXPONENT_TOLERANCE, Check
from pipeline.simulator.laws.light import light_checks
from pipeline.simulator.laws.moving import moving_checks, odometry_checks
from pipeline.simulator.laws.radius import ghost_checks, radius_checks

_HEAD = """# Laws of the known effects against traced and rendered rings

Made by `python -m pipeline.simulator.laws.table`; nothing here is written by hand. The bench is the
instrument of the physics notes: baseline 22 mm, equidistant lens of 360 px/rad, line of 0.15 mm, in a
smooth round pipe. Radius errors are apparent less true, along the effect's crest. Rays are traced one by
one through the true camera, its windows by Snell's law, to the wall and the sheet; light is taken from the
render engine. ✓ and ○ are the notes' own marks: checked there against a ray trace, or derived only. The
tolerance is what the terms of second order, which a law leaves out, may make at this size. The exponent is
the slope of ln |δr| over ln r from 25.4 to 50.8 mm, and agrees within {exponent:g}.

{summary}

| effect | | law | compared | law says | computed | ± | harmonic | exponent | verdict |
|---|---|---|---|---|---|---|---|---|---|
"""


def all_checks() -> Iterator[Check]:
    """Yield every check."""
    yield from radius_checks()
    yield from moving_checks()
    yield from odometry_checks()
    yield from light_checks()
    yield from ghost_checks()


def table_text(checks: Sequence[Check]) -> str:
    """Return the table as Markdown."""
    agreeing = sum(check.agrees for check in checks)
    names = len({check.name for check in checks})
    summary = f"{agreeing} of {len(checks)} figures of {names} effects and states agree with their law."
    if agreeing < len(checks):
        wrong = ", ".join(dict.fromkeys(f"`{c.name}`" for c in checks if not c.agrees))
        summary += f" The laws of {wrong} do not hold as written; the last column has those that do."
    head = _HEAD.format(exponent=EXPONENT_TOLERANCE, summary=summary)
    return head + "".join(_row(check) for check in checks)


def _row(check: Check) -> str:
    harmonic = "" if check.harmonic is None else f"{check.harmonic[0]} → {check.harmonic[1]}"
    exponent = "" if check.exponent is None else f"{check.exponent[0]:.2f} → {check.exponent[1]:.2f}"
    cells = (
        f"`{check.name}`" if "_" in check.name or check.name == "baseline" else check.name,
        check.mark, check.law, check.of, _size(check.predicted, check), _size(check.computed, check),
        f"{check.tolerance:.1g}", harmonic, exponent, verdict(check),
    )  # fmt: skip
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |\n"


def verdict(check: Check) -> str:
    """Return in words whether a law holds, and the right law where it does not."""
    if check.agrees:
        return "holds"
    if check.mended_agrees and check.mended_value is not None:
        return f"**does not hold**; {check.mended} ({_size(check.mended_value, check)}, holds)"
    return "**does not hold**"


def _size(value: float, check: Check) -> str:
    return f"{value:.4g} {check.unit}".strip()


if __name__ == "__main__":
    file = Path(sys.argv[1]) if len(sys.argv) > 1 else Path("data/effects/laws.md")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(table_text(list(all_checks())), "utf-8")
