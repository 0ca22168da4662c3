"""Where a batch is worked on: local processes, or a Dask scheduler somewhere."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import dask
from distributed import Client, LocalCluster, as_completed

from pipeline.batch.work import Ending, Work, run_one
from pipeline.errors import InputError

_CONNECT_S = 15
# A recording is given up after so many workers were lost over it: it may be what kills them.
_LOST_WORKERS = 5
# What becomes of work when nobody is there to hand it out.
_GONE = ("cancelled", "lost")


@contextmanager
def workers(count: int | None, scheduler: str) -> Iterator[Client]:
    """Yield a client of local workers, as many as cores where ``count`` is None, or of a scheduler.

    Raises
    ------
    InputError
        When the scheduler does not answer.
    """
    dask.config.set({"distributed.scheduler.allowed-failures": _LOST_WORKERS})
    if scheduler:
        try:
            client = Client(scheduler, timeout=_CONNECT_S)
        except (OSError, ValueError) as error:
            raise InputError(
                scheduler, f"no scheduler answers: {error}", expected="tcp://HOST:PORT"
            ) from error
        with client:
            yield client
        return
    cores = len(os.sched_getaffinity(0))
    with (
        LocalCluster(
            n_workers=count or cores, threads_per_worker=1, processes=True, dashboard_address=None,
            host="127.0.0.1",
        ) as cluster,
        Client(cluster) as client,
    ):  # fmt: skip
        yield client


def endings(client: Client, works: Sequence[Work]) -> Iterator[Ending]:
    """Yield the ending of every recording as it comes; one that lost too many workers failed.

    Raises
    ------
    InputError
        When the scheduler is lost.
    """
    futures = {client.submit(run_one, work, key=f"run-{work.name}", pure=False): work for work in works}
    for future in as_completed(list(futures)):
        if future.status == "finished":
            yield future.result()
        elif future.status in _GONE:
            raise InputError(
                client.scheduler.address if client.scheduler else "scheduler", "the scheduler was lost",
                hint="start it again, or leave out --scheduler; the same command then continues",
            )  # fmt: skip
        else:
            problem = f"{_LOST_WORKERS} workers were lost over it: {future.exception()}"
            yield Ending(futures[future].name, "failed", problem)
