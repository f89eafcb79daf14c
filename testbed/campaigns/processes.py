"""Runs jobs in processes on this machine; a thread for each process hands it one job at a time."""

from __future__ import annotations

import os
import queue
import threading
from collections.abc import Callable, Iterator, Sequence
from types import TracebackType
from typing import Any, Self

from testbed.campaigns.child import Child, DeathError
from testbed.campaigns.outcome import J, Outcome
from testbed.campaigns.transfer import packed
from testbed.errors import UserError


class Processes:
    """`workers` processes (None: one per processor). Each has one job at a time, so a crash has one cause."""

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and (not isinstance(workers, int) or workers < 1):
            raise UserError(f"workers must be a whole number of at least 1, not {workers!r:.40}")
        self._count = workers or os.cpu_count() or 1
        self._children: list[Child] = []

    @property
    def workers(self) -> int:
        return self._count

    @property
    def pids(self) -> list[int | None]:
        """Of the processes; None for one that is not running yet."""
        return [child.pid for child in self._children]

    def imap(self, work: Callable[[J], Any], jobs: Sequence[J]) -> Iterator[Outcome]:
        packed(work, None)
        jobs = list(jobs)  # an iterator will do as well
        while len(self._children) < min(self._count, len(jobs)):
            self._children.append(Child())
        todo: queue.SimpleQueue[int | None] = queue.SimpleQueue()
        for index in range(len(jobs)):
            todo.put(index)
        for _ in self._children:
            todo.put(None)
        done: queue.Queue[Outcome | Exception] = queue.Queue()
        threads = [
            threading.Thread(target=_serve, args=(child, work, jobs, todo, done), daemon=True)
            for child in self._children
        ]
        for thread in threads:
            thread.start()
        ended = False
        try:
            for _ in range(len(jobs)):
                outcome = _wait(done)
                if isinstance(outcome, Exception):
                    raise outcome
                yield outcome
            ended = True
        finally:
            if not ended:
                self._close()
            for thread in threads:
                thread.join()

    def _close(self) -> None:
        for child in self._children:
            child.close()
        self._children = []

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._close()


def _serve(
    child: Child,
    work: Callable[[Any], Any],
    jobs: Sequence[Any],
    todo: queue.SimpleQueue[int | None],
    done: queue.Queue[Outcome | Exception],
) -> None:
    while (index := todo.get()) is not None:
        try:
            done.put(child.do(index, packed(work, jobs[index])))
        except UserError as error:
            # One job that cannot be sent costs no other.
            done.put(Outcome(index, None, error, 0.0, ""))
        except DeathError:
            return  # closed while it worked
        except Exception as error:
            done.put(error)
            return


def _wait(done: queue.Queue[Outcome | Exception]) -> Outcome | Exception:
    # With a timeout: on some systems Ctrl-C does not interrupt a wait without one.
    while True:
        try:
            return done.get(timeout=1.0)
        except queue.Empty:
            continue
