"""Starts the worker processes of a fleet, has them step their shares, and ends them.

Each is a new interpreter, not a fork: it inherits no lock and no state of a solver.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import signal
import subprocess
import sys
import weakref
from collections.abc import Sequence

from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.stepping.waiting import Inbox
from aircraft.jsbsim.stepping.worker import DONE, READ, STEP, Share

# Each process has a core to itself: threads within linear algebra would only slow the others down.
_ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
_BOOT = "import sys; sys.path[:] = {path!r}; from aircraft.jsbsim.stepping.worker import main; main({memory})"


class WorkerError(RuntimeError):
    """A worker process ended, or could not do what it was asked for."""


class Workers:
    """Processes that step one share of a fleet each, while this one steps its own.

    shares  of the fleet's vehicles, one a process; they load and trim at once
    memory  the file of the fleet's shared numbers; closed with the processes
    vehicles, channels  N, and the most channels that one has
    """

    def __init__(self, shares: Sequence[Share], memory: int, vehicles: int, channels: int) -> None:
        if os.name != "posix":
            raise WorkerError("a fleet's worker processes need a POSIX system; fly without workers")
        self._shares = shares
        self._processes: list[subprocess.Popen[bytes]] = []
        self._answers: list[Inbox] = []
        # However the fleet is let go of, no process stays.
        self.close = weakref.finalize(self, _end, self._processes, memory)
        boot = _BOOT.format(path=sys.path, memory=memory)
        try:
            for share in shares:
                process = subprocess.Popen(
                    [sys.executable, "-c", boot],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    env=_ENVIRONMENT | os.environ,
                    pass_fds=(memory,),
                    # Ctrl-C in a terminal reaches the parent only, which then ends its workers.
                    start_new_session=True,
                )
                self._processes.append(process)
                self._answers.append(Inbox(process.stdout))
                self._write(len(self._processes) - 1, pickle.dumps((share, vehicles, channels)))
        except OSError as error:  # no process, no memory for one
            self.close()
            raise WorkerError(f"no worker process starts: {error.strerror}") from None
        except BaseException:
            self.close()
            raise

    @property
    def pids(self) -> list[int]:
        """Of the processes."""
        return [process.pid for process in self._processes]

    def step(self) -> None:
        """Have all step as the shared memory says; they work on until `wait`."""
        self._ask(STEP)

    def read(self) -> None:
        """Have all read their telemetry into the shared memory."""
        self._ask(READ)
        self.wait()

    def wait(self) -> None:
        """Wait until all have done what they were asked for.

        Raises  WorkerError where one has ended; FdmError, as the worker met it
        """
        for k, answer in enumerate(self._answers):
            if answer.read() != DONE:
                raise self._failed(k)

    def _ask(self, what: bytes) -> None:
        for k in range(len(self._processes)):
            self._write(k, what)

    def _write(self, k: int, message: bytes) -> None:
        stream = self._processes[k].stdin
        assert stream is not None
        try:
            stream.write(message)
            stream.flush()
        except OSError:  # its end of the pipe is closed
            raise self._failed(k) from None

    def _failed(self, k: int) -> Exception:
        """What worker k has met; all processes have ended then."""
        process, share = self._processes[k], self._shares[k]
        who = f"worker process {k + 2}, vehicles {share.first + 1} to {share.last},"
        assert process.stdout is not None
        try:
            flight, kind, said = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            process.kill()
            code = process.wait()
            error: Exception = WorkerError(f"{who} {_ended(code)}")
        else:
            error = FdmError(said) if flight else WorkerError(f"{who} failed: {kind}: {said}")
        self.close()
        return error


def _ended(code: int) -> str:
    """How a process with this exit code ended."""
    if code >= 0:
        return f"ended with exit code {code}"
    with contextlib.suppress(ValueError):
        return f"died of {signal.Signals(-code).name}"
    return f"died of signal {-code}"


def _end(processes: list[subprocess.Popen[bytes]], memory: int) -> None:
    for process in processes:
        process.kill()
    for process in processes:
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError, ValueError):
                pipe.close()  # type: ignore[union-attr]
    os.close(memory)
