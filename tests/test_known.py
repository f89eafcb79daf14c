"""`View.known`: who is not known is in no row, costs nothing where all are, and passes every stage."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from filters.barriers.class_k import cubic
from filters.barriers.closed_form import TurnBarrier
from filters.barriers.per_pair import PerPair
from filters.cbf.collision import CollisionFilter
from filters.cbf.theorem_monitor import Monitor
from filters.constraints import Constraints
from filters.model import Command, Limits, State, View
from filters.qp.single import Status
from filters.rivals.navigation import NavigationFilter
from filters.wrappers.air_mass import AirMass
from filters.wrappers.pose_prediction import Horizon, Predicted
from testbed.components.border.contract import Breach, Contract
from testbed.components.border.others import OwnEnvironment, OwnFilter
from testbed.environment.network import Network
from testbed.environment.sensing import Sensing

LIMITS = Limits.of(np.tile([15.0, 25.0, np.radians(13.0), 3.9], (5, 1)))
TURN = TurnBarrier(16.0, np.radians(11.7), 5.0, 0.01)
MODES = ("centralised", "limited")


def crowded(seed: int, n: int = 5) -> tuple[View, Command]:
    """Vehicles close together, so that many rows bind."""
    rng = np.random.default_rng(seed)
    state = State(*rng.uniform(-25, 25, (2, n)), rng.uniform(-np.pi, np.pi, n), rng.uniform(-2, 2, n))
    wanted = Command(rng.uniform(10, 30, n), rng.uniform(-0.4, 0.4, n), rng.uniform(-4, 4, n))
    return View(state, Command(np.full(n, 20.0), 0.0, 0.0)), wanted


def limits(n: int) -> Limits:
    return LIMITS[:n]


@pytest.mark.parametrize("mode", MODES)
@given(seed=st.integers(0, 2**32), left=st.lists(st.booleans(), min_size=5, max_size=5))
@settings(max_examples=40, deadline=None)
def test_the_others_are_filtered_as_if_the_unknown_were_not_there(
    mode: str, seed: int, left: list[bool]
) -> None:
    view, wanted = crowded(seed)
    here = ~np.array(left)
    seen = View(view.state, view.rates, here)
    filter_ = CollisionFilter(TURN, cubic(0.1), mode)  # type: ignore[arg-type]
    whole = filter_(seen, wanted, LIMITS)
    assert np.allclose(whole.command.array()[~here], LIMITS.clip(wanted).array()[~here])
    assert (whole.status == int(Status.SOLVED))[~here].all() and not whole.residual[~here].any()
    if here.any():
        part = filter_(View(view.state[here], view.rates[here]), wanted[here], LIMITS[here])
        assert np.allclose(whole.command.array()[here], part.command.array(), atol=1e-7)
        assert np.array_equal(whole.status[here], part.status)
        assert whole.pairs is not None and part.pairs is not None
        both = here[whole.pairs.i] & here[whole.pairs.j]
        assert np.array_equal(whole.pairs.h[both], part.pairs.h)
        assert np.isnan(whole.pairs.h[~both]).all() and np.isnan(whole.hdot_predicted[~both]).all()


@pytest.mark.parametrize("mode", MODES)
def test_what_stands_at_an_unknown_place_has_no_effect(mode: str) -> None:
    view, wanted = crowded(3)
    known = np.array([True, False, True, False, True])
    filter_ = CollisionFilter(TURN, cubic(0.1), mode)  # type: ignore[arg-type]
    state = view.state.array()
    state[[1, 3]] = state[0]  # on top of one another and of a known one
    plain, heaped = (
        filter_(View(s, view.rates, known), wanted, LIMITS) for s in (view.state, State.of(state))
    )
    assert np.array_equal(plain.command.array(), heaped.command.array())


@pytest.mark.parametrize("mode", MODES)
@given(seed=st.integers(0, 2**32))
@settings(max_examples=25, deadline=None)
def test_everybody_known_is_the_same_as_none(mode: str, seed: int) -> None:
    view, wanted = crowded(seed)
    filter_ = CollisionFilter(TURN, cubic(0.1), mode)  # type: ignore[arg-type]
    plain = filter_(view, wanted, LIMITS)
    for known in (np.ones(5, dtype=bool), np.ones((5, 5), dtype=bool)):
        told = filter_(View(view.state, view.rates, known), wanted, LIMITS)
        assert np.allclose(told.command.array(), plain.command.array(), atol=1e-7)
        assert np.array_equal(told.status, plain.status)


def test_limited_a_vehicle_has_rows_of_those_it_knows_and_central_a_pair_if_one_does() -> None:
    view, wanted = crowded(7, 2)
    one_way = np.array([[True, True], [False, True]])  # 1 knows of 2, 2 does not know of 1
    seen = View(view.state, view.rates, one_way)
    limited = CollisionFilter(TURN, cubic(0.1), "limited")
    both, half = limited(view, wanted, limits(2)), limited(seen, wanted, limits(2))
    assert np.allclose(half.command.array()[0], both.command.array()[0], atol=1e-9)
    assert np.array_equal(half.command.array()[1], limits(2).clip(wanted).array()[1])
    assert not np.allclose(both.command.array()[1], half.command.array()[1])
    central = CollisionFilter(TURN, cubic(0.1))
    assert np.allclose(
        central(seen, wanted, limits(2)).command.array(), central(view, wanted, limits(2)).command.array()
    )


def fence(view: View) -> tuple[Constraints, ...]:
    """Every vehicle is held to at most 18 m/s."""
    n = len(view.state)
    lie = np.tile([-1.0, 0.0, 0.0], (n, 1))
    return (Constraints.of((np.arange(n),), (lie,), np.ones(n), np.full(n, 18.0)),)


@pytest.mark.parametrize("mode", MODES)
def test_constraints_beside_the_pairs_leave_out_the_unknown_too(mode: str) -> None:
    view, _ = crowded(1, 3)
    far = State(view.state.x * 100, view.state.y * 100, view.state.theta, view.state.z)
    fast = Command(np.full(3, 24.0), 0.0, 0.0)
    filter_ = CollisionFilter(TURN, cubic(0.1), mode, also=[fence])  # type: ignore[arg-type]
    chosen = filter_(View(far, view.rates, np.array([True, False, True])), fast, limits(3)).command.v
    assert chosen == pytest.approx([18.0, 24.0, 18.0])


def test_a_barrier_of_its_own_for_each_pair_keeps_to_its_pairs() -> None:
    view, wanted = crowded(5, 3)
    barriers = tuple(TurnBarrier(16.0, np.radians(w), 5.0, 0.01) for w in (8.0, 10.0, 12.0))
    known = np.array([True, False, True])
    whole = CollisionFilter(PerPair(barriers), cubic(0.1), shared=False)
    pair = CollisionFilter(PerPair(barriers[1:2]), cubic(0.1), shared=False)
    part = pair(view.__class__(view.state[known], view.rates[known]), wanted[known], limits(2))
    made = whole(View(view.state, view.rates, known), wanted, limits(3))
    assert np.allclose(made.command.array()[known], part.command.array(), atol=1e-7)


def test_the_monitor_looks_at_the_rows_there_are() -> None:
    view, wanted = crowded(2)
    nobody, all_ = Monitor(CollisionFilter(TURN, cubic(0.1))), Monitor(CollisionFilter(TURN, cubic(0.1)))
    nobody(View(view.state, view.rates, np.zeros(5, dtype=bool)), wanted, LIMITS)
    all_(view, wanted, LIMITS)
    assert nobody.record.steps == 1 and nobody.record.checks["gamma_is_safe"].checked == 0
    assert all_.record.checks["limited_is_safe"].checked > 0
    assert nobody.record.cost == nobody.record.cost_limited


def test_the_navigation_function_is_not_repelled_by_the_unknown() -> None:
    state = State([0.0, 6.0], [0.0, 0.5], [0.0, np.pi], [0.0, 0.0])
    rates = Command([20.0, 20.0], 0.0, 0.0)
    law = NavigationFilter([[100.0, 0.0], [-100.0, 0.0]], [[0.0, 0.0], [6.0, 0.5]], path_gain=0.0)
    unknown = law.gradient(View(state, rates, np.eye(2, dtype=bool)))
    assert np.allclose(-unknown / np.abs(unknown), [1.0, -1.0], atol=2e-2)
    assert np.abs(law.gradient(View(state, rates)) - unknown).max() > 0.05 * np.abs(unknown).max()


def test_wrappers_and_stages_pass_on_who_is_known() -> None:
    view, wanted = crowded(7)
    known = np.array([True, True, False, True, True])
    seen: list[View] = []

    def listening(view: View, nominal: Command, limits: Limits) -> object:
        seen.append(view)
        return CollisionFilter(TURN, cubic(0.1))(view, nominal, limits)

    given = View(view.state, view.rates, known)
    Predicted(listening, Horizon(0.3))(given, wanted, LIMITS)  # type: ignore[arg-type]
    AirMass(listening, (2.0, 1.0))(given, wanted, LIMITS)  # type: ignore[arg-type]
    rng = np.random.default_rng(1)
    deviations = np.full(7, 0.1), np.zeros(7), np.zeros(7)
    seen.append(Sensing(*deviations, 0.9, True, 5, rng)(given))
    seen.append(Network(5, 0.1, 0.0, 0.2, 0.1, "hold", False, rng)(given))
    assert len(seen) == 4 and all(s.known is known for s in seen)


def test_a_view_of_one_and_of_oneself_keep_who_is_known() -> None:
    view, _ = crowded(1, 3)
    square = np.array([[True, False, True], [False, True, True], [True, True, True]])
    seen = View(view.state, view.rates, square)
    assert np.array_equal(seen.of(0).known, square[0])
    many = View(
        State.of(np.tile(view.state.array(), (3, 1, 1))), Command.of(np.zeros((3, 3, 3)) + 20.0), square
    )
    assert np.array_equal(many.of(1).known, square[1]) and many.own().known is square
    i, j = np.array([0, 0, 1]), np.array([1, 2, 2])
    assert seen.knows(i, j).tolist() == seen.joined(i, j).tolist() == [False, True, True]
    assert view.knows(i, j).all() and view.of(0) is view


def test_a_users_filter_is_shown_who_is_known_and_cannot_change_it() -> None:
    view, wanted = crowded(4)
    known = np.array([True, True, False, True, True])

    def meddling(view: View, nominal: Command, limits: Limits) -> object:
        assert view.known is not None and not view.known[2]
        with pytest.raises(ValueError, match="read-only"):
            view.known[2] = True
        return CollisionFilter(TURN, cubic(0.1))(view, nominal, limits)

    own = OwnFilter(Contract("filter", "meddling", 5), meddling, LIMITS)
    decision = own(View(view.state, view.rates, known), wanted, LIMITS)
    assert decision.pairs is not None and np.isnan(decision.pairs.h).sum() == 4


def test_a_users_environment_says_who_is_known_or_breaks_its_contract() -> None:
    view, _ = crowded(4)

    class Air:
        def __init__(self, known: object) -> None:
            self.known = known

        def wind(self, t: float, state: State) -> None:
            return None

        def observe(self, t: float, truth: State, rates: Command) -> View:
            return View(truth, rates, self.known)  # type: ignore[arg-type]

    def observed(known: object) -> View:
        made = OwnEnvironment(Contract("environment", "Air", 5), Air(known))
        return made.observe(0.0, view.state, view.rates)

    assert observed(None).known is None
    assert observed(np.eye(5, dtype=bool)).known.tolist() == np.eye(5, dtype=bool).tolist()  # type: ignore[union-attr]
    for wrong, said in ((np.ones(4, dtype=bool), "shape"), (np.ones(5), "truth values"), ("all", "a str")):
        with pytest.raises(Breach, match=rf"observe\(\)\.known .*{said}"):
            observed(wrong)
