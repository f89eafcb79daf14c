"""The contract: what a part may return, clause by clause, and the words of a breach."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from filters.model import Command, Limits, State, View
from testbed.components.border.contract import (
    LARGEST,
    Breach,
    Contract,
    copy_of,
    copy_of_limits,
    copy_of_view,
    describe,
    locked,
)
from testbed.errors import StoppedError

C = Contract("plant", "my.Own", 2)
BIG = 2.0 * LARGEST


def test_a_breach_names_the_part_and_its_maker() -> None:
    contract = Contract("filter", "its.Maker", 3)
    assert contract.vehicles == 3
    breach = contract.breach("too late")
    assert (breach.part, breach.whose, breach.clause) == ("filter", "its.Maker", "too late")
    assert str(breach) == "filter its.Maker: too late"


def said(function: Callable[..., Any], *arguments: Any) -> str:
    """The clause of the breach that the call raises."""
    with pytest.raises(Breach) as raised:
        function(*arguments)
    breach = raised.value
    assert (breach.part, breach.whose) == (C.part, C.whose)
    assert str(breach) == f"plant my.Own: {breach.clause}"
    return breach.clause


# Copies


def frozen(array: np.ndarray) -> bool:
    return not array.flags.writeable


def test_a_copy_is_read_only_of_its_type_and_apart_from_what_was_copied() -> None:
    state = State.of(np.arange(8.0).reshape(2, 4))
    rates = Command.of(np.arange(6.0).reshape(2, 3))
    for value in (state, rates):
        copy = copy_of(value)
        assert type(copy) is type(value) and np.array_equal(copy.array(), value.array())
        for name, own in copy.__dict__.items():
            assert frozen(own) and not np.shares_memory(own, getattr(value, name))
    known = np.array([True, False])
    seen = copy_of_view(View(state, rates, known))
    assert type(seen) is View and np.array_equal(seen.known, known) and frozen(seen.known)
    assert not np.shares_memory(seen.known, known)
    assert np.array_equal(seen.state.array(), state.array()) and frozen(seen.state.x)
    assert np.array_equal(seen.rates.array(), rates.array()) and frozen(seen.rates.v)
    assert copy_of_view(View(state, rates)).known is None
    values = np.zeros(2)
    assert locked(values) is values and frozen(values)


def test_a_copy_of_limits_is_read_only_and_the_same_limits() -> None:
    limits = Limits(*(np.full(2, v) for v in (15.0, 25.0, 0.2, 1.0)))
    copy = copy_of_limits(limits)
    assert np.array_equal(copy.array(), limits.array())
    assert frozen(copy.v_min) and not np.shares_memory(copy.v_min, limits.v_min)


# Exceptions in words


def test_an_exception_is_described_in_one_line_with_its_place() -> None:
    def fails() -> None:
        raise ValueError("no\n  fuel\t\x07")

    def calls() -> None:
        fails()

    with pytest.raises(ValueError) as raised:
        calls()
    line = fails.__code__.co_firstlineno + 1
    assert describe(raised.value) == f"ValueError: no fuel \\x07 ({Path(__file__).name}:{line})"
    with pytest.raises(ValueError) as raised:
        json.loads("{")
    assert re.search(r"\(decoder\.py:\d+\)$", describe(raised.value))
    assert describe(ValueError("x")) == "ValueError: x"
    assert describe(KeyError()) == "KeyError: no message"
    assert describe(ValueError("ü" + 400 * "é")) == "ValueError: ü" + 299 * "é"


def test_an_exception_that_cannot_say_what_it_is_has_no_message() -> None:
    class MuteError(Exception):
        def __str__(self) -> str:
            raise RuntimeError

    assert describe(MuteError()) == "MuteError: no message"


# Calls


def test_a_call_gives_what_the_part_returns_and_names_what_it_raises() -> None:
    assert C.call("f()", lambda a, b: (a, b), 1, b=2) == (1, 2)

    def fails(error: BaseException) -> None:
        raise error

    clause = said(C.call, "f()", fails, ValueError("no"))
    assert clause.startswith("f() raised ValueError: no (test_contract.py:")
    assert said(C.call, "f()", fails, SystemExit(3)).startswith("f() raised SystemExit: 3 (")
    with pytest.raises(Breach) as raised:
        C.call("f()", fails, ValueError("no"))
    assert isinstance(raised.value.__cause__, ValueError)
    for passes in (KeyboardInterrupt(), StoppedError(15)):
        with pytest.raises(type(passes)):
            C.call("f()", fails, passes)


def test_a_method_is_found_or_named() -> None:
    class Thing:
        attribute = 3
        fine = staticmethod(lambda: 7)

        @property
        def broken(self) -> None:
            raise ValueError("no")

    assert C.method(Thing(), "fine")() == 7
    assert said(C.method, Thing(), "none") == "it has no method none()"
    assert said(C.method, Thing(), "attribute", "its barrier") == "its barrier has no method attribute()"
    assert said(C.method, Thing(), "broken").startswith("its attribute broken raised ValueError: no (")
    clause = said(C.method, Thing(), "broken", "its barrier")
    assert clause.startswith("its barrier's attribute broken raised ValueError: no (")


# Arrays


def test_numbers_come_back_as_a_read_only_copy_of_floats() -> None:
    for value in (
        np.array([1.0, 2.0]),
        np.array([1.0, 2.0], dtype=np.float32),
        np.array([1, 2], dtype=np.uint8),
        [1, 2],
    ):
        found = C.array("r", value, (2,))
        assert found.dtype == float and np.array_equal(found, [1.0, 2.0]) and frozen(found)
        assert not np.shares_memory(found, np.asarray(value))

    class Mine(np.ndarray):
        pass

    found = C.array("r", np.zeros(2).view(Mine), (2,))
    assert type(found) is np.ndarray and not found.any()


@pytest.mark.parametrize(
    ("value", "clause"),
    [
        (None, "r is None, not an array of real numbers"),
        ("x", "r is a str, not an array of real numbers"),
        (3 + 1j, "r is a complex, not an array of real numbers"),
        (object(), "r is an object, not an array of real numbers"),
        (np.array([1j, 0]), "r is a ndarray of dtype complex128, not an array of real numbers"),
        (np.array([True, False]), "r is a ndarray of dtype bool, not an array of real numbers"),
        (3.0, "r has shape (), not (2,)"),
        ([1.0], "r has shape (1,), not (2,)"),
        (np.zeros((1, 2)), "r has shape (1, 2), not (2,)"),
        ([[1.0], [1.0, 2.0]], "r is a list, not an array of shape (2,)"),
        ([np.nan, 0.0], "r is not finite: nan, vehicle 1"),
        ([0.0, np.inf], "r is not finite: inf, vehicle 2"),
        ([0.0, -np.inf], "r is not finite: -inf, vehicle 2"),
        ([0.0, -BIG], "r is -2e+09, beyond 1e+09, vehicle 2"),
        ([BIG, np.nan], "r is 2e+09, beyond 1e+09, vehicle 1"),
    ],
)  # fmt: skip
def test_what_is_no_array_of_numbers_is_named(value: Any, clause: str) -> None:
    assert said(C.array, "r", value, (2,)) == clause


def test_numbers_up_to_the_largest_are_taken_without_a_warning() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert np.array_equal(C.array("r", [LARGEST, -LARGEST], (2,)), [LARGEST, -LARGEST])
        assert np.array_equal(C.array("r", [4e4, 0.0], (2,)), [4e4, 0.0])
        assert "is 1e+09, beyond 1e+09" in said(C.array, "r", [0.0, 1e9 + 0.5], (2,))
        assert "1e+300, beyond" in said(C.array, "r", [0.0, 1e300], (2,))


def test_the_vehicle_of_a_number_is_that_of_the_axis_before_the_last() -> None:
    track = np.zeros((4, 2, 3))
    track[2, 1, 0] = np.nan
    assert said(C.array, "the track", track, (4, 2, 3)) == "the track is not finite: nan, vehicle 2"
    wind = np.zeros((2, 3))
    wind[0, 2] = np.inf
    assert said(C.array, "wind()", wind, (2, 3)) == "wind() is not finite: inf, vehicle 1"


def test_an_array_that_cannot_be_made_is_a_breach() -> None:
    class Leaves:
        def __init__(self, error: BaseException) -> None:
            self.error = error

        def __array__(self, *_: Any, **__: Any) -> Any:
            raise self.error

    for error in (RuntimeError("no"), SystemExit()):
        with pytest.raises(Breach) as raised:
            C.array("r", Leaves(error), (2,))
        assert raised.value.clause == "r is a Leaves, not an array of shape (2,)"
        assert raised.value.__suppress_context__


def test_a_channel_may_be_missing_of_a_vehicle_and_no_more() -> None:
    found = C.channel("flap", np.array([np.nan, 3]))
    assert np.isnan(found[0]) and found[1] == 3.0 and found.dtype == float
    given = np.array([1.0, 2.0])
    assert not np.shares_memory(C.channel("flap", given), given)
    assert said(C.channel, "flap", [0.0, np.inf]) == "flap is not finite: inf, vehicle 2"
    assert said(C.channel, "flap", [0.0]) == "flap has shape (1,), not (2,)"
    assert said(C.channel, "flap", [np.nan, BIG]) == "flap is 2e+09, beyond 1e+09, vehicle 2"


def test_whole_numbers_and_truth_values_are_copied_and_nothing_else_is_taken() -> None:
    whole, truth = np.array([1, 2]), np.array([True, False])
    for check, value in ((C.integers, whole), (C.booleans, truth)):
        for given in (value, list(value)):
            found = check("s", given, (2,))
            assert np.array_equal(found, value) and found.dtype == value.dtype
            assert not np.shares_memory(found, value)
    small = C.integers("s", np.array([1, 2], dtype=np.uint8), (2,))
    assert small.dtype == int and list(small) == [1, 2]
    assert said(C.integers, "s", [1.0, 2.0], (2,)) == "s is a list, not an array of whole numbers"
    clause = "s is a ndarray of dtype float64, not an array of whole numbers"
    assert said(C.integers, "s", np.zeros(2), (2,)) == clause
    clause = "s is a ndarray of dtype float64, not an array of truth values"
    assert said(C.booleans, "s", np.zeros(2), (2,)) == clause
    assert said(C.booleans, "s", [0, 1], (2,)) == "s is a list, not an array of truth values"
    for check, value in ((C.integers, whole), (C.booleans, truth)):
        assert said(check, "s", value[:1], (2,)) == "s has shape (1,), not (2,)"


# States and commands


def test_a_state_comes_back_as_a_read_only_copy() -> None:
    for shape in ((2,), (2, 2), (3, 2)):
        values = np.arange(4.0 * np.prod(shape)).reshape(*shape, 4)
        given = State.of(values.copy())
        found = C.state("s", given) if shape == (2,) else C.state("s", given, shape)
        assert type(found) is State and np.array_equal(found.array(), values)
        for name in ("x", "y", "theta", "z"):
            assert frozen(getattr(found, name))
            assert not np.shares_memory(getattr(found, name), getattr(given, name))
        rates = C.command("c", Command.of(values[..., :3].copy()), None if shape == (2,) else shape)
        assert type(rates) is Command and np.array_equal(rates.array(), values[..., :3])


@pytest.mark.parametrize("vehicles", [1, 2, 16, 17, 40])
def test_fields_are_fine_where_every_number_is_finite_and_not_too_large(vehicles: int) -> None:
    values = np.arange(3.0 * vehicles).reshape(vehicles, 3)
    for number, fine in ((0.0, True), (LARGEST, None), (-LARGEST, None), (BIG, False), (-BIG, False),
                         (np.nan, False), (np.inf, False)):  # fmt: skip
        for at in (
            np.ndindex(vehicles, 3) if vehicles < 3 else ((0, 0), (vehicles - 1, 2), (vehicles // 2, 1))
        ):
            given = values.copy()
            given[at] = number
            found, said_fine = C.fields("c", Command.of(given), Command, (vehicles,))
            assert np.array_equal(found.array(), given, equal_nan=True)
            # Of many numbers their squares are summed: a large one is then left to the closer look.
            assert said_fine is (fine if fine is not None else vehicles <= 16)


@pytest.mark.parametrize("count", [1, 16, 17, 40])
def test_every_number_of_an_array_is_looked_at(count: int) -> None:
    for at in {0, count // 2, count - 1}:
        for number in (np.nan, BIG, -BIG):
            values = np.ones(count)
            values[at] = number
            assert said(C.array, "r", values, (count,)).endswith(f", vehicle {at + 1}")
        values[at] = LARGEST
        assert np.array_equal(C.array("r", values, (count,)), values)
        values[at] = -LARGEST
        assert np.array_equal(C.array("r", values, (count,)), values)


def test_a_subclass_is_asked_for_its_attributes() -> None:
    class Late(State):
        """Computes its height when asked."""

        def __getattribute__(self, name: str) -> Any:
            return np.full(2, 7.0) if name == "z" else super().__getattribute__(name)

    found = C.state("s", bare(Late, **State.of(np.zeros((2, 4))).__dict__))
    assert type(found) is State and list(found.z) == [7.0, 7.0] and not found.x.any()

    class Failing(Command):
        @property
        def omega(self) -> Any:  # type: ignore[override]
            raise ValueError("no gyro")

    assert said(C.command, "c", bare(Failing, v=np.zeros(2), zeta=np.zeros(2))).startswith(
        "c raised ValueError: no gyro ("
    )


def test_a_subclass_without_an_attribute_is_named() -> None:
    class Less(Command):
        """Has no climb rate."""

    made = bare(Less, v=np.zeros(2), omega=np.zeros(2))
    assert said(C.command, "c", made) == "c.zeta is None, not an array of real numbers"


def bare(kind: type, **fields: Any) -> Any:
    """A state or command whose fields never saw its own checks."""
    made = object.__new__(kind)
    made.__dict__.update(fields)
    return made


@pytest.mark.parametrize(
    ("check", "value", "clause"),
    [
        (C.state, None, "it is None, not a State"),
        (C.state, Command.of(np.zeros((2, 3))), "it is a Command, not a State"),
        (C.command, State.of(np.zeros((2, 4))), "it is a State, not a Command"),
        (C.state, State.of(np.zeros((3, 4))), "it.x has shape (3,), not (2,)"),
        (C.command, Command.of(np.zeros((1, 2, 3))), "it.v has shape (1, 2), not (2,)"),
        (C.command, bare(Command, v=np.zeros(2)), "it.omega is None, not an array of real numbers"),
        (C.state, State.of([[0, 0, 0, 0], [0, 0, np.nan, 0]]), "it.theta is not finite: nan, vehicle 2"),
        (C.state, State.of([[0, 0, 0, BIG], [0, 0, 0, 0]]), "it.z is 2e+09, beyond 1e+09, vehicle 1"),
        (C.command, Command.of([[0, 0, 0], [0, np.inf, 0]]), "it.omega is not finite: inf, vehicle 2"),
    ],
)  # fmt: skip
def test_what_is_no_state_or_command_is_named(check: Any, value: Any, clause: str) -> None:
    assert said(check, "it", value) == clause


def test_in_a_view_the_vehicle_is_that_of_the_last_axis_but_the_fields() -> None:
    values = np.zeros((2, 3, 4))
    values[0, 2, 1] = np.nan
    assert said(C.state, "it", State.of(values), (2, 3)) == "it.y is not finite: nan, vehicle 3"
    assert said(C.command, "it", Command.of(np.zeros((2, 3, 3)))) == "it.v has shape (2, 3), not (2,)"
    fine = C.state("it", State.of(np.ones((2, 3, 4))), (2, 3))
    assert fine.shape == (2, 3) and frozen(fine.x)


def test_fields_of_other_types_are_turned_into_floats() -> None:
    mixed = bare(Command, v=[1, 2], omega=np.zeros(2, dtype=np.float32), zeta=np.array([3, 4]))
    found = C.command("c", mixed)
    assert np.array_equal(found.array(), [[1.0, 0.0, 3.0], [2.0, 0.0, 4.0]]) and found.v.dtype == float


def test_large_numbers_whose_squares_pass_the_limit_are_fine() -> None:
    far = State.of([[3e5, -4e5, 0.0, 0.0], [0.0, 0.0, 0.0, LARGEST]])
    assert np.array_equal(C.state("s", far).array(), far.array())
    fast = Command.of([[5e4, 0.0, 0.0], [0.0, 0.0, -LARGEST]])
    assert np.array_equal(C.command("c", fast).array(), fast.array())
    C.check_finite("s", far)
    assert said(C.check_finite, "s", State.of([[0, 0, 0, np.inf]])) == "s.z is not finite: inf, vehicle 1"
