"""Newton's method within bounds and continuation, on equations whose solutions are known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.jsbsim.continuation import BALANCED, Problem, correct, follow, nearest, solve


class Counted(Problem):
    """A problem that notes where it was evaluated."""

    def __init__(self, residuals, lowest, highest, **more):
        self.__dict__["at"] = []

        def noted(p, x):
            self.at.append(x.copy())
            return residuals(p, x)

        super().__init__(noted, np.array(lowest, float), np.array(highest, float), **more)


NONE = np.zeros(0)
WIDE = [-9.0], [9.0]


def cubic(p, x):
    return x**3 - p[:1]


def test_what_is_solved_is_balanced_and_within_bounds_to_the_edge():
    for left, x, answer in (
        (0.9e-6, 0.5, True), (-0.9e-6, 0.5, True), (1.0e-6, 0.5, False), (1.1e-6, 0.5, False),
        (-1.1e-6, 0.5, False),
        (0.0, 0.0, True), (0.0, 1.0, True), (0.0, -1e-9, False), (0.0, 1 + 1e-9, False),
    ):  # fmt: skip
        problem = Counted(lambda p, x, left=left: np.array([0.0, left]), [0.0, 0.0], [1.0, 1.0])
        assert problem.solved(NONE, np.array([0.5, x])) is answer
        assert problem.at[-1].tolist() == [0.5, x]
    assert BALANCED == 1e-6


@pytest.mark.parametrize("guess", [-4.0, 0.5, 8.0])
def test_a_direct_solution_is_exact(guess):
    x = solve(Problem(cubic, np.array([-9.0]), np.array([9.0])), np.array([8.0]), np.array([guess]))
    assert x == pytest.approx([2.0], abs=1e-12)


def test_a_direct_solution_out_of_bounds_or_none_at_all_is_none():
    assert solve(Problem(cubic, np.array([-1.0]), np.array([1.0])), np.array([8.0]), np.array([0.5])) is None
    assert solve(Problem(lambda p, x: x**2 + 1, *map(np.array, WIDE)), NONE, np.array([0.5])) is None


@given(seed=st.integers(0, 2**31), slow=st.booleans())
@settings(max_examples=40, deadline=None)
def test_newtons_method_solves_a_random_smooth_system(seed, slow):
    rng = np.random.default_rng(seed)
    m = int(rng.integers(1, 6))
    a, root = np.eye(m) * 3 + rng.normal(0, 0.4, (m, m)), rng.uniform(-0.7, 0.7, m)

    def residuals(p, x):
        return a @ (x - root) + 0.3 * (np.sin(x) - np.sin(root))

    problem = Problem(residuals, np.full(m, -1.0), np.ones(m), slow=slow)
    x = correct(problem, NONE, rng.uniform(-3, 3, m))  # a guess out of bounds is brought within them
    # Residuals of 1e-10, or 5e-7, over the slopes, of 2 and more.
    np.testing.assert_allclose(x, root, rtol=0, atol=5e-7 if slow else 1e-10)


def test_newtons_method_converges_in_as_many_evaluations_as_it_needs():
    """At (2) from 2.5 its steps are 2.0933, 2.0041, 2.0000084, 2.0 + 4e-11, 2.0; each needs a derivative."""
    fast = Counted(cubic, *WIDE)
    assert correct(fast, np.array([8.0]), np.array([2.5])) == pytest.approx([2.0], abs=1e-9)
    steps = [2.5, 2.09333, 2.0041, 2.0000084, 2.0, 2.0]
    assert [x[0] for x in fast.at[::2]] == pytest.approx(steps, abs=1e-4)
    assert len(fast.at) == 2 * 5 + 1 + 1  # and one for whoever judges it
    assert [b[0] - a[0] for a, b in zip(fast.at[:-2:2], fast.at[1:-2:2], strict=True)] == pytest.approx(
        [1e-7] * 5
    )
    # With corrected derivatives, once steps leave less than 0.3: one evaluation a step.
    slow = Counted(cubic, *WIDE, slow=True)
    assert correct(slow, np.array([8.0]), np.array([2.5])) == pytest.approx([2.0], abs=1e-7)
    first = 2.5 - (2.5**3 - 8) / (3 * 2.5**2)
    secant = first - (first**3 - 8) * (first - 2.5) / (first**3 - 2.5**3)
    third = secant - (secant**3 - 8) * (secant - first) / (secant**3 - first**3)
    assert [x[0] for x in slow.at] == pytest.approx(
        [2.5, 2.5 + 1e-7, first, secant, third, *[2.0] * (len(slow.at) - 5)], abs=2e-5
    )
    assert len(slow.at) <= 8


def test_a_slow_step_that_leaves_much_gets_new_derivatives():
    """tanh is flat: from 1.2 a step leaves more than 0.3 of the residual, so its slope is taken anew."""
    problem = Counted(lambda p, x: np.tanh(x), *WIDE, slow=True)
    assert correct(problem, NONE, np.array([1.0])) == pytest.approx([0.0], abs=1e-6)
    first = 1.0 - math.tanh(1.0) * math.cosh(1.0) ** 2
    assert [x[0] for x in problem.at[:4]] == pytest.approx([1.0, 1.0 + 1e-7, first, first + 1e-7], abs=1e-6)


def test_steps_are_shortened_where_they_would_go_too_far():
    """arctan from 3: the whole step leads to -9.5, half to -3.2, a quarter to -0.12, which is nearer."""
    problem = Counted(lambda p, x: np.arctan(x), [-99.0], [99.0])
    assert correct(problem, NONE, np.array([3.0])) == pytest.approx([0.0], abs=1e-9)
    whole = -math.atan(3.0) * 10.0
    ahead = [3.0 + share * whole for share in (1.0, 0.5, 0.25)]
    assert [x[0] for x in problem.at[:5]] == pytest.approx([3.0, 3.0 + 1e-7, *ahead], abs=1e-5)
    # From 4.1 even a tenth is needed, from 9 that is too much.
    far = Counted(lambda p, x: np.arctan(x), [-99.0], [99.0])
    assert correct(far, NONE, np.array([6.0])) == pytest.approx([0.0], abs=1e-9)
    whole = -math.atan(6.0) * 37.0
    assert far.at[5][0] == pytest.approx(6.0 + 0.1 * whole, abs=1e-4)
    lost = Counted(lambda p, x: np.arctan(x), [-99.0], [99.0])
    assert correct(lost, NONE, np.array([40.0])) is None
    assert len(lost.at) == 2 + 4 + 1


def test_each_unknown_has_a_longest_step():
    """Both are scaled together: the direction stays."""
    problem = Counted(lambda p, x: x - [8.0, 2.0], [-9.0] * 2, [9.0] * 2, longest=np.array([0.5, 0.05]))
    correct(problem, NONE, np.zeros(2))
    assert problem.at[3] == pytest.approx([0.2, 0.05])
    near = Counted(lambda p, x: x - [0.3, 0.02], [-9.0] * 2, [9.0] * 2, longest=np.array([0.5, 0.05]))
    assert correct(near, NONE, np.zeros(2)) == pytest.approx([0.3, 0.02])
    assert near.at[3] == pytest.approx([0.3, 0.02])


def test_guesses_and_steps_are_cut_at_the_bounds():
    for guess, first in ((3.0, 1.0), (-3.0, 0.0)):
        problem = Counted(lambda p, x: x - 0.5, [0.0], [1.0])
        assert correct(problem, NONE, np.array([guess])) == pytest.approx([0.5])
        assert problem.at[0].tolist() == [first]
    for root, bound in ((-7.0, 0.0), (7.0, 1.0)):
        problem = Counted(lambda p, x, root=root: x - root, [0.0], [1.0])
        assert correct(problem, NONE, np.array([0.5])) is None
        assert problem.at[2].tolist() == [bound]


def test_twelve_steps_are_all_that_are_made():
    """Each is a hundredth of the way here."""
    problem = Counted(lambda p, x: x - 1.0, *WIDE, longest=np.array([0.01]))
    assert correct(problem, NONE, np.array([0.0])) is None
    assert problem.at[-1] == pytest.approx([0.12])
    close = Counted(lambda p, x: x - 0.1199, *WIDE, longest=np.array([0.01]))
    assert correct(close, NONE, np.array([0.0])) == pytest.approx([0.1199])


def test_derivatives_stay_within_the_bounds():
    problem = Counted(
        lambda p, x: np.array([x[0] + x[1] - 1.5, x[0] - x[1] - 0.5]), [0, 0], [1, 1], difference=1e-3
    )
    assert correct(problem, NONE, np.array([1.0, 0.2])) == pytest.approx([1.0, 0.5])
    assert problem.at[1] == pytest.approx([1 - 1e-3, 0.2]) and problem.at[2] == pytest.approx([1.0, 0.201])
    # At the bound exactly, the difference reaches it: from 0.999 upwards.
    edge = Counted(lambda p, x: x - 0.25, [0.0], [1.0], difference=0.5)
    correct(edge, NONE, np.array([0.5]))
    assert edge.at[1][0] == 1.0


def test_a_slope_of_zero_a_solution_out_of_bounds_and_a_stuck_search_are_none():
    assert correct(Problem(lambda p, x: 0 * x + 1, *map(np.array, WIDE)), NONE, np.array([0.5])) is None
    assert (
        correct(Problem(cubic, np.array([-1.0]), np.array([1.0])), np.array([8.0]), np.array([0.5])) is None
    )
    # It is within bounds, and solved at once where the guess is the solution.
    there = Counted(lambda p, x: x - 0.5, [0.0], [1.0])
    assert correct(there, NONE, np.array([0.5])).tolist() == [0.5] and len(there.at) == 2


def test_a_step_of_nothing_corrects_no_slope():
    """At the bound the step is cut to nothing; the search ends, without a division by zero."""
    with np.errstate(all="raise"):
        assert (
            correct(Problem(lambda p, x: x - 2, np.zeros(1), np.ones(1), slow=True), NONE, np.ones(1)) is None
        )


# -- continuation


def circle(p, x):
    """cos and sin of the parameter, slowly found from afar: two unknowns."""
    return np.array([x[0] - math.cos(p[0]), x[1] - math.sin(p[0])])


def test_a_continuation_arrives_exactly_at_its_target():
    """To the last bit, though 0.2 + (0.9 - 0.2) is not 0.9."""
    asked = []

    def residuals(p, x):
        asked.append(p[0])
        return np.array([x[0] - p[0]])

    assert 0.2 + 1.0 * (0.9 - 0.2) != 0.9
    follow(Problem(residuals, *map(np.array, WIDE)), np.array([0.2]), np.array([0.2]), np.array([0.9]))
    assert asked[-1] == 0.9


def test_a_continuation_goes_along_the_line_to_its_target():
    problem = Problem(circle, np.full(2, -2.0), np.full(2, 2.0))
    target = np.array([1.1])
    found = follow(problem, np.array([0.0]), np.array([1.0, 0.0]), target)
    assert found.arrived is True and found.p is target
    assert found.x == pytest.approx([math.cos(1.1), math.sin(1.1)], abs=1e-9)
    assert problem.solved(target, found.x)


def stepped(limit, **shortest):
    """Shares of the way at which a solution is sought that exists up to `limit`."""
    asked = []

    def residuals(p, x):
        asked.append(p[0] - 3.0)
        return np.array([x[0] - 2 * p[0]])

    problem = Problem(residuals, np.array([0.0]), np.array([2 * (3.0 + limit)]))
    found = follow(problem, np.array([3.0]), np.array([6.0]), np.array([4.0]), **shortest)
    return found, list(dict.fromkeys(np.round(asked, 6)))


def test_steps_are_halved_and_doubled_and_end_where_the_solutions_do():
    found, asked = stepped(2.0)
    assert found.arrived and asked == [0.5, 1.0]
    found, asked = stepped(0.3, shortest=1 / 16)
    assert not found.arrived and found.p == pytest.approx([3.25]) and found.x == pytest.approx([6.5])
    assert asked == [0.5, 0.25, 0.75, 0.375, 0.3125]
    found, asked = stepped(0.3)
    assert 0.3 - 1 / 64 < found.p[0] - 3.0 <= 0.3 and found.arrived is False
    assert asked[-1] - (found.p[0] - 3.0) == pytest.approx(1 / 128, abs=1e-6)  # the last step that failed
    found, _ = stepped(0.3, shortest=1e-4)
    assert 0.2998 < found.p[0] - 3.0 <= 0.3
    found, asked = stepped(0.0)
    assert (
        not found.arrived
        and found.p == pytest.approx([3.0])
        and asked[-1] == pytest.approx(1 / 128, abs=1e-6)
    )


def test_a_shorter_step_grows_again_to_half_the_way():
    """A solution that only near guesses find: the step is halved at first, then doubled up to a half."""
    asked = []

    def residuals(p, x):
        asked.append(round(float(p[0]), 6))
        far = asked[0] == p[0] or len(set(asked)) == 2  # the first two steps fail
        return np.array([1.0 if far else x[0] - p[0]])

    found = follow(Problem(residuals, *map(np.array, WIDE)), np.zeros(1), np.zeros(1), np.ones(1))
    assert found.arrived and list(dict.fromkeys(asked)) == [0.5, 0.25, 0.125, 0.375, 0.875, 1.0]


def test_each_step_begins_from_an_extrapolation():
    """The guess is where it is evaluated first: the straight line through the last two solutions."""
    seen = {}

    def residuals(p, x):
        seen.setdefault(round(float(p[0]), 6), float(x[0]))
        return np.array([x[0] - p[0] ** 2])

    follow(Problem(residuals, *map(np.array, WIDE)), np.array([1.0]), np.array([1.0]), np.array([3.0]))
    # Solutions 1 at 1 and 4 at 2: from 1 itself first, then to 7 at 3.
    assert seen == pytest.approx({2.0: 1.0, 3.0: 7.0}, abs=1e-6)
    # The first step fails: a quarter of the way, three quarters, all.
    seen.clear()

    def not_at_first(p, x):
        return np.ones(1) if not seen and p[0] == 2.0 else residuals(p, x)

    follow(Problem(not_at_first, *map(np.array, WIDE)), np.array([1.0]), np.array([1.0]), np.array([3.0]))
    assert seen == pytest.approx({1.5: 1.0, 2.5: 4.75, 3.0: 8.25}, abs=1e-6)


# -- the nearest


def test_the_nearest_of_several_searches_has_the_least_squares():
    """(x^2 - 1, 0.2 x - 0.3): near 1 and near -1 is a least; the one at 1 leaves less."""
    problem = Counted(lambda p, x: np.array([x[0] ** 2 - p[0], 0.2 * x[0] - 0.3]), [-3.0], [3.0])
    low, high = [-2.0], [2.0]
    for guesses in ([low, high], [high, low], [high]):
        x = nearest(problem, np.array([1.0]), [np.array(g) for g in guesses])
        assert 1.0 < x[0] < 1.02
    assert nearest(problem, np.array([1.0]), [np.array(low)])[0] < -0.9


def test_a_search_for_the_nearest_begins_within_its_bounds():
    problem = Counted(lambda p, x: x - 5.0, [-1.0, 0.0], [1.0, 4.0])
    x = nearest(problem, NONE, [np.array([7.0, -7.0])])
    assert x == pytest.approx([1.0, 4.0], abs=1e-6)
    # A billionth of the range from the bound.
    assert 1.0 - problem.at[0][0] == pytest.approx(2e-9, rel=1e-3) and problem.at[0][1] == pytest.approx(
        4e-9, rel=1e-3
    )
