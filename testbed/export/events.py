"""Lists the events of a run: where a claim was violated, where a pair was closest, why it ended."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pandas as pd

from testbed.claims.registry import SEPARATION, SEPARATION_INTRUDERS
from testbed.records.run import Run
from testbed.records.verdict import Status, Verdict
from testbed.report.fences import named
from testbed.report.tables import number

NO_SOLUTION = ("infeasible", "iteration_limit")
NEAREST = (SEPARATION.id, SEPARATION_INTRUDERS.id)


@dataclass(frozen=True)
class Event:
    """`kind` is a guarantee's id, or `below-ds`, `outside-safe-set`,
    `beyond-fence`, `no-solution`, `ended-early`.

    vehicles  counted from 1; empty where the event concerns no vehicle in particular
    """

    t_s: float
    kind: str
    vehicles: tuple[int, ...]
    text: str


def events(run: Run) -> list[Event]:
    """Events in order of time.

    The worst instant of every violated guarantee, and of separation always, is known at every FDM step; the
    instants at which a pair comes below Ds or leaves the safe set, or a QP loses its solution, are the first
    recorded ones.
    """
    found = [_worst(g) for g in run.guarantees if g.instant is not None and _told(g)]
    pairs, vehicles = run.pairs, run.vehicles
    d_safe = run.manifest["scenario"]["d_safe_m"]
    unit = "m" if run.manifest["scenario"]["barrier"]["form"] == "root" else "m^2"
    tables = run.manifest["scenario"].get("vehicle", [])
    strangers = [k for k, v in enumerate(tables, 1) if not v.get("filter", True)]
    if strangers:  # what happens between intruders is nobody's promise
        pairs = pairs[~(pairs.i.isin(strangers) & pairs.j.isin(strangers))]
    if len(pairs):
        for row in _entered(pairs, ["i", "j"], pairs.distance_m < d_safe):
            text = f"closer than Ds {d_safe:g} m: {row.distance_m:.3f} m"
            found.append(Event(row.t_s, "below-ds", (row.i, row.j), text))
        for row in _entered(pairs, ["i", "j"], pairs.h_m < 0.0):
            text = f"out of the safe set: h = {row.h_m:.3f} {unit}"
            found.append(Event(row.t_s, "outside-safe-set", (row.i, row.j), text))
    for row in _entered(run.fences, ["fence", "vehicle"], run.fences.clearance_m < 0.0):
        text = f"beyond {named(run.manifest['scenario'], row.fence)}: {-row.clearance_m:.3f} m"
        found.append(Event(row.t_s, "beyond-fence", (row.vehicle,), text))
    for row in _entered(vehicles, ["vehicle"], vehicles.qp_status.isin(NO_SOLUTION)):
        text = f"no solution of the QP: {row.qp_status}; flies the evading manoeuvre"
        found.append(Event(row.t_s, "no-solution", (row.vehicle,), text))
    if end := run.manifest["ended_early"]:
        last = float(vehicles.t_s.iloc[-1]) if len(vehicles) else 0.0
        found.append(Event(last, "ended-early", (), end))
    return sorted(found, key=lambda e: (e.t_s, e.kind, e.vehicles))


def _told(v: Verdict) -> bool:
    return v.status is Status.VIOLATED or (v.id in NEAREST and v.value is not None)


def _worst(v: Verdict) -> Event:
    assert v.instant is not None and v.value is not None
    value = f"{v.quantity} {number(v.value)} {v.unit}".rstrip()
    return Event(float(v.instant), v.id, v.vehicles, f"{v.id} {v.status}: {value}")


def _entered(table: pd.DataFrame, keys: list[str], inside: pd.Series) -> list:
    """The rows at which `inside` becomes true, separately for each vehicle or pair."""
    before = inside.groupby([table[k] for k in keys]).shift(fill_value=False)
    return list(table[np.asarray(inside & ~before.astype(bool))].itertuples(index=False))
