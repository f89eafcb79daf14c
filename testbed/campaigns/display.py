"""Shows progress on stderr: live lines on a terminal, plain lines in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self

# Seconds between updates of a terminal, and between lines in a log that come now and then.
SHOWN_S, LOGGED_S = 0.5, 10.0


class Display:
    """One live line per piece of work on a terminal. In a log each caller decides which lines it writes."""

    def __init__(self) -> None:
        self._bar: Any = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            columns = ("{task.description}", BarColumn(bar_width=20), TextColumn("{task.fields[note]}"))
            self._bar = Progress(*columns, console=Console(stderr=True), transient=True)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    @property
    def live(self) -> bool:
        """Whether there is a terminal that shows live lines."""
        return self._bar is not None

    def task(
        self, name: str, total: float, done: float = 0.0, note: str = ""
    ) -> Callable[[float, str], None]:
        """A live line, and the function (done, note) that updates it; without a terminal it does nothing."""
        if self._bar is None:
            return lambda done, note: None
        task = self._bar.add_task(name, total=total, completed=done, note=note)
        return lambda done, note: self._bar.update(task, completed=done, note=note)

    def track(self, name: str) -> Callable[[float, float], None]:
        """A callback (t, duration) in simulated seconds for one run; a log gets one line at the start."""
        if self._bar is None:
            say(f"flying {name} ...")
            return lambda t, duration: None
        update, shown = self.task(f"flying {name}", 1.0), 0.0

        def show(t: float, duration: float) -> None:
            nonlocal shown
            now = time.monotonic()
            if now - shown > SHOWN_S / 5 or t >= duration:
                shown = now
                update(t / duration if duration else 1.0, f"{t:.1f} of {duration:g} s")

        return show


def say(line: str) -> None:
    """Write one line to stderr, at once."""
    print(line, file=sys.stderr, flush=True)
