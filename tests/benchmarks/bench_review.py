"""How fast the review's page is and how much memory it takes, in Chromium without a graphics card.

python -m tests.benchmarks.bench_review RUN for a finished run

python -m tests.benchmarks.bench_review RUN --metres 100 --keep FOLDER for the run repeated to that length

``click`` is the start of the command; the address is opened as soon as it is printed. The first view is
complete when list, wall, section and a part of the model are drawn. Times are by the clock.
"""

from __future__ import annotations

import argparse
import os
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from playwright.sync_api import Browser

from tests.long_run import write_long_run
from tests.review_browser import Tab, chromium, tab
from tests.review_server import ReviewServer

SIZE = {"width": 1280, "height": 720}
# Wall and section have been drawn, and a part of the model is visible.
DRAWN = """!!window.boresight && document.querySelectorAll('.list .row').length > 0
  && [...boresight.flat.picture.tiles.values()].some((t) => t.naturalWidth > 0)
  && document.querySelectorAll('.section path.measured').length > 0"""
MODEL = "boresight.model.parts.length > 0 && boresight.model.frameTimes.length > 0"
FLY = """new Promise((done) => { const m = boresight.model, times = [];
  const step = (now) => { times.push(now); m.fly(0.7); if (times.length < 90) requestAnimationFrame(step);
    else { times.shift(); done(times.slice(1).map((t, k) => t - times[k])); } };
  requestAnimationFrame(step); })"""
DRAW = """(() => { const m = boresight.model, gl = m.renderer.getContext(), pixel = new Uint8Array(4);
  const start = performance.now();
  for (let k = 0; k < 20; k++) { m.eye.camera.position.z -= 0.0007; m.renderer.render(m.scene, m.eye.camera);
    gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); }
  return (performance.now() - start) / 20; })()"""
SIZED = """(() => { const r = boresight.model.renderer;
  if (%s) { r.setPixelRatio(1); r.setSize(%s, %s, false); } })()"""
NEXT = """(() => { const start = performance.now();
  boresight.session.select(boresight.session.standing.at(-1).id);
  return performance.now() - start; })()"""


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", type=Path)
    parser.add_argument("--metres", type=float, default=0.0)
    parser.add_argument(
        "--coarser", type=int, default=2, help="keep every n-th cell and texel of a repeated run"
    )
    parser.add_argument("--keep", type=Path, help="where the repeated run is written, or already lies")
    given = parser.parse_args()
    with TemporaryDirectory() as folder:
        run = given.run
        if given.metres:
            run = given.keep or Path(folder) / "long"
            if not run.exists():
                write_long_run(given.run, run, 1000 * given.metres, given.coarser)
        measure(run)


def measure(run: Path) -> None:
    """Open a run and print the results."""
    with chromium() as browser:
        start = time.perf_counter()
        with ReviewServer(run) as server:
            told = time.perf_counter()
            print(
                f"{'server answers after':34} {told - start:8.2f} s, CPU {cpu_of(server.process.pid):.2f} s"
            )
            for name in ("first opening", "opened again"):
                opened(browser, server, name, told - start)
            print(f"{'server, its own memory':34} {held(server.process.pid, 'Pss_Anon') / 2**20:8.0f} MiB")


def opened(browser: Browser, server: ReviewServer, name: str, before: float) -> None:
    """Open the page in a new tab and measure it."""
    context = browser.new_context(viewport=SIZE)
    with tab(context, server.origin) as page:
        begin, busy = time.perf_counter(), (cpu_of(server.process.pid), cpu_s())
        page.page.goto(server.address)
        page.until(DRAWN, 120)
        first = time.perf_counter() - begin
        served, shown = cpu_of(server.process.pid) - busy[0], cpu_s() - busy[1]
        print(f"{name + ': CPU so far':34} {served:8.2f} s of the server, {shown:.2f} s of Chromium")
        page.until(MODEL, 120)
        model = time.perf_counter() - begin
        page.until("boresight.model.isReady", 300)
        whole = time.perf_counter() - begin
        again = name != "first opening"
        print(
            f"{name + ': list, wall, section':34} {first:8.2f} s"
            + ("" if again else f"   from the click {before + first:.2f} s")
        )
        print(
            f"{name + ': model too':34} {model:8.2f} s"
            + ("" if again else f"   from the click {before + model:.2f} s")
        )
        print(f"{name + ': all wanted detail':34} {whole:8.2f} s")
        if again:
            drawing(page)
            memory(page)
    context.close()


def drawing(page: Tab) -> None:
    """Print how fast the model turns, in its pane and over the whole window."""
    triangles = page.js("boresight.model.parts.reduce((n, p) => n + p.mesh.geometry.index.count / 3, 0)")
    print(f"{'triangles in detail':34} {triangles:8.0f}")
    for name, width, height in (("pane", 0, 0), ("1280 x 720", 1280, 720), ("320 x 180", 320, 180)):
        page.js(SIZED % (width, width, height))
        steps = sorted(page.js(FLY))
        busy = cpu_s()
        render = page.js(DRAW)
        busy = 1000 * (cpu_s() - busy) / 20
        print(f"{'flight, ' + name:34} {1000 / steps[len(steps) // 2]:8.1f} frames/s (median)")
        print(f"{'one picture, ' + name:34} {render:8.1f} ms, {busy:.1f} ms of CPU over all threads")
    print(f"{'next finding, on the page':34} {page.js(NEXT):8.0f} ms")


def memory(page: Tab) -> None:
    """Print the tab's memory after a passage through the whole pipe."""
    first, last = page.js("boresight.session.run.distance_mm")
    for k in range(12):
        page.js(f"boresight.session.moveTo([{first + (last - first) * (k + 0.5) / 12}, 0])")
        page.until("boresight.model.isReady", 120)
    page.js("boresight.session.show('deviation')")
    page.page.wait_for_timeout(1500)
    heap = page.page.context.new_cdp_session(page.page).send("Runtime.getHeapUsage")
    print(f"{'JavaScript heap':34} {heap['usedSize'] / 2**20:8.0f} MiB")
    for kind, size in sorted(by_kind().items()):
        print(f"{'Chromium ' + kind + ', largest resident':34} {size / 2**20:8.0f} MiB")


def by_kind() -> dict[str, float]:
    """Return the largest private memory of each kind of Chromium process below this one."""
    found: dict[str, float] = {}
    for process in descendants(os.getpid()):
        words = command(process)
        kind = next((w.removeprefix("--type=") for w in words if w.startswith("--type=")), "")
        if kind in ("renderer", "gpu-process"):
            found[kind] = max(found.get(kind, 0.0), held(process, "Pss"))
    return found


def cpu_s() -> float:
    """Return the CPU time that all processes of Chromium have taken."""
    own = [p for p in descendants(os.getpid()) if any("--type=" in w for w in command(p))]
    return sum(map(cpu_of, own))


def cpu_of(pid: int) -> float:
    """Return the CPU time that a process has taken."""
    after_name = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(after_name[11]) + int(after_name[12])) / os.sysconf("SC_CLK_TCK")


def descendants(pid: int) -> list[int]:
    """Return all processes below one."""
    below = [
        int(c) for t in Path(f"/proc/{pid}/task").iterdir() for c in (t / "children").read_text().split()
    ]
    return [*below, *(d for child in below for d in descendants(child))]


def command(pid: int) -> list[str]:
    return Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").replace("\0", " ").split()


def held(pid: int, which: str) -> float:
    """Return memory, bytes, of a process.

    ``Pss`` with its share of common pages, or ``Pss_Anon``, its own.
    """
    for line in Path(f"/proc/{pid}/smaps_rollup").read_text().splitlines():
        if line.startswith(f"{which}:"):
            return 1024 * float(line.split()[1])
    return 0.0


if __name__ == "__main__":
    main()
