"""A filter of your own: fly the evading manoeuvre whenever somebody is near. No QP, no barrier.

python docs/guide/examples/own_filter.py
"""

import numpy as np

import testbed
from filters.filter import Decision
from filters.model import Command

NEAR_M = 60.0


class TurnAway:
    """Made from the scenario, the barrier (whose manoeuvre it flies) and the goals; called at every step."""

    def __init__(self, scenario, barrier, goal):
        self.gamma = barrier.manoeuvre(scenario.vehicles).array()

    def __call__(self, view, nominal, limits):
        seen = view.own().state
        place = seen.position
        distance = np.linalg.norm(place[:, None] - place, axis=-1) + np.diag(np.full(len(place), np.inf))
        near = distance.min(axis=1) < NEAR_M
        wanted = np.clip(nominal.array(), limits.lower.array(), limits.upper.array())
        command = np.where(near[:, None], self.gamma, wanted)
        changed = np.abs(command - wanted).max(axis=1)
        return Decision(
            command=Command.of(command),
            status=np.zeros(len(place), dtype=int),  # NONE: there is no QP,
            residual=np.zeros(len(place)),  # so nothing is left over of it,
            override=changed > 1e-6,
            deviation=changed,
            pairs=None,  # and no h.
            hdot_predicted=np.zeros(0),
        )


if __name__ == "__main__":
    scenario = testbed.load_scenario(
        "paper-2-turn", ["lookahead_m=10", "filter_dt_s=0.05", "record_dt_s=0.05"]
    )
    run = testbed.run(scenario, parts=testbed.Parts(filter=TurnAway))
    print(
        run.scorecard.loc[["separation", "safe-set", "qp-feasibility", "goal"], ["verdict", "value", "why"]]
    )
