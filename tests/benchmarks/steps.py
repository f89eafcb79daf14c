"""What filter steps cost on vehicles that meet, and what the authors' way of solving them would."""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from benchmarks.clock import BareStep, clock, least
from filters.barriers.pairs import ForwardDifference
from filters.cbf.collision import CollisionFilter
from filters.cbf.constraints import pair_rows
from filters.model import Array, Command, Limits, View, step
from filters.qp.single import Status
from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.scenario import scenario
from testbed.scenario.scenario import Scenario

PERIOD_S = 0.05
# Metres of radius per vehicle of a circle on which starts are as far apart as the paper's twenty.
RADIUS_PER_VEHICLE_M = 10.0


@dataclass(frozen=True)
class Moment:
    """What a filter was asked."""

    view: View
    nominal: Command
    limits: Limits


def circle(vehicles: int, mode: str) -> Scenario:
    """Vehicles head for the centre of a circle, under the smoothed barrier."""
    return scenario.load(
        "paper-20-turn",
        [
            f"vehicles={vehicles}",
            f"start.radius_m={max(2, vehicles) * RADIUS_PER_VEHICLE_M}",
            f"filter.kind={mode}",
            "barrier.delta_m2=0",
            "barrier.smoothing_m2=30",
        ],
    )


def active_moments(s: Scenario, count: int) -> tuple[CollisionFilter, list[Moment]]:
    """The filter, and moments of a unicycle flight at which it changes most vehicles' commands."""
    start, goal = places(s, generators(s.seed)["start"])
    barrier = catalogue.barrier(s)
    filter_ = CollisionFilter(barrier, catalogue.alpha(s), mode=s.filter.kind)  # type: ignore[arg-type]
    limits, nominal = catalogue.limits(s), catalogue.guidance(s, goal, barrier)
    found: list[Moment] = []
    state, level = start, Command.of(np.zeros((s.vehicles, 3)))
    for _ in range(round(2.0 * s.start.radius_m / 15.0 / PERIOD_S)):
        wanted = nominal(0.0, View(state, level))
        view = View(state, wanted)
        decision = filter_(view, wanted, limits)
        if decision.override.sum() > s.vehicles // 2:
            found.append(Moment(view, wanted, limits))
            if len(found) == count:
                break
        state = step(state, decision.command, PERIOD_S)
    return filter_, found


def step_cost(vehicles: int, mode: str, bare: BareStep, moments: int, goes: int) -> dict[str, float]:
    """Bare steps per filter step while most vehicles' commands are changed, and how many QPs failed."""
    filter_, asked = active_moments(circle(vehicles, mode), moments)
    if not asked:
        raise RuntimeError(f"{vehicles} vehicles never met")
    bare.measure()
    cost, unsolved = [], 0
    for m in asked:
        cost.append(least(lambda m=m: filter_(m.view, m.nominal, m.limits), goes))  # type: ignore[misc]
        unsolved += int(np.sum(filter_(m.view, m.nominal, m.limits).status != Status.SOLVED))
    bare.measure()
    return {
        "vehicles": vehicles,
        "bare_steps": float(np.mean(cost)) / bare.seconds,
        "moments": len(asked),
        "unsolved": unsolved,
    }


def exponent(rows: list[dict[str, float]]) -> float:
    """The power of the number of vehicles that the costs grow by, between the first row and the last."""
    first, last = rows[0], rows[-1]
    grown = last["bare_steps"] / first["bare_steps"]
    return float(np.log(grown) / np.log(last["vehicles"] / first["vehicles"]))


def _fresh(barrier: ForwardDifference, filter_: CollisionFilter, m: Moment, vehicle: int) -> Array:
    """One vehicle's input as the authors' program finds it: differenced gradients, a new OSQP, every row."""
    import osqp
    from scipy import sparse

    n = len(m.view.state)
    others = np.delete(np.arange(n), vehicle)
    i, j = np.minimum(others, vehicle), np.maximum(others, vehicle)
    rows = pair_rows(barrier.values(m.view.state, i, j), m.view.state, filter_.alpha)
    gamma = filter_.gamma(n)
    assert gamma is not None
    first = (i == vehicle)[:, None]
    lie_i, lie_j = rows.lie
    own, other = np.where(first, lie_i, lie_j), np.where(first, lie_j, lie_i)
    rhs = 0.5 * rows.rhs + 0.5 * (own @ gamma[vehicle] - np.einsum("rk,rk->r", other, gamma[others]))
    low, high = (corner[vehicle] for corner in m.limits.corners)
    target = m.nominal.array()[vehicle]
    solver = osqp.OSQP()
    solver.setup(
        sparse.identity(3, format="csc"),
        -target,
        sparse.csc_matrix(np.vstack([own, np.eye(3)])),
        np.concatenate([rhs, low]),
        np.concatenate([np.full(len(rhs), np.inf), high]),
        eps_abs=1e-6,
        eps_rel=1e-6,
        polishing=True,
        verbose=False,
    )
    return np.asarray(solver.solve(raise_error=False).x)


@contextmanager
def _silent() -> Iterator[None]:
    """OSQP's library prints that there is nothing to polish whatever it is told."""
    sys.stdout.flush()
    kept, nowhere = os.dup(1), os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    try:
        yield
    finally:
        ctypes.CDLL(None).fflush(None)
        os.dup2(kept, 1)
        os.close(kept)
        os.close(nowhere)


def against_fresh_osqp(bare: BareStep, moments: int) -> dict[str, float]:
    """Filter steps spread over `paper-20-turn` on unicycles, both ways, in bare steps per vehicle-step."""
    s = scenario.load("paper-20-turn")
    start, goal = places(s, generators(s.seed)["start"])
    barrier = catalogue.barrier(s)
    filter_ = CollisionFilter(barrier, catalogue.alpha(s), mode="limited")
    limits, nominal = catalogue.limits(s), catalogue.guidance(s, goal, barrier)
    differenced = ForwardDifference(barrier)
    every = s.filter_steps // moments
    state, ours, fresh, apart = start, [], [], []
    level = Command.of(np.zeros((s.vehicles, 3)))
    bare.measure()
    for k in range(s.filter_steps):
        wanted = nominal(0.0, View(state, level))
        m = Moment(View(state, wanted), wanted, limits)
        decision = filter_(m.view, wanted, limits)
        if k % every == every // 2:
            ours.append(least(lambda m=m: filter_(m.view, m.nominal, m.limits), 5))  # type: ignore[misc]
            began = clock()
            with _silent():
                found = np.array([_fresh(differenced, filter_, m, v) for v in range(s.vehicles)])
            fresh.append(clock() - began)
            solved = decision.status == Status.SOLVED
            apart.append(np.abs(found - decision.command.array())[solved].max(initial=0.0))
        state = step(state, decision.command, s.rates.filter_dt_s)
    bare.measure()
    unit = bare.seconds * s.vehicles
    return {
        "ours": float(np.median(ours)) / unit,
        "ours_mean": float(np.mean(ours)) / unit,
        "fresh": float(np.median(fresh)) / unit,
        "times": float(np.mean(fresh) / np.mean(ours)),
        "apart": float(np.max(apart)),
        "moments": len(ours),
    }
