"""A run flown step by step, with commands from outside: the first vehicle turns away early.

python docs/guide/examples/own_commands.py
"""

import numpy as np

import testbed
from filters.model import Command

if __name__ == "__main__":
    scenario = testbed.load_scenario("paper-2-turn", ["filter_dt_s=0.05", "record_dt_s=0.05"])
    session = testbed.assemble(scenario)
    step = session.reset()  # t, state, rates, view, air; nominal and decision once something was flown
    while not step.done:
        seen = step.view.own().state  # what each vehicle knows of itself
        turn = np.where((np.arange(2) == 0) & (seen.x < -100.0), 0.03, 0.0)
        # The filter alters what is given; `session.step()` asks the scenario's guidance instead.
        step = session.step(Command(np.full(2, 20.0), turn, np.zeros(2)))
    run = session.judge()
    print(run.scorecard.loc[["separation", "safe-set", "goal"], ["verdict", "value", "margin", "t_s"]])
    print("parts:", {part: origin["name"] for part, origin in run.manifest["parts"].items()})
