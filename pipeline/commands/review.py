"""``boresight review``: go through a run's findings in the browser, decide, measure, compare, sign."""

from __future__ import annotations

import os
import secrets
import socket
import threading
import webbrowser
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
import uvicorn
from rich.console import Console

from pipeline.artefacts.comparison import Comparison, FindingPair, RegisteredWalls, WallPair
from pipeline.errors import InputError
from pipeline.files.codec import digest
from pipeline.files.disk import disk_errors_named
from pipeline.machine.configuration import Configuration, resolve
from pipeline.machine.display import Display, ProgressDisplay, SilentDisplay
from pipeline.machine.outcome import Number, RunOutcome
from pipeline.machine.plan import Plan, Selection, Source, make_plan
from pipeline.machine.run_folder import claimed, logged
from pipeline.machine.runner import Runner
from pipeline.review.compared import RunPair
from pipeline.review.guard import Guard
from pipeline.review.review import FOLDER, Review, open_review
from pipeline.review.run_files import RunFiles
from pipeline.review.server import application
from pipeline.system.processes import stop_wish
from stages.catalogue import PIPELINE
from stages.compare import COMPARISON

if TYPE_CHECKING:
    from pipeline.review.compared import Compared


def review(
    run: Annotated[Path, typer.Argument(help="folder of a finished run")],
    port: Annotated[
        int,
        typer.Option(min=0, max=65535, help="port on 127.0.0.1; 0 takes that of last time, or a free one"),
    ] = 0,
    export: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="write the page as files, read-only, and end")
    ] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="open the page")] = True,
    compare: Annotated[
        Path | None, typer.Option(metavar="EARLIER", help="folder of an earlier run of the same pipe")
    ] = None,
    years: Annotated[
        float | None,
        typer.Option(min=0.001, max=200, help="time from the earlier run to this one, for rates"),
    ] = None,
    config: Annotated[
        Path | None, typer.Option(metavar="FILE", help="parameters of the comparison (YAML)")
    ] = None,
    assignments: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="STAGE.NAME=VALUE", help="one of them, such as register.least_share=0.5"
        ),
    ] = None,
) -> None:
    """Go through a run in the browser: decide on each finding, measure, sign, print.

    The page is served on this machine only; nothing is sent anywhere. Decisions are kept in RUN/review.
    """
    opened = open_review(RunFiles(run.resolve()))
    compared = _compared(opened, compare, years, config, assignments or ())
    with as_file(files("pipeline.review").joinpath("page", "dist")) as page:
        if not (page / "index.html").is_file():
            raise InputError(page, "has no page", hint="install boresight whole")
        if export is not None:
            from pipeline.review.export import (
                export_review,  # it draws papers; the page need not wait for that
            )

            with disk_errors_named(export):
                export_review(opened, page, export, compared)
            typer.echo(f"Read-only review: {export.resolve() / 'index.html'}")
            return
        serve(opened, page, port, browser, compared)


def _compared(
    opened: Review, earlier: Path | None, years: float | None, config: Path | None, assignments: Sequence[str]
) -> Compared | None:
    """Return the review's run beside an earlier one, told in a line; None without one."""
    if earlier is None:
        for name, given in (("--years", years), ("--config", config), ("--set", assignments or None)):
            if given is not None:
                raise InputError(name, "concerns a comparison", hint="give the earlier run with --compare")
        return None
    # A review of one run need not wait for what compares two.
    from pipeline.commands.review import StagedComparison
    from pipeline.review.compared import Compared, run_pair

    pair = run_pair(opened, RunFiles(earlier.resolve()))
    comparison = StagedComparison.configured(config, assignments)
    comparison.complete(pair)
    compared = Compared(pair, comparison, years)
    typer.echo(compared.line)
    return compared


def serve(opened: Review, page: Path, port: int, browser: bool, compared: Compared | None = None) -> None:
    """Serve a review until interrupted.

    Raises
    ------
    InputError
        When the port is taken.
    """
    last = opened.files.path / FOLDER / "port"
    with _listening(port) if port else _listening_again(last) as listener:
        number = int(listener.getsockname()[1])
        with suppress(OSError):  # a comfort only: see _listening_again
            last.write_text(f"{number}\n", "ascii")
        token = secrets.token_urlsafe(24)
        address = f"http://127.0.0.1:{number}/?token={token}"
        typer.echo(f"Review of {opened.files.path.name}: {address}\nStop with Ctrl-C.")
        if browser:
            webbrowser.open(address)
        guarded = Guard(application(opened, page, compared), token, number)
        server = uvicorn.Server(uvicorn.Config(guarded, log_level="warning", server_header=False))
        server.run(sockets=[listener])


def _listening_again(last: Path) -> socket.socket:
    """Listen where the last server did, so that a page left open finds its server again."""
    try:
        return _listening(int(last.read_text("ascii")))
    except (OSError, ValueError, OverflowError, InputError):
        return _listening(0)


def _listening(port: int) -> socket.socket:
    listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind(("127.0.0.1", port))
        listener.listen()  # before anyone is told the address: who comes early waits instead of being refused
    except OSError as error:
        listener.close()
        raise InputError(f"port {port}", error.strerror or "is taken", hint="leave out --port") from error
    return listener


@dataclass(frozen=True)
class StagedComparison:
    """Compares two runs with the parameters of a configuration; what was computed before is reused."""

    configuration: Configuration
    _turn: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    @classmethod
    def configured(cls, config: Path | None, assignments: Sequence[str]) -> StagedComparison:
        """Return a comparison with the parameters of a file, which may be that of a whole run, and words."""
        return cls(resolve((*PIPELINE, *COMPARISON), config, assignments))

    def __call__(self, pair: RunPair) -> tuple[RegisteredWalls, Comparison]:
        """Return the comparison of a pair as it stands; a server's threads take turns.

        Raises
        ------
        UnusableError
            When the two do not show the same wall.
        """
        return self._compared(pair, SilentDisplay())

    def complete(self, pair: RunPair) -> None:
        """Compute what is missing, with a bar for the user; Ctrl-C stops it. Raises as a call does."""
        with ProgressDisplay(Console(stderr=True)) as display:
            self._compared(pair, display)

    def _compared(self, pair: RunPair, display: Display) -> tuple[RegisteredWalls, Comparison]:
        plan = self._plan(pair)
        place = pair.now.files.path / FOLDER / "comparison"
        with self._turn, claimed(place) as folder, logged(folder) as logger, stop_wish() as wish:
            workers = len(os.sched_getaffinity(0))
            Runner(plan, (), folder, _not_recorded, _no_headline, display, logger, wish, workers).run(
                Selection()
            )
            store, (first, second) = folder.store, plan.steps
            walls = store.look(first.stage.name, first.key, RegisteredWalls)
            found = store.look(second.stage.name, second.key, Comparison)
        if walls is None or found is None:
            raise InputError(place, "lost a result of the comparison", hint="start the review again")
        return walls, found

    def _plan(self, pair: RunPair) -> Plan:
        findings = pair.findings()
        walls = Source(WallPair, pair.walls(), pair.walls_key())
        return make_plan(
            COMPARISON, self.configuration, (walls, Source(FindingPair, findings, digest(findings)))
        )


def _no_headline(artefacts: Mapping[type, object]) -> tuple[Number, ...]:
    """Name no number before others: the page shows the whole comparison."""
    return ()


def _not_recorded(outcome: RunOutcome) -> None:
    """Leave no record: the store's manifests say which results are whole."""
