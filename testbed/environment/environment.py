"""The environment of a run: the air that moves the vehicles, and what they know of each other."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from filters.model import Array, Command, State, View
from testbed.environment import atmosphere, observation
from testbed.environment.atmosphere import Atmosphere
from testbed.environment.observation import Observation
from testbed.scenario.scenario import Scenario


class Environment(Atmosphere, Observation, Protocol):
    """An atmosphere and an observation in one object: what `Parts(disturbance=...)` makes."""


@dataclass(frozen=True)
class Surroundings:
    """An Environment made of its two halves; calm air and full knowledge unless given."""

    atmosphere: Atmosphere = field(default_factory=atmosphere.Air)
    observation: Observation = field(default_factory=observation.Knowledge)

    def wind(self, t: float, state: State) -> Array | None:
        """As `Atmosphere.wind`."""
        return self.atmosphere.wind(t, state)

    def observe(self, t: float, truth: State, rates: Command) -> View:
        """As `Observation.observe`."""
        return self.observation.observe(t, truth, rates)


def build(s: Scenario, rngs: dict[str, np.random.Generator]) -> Surroundings:
    """The environment of `s`, drawing from the generators named gust, noise and network."""
    return Surroundings(atmosphere.build(s, rngs["gust"]), observation.build(s, rngs))
