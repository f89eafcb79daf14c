"""Plans a benchmark's runs and flies those that its journal has not."""

from __future__ import annotations

import copy
import time
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbed.campaigns.display import LOGGED_S, SHOWN_S, Display, say
from testbed.campaigns.engine import fly as fly_each
from testbed.campaigns.engine import open_pool
from testbed.campaigns.identity import AirframeHashes, code_id, content_id
from testbed.campaigns.journal import Journal
from testbed.scenario.location import placed
from testbed.scenario.overrides import assign
from testbed.scenario.scenario import Scenario, field_path
from testbed.scenario.variants import Variants
from testbed.studies.benchmark.file import Benchmark
from testbed.studies.benchmark.flight import Flight, fly
from testbed.studies.benchmark.meetings import Meeting, meetings


@dataclass(frozen=True)
class Cell:
    """One filter on one plant in one set."""

    filter: str
    plant: str
    set: str


@dataclass
class Plan:
    """Everything that a benchmark flies.

    scenarios  of each cell, that of its first encounter
    airframes  name -> SHA-256
    """

    benchmark: Benchmark
    sets: dict[str, list[Meeting]]
    scenarios: dict[Cell, Scenario]
    airframes: dict[str, str]
    code: str
    home: dict[str, Any] = field(default_factory=dict)

    @property
    def cells(self) -> list[Cell]:
        """Set by set, plant by plant, in the file's order."""
        b = self.benchmark
        return [Cell(f, p, s) for s in b.sets for p in b.plants for f in b.filters]

    def flight(self, cell: Cell, k: int) -> Flight:
        """Encounter number k, from 0, of the cell's set."""
        met = self.sets[cell.set][k]
        fields = fields_of(self.benchmark, cell) | self.home
        id_ = content_id([met.data, fields, self.airframes])
        return Flight(cell.filter, cell.plant, cell.set, met.name, met.data, fields, id_, self.code)

    @staticmethod
    def key(flight: Flight) -> str:
        """The name of a run: of everything that its row depends on."""
        return content_id([flight.id, flight.code])

    @property
    def size(self) -> int:
        """How many runs there are."""
        return sum(self.benchmark.encounters(c.filter, c.set) for c in self.cells)

    def flights(self) -> Iterator[Flight]:
        """Encounter by encounter over all cells: a benchmark cut short has compared like with like."""
        for k in range(max(len(of) for of in self.sets.values())):
            for cell in self.cells:
                if k < self.benchmark.encounters(cell.filter, cell.set):
                    yield self.flight(cell, k)


def fields_of(b: Benchmark, cell: Cell) -> dict[str, Any]:
    """What a cell sets in its encounters' scenarios, by dotted path."""
    return {**b.set, **b.plants[cell.plant], **b.filters[cell.filter]}


def plan(b: Benchmark, folder: Path) -> Plan:
    """All runs of a benchmark whose paths start from `folder`; nothing is flown.

    Raises UserError naming the set, filter or plant that is wrong, or a field without effect in every run.
    """
    for table in ("set", "filters", "plants"):
        of = getattr(b, table)
        for name, fields in [("", of)] if table == "set" else of.items():
            for path in fields:
                field_path(path, f"{table}.{name}." if name else "set.")
    sets = {name: meetings(of, b.seed, folder, f"{b.name}: sets.{name}") for name, of in b.sets.items()}
    listed = [a for fields in (b.set, *b.plants.values()) for a in fields.get("airframes", [])]
    home = {k: v for k, v in placed({"airframes": listed}, folder, Path()).items() if k == "airframes_folder"}
    made = Plan(b, sets, {}, {}, code_id("testbed.studies.benchmark.flight"), home)
    variants, hashes = Variants(), AirframeHashes()
    for cell in made.cells:
        first = made.flight(cell, 0)
        where = f"{b.name}: {cell.filter} on {cell.plant} in {cell.set}"
        data = copy.deepcopy(first.data)
        for path, value in first.fields.items():
            assign(data, tuple(path.split(".")), value)
        made.scenarios[cell] = s = variants.add(data, where)
        made.airframes |= hashes.of(s)
    variants.refuse(b.name)
    return made


def fly_all(
    made: Plan,
    journal: Journal,
    workers: int | None,
    minutes: float | None = None,
    only: Collection[str] = (),
) -> bool:
    """Fly what the journal has not; whether all is flown. After `minutes` it stops and keeps its runs.

    only  filters whose runs are flown; empty: all
    """
    return fly_some([f for f in made.flights() if not only or f.filter in only], journal, workers, minutes)


def fly_some(
    flights: Sequence[Flight], journal: Journal, workers: int | None, minutes: float | None = None
) -> bool:
    """Fly those of `flights` that the journal has not; whether all of them are flown."""
    keys = [Plan.key(f) for f in flights]
    missing = len({key for key in keys if key not in journal.entries})
    if found := len(keys) - missing:
        say(f"{found} of {len(keys)} runs are there already")
    with Display() as display, open_pool(missing, workers) as pool:
        count = _Count(display, missing, minutes)
        try:
            fly_each(fly, flights, keys, journal, pool, lambda k, row: count.done(flights[k], row))
        except _TimeUpError:
            return False
    return True


class _TimeUpError(Exception):
    """The minutes given are over."""


class _Count:
    """Counts runs as they end: a live line on a terminal, now and then a line in a log."""

    def __init__(self, display: Display, total: int, minutes: float | None) -> None:
        self._display, self._total, self._flown = display, total, 0
        self._update = display.task("runs", total)
        self._begun = self._shown = time.monotonic()
        self._until = self._begun + 60.0 * minutes if minutes is not None else float("inf")

    def done(self, flight: Flight, row: dict[str, Any]) -> None:
        self._flown += 1
        now = time.monotonic()
        if now - self._shown >= (SHOWN_S if self._display.live else LOGGED_S):
            self._shown = now
            left = (self._total - self._flown) * (now - self._begun) / self._flown
            text = f"{self._flown} of {self._total}, {left / 60.0:.1f} min left: {said(flight, row)}"
            self._update(self._flown, text)
            if not self._display.live:
                say(text)
        if now >= self._until and self._flown < self._total:
            raise _TimeUpError


def said(flight: Flight, row: dict[str, Any]) -> str:
    """A run in a few words."""
    value = row.get("distance_m")
    how = row["refused"] or (f"{value:.2f} m" if value is not None else "no pair")
    return f"{flight.filter} on {flight.plant}, {flight.encounter}: {how}"


def rows(made: Plan, journal: Journal) -> list[dict[str, Any]]:
    """A row per flown run: cell, encounter, and what was counted. In the plan's order."""
    found = journal.rows
    named = [(f, made.key(f)) for f in made.flights()]
    return [
        {"set": f.set, "plant": f.plant, "filter": f.filter, "encounter": f.encounter} | found[key]
        for f, key in named
        if key in found
    ]
