"""What a steady flight lacks, told on an aircraft whose steady flights are known in closed form."""

import math

import numpy as np
import pytest

from aircraft.jsbsim import shortfall, steady
from aircraft.jsbsim.continuation import Problem
from aircraft.jsbsim.rest import rotation
from aircraft.jsbsim.shortfall import THROTTLE
from tests.paper_plane import EAST, PaperPlane, problem_of


@pytest.mark.parametrize("rudder", [False, True])
def test_forces_in_path_axes_are_along_beside_and_above_the_path(rudder):
    plane = PaperPlane(rudder=rudder)
    x, p = np.array([0.3, 0.08, -0.05, 0.2, 0.1, 0.5, 0.0][: 6 + rudder]), np.array([20.0, 0.1, 0.15])
    problem_of(plane, p).residuals(p, x)
    found = shortfall.in_path_axes(plane, p, x, EAST)
    left, ned = shortfall.balance(plane), rotation(0.3, 0.18, EAST - 0.05) @ (plane.left()[:3] / 0.3048)
    north, east, down = ned
    along = east * math.cos(0.1) - down * math.sin(0.1)
    above = -east * math.sin(0.1) - down * math.cos(0.1)
    np.testing.assert_allclose(found[:3], [along, -north, above], rtol=1e-10)
    np.testing.assert_array_equal(found[3:], left[3:])
    assert len(left) == 6 + rudder and (not rudder or left[6] == plane.nodes["beta"].value)


def test_the_throttle_limits_guess_the_trim_between_them():
    plane = PaperPlane(rudder=True)
    problem = problem_of(plane, (20.0, 0.0))
    level = np.array([20.0, 0.0, 0.0])
    x = steady.solve(problem, level, steady.first_guess(problem, level))
    for p in (np.array([18.0, 0.1, 0.1]), np.array([24.0, -0.02, -0.1])):
        found = shortfall.throttle_limits(plane, problem, level, x, p, EAST)
        assert found.missing == ""
        # Thrust along the path is linear in the throttle: the guess is the trim.
        assert found.guess[THROTTLE] == pytest.approx(plane.throttle_needed(*p), abs=1e-9)
        assert np.abs(problem.residuals(p, found.guess)).max() < 1e-6
    # A few hundredths of the throttle are left, or missing, at its ends.
    for throttle, what in ((0.03, ""), (-0.03, "drag"), (0.97, ""), (1.03, "thrust")):
        climb = math.atan2(plane.steepest(20.0, throttle), 20.0)
        p = np.array([20.0 / math.cos(climb), climb, 0.0])
        assert shortfall.throttle_limits(plane, problem, level, x, p, EAST).missing.partition(" ")[0] == what
    for climb, k, what in ((0.5, 1.0, "thrust"), (-0.4, 0.0, "drag")):
        p = np.array([20.0, climb, 0.0])
        found = shortfall.throttle_limits(plane, problem, level, x, p, EAST)
        short = abs(plane.thrust * (plane.throttle_needed(20.0, climb) - k))
        assert found.missing.startswith(f"{what} is short by {short:.2g} m/s^2 at airspeed 20.00 m/s with")
        assert found.missing.endswith(f"throttle {k:.2f} (its limit)") and found.guess[THROTTLE] == k
    # The wing ends the way to a slow flight, not the throttle.
    assert shortfall.throttle_limits(plane, problem, level, x, np.array([6.0, 0.0, 0.0]), EAST) is None


def test_a_throttle_without_effect_is_guessed_in_its_middle(monkeypatch):
    plane = PaperPlane(thrust=0.0)
    problem = problem_of(plane, (20.0, 0.0))
    forces = shortfall.in_path_axes
    monkeypatch.setattr(shortfall, "in_path_axes", lambda *asked: forces(*asked) * ([0.0] + [1.0] * 5))
    p, x = np.array([20.0, 0.0, 0.0]), steady.first_guess(problem, [20.0, 0.0, 0.0])
    assert shortfall.throttle_limits(plane, problem, p, x, p, EAST).guess[THROTTLE] == 0.5


LACKS = {
    "drag is short by 0.5 m/s^2": (0.5, 0.2, 0.3, 0.1, 0.1, 0.1),
    "lift is too large by 0.5 m/s^2": (0.1, 0.2, 0.5, 0.1, 0.1, 0.1),
    "thrust is short by 1.5 m/s^2": (-1.5, 0.2, 0.3, 0.1, 0.1, 0.1),
    "drag is short by 1.5 m/s^2": (1.5, 0.2, 0.3, 0.1, 0.1, 0.1),
    "side force is short by 0.9 m/s^2": (0.1, -0.9, 0.3, 0.1, 0.1, 0.1),
    "lift is short by 2.1 m/s^2": (0.1, 0.2, -2.1, 0.1, 0.1, 0.1),
    "lift is too large by 2.1 m/s^2": (0.1, 0.2, 2.1, 0.1, 0.1, 0.1),
    "rolling moment is off by 3.1 rad/s^2": (0.1, 0.2, -2.1, -3.1, 0.1, 0.1),
    "pitching moment is off by 3.1 rad/s^2": (0.1, 0.2, -2.1, 0.1, 3.1, 0.1),
    "yawing moment is off by 3.1 rad/s^2": (0.1, 0.2, -2.1, 0.1, 0.1, -3.1),
    "no balance was found": (2e-7, 3e-7, -4e-7, 0.0, 0.0, 0.0),
    "lift is short by 4e-06 m/s^2": (2e-7, 3e-7, -4e-6, 0.0, 0.0, 0.0),
}


@pytest.mark.parametrize("told", LACKS)
def test_what_lacks_most_is_named(monkeypatch, told):
    """Of forces along, beside and above the path [m/s^2] and three moments [rad/s^2]."""
    left = np.array(LACKS[told]) / np.array([0.3048] * 3 + [1.0] * 3)
    monkeypatch.setattr(shortfall, "in_path_axes", lambda plane, p, x, heading: left)
    seen = []
    problem = Problem(lambda p, x: seen.append((p, x)), np.zeros(6), np.ones(6))
    p, x = np.array([18.126, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, -0.25, 0.5, 0.75])
    at = " at airspeed 18.13 m/s with elevator -0.25, aileron 0.50, throttle 0.75"
    assert shortfall.lacking(None, problem, p, x, EAST) == told + at
    assert seen == [(p, x)]  # the flight is evaluated before its forces are read


@pytest.mark.parametrize(
    ("commands", "said"),
    [
        ((-1.0, 0.0, 0.5), "elevator -1.00 (its limit), aileron 0.00, throttle 0.50"),
        (
            (0.9995, -0.9995, 0.0005),
            "elevator 1.00 (its limit), aileron -1.00 (its limit), throttle 0.00 (its limit)",
        ),
        ((0.9985, -0.9985, 0.0015), "elevator 1.00, aileron -1.00, throttle 0.00"),
        ((0.0, 1.0, 1.0), "elevator 0.00, aileron 1.00 (its limit), throttle 1.00 (its limit)"),
        ((-0.004, 0.004, 0.999), "elevator 0.00, aileron 0.00, throttle 1.00"),
        ((-0.0, 0.999, 0.999), "elevator 0.00, aileron 1.00, throttle 1.00"),
    ],
)  # fmt: skip
def test_commands_at_their_limits_are_named(monkeypatch, commands, said):
    monkeypatch.setattr(shortfall, "in_path_axes", lambda *asked: np.ones(6))
    problem = Problem(lambda p, x: None, np.zeros(6), np.ones(6))
    told = shortfall.lacking(
        None, problem, np.array([20.0, 0.0, 0.0]), np.array([0.0, 0.0, 0.0, *commands]), EAST
    )
    assert told.endswith(f" at airspeed 20.00 m/s with {said}")


def test_the_nearest_flight_weighs_moments_thrice():
    """Two unknowns, one wish each: the least squares of (f, 3 m) at the bound of both."""
    seen = []

    def residuals(p, x):
        seen.append(x.copy())
        force, moment = x[0] - 1.0, x[0] + 1.0
        return np.array([force, 0.0, 0.0, moment, x[1] - 0.25, 0.0])

    problem = Problem(residuals, np.full(6, -2.0), np.full(6, 2.0))
    plane = PaperPlane()
    told = shortfall.missing(plane, problem, np.array([20.0, 0.0, 0.0]), [np.zeros(6)], EAST)
    # (x - 1)^2 + 9 (x + 1)^2 is least at -0.8; the last evaluation is at the least.
    assert seen[-1][0] == pytest.approx(-0.8, abs=1e-6) and seen[-1][1] == pytest.approx(0.25, abs=1e-6)
    assert " at airspeed 20.00 m/s with " in told
