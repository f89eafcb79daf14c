"""What the border's checks of a user's own parts cost: calls through it less the same calls without."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

import testbed
from benchmarks.clock import least
from filters.barriers.pairs import PairValues, all_pairs
from filters.filter import Decision
from filters.model import Command, View
from testbed.components import catalogue
from testbed.components.border.making import Maker
from testbed.components.components import Parts
from testbed.components.initial_conditions import generators, places

PERIODS = 10


class Answers:
    """A part of any role that answers at once what it was given to answer."""

    def __init__(self, scenario: Any, state: Any, command: Command, decision: Decision) -> None:
        self.dt, self._state, self._command, self._decision = (
            scenario.rates.fdm_dt_s,
            state,
            command,
            decision,
        )
        self._track = np.repeat(state.position[None], PERIODS, axis=0)
        self._wind, self._fine = np.zeros((len(state), 3)), [""] * len(state)

    def reset(self, state: Any, rng: Any) -> None: ...

    def step(self, command: Command, wind: Any, n: int) -> Any:
        return self._track

    def state(self) -> Any:
        return self._state

    def achieved(self) -> Command:
        return self._command

    def telemetry(self) -> dict[str, Any]:
        return {}

    def faults(self) -> list[str]:
        return self._fine

    def wind(self, t: float, state: Any) -> Any:
        return self._wind

    def observe(self, t: float, truth: Any, rates: Command) -> View:
        return View(truth, rates)


def cost(vehicles: int) -> dict[str, float]:
    """Role -> what the border adds a filter step to a part of that role, in steps of the paper's filter.

    The paper's filter is the measure, not the bare step: checks and filter are both Python and numpy on few
    numbers, and a machine that is slow at these is slow at both.
    """
    settings = [f"vehicles={vehicles}", "filter_dt_s=0.05", "record_dt_s=0.05"]
    s = testbed.load_scenario("paper-20-turn", settings)
    start, goal = places(s, generators(s.seed)["start"])
    barrier, limits = catalogue.barrier(s), catalogue.limits(s)
    zeros, (i, j) = np.zeros(vehicles), all_pairs(vehicles)
    command = Command(np.full(vehicles, 20.0), zeros, zeros)
    pairs = PairValues(i, j, np.ones(i.size), np.ones((i.size, 8)))
    nothing = zeros.astype(int), zeros, zeros.astype(bool), zeros
    decision = Decision(command, *nothing, pairs, np.ones(i.size))
    plain = Decision(command, *nothing, None, np.zeros(0))
    raw = Answers(s, start, command, decision)
    parts = Parts(
        plant=lambda s, wind: raw,
        filter=lambda s, b, goal: lambda view, nominal, limits: decision,
        nominal=lambda s, goal, b: lambda t, state: command,
        disturbance=lambda s, generators: raw,
    )
    maker = Maker(parts, parts.own(), s, barrier, goal, limits)
    view, still = View(start, command), np.zeros((vehicles, 3))
    choose_plain = Maker(
        Parts(filter=lambda s, b, goal: lambda view, nominal, limits: plain),
        parts.own(),
        s,
        barrier,
        goal,
        limits,
    ).filter()
    plant, air, choose, law = maker.plant(still), maker.environment({}), maker.filter(), maker.guidance()
    plant.reset(start, np.random.default_rng(1), still, np.full(vehicles, 20.0))

    def flown(p: Any) -> Callable[[], object]:
        return lambda: (p.step(command, still, PERIODS), p.state(), p.achieved(), p.faults())

    def known(e: Any) -> Callable[[], object]:
        return lambda: (e.wind(0.0, start), e.observe(0.0, start, command))

    through = {
        "plant": (flown(plant), flown(raw)),
        "filter": (lambda: choose_plain(view, command, limits), lambda: plain),
        "filter with values of pairs": (lambda: choose(view, command, limits), lambda: decision),
        "guidance": (lambda: law(0.0, view), lambda: command),
        "environment": (known(air), known(raw)),
    }
    paper = Maker(Parts(), {}, s, barrier, goal, limits).filter()
    step = least(lambda: paper(view, command, limits), 300, 5)
    found = {role: least(own, 300, 5) - least(without, 300, 5) for role, (own, without) in through.items()}
    step = min(step, least(lambda: paper(view, command, limits), 300, 5))
    return {role: seconds / step for role, seconds in found.items()}
