"""The executor over dask.distributed: the same processes, on more machines than one.

Each thread of a Dask worker keeps one child process of ours and waits for it. So a run that aborts takes
nobody with it, Dask's own processes least of all, which could not tell such a run from its neighbours; what
Dask adds is that the runs of a lost worker are flown by another.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
import math
import pickle
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

from testbed.campaigns.child import Child
from testbed.campaigns.outcome import CrashError, J, Outcome
from testbed.errors import UserError

# Of jobs given to the scheduler for each that can run; more would only fill its memory.
AHEAD = 3
# Dask gives a task up after four lost workers; so many times it is given to it again.
RESUBMITTED = 4
# A busy machine loses a connection whose scheduler is there: so often it is made again for one outcome.
RECONNECTED = 3
# What Dask says when it has lost the scheduler, or thinks so.
DISCONNECTED = (OSError, asyncio.CancelledError, concurrent.futures.CancelledError)
# How long the number of workers is believed.
COUNTED_S = 2.0
# For the scheduler to answer, and again for its first worker.
TIMEOUT_S = 5.0

_OWN = threading.local()


def on_worker(index: int, message: bytes) -> Outcome:
    """The task, as a Dask worker's thread does it; the message is nothing to the scheduler."""
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
        except ImportError:
            raise UserError(
                "--cluster: dask.distributed is not installed; pip install 'cbf-jsbsim-testbed[cluster]'"
            ) from None
        # What a lost connection means is said below, once.
        for name in ("distributed", *logging.root.manager.loggerDict):
            if name.startswith("distributed"):
                logging.getLogger(name).setLevel(logging.CRITICAL)
        self._address, self._counted = address, (-math.inf, 0)
        try:
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
        # Asked for with every run that ends; the scheduler has better to do.
        now = time.monotonic()
        if now - self._counted[0] > COUNTED_S:
            count = self._counted[1]
            # Where it cannot be asked, the jobs it has will tell.
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

        todo, again = iter(range(len(jobs))), deque[int]()
        running: dict[Any, int] = {}
        lost: dict[int, int] = {}
        ended, reconnected = as_completed(loop=self.client.loop), 0

        def fill() -> None:
            while len(running) < AHEAD * max(1, self.workers):
                index = again[0] if again else next(todo, None)
                if index is None:
                    return
                if not again:
                    again.append(index)  # until it is given
                message = pickle.dumps((work, jobs[index]))
                future = self.client.submit(on_worker, index, message, pure=False)
                again.popleft()
                running[future] = index
                ended.add(future)

        try:
            while True:
                future = outcome = error = None
                with suppress(*DISCONNECTED):
                    fill()
                    if not running:
                        return
                    future = next(ended)
                    if future.status == "finished":
                        outcome = future.result()
                    elif future.status == "error":
                        error = future.exception()
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
