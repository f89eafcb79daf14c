"""Makes the parts of one run, and wraps those of a user's own so that their calls are checked."""

from __future__ import annotations

import copy
from collections.abc import Callable
from typing import Any

import numpy as np

from aircraft.plant import Plant
from filters.barriers.pairs import Barrier
from filters.filter import Choose
from filters.model import Array, Limits
from testbed.components import catalogue, remedies
from testbed.components.border.contract import Contract, locked
from testbed.components.border.others import OwnEnvironment, OwnFilter, OwnGuidance
from testbed.components.border.plant import OwnPlant
from testbed.components.components import Parts
from testbed.components.guidance import Guidance
from testbed.components.initial_conditions import generators, places
from testbed.components.provenance import Origin
from testbed.environment.environment import Environment
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario

# What messages call the parts.
WORDS = {"plant": "plant", "filter": "filter", "nominal": "guidance", "disturbance": "environment"}


class Maker:
    """Makes each part from the scenario, the unmodified barrier, the goals (N, 3) m and the limits.

    own  `parts.own()`: the parts that are a user's

    All methods raise Breach if a user's maker raises, or makes what is no such part; UserError passes.
    """

    def __init__(
        self,
        parts: Parts,
        own: dict[str, Origin],
        scenario: Scenario,
        barrier: Barrier,
        goal: Array,
        limits: Limits,
    ) -> None:
        self._parts, self._own = parts, own
        self._scenario, self._barrier, self._goal, self._limits = scenario, barrier, goal, limits

    def environment(self, rngs: dict[str, np.random.Generator]) -> Environment:
        """The environment, drawing from the generators `rngs`."""
        s = self._scenario
        if "disturbance" not in self._own:
            return self._parts.disturbance(s, rngs)
        fresh = generators(s.seed)
        places(s, fresh["start"])  # as far as it was drawn from
        contract = self._contract("disturbance")
        made = self._make(contract, self._parts.disturbance, self._copied(), fresh)
        return OwnEnvironment(contract, made)

    def plant(self, wind: Array) -> Plant:
        """The plant, for `wind` (N, 3) m/s at the start."""
        if "plant" not in self._own:
            return self._parts.plant(self._scenario, wind)
        contract = self._contract("plant")
        made = self._make(contract, self._parts.plant, self._copied(), locked(wind.copy()))
        return OwnPlant(contract, made, self._scenario.rates.fdm_dt_s)

    def filter(self) -> Choose:
        """The filter."""
        if "filter" not in self._own:
            return self._parts.filter(self._scenario, self._barrier, self._goal)
        contract = self._contract("filter")
        s, barrier = remedies.for_own_filter(self._scenario), self._barrier
        if s is not self._scenario:
            barrier = catalogue.barrier(s)
        given = s.model_copy(deep=True), copy.deepcopy(barrier), locked(self._goal.copy())
        made = self._make(contract, self._parts.filter, *given)
        if callable(made):
            made = remedies.wrap(self._scenario, made, barrier, catalogue.lags)
        return OwnFilter(contract, made, self._limits)

    def guidance(self) -> Guidance:
        """The guidance."""
        if "nominal" not in self._own:
            return self._parts.nominal(self._scenario, self._goal, self._barrier)
        contract = self._contract("nominal")
        given = self._copied(), locked(self._goal.copy()), copy.deepcopy(self._barrier)
        return OwnGuidance(contract, self._make(contract, self._parts.nominal, *given))

    def _contract(self, part: str) -> Contract:
        return Contract(WORDS[part], self._own[part].name, self._scenario.vehicles)

    def _copied(self) -> Scenario:
        return self._scenario.model_copy(deep=True)

    @staticmethod
    def _make(contract: Contract, maker: Callable[..., Any], *given: Any) -> Any:
        def make() -> Any:
            try:
                return maker(*given)
            except UserError as error:
                return error

        made = contract.call("making it", make)
        if isinstance(made, UserError):
            raise made
        return made
