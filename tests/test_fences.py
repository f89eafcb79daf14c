"""Fences: h against the manoeuvre flown, gradients, invariances, the theorem of the shared manoeuvre."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from filters.barriers.class_k import cubic
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.fences.fences import Fence, Fences
from filters.barriers.fences.polygon import Polygon
from filters.barriers.fences.shapes import Area, Disc, Heights
from filters.cbf.collision import CollisionFilter
from filters.cbf.fence_constraints import FenceConstraints
from filters.constraints import Constraints
from filters.model import Command, Limits, State, View, step
from filters.qp.single import Status
from filters.wrappers.row_margins import BoundedError

SQUARE = [[-300, -300], [300, -300], [300, 300], [-300, 300]]
# Two reflex corners, listed clockwise.
NOTCHED = [[-350, -300], [-350, 320], [20, 300], [60, 90], [140, 120], [150, 310], [400, 280], [380, -290]]
SMALL = [[30, 10], [70, -20], [55, 35], [90, 60], [20, 55]]
LARGE = [[-120, -40], [130, -60], [40, 30], [110, 150], [-90, 160]]
SHAPES = {
    "keep in a square": Area(Polygon(SQUARE), inside=True, margin=7.0),
    "keep in, non-convex": Area(Polygon(NOTCHED), inside=True),
    "keep out of a small polygon": Area(Polygon(SMALL), inside=False, margin=3.0),
    "keep out of a large polygon": Area(Polygon(LARGE), inside=False),
    "keep out of a small disc": Disc(20 + 30j, 25.0, margin=4.0),
    "keep out of a large disc": Disc(-10 - 20j, 150.0),
    "heights": Heights(-40.0, 60.0, margin=5.0),
    "floor": Heights(-10.0, np.inf),
}
V, OMEGA = 16.0, np.deg2rad(11.7)
LIMITS = Limits(15.0, 25.0, np.deg2rad(13), 3.9)
TURN = TurnBarrier(V, OMEGA, 5.0, smoothing=30.0)
ALPHA = cubic(0.1)

shapes = st.sampled_from(list(SHAPES.values()))
numbers = st.floats(-450, 450)
poses = st.tuples(numbers, numbers, st.floats(-7, 7), st.floats(-80, 80))
turns = st.tuples(st.floats(5, 40), st.floats(0.1, 0.6), st.booleans())


def one(shape, v=V, omega=OMEGA, zeta=0.0):
    """The barrier of one vehicle and one fence."""
    return Fences([Fence(shape, np.array([0]))], Command(np.array([v]), np.array([omega]), np.array([zeta])))


def state_of(pose):
    return State(*(np.array([value], dtype=float) for value in pose))


def signed_distance(shape, points, height):
    """Signed distances (n,) of points (n, 2) to a shape, by loops and by angles: none of the code tested."""
    if isinstance(shape, Heights):
        return np.minimum(height - shape.floor, shape.ceiling - height) - shape.margin
    if isinstance(shape, Disc):
        centre = np.array([shape.centre.real, shape.centre.imag])
        return np.sqrt(((points - centre) ** 2).sum(axis=-1)) - shape.radius - shape.margin
    corners = np.asarray(shape.polygon.corners, dtype=float)
    least, turned = np.full(len(points), np.inf), np.zeros(len(points))
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        share = np.clip(((points - a) @ (b - a)) / ((b - a) @ (b - a)), 0, 1)
        least = np.minimum(least, np.linalg.norm(points - a - share[:, None] * (b - a), axis=-1))
        first, then = a - points, b - points
        turned += np.arctan2(first[:, 0] * then[:, 1] - first[:, 1] * then[:, 0], (first * then).sum(axis=-1))
    inside = np.abs(turned) > np.pi
    return np.where(inside == shape.inside, least, -least) - shape.margin


def flown(shape, pose, v, omega):
    """The smallest signed distance while one vehicle flies v and omega for ever, by search."""
    begin, end = (0.0, 2 * np.pi / abs(omega)) if omega else (0.0, 2000.0 / v)
    least = np.inf
    count = 20_001
    for _ in range(7):
        t = np.linspace(begin, end, count)
        there = step(
            State(*(np.full(count, value) for value in pose)), Command(np.full(count, v), omega, 0.0), t
        )
        found = signed_distance(shape, np.stack([there.x, there.y], axis=-1), there.z)
        k = int(np.argmin(found))
        least = min(least, float(found[k]))
        begin, end, count = t[max(k - 1, 0)], t[min(k + 1, count - 1)], 101
    return least


@given(shapes, poses, turns)
@settings(max_examples=60, deadline=None)
def test_h_of_a_turn_is_the_least_clearance_flown(shape, pose, turn):
    v, omega, right = turn
    omega = -omega if right else omega
    h = one(shape, v, omega).values(state_of(pose))[0]
    least = flown(shape, pose, v, omega)
    if h >= 0 or isinstance(shape, Disc | Heights):
        assert h == pytest.approx(least, abs=1e-9)
    else:
        assert least < 1e-9


@given(
    st.sampled_from([s for s in SHAPES.values() if isinstance(s, Disc | Heights)]), poses, st.floats(5, 40)
)
@settings(max_examples=40, deadline=None)
def test_h_of_straight_flight_past_a_disc_is_the_least_clearance_flown(shape, pose, v):
    assert one(shape, v, 0.0).values(state_of(pose))[0] == pytest.approx(flown(shape, pose, v, 0.0), abs=1e-9)


@given(shapes, poses, turns)
@settings(max_examples=200, deadline=None)
def test_gradients_of_all_rows_are_their_differences(shape, pose, turn):
    v, omega, right = turn
    straight = right and isinstance(shape, Disc)
    barrier = one(shape, v, 0.0 if straight else -omega if right else omega)
    rows = barrier.rows(state_of(pose))
    for k in range(4):
        size = 1e-5 if k == 2 else 1e-3
        ends = []
        for sign in (1.0, -1.0):
            moved = list(pose)
            moved[k] += sign * size
            ends.append(barrier.rows(state_of(moved)).h)
        near = [np.abs(end - rows.h) <= 2.0 * size * (1 + v / omega) for end in ends]
        # Where the rows are renamed on the way (the nearest edge, inside to outside), there is no difference.
        smooth = near[0] & near[1] & (np.abs(ends[0] + ends[1] - 2 * rows.h) <= 1e-7 * (1 + v / omega))
        difference = (ends[0] - ends[1]) / (2 * size)
        # One-sided differences agree where h is smooth; the size of a turn's lever scales the error.
        assert np.abs(difference - rows.grad[k])[smooth] == pytest.approx(0.0, abs=1e-6 * (1 + v / omega))


@given(
    st.sampled_from(["keep in, non-convex", "keep out of a large polygon", "keep out of a small disc"]),
    poses,
    turns,
    st.tuples(numbers, numbers),
    st.floats(-4, 4),
    st.booleans(),
)
@settings(max_examples=100, deadline=None)
def test_h_does_not_depend_on_origin_axes_or_hand(name, pose, turn, shift, angle, mirrored):
    """A motion of the plane moves fence and vehicle alike; in a mirror the turn is to the other side."""
    shape, (v, omega, _) = SHAPES[name], turn

    def moved(point):
        point = np.conj(point) if mirrored else point
        return point * np.exp(1j * angle) + complex(*shift)

    if isinstance(shape, Disc):
        other = Disc(complex(moved(shape.centre)), shape.radius, shape.margin)
    else:
        corners = moved(shape.polygon.points)
        other = Area(Polygon(np.stack([corners.real, corners.imag], axis=-1)), shape.inside, shape.margin)
    x, y, theta, z = pose
    place = moved(x + 1j * y)
    there = (place.real, place.imag, (-theta if mirrored else theta) + angle, z)
    h = one(shape, v, omega).values(state_of(pose))
    assert one(other, v, -omega if mirrored else omega).values(state_of(there)) == pytest.approx(h, abs=1e-9)


def two_turns(seed, n=3):
    """A view of n vehicles at random, all in the safe set of every pair and every fence; the fences."""
    rng = np.random.default_rng(seed)
    gamma = TURN.manoeuvre(n)
    fences = Fences(
        [
            Fence(SHAPES["keep in, non-convex"], np.arange(n)),
            Fence(SHAPES["keep out of a small disc"], np.array([0, n - 1])),
            Fence(Area(Polygon(np.array(SMALL) - [200, 0]), inside=False), np.arange(n)),
            Fence(SHAPES["heights"], np.array([1])),
        ],
        gamma,
    )
    for _ in range(2000):
        x, y, theta, z = (rng.uniform(*ends, n) for ends in ((-350, 400), (-300, 320), (-4, 4), (-35, 55)))
        state = State(x, y, theta, z)
        if fences.values(state).min() >= 0 and TURN.values(state).h.min() >= 0:
            break
    else:
        assume(False)
    if seed % 2:  # margins take away what there is left: everybody's nearest vehicle is at its boundary
        h, fenced = fences.values(state), fences.fences
        fences = Fences(
            [
                replace(f, shape=replace(f.shape, margin=f.shape.margin + h[fences.fence == k].min()))
                for k, f in enumerate(fenced)
            ],
            gamma,
        )
    wanted = Command(rng.uniform(12, 28, n), rng.uniform(-0.4, 0.4, n), rng.uniform(-5, 5, n))
    return View(state, Command(np.full(n, 20.0), 0.0, 0.0)), wanted, fences


@given(st.integers(0, 10**6), st.sampled_from(["centralised", "limited"]))
@settings(max_examples=100, deadline=None)
def test_inside_all_safe_sets_the_shared_manoeuvre_satisfies_every_row_and_the_qps_are_solved(seed, mode):
    view, wanted, fences = two_turns(seed)
    filter_ = CollisionFilter(TURN, ALPHA, mode, also=[FenceConstraints(fences, ALPHA)])
    gamma = TURN.manoeuvre(len(view.state)).array()
    for block in filter_.constraints(view):
        assert (block.left(gamma) - block.rhs).min() >= -1e-9
    decision = filter_(view, wanted, LIMITS)
    assert (decision.status == Status.SOLVED).all()
    for block in filter_.constraints(view):
        assert (block.left(decision.command.array()) - block.rhs).min() >= -1e-7


def touching(courses, omega):
    """Heights on the map (2,) at which circles at `omega` touch the square's northern edge from inside."""
    r = V / omega
    return 300.0 - 7.0 - abs(r) - r * np.cos(courses)


@pytest.mark.parametrize(("omega", "unsolved"), [(OMEGA, 0), (-OMEGA, 1)], ids=["shared", "opposite"])
def test_rows_of_two_manoeuvres_may_leave_no_input_though_each_leaves_one(omega, unsolved):
    """Two vehicles on their way north at the fence, and as near to each other as the pair's barrier allows.

    The pair's barrier turns left. Where the fence's does as well there is always a solution; where it turns
    right, each row is satisfied by its own manoeuvre and, from some of these states, all by none.
    """
    n, alpha, found = 2, cubic(0.1), 0
    rng = np.random.default_rng(5)
    gamma = Command(np.full(n, V), np.full(n, omega), np.zeros(n))
    fences = Fences([Fence(SHAPES["keep in a square"], np.arange(n))], gamma)
    filter_ = CollisionFilter(TURN, alpha, also=[FenceConstraints(fences, alpha)])
    for _ in range(100):
        courses = rng.uniform(0.2, 2.9, n)
        y = touching(courses, omega) - 0.01
        apart = np.linspace(0.0, 250.0, 2000)
        first = np.zeros((apart.size, 1))
        rows = State(np.hstack([first, apart[:, None]]), first + y, first + courses, first + np.zeros(n))
        at = np.arange(apart.size)
        h = TURN.values(rows, (at, 0 * at), (at, 0 * at + 1)).h
        k = int(np.argmin(np.where(h >= 0, h, np.inf)))
        state = rows[k]
        assert fences.values(state).min() >= 0
        assert h[k] >= 0
        wanted = Command(np.full(n, 20.0), 0.0, 0.0)
        decision = filter_(View(state, wanted), wanted, LIMITS)
        found += bool((decision.status == Status.INFEASIBLE).any())
    assert (found > 0) == unsolved


def test_a_straight_manoeuvre_has_no_area_to_stay_in():
    with pytest.raises(ValueError, match=r"fence 1 \(fence\), vehicle 1: .*leaves every area"):
        one(SHAPES["keep in a square"], omega=0.0)
    with pytest.raises(ValueError, match="give a circle around it"):
        one(SHAPES["keep out of a small polygon"], omega=0.0)
    with pytest.raises(ValueError, match="climbs at 2 m/s and leaves every height band"):
        one(SHAPES["heights"], zeta=2.0)


@given(poses, st.floats(5, 40), st.floats(0.01, 20))
@settings(max_examples=50, deadline=None)
def test_flying_straight_on_never_lets_h_of_a_disc_fall(pose, v, t):
    barrier = one(SHAPES["keep out of a small disc"], v, 0.0)
    now = state_of(pose)
    then = step(now, Command(np.array([v]), np.zeros(1), np.zeros(1)), t)
    assert barrier.values(then)[0] >= barrier.values(now)[0] - 1e-9
    (rows,) = FenceConstraints(barrier, ALPHA)(View(now, barrier.gamma))
    assert rows.left(np.array([[v, 0.0, 0.0]])).min() >= -1e-9


def test_a_vehicle_alone_is_kept_in_its_fence():
    """A single vehicle has no pair: its filter's rows are those of the fence alone."""
    turn = TurnBarrier(V, OMEGA, 5.0)
    fences = one(SHAPES["keep in a square"])
    filter_ = CollisionFilter(turn, ALPHA, also=[FenceConstraints(fences, ALPHA)])
    state, least = State(np.array([0.0]), np.array([0.0]), np.array([0.3]), np.array([0.0])), np.inf
    ahead = Command(np.array([25.0]), np.zeros(1), np.zeros(1))
    plain = state
    for _ in range(2000):
        command = filter_(View(state, ahead), ahead, LIMITS).command
        state, plain = step(state, command, 0.02), step(plain, ahead, 0.02)
        least = min(least, fences.clearance(state.position)[0])
    assert 0 <= least < 40
    assert fences.clearance(plain.position)[0] < -300


@pytest.mark.parametrize("mode", ["centralised", "limited"])
def test_each_observer_filters_by_its_own_pose(mode):
    view, wanted, fences = two_turns(3)
    n = len(view.state)
    apart = View(
        State.of(np.broadcast_to(view.state.array(), (n, n, 4)).copy()),
        Command.of(np.broadcast_to(view.rates.array(), (n, n, 3)).copy()),
    )
    make = CollisionFilter(TURN, ALPHA, mode, also=[FenceConstraints(fences, ALPHA)])
    same = make(view, wanted, LIMITS).command.array()
    assert make(apart, wanted, LIMITS).command.array() == pytest.approx(same, abs=1e-7)


def test_margins_raise_a_fences_rows():
    view, _, fences = two_turns(3)
    margin = BoundedError(1.0, 0.02, 0.5)
    (rows,) = FenceConstraints(fences, ALPHA)(view)
    raised = rows.raised(margin)
    assert isinstance(raised, Constraints)
    assert raised.rhs - rows.rhs == pytest.approx(np.abs(rows.lie[0]) @ [1.0, 0.02, 0.5])


@pytest.mark.parametrize(
    ("corners", "why"),
    [
        ([[0, 0], [1, 1]], "three corners at least, got 2"),
        ([[0, 0], [10, 10], [10, 0], [0, 10]], "edges 1-2 and 3-4 meet"),
        ([[0, 0], [10, 0], [10, 0], [0, 10]], "corners 2 and 3 are at one place"),
        ([[0, 0], [10, 0], [5, 0], [5, 10]], "folds back on itself at corner 2"),
        ([[0, 0], [10, 0], [10, 10], [5, 0], [0, 10]], "meet"),
        ([[0, 0], [np.nan, 0], [10, 10]], "finite corners"),
    ],
)
def test_what_is_no_simple_polygon_is_refused(corners, why):
    with pytest.raises(ValueError, match=why):
        Polygon(corners)


def test_numbers_out_of_range_are_refused():
    with pytest.raises(ValueError, match="radius must be positive"):
        Disc(0j, -3.0)
    with pytest.raises(ValueError, match="leave no height"):
        Heights(50.0, 20.0)
    with pytest.raises(ValueError, match="leave no height"):
        Heights(0.0, 20.0, margin=10.0)
    with pytest.raises(ValueError, match="margin must be finite and not negative"):
        Area(Polygon(SQUARE), inside=True, margin=-1.0)
