"""``run --follow`` while a recording is written at the camera's pace: how far the live page lags behind.

A thread writes a copy of a recording as a recorder would, and the program follows it. The lag of a frame
lasts from its writing until the live page shows its section; for the last frames it includes the wait until
the recording counts as complete.

usage: python -m tests.benchmarks.bench_follow [RECORDING] [--pace FACTOR]
"""

import argparse
import csv
import shutil
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path
from unittest.mock import patch

import av
import numpy as np
from rich.console import Console

import pipeline.commands.follow as command
from pipeline.recording import open_recording
from tests.shared_data import PROJECT_ROOT

QUIET_S, GRAIN_S = 3.0, 1 / 30


def packet_ends(video):
    """Return when the recorder has each packet, s from the first, and where it ends in the file, bytes."""
    with av.open(str(video)) as container:
        stream = container.streams.video[0]
        packets = [(p.dts if p.dts is not None else p.pts, p.pos) for p in container.demux(stream) if p.size]
        unit = float(stream.time_base)
    time_s = np.array([(dts - packets[0][0]) * unit for dts, _ in packets])
    return time_s, np.array([*(pos for _, pos in packets[1:]), video.stat().st_size])


def write_at_pace(source, place, pace, written):
    """Write frames, table and encoder of ``source`` into ``place`` at the given pace; record the times."""
    tables = {name: rows(source / name) for name in ("frames.csv", "encoder.csv")}
    done = dict.fromkeys(tables, 0)
    time_s, end = packet_ends(source / "frames.mkv")
    with ExitStack() as stack:
        data = stack.enter_context((source / "frames.mkv").open("rb"))
        video = stack.enter_context((place / "frames.mkv").open("ab"))
        out = {name: stack.enter_context((place / name).open("a")) for name in tables}
        start = time.monotonic()
        while video.tell() < end[-1]:
            now = pace * (time.monotonic() - start)
            for name, (times, lines) in tables.items():
                upto = int(np.searchsorted(times, now, "right"))
                out[name].writelines(lines[done[name] : upto])
                out[name].flush()
                done[name] = max(done[name], upto)
            there = int(np.searchsorted(time_s, now, "right"))
            video.write(data.read(int(end[there - 1]) - video.tell()))
            video.flush()
            written.append((time.monotonic(), there))
            time.sleep(GRAIN_S)


def rows(table):
    """Return times and lines of a table; the header belongs to the first line."""
    head, *lines = table.read_text().splitlines(keepends=True)
    column = next(csv.reader([head])).index("time_s")
    times = np.array([float(next(csv.reader([line]))[column]) for line in lines])
    return times - times[0], [head + lines[0], *lines[1:]]


def follow_paced(source, pace):
    """Return the times of written frames, the pages (time, last frame on it), and the CPU time."""
    written, pages, write = [], [], command.write_live_page
    with tempfile.TemporaryDirectory() as name:
        place = Path(name) / "recording"
        place.mkdir()
        for file in ("recording.yaml", "probe.yaml"):
            shutil.copy(source / file, place / file)

        def noted(title, sections, *rest):
            write(title, sections, *rest)
            pages.append((time.monotonic(), sections[-1].frame if sections else -1))

        recorder = threading.Thread(target=write_at_pace, args=(source, place, pace, written))
        with patch.object(command, "write_live_page", noted):
            before = time.process_time()
            recorder.start()
            command.follow(place, Path(name) / "run", None, QUIET_S, Console(quiet=True))
            spent = time.process_time() - before
        recorder.join()
    return np.array(written), np.array(pages), spent


def lags(written, pages):
    """Return the lag, s, of the last frame of every new page."""
    fresh = pages[np.flatnonzero(np.diff(pages[:, 1], prepend=-1) > 0)]
    there = np.searchsorted(written[:, 1], fresh[:, 1] + 1)
    return fresh[:, 0] - written[np.minimum(there, len(written) - 1), 0]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    default = PROJECT_ROOT.parent / "shared" / "recordings" / "open-1-field"
    parser.add_argument("recording", type=Path, nargs="?", default=default)
    parser.add_argument("--pace", type=float, default=1.0, help="times the camera's own pace")
    arguments = parser.parse_args()
    written, pages, spent = follow_paced(arguments.recording, arguments.pace)
    frames, rate = int(written[-1, 1]), open_recording(arguments.recording).frame_rate * arguments.pace
    lag = lags(written, pages)
    print(f"{frames} frames written at {rate:.0f} frames/s; {len(lag)} live pages, "
          f"lag median {np.median(lag[:-1]):.2f} s, largest {lag[:-1].max():.2f} s, "
          f"in the last third {lag[2 * len(lag) // 3:-1].max():.2f} s")  # fmt: skip
    print(f"processor time {spent:.1f} s, {1000 * spent / frames:.1f} ms a frame: "
          f"two cores would keep up with {2 * frames / spent:.0f} frames/s")  # fmt: skip


if __name__ == "__main__":
    main()
