"""FleetEnvironment: a scenario as a PettingZoo parallel environment, every vehicle an agent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filters.model import Array
from testbed.components.components import Parts
from testbed.gym.episode import Episode, scenario_of
from testbed.gym.extra import require
from testbed.gym.rewards import Reward, progress
from testbed.records.run import Run
from testbed.scenario.scenario import Scenario

require("gymnasium")
require("pettingzoo")
from gymnasium import spaces  # noqa: E402
from pettingzoo import ParallelEnv  # noqa: E402

Each = dict[str, Any]


class FleetEnvironment(ParallelEnv[str, Array, Array]):
    """Every vehicle is an agent, `vehicle_1` and so on; the filter alters what all of them want.

    Arguments, actions, observations and rewards are those of `testbed.gym.ego.EgoEnvironment`, without `ego`.
    An agent is terminated by its loss of Ds (if `end_at_loss`) or when it has left, all of them by a fault;
    all are truncated at the end of the run. A vehicle whose agent is done is flown on by its guidance.
    """

    metadata = {"render_modes": [], "name": "testbed"}  # noqa: RUF012

    def __init__(
        self,
        scenario: Scenario | str | Path,
        overrides: Sequence[str] = (),
        *,
        filtered: bool = True,
        reward: Reward = progress,
        end_at_loss: bool = True,
        parts: Parts | None = None,
        force: bool = False,
    ) -> None:
        s = scenario_of(scenario, overrides, filtered)
        self._episode = Episode(s, parts, reward, end_at_loss, force)
        self.possible_agents = [f"vehicle_{k}" for k in range(1, s.vehicles + 1)]
        self.agents: list[str] = []
        self._place = {agent: k for k, agent in enumerate(self.possible_agents)}
        low, high = self._episode.low, self._episode.high
        self.names = {agent: self._episode.names(k) for agent, k in self._place.items()}
        self.action_spaces = {
            a: spaces.Box(low[k], high[k], dtype=np.float64) for a, k in self._place.items()
        }
        self.observation_spaces = {
            a: spaces.Box(-np.inf, np.inf, (len(self.names[a]),), dtype=np.float64) for a in self._place
        }

    def observation_space(self, agent: str) -> spaces.Box:
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Box:
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Each, Each]:
        """Start an episode; `options` are not used."""
        self._episode.reset(seed)
        self.agents = list(self.possible_agents)
        return self._of(self._episode.observation), self._of(self._episode.info)

    def step(self, actions: Mapping[str, Array]) -> tuple[Each, Each, Each, Each, Each]:
        """Fly one filter period.

        Raises  ValueError for an agent without an action, or an action that is none; RuntimeError if no agent
                takes part any more
        """
        if not self.agents:
            raise RuntimeError("no agent takes part: reset() starts an episode")
        if missing := [agent for agent in self.agents if agent not in actions]:
            raise ValueError(f"actions: none for {missing[0]}; give one for each of {', '.join(self.agents)}")
        episode = self._episode
        episode.fly({self._place[agent]: actions[agent] for agent in self.agents})
        terminated = self._of(episode.terminated)
        truncated = {agent: episode.truncated and not done for agent, done in terminated.items()}
        found = (
            self._of(episode.observation),
            self._of(episode.reward),
            terminated,
            truncated,
            self._of(episode.info),
        )
        self.agents = [a for a in self.agents if not terminated[a] and not truncated[a]]
        return found

    def judge(self) -> Run:
        """The episode as a run, with its verdicts; not flown to its end, it counts as ended early."""
        return self._episode.judge()

    def close(self) -> None:
        self._episode.close()

    def _of(self, what: Any) -> Each:
        """Agent -> `what` of its vehicle, for the agents that take part."""
        return {agent: what(self._place[agent]) for agent in self.agents}
