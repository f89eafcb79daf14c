"""Runs in a worker process: takes jobs from stdin, answers on stdout, ends when its parent has ended."""

from __future__ import annotations

import os
import pickle
import queue
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from testbed.campaigns.transfer import answer, failure, unpacked


def main() -> None:
    """The worker's loop."""
    inbox, outbox = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # A job that prints or reads must not disturb the pipes.
    os.dup2(2, 1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(inbox, jobs), daemon=True).start()
    while True:
        message = jobs.get()
        pickle.dump(_answer(message, outbox), outbox)
        outbox.flush()


def _listen(inbox: Any, jobs: queue.SimpleQueue[bytes]) -> None:
    # A worker whose parent was killed must not go on.
    with suppress(Exception):
        while True:
            jobs.put(pickle.load(inbox))
    os._exit(0)


def _answer(message: bytes, outbox: Any) -> bytes:
    loaded: tuple[Callable[[Any], Any], Any] | BaseException
    try:
        loaded = unpacked(message)
    except BaseException as error:
        loaded = error
    # Sent only now: a process killed while it imports modules has failed to start; the job is not to blame.
    pickle.dump("started", outbox)
    outbox.flush()
    if isinstance(loaded, BaseException):
        return failure(loaded, 0.0)
    work, job = loaded
    began = time.perf_counter()
    try:
        return answer(work(job), time.perf_counter() - began)
    except BaseException as error:
        return failure(error, time.perf_counter() - began)
