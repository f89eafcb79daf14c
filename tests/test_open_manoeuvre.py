"""G9 between samples: the manoeuvre flown is open where its paths may come nearer than Ds between samples."""

import math
import re

import numpy as np
import pytest

from filters.model import Command, State
from testbed.claims.manoeuvre import fly
from testbed.components import catalogue
from testbed.records.verdict import Status
from testbed.scenario.scenario import load

DS = 5.0


class Weaving:
    """Two vehicles side by side, whatever they are told: the second comes nearer once, by 2 m, and goes back.

    Its least distance `nearest` [m] falls between samples dt [s] apart.
    """

    def __init__(self, nearest, dt):
        self.nearest, self.dt, self.k = nearest, dt, 0

    def at(self, k):
        t = self.dt * np.asarray(k, float)
        swing = 1.0 - np.cos(np.clip(2.0 * (t - 7.25), -np.pi, np.pi))  # nearest at 7.25 s
        x, y = np.stack([20 * t, 20 * t], -1), np.stack([0 * t, self.nearest + swing], -1)
        return np.stack([x, y, np.zeros_like(x)], axis=-1)

    def state(self):
        x, y, z = self.at(self.k).T
        return State(x, y, np.zeros(2), z)

    def step(self, command, wind, n):
        self.k += n
        return self.at(np.arange(self.k - n + 1, self.k + 1))

    def faults(self):
        return ["", ""]

    def achieved(self):
        return Command(np.full(2, 20.0), np.zeros(2), np.zeros(2))


def judged(nearest, dt, arcs=False):
    s = load(
        "paper-2-turn",
        [f"fdm_dt_s={dt!r}", f"filter_dt_s={dt!r}", f"record_dt_s={dt!r}", f"duration_s={200 * dt!r}"],
    )
    s = s.model_copy(update={"checks": s.checks.model_copy(update={"manoeuvre_instants": 1})})
    assert s.d_safe_m == DS
    barrier, limits = catalogue.barrier(s), catalogue.limits(s)
    calm = lambda t, state: np.zeros((2, 3))  # noqa: E731
    return fly(
        s, lambda t: Weaving(nearest, dt), calm, barrier, limits, [0.0], np.array([0]), np.array([1]), arcs
    )


# Its path bends by 4 m/s^2 at most, so distances between samples T apart are known to T^2 m.
@pytest.mark.parametrize(
    ("nearest", "dt", "status"),
    [
        (5.004, 0.1, Status.OPEN),  # may be 5 mm nearer than Ds between samples
        (5.004, 0.05, Status.HOLDS),  # known to 2.5 mm
        (5.05, 0.1, Status.HOLDS),
        (4.95, 0.1, Status.VIOLATED),
        (4.9996, 0.1, Status.OPEN),  # it does come nearer, but no sample shows it, nor the straight lines
        (4.9996, 0.0125, Status.VIOLATED),
    ],
)
def test_the_manoeuvre_holds_only_where_its_paths_cannot_come_nearer_between_samples(nearest, dt, status):
    found = judged(nearest, dt)
    assert found.status is status
    assert found.bound == pytest.approx(DS, abs=1e-6) and found.margin == found.value - found.bound
    (branch,) = found.detail["branches"]
    assert branch["radius_m"] == pytest.approx(dt**2, rel=0.1)
    assert branch["possible_m"] <= nearest + 1e-12
    if status is Status.OPEN:
        assert found.why.startswith("flown from 0 s, paths between samples may come as near as 4.99")
        assert ": sample finer, " in found.why


def test_the_step_that_an_open_manoeuvre_asks_for_would_do():
    found = judged(5.004, 0.1)
    step = float(re.search(r"sample finer, fdm_dt_s <= ([\d.]+) would do$", found.why)[1])
    assert 0.05 < step < 0.07
    assert judged(5.004, step).status is Status.HOLDS


def test_a_unicycle_flies_arcs_that_are_known():
    """The same samples of a plant that flies arcs are no reason to leave it open."""
    assert judged(5.004, 0.1, arcs=True).status is Status.HOLDS
    assert math.isclose(judged(5.004, 0.1, arcs=True).detail["branches"][0]["radius_m"], 0.0)
