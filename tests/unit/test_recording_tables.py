from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.files.yaml_file import parse_yaml
from pipeline.recording.tables import read_encoder, read_frame_table

relaxed = settings(
    max_examples=150, suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None
)


@relaxed
@given(
    steps=st.lists(st.floats(1e-4, 1e3), min_size=1, max_size=30),
    lights=st.lists(st.sampled_from(["laser", "led", "both"]), min_size=30, max_size=30),
)
def test_frame_table_round_trip(tmp_path: Path, steps: list[float], lights: list[str]) -> None:
    times = np.cumsum(steps)
    file = tmp_path / "frames.csv"
    rows = [f"{i},{float(t)!r},{w}" for i, (t, w) in enumerate(zip(times, lights, strict=False))]
    file.write_text("frame,time_s,illumination\n" + "\n".join(rows))
    table = read_frame_table(file)
    np.testing.assert_array_equal(table.time_s, times)
    assert table.illumination.tolist() == lights[: len(times)]


@relaxed
@given(distances=st.lists(st.floats(-1e6, 1e6), min_size=2, max_size=30))
def test_encoder_round_trip(tmp_path: Path, distances: list[float]) -> None:
    file = tmp_path / "encoder.csv"
    rows = [f"{0.01 * i!r},{d!r}" for i, d in enumerate(distances)]
    file.write_text("distance_mm,time_s\n" + "\n".join(",".join(r.split(",")[::-1]) for r in rows))
    np.testing.assert_array_equal(read_encoder(file).distance_mm, distances)


@pytest.mark.parametrize("read", [read_frame_table, read_encoder])
@relaxed
@given(body=st.text(alphabet='0123456789.,-en"\n\r;laserdboth\x00é', max_size=200))
def test_any_text_is_read_or_refused(tmp_path: Path, read, body: str) -> None:
    file = tmp_path / "table.csv"
    header = "frame,time_s,illumination\n" if read is read_frame_table else "time_s,distance_mm\n"
    file.write_bytes((header + body).encode())
    try:
        table = read(file)
    except InputError:
        return
    assert np.all(np.isfinite(table.time_s))
    assert np.all(np.diff(table.time_s) >= 0)


@relaxed
@given(data=st.binary(max_size=200))
def test_any_bytes_are_read_or_refused(tmp_path: Path, data: bytes) -> None:
    file = tmp_path / "table.csv"
    file.write_bytes(data)
    with pytest.raises(InputError):
        read_frame_table(file)


@relaxed
@given(text=st.text(alphabet="ab:-[]{},&*!?|>'\"%@#\n \t0.e1\x00\u2028", max_size=120))
def test_any_yaml_is_a_mapping_or_refused(text: str) -> None:
    try:
        section = parse_yaml(text, Path("some.yaml"))
    except InputError:
        return
    for key in section.values:
        assert isinstance(key, str)
        for getter in (section.number, section.text, section.section):
            with suppress(InputError):
                getter(key)


def test_deep_nesting_is_refused() -> None:
    with pytest.raises(InputError):
        parse_yaml("[" * 3_000, Path("deep.yaml"))
