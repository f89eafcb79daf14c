"""One process that does jobs one at a time, and what stands at either end of its pipes.

A fresh interpreter, not a fork: the same on every platform, no lock or solver state inherited half-way, and
unlike multiprocessing's it may be started from a cluster's daemonic workers.
"""

from __future__ import annotations

import os
import pickle
import platform
import queue
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from testbed.campaigns.outcome import CrashError, Outcome

# A job that crashes its process is tried again once. One whose process is killed from outside is not to
# blame, but what runs out of memory is killed every time.
CRASHES, KILLS = 2, 8
# Deaths before any job began: of these nothing is learnt by trying for ever.
FAILED_STARTS, KILLED_STARTS = 3, 50
OUTSIDE = {
    -getattr(signal, name) for name in ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP") if hasattr(signal, name)
}
# One process a core: linear algebra in threads of its own would only fight the neighbours.
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
BOOT = "import sys; sys.path[:] = {path!r}; from testbed.campaigns.child import main; main()"


@dataclass
class DeathError(Exception):
    """The process ended before it answered.

    code     its exit code, negative for a signal
    started  whether it had begun with the job
    """

    code: int
    started: bool

    @property
    def outside(self) -> bool:
        return self.code in OUTSIDE

    def __str__(self) -> str:
        if self.code >= 0:
            return f"its process ended with exit code {self.code}"
        return f"its process died of {signal.Signals(-self.code).name}"


class Child:
    """A process, started when first needed and again whenever it has died."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process is not None else None

    def do(self, index: int, message: bytes) -> Outcome:
        """The outcome of `work(job)`, pickled as a pair in `message`, after as many tries as deaths allow.

        Raises RuntimeError if no process can be started, DeathError once `close` was called.
        """
        crashes = kills = failed_starts = killed_starts = 0
        while True:
            try:
                if self._closed:
                    raise DeathError(0, False)
                ok, value, wall_s = self._call(message)
            except DeathError as death:
                self._process = None
                if self._closed:
                    raise
                crashes += death.started and not death.outside
                kills += death.started and death.outside
                failed_starts += not death.started and not death.outside
                killed_starts += not death.started and death.outside
                if failed_starts >= FAILED_STARTS or killed_starts >= KILLED_STARTS:
                    raise RuntimeError(f"no worker starts: {death}") from None
                if crashes >= CRASHES or kills >= KILLS:
                    error = CrashError(f"{death}, {crashes + kills} times")
                    return Outcome(index, None, error, 0.0, "")
                continue
            worker = f"{platform.node()}:{self.pid}"
            return Outcome(index, value if ok else None, None if ok else value, wall_s, worker)

    def close(self) -> None:
        """End the process, whatever it is doing; safe from another thread than the one in `do`."""
        self._closed = True
        process = self._process
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                with suppress(OSError, ValueError):
                    pipe.close()  # type: ignore[union-attr]

    def _call(self, message: bytes) -> tuple[bool, Any, float]:
        if self._process is None or self._process.poll() is not None:
            self._process = subprocess.Popen(
                [sys.executable, "-c", BOOT.format(path=sys.path)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=ENVIRONMENT | os.environ,
                # Ctrl-C in a terminal is for the parent, which then closes its children.
                start_new_session=True,
            )
        process, started = self._process, False
        if self._closed:
            process.kill()
        assert process.stdin is not None and process.stdout is not None
        try:
            pickle.dump(message, process.stdin)
            process.stdin.flush()
            started = pickle.load(process.stdout) == "started"
            ok, value, wall_s = pickle.loads(pickle.load(process.stdout))
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            process.kill()
            code = process.wait()
            process.stdout.close()
            with suppress(OSError):
                process.stdin.close()
            raise DeathError(code, started) from None
        return ok, value, wall_s


def main() -> None:
    """The process's own end: jobs from stdin, answers to stdout, gone as soon as the parent is."""
    inbox, outbox = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    # What a library prints must not come between the answers.
    os.dup2(2, 1)
    jobs: queue.SimpleQueue[bytes] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(inbox, jobs), daemon=True).start()
    while True:
        answer = _answer(jobs.get(), outbox)
        pickle.dump(answer, outbox)
        outbox.flush()


def _listen(inbox: Any, jobs: queue.SimpleQueue[bytes]) -> None:
    # A parent that was killed must not leave processes computing for nobody.
    with suppress(Exception):
        while True:
            jobs.put(pickle.load(inbox))
    os._exit(0)


def _answer(message: bytes, outbox: Any) -> bytes:
    began = time.perf_counter()
    try:
        work, job = pickle.loads(message)
        pickle.dump("started", outbox)
        outbox.flush()
        began = time.perf_counter()
        return pickle.dumps((True, work(job), time.perf_counter() - began))
    except BaseException as error:
        wall_s = time.perf_counter() - began
        with suppress(Exception):
            if isinstance(error, Exception):
                return pickle.dumps((False, error, wall_s))
        return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}"), wall_s))
