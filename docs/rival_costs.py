"""Times a step of every filter against the paper's filter, in one process, for docs/guide/rivals.md.

    python docs/rival_costs.py

Unicycles stand on a circle and fly across it: 2 and 20 of them, most steps with rows that bind. The filters
take turns, so that a busy machine slows all alike, and each sees the flight that it leads to: those with a
model of the vehicles count on what they command being flown. Medians go to docs/guide/data/rivals/costs.csv.
"""

from __future__ import annotations

import csv
import time
from pathlib import Path

import numpy as np

from filters.filter import Choose
from filters.model import Array, Command, Limits, State, View, step
from testbed.components import catalogue
from testbed.scenario.scenario import load

FILE = Path(__file__).parent / "guide" / "data" / "rivals" / "costs.csv"
COUNTS = (2, 20)
STEPS = 60
DT = 0.05
REFERENCE = "centralised"


def filters(n: int) -> tuple[dict[str, Choose], Limits, State, Array]:
    """One filter of every kind, limits, start (N,) and goals (N, 3) of n vehicles on a circle."""
    made: dict[str, Choose] = {}
    for kind in catalogue.FILTERS:
        s = load(
            "paper-2-turn",
            [f'filter.kind="{kind}"', f"vehicles={n}", f"rates.filter_dt_s={DT}", f"rates.record_dt_s={DT}"],
        )
        angle = 2 * np.pi * np.arange(n) / n
        radius = 60.0 if n == 2 else 120.0
        start = State(radius * np.cos(angle), radius * np.sin(angle), angle + np.pi, np.zeros(n))
        goal = -start.position
        made[kind] = catalogue.filter_(s, catalogue.barrier(s), goal)
    return made, catalogue.limits(s), start, goal


def timed(n: int) -> dict[str, float]:
    """Median seconds of processor a step of each kind; each sees the flight that it leads to."""
    made, limits, start, _ = filters(n)
    wanted = Command(np.full(n, 20.0), np.zeros(n), np.zeros(n))
    seen, spent = {kind: (start, wanted) for kind in made}, {kind: np.zeros(STEPS) for kind in made}
    for k in range(STEPS):
        for kind, f in made.items():
            state, rates = seen[kind]
            begun = time.process_time()
            decision = f(View(state, rates), wanted, limits)
            spent[kind][k] = time.process_time() - begun
            seen[kind] = step(state, decision.command, DT), decision.command
    return {kind: float(np.median(s)) for kind, s in spent.items()}


def main() -> None:
    found = {n: timed(n) for n in COUNTS}
    FILE.parent.mkdir(parents=True, exist_ok=True)
    with FILE.open("w", newline="", encoding="utf-8") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(["kind", *(f"{what}_{n}" for n in COUNTS for what in ("ms", "ratio", "flow"))])
        for kind in found[COUNTS[0]]:
            row = [(1e3 * t[kind], t[kind] / t[REFERENCE], t[kind] / t["flow"]) for t in found.values()]
            table.writerow([kind, *(f"{x:.3g}" for numbers in row for x in numbers)])


if __name__ == "__main__":
    main()
