"""Waits for another process of a fleet: looks again and again for a short time before it sleeps.

A process that sleeps is woken by the system, mostly on the processor of the one that wakes it and works on:
both then share that processor until one is moved. Between two filter steps that takes longer than the steps.
"""

from __future__ import annotations

import os
import select
from time import perf_counter
from typing import Any

# Longer than what is done between the steps of small fleets, so that their processes do not sleep at all.
AWAKE_S = 0.004


class Inbox:
    """The readable end of a pipe."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self._poll = select.poll()
        self._poll.register(stream, select.POLLIN)

    def read(self) -> bytes:
        """The next byte; none where the other end is closed."""
        end = perf_counter() + AWAKE_S
        while not self._poll.poll(0) and perf_counter() < end:
            os.sched_yield()  # to whoever else wants this processor
        return bytes(self.stream.read(1))
