"""Progress of long work: a bar on a terminal, a line per piece of work in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from types import TracebackType
from typing import Any, Self


class Progress:
    """Shows how far simulated time has come; on stderr, so that results on stdout stay clean."""

    def __init__(self) -> None:
        self._bar: Any = None

    def __enter__(self) -> Self:
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
            from rich.progress import Progress as Bar

            columns = (
                "[progress.description]{task.description}",
                BarColumn(),
                TextColumn("{task.fields[note]}"),
            )
            self._bar = Bar(*columns, TimeRemainingColumn(), console=Console(stderr=True), transient=True)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._bar is not None:
            self._bar.stop()

    def track(self, name: str) -> Callable[[float, float], None]:
        """A callback (t, duration) in simulated seconds for one piece of work."""
        if self._bar is None:
            print(f"flying {name} ...", file=sys.stderr, flush=True)
            return lambda t, duration: None
        task = self._bar.add_task(f"flying {name}", total=1.0, note="")
        shown = 0.0

        def show(t: float, duration: float) -> None:
            nonlocal shown
            now = time.monotonic()
            if now - shown > 0.1 or t >= duration:
                shown = now
                done = t / duration if duration else 1.0
                self._bar.update(task, completed=done, note=f"{t:.1f} of {duration:g} s")

        return show
