"""EgoEnvironment: a scenario as a Gymnasium environment, of which one vehicle is flown by actions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from filters.model import Array
from testbed.components.components import Parts
from testbed.errors import UserError
from testbed.gym.episode import Episode, scenario_of
from testbed.gym.extra import require
from testbed.gym.rewards import Reward, progress
from testbed.records.run import Run
from testbed.scenario.scenario import Scenario

require("gymnasium")
import gymnasium  # noqa: E402
from gymnasium import spaces  # noqa: E402


class EgoEnvironment(gymnasium.Env[Array, Array]):
    """One vehicle is flown by actions, the others by their guidance; the filter alters what all of them want.

    scenario     a Scenario, or the name or file of one
    overrides    of a scenario that is read, such as ["duration_s=20"]
    ego          the vehicle flown by actions, from 1
    filtered     False flies the scenario without its filter: commands are clipped to the limits alone
    reward       function of a `testbed.gym.rewards.Transition`; default: metres nearer to the goal, less 100
                 at a loss of Ds
    end_at_loss  whether the episode ends when the ego is nearer than Ds to another vehicle
    parts        of your own; None is the scenario's
    force        fly even from a start outside the safe set
    Raises       UserError for a scenario that is none, an ego that it has not, a reward that is no function

    Action (3,): ground speed [m/s], course rate [rad/s], climb rate [m/s] asked for over the next filter
    period; the space is the vehicle's limits, and what is beyond them is flown at them.
    Observation: a vector in SI; `names` says what each entry is (see `testbed.gym.observation`).
    Terminated by a fault, by the loss, or when the ego has left; truncated at the end of the run.
    `reset(seed=k)` flies seed k of the scenario. Without a seed the first episode has the scenario's own, and
    later ones are drawn from it.
    """

    metadata = {"render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        scenario: Scenario | str | Path,
        overrides: Sequence[str] = (),
        *,
        ego: int = 1,
        filtered: bool = True,
        reward: Reward = progress,
        end_at_loss: bool = True,
        parts: Parts | None = None,
        force: bool = False,
    ) -> None:
        s = scenario_of(scenario, overrides, filtered)
        if isinstance(ego, bool) or not isinstance(ego, int | np.integer) or not 1 <= ego <= s.vehicles:
            raise UserError(f"ego {ego!r}: the scenario's vehicles are numbered 1 to {s.vehicles}")
        self._episode = Episode(s, parts, reward, end_at_loss, force)
        self._ego = int(ego) - 1
        self.names = self._episode.names(self._ego)
        self.action_space = spaces.Box(
            self._episode.low[self._ego], self._episode.high[self._ego], dtype=np.float64
        )
        self.observation_space = spaces.Box(-np.inf, np.inf, (len(self.names),), dtype=np.float64)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Start an episode; `options` are not used."""
        super().reset(seed=seed)
        self._episode.reset(seed)
        return self._episode.observation(self._ego), self._episode.info(self._ego)

    def step(self, action: Array) -> tuple[Array, float, bool, bool, dict[str, Any]]:
        """Fly one filter period. ValueError for an action that is not three finite numbers."""
        episode, ego = self._episode, self._ego
        episode.fly({ego: action})
        terminated = episode.terminated(ego)
        return (
            episode.observation(ego),
            episode.reward(ego),
            terminated,
            episode.truncated and not terminated,
            episode.info(ego),
        )

    def judge(self) -> Run:
        """The episode as a run, with its verdicts; not flown to its end, it counts as ended early."""
        return self._episode.judge()

    def close(self) -> None:
        self._episode.close()
