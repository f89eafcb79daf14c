"""One scenario flown again and again, a filter period at a time, by actions: what both environments share."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from filters.model import Array, Command, View
from testbed.components import catalogue
from testbed.components.components import Parts
from testbed.errors import UserError
from testbed.gym.observation import distance, names, observe
from testbed.gym.rewards import Reward, Transition, rewarded
from testbed.records.run import Run
from testbed.scenario.scenario import Scenario, load
from testbed.scenario.variants import changed
from testbed.simulation.session import Session, assemble
from testbed.simulation.step import Step

# The largest seed of a scenario, and the largest that is drawn.
LARGEST_SEED, LARGEST_DRAWN = 2**63 - 1, 2**31 - 1


def scenario_of(source: Scenario | str | Path, overrides: Sequence[str], filtered: bool) -> Scenario:
    """The scenario to fly: given, or read with overrides; without its filter unless `filtered`."""
    if isinstance(source, Scenario):
        if overrides:
            raise UserError(
                "overrides: they change a scenario that is read; this one is given, change it itself"
            )
        s = source
    else:
        s = load(source, list(overrides))
    return s if filtered else changed(s, {"filter.kind": "none"})


class Episode:
    """A scenario's runs, one after another.

    scenario     what is flown; its seed is changed by `reset`
    parts        of your own; None is the scenario's
    reward       see `testbed.gym.rewards`
    end_at_loss  whether a vehicle is done when it is nearer than Ds to another
    force        fly even from a start outside the safe set
    """

    def __init__(
        self, scenario: Scenario, parts: Parts | None, reward: Reward, end_at_loss: bool, force: bool
    ) -> None:
        if not callable(reward):
            raise UserError(f"reward: give a function of a Transition, not {reward!r}")
        self.scenario = scenario
        self._parts, self._reward, self._end_at_loss, self._force = parts, reward, end_at_loss, force
        self._session: Session | None = None
        self._drawn: np.random.Generator | None = None
        low, high = catalogue.limits(scenario).corners
        self.low, self.high = low, high

    def reset(self, seed: int | None) -> None:
        """Start a run; the one before, if it was not judged, is lost.

        seed    of the run; None is the scenario's own the first time, and then drawn from the one before
        Raises  ValueError for a seed that is none; UserError where no run can start
        """
        if seed is not None or self._drawn is None:
            flown = self.scenario.seed if seed is None else seed
            if (
                isinstance(flown, bool)
                or not isinstance(flown, int | np.integer)
                or not 0 <= flown <= LARGEST_SEED
            ):
                raise ValueError(f"seed {flown!r}: give a whole number, 0 to {LARGEST_SEED}")
            self._drawn = np.random.default_rng(flown)
        else:
            flown = int(self._drawn.integers(LARGEST_DRAWN))
        self.close()
        s = self.scenario.model_copy(update={"seed": int(flown)})
        self._session = assemble(s, self._parts, force=self._force)
        self._stand(self._session.reset())
        if self.step.done:
            raise UserError(
                self.step.fault or "duration_s: 0 s leaves nothing to fly; give at least one filter period"
            )

    def fly(self, actions: Mapping[int, Array]) -> None:
        """One filter period: vehicles (from 0) by their actions, the others by their guidance.

        Raises  RuntimeError if there is no run, or it is over; ValueError for an action that is none
        """
        commands, of = np.zeros((self.scenario.vehicles, 3)), np.zeros(self.scenario.vehicles, dtype=bool)
        for vehicle, action in actions.items():
            commands[vehicle], of[vehicle] = self.action(vehicle, action), True
        session = self.session
        self.before = self.step
        self._stand(session.step(Command.of(commands), of=of))

    def action(self, vehicle: int, action: object) -> Array:
        """The command (3,) that an action asks for: within the limits, the nearest one."""
        try:
            asked = np.asarray(action, dtype=float)
        except (TypeError, ValueError):
            asked = np.empty(0)
        if asked.shape != (3,) or not np.isfinite(asked).all():
            raise ValueError(
                f"action of vehicle {vehicle + 1}: give three finite numbers, ground speed [m/s], course rate"
                f" [rad/s] and climb rate [m/s]; got {action!r}"
            )
        return np.clip(asked, self.low[vehicle], self.high[vehicle])

    @property
    def session(self) -> Session:
        if self._session is None:
            raise RuntimeError("no run: reset() starts one")
        return self._session

    def observation(self, vehicle: int) -> Array:
        """The vector of `vehicle` (from 0); of the true states where a run ended before anybody knew any."""
        return observe(self._view, vehicle, self.session.setting.goal)

    def names(self, vehicle: int) -> tuple[str, ...]:
        """What its entries are; vehicles from 0."""
        return names(vehicle + 1, self.scenario.vehicles)

    def distance_m(self, vehicle: int) -> float:
        """True distance [m] of `vehicle` (from 0) to the nearest other; inf if there is none."""
        return distance(self.step.state, vehicle, self._there)

    def reward(self, vehicle: int) -> float:
        """For the period flown last. UserError if the reward is no finite number."""
        t = Transition(
            vehicle,
            self.before,
            self.step,
            self.session.setting.goal[vehicle],
            self.distance_m(vehicle),
            self.scenario.d_safe_m,
        )
        return rewarded(self._reward, t)

    def terminated(self, vehicle: int) -> bool:
        """Whether `vehicle` (from 0) is done before the end: by a fault, a loss, or because it has left."""
        lost = self._end_at_loss and self.distance_m(vehicle) < self.scenario.d_safe_m
        return self.step.fault is not None or lost or not self._there[vehicle]

    @property
    def truncated(self) -> bool:
        """Whether the run is over at its full duration."""
        return self.step.done and self.step.fault is None

    def info(self, vehicle: int) -> dict[str, object]:
        """Time, seed, true distance to the nearest vehicle; the command flown, and whether it was altered."""
        found: dict[str, object] = {
            "t_s": self.step.t,
            "seed": self.session.scenario.seed,
            "distance_m": self.distance_m(vehicle),
            "fault": self.step.fault,
        }
        decision = self.step.decision
        if decision is not None:
            found["command"] = decision.command.array()[vehicle]
            found["override"] = bool(decision.override[vehicle])
        return found

    def judge(self) -> Run:
        """The run flown last and its verdicts; see `Session.judge`."""
        return self.session.judge()

    def close(self) -> None:
        """End the run; may be called twice."""
        if self._session is not None:
            self._session.close()

    def _stand(self, step: Step) -> None:
        """Where the run stands now, and who has not left (N,)."""
        self.step = step
        self._view = step.view or View(step.state, step.rates)
        n = np.arange(self.scenario.vehicles)
        self._there = self._view.knows(n, n)
