"""How a campaign gets on: one live line on a terminal, now and then a line in a log."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from testbed.campaigns.flight import FLOWN, lost
from testbed.campaigns.outcome import Executor
from testbed.campaigns.progress import Progress
from testbed.statistics import rate_of

# Seconds between lines in a log, and between updates of a terminal.
LOGGED_S, SHOWN_S = 10.0, 0.5


class View:
    """Counts runs as they end; on stderr, so that results on stdout stay clean."""

    def __init__(self) -> None:
        self._bar: Any = None

    @contextmanager
    def showing(self, state: Progress, most: int, pool: Executor) -> Iterator[None]:
        """Shown while the block lasts.

        most  runs there are if no look ends the campaign before
        """
        self._guarantee, self._pool, self._most = state.plan.campaign.guarantee, pool, most
        rows = [e["row"] for e in state.entries.values()]
        self._before = self._done = len(rows)
        self._failed = sum(row["status"] != FLOWN for row in rows)
        self._lost = sum(lost(row, self._guarantee) for row in rows)
        self._began = self._shown = time.monotonic()
        if sys.stderr.isatty():
            from rich.console import Console
            from rich.progress import BarColumn, Progress, TextColumn

            columns = ("{task.description}", BarColumn(bar_width=20), TextColumn("{task.fields[note]}"))
            console = Console(stderr=True)
            self._bar = Progress(*columns, console=console, transient=True)
            self._task = self._bar.add_task(state.plan.campaign.name, total=most, note=self._counts())
        else:
            # Without the rate, whose interval is seconds of imports away.
            print(f"{state.plan.campaign.name}: {self._counts()}", file=sys.stderr, flush=True)
        try:
            if self._bar is not None:
                self._bar.start()
            yield
        finally:
            if self._bar is not None:
                self._bar.stop()
            if self._done > self._before:
                print(f"{state.plan.campaign.name}: {self._counts()}", file=sys.stderr, flush=True)

    def done(self, row: dict[str, Any]) -> None:
        """Another run ended."""
        self._done += 1
        self._failed += row["status"] != FLOWN
        self._lost += lost(row, self._guarantee)
        if time.monotonic() - self._shown >= (LOGGED_S if self._bar is None else SHOWN_S):
            self._show()

    def _counts(self) -> str:
        return f"{self._done} of {self._most} done, {self._failed} failed"

    def __str__(self) -> str:
        text = self._counts()
        running = min(self._pool.workers, self._most - self._done)
        text += f", {running} running" if running else ""
        if self._done:
            seen = rate_of(self._lost, self._done)
            rate = f"{100 * seen.value:.1f} % [{100 * seen.low:.1f}, {100 * seen.high:.1f}]"
            text += f", {self._guarantee} lost in {rate}"
        flown, left = self._done - self._before, self._most - self._done
        if flown and left:
            text += f", {_duration(left * (time.monotonic() - self._began) / flown)} left"
        return text

    def _show(self) -> None:
        self._shown = time.monotonic()
        if self._bar is not None:
            self._bar.update(self._task, completed=self._done, note=str(self))
        elif self._done > self._before:
            print(str(self), file=sys.stderr, flush=True)


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"
