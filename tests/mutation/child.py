"""Work done in a forked process, which may hang, crash or grow without harm to this one."""

from __future__ import annotations

import json
import os
import resource
import select
import signal
import time
from collections.abc import Callable
from typing import Any

MEMORY = 6_000_000_000  # bytes; a mutant may ask for any shape


def run(work: Callable[[Callable[[float], None]], Any], first_limit: float) -> Any:
    """What `work(allow)` returns, as JSON; "timeout" or "crash" (a word) if it did not get that far.

    `allow(seconds)` starts the time limit anew; until it is called, `first_limit` [s] holds.
    """
    here, there = os.pipe()
    pid = os.fork()
    if pid == 0:
        os.close(here)
        _work(work, there)
    os.close(there)
    try:
        return _answer(here, time.monotonic() + first_limit)
    finally:
        os.close(here)
        os.kill(pid, signal.SIGKILL)
        os.waitpid(pid, 0)


def _work(work: Callable[[Callable[[float], None]], Any], there: int) -> None:
    code = 1
    try:
        resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
        result = work(lambda seconds: _send(there, {"allow": seconds}))
        _send(there, {"result": result})
        code = 0
    finally:
        os._exit(code)


def _send(there: int, message: dict[str, Any]) -> None:
    os.write(there, json.dumps(message).encode() + b"\n")


def _answer(here: int, deadline: float) -> Any:
    buffer = b""
    while True:
        ready, _, _ = select.select([here], [], [], max(0.0, deadline - time.monotonic()))
        if not ready:
            return "timeout"
        chunk = os.read(here, 1 << 16)
        if not chunk:
            return "crash"
        *lines, buffer = (buffer + chunk).split(b"\n")
        for line in lines:
            message = json.loads(line)
            if "result" in message:
                return message["result"]
            deadline = time.monotonic() + message["allow"]
