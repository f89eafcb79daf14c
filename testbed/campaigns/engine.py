"""Flies many runs, for campaigns and studies: each once, and kept as soon as it ends.

`fly` is the one loop. Runs are told apart by key; a run whose key is in the journal is not flown again, and
equal keys are flown once. What is kept does not depend on how many workers there are.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from testbed.campaigns.display import Display, say
from testbed.campaigns.executor import executor
from testbed.campaigns.inprocess import InProcess
from testbed.campaigns.journal import Journal, Row
from testbed.campaigns.outcome import Executor, Outcome

J = TypeVar("J")
R = TypeVar("R")


def fly(
    work: Callable[[J], Any],
    jobs: Sequence[J],
    keys: Sequence[str],
    journal: Journal,
    pool: Executor,
    ended: Callable[[int, Row], None],
    row_of: Callable[[Outcome], Row] = Outcome.value,
) -> None:
    """Fly the jobs whose keys have no row in `journal` yet.

    keys    of the jobs, in their order
    ended   called with a job's number and row once the row is kept
    row_of  makes a row of an outcome; it may raise, which ends the work and loses nothing that is kept
    """
    waiting = {key: k for k, key in reversed(list(enumerate(keys))) if key not in journal.entries}
    numbers = sorted(waiting.values())
    if not numbers:
        return
    for outcome in pool.imap(work, _Chosen(jobs, numbers)):
        number, row = numbers[outcome.index], row_of(outcome)
        timing = {"wall_s": outcome.wall_s, "worker": outcome.worker, "ended_unix_s": time.time()}
        journal.keep(keys[number], row, timing)
        ended(number, journal.entries[keys[number]]["row"])


def fly_rows(
    work: Callable[[J], Row],
    jobs: Sequence[J],
    keys: Sequence[str],
    journal: Journal,
    workers: int | None = None,
    said: Callable[[J, Row], str] = lambda job, row: str(job),
) -> list[Row]:
    """The rows of `jobs` in their order, those in `journal` as they are there and the others flown.

    workers  processes; None: one per processor; 1: in this process
    said     a run in a few words, for the display
    """
    if found := len(journal.found.intersection(keys)):
        say(f"resuming: {found} of {len(set(keys))} runs found in {journal.file}")
    missing = len({key for key in keys if key not in journal.entries})
    with Display() as display, open_pool(missing, workers) as pool:
        count = _Count(display, missing)
        fly(work, jobs, keys, journal, pool, lambda k, row: count.done(said(jobs[k], row)))
    return [journal.entries[key]["row"] for key in keys]


def fly_all(
    work: Callable[[J], R],
    jobs: Sequence[J],
    workers: int | None = None,
    said: Callable[[J, R], str] = lambda job, result: str(job),
) -> list[R]:
    """`work(job)` for each job, in their order, whatever it returns; nothing is kept.

    work  a module's function: it is sent to the processes by name
    """
    results: dict[int, R] = {}
    with Display() as display, open_pool(len(jobs), workers) as pool:
        count = _Count(display, len(jobs))
        for outcome in pool.imap(work, jobs):
            results[outcome.index] = outcome.value()
            count.done(said(jobs[outcome.index], results[outcome.index]))
    return [results[k] for k in range(len(jobs))]


def open_pool(jobs: int, workers: int | None) -> Executor:
    """No more workers than jobs; one works in this process."""
    count = min(jobs, workers or os.cpu_count() or 1)
    return InProcess() if count <= 1 else executor(count)


class _Count:
    """Runs that ended: a live line on a terminal, a line for each in a log."""

    def __init__(self, display: Display, total: int) -> None:
        self._display, self._total, self._done = display, total, 0
        self._update = display.task("runs", total)

    def done(self, text: str) -> None:
        self._done += 1
        line = f"{self._done} of {self._total}: {text}"
        self._update(self._done, line)
        if not self._display.live:
            say(line)


class _Chosen(Sequence[J]):
    """Some of the jobs, made when they are asked for: a hundred thousand scenarios would fill the memory."""

    def __init__(self, jobs: Sequence[J], numbers: Sequence[int]) -> None:
        self._jobs, self._numbers = jobs, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: Any) -> Any:
        return self._jobs[self._numbers[index]]
