from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from pipeline.errors import InputError
from pipeline.files.json_yaml import parse_yaml
from pipeline.recording.tables import read_encoder, read_frame_table, read_imu

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


@relaxed
@given(
    rates=st.lists(st.tuples(*[st.floats(-50, 50)] * 3), min_size=2, max_size=20),
    order=st.permutations(["time_s", "gx", "gy", "gz", "ax", "ay", "az"]),
)
def test_imu_round_trip(tmp_path: Path, rates: list[tuple[float, ...]], order: list[str]) -> None:
    file = tmp_path / "imu.csv"
    names = ["time_s", "gx", "gy", "gz", "ax", "ay", "az"]
    rows = [[0.01 * i, *r, 0.1 * i, -9.8, 0.5] for i, r in enumerate(rates)]
    cells = [",".join(repr(float(r[names.index(n)])) for n in order) for r in rows]
    file.write_text(",".join(order) + "\n" + "\n".join(cells))
    found = read_imu(file)
    table = np.column_stack([found.time_s, found.rate_rad_s, found.force_m_s2])
    np.testing.assert_array_equal(table, np.array(rows))


@pytest.mark.parametrize(
    ("row", "complaint"),
    [
        ("0.02,0,0,0,0,0,-1", "usually shows 1 m/s²"),
        ("0.02,300,0,0,0,0,-9.8", "a rate is 300 rad/s"),
        ("0.00,0,0,0,0,0,-9.8", "time_s goes from 0.01 to 0"),
        ("0.02,0,0,nan,0,0,-9.8", "gz is 'nan'"),
        ("0.02,0,0,0,0,-9.8", "has 6 cells"),
    ],
)
def test_an_imu_with_other_units_or_errors_is_refused_with_its_name(
    tmp_path: Path, row: str, complaint: str
) -> None:
    file = tmp_path / "imu.csv"
    usual = "-1" if complaint.startswith("usually") else "-9.8"
    rows = [f"{t},0,0,0,0,0,{usual}" for t in ("0.00", "0.01")]
    file.write_text("time_s,gx,gy,gz,ax,ay,az\n" + "\n".join([*rows, row]))
    with pytest.raises(InputError) as refused:
        read_imu(file)
    assert complaint in str(refused.value)


@pytest.mark.parametrize("read", [read_frame_table, read_encoder, read_imu])
@relaxed
@given(body=st.text(alphabet='0123456789.,-en"\n\r;laserdboth\x00é', max_size=200))
def test_any_text_is_read_or_refused(tmp_path: Path, read, body: str) -> None:
    file = tmp_path / "table.csv"
    header = {
        read_frame_table: "frame,time_s,illumination\n",
        read_encoder: "time_s,distance_mm\n",
        read_imu: "time_s,gx,gy,gz,ax,ay,az\n",
    }[read]
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
