"""The one seam by which many runs are flown: here, or on a cluster.

    with executor(workers=2) as pool:
        for outcome in pool.imap(measure, jobs):
            print(jobs[outcome.index], outcome.value())

Work is a module's function and is sent by name; a job is data. Every job is answered once, in the order in
which they end. A job that raises, or crashes its process, is an outcome; the others go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, Self, TypeVar

J = TypeVar("J")


class CrashError(Exception):
    """A job's process died under it, time and again; the text says how."""


@dataclass(frozen=True)
class Outcome:
    """What became of one job.

    index   its place among the jobs given
    result  what the work returned, if `error` is None
    error   what the work raised, or CrashError
    wall_s  time the work took, in its own process
    worker  who did it
    """

    index: int
    result: Any
    error: Exception | None
    wall_s: float
    worker: str

    def value(self) -> Any:
        """The result; raises what the work raised."""
        if self.error is not None:
            raise self.error
        return self.result


class Executor(Protocol):
    """Processes that outlive single calls of `imap`, so that imports are paid for once."""

    @property
    def workers(self) -> int:
        """How many jobs can run at once now."""
        ...

    def imap(self, work: Callable[[J], Any], jobs: Sequence[J]) -> Iterator[Outcome]:
        """One outcome for each job, as they end. Closing the iterator abandons what is still running."""
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def executor(workers: int | None = None, cluster: str | None = None) -> Executor:
    """Processes on this machine (`workers`, None: one per processor), or the cluster at an address.

    Raises UserError if the cluster cannot be reached or the extra `cluster` is not installed.
    """
    if cluster is not None:
        from testbed.campaigns.cluster import Cluster

        return Cluster(cluster)
    from testbed.campaigns.processes import Processes

    return Processes(workers)
