"""``boresight review``: go through a run's findings in the browser, decide, measure, compare, sign."""

from __future__ import annotations

import secrets
import socket
import webbrowser
from collections.abc import Sequence
from contextlib import suppress
from importlib.resources import as_file, files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
import uvicorn

from pipeline.errors import InputError
from pipeline.files.disk import disk_errors_named
from pipeline.review.guard import Guard
from pipeline.review.review import FOLDER, Review, open_review
from pipeline.review.run_files import RunFiles
from pipeline.review.server import application

if TYPE_CHECKING:
    from pipeline.review.compared import Compared


def review(
    run: Annotated[Path, typer.Argument(help="folder of a finished run")],
    port: Annotated[
        int,
        typer.Option(min=0, max=65535, help="port on 127.0.0.1; 0 takes that of last time, or a free one"),
    ] = 0,
    export: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="write the page as read-only files and stop")
    ] = None,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="open the page")] = True,
    compare: Annotated[
        Path | None, typer.Option(metavar="EARLIER", help="folder of an earlier run of the same pipe")
    ] = None,
    twin: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="folder of boresight twin on this run: adds its page"),
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
            "--set", metavar="STAGE.NAME=VALUE", help="one parameter, such as register.least_share=0.5"
        ),
    ] = None,
) -> None:
    """Go through a run in the browser: decide on each finding, measure, sign, print.

    The page is served on this machine only; nothing is sent anywhere. Decisions are kept in RUN/review.
    """
    opened = open_review(RunFiles(run.resolve()))
    compared, beside = _compared(opened, compare, years, config, assignments or ()), _twin_page(twin)
    with as_file(files("pipeline.review").joinpath("page", "dist")) as page:
        if not (page / "index.html").is_file():
            raise InputError(page, "has no page", hint="install boresight again: its page was not built")
        if export is not None:
            from pipeline.review.export import (
                export_review,  # it draws papers; the page need not wait for that
            )

            with disk_errors_named(export):
                export_review(opened, page, export, compared, beside)
            typer.echo(f"Read-only review: {export.resolve() / 'index.html'}")
            return
        serve(opened, page, port, browser, compared, beside)


def _twin_page(twin: Path | None) -> Path | None:
    """Return the page in the folder of a twin."""
    page = None if twin is None else twin / "twin.html"
    if page is not None and not page.is_file():
        raise InputError(page.parent, "holds no twin.html", expected="the folder of boresight twin")
    return page


def _compared(
    opened: Review, earlier: Path | None, years: float | None, config: Path | None, assignments: Sequence[str]
) -> Compared | None:
    """Return the review's run beside an earlier one, and print a line on it; None without one."""
    if earlier is None:
        for name, given in (("--years", years), ("--config", config), ("--set", assignments or None)):
            if given is not None:
                raise InputError(
                    name, "has a meaning only for a comparison", hint="give the earlier run with --compare"
                )
        return None
    # A review of one run need not wait for what compares two.
    from pipeline.commands.staged_comparison import StagedComparison
    from pipeline.review.compared import Compared, run_pair

    pair = run_pair(opened, RunFiles(earlier.resolve()))
    comparison = StagedComparison.configured(config, assignments)
    comparison.complete(pair)
    compared = Compared(pair, comparison, years)
    typer.echo(compared.line)
    return compared


def serve(
    opened: Review, page: Path, port: int, browser: bool, compared: Compared | None = None,
    twin: Path | None = None,
) -> None:  # fmt: skip
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
        guarded = Guard(application(opened, page, compared, twin), token, number)
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
