"""Settings of a run that exclude dirt and drops, which a twin found, from photo and rings."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from pipeline.errors import InputError
from pipeline.files.json_yaml import read_json

_PLACE = ("u_px", "v_px", "radius_px")
# A spot reaches beyond the radius at which it was found. Derived for Gaussian spots that take 10 to 50 %:
# their change falls to 3 %, where they are found, at 1.5 to 2.4 of their σ, and to 1 % at 2.1 to 2.8.
_WIDER = 1.5
# At the radius found for a drop, texture is still displaced by 0.3 px; most of that ends within a quarter
# more.
_WIDER_DROP = 1.2
# 1 σ of a sharp line, and its largest displacement by a rim: light that changes by a share g per px across a
# line of width w moves it by g w². A ring's sample is measured to about as much.
_LINE_PX, _MOVED_PX = 1.2, 0.03


def dirt_of(twin: Path | str | None) -> tuple[str, ...]:
    """Return the settings that exclude from photo and rings what a twin found on window or lens.

    A speck that dims both flanks of the line equally does not displace it, and stays in the rings.

    Raises
    ------
    InputError
        When the folder holds no twin.json, or a broken one.
    """
    if twin is None:
        return ()
    file = Path(twin) / "twin.json"
    try:
        on_image = [m for m in read_json(file)["found"] if m["fixed_to"] == "image" and "u_px" in m["place"]]
        places = [[float(m["place"][k]["value"]) for k in _PLACE] for m in on_image]
        moved = [_moves_line(m, p[2]) for m, p in zip(on_image, places, strict=True)]
        more = [_WIDER_DROP if "aside" in m["parameters"] else _WIDER for m in on_image]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(
            file, "is not a result of boresight twin", expected="its twin.json", hint="state its folder"
        ) from error
    wider = [[u, v, by * r] for by, (u, v, r) in zip(more, places, strict=True)]
    of_line = [p for p, m in zip(wider, moved, strict=True) if m]
    return f"texture.left_out={json.dumps(wider)}", f"rings.left_out={json.dumps(of_line)}"


def _moves_line(found: dict[str, Any], radius_px: float) -> bool:
    """Return whether a finding on the window moves the line: a drop, or a rim that is steep for its width."""
    if found["name"] is None or "glint" in found["name"].split(" or "):
        return bool(found["channel"] == "line")  # mirrored LEDs do not show in laser frames
    share = found["parameters"].get("share")
    if share is None:
        return True
    return abs(float(share["value"])) / radius_px * _LINE_PX**2 > _MOVED_PX
