"""The motion of the air: the Atmosphere protocol, and steady wind with gusts from a scenario."""

from __future__ import annotations

from math import radians
from typing import Protocol

import numpy as np

from filters.model import Array, State
from testbed.environment import gusts
from testbed.environment.wind import SteadyWind
from testbed.scenario.scenario import Scenario


class Atmosphere(Protocol):
    """The air's motion over the ground."""

    def wind(self, t: float, state: State) -> Array | None:
        """The wind (N, 3) m/s, east, north and up, at time t [s] where the vehicles are (N,).

        Depends on nothing but time and place, so that any plant meets the same air at any time.
        None means that the air is still, for the whole run: who answers None once answers it always.
        """
        ...


class Air:
    """Steady wind plus gusts; either may be absent, and without both the air is still."""

    def __init__(self, steady: SteadyWind | None = None, field: gusts.GustField | None = None) -> None:
        self._steady, self._field = steady, field

    def wind(self, t: float, state: State) -> Array | None:
        """As `Atmosphere.wind`."""
        if self._steady is None and self._field is None:
            return None
        air = np.zeros((len(state), 3)) if self._steady is None else self._steady(state.z)
        if self._field is not None:
            air = air + self._field(t, state.position)
        return air


def build(s: Scenario, rng: np.random.Generator) -> Air:
    """The air of `s`; gusts are drawn from `rng`."""
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
        field = gusts.draw(rng, sigma, g.length_scale_m, carried, s.vehicles if g.independent else 1)
    return Air(steady, field)
