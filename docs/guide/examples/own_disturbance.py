"""A disturbance of your own: a thermal in the middle, on top of whatever the scenario has.

python docs/guide/examples/own_disturbance.py
"""

import numpy as np

import testbed
from testbed.environment.environment import build

CORE_MPS = 3.0
RADIUS_M = 60.0


class Thermal:
    """Rising air about the origin. What vehicles know is left to the scenario's sensing and network."""

    def __init__(self, scenario, generators):
        self.usual = build(scenario, generators)

    def wind(self, t, state):
        air = self.usual.wind(t, state)  # (N, 3) m/s: east, north, up; None in still air
        if air is None:
            air = np.zeros((len(state), 3))
        air[:, 2] += CORE_MPS * np.exp(-(state.x**2 + state.y**2) / RADIUS_M**2)
        return air

    def observe(self, t, truth, rates):
        return self.usual.observe(t, truth, rates)


if __name__ == "__main__":
    settings = ["plant=lagged", "lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05"]
    scenario = testbed.load_scenario("paper-2-turn", settings)
    run = testbed.run(scenario, parts=testbed.Parts(disturbance=Thermal))
    print(f"strongest updraft met: {run.vehicles.wind_up_mps.max():.2f} m/s")
    print(run.scorecard.loc[["separation", "safe-set"], ["verdict", "value", "margin", "t_s"]])
