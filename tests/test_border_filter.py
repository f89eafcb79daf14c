"""A user's filter behind the border: what it is given, and each clause of decision and declaration."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from filters.barriers.pairs import PairValues, all_pairs
from filters.constraints import Constraints
from filters.filter import Decision, Declaration
from filters.model import Command, State, View
from testbed.components.border.others import OwnFilter
from tests.behind_the_border import FLOWN, LIMITS, START, contract, raising, refuses_writing, said

# The filter

I, J = all_pairs(3)
VALUES = PairValues(I, J, np.array([1.0, 2.0, 3.0]), np.arange(24.0).reshape(3, 8))
FINE = Decision(
    FLOWN, np.zeros(3, dtype=int), np.zeros(3), np.array([True, False, True]), np.array([0.1, 0.2, 0.3]),
    VALUES, np.array([4.0, 5.0, 6.0]),
)  # fmt: skip
VIEW = View(START, FLOWN)


def own_filter(answer: Any = FINE, **declared: Any) -> OwnFilter:
    """Over a filter that answers so, whatever it is asked, and declares so."""

    class Answering:
        asked: Any = None

        def __call__(self, *arguments: Any) -> Any:
            Answering.asked = arguments
            return answer

        declaration = Declaration(**declared)

    made = OwnFilter(contract("filter"), Answering(), LIMITS)
    made.asked = lambda: Answering.asked  # type: ignore[attr-defined]
    return made


def but(**fields: Any) -> Decision:
    return replace(FINE, **fields)


def test_a_filter_is_given_copies_and_its_decision_is_copied() -> None:
    made = own_filter()
    found = made(VIEW, FLOWN, LIMITS)
    view, nominal, limits = made.asked()  # type: ignore[attr-defined]
    assert refuses_writing(view.state.x) and refuses_writing(nominal.v) and refuses_writing(limits.v_max)
    assert np.array_equal(view.state.array(), START.array())
    assert np.array_equal(nominal.array(), FLOWN.array()) and nominal is not FLOWN
    assert np.array_equal(limits.array(), LIMITS.array()) and LIMITS.v_max.flags.writeable
    for name in ("status", "residual", "override", "deviation", "hdot_predicted"):
        own, given = getattr(found, name), getattr(FINE, name)
        assert np.array_equal(own, given) and not np.shares_memory(own, given), name
    assert np.array_equal(found.command.array(), FLOWN.array()) and refuses_writing(found.command.v)
    assert np.array_equal(found.pairs.h, VALUES.h) and np.array_equal(found.pairs.grad, VALUES.grad)
    assert np.array_equal(found.pairs.i, I) and np.array_equal(found.pairs.j, J)
    assert not np.shares_memory(found.pairs.h, VALUES.h)
    assert made.refused is None and type(found) is Decision


def test_a_filter_without_pairs_has_none() -> None:
    found = own_filter(but(pairs=None, hdot_predicted="whatever"))(VIEW, FLOWN, LIMITS)
    assert found.pairs is None and found.hdot_predicted.shape == (0,)


@pytest.mark.parametrize(
    ("answer", "clause"),
    [
        (3, "it returned a int, not a Decision"),
        (but(command=None), "command is None, not a Command"),
        (but(command=FLOWN[:2]), "command.v has shape (2,), not (3,)"),
        (but(status=np.zeros(3)), "status is a ndarray of dtype float64, not an array of whole numbers"),
        (but(status=np.zeros(2, dtype=int)), "status has shape (2,), not (3,)"),
        (but(status=np.array([0, 0, 77])), "status [0, 0, 77] has a value that filters.qp.Status has not"),
        (but(residual=np.zeros(2)), "residual has shape (2,), not (3,)"),
        (but(residual=np.full(3, np.nan)), "residual is not finite: nan, vehicle 1"),
        (but(override=np.zeros(3)), "override is a ndarray of dtype float64, not an array of truth values"),
        (but(override=np.zeros(2, dtype=bool)), "override has shape (2,), not (3,)"),
        (but(deviation=np.zeros(2)), "deviation has shape (2,), not (3,)"),
        (but(deviation=np.full(3, np.inf)), "deviation is not finite: inf, vehicle 1"),
        (but(pairs=3), "pairs is a int, not PairValues"),
        (but(pairs=replace(VALUES, i=J, j=I)), "pairs.i are not those of all pairs i < j, in row order"),
        (
            but(pairs=replace(VALUES, j=J[::-1].copy())),
            "pairs.j are not those of all pairs i < j, in row order",
        ),
        (but(pairs=replace(VALUES, i=I[:2])), "pairs.i has shape (2,), not (3,)"),
        (
            but(pairs=replace(VALUES, j=J * 1.0)),
            "pairs.j is a ndarray of dtype float64, not an array of whole numbers",
        ),
        (but(pairs=replace(VALUES, h=np.zeros(2))), "pairs.h has shape (2,), not (3,)"),
        (but(pairs=replace(VALUES, grad=np.zeros((3, 4)))), "pairs.grad has shape (3, 4), not (3, 8)"),
        (but(hdot_predicted=np.zeros(2)), "hdot_predicted has shape (2,), not (3,)"),
        (but(hdot_predicted=np.full(3, np.nan)), "hdot_predicted is not finite: nan, vehicle 1"),
    ],
)
def test_a_decision_that_breaks_a_clause_is_named(answer: Any, clause: str) -> None:
    assert said(own_filter(answer), VIEW, FLOWN, LIMITS) == clause


def test_equal_pair_indices_are_as_good_as_the_same() -> None:
    same = replace(VALUES, i=list(I), j=np.array(J))
    found = own_filter(but(pairs=same))(VIEW, FLOWN, LIMITS)
    assert np.array_equal(found.pairs.i, I) and np.array_equal(found.pairs.j, J)
    assert found.pairs.known is None
    assert found.pairs.lie(START)[0].shape == (3, 3)


def test_the_projects_own_indices_of_one_side_say_nothing_of_the_other() -> None:
    i, j = all_pairs(3)  # the very arrays that the border has
    fine = but(pairs=replace(VALUES, i=i, j=j))
    assert own_filter(fine)(VIEW, FLOWN, LIMITS).pairs.i is i
    only_i, only_j = replace(VALUES, i=i, j=j[::-1].copy()), replace(VALUES, i=i[::-1].copy(), j=j)
    assert "pairs.j are not" in said(own_filter(but(pairs=only_i)), VIEW, FLOWN, LIMITS)
    assert "pairs.i are not" in said(own_filter(but(pairs=only_j)), VIEW, FLOWN, LIMITS)


def test_a_call_that_raises_is_named() -> None:
    assert said(OwnFilter(contract("filter"), raising, LIMITS), VIEW, FLOWN, LIMITS).startswith(
        "the call raised RuntimeError: the engine fell off"
    )
    assert said(OwnFilter, contract("filter"), 3, LIMITS) == "it is a int, which cannot be called"


@pytest.mark.parametrize("number", [np.nan, np.inf, -np.inf, 2e9, -2e9])
def test_a_command_that_cannot_be_flown_is_passed_on_as_nan_with_the_reason(number: float) -> None:
    bad = FLOWN.array()
    bad[1, 0] = number
    answers = [but(command=Command.of(bad)), FINE]
    made = OwnFilter(contract("filter"), lambda *_: answers.pop(0), LIMITS)
    found = made(VIEW, FLOWN, LIMITS)
    why = f"is not finite: {number:g}" if not np.isfinite(number) else f"is {number:g}, beyond 1e+09"
    assert made.refused is not None and made.refused.clause == f"command.v {why}, vehicle 2"
    due = FLOWN.array()
    due[1, 0] = np.nan
    assert np.array_equal(found.command.array(), due, equal_nan=True)
    made(VIEW, FLOWN, LIMITS)
    assert made.refused is None


def test_a_large_command_that_is_finite_is_left_to_the_limits() -> None:
    fast = FLOWN.array()
    fast[0, 0] = 1e9
    fast[2, 2] = -1e9
    made = own_filter(but(command=Command.of(fast)))
    assert np.array_equal(made(VIEW, FLOWN, LIMITS).command.array(), fast) and made.refused is None


# Pairs that do not know of each other: vehicle 3 knows nobody, and nobody knows it.
APART = View(START, FLOWN, np.array([True, True, False]))


def test_what_is_said_of_pairs_that_do_not_know_of_each_other_is_dropped() -> None:
    h, grad, hdot = VALUES.h.copy(), VALUES.grad.copy(), FINE.hdot_predicted.copy()
    h[1:], grad[1:], hdot[1:] = np.nan, np.inf, -np.inf
    answer = but(pairs=replace(VALUES, h=h, grad=grad), hdot_predicted=hdot)
    found = own_filter(answer)(APART, FLOWN, LIMITS)
    assert found.pairs.h[0] == 1.0 and np.isnan(found.pairs.h[1:]).all()
    assert np.array_equal(found.pairs.grad[0], VALUES.grad[0]) and np.isnan(found.pairs.grad[1:]).all()
    assert found.hdot_predicted[0] == 4.0 and np.isnan(found.hdot_predicted[1:]).all()
    assert found.pairs.h.dtype == found.pairs.grad.dtype == found.hdot_predicted.dtype == float
    assert np.isnan(h[1]) and np.isinf(grad[2, 0])  # the filter's own arrays are as they were
    finite = own_filter()(APART, FLOWN, LIMITS)
    assert np.array_equal(np.isnan(finite.pairs.h), [False, True, True])
    assert np.array_equal(np.isnan(finite.hdot_predicted), [False, True, True])


@pytest.mark.parametrize(
    ("answer", "clause"),
    [
        (but(pairs=replace(VALUES, h=VALUES.h * np.nan)), "pairs.h is not finite: nan, vehicle 1"),
        (but(pairs=replace(VALUES, h=[1.0, 2.0])), "pairs.h has shape (2,), not (3,)"),
        (
            but(pairs=replace(VALUES, h=np.array(["a", "b", "c"]))),
            "pairs.h is a ndarray of dtype <U1, not an array of real numbers",
        ),
        (
            but(pairs=replace(VALUES, grad=np.full((3, 8), np.inf))),
            "pairs.grad is not finite: inf, vehicle 1",
        ),
        (but(pairs=replace(VALUES, grad=np.zeros((2, 8)))), "pairs.grad has shape (2, 8), not (3, 8)"),
        (but(hdot_predicted=np.full(3, np.nan)), "hdot_predicted is not finite: nan, vehicle 1"),
        (but(hdot_predicted=np.zeros(4)), "hdot_predicted has shape (4,), not (3,)"),
    ],
)
def test_pairs_that_know_of_each_other_are_checked_all_the_same(answer: Any, clause: str) -> None:
    assert said(own_filter(answer), APART, FLOWN, LIMITS) == clause


def test_whole_numbers_of_pairs_are_taken_where_some_are_apart() -> None:
    whole = but(pairs=replace(VALUES, h=np.array([1, 2, 3])), hdot_predicted=np.array([4, 5, 6]))
    found = own_filter(whole)(APART, FLOWN, LIMITS)
    assert np.array_equal(found.pairs.h, [1.0, np.nan, np.nan], equal_nan=True)
    assert np.array_equal(found.hdot_predicted, [4.0, np.nan, np.nan], equal_nan=True)


# What a filter declares


class Spheres:
    """h = x of vehicle i, in m, of all pairs."""

    def __init__(self, answer: Any = None) -> None:
        self.answer = answer

    def values(self, state: State) -> Any:
        assert refuses_writing(state.x)
        if self.answer is not None:
            return self.answer
        return PairValues(I, J, np.array([-1.0, 2.0, 0.5]), np.ones((3, 8)))


def test_only_what_is_declared_is_declared() -> None:
    barrier, rows = Spheres(), lambda view: ()
    for declared, words in (
        ({}, []),
        ({"constraints": rows}, []),
        ({"barrier": barrier}, ["barrier"]),
        ({"barrier": barrier, "alpha": np.sinh}, ["barrier", "alpha"]),
        ({"barrier": barrier, "constraints": rows}, ["barrier", "constraints"]),
        ({"barrier": barrier, "alpha": np.sinh, "constraints": rows}, ["barrier", "alpha", "constraints"]),
        ({"barrier": barrier, "alpha": np.sinh, "constraints": rows, "paper": True}, []),
        ({"alpha": np.sinh}, []),
    ):
        made = own_filter(**declared)
        assert made.declared == words and made.declares is ("constraints" in declared)
        assert made.declaration == Declaration()
    assert own_filter(solves_qp=True).declaration == Declaration(solves_qp=True)
    assert OwnFilter(contract("filter"), lambda *_: None, LIMITS).declared == []


@pytest.mark.parametrize(
    ("declared", "clause"),
    [
        ({"constraints": 3}, "its declared constraints are a int, which cannot be called"),
        ({"barrier": 3}, "its declared barrier has no method values()"),
        ({"barrier": Spheres(), "alpha": 3}, "its declared alpha is a int, which cannot be called"),
        ({"barrier": Spheres(), "alpha": np.cosh}, "its declared alpha is not of class K: alpha(0) is 1"),
        (
            {"barrier": Spheres(), "alpha": lambda h: h - 2e-9},
            "its declared alpha is not of class K: alpha(0) is -2e-09",
        ),
        ({"barrier": Spheres(), "alpha": lambda h: 0.0}, "its declared alpha has shape (), not (1,)"),
    ],
)
def test_a_declaration_that_is_none_is_a_breach(declared: Any, clause: str) -> None:
    assert said(own_filter, **declared) == clause


def test_a_declaration_that_raises_is_a_breach() -> None:
    class Silent:
        declaration = property(raising)
        __call__ = raising

    clause = said(OwnFilter, contract("filter"), Silent(), LIMITS)
    assert clause.startswith("declaration raised RuntimeError: the engine fell off")
    broken = type("Broken", (Spheres,), {"values": raising})()
    clause = said(own_filter(barrier=broken).barrier_values, START)
    assert clause.startswith("values() of its declared barrier raised RuntimeError: the engine fell off")
    clause = said(own_filter, barrier=Spheres(), alpha=raising)
    assert clause.startswith("its declared alpha raised RuntimeError: the engine fell off")


def test_the_declared_barrier_is_valued_at_the_state_given() -> None:
    pairs, alpha_h = own_filter(barrier=Spheres()).barrier_values(START)
    assert list(pairs.h) == [-1.0, 2.0, 0.5] and alpha_h is None and pairs.grad.shape == (3, 8)
    pairs, alpha_h = own_filter(barrier=Spheres(), alpha=lambda h: 2.0 * h).barrier_values(START)
    assert list(pairs.h) == [-1.0, 2.0, 0.5] and list(alpha_h) == [-2.0, 4.0, 1.0]

    def writes(h: np.ndarray) -> np.ndarray:
        h += 5.0 * (h.size > 1)
        return h - 5.0 * (h.size > 1)

    pairs, alpha_h = own_filter(barrier=Spheres(), alpha=writes).barrier_values(START)
    assert list(pairs.h) == list(alpha_h) == [-1.0, 2.0, 0.5]


def flat_then(change: float) -> Callable[[np.ndarray], np.ndarray]:
    """5 h, but at the largest h so much more or less than at the one below it."""

    def alpha(h: np.ndarray) -> np.ndarray:
        out = np.asarray(5.0 * h)
        if h.size == 3:
            out[1] = out[2] + change
        return out

    return alpha


def test_a_declared_alpha_grows_with_h_through_zero() -> None:
    never = "its declared alpha is not of class K: it does not grow with h from alpha(0) = 0"
    slack = 1e-9 * (1.0 + 2.5)
    for fine in (0.0, -0.9 * slack, 1.0):
        own_filter(barrier=Spheres(), alpha=flat_then(fine)).barrier_values(START)
    for falls in (-1.1 * slack, -1.0):
        made = own_filter(barrier=Spheres(), alpha=flat_then(falls))
        assert said(made.barrier_values, START) == never
    # By more than the round-off of its numbers there, whatever they are elsewhere.
    far = Spheres(replace(VALUES, h=np.array([1.0, 2.0, 3.0])))
    made = own_filter(barrier=far, alpha=lambda h: np.array([5.0, 5.0 - 5e-4, 1e6])[: h.size] * (h > 0))
    assert said(made.barrier_values, START) == never
    # Round-off near zero is none.
    near = Spheres(replace(VALUES, h=np.array([1e-6, 2.0, 3.0])))
    made = own_filter(barrier=near, alpha=lambda h: np.where(h < 1e-5, -5e-10, h) * (h > 0))
    made.barrier_values(START)
    # On the wrong side of zero, though it grows.
    for off in (lambda h: np.where(h < 0, 0.1, h), lambda h: np.where(h > 0, h - 0.7, h)):
        assert said(own_filter(barrier=Spheres(), alpha=off).barrier_values, START) == never
    # By round-off.
    own_filter(barrier=Spheres(), alpha=lambda h: np.where(h < 0, 9e-10, h)).barrier_values(START)
    own_filter(barrier=Spheres(), alpha=lambda h: h + 9e-10 * (h.size == 1)).barrier_values(START)
    clause = said(own_filter(barrier=Spheres(), alpha=odd).barrier_values, START)
    assert clause.startswith("its declared alpha raised ValueError: odd")
    short = own_filter(barrier=Spheres(), alpha=lambda h: h[:1])
    assert said(short.barrier_values, START) == "its declared alpha has shape (1,), not (3,)"


def odd(h: np.ndarray) -> np.ndarray:
    if h.size > 1:
        raise ValueError("odd")
    return h


@pytest.mark.parametrize(
    ("answer", "clause"),
    [
        (3, "values() of its declared barrier is a int, not PairValues"),
        (
            replace(VALUES, h=np.full(3, np.nan)),
            "values() of its declared barrier.h is not finite: nan, vehicle 1",
        ),
        (
            replace(VALUES, i=J),
            "values() of its declared barrier.i are not those of all pairs i < j, in row order",
        ),
    ],
)
def test_a_declared_barrier_that_breaks_a_clause_is_named(answer: Any, clause: str) -> None:
    assert said(own_filter(barrier=Spheres(answer)).barrier_values, START) == clause


# Declared rows


def block(**fields: Any) -> Any:
    usual = {
        "vehicles": (np.array([0, 1]), np.array([2, 0])),
        "lie": (np.ones((2, 3)), 2.0 * np.ones((2, 3))),
        "h": np.array([1.0, 2.0]),
        "rhs": np.array([-1.0, -2.0]),
    }
    return Constraints(**(usual | fields))


def rows_of(found: Any) -> tuple[Constraints, ...]:
    return own_filter(constraints=lambda view: found).rows(VIEW)


def test_declared_rows_are_copied() -> None:
    given = block()
    one = block(vehicles=(np.array([2, 0]),), lie=(np.ones((2, 3)),))
    for found in (rows_of((given, one)), rows_of([given, one])):
        assert len(found) == 2 and isinstance(found, tuple)
        made = found[0]
        for name in ("h", "rhs"):
            own = getattr(made, name)
            assert np.array_equal(own, getattr(given, name)) and not np.shares_memory(
                own, getattr(given, name)
            )
        for name in ("vehicles", "lie"):
            for own, side in zip(getattr(made, name), getattr(given, name), strict=True):
                assert np.array_equal(own, side) and not np.shares_memory(own, side)
        assert len(found[1].vehicles) == 1
    assert rows_of(()) == ()
    seen: list[View] = []

    def keeps(view: View) -> tuple[Constraints, ...]:
        seen.append(view)
        return ()

    own_filter(constraints=keeps).rows(VIEW)
    assert refuses_writing(seen[0].state.x)


@pytest.mark.parametrize(
    ("found", "clause"),
    [
        (None, "constraints() is not a tuple of filters.constraints.Constraints"),
        ((3,), "constraints() is not a tuple of filters.constraints.Constraints"),
        (block(), "constraints() is not a tuple of filters.constraints.Constraints"),
        ((block(lie=(np.ones((2, 3)),)),), "constraints() has a block without one lie per vehicle"),
        ((block(lie=None),), "constraints() has a block without one lie per vehicle"),
        ((block(h=3.0),), "constraints() has a block without one lie per vehicle"),
        ((block(vehicles=(), lie=()),), "constraints() has rows over vehicles that are not 0 to 2"),
        (
            (block(vehicles=(np.array([0, -1]), np.array([2, 0]))),),
            "constraints() has rows over vehicles that are not 0 to 2",
        ),
        (
            (block(vehicles=(np.array([0, 1]), np.array([2, 3]))),),
            "constraints() has rows over vehicles that are not 0 to 2",
        ),
        (
            (block(vehicles=(np.array([0, 1]), np.array([2.0, 0.0]))),),
            "vehicles of constraints() is a ndarray of dtype float64, not an array of whole numbers",
        ),
        (
            (block(vehicles=(np.array([0]), np.array([2, 0]))),),
            "vehicles of constraints() has shape (1,), not (2,)",
        ),
        (
            (block(lie=(np.ones((2, 3)), np.ones((2, 2)))),),
            "lie of constraints() has shape (2, 2), not (2, 3)",
        ),
        (
            (block(lie=(np.ones((2, 3)), np.full((2, 3), np.nan))),),
            "lie of constraints() is not finite: nan, vehicle 1",
        ),
        ((block(h=np.array([0.0, np.inf])),), "h of constraints() is not finite: inf, vehicle 2"),
        ((block(rhs=np.zeros(3)),), "rhs of constraints() has shape (3,), not (2,)"),
        ((block(rhs=np.array([0.0, np.nan])),), "rhs of constraints() is not finite: nan, vehicle 2"),
    ],
)
def test_declared_rows_that_break_a_clause_are_named(found: Any, clause: str) -> None:
    assert said(rows_of, found) == clause


def test_constraints_that_raise_are_named() -> None:
    assert said(own_filter(constraints=raising).rows, VIEW).startswith(
        "constraints() raised RuntimeError: the"
    )
