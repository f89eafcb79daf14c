"""Describes the outcome of a job, and what an executor of many jobs offers."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Protocol, Self, TypeVar

J = TypeVar("J")


class CrashError(Exception):
    """A job's process died each time it was tried; the text says how."""


@dataclass(frozen=True)
class Outcome:
    """The outcome of one job.

    index   its place among the jobs given
    result  what the work returned, if `error` is None
    error   what the work raised, CrashError, or UserError if something could not be sent
    wall_s  time the work took in its own process [s]
    worker  machine and process that did it
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
    """Does many jobs at once. Its processes stay between calls of `imap`, so that imports happen once."""

    @property
    def workers(self) -> int:
        """How many jobs can run at once now."""
        ...

    def imap(self, work: Callable[[J], Any], jobs: Sequence[J]) -> Iterator[Outcome]:
        """One outcome for each job, as they end. Closing the iterator abandons what is still running.

        A job, a result or an exception that cannot be sent between processes is an outcome with a UserError.
        Raises UserError if the work itself cannot be sent.
        """
        ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None: ...
