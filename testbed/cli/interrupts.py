"""Ends the command line after errors and signals: one line on stderr and an exit code."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

from testbed.cli.terminal import prepare, say
from testbed.errors import StoppedError, UserError

# Ctrl-C, a polite kill, a closed terminal (which Windows lacks): all clean up the same way.
SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
_HAS_TIMER = hasattr(signal, "setitimer")
_AGAIN_S = 0.2


def ending(command: Callable[[], object]) -> None:
    """Run `command` to its end and exit: 2 after a user's mistake or a full disk, 128 + n after signal n."""
    prepare()
    try:
        with _listening():
            try:
                command()
            finally:
                sys.stdout.flush()
    except UserError as error:
        say(f"error: {error}")
        _leave(2)
    except BrokenPipeError:
        _leave(1)  # the reader of our output has ended, as `head` does
    except OSError as error:
        say(f"error: {UserError(str(error))}")
        _leave(2)
    except (StoppedError, KeyboardInterrupt) as error:
        number = getattr(error, "number", signal.SIGINT)
        say(f"stopped by {signal.Signals(number).name}; nothing half-written is left")
        _leave(128 + number)


@contextmanager
def _listening() -> Iterator[None]:
    """Signals raise StoppedError until it is being handled: nothing may interrupt the cleaning up."""
    first = 0
    before: dict[signal.Signals, Any] = {}

    def stop(number: int, frame: FrameType | None) -> None:
        nonlocal first
        if not first:
            first = number
            if _HAS_TIMER:
                before[signal.SIGALRM] = signal.signal(signal.SIGALRM, stop)
        for other in SIGNALS:
            signal.signal(other, signal.SIG_IGN)
        # What is raised inside a destructor, a callback of C or an import that catches everything (as
        # numpy.random's does) is lost without a trace: ask again until it is being handled.
        if _HAS_TIMER:
            signal.setitimer(signal.ITIMER_REAL, _AGAIN_S)
        if not _handled():
            raise StoppedError(first)

    said = sys.unraisablehook

    def unraisable(lost: Any) -> None:
        """Say what was lost, but for our own request, which is made again."""
        if not isinstance(lost.exc_value, StoppedError):
            said(lost)

    sys.unraisablehook = unraisable
    with suppress(ValueError):  # not in the main thread, where no signal arrives either
        for number in SIGNALS:
            # Started with nohup, or in the background of a script: left ignored, as asked.
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, stop)
    try:
        yield
    finally:
        sys.unraisablehook = said
        if first and _HAS_TIMER:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in before.items():
            signal.signal(number, handler)


def _handled() -> bool:
    """Whether a StoppedError is being handled, by an except or finally clause or the end of a with block."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, StoppedError):
        error = error.__context__
    return error is not None


def _leave(code: int) -> None:
    """Exit; what cannot be flushed any more is dropped, without a traceback at the very end."""
    try:
        sys.stdout.flush()
    except OSError:
        with suppress(OSError, ValueError):
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
    sys.exit(code)
