"""Says how far a campaign has come: which runs its looks ask for, and which of them are done."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from testbed.campaigns.flight import lost
from testbed.campaigns.plan import Plan, Planned, rounds
from testbed.statistics import Look
from testbed.statistics import Plan as Looks


@dataclass
class Progress:
    """How far a plan has come: the runs to fly so far, by its looks, and the rows of finished runs.

    looks  cell -> what its last look said; empty without a stopping rule
    """

    plan: Plan
    entries: dict[str, dict[str, Any]]
    wanted: list[Planned] = field(default_factory=list)
    looks: dict[int, Look] = field(default_factory=dict)

    @property
    def missing(self) -> list[Planned]:
        return [r for r in self.wanted if r.id not in self.entries]

    @property
    def complete(self) -> bool:
        return not self.missing

    def lost(self, run: Planned) -> bool:
        return lost(self.entries[run.id]["row"], self.plan.campaign.guarantee)


def progress(plan: Plan, entries: dict[str, dict[str, Any]]) -> Progress:
    """How far the rows reach: round by round, and no round before the one before it is whole."""
    made = Progress(plan, entries)
    stop = plan.campaign.stop
    looks = Looks(tuple(stop.looks), stop.target, stop.alpha, stop.spending) if stop else None
    active = [c.number for c in plan.cells]
    for number, (first, last) in enumerate(rounds(plan), 1):
        # Seed by seed over all cells: a campaign cut short has compared like with like.
        each = [plan.of(cell) for cell in active]
        made.wanted += [of[k] for k in range(first, last) for of in each if k < len(of)]
        if looks is None or not made.complete:
            break
        for cell in active:
            events = sum(made.lost(r) for r in plan.of(cell)[:last])
            made.looks[cell] = looks.look(number, events)
        active = [cell for cell in active if not made.looks[cell].final]
    return made
