"""Describes the outcome of a job, and what an executor of many jobs offers."""

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
