"""Runs jobs on a dask.distributed cluster, in the same kind of processes as on this machine.

Each thread of a Dask worker keeps one process of ours and waits for it. So a run that aborts ends no other
run and no process of Dask's, which could not tell which run was to blame. The runs of a lost Dask worker are
flown by another one.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from testbed.campaigns.child import Child
from testbed.campaigns.outcome import CrashError, J, Outcome
from testbed.campaigns.transfer import packed
from testbed.errors import UserError

# Jobs given to the scheduler for each that can run at once; more would only fill its memory.
AHEAD = 3
# Dask gives a task up after four lost workers; the job is submitted again so many times.
RESUBMITTED = 4
# A busy machine loses connections to a scheduler that still runs: reconnections allowed per outcome.
RECONNECTED = 3
# What Dask raises when it has lost the scheduler, or takes it for lost.
DISCONNECTED = (OSError, asyncio.CancelledError, concurrent.futures.CancelledError)
# How long a number of workers is used before it is asked for again.
COUNTED_S = 2.0
# Time for the scheduler to answer, and again for its first worker.
TIMEOUT_S = 5.0

_OWN = threading.local()


def on_worker(index: int, message: bytes) -> Outcome:
    """The task that a Dask worker's thread runs; the scheduler does not read the message."""
    if not hasattr(_OWN, "child"):
        _OWN.child = Child()
    outcome: Outcome = _OWN.child.do(index, message)
    return outcome


class Cluster:
    """A Dask scheduler's workers. Raises UserError if it cannot be reached, or has no workers."""

    def __init__(self, address: str, timeout_s: float | None = None) -> None:
        timeout_s = TIMEOUT_S if timeout_s is None else timeout_s
        try:
            from distributed import Client
            from distributed.comm import resolve_address
        except ImportError:
            raise UserError(
                "--cluster: dask.distributed is not installed; pip install 'cbf-jsbsim-testbed[cluster]'"
            ) from None
        # A lost connection is reported below, once.
        for name in ("distributed", *logging.root.manager.loggerDict):
            if name.startswith("distributed"):
                logging.getLogger(name).setLevel(logging.CRITICAL)
        self._address, self._counted = address, (-math.inf, 0)
        try:
            # First alone: a client that is not made because of its address prints a trace when it is deleted.
            resolve_address(address)
            self.client = Client(address, timeout=timeout_s, set_as_default=False)
        except OSError:
            raise UserError(
                f"--cluster {address}: no Dask scheduler answers there within {timeout_s:g} s"
            ) from None
        except (ValueError, TypeError) as error:
            raise UserError(f"--cluster {address}: {error}") from None
        try:
            self.client.wait_for_workers(1, timeout=timeout_s)
        except TimeoutError:
            self.client.close()
            raise UserError(
                f"--cluster {address}: the scheduler has no workers; start some with: dask worker {address}"
            ) from None

    @property
    def workers(self) -> int:
        # Read after every run: a query each time would burden the scheduler.
        now = time.monotonic()
        if now - self._counted[0] > COUNTED_S:
            count = self._counted[1]
            # A failure here shows again when a job is submitted.
            with suppress(*DISCONNECTED):
                count = sum(self.client.nthreads().values())
            self._counted = (now, count)
        return self._counted[1]

    def _gone(self) -> UserError:
        return UserError(f"--cluster {self._address}: the scheduler is gone")

    def _reconnect(self) -> None:
        """A new connection in place of a lost one; raises UserError if the scheduler does not answer."""
        from distributed import Client

        lost = self.client
        try:
            self.client = Client(self._address, timeout=TIMEOUT_S, set_as_default=False)
        except OSError:
            raise self._gone() from None
        with suppress(*DISCONNECTED):
            lost.close(timeout=TIMEOUT_S)

    def imap(self, work: Callable[[J], Any], jobs: Sequence[J]) -> Iterator[Outcome]:
        from distributed import KilledWorker, as_completed

        packed(work, None)
        jobs = list(jobs)
        todo, again = iter(range(len(jobs))), deque[int]()
        running: dict[Any, int] = {}
        lost: dict[int, int] = {}
        refused: deque[Outcome] = deque()
        ended, reconnected = as_completed(loop=self.client.loop), 0

        def fill() -> None:
            while len(running) < AHEAD * max(1, self.workers):
                index = again[0] if again else next(todo, None)
                if index is None:
                    return
                try:
                    message = packed(work, jobs[index])
                except UserError as error:
                    # One job that cannot be sent costs no other.
                    refused.append(Outcome(index, None, error, 0.0, ""))
                    continue
                if not again:
                    again.append(index)  # until it is given
                future = self.client.submit(on_worker, index, message, pure=False)
                again.popleft()
                running[future] = index
                ended.add(future)

        try:
            while True:
                future = outcome = error = None
                with suppress(*DISCONNECTED):
                    fill()
                    if not running and not refused:
                        return
                    if not refused:
                        future = next(ended)
                        if future.status == "finished":
                            outcome = future.result()
                        elif future.status == "error":
                            error = future.exception()
                if refused:
                    yield refused.popleft()
                    continue
                if outcome is None and error is None:
                    if reconnected == RECONNECTED:
                        raise self._gone()
                    self._reconnect()
                    ended, reconnected = as_completed(loop=self.client.loop), reconnected + 1
                    again.extend(running.values())
                    running.clear()
                    continue
                index = running.pop(future)
                if outcome is not None:
                    reconnected = 0
                    yield outcome
                elif isinstance(error, KilledWorker):
                    lost[index] = lost.get(index, 0) + 1
                    if lost[index] < RESUBMITTED:
                        again.append(index)
                    else:
                        yield Outcome(
                            index, None, CrashError("it lost every worker it was given to"), 0.0, ""
                        )
                else:
                    reason = " ".join(f"{type(error).__name__}: {error}".split())
                    raise UserError(f"--cluster {self._address}: its workers fail with {reason}")
        finally:
            with suppress(*DISCONNECTED):
                for future in running:
                    future.cancel()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.client.close()
