"""Runs a worker process, hands it one job at a time, and starts it again when it has died.

The process is a new interpreter, not a fork: it works alike on every platform, inherits no lock and no
solver state, and, unlike those of multiprocessing, it may be started from a cluster's daemonic workers.
"""

from __future__ import annotations

import os
import pickle
import platform
import signal
import subprocess
import sys
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from testbed.campaigns.outcome import CrashError, Outcome
from testbed.campaigns.transfer import answered
from testbed.components.fleet_workers import VARIABLE

# A job that crashes its process is tried once more. A job whose process is killed from outside is tried
# more often: it is not to blame, unless it runs out of memory, and then it is killed every time.
CRASHES, KILLS = 2, 8
# Deaths before a job began, after which no further start is tried.
FAILED_STARTS, KILLED_STARTS = 3, 50
OUTSIDE = {
    -getattr(signal, name) for name in ("SIGKILL", "SIGTERM", "SIGINT", "SIGHUP") if hasattr(signal, name)
}
# There is one process per core: threads within linear algebra, and processes that step a run's aircraft,
# would only slow the others down.
ENVIRONMENT = {
    "OPENBLAS_NUM_THREADS": "1",
    "OMP_NUM_THREADS": "1",
    "MKL_NUM_THREADS": "1",
    VARIABLE: "1",
}
BOOT = "import sys; sys.path[:] = {path!r}; from testbed.campaigns.worker import main; main()"


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
        try:
            return f"its process died of {signal.Signals(-self.code).name}"
        except ValueError:
            return f"its process died of signal {-self.code}"


class Child:
    """A process, started when first needed and again whenever it has died."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._closed = False

    @property
    def pid(self) -> int | None:
        return self._process.pid if self._process is not None else None

    def do(self, index: int, message: bytes) -> Outcome:
        """The outcome of the work and job in `message`, tried again after a death, within limits.

        message  as `transfer.packed` makes it

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
                # Ctrl-C in a terminal reaches the parent only, which then closes its children.
                start_new_session=True,
                creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
            )
        process, started = self._process, False
        if self._closed:
            process.kill()
        assert process.stdin is not None and process.stdout is not None
        try:
            pickle.dump(message, process.stdin)
            process.stdin.flush()
            started = pickle.load(process.stdout) == "started"
            answer = pickle.load(process.stdout)
        except (EOFError, OSError, ValueError, pickle.UnpicklingError):
            process.kill()
            code = process.wait()
            process.stdout.close()
            with suppress(OSError):
                process.stdin.close()
            raise DeathError(code, started) from None
        return answered(answer)
