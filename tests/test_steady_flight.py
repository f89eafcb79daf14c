"""Trims, on an aircraft whose steady flights are known in closed form."""

import math
import re

import numpy as np
import pytest

from aircraft.jsbsim import shortfall, steady
from aircraft.jsbsim.continuation import BALANCED
from aircraft.jsbsim.errors import FdmError, UnsteadyError
from aircraft.jsbsim.geodesy import G_MPS2
from aircraft.jsbsim.rest import rotation
from aircraft.jsbsim.shortfall import AILERON, ELEVATOR, RUDDER, THROTTLE
from tests.paper_plane import (
    CL_0,
    CL_ALPHA,
    EAST,
    PITCH_0,
    PITCH_ALPHA,
    PITCH_DAMPING,
    PITCH_ELEVATOR,
    ROLL_AILERON,
    ROLL_BETA,
    ROLL_DAMPING,
    YAW_BETA,
    YAW_DAMPING,
    YAW_RUDDER,
    PaperPlane,
    Ways,
    problem_of,
    start,
)

FLIGHTS = [(20.0, 0.0, 0.0), (17.0, 2.5, 0.0), (24.0, -1.0, 0.2), (18.0, 1.5, -0.15), (15.0, 0.0, 0.1)]


def is_the_trim_of(plane, t, speed, climb, omega):
    """Every number of a trim against the formulas; exact without sideslip, that is with a rudder."""
    roll, pitch, yaw = t.roll, t.pitch, t.yaw
    p, q, r = rotation(roll, pitch, yaw).T @ [0.0, 0.0, -omega]
    assert t.airspeed == pytest.approx(speed, abs=1e-12)
    alpha = (plane.cl_needed(speed, climb, omega) - CL_0) / CL_ALPHA
    slip = 0.0 if plane.airframe.has_rudder else YAW_DAMPING * r / (YAW_BETA * speed)
    assert t.beta == pytest.approx(slip, abs=1e-8)
    exact = 1e-6 if plane.airframe.setup.captive else 1e-9  # where engines settle, steps end sooner
    near = exact if abs(slip) < 1e-9 else 0.1 * abs(omega)  # sideslip turns lift and drag aside a little
    assert t.alpha == pytest.approx(alpha, abs=near)
    assert t.throttle == pytest.approx(plane.throttle_needed(speed, climb, omega), abs=near)
    elevator = (PITCH_ALPHA * t.alpha - PITCH_0 + PITCH_DAMPING * q / speed) / PITCH_ELEVATOR
    aileron = (ROLL_BETA * t.beta + ROLL_DAMPING * p / speed) / ROLL_AILERON
    rudder = YAW_DAMPING * r / speed / YAW_RUDDER if plane.airframe.has_rudder else 0.0
    assert (t.elevator, t.aileron, t.rudder) == pytest.approx((elevator, aileron, rudder), abs=exact)
    bank = math.atan(speed * math.cos(climb) * -omega / (G_MPS2 * math.cos(climb)))
    assert math.sin(roll) * math.cos(pitch) == pytest.approx(math.sin(bank) * math.cos(climb), abs=near)
    # The attitude's angles to the air are alpha and beta.
    air = rotation(roll, pitch, yaw).T @ steady.velocity_of(speed, climb, EAST)
    assert math.atan2(air[2], air[0]) == pytest.approx(t.alpha, abs=1e-9)
    assert math.asin(air[1] / speed) == pytest.approx(t.beta, abs=1e-9)


@pytest.mark.parametrize("captive", [False, True])
@pytest.mark.parametrize("rudder", [False, True])
@pytest.mark.parametrize(("v", "zeta", "omega"), FLIGHTS)
def test_a_trim_is_the_steady_flight_of_the_formulas(v, zeta, omega, rudder, captive):
    plane = PaperPlane(rudder=rudder, captive=captive)
    t = steady.trim(plane, start(v, zeta), omega)
    is_the_trim_of(plane, t, math.hypot(v, zeta), math.atan2(zeta, v), omega)
    assert np.abs(plane.left()).max() < BALANCED
    n = plane.nodes
    assert n["on"].value == 0.0
    for name in ("elevator", "aileron", "throttle"):
        assert n[name].value == getattr(t, name)
    assert n["rudder"].value == (t.rudder if rudder else 0.0)
    assert (n["roll_ic"].value, n["pitch_ic"].value, n["yaw_ic"].value) == (t.roll, t.pitch, t.yaw)


def test_a_trim_is_in_the_air_and_along_its_path_through_it():
    """From the west at 18 m/s with 5 m/s from the south and 1 m/s up: air-relative, south-eastwards, down."""
    plane = PaperPlane(rudder=True)
    t = steady.trim(plane, start(18.0, wind=(0.0, 5.0, 1.0)))
    speed, climb = math.sqrt(18.0**2 + 5.0**2 + 1.0), math.asin(-1.0 / math.sqrt(18.0**2 + 26.0))
    assert t.airspeed == pytest.approx(speed, rel=1e-9)
    assert t.throttle == pytest.approx(plane.throttle_needed(speed, climb), abs=1e-9)
    assert t.yaw == pytest.approx(EAST + math.atan2(5.0, 18.0), abs=1e-9)
    assert t.pitch == pytest.approx(climb + t.alpha, abs=1e-9)
    # The velocity that is flown is the start's, to the last bit.
    air, _ = steady.place(plane, start(18.0, wind=(0.0, 5.0, 1.0)))
    body = np.ascontiguousarray(rotation(t.roll, t.pitch, t.yaw).T) @ air
    assert [plane.nodes[f"{axis}_ic"].value for axis in "uvw"] == [float(x / 0.3048) for x in body]


def test_no_airspeed_and_no_steady_flight_are_errors_that_say_all():
    plane = PaperPlane()
    with pytest.raises(FdmError, match=r"^paper cannot fly at airspeed 0 m/s$"):
        steady.trim(plane, start(0.0))
    with pytest.raises(UnsteadyError, match="lift is short by"):
        steady.trim(plane, start(0.5))
    wind = (1.0, -2.0, 0.5)
    with pytest.raises(UnsteadyError) as error:
        steady.trim(plane, start(20.0, 9.0, wind=wind), 0.1)
    told = (
        "paper cannot fly steadily at ground speed 20 m/s, climb 9 m/s, turn 0.1 rad/s, wind (1.0, -2.0, 0.5)"
    )
    assert str(error.value) == f"{told} m/s: {error.value.missing}"
    assert error.value.missing.startswith("thrust is short by ")


@pytest.mark.parametrize("omega", [0.0, 0.1])
def test_the_missing_force_is_that_of_the_formulas(omega):
    """At full throttle the path lacks g sin(climb) + drag - thrust; at idle it has too much of it."""
    for rate, what, limit in ((9.0, "thrust", "throttle 1.00"), (-6.0, "drag", "throttle 0.00")):
        plane = PaperPlane(rudder=True)
        with pytest.raises(UnsteadyError) as error:
            steady.trim(plane, start(20.0, rate), omega)
        speed, climb = math.hypot(20.0, rate), math.atan2(rate, 20.0)
        short = plane.thrust * (plane.throttle_needed(speed, climb, omega) - (rate > 0))
        told = re.fullmatch(
            rf"(\w+) is short by ([\d.]+) m/s\^2 at airspeed {speed:.2f} m/s with elevator (-?[\d.]+),"
            rf" aileron (-?[\d.]+), {limit} \(its limit\)",
            error.value.missing,
        )
        assert told and told[1] == what and told[2] == f"{abs(short):.2g}"
        near = steady.trim(plane, start(20.0), omega)
        assert float(told[3]) == pytest.approx(near.elevator, abs=0.1)
        assert float(told[4]) == pytest.approx(near.aileron, abs=0.02)


def test_below_the_stall_lift_is_short_and_the_elevator_is_at_its_limit():
    plane = PaperPlane()
    slowest = math.sqrt(G_MPS2 / (0.05 * plane.largest_cl()))
    assert steady.trim(plane, start(slowest + 0.05)).elevator == pytest.approx(0.99, abs=0.015)
    with pytest.raises(UnsteadyError, match=r"^paper.*: lift is short by ") as error:
        steady.trim(plane, start(slowest - 1.0))
    lacks = float(re.search(r"short by ([\d.]+)", error.value.missing)[1])
    best = G_MPS2 - 0.05 * (slowest - 1.0) ** 2 * plane.largest_cl()
    assert 0.3 * best < lacks <= 1.05 * best  # moments weigh thrice: some lift is bought with a moment
    assert "elevator 1.00 (its limit), aileron 0.00, throttle" in error.value.missing


# -- where a search begins, and which ways it tries


def test_a_first_guess_is_a_coordinated_bank():
    plane = PaperPlane(rudder=True)
    guess = steady.first_guess(problem_of(plane, (20.0, 0.0)), np.array([20.0, 0.0, 0.2]))
    bank = -math.atan(20.0 * 0.2 / G_MPS2)
    np.testing.assert_allclose(guess, [bank, 0.05 / math.cos(bank), 0.0, 0.0, 0.0, 0.4, 0.0], rtol=1e-12)
    guess = steady.first_guess(problem_of(PaperPlane(), (20.0, 0.0)), np.array([20.0, 0.0, 0.0]))
    np.testing.assert_array_equal(guess, [0.0, 0.05, 0.0, 0.0, 0.0, 0.4])


@pytest.mark.parametrize("rudder", [False, True])
def test_the_unknowns_have_their_bounds(rudder):
    lowest, highest = steady.bounds(PaperPlane(rudder=rudder), 0.1, 0.8)
    assert lowest.tolist() == [-math.pi] * 3 + [-1.0, -1.0, 0.1] + [-1.0] * rudder
    assert highest.tolist() == [math.pi] * 3 + [1.0, 1.0, 0.8] + [1.0] * rudder


@pytest.mark.parametrize("rudder", [False, True])
def test_a_problem_takes_its_engines_range_and_smaller_steps_where_they_settle(rudder):
    m = 6 + rudder
    free = problem_of(PaperPlane(rudder=rudder, idle=0.1, full=0.9), (20.0, 0.0))
    assert (free.lowest[THROTTLE], free.highest[THROTTLE]) == (0.1, 0.9)
    assert (free.difference, free.longest, free.slow, free.converged) == (1e-7, None, False, 1e-10)
    slow = problem_of(PaperPlane(rudder=rudder, captive=True), (20.0, 0.0))
    assert (slow.difference, slow.slow, slow.converged) == (1e-5, True, 5e-7)
    assert slow.longest.tolist() == [0.5, 0.15, 0.2, 0.5, 0.5, 0.2, 0.5][:m]


def test_residuals_are_the_accelerations_of_that_flight():
    plane = PaperPlane(rudder=True)
    x = np.array([0.1, 0.07, -0.02, 0.3, -0.1, 0.6, 0.05])
    p = np.array([21.0, 0.05, -0.12])
    left = problem_of(plane, (20.0, 0.0)).residuals(p, x)
    body = rotation(0.1, 0.12, EAST - 0.02).T
    velocity = body @ [0.0, 21.0 * math.cos(0.05), -21.0 * math.sin(0.05)]
    written = [plane.nodes[f"{axis}_ic"].value * 0.3048 for axis in "uvw"]
    np.testing.assert_allclose(written, velocity, atol=1e-12)
    np.testing.assert_allclose(
        [plane.nodes[f"{axis}_ic"].value for axis in "pqr"], body @ [0.0, 0.0, 0.12], atol=1e-15
    )
    names = ("elevator", "aileron", "throttle", "rudder")
    assert [plane.nodes[k].value for k in names] == x[[ELEVATOR, AILERON, THROTTLE, RUDDER]].tolist()
    np.testing.assert_allclose(left[:3] * 0.3048, plane.left()[:3], rtol=1e-12)
    np.testing.assert_array_equal(left[3:], [*plane.left()[3:], plane.nodes["beta"].value])
    # At the speed and climb that the caller stated, its own velocity is flown to the last bit.
    air = np.array([0.0, 20.0 + 1e-9, 0.0])
    steady.trim_problem(plane, EAST, 20.0, 0.0, air).residuals(np.array([20.0, 0.0, 0.0]), np.zeros(7))
    assert plane.nodes["u_ic"].value == (rotation(0.0, 0.0, EAST).T @ air)[0] / 0.3048
    for other in ((20.0, 0.1), (19.0, 0.0)):
        steady.trim_problem(plane, EAST, 20.0, 0.0, air).residuals(np.array([*other, 0.0]), np.zeros(7))
        assert plane.nodes["u_ic"].value * 0.3048 == pytest.approx(other[0], abs=1e-12)


def test_a_velocity_is_north_east_down():
    heading, climb = 0.4, 0.1
    expected = [20 * math.cos(0.1) * math.cos(0.4), 20 * math.cos(0.1) * math.sin(0.4), -20 * math.sin(0.1)]
    np.testing.assert_allclose(steady.velocity_of(20.0, climb, heading), expected, rtol=1e-15)


def evaluations(captive, near=None, v=20.0, zeta=0.0):
    plane = PaperPlane(captive=captive)
    plane.forgets = False  # what an engine does at dt = 0 is known: one evaluation more each time
    found = steady.trim(plane, start(v, zeta), 0.0, near)
    return plane.evaluations, found


def test_a_trim_nearby_shortens_the_search_where_evaluations_are_dear():
    """Newton's method with corrected derivatives; engines that settle take two calls an evaluation."""
    many, found = evaluations(True)
    few, again = evaluations(True, found)
    assert few == 4 and many <= 30  # at the guess, and once more by whoever judges it
    assert again.throttle == pytest.approx(found.throttle, abs=1e-6)
    wrong = steady.Trim(1.5, -1.0, 1.0, -1.0, 0.0, 1.0, 1.0, 0.0, 5.0)
    assert evaluations(True, wrong)[1].throttle == pytest.approx(found.throttle, abs=1e-6)
    assert evaluations(False)[0] <= 20


@pytest.mark.parametrize("captive", [True, False])
def test_what_a_trim_begins_with(monkeypatch, captive):
    """Where engines settle: the trim given, two guesses, then Powell's method; else that alone."""
    tried = []
    monkeypatch.setattr(steady, "correct", lambda problem, p, guess: tried.append(guess.tolist()))
    plane, near = PaperPlane(captive=captive), steady.Trim(0.1, 0.2, 0.3, 0.04, 0.5, 0.6, 0.7, 0.8, 20.0)
    given, first = [0.1, 0.04, 0.0, 0.6, 0.7, 0.8], [0.0, 0.05, 0.0, 0.0, 0.0, 0.4]
    more = [*first[:5], 0.7]
    assert steady.trim(plane, start(20.0), 0.0, near).throttle > 0
    assert tried == ([given, first, more] if captive else [])
    tried.clear()
    assert steady.trim(plane, start(20.0)).throttle > 0
    assert tried == ([first, more] if captive else [])


def test_where_the_direct_solution_fails_a_continuation_finds_the_trim(monkeypatch):
    """Directly only level flight at the speeds given is found; the rest follows from there."""
    solve, asked = steady.solve, []

    def only_level(problem, p, guess):
        asked.append(p.tolist())
        return solve(problem, p, guess) if p[0] == 26.0 and not p[1:].any() else None

    monkeypatch.setattr(steady, "solve", only_level)
    plane = PaperPlane(rudder=True)
    is_the_trim_of(
        plane, steady.trim(plane, start(18.0, 2.0), 0.1), math.hypot(18.0, 2.0), math.atan2(2, 18), 0.1
    )
    speed = math.hypot(18.0, 2.0)
    # At the trim, then level at its airspeed, at the usual start, at the slowest and the fastest.
    assert [p[0] for p in asked] == pytest.approx([speed, speed, 20.0, 14.0, 26.0])
    assert asked[0][1:] == pytest.approx([math.atan2(2.0, 18.0), 0.1]) and not np.any(
        [p[1:] for p in asked[1:]]
    )


@pytest.mark.parametrize(
    ("arrives", "tried"),
    [((1,), 1), ((2, 3), 3), ((3,), 3), ((2, 4, 5), 5), ((), 3)],
)
def test_continuations_go_straight_then_turn_first_then_climb_first(monkeypatch, arrives, tried):
    plane = PaperPlane()
    level, p, half = [20.0, 0.0, 0.0], [18.0, 0.1, 0.2], [18.0, 0.0, 0.2]
    steep = [18.0, 0.1, 0.0]
    lacks = []
    monkeypatch.setattr(steady, "solve", lambda problem, at, guess: np.zeros(6) if at[0] == 20.0 else None)
    monkeypatch.setattr(shortfall, "throttle_limits", lambda *asked: None)
    monkeypatch.setattr(shortfall, "missing", lambda *asked: lacks.append(asked) or "all")
    ways = Ways(*arrives)
    monkeypatch.setattr(steady, "follow", ways)
    problem = problem_of(plane, p)
    x, missing = steady.find(plane, problem, np.array(p), EAST, (20.0,))
    plan = {
        (1,): [(level, p)],
        (2, 3): [(level, p), (level, half), (half, p)],
        (3,): [(level, p), (level, half), (level, steep)],
        (2, 4, 5): [(level, p), (level, half), (half, p), (level, steep), (steep, p)],
        (): [(level, p), (level, half), (level, steep)],
    }[arrives]
    if arrives == (3,):  # climbing first arrives at its corner, and goes on
        plan.append((steep, p))
    assert ways.targets == plan
    if arrives in ((1,), (2, 3), (2, 4, 5)):
        assert missing == "" and lacks == []
        # Each way goes on from where the one before it came.
        assert x.tolist() == [{1: 1.0, 3: 5.0, 5: 9.0}[len(plan)]] * 6
    else:
        assert x is None and missing == "all"
        ((asked, same, at, guesses, heading),) = lacks
        assert (asked, same, at.tolist(), heading) == (plane, problem, p, EAST)
        np.testing.assert_array_equal(guesses[0], steady.first_guess(problem, np.array(p)))
        assert [g.tolist() for g in guesses[1:]] == [[1.0] * 6] + [[7.0] * 6] * (arrives == (3,))


def test_the_guess_of_the_throttle_limits_is_tried_before_the_ways(monkeypatch):
    solve = steady.solve
    monkeypatch.setattr(
        steady, "solve", lambda problem, p, guess: None if p[1:].any() else solve(problem, p, guess)
    )
    monkeypatch.setattr(steady, "follow", None)  # not needed
    plane = PaperPlane(rudder=True)
    is_the_trim_of(
        plane, steady.trim(plane, start(18.0, 2.0), 0.1), math.hypot(18, 2), math.atan2(2, 18), 0.1
    )


# -- quick answers


@pytest.mark.parametrize("rudder", [False, True])
def test_an_attempt_is_the_trim_or_nothing(rudder):
    for v, zeta, omega in FLIGHTS:
        plane = PaperPlane(rudder=rudder)
        t = steady.attempt(plane, start(v, zeta), omega)
        is_the_trim_of(plane, t, math.hypot(v, zeta), math.atan2(zeta, v), omega)
        again = steady.attempt(plane, start(v, zeta), omega, t)
        is_the_trim_of(plane, again, math.hypot(v, zeta), math.atan2(zeta, v), omega)
    assert steady.attempt(PaperPlane(rudder=rudder), start(20.0, 9.0)) is None
    assert steady.attempt(PaperPlane(rudder=rudder), start(20.0)).roll == pytest.approx(0.0, abs=1e-9)


def test_an_attempt_begins_at_the_trim_given_or_at_two_angles_of_attack(monkeypatch):
    tried = []
    monkeypatch.setattr(steady, "correct", lambda problem, p, guess: tried.append(("correct", p, guess)))
    monkeypatch.setattr(steady, "solve", lambda problem, p, guess: tried.append(("solve", p, guess)))
    near = steady.Trim(0.1, 0.2, 0.3, 0.04, 0.5, 0.6, 0.7, 0.8, 20.0, 0.9)
    usual = [[0.0, 0.05, 0.0, 0.0, 0.0, 0.4, 0.0], [0.0, 0.15, 0.0, 0.0, 0.0, 0.7, 0.0]]
    given = [0.1, 0.04, 0.0, 0.6, 0.7, 0.8, 0.9]
    for captive, known, expected in (
        (False, None, [usual[0], usual[0], usual[1], usual[1]]),
        (True, None, usual),
        (True, near, [given, usual[0]]),
    ):
        tried.clear()
        plane = PaperPlane(rudder=True, captive=captive)
        assert steady.attempt(plane, start(20.0, 2.0), 0.0, known) is None
        assert [guess.tolist() for _, _, guess in tried] == expected
        assert [what for what, _, _ in tried] == (["correct"] * 2 if captive else ["correct", "solve"] * 2)
        assert all(
            p.tolist() == pytest.approx([math.hypot(20, 2), math.atan2(2, 20), 0.0]) for _, p, _ in tried
        )


@pytest.mark.parametrize(("rudder", "captive"), [(False, False), (True, False), (True, True)])
def test_what_full_throttle_lacks_is_told_without_a_continuation(rudder, captive):
    plane = PaperPlane(rudder=rudder, captive=captive)
    short = plane.thrust * (plane.throttle_needed(math.hypot(20, 9), math.atan2(9, 20)) - 1)
    told = steady.lacking(plane, start(20.0, 9.0))
    assert told.startswith(f"thrust is short by {short:.2g} m/s^2 at airspeed 21.93 m/s with elevator")
    assert told.endswith("aileron 0.00, throttle 1.00 (its limit)")
    before = plane.evaluations
    near = steady.trim(plane, start(20.0, 5.0))
    before = plane.evaluations
    assert steady.lacking(plane, start(20.0, 9.0), near) == told
    assert plane.evaluations - before < 60
    assert "airspeed 8.00 m/s with elevator 1.00 (its limit)" in steady.lacking(plane, start(8.0))


@pytest.mark.parametrize("captive", [False, True])
def test_what_lacks_is_sought_from_the_trim_given_at_full_throttle(monkeypatch, captive):
    asked, correct = [], steady.correct
    monkeypatch.setattr(steady, "correct", lambda *given: asked.append(given) or correct(*given))
    plane = PaperPlane(captive=captive, full=0.9)
    steady.lacking(plane, start(20.0, 9.0))
    steady.lacking(plane, start(20.0, 9.0), steady.Trim(0.1, 0.2, 0.3, 0.04, 0.5, 0.6, 0.7, 0.8, 20.0))
    guesses = [[0.0, 0.05, 0.0, 0.0, 0.0], [0.1, 0.04, 0.0, 0.6, 0.7]]
    longest = [0.5, 0.15, 0.2, 0.5, 0.5] if captive else None
    for (held, p, guess), wanted in zip(asked, guesses, strict=True):
        assert guess.tolist() == wanted
        assert p.tolist() == pytest.approx([math.hypot(20, 9), math.atan2(9, 20), 0.0, 0.9])
        assert held.lowest.tolist() == [-math.pi] * 3 + [-1.0] * 2 and held.highest[4] == 1.0
        assert (held.slow, held.difference) == ((True, 1e-5) if captive else (False, 1e-7))
        assert (None if held.longest is None else held.longest.tolist()) == longest


def test_forces_that_are_not_finite_are_told_as_that():
    plane = PaperPlane(thrust=math.nan)
    assert steady.lacking(plane, start(20.0)) == "its forces are not finite"
