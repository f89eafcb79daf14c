"""Counts a campaign's runs as they end, and shows the counts."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from testbed.campaigns.display import LOGGED_S, SHOWN_S, Display, say
from testbed.campaigns.flight import FLOWN, lost
from testbed.campaigns.outcome import Executor
from testbed.campaigns.progress import Progress
from testbed.statistics import rate_of


class View:
    """How many runs are done, failed and lost, and how long the rest will take."""

    def __init__(self) -> None:
        self._display = Display()

    @contextmanager
    def showing(self, state: Progress, most: int, pool: Executor) -> Iterator[None]:
        """Show the counts while the block lasts.

        most  runs there are if no look ends the campaign before
        """
        self._guarantee, self._pool, self._most = state.plan.campaign.guarantee, pool, most
        rows = [e["row"] for e in state.entries.values()]
        self._before = self._done = len(rows)
        self._failed = sum(row["status"] != FLOWN for row in rows)
        self._lost = sum(lost(row, self._guarantee) for row in rows)
        self._began = self._shown = time.monotonic()
        name = state.plan.campaign.name
        with self._display:
            self._update = self._display.task(name, most, self._done, self._counts())
            if not self._display.live:
                # Without the rate: computing its interval needs imports that take seconds.
                say(f"{name}: {self._counts()}")
            try:
                yield
            finally:
                if self._done > self._before:
                    say(f"{name}: {self._counts()}")

    def done(self, row: dict[str, Any]) -> None:
        """Another run ended."""
        self._done += 1
        self._failed += row["status"] != FLOWN
        self._lost += lost(row, self._guarantee)
        if time.monotonic() - self._shown >= (SHOWN_S if self._display.live else LOGGED_S):
            self._shown = time.monotonic()
            self._update(self._done, str(self))
            if not self._display.live:
                say(str(self))

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


def _duration(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min {rest} s" if minutes else f"{rest} s"
