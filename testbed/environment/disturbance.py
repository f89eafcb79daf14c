"""What disturbs a flight, moving air and imperfect knowledge, and how a scenario says so."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import radians
from typing import Protocol

import numpy as np

from filters.model import Array, Command, State, View
from testbed.environment import gusts
from testbed.environment.network import Network
from testbed.environment.sensing import Sensing
from testbed.environment.wind import SteadyWind
from testbed.scenario.scenario import Scenario


class Disturbance(Protocol):
    """What moves the air, and what the vehicles know.

    windy                     whether the air moves at all
    wind(t, state)            the air's motion over the ground (N, 3) m/s, east, north and up; depends on
                              nothing but time and place, so any plant, at any time, meets the same air
    observe(t, truth, rates)  what the vehicles know; asked once at every filter step, in order
    """

    windy: bool

    def wind(self, t: float, state: State) -> Array: ...
    def observe(self, t: float, truth: State, rates: Command) -> View: ...


class Disturbances:
    """Steady wind and gusts, and stages of knowledge, each made from the one before; all of them optional.

    Without stages `observe` hands on the truth itself.
    """

    def __init__(
        self,
        steady: SteadyWind | None = None,
        field: gusts.GustField | None = None,
        stages: Sequence[Callable[[View], View]] = (),
    ) -> None:
        self._steady, self._field, self._stages = steady, field, tuple(stages)
        self.windy = steady is not None or field is not None

    def wind(self, t: float, state: State) -> Array:
        air = np.zeros((len(state), 3)) if self._steady is None else self._steady(state.z)
        if self._field is not None:
            air = air + self._field(t, np.stack([state.x, state.y, state.z], axis=-1))
        return air

    def observe(self, t: float, truth: State, rates: Command) -> View:
        view = View(truth, rates)
        for stage in self._stages:
            view = stage(view)
        return view


def build(s: Scenario, rngs: dict[str, np.random.Generator]) -> Disturbances:
    """The disturbances of `s`, drawing from the generators named gust, noise and network."""
    w, g = s.wind, s.gusts
    steady = None
    if w.speed_mps or w.updraft_mps or w.shear_per_s:
        steady = SteadyWind(
            w.speed_mps, radians(w.towards_deg), w.updraft_mps, w.shear_exponent, w.shear_per_s
        )
    field = None
    sigma = gusts.SIGMA_MPS[g.intensity] if g.sigma_mps is None else g.sigma_mps
    if sigma:
        carried = np.zeros(3) if steady is None else steady.mean()
        field = gusts.draw(rngs["gust"], sigma, g.length_scale_m, carried, s.vehicles if g.independent else 1)
    return Disturbances(steady, field, _knowledge(s, rngs))


def _knowledge(s: Scenario, rngs: dict[str, np.random.Generator]) -> list[Callable[[View], View]]:
    """Measurement first, then the delays and losses on the way to whoever uses it."""
    m, link, dt = s.sensing, s.network, s.rates.filter_dt_s
    position, course, speed, turn = (
        np.array([getattr(m, name.format(kind)) for kind in ("noise", "drift", "bias")])
        for name in ("position_{}_m", "course_{}_deg", "speed_{}_mps", "turn_rate_{}_degps")
    )
    course, turn = np.radians(course), np.radians(turn)
    sigmas = np.stack([position, position, course, position, speed, turn, speed], axis=-1)
    stages: list[Callable[[View], View]] = []
    if sigmas.any():
        persistence = float(np.exp(-dt / m.drift_time_s))
        noise, drift, bias = sigmas
        everyone = m.source == "sensors"
        stages.append(Sensing(noise, drift, bias, persistence, everyone, s.vehicles, rngs["noise"]))
    if m.delay_s or link.latency_s or link.loss:
        # A centralised QP is solved in one place, which hears of every vehicle over a link.
        central = s.filter.kind == "centralised"
        late = (m.delay_s, link.latency_s, link.loss)
        stages.append(Network(s.vehicles, dt, *late, link.stale, central, rngs["network"]))
    return stages
