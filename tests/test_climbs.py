"""The steepest climbs and descents, on an aircraft whose steady flights are known in closed form."""

import itertools
import math

import numpy as np
import pytest

from aircraft.jsbsim import climbs, steady
from aircraft.jsbsim.continuation import Problem, Reached, follow
from aircraft.jsbsim.shortfall import THROTTLE
from tests.paper_plane import EAST, PaperPlane, Ways, problem_of, start


@pytest.mark.parametrize("rudder", [False, True])
@pytest.mark.parametrize(("v", "omega"), [(20.0, 0.0), (16.0, 0.0), (23.0, 0.15), (18.0, -0.1)])
def test_idle_and_full_throttle_end_the_climbs(v, omega, rudder):
    plane = PaperPlane(rudder=rudder, idle=0.05, full=0.95)
    level = steady.trim(plane, start(19.0))
    plane.nodes["on"].value = 1.0
    found = climbs.climb_range(plane, v, omega, level)
    expected = plane.steepest(v, 0.05, omega), plane.steepest(v, 0.95, omega)
    assert found == pytest.approx(expected, abs=1e-6 if rudder or omega == 0 else 0.1)
    assert plane.nodes["on"].value == 0.0
    assert plane.nodes["yaw_ic"].value == pytest.approx(EAST, abs=0.2)  # eastwards


def test_a_climb_is_a_trim_with_the_throttle_given():
    plane = PaperPlane(rudder=True)
    level = steady.trim(plane, start(20.0))
    lowest, highest = climbs.climb_range(plane, 20.0, 0.1, level)
    for zeta, throttle in ((lowest, 0.0), (highest, 1.0)):
        assert steady.trim(plane, start(20.0, zeta), 0.1).throttle == pytest.approx(throttle, abs=1e-8)


def test_where_no_throttle_ends_them_climbs_end_at_60_degrees():
    steepest = 20.0 * math.tan(math.radians(60.0))
    strong = PaperPlane(thrust=12.0)  # climbs more steeply than that at full throttle
    lowest, highest = climbs.climb_range(strong, 20.0, 0.0, steady.trim(strong, start(20.0)))
    assert (lowest, highest) == pytest.approx((strong.steepest(20.0, 0.0), steepest), rel=1e-9)
    braked = PaperPlane(thrust=8.0, drag=0.2)  # drag outgrows gravity: no dive keeps the ground speed at idle
    lowest, highest = climbs.climb_range(braked, 20.0, 0.0, steady.trim(braked, start(15.0)))
    assert (lowest, highest) == pytest.approx((-steepest, braked.steepest(20.0, 1.0)), rel=1e-9)


def test_where_trims_end_before_that_so_do_the_climbs():
    """At 24 m/s through the air: 20 over the ground, and 13.27 m/s up or down. Found to 1e-4 of the way."""
    steepest = 20.0 * math.tan(math.radians(60.0))
    strong = PaperPlane(thrust=12.0, fastest=24.0)
    lowest, highest = climbs.climb_range(strong, 20.0, 0.0, steady.trim(strong, start(20.0)))
    assert lowest == pytest.approx(strong.steepest(20.0, 0.0), rel=1e-9)
    assert 0 <= math.sqrt(24.0**2 - 20.0**2) - highest < 1e-4 * (steepest - lowest)
    assert strong.nodes["yaw_ic"].value == pytest.approx(EAST, abs=1e-6)


def test_flight_below_the_stall_has_no_climbs():
    plane = PaperPlane(rudder=True)
    level = steady.trim(plane, start(20.0))
    assert climbs.climb_range(plane, 5.0, 0.0, level) == pytest.approx((math.nan, math.nan), nan_ok=True)


def test_a_climb_that_is_not_reached_straight_is_reached_turning_last(monkeypatch):
    ways, plane = Ways(2, 3, 4, 6, 7, 8), PaperPlane()
    monkeypatch.setattr(climbs, "follow", ways)
    level = steady.Trim(0.1, 0.0, EAST + 0.2, 0.3, 0.0, 0.4, 0.5, 0.6, 19.0)
    lowest, highest = climbs.climb_range(plane, 18.0, 0.2, level)
    place = [19.0, 0.6, 0.0]
    expected = []
    for throttle in (0.0, 1.0):
        corners = [[19.0, throttle, 0.0], [18.0, throttle, 0.0], [18.0, throttle, 0.2]]
        expected += [(place, corners[2]), (place, corners[0]), *itertools.pairwise(corners)]
    assert ways.targets == expected
    # The climb angle began at 0; `Ways` adds the number of each of its calls.
    assert (lowest, highest) == pytest.approx((18.0 * math.tan(2 + 3 + 4), 18.0 * math.tan(6 + 7 + 8)))


def test_climbs_begin_at_the_level_trim_given(monkeypatch):
    seen = []

    def never(problem, p, x, target):
        seen.append((p.tolist(), x.tolist()))
        return Reached(p, x, False)

    monkeypatch.setattr(climbs, "follow", never)
    level = steady.Trim(0.1, 0.0, EAST + 0.2, 0.3, 0.05, 0.4, 0.5, 0.6, 19.0, 0.7)
    for rudder in (False, True):
        seen.clear()
        nothing = climbs.climb_range(PaperPlane(rudder=rudder), 18.0, 0.2, level)
        assert all(map(math.isnan, nothing)) and len(nothing) == 2
        unknowns = [0.1, 0.3, pytest.approx(0.2), 0.4, 0.5, 0.0, 0.7][: 6 + rudder]
        assert seen[0] == ([19.0, 0.6, 0.0], unknowns)


def test_residuals_of_a_climb_are_those_of_the_same_trim():
    for rudder in (False, True):
        plane = PaperPlane(rudder=rudder)
        problem = climbs.climb_problem(plane, EAST)
        assert problem.lowest[THROTTLE] == -math.radians(60.0) and problem.highest[THROTTLE] == math.radians(
            60.0
        )
        slope, x = 0.2, np.array([0.1, 0.07, -0.02, 0.3, -0.1, 0.2, 0.05][: 6 + rudder])
        found = problem.residuals(np.array([20.0, 0.6, 0.1]), x)
        assert plane.nodes["rudder"].value == (0.05 if rudder else 0.0)
        p = np.array([20.0 / math.cos(slope), slope, 0.1])
        same = x.copy()
        same[THROTTLE] = 0.6
        np.testing.assert_allclose(found, problem_of(plane, p).residuals(p, same), rtol=1e-12)


def test_the_way_to_a_climb_is_followed_finely():
    """The last climb is found to 1e-4 of the way, not to the 1/128 of a trim."""
    found = follow(
        Problem(lambda p, x: np.array([x[0] - p[0]]), np.array([-1.0]), np.array([0.3])),
        np.array([0.0]), np.array([0.0]), np.array([1.0]), shortest=1e-4,
    )  # fmt: skip
    assert not found.arrived and 0.2999 <= found.p[0] <= 0.3
