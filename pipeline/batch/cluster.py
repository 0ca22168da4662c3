"""Where a batch is worked on: local processes, a Dask scheduler somewhere, or the jobs of a queue."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from typing import TYPE_CHECKING

import dask
from distributed import Client, LocalCluster, as_completed

from pipeline.batch.kinds import Cluster, LocalWorkers, QueuedJobs, RunningScheduler
from pipeline.batch.work import Ending, Work, run_one
from pipeline.errors import InputError

if TYPE_CHECKING:
    from dask_jobqueue.core import JobQueueCluster

_CONNECT_S = 15
# A run takes the cores of its job by itself; the worker has it compute nothing beside.
_ONE_AT_A_TIME = ("--nthreads", "1")
# A recording is given up after so many workers were lost over it: it may be what kills them.
_LOST_WORKERS = 5
# What becomes of work when nobody is there to hand it out.
_GONE = ("cancelled", "lost")


@contextmanager
def workers(cluster: Cluster) -> Iterator[Client]:
    """Yield a client of the workers of a cluster.

    Raises
    ------
    InputError
        When the scheduler does not answer, or the queue takes no jobs.
    """
    dask.config.set({"distributed.scheduler.allowed-failures": _LOST_WORKERS})
    with ExitStack() as opened:
        match cluster:
            case LocalWorkers():
                place = opened.enter_context(_local(cluster))
            case QueuedJobs():
                place = opened.enter_context(_queued(cluster))
            case RunningScheduler():
                place = cluster.address
        yield opened.enter_context(_client(place))


def _local(cluster: LocalWorkers) -> LocalCluster:
    cores = len(os.sched_getaffinity(0))
    return LocalCluster(
        n_workers=cluster.count or cores, threads_per_worker=1, processes=True, dashboard_address=None,
        host="127.0.0.1",
    )  # fmt: skip


def _queued(cluster: QueuedJobs) -> JobQueueCluster:
    import dask_jobqueue

    kind = {"slurm": dask_jobqueue.SLURMCluster, "pbs": dask_jobqueue.PBSCluster}[cluster.kind]
    submit = kind.job_cls.submit_command.split()[0]
    if shutil.which(submit) is None:
        raise InputError(
            submit, "is not on the path", hint=f"start the batch where {cluster.kind} takes jobs"
        )
    jobs = kind(
        cores=cluster.cores, memory=f"{cluster.memory_gib}GiB", processes=1, walltime=cluster.walltime,
        queue=cluster.queue, account=cluster.account, worker_extra_args=list(_ONE_AT_A_TIME),
        scheduler_options={"dashboard_address": None, "host": cluster.host},
    )  # fmt: skip
    # Adapting, where both ends are the same, queues a job again that ended or was killed.
    jobs.adapt(minimum_jobs=cluster.jobs, maximum_jobs=cluster.jobs)
    return jobs


def _client(place: str | LocalCluster | JobQueueCluster) -> Client:
    try:
        return Client(place, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(str(place), f"no scheduler answers: {error}", expected="tcp://HOST:PORT") from error


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
                hint="start it again, or work on other workers; the same command then continues",
            )  # fmt: skip
        else:
            problem = f"{_LOST_WORKERS} workers were lost over it: {future.exception()}"
            yield Ending(futures[future].name, "failed", problem)
