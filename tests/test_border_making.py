"""Makers of a user's own parts: what they are given, and what happens to what they raise."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import testbed
from filters.filter import Declaration
from filters.model import Command, State, View
from testbed.components import catalogue
from testbed.components.border.contract import Breach
from testbed.components.border.making import Maker
from testbed.components.border.others import OwnEnvironment, OwnFilter, OwnGuidance
from testbed.components.border.plant import OwnPlant
from testbed.components.initial_conditions import generators, places
from testbed.errors import UserError
from testbed.scenario.scenario import Scenario, load
from tests.behind_the_border import refuses_writing

GOAL = np.array([[100.0, 0.0, 0.0], [-100.0, 0.0, 0.0]])
WIND = np.ones((2, 3))
# Role -> the method of the maker that makes it, with what it is given.
METHODS: dict[str, tuple[str, tuple[Any, ...], str]] = {
    "plant": ("plant", (WIND,), "plant"),
    "filter": ("filter", (), "filter"),
    "nominal": ("guidance", (), "guidance"),
    "disturbance": ("environment", ({},), "environment"),
}


def maker(*overrides: str, **parts: Any) -> tuple[Maker, Scenario, Any]:
    s = load("paper-2-turn", list(overrides))
    barrier, made = catalogue.barrier(s), testbed.Parts(**parts)
    return Maker(made, made.own(), s, barrier, GOAL, catalogue.limits(s)), s, barrier


def make(role: str, of: Maker) -> Any:
    name, given, _ = METHODS[role]
    return getattr(of, name)(*given)


def raising(*_: Any) -> Any:
    raise RuntimeError("the engine fell off")


def refusing(*_: Any) -> Any:
    raise UserError("no such engine")


def nothing(*_: Any) -> Any:
    return None


@pytest.mark.parametrize("role", METHODS)
def test_a_maker_that_raises_or_makes_nothing_breaks_its_parts_contract(role: str) -> None:
    word = METHODS[role][2]
    for broken, clause in (
        (raising, "making it raised RuntimeError: the engine fell off ("),
        (nothing, "it "),
    ):
        with pytest.raises(Breach) as raised:
            make(role, maker(**{role: broken})[0])
        assert raised.value.part == word and raised.value.clause.startswith(clause)
        assert raised.value.whose.endswith(f"test_border_making.{broken.__name__}")


@pytest.mark.parametrize("role", METHODS)
def test_what_a_maker_tells_the_user_passes(role: str) -> None:
    with pytest.raises(UserError, match=r"^no such engine$"):
        make(role, maker(**{role: refusing})[0])


@pytest.mark.parametrize("role", METHODS)
def test_a_part_of_the_catalogue_is_made_as_it_is(role: str) -> None:
    """With the scenario, goals and barrier of the run themselves; only a user's are wrapped."""
    given: list[Any] = []

    class Usual(testbed.Parts):
        def own(self) -> dict[str, Any]:
            return {}

    def keeps(*arguments: Any) -> str:
        given.extend(arguments)
        return "made"

    s = load("paper-2-turn")
    barrier = catalogue.barrier(s)
    of = Maker(Usual(**{role: keeps}), {}, s, barrier, GOAL, catalogue.limits(s))
    assert make(role, of) == "made"
    due = {
        "plant": (s, WIND),
        "filter": (s, barrier, GOAL),
        "nominal": (s, GOAL, barrier),
        "disturbance": (s, {}),
    }
    assert len(given) == len(due[role]) and all(
        a is b or a == b for a, b in zip(given, due[role], strict=True)
    )
    assert given[0] is s


class Everything:
    """A plant, a filter, a guidance and an environment at once, which keeps what it was made with."""

    dt = 0.005
    made: tuple[Any, ...] = ()

    def __init__(self, *given: Any) -> None:
        Everything.made = given

    def __call__(self, *_: Any) -> Any:
        return None

    reset = step = state = achieved = telemetry = faults = wind = observe = __call__


def test_a_users_maker_is_given_copies() -> None:
    kinds = {"plant": OwnPlant, "filter": OwnFilter, "nominal": OwnGuidance, "disturbance": OwnEnvironment}
    for role, kind in kinds.items():
        of, s, barrier = maker(**{role: Everything})
        assert type(make(role, of)) is kind
        given = Everything.made
        assert given[0] == s and given[0] is not s and given[0].limits is not s.limits
        if role == "plant":
            assert np.array_equal(given[1], WIND) and refuses_writing(given[1]) and len(given) == 2
        elif role != "disturbance":
            goal, own = (given[2], given[1]) if role == "filter" else (given[1], given[2])
            assert np.array_equal(goal, GOAL) and goal is not GOAL and refuses_writing(goal)
            assert type(own) is type(barrier) and own is not barrier and own.d_safe == barrier.d_safe
    assert GOAL.flags.writeable and WIND.flags.writeable


def test_an_environments_generators_are_the_runs_after_the_start_was_drawn() -> None:
    of, s, _ = maker("start.heading_perturbation_deg=5", "seed=11", disturbance=Everything)
    taken = {"start": np.random.default_rng(0)}
    of.environment(taken)
    given = Everything.made[1]
    due = generators(11)
    assert set(given) == set(due)
    places(s, due["start"])
    assert {name: rng.random() for name, rng in given.items()} == {
        name: rng.random() for name, rng in due.items()
    }
    assert taken["start"].random() == np.random.default_rng(0).random()


def test_the_periods_and_the_limits_are_the_scenarios() -> None:
    of, s, _ = maker("fdm_dt_s=0.0025", plant=Everything)
    with pytest.raises(Breach, match=r"its dt is 0.005 s, the scenario's rates.fdm_dt_s is 0.0025 s"):
        of.plant(WIND)
    seen: list[Any] = []

    def choose(view: View, nominal: Command, limits: Any) -> None:
        seen.append(limits)

    of, s, _ = maker(filter=lambda *_: choose)
    own = of.filter()
    view = View(State.of(np.zeros((2, 4))), Command.of(np.ones((2, 3))))
    with pytest.raises(Breach, match="it returned a NoneType, not a Decision"):
        own(view, view.rates, None)
    assert np.array_equal(seen[0].array(), catalogue.limits(s).array())
    with pytest.raises(Breach, match=r"its command is None, not a Command"):
        maker(nominal=Everything)[0].guidance()(0.0, view)


def test_a_filter_is_made_for_the_remedies_that_are_applied_to_it() -> None:
    """A larger Ds is in the barrier and the scenario that it is made from; the remedy itself is gone."""
    of, s, barrier = maker("remedy.ds_buffer_m=2", filter=Everything)
    of.filter()
    given, own, _ = Everything.made
    assert s.d_safe_m == barrier.d_safe and own.d_safe == given.d_safe_m == s.d_safe_m + 2.0
    assert given.remedy.ds_buffer_m == 0.0
    seen: list[View] = []

    class Looking:
        declaration = Declaration()

        def __call__(self, view: View, nominal: Command, limits: Any) -> None:
            seen.append(view)

    of, _, _ = maker("remedy.prediction_s=1", filter=lambda *_: Looking())
    state, rates = State.of(np.zeros((2, 4))), Command.of([[10.0, 0.0, 0.0], [20.0, 0.0, 1.0]])
    with pytest.raises(Breach):
        of.filter()(View(state, rates), rates, None)
    np.testing.assert_allclose(seen[0].state.position, [[10.0, 0.0, 0.0], [20.0, 0.0, 1.0]], atol=1e-9)


def test_a_filter_predicts_the_lags_of_the_scenario() -> None:
    """0.5 s of delay in the turn and speed: it is shown where its vehicles will be, by its own manoeuvre."""
    more = ["plant=lagged", "remedy.predict_lags=true", "lags.source=table", "lags.v_delay_s=0.5"]
    seen: list[View] = []

    def choose(view: View, nominal: Command, limits: Any) -> None:
        seen.append(view)

    of, _, _ = maker(*more, filter=lambda *_: choose)
    state, rates = State.of(np.zeros((2, 4))), Command.of([[20.0, 0.0, 0.0], [20.0, 0.0, 0.0]])
    with pytest.raises(Breach, match="not a Decision"):
        of.filter()(View(state, rates), rates, None)
    assert (seen[0].state.x > 1.0).all()


@pytest.mark.parametrize(("role", "place"), [("filter", 1), ("nominal", 2)])
def test_what_a_users_maker_writes_into_the_barrier_stays_there(role: str, place: int) -> None:
    listed = "[{v_mps=20, omega_degps=5}, {v_mps=18, omega_degps=-5}]"
    of, _, barrier = maker('barrier.kind="rollout"', f"barrier.manoeuvres={listed}", **{role: Everything})
    make(role, of)
    own = Everything.made[place]
    arrays = [(name, x) for name, x in vars(barrier.gamma).items() if isinstance(x, np.ndarray)]
    assert arrays
    for name, values in arrays:
        assert not np.shares_memory(values, getattr(own.gamma, name)), name
