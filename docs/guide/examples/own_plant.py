"""A plant of your own: vehicles that must bank before they turn.

python docs/guide/examples/own_plant.py
"""

import numpy as np

import testbed
from filters.model import Command, step

G_MPS2 = 9.81
LAG_S = 0.4


class Banked:
    """Turns at g tan(bank) / v; the bank follows the one the command needs with a lag. No wind reaches it."""

    def __init__(self, scenario, wind):
        self.dt = scenario.rates.fdm_dt_s

    def reset(self, state, rng, wind, speed):
        self.now, self.bank = state, np.zeros(len(state))
        self.rates = Command(speed, self.bank.copy(), self.bank.copy())

    def step(self, command, wind, n):
        track = np.empty((n, len(self.now), 3))
        for k in range(n):
            wanted = np.arctan(command.v * command.omega / G_MPS2)
            self.bank = self.bank + (wanted - self.bank) * self.dt / LAG_S
            self.rates = Command(command.v, G_MPS2 * np.tan(self.bank) / command.v, command.zeta)
            self.now = step(self.now, self.rates, self.dt)
            track[k] = self.now.position
        return track

    def state(self):
        return self.now

    def achieved(self):
        return self.rates

    def telemetry(self):
        return {"roll_rad": -self.bank}  # right wing down positive; a left turn is positive omega

    def faults(self):
        return [""] * len(self.now)


if __name__ == "__main__":
    scenario = testbed.load_scenario(
        "paper-2-turn", ["lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05"]
    )
    for name, parts in {"unicycle": testbed.Parts(), "banked": testbed.Parts(plant=Banked)}.items():
        separation = testbed.run(scenario, parts=parts).guarantee("separation")
        print(f"{name}: separation {separation['verdict']}, {separation['value']:.2f} m")
