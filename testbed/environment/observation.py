"""What the vehicles know: the Observation protocol, and measurement and communication from a scenario."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from filters.model import Command, State, View
from testbed.environment.known_range import KnownRange, unseen_steps
from testbed.environment.network import Network
from testbed.environment.sensing import Sensing
from testbed.scenario.scenario import Scenario


class Observation(Protocol):
    """What the vehicles know of themselves and of each other."""

    def observe(self, t: float, truth: State, rates: Command) -> View:
        """What is known at time t [s] of the true poses and rates (N,): arrays (N,), or (N, N) as
        [observer, vehicle] where each vehicle knows something else.

        Called once at every filter step, in order.
        """
        ...


class Knowledge:
    """Stages of knowledge, each made from the one before; without stages the truth itself is known."""

    def __init__(self, stages: Sequence[Callable[[View], View]] = ()) -> None:
        self._stages = tuple(stages)

    def observe(self, t: float, truth: State, rates: Command) -> View:
        """As `Observation.observe`."""
        view = View(truth, rates)
        for stage in self._stages:
            view = stage(view)
        return view


def build(s: Scenario, rngs: dict[str, np.random.Generator]) -> Knowledge:
    """What is known in `s`, drawing from the generators named noise and network.

    Measurement comes first, then the delays and losses on the way to whoever uses it.
    """
    m, link, dt = s.sensing, s.network, s.rates.filter_dt_s
    position, course, speed, turn = (
        np.array([getattr(m, name.format(kind)) for kind in ("noise", "drift", "bias")])
        for name in ("position_{}_m", "course_{}_deg", "speed_{}_mps", "turn_rate_{}_degps")
    )
    course, turn = np.radians(course), np.radians(turn)
    sigmas = np.stack([position, position, course, position, speed, turn, speed], axis=-1)
    stages: list[Callable[[View], View]] = []
    if m.range_m is not None:
        stages.append(KnownRange(m.range_m, unseen_steps(m.delay_s + link.latency_s, dt) - 1))
    if sigmas.any():
        persistence = float(np.exp(-dt / m.drift_time_s))
        noise, drift, bias = sigmas
        everyone = m.source == "sensors"
        stages.append(Sensing(noise, drift, bias, persistence, everyone, s.vehicles, rngs["noise"]))
    if m.delay_s or link.latency_s or link.loss:
        # A centralised QP is solved in one place, which hears of every vehicle over a link.
        central = s.filter.kind in ("centralised", "optimal-decay")
        late = (m.delay_s, link.latency_s, link.loss)
        stages.append(Network(s.vehicles, dt, *late, link.stale, central, rngs["network"]))
    return Knowledge(stages)
