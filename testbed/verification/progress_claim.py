"""Checks G7b, how long vehicles go without coming nearer to their goals."""

from __future__ import annotations

import numpy as np

from testbed.verification import departed, fleet
from testbed.verification.finding import Finding, Judge, thin
from testbed.verification.recorded import Array
from testbed.verification.settings import Scenario, box, goals, seeking, start

# Starts of aircraft are met within this [m], and so is the bound [s] at some metres a second.
START_M = 1e-3


def patience(s: Scenario) -> float | None:
    """The bound [s], the longest straight way at the least speed; None where the run is no longer."""
    due = seeking(s) & fleet.under(s)
    if not due.any():
        return None
    way = np.linalg.norm(goals(s) - start(s).position, axis=-1)
    bound = float((way / box(s)[0][:, 0])[due].max())
    return bound if bound < s["duration_s"] else None


def waits(judge: Judge) -> Finding:
    """The finding of G7b."""
    run, e = judge.run, judge.entry
    s = run.scenario
    bound, due = patience(s), seeking(s) & fleet.under(s)
    if bound is None:
        return judge.done("the run is too short", None)
    judge.expect_near("bound", e["bound"], bound, START_M)
    judge.expect("margin", e["margin"], e["bound"] - e["value"])
    judge.expect("verdict", e["verdict"], judge.verdict(e["value"] <= e["bound"]))
    if not run.complete or run.flew_on:
        return judge.done("unknown", None, True, thin(run))
    away = np.linalg.norm(run.position - goals(s), axis=-1)
    if departed.leaves(run):  # who has been there has left
        away[1:][np.logical_or.accumulate(away <= s["goal_radius_m"])[:-1]] = np.inf
    each = [_waits(run.t, away[:, v], s["goal_radius_m"]) for v in range(s["vehicles"])]
    longest = np.array([max(found)[0] for found, _ in each])
    value = float(longest[due].max())
    judge.expect_near("value", e["value"], value, 1e-9 * (1.0 + value))
    detail = {
        "arrived": int(sum(there for (_, there), of in zip(each, due, strict=True) if of)),
        "of": int(due.sum()),
        "waiting": int((longest[due] > bound).sum()),
    }
    for name, count in detail.items():
        judge.expect(name, e["detail"].get(name), count)
    who = e["vehicles"][0] - 1 if len(e["vehicles"]) == 1 and 1 <= e["vehicles"][0] <= len(due) else -1
    if who < 0 or not due[who] or longest[who] < value - 1e-9:
        judge.wrong.append(f"vehicles are {e['vehicles']}")
    elif not any(
        abs(begin - e["t_s"]) <= 1e-9 * (1.0 + begin) and wait >= value - 1e-9 for wait, begin in each[who][0]
    ):
        judge.wrong.append(f"no such wait begins at {e['t_s']} s")
    return judge.done(f"{value:.6g}", 1e-9)


def _waits(t: Array, away: Array, step: float) -> tuple[list[tuple[float, float]], bool]:
    """Every time [s] without coming nearer by `step` [m] and its begin; whether the goal was met."""
    began, known, found = 0.0, away[0], [(0.0, 0.0)]
    if known <= step:
        return found, True
    for now, distance in zip(t.tolist(), away, strict=True):
        if distance > max(known - step, step):
            continue
        found.append((now - began, began))
        if distance <= step:
            return found, True
        began, known = now, distance
    return [*found, (float(t[-1]) - began, began)], False
