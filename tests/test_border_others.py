"""A user's guidance and environment behind the border: what each is given, and each clause."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from filters.model import Command, State, View
from testbed.components.border.others import OwnEnvironment, OwnGuidance
from tests.behind_the_border import FLOWN, START, contract, raising, refuses_writing, said

VIEW = View(START, FLOWN)


# Guidance


def test_guidance_is_given_a_view_if_it_takes_one_and_else_the_state() -> None:
    seen: list[Any] = []

    def by_view(t: float, view: View) -> Command:
        seen.append((t, view))
        return FLOWN

    def by_state(t: float, state: State) -> Command:
        seen.append((t, state))
        return FLOWN

    def view_first(view: Any, state: State) -> Command:
        seen.append((view, state))
        return FLOWN

    def of_view(t: float, view: View, gain: float = 1.0) -> Command:
        assert isinstance(view, View)
        return FLOWN

    OwnGuidance(contract("guidance"), of_view)(0.0, VIEW)
    for law in (by_view, by_state, view_first):
        found = OwnGuidance(contract("guidance"), law)(2.5, VIEW)
        assert np.array_equal(found.array(), FLOWN.array()) and found is not FLOWN
    (t, view), (_, state), (_, other) = seen
    assert t == 2.5 and isinstance(view, View) and refuses_writing(view.state.x)
    assert (
        isinstance(state, State) and np.array_equal(state.array(), START.array()) and refuses_writing(state.x)
    )
    assert isinstance(other, State)


@pytest.mark.parametrize(
    ("law", "clause"),
    [
        (lambda t, state: None, "its command is None, not a Command"),
        (lambda t, state: FLOWN[:1], "its command.v has shape (1,), not (3,)"),
        (lambda t, state: Command.of(FLOWN.array() * np.nan), "its command.v is not finite: nan, vehicle 1"),
    ],
)
def test_guidance_that_breaks_a_clause_is_named(law: Any, clause: str) -> None:
    assert said(OwnGuidance(contract("guidance"), law), 0.0, VIEW) == clause


def test_guidance_that_raises_or_cannot_be_called_is_named() -> None:
    clause = said(OwnGuidance(contract("guidance"), raising), 0.0, VIEW)
    assert clause.startswith("the call raised RuntimeError: the engine fell off")
    assert said(OwnGuidance, contract("guidance"), 3) == "it is a int, which cannot be called"


# The environment


def environment(wind: Any = None, observe: Any = None) -> OwnEnvironment:
    usual = SimpleNamespace(
        wind=wind or (lambda t, state: None), observe=observe or (lambda t, truth, rates: View(truth, rates))
    )
    return OwnEnvironment(contract("environment"), usual)


def test_the_wind_is_copied_and_none_is_still_air_for_ever() -> None:
    blown = np.arange(9.0).reshape(3, 3)
    made = environment(lambda t, state: blown)
    found = made.wind(0.0, START)
    assert np.array_equal(found, blown) and not np.shares_memory(found, blown) and refuses_writing(found)
    assert made.wind(1.0, START) is not None
    still = environment()
    assert still.wind(0.0, START) is None and still.wind(1.0, START) is None
    clause = "wind() is None at some times only; return zeros (N, 3) where air is still for a while"
    at_first = environment(lambda t, state: None if t == 0 else blown)
    at_first.wind(0.0, START)
    assert said(at_first.wind, 1.0, START) == clause
    later = environment(lambda t, state: blown if t == 0 else None)
    later.wind(0.0, START)
    assert said(later.wind, 1.0, START) == clause


def test_the_environment_is_given_copies_one_of_the_same_state() -> None:
    seen: list[Any] = []

    def wind(t: float, state: State) -> None:
        seen.append(state)

    def observe(t: float, truth: State, rates: Command) -> View:
        seen.extend((t, truth, rates))
        return View(truth, rates)

    made = environment(wind, observe)
    made.wind(1.0, START)
    found = made.observe(1.5, START, FLOWN)
    state, t, truth, rates = seen
    assert state is truth and refuses_writing(truth.x) and np.array_equal(truth.array(), START.array())
    assert t == 1.5 and np.array_equal(rates.array(), FLOWN.array()) and refuses_writing(rates.v)
    assert np.array_equal(found.state.array(), START.array()) and found.state is not truth
    assert np.array_equal(found.rates.array(), FLOWN.array()) and found.known is None
    later = State.of(START.array() + 1.0)
    made.wind(2.0, later)
    assert np.array_equal(seen[-1].array(), later.array())
    made.wind(2.0, START)
    assert np.array_equal(seen[-1].array(), START.array())


def test_an_observation_of_each_vehicles_own_is_taken() -> None:
    each = State.of(np.arange(36.0).reshape(3, 3, 4))
    rates = Command.of(np.arange(27.0).reshape(3, 3, 3))
    known = np.array([[True, True, False], [True, True, True], [False, True, True]])
    found = environment(observe=lambda *_: View(each, rates, known)).observe(0.0, START, FLOWN)
    assert np.array_equal(found.state.array(), each.array())
    assert np.array_equal(found.rates.array(), rates.array())
    assert np.array_equal(found.known, known) and not np.shares_memory(found.known, known)
    of_all = np.array([True, False, True])
    found = environment(observe=lambda *_: View(START, FLOWN, of_all)).observe(0.0, START, FLOWN)
    assert np.array_equal(found.known, of_all)


@pytest.mark.parametrize(
    ("view", "clause"),
    [
        (3, "observe() is a int, not a View"),
        (View(None, FLOWN), "observe().state is None, not a State"),
        (View(SimpleNamespace(), FLOWN), "observe().state is a SimpleNamespace, not a State"),
        (View(SimpleNamespace(x=[1.0, 2.0]), FLOWN), "observe().state is a SimpleNamespace, not a State"),
        (View(START, None), "observe().rates is None, not a Command"),
        (View(START[:2], FLOWN), "observe().state.x has shape (2,), not (3,)"),
        (View(State.of(np.zeros((2, 3, 4))), FLOWN), "observe().state.x has shape (2, 3), not (3, 3)"),
        (View(START, Command.of(np.zeros((3, 3, 3)))), "observe().rates.v has shape (3, 3), not (3,)"),
        (View(State.of(np.full((3, 4), np.inf)), FLOWN), "observe().state.x is not finite: inf, vehicle 1"),
        (View(START, Command.of(FLOWN.array() * np.nan)), "observe().rates.v is not finite: nan, vehicle 1"),
        (
            View(START, FLOWN, np.ones(3)),
            "observe().known is a ndarray of dtype float64, not an array of truth values",
        ),
        (View(START, FLOWN, np.ones(2, dtype=bool)), "observe().known has shape (2,), not (3,)"),
        (View(START, FLOWN, np.ones((3, 2), dtype=bool)), "observe().known has shape (3, 2), not (3, 3)"),
        (View(START, FLOWN, True), "observe().known has shape (), not (3, 3)"),
    ],
)
def test_an_observation_that_breaks_a_clause_is_named(view: Any, clause: str) -> None:
    assert said(environment(observe=lambda *_: view).observe, 0.0, START, FLOWN) == clause


def test_an_environment_that_raises_or_lacks_a_method_is_named() -> None:
    assert said(environment(wind=raising).wind, 0.0, START).startswith("wind() raised RuntimeError: the")
    assert said(environment(observe=raising).observe, 0.0, START, FLOWN).startswith(
        "observe() raised Runtime"
    )
    clause = "wind() has shape (3,), not (3, 3)"
    assert said(environment(wind=lambda *_: np.zeros(3)).wind, 0.0, START) == clause
    for name in ("wind", "observe"):
        lacks = SimpleNamespace(**{other: raising for other in ("wind", "observe") if other != name})
        assert said(OwnEnvironment, contract("environment"), lacks) == f"it has no method {name}()"
