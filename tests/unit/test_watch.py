"""The present stage of a run, as the benchmarks read it from its log."""

from pathlib import Path

from tests.benchmarks.watch import Progress


def test_time_of_exported_files_is_not_counted_for_the_stage_that_runs_with_them(tmp_path: Path) -> None:
    log = tmp_path / "run.log"
    at, told = Progress(log), []
    for line in (
        "", "stage rings starts, key 1", "stage rings completed, 1.0 s", "writing rings.zarr",
        "stage mesh starts, key 2", "stage defects starts, key 3", "wrote rings.zarr, 0.1 s",
        "stage mesh completed, 1.0 s", "stage defects completed, 1.0 s",
    ):  # fmt: skip
        with log.open("a") as file:
            file.write(f"2026-01-01 00:00:00,000 INFO {line}\n")
        told.append(at())
    assert told == [
        "start", "rings", "between", "files", "mesh and files", "mesh and defects and files",
        "mesh and defects", "defects", "between",
    ]  # fmt: skip
