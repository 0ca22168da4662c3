"""frames.csv, encoder.csv and imu.csv."""

from __future__ import annotations

import csv
import difflib
import io
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from pipeline.arrays import Float
from pipeline.errors import InputError
from pipeline.recording.base import Encoder, FrameTable, Illumination, Imu
from pipeline.recording.checks import refuse_backward

FRAME_COLUMNS = ("frame", "time_s", "illumination")
ENCODER_COLUMNS = ("time_s", "distance_mm")
IMU_COLUMNS = ("time_s", "gx", "gy", "gz", "ax", "ay", "az")
# A gyroscope of 4000 °/s and an accelerometer of 20 g are beyond what probes carry: such figures are in
# another unit, as °/s (some hundred) and mg (1000 at rest) are.
_LARGEST_RATE_RAD_S, _LARGEST_FORCE_M_S2 = 70.0, 200.0
# At rest an accelerometer shows 9.8 m/s²; one that shows less than 2 in the median was written in g.
_LEAST_FORCE_M_S2 = 2.0
_OTHER_SEPARATORS = {";": "semicolons", "\t": "tabs"}
# About ten million lines: four days at 30 frames/s.
LARGEST_BYTES = 256 << 20
_KINDS = tuple(k.value for k in Illumination)


def read_frame_table(file: Path) -> FrameTable:
    """Read ``frame,time_s,illumination``; frame numbers must rise, times must not run backwards.

    Raises
    ------
    InputError
        With the line of what is missing, mistyped, not finite or out of order.
    """
    return frame_table(file, _text(file, FRAME_COLUMNS))


def frame_table(file: Path, text: str) -> FrameTable:
    """Return the table of frames that ``text`` of a file holds; raises as `read_frame_table`."""
    frame, time_s, illumination = [], [], []
    for line, (number, time, light) in _rows(file, text, FRAME_COLUMNS):
        frame.append(_whole(file, line, "frame", number))
        time_s.append(_finite(file, line, "time_s", time))
        illumination.append(_light(file, line, light))
    if not frame:
        raise InputError(file, "lists no frames", expected="one line for each frame")
    refuse_backward(file, frame, "frame", strictly=True)
    refuse_backward(file, time_s, "time_s", strictly=False)
    return FrameTable(np.array(frame, np.int64), np.array(time_s), np.array(illumination, np.str_))


def read_encoder(file: Path) -> Encoder:
    """Read ``time_s,distance_mm``; times must not run backwards.

    Raises
    ------
    InputError
        As `read_frame_table`; also with fewer than two lines.
    """
    return encoder_readings(file, _text(file, ENCODER_COLUMNS))


def encoder_readings(file: Path, text: str) -> Encoder:
    """Return the readings that ``text`` of a file holds; raises as `read_encoder`."""
    table = _readings(file, text, ENCODER_COLUMNS, "encoder")
    refuse_backward(file, table[:, 0].tolist(), "time_s", strictly=False)
    return Encoder(table[:, 0], table[:, 1])


def read_imu(file: Path) -> Imu:
    """Read ``time_s,gx,gy,gz,ax,ay,az`` in s, rad/s and m/s²; times must rise.

    Raises
    ------
    InputError
        As `read_encoder`; also where rates or forces can only be in another unit.
    """
    return imu_readings(file, _text(file, IMU_COLUMNS))


def imu_readings(file: Path, text: str) -> Imu:
    """Return the readings that ``text`` of a file holds; raises as `read_imu`."""
    table = _readings(file, text, IMU_COLUMNS, "imu")
    refuse_backward(file, table[:, 0].tolist(), "time_s", strictly=True)
    imu = Imu(table[:, 0], table[:, 1:4], table[:, 4:])
    refuse_other_units(file, imu)
    return imu


def _readings(file: Path, text: str, columns: Sequence[str], key: str) -> Float:
    """Return the numbers (N, K) of a table that a recording names by ``key``, at least two lines of them."""
    rows = [
        [_finite(file, line, name, cell) for name, cell in zip(columns, cells, strict=True)]
        for line, cells in _rows(file, text, columns)
    ]
    if len(rows) < 2:
        raise InputError(
            file, f"has {len(rows)} readings", expected="at least 2",
            hint=f"remove the key {key} from recording.yaml to run without one",
        )  # fmt: skip
    return np.array(rows)


def refuse_other_units(file: Path, imu: Imu) -> None:
    """Raise `InputError` where rates can only be in °/s, or forces only in g or mg."""
    rate = float(np.abs(imu.rate_rad_s).max())
    force = float(np.median(np.linalg.norm(imu.force_m_s2, axis=1)))
    if rate > _LARGEST_RATE_RAD_S:
        raise InputError(
            file, f"a rate is {rate:.4g} rad/s", expected=f"rates up to {_LARGEST_RATE_RAD_S:g} rad/s",
            hint="state rates in rad/s: 1 °/s is 0.01745 rad/s",
        )  # fmt: skip
    if not _LEAST_FORCE_M_S2 <= force <= _LARGEST_FORCE_M_S2:
        raise InputError(
            file, f"the accelerometer usually shows {force:.4g} m/s²", expected="about 9.8 m/s²",
            hint="state the specific force in m/s², gravity included: 1 g is 9.80665 m/s²",
        )  # fmt: skip


def _text(file: Path, columns: Sequence[str]) -> str:
    try:
        size = file.stat().st_size
        if size > LARGEST_BYTES:
            raise InputError(file, f"is {size} bytes long", expected=f"at most {LARGEST_BYTES} bytes")
        return file.read_text("utf-8-sig")
    except OSError as error:
        raise InputError(file, f"cannot be read ({error.strerror})", expected=",".join(columns)) from error
    except UnicodeDecodeError as error:
        raise InputError(file, "is not UTF-8 text", expected=",".join(columns)) from error


def _rows(file: Path, text: str, columns: Sequence[str]) -> Iterator[tuple[int, list[str]]]:
    """Yield (line number, cells in the order of ``columns``)."""
    rows = csv.reader(io.StringIO(text, newline=""))
    try:
        header = [h.strip() for h in next(rows, [])]
        order = [_column(file, header, c) for c in columns]
        for cells in rows:
            if not any(c.strip() for c in cells):
                continue
            if len(cells) != len(header):
                raise InputError(
                    file, f"has {len(cells)} cells", place=f"line {rows.line_num}",
                    expected=f"{len(header)} as in the first line",
                    hint="the file may have been cut off while it was written",
                )  # fmt: skip
            yield rows.line_num, [cells[i].strip() for i in order]
    except csv.Error as error:
        raise InputError(file, f"is not a CSV file: {error}", place=f"line {rows.line_num}") from error


def _column(file: Path, header: list[str], name: str) -> int:
    if name in header:
        return header.index(name)
    near = difflib.get_close_matches(name, header, 1)
    first = ",".join(header)
    parted_by = next((word for mark, word in _OTHER_SEPARATORS.items() if mark in first), "")
    hint = f"is {near[0]} meant?" if near else f"add the column; the first line is {first[:80]!r}"
    if parted_by:
        hint = (
            f"columns are separated by {parted_by}: save the file with commas between, and points in decimals"
        )
    raise InputError(
        file, f"has no column {name}", place="line 1", expected="a first line that names the columns",
        hint=hint,
    )  # fmt: skip


def _finite(file: Path, line: int, name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(file, f"{name} is {text!r}", place=f"line {line}", expected="a finite number")
    return value


def _whole(file: Path, line: int, name: str, text: str) -> int:
    if not (text.isascii() and text.isdigit() and len(text) < 10):
        raise InputError(file, f"{name} is {text!r}", place=f"line {line}", expected="a whole number from 0")
    return int(text)


def _light(file: Path, line: int, text: str) -> str:
    if text not in _KINDS:
        near = difflib.get_close_matches(text, _KINDS, 1)
        raise InputError(
            file, f"illumination is {text!r}", place=f"line {line}", expected=f"one of {', '.join(_KINDS)}",
            hint=f"did you mean {near[0]}?" if near else "",
        )  # fmt: skip
    return text
