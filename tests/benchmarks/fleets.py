"""Large fleets in bare steps: 2 to 1,000 X8s at the density of traffic, by one worker and two; unicycles.

Times of aircraft are those of the clock on the wall, since several processes work: only an idle machine gives
numbers. Those of one process are the processor's.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import testbed
from aircraft.jsbsim.fleet import JsbsimFleet
from benchmarks.clock import BareStep, in_turn
from benchmarks.interval import median_of, until_decided
from benchmarks.runs import RUNS
from filters.barriers.closed_form import TurnBarrier
from filters.cbf.collision import CollisionFilter
from filters.model import Command, View
from testbed.components import catalogue
from testbed.components.initial_conditions import generators, places
from testbed.components.neighbours import neighbours
from testbed.records.store import RunWriter, staged
from testbed.scenario import scenario
from testbed.scenario.scenario import Scenario, parse
from testbed.simulation import simulate

SIZES = (2, 5, 20, 100, 300, 1000)
PER_M2 = 25e-6  # one vehicle per 0.04 km2
# Aircraft steps of a row of the curve, at least so many filter steps and at most.
VEHICLE_STEPS, LEAST_STEPS, MOST_STEPS = 100_000, 20, 200

clock, processor = time.perf_counter, time.process_time


def city(vehicles: int, plant: str, duration_s: float, workers: int = 1) -> Scenario:
    """Vehicles on their ways across a square at the density of traffic; filter and recording at 20 Hz."""
    side = max(300.0, float(np.sqrt(vehicles / PER_M2)))
    start = {"pattern": "random-goals", "square_m": side, "goal_distance_m": side / 2, "start_h_m": 1.0}
    rates: dict[str, Any] = {"fdm_dt_s": 0.005, "filter_dt_s": 0.05, "record_dt_s": 0.05}
    if plant == "jsbsim":
        rates["workers"] = workers
    said = {"name": "city", "vehicles": vehicles, "plant": plant, "duration_s": duration_s, "start": start}
    rest = {"filter": {"kind": "limited"}, "rates": rates, "checks": {"manoeuvre_instants": 0}}
    return parse(said | rest)


class InFleet:
    """Seconds on the wall spent in `JsbsimFleet.step`, while the block runs."""

    def __enter__(self) -> InFleet:
        self.seconds, self._step = 0.0, JsbsimFleet.step
        step = self._step

        def timed(*given: Any) -> Any:
            began = clock()
            try:
                return step(*given)
            finally:
                self.seconds += clock() - began

        JsbsimFleet.step = timed  # type: ignore[method-assign,assignment]
        return self

    def __exit__(self, *error: object) -> None:
        JsbsimFleet.step = self._step  # type: ignore[method-assign]


def cost(vehicles: int, workers: int, bare: BareStep, place: Path) -> dict[str, Any]:
    """One row of the curve: X8s at 20 Hz, in bare steps per vehicle-step."""
    steps = min(MOST_STEPS, max(LEAST_STEPS, VEHICLE_STEPS // (10 * vehicles)))
    s = city(vehicles, "jsbsim", 0.05 * (steps + 2), workers)
    unit = bare.measure()
    with InFleet() as fleet, staged(place / f"{vehicles}-{workers}", True) as folder:
        began, writer = clock(), RunWriter(folder)
        session = testbed.assemble(s, force=True, sink=writer)
        step = session.reset()
        start_s, stamps = clock() - began, [clock()]
        while not step.done:
            step = session.step()
            stamps.append(clock())
        writer.finish(session.judge())
        finish_s = clock() - stamps[-1]
    # The first two steps warm up.
    each = np.diff(stamps)[2:] / (10 * vehicles)
    flight = stamps[-1] - stamps[0] + finish_s
    return {
        "vehicles": vehicles,
        "workers": workers,
        "start_s": start_s,
        "beyond_fdm": 1.0 - fleet.seconds / flight,
        "bare_us": 1e6 * unit,
        # The same by JSBSim alone, in turns of as many periods with nothing between.
        "in_turn": in_turn(vehicles, 10) / unit if workers == 1 else 0.0,
        **median_of((each / unit).tolist()).to_json(),
    }


def against_bare(workers: int, target: float, bare: BareStep, place: Path) -> dict[str, Any]:
    """`20 X8s, filter 20 Hz, limited` on the wall: the flight over its bare steps, repeated."""
    source, changes, _ = RUNS["20 X8s, filter 20 Hz, limited"]
    s = scenario.load(source, [*changes, f"rates.workers={workers}"])
    unit = bare.seconds * s.vehicles * s.filter_steps * s.rates.fdm_steps

    def flight() -> float:
        stamps: list[float] = []
        simulate.run(
            s, place / "run", force=True, overwrite=True, progress=lambda t, end: stamps.append(clock())
        )
        return (clock() - stamps[0]) / unit

    bare.measure()
    found = until_decided(flight, target, most=9)
    bare.measure()
    return {"workers": workers, "target": target, "bare_us": 1e6 * bare.seconds} | found.to_json(target)


def filter_step(vehicles: int) -> dict[str, float]:
    """Microseconds of a filter step by near pairs, at the start of a flight at the density of traffic."""
    s = city(vehicles, "unicycle", 1.0)
    start, goal = places(s, generators(s.seed)["start"])
    barrier, limits, alpha = catalogue.barrier(s), catalogue.limits(s), catalogue.alpha(s)
    assert isinstance(barrier, TurnBarrier)
    reach = barrier.reach(vehicles)
    near = neighbours(s, barrier, alpha, limits)
    if near is None and reach is not None:  # so few that all pairs would be looked at
        from filters.barriers.reach import Neighbours

        near = Neighbours(reach, reach.binding(alpha, limits, barrier.manoeuvre(vehicles)))
    made = CollisionFilter(barrier, alpha, mode="limited", near=near)
    level = Command.of(np.zeros((vehicles, 3)))
    wanted = catalogue.guidance(s, goal, barrier)(0.0, View(start, level))
    view, samples = View(start, wanted), []
    for _ in range(60):
        began = processor()
        made(view, wanted, limits)
        samples.append(1e6 * (processor() - began))
    return {"vehicles": vehicles, "us": statistics.median(samples)}


def unicycles(bare: BareStep, place: Path, duration_s: float) -> dict[str, Any]:
    """1,000 unicycles in bare steps per vehicle-step, all judging and recording included."""
    s = city(1000, "unicycle", duration_s)
    unit, stamps = bare.measure(), list[float]()
    simulate.run(
        s, place / "unicycles", force=True, overwrite=True, progress=lambda t, end: stamps.append(processor())
    )
    flight, steps = processor() - stamps[0], 1000 * s.filter_steps * s.rates.fdm_steps
    each = (np.diff(stamps) / (1000 * s.rates.fdm_steps * unit)).tolist()
    return {"duration_s": duration_s, "whole": flight / (steps * unit)} | median_of(each).to_json(3.0)


def measure(quick: bool, bare: BareStep, place: Path, note: Callable[[str], None]) -> dict[str, Any]:
    """All rows of large fleets, as plain data."""
    found: dict[str, Any] = {"curve": [], "against_bare": []}
    for workers, target in ((1, 1.5), (2, 0.85)):
        note(f"20 X8s on the wall, {workers} workers")
        found["against_bare"].append(against_bare(workers, target, bare, place))
    for vehicles in SIZES[:4] if quick else SIZES:
        for workers in (1, 2):
            note(f"{vehicles} X8s at the density of traffic, {workers} workers")
            found["curve"].append(cost(vehicles, workers, bare, place))
    note("filter steps of near pairs")
    found["filter"] = [filter_step(n) for n in (100, 200, 500, 1000)]
    note("1,000 unicycles")
    found["unicycles"] = unicycles(bare, place, 2.0 if quick else 60.0)
    return found
