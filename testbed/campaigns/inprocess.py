"""Runs jobs one after another in this process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, Self

from testbed.campaigns.outcome import J, Outcome


class InProcess:
    """An executor without processes. Work that ends the process ends this one."""

    workers = 1

    def imap(self, work: Callable[[J], Any], jobs: Sequence[J]) -> Iterator[Outcome]:
        """One outcome for each job, in order."""
        jobs = list(jobs)
        for index in range(len(jobs)):
            began = time.perf_counter()
            try:
                result, error = work(jobs[index]), None
            except Exception as raised:
                result, error = None, raised
            yield Outcome(index, result, error, time.perf_counter() - began, "this process")

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        pass
