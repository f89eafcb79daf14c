"""A nominal controller of your own: fly at 20 m/s and turn towards the goal.

python docs/guide/examples/own_nominal.py
"""

import numpy as np

import testbed
from filters.model import Command


class Homing:
    """Made from the scenario, the goals (N, 3) and the barrier; called with time and state at every step."""

    def __init__(self, scenario, goal, barrier):
        self.goal = goal

    def __call__(self, t, state):
        bearing = np.arctan2(self.goal[:, 1] - state.y, self.goal[:, 0] - state.x)
        error = np.remainder(bearing - state.theta + np.pi, 2 * np.pi) - np.pi
        speed = np.full(len(state), 20.0)
        return Command(speed, 0.5 * error, 0.1 * (self.goal[:, 2] - state.z))


if __name__ == "__main__":
    scenario = testbed.load_scenario("paper-2-turn", ["filter_dt_s=0.05", "record_dt_s=0.05"])
    run = testbed.run(scenario, parts=testbed.Parts(nominal=Homing))
    print(run.scorecard.loc[["separation", "safe-set", "goal"], ["verdict", "value", "margin", "t_s"]])
