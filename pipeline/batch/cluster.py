"""Where the runs of a batch are computed: local processes, a Dask scheduler, or the jobs of a queue."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import dask
from distributed import Client, LocalCluster, as_completed
from pydantic import Field, TypeAdapter, ValidationError

from pipeline.batch import BatchOutcome, Work, run_one
from pipeline.errors import InputError
from pipeline.files.json_yaml import read_yaml
from pipeline.machine.configuration import CLUSTER
from pipeline.machine.stage import Parameters

_EXPECTED = (
    "kind: local (count), scheduler (address), slurm or pbs (jobs, cores, memory_gib, walltime, queue, "
    "account, host)"
)


class LocalWorkers(Parameters):
    """Processes of this machine."""

    kind: Literal["local"] = "local"
    count: int | None = Field(None, ge=1, description="workers; one for each core where left out")


class RunningScheduler(Parameters):
    """A Dask scheduler that somebody started, with its workers."""

    kind: Literal["scheduler"] = "scheduler"
    address: str = Field(min_length=1, description="tcp://HOST:PORT")


class QueuedJobs(Parameters):
    """Jobs of a batch queue, one recording at a time each; a job that ends is queued again."""

    kind: Literal["slurm", "pbs"]
    jobs: int = Field(ge=1, le=10_000, description="jobs at a time")
    cores: int = Field(2, ge=1, description="cores of a job")
    memory_gib: float = Field(8.0, gt=0, description="memory of a job, GiB")
    walltime: str = Field("04:00:00", pattern=r"^(\d+-)?\d+:\d\d:\d\d$", description="of a job, HH:MM:SS")
    queue: str | None = Field(None, description="queue or partition; the system's own where left out")
    account: str | None = Field(None, description="account that is charged; the user's own where left out")
    host: str | None = Field(None, description="address of this machine as the jobs see it")


Cluster = Annotated[LocalWorkers | RunningScheduler | QueuedJobs, Field(discriminator="kind")]


def read_cluster(file: Path | None) -> Cluster:
    """Return the kind of cluster that a configuration file names; local workers where it names none.

    Raises
    ------
    InputError
        For a section ``cluster`` that is none of the kinds, naming the key.
    """
    section = read_yaml(file).values.get(CLUSTER) if file else None
    if file is None or section is None:
        return LocalWorkers.model_validate({})
    try:
        return TypeAdapter[Cluster](Cluster).validate_python(section)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        # The first part of the place is the kind itself.
        place = ".".join((CLUSTER, *map(str, first["loc"][1:])))
        raise InputError(file, first["msg"], place=place, expected=_EXPECTED) from error


if TYPE_CHECKING:
    from dask_jobqueue.core import JobQueueCluster

# Time after which a scheduler that does not answer is given up, s.
_CONNECT_S = 15
# A run uses all cores of its job, so that the worker computes one run at a time.
_ONE_AT_A_TIME = ("--nthreads", "1")
# A recording fails after so many workers died while computing it: the recording may be the cause.
_LOST_WORKERS = 5
# States of work whose scheduler is gone.
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
    # Adapting with equal limits queues a job again when it ends or is killed.
    jobs.adapt(minimum_jobs=cluster.jobs, maximum_jobs=cluster.jobs)
    return jobs


def _client(place: str | LocalCluster | JobQueueCluster) -> Client:
    try:
        return Client(place, timeout=_CONNECT_S)
    except (OSError, ValueError) as error:
        raise InputError(str(place), f"no scheduler answers: {error}", expected="tcp://HOST:PORT") from error


def outcomes(client: Client, works: Sequence[Work]) -> Iterator[BatchOutcome]:
    """Yield the outcome of every recording as it ends; one that lost too many workers has failed.

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
            yield BatchOutcome(futures[future].name, "failed", problem)
