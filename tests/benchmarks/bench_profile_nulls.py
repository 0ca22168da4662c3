"""Recordings without any effect on the line's light, but with degraded pictures.

Every claim is a false alarm. usage: python -m tests.benchmarks.bench_profile_nulls OUT.jsonl [--cases N]
[--seed N]

Each case takes a recording of another renderer in which the line's light is ordinary, draws image conditions
(codec, response, defocus, exposure that clips, noise), encodes its laser frames again, and examines the
line's profile. OUT.jsonl gets a line for each case, with what was found and every p-value; cases that have a
line are not repeated. At the end the false claims are counted, and the p-values are tested for uniformity
(Kolmogorov and Smirnov).
"""

from __future__ import annotations

import argparse
import csv
import json
import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import av
import cv2
import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.stats import kstest

from pipeline.errors import UnusableError
from pipeline.instrument.probe_file import read_probe
from pipeline.recording import open_recording
from stages.diagnose.profile.evidence import profile_evidence
from stages.rings import RingParameters, extract_rings
from tests.quiet import quiet_context
from tests.shared_data import shared

SOURCES = (
    "open-1-gauge", "blind-a/a10-gauge", "blind-a/a01-gauge",
    "open-1-field", "blind-a/a10-field", "blind-a/a01-field",
)  # fmt: skip
MOST_FRAMES = 90
# A response changes the line's width by a known law: to report it is not a false alarm.
TRUE_OF_GAMMA = frozenset({"gamma", "albedo_bias"})


@dataclass(frozen=True)
class Condition:
    """What is done to the pictures; neutral values leave them as they are.

    Attributes
    ----------
    crf : quality of H.264; larger is worse.
    gamma : grey = light to the power 1 / gamma.
    defocus_px : 1 σ of a blur.
    gain : factor on the light, clipped at full scale.
    noise : variance over the grey level.
    """

    crf: int = 18
    gamma: float = 1.0
    defocus_px: float = 0.0
    gain: float = 1.0
    noise: float = 0.0


@dataclass(frozen=True)
class Case:
    """A recording, the conditions drawn for it, and the seed of its noise."""

    source: str
    condition: Condition
    seed: int

    @property
    def name(self) -> str:
        """Return a file name of the case."""
        return f"{Path(self.source).name}-{self.seed}"


def drawn(count: int, seed: int) -> Iterator[Case]:
    """Yield cases; the first of each recording is only encoded again."""
    random = np.random.default_rng(seed)
    for k in range(count):
        condition = Condition(
            int(random.choice([18, 23, 28, 34])),
            float(random.choice([1.0, 1.0, 1.0, 1.5, 2.2])),
            float(random.choice([0.0, 0.0, 0.8, 1.5])),
            float(random.choice([0.6, 1.0, 1.0, 2.0, 4.0])),
            float(random.choice([0.0, 0.0, 0.25, 1.0])),
        )
        source = SOURCES[k % len(SOURCES)]
        yield Case(source, condition if k >= len(SOURCES) else Condition(), 1000 * seed + k)


def spoilt(image: NDArray[np.uint8], condition: Condition, random: np.random.Generator) -> NDArray[np.uint8]:
    """Return a picture under the conditions."""
    out = image.astype(np.float32)
    if condition.defocus_px:
        out = cv2.GaussianBlur(out, (0, 0), condition.defocus_px)
    out = out * condition.gain
    if condition.noise:
        strength = np.sqrt(4 + condition.noise * np.maximum(out, 0))
        out = out + random.standard_normal((*out.shape[:2], 1), np.float32) * strength
    out = 255 * (np.clip(out, 0, 255) / 255) ** (1 / condition.gamma)
    return np.asarray(np.rint(out), np.uint8)


def make(case: Case, folder: Path) -> None:
    """Write the recording of a case: only laser frames, at most `MOST_FRAMES`, evenly chosen."""
    source, random = shared("recordings", *case.source.split("/")), np.random.default_rng(case.seed)
    with (source / "frames.csv").open() as file:
        rows = list(csv.DictReader(file))
    laser = [k for k, row in enumerate(rows) if row["illumination"] == "laser"]
    kept = laser[:: -(-len(laser) // MOST_FRAMES)]
    folder.mkdir(parents=True)
    with av.open(str(folder / "frames.mkv"), "w") as video:
        stream = video.add_stream("libx264", rate=30)
        stream.pix_fmt, stream.options = "yuv420p", {"crf": str(case.condition.crf), "preset": "veryfast"}
        with av.open(str(source / "frames.mkv")) as old:
            stream.width, stream.height = old.streams.video[0].width, old.streams.video[0].height
            for k, frame in enumerate(old.decode(video=0)):
                if k not in kept:
                    continue
                picture = spoilt(frame.to_ndarray(format="bgr24"), case.condition, random)
                for packet in stream.encode(av.VideoFrame.from_ndarray(picture, format="bgr24")):
                    video.mux(packet)
        for packet in stream.encode():
            video.mux(packet)
    lines = [f"{n},{rows[k]['time_s']},laser\n" for n, k in enumerate(kept)]
    (folder / "frames.csv").write_text("frame,time_s,illumination\n" + "".join(lines))
    document = yaml.safe_load((source / "recording.yaml").read_text())
    (folder / "recording.yaml").write_text(
        yaml.safe_dump(document | {"name": case.name, "video": "frames.mkv"})
    )
    for name in ("probe.yaml", "encoder.csv"):
        if (source / name).exists():
            shutil.copy(source / name, folder)


def examined(case: Case, folder: Path) -> dict[str, Any]:
    """Return the evidence of the line's profile in a case."""
    make(case, folder)
    recording, probe = open_recording(folder), read_probe(folder / "probe.yaml")
    told: dict[str, Any] = {"case": case.name, "condition": asdict(case.condition)}
    try:
        rings = extract_rings(recording, probe, RingParameters.model_validate({}), quiet_context())
        evidence = profile_evidence(recording, rings, probe, quiet_context())
    except UnusableError as error:
        return told | {"problem": error.problem}
    classes = [sorted({f.effect, *f.alike}) for f in evidence.found]
    names = ["|".join(c) for c in classes] + ["unexplained"] * (evidence.unexplained is not None)
    each = {f.effect: {"z": float(f.z), "p": float(f.p_value)} for f in evidence.findings}
    return told | {"found": names, "tests": each}


def false_claims(told: dict[str, Any]) -> list[str]:
    """Return the classes of effects that were reported though the case has none of them."""
    true = TRUE_OF_GAMMA if told["condition"]["gamma"] != 1 else frozenset()
    return [name for name in told.get("found", []) if true.isdisjoint(name.split("|"))]


def main() -> None:
    """Do the missing cases and print the counts."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("out", type=Path)
    parser.add_argument("--cases", type=int, default=48)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    done = [json.loads(line) for line in asked.out.read_text().splitlines()] if asked.out.exists() else []
    known = {told["case"] for told in done}
    for case in drawn(asked.cases, asked.seed):
        if case.name not in known:
            with tempfile.TemporaryDirectory() as folder:
                done.append(examined(case, Path(folder) / case.name))
            with asked.out.open("a") as file:
                file.write(json.dumps(done[-1]) + "\n")
    summarise(done)


def summarise(done: list[dict[str, Any]]) -> None:
    """Print false claims, and how uniform the p-values of each effect are."""
    wrong = [(told["case"], names) for told in done if (names := false_claims(told))]
    unusable = sum("problem" in told for told in done)
    print(f"{len(done)} cases, {unusable} unusable, {len(wrong)} with a false claim: {wrong}")
    for effect in sorted({name for told in done for name in told.get("tests", {})}):
        p = [told["tests"][effect]["p"] for told in done if effect in told.get("tests", {})]
        tested = [q for q in p if q < 1]
        if tested:
            uniform = kstest(tested, "uniform").pvalue
            print(f"{effect}: {len(tested)} tested, least p {min(tested):.1e}, uniform with p {uniform:.2g}")


if __name__ == "__main__":
    main()
