"""The kinds of place a batch is worked on at, as the section ``cluster`` of a configuration names them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, TypeAdapter, ValidationError

from pipeline.errors import InputError
from pipeline.files.yaml_file import read_yaml
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
