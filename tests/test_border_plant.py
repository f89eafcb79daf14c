"""A user's plant behind the border: what it is given, and each clause of what it returns."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from filters.model import Command, State, step
from testbed.components.border.plant import OwnPlant, parameters
from tests.behind_the_border import (
    CALM,
    DT,
    FLOWN,
    RNG,
    SPEED,
    START,
    contract,
    raising,
    refuses_writing,
    said,
)

# Parameters


def test_parameters_are_those_that_can_be_named() -> None:
    assert parameters(lambda a, b=1, *c, d: None) == (["a", "b", "d"], False)
    assert parameters(lambda a, *b, **c: None) == (["a"], True)
    assert parameters(lambda: None) == ([], False)
    assert parameters(print)[0] == ["sep", "end", "file", "flush"]
    assert parameters(3) == ([], False)  # type: ignore[arg-type]
    assert parameters(type("Odd", (), {"__signature__": 3, "__call__": lambda s: None})()) == ([], False)


# The plant


class Unicycles:
    """A plant that keeps what it was given; a test changes one of its methods."""

    dt: Any = DT

    def __init__(self) -> None:
        self.given: list[Any] = []
        self.now, self.rates = START, FLOWN
        self.said: dict[str, Any] = {"flap": np.array([0.1, np.nan, 0.3])}
        self.ended: Any = ["", "", ""]

    def reset(self, state: State, rng: Any) -> None:
        self.given.append((state, rng))
        self.now = State.of(state.array())

    def step(self, command: Command, wind: np.ndarray, n: int) -> Any:
        self.given.append((command, wind, n))
        start = self.now
        self.now, self.rates = step(start, command, n * self.dt), Command.of(command.array())
        return np.stack([step(start, command, k * self.dt).position for k in range(1, n + 1)])

    def state(self) -> Any:
        return self.now

    def achieved(self) -> Any:
        return self.rates

    def telemetry(self) -> Any:
        return self.said

    def faults(self) -> Any:
        return self.ended


def plant(made: Any = None) -> tuple[OwnPlant, Any]:
    own = Unicycles() if made is None else made
    return OwnPlant(contract(), own, DT), own


def started(made: Any = None) -> tuple[OwnPlant, Any]:
    own, inner = plant(made)
    own.reset(START, RNG, CALM, SPEED)
    return own, inner


def test_a_plant_is_given_copies_and_its_state_is_asked_for_once_a_step() -> None:
    own, inner = started()
    state, rng = inner.given[0]
    assert state is not START and np.array_equal(state.array(), START.array()) and rng is RNG
    assert refuses_writing(state.x)
    assert np.array_equal(own.state().array(), START.array()) and own.dt == DT
    wind = np.ones((3, 3))
    track = own.step(FLOWN, wind, 4)
    command, blown, n = inner.given[1]
    assert np.array_equal(command.array(), FLOWN.array()) and refuses_writing(command.v)
    assert np.array_equal(blown, wind) and blown is not wind and refuses_writing(blown) and n == 4
    np.testing.assert_allclose(track[-1], step(START, FLOWN, 4 * DT).position, atol=1e-12)
    assert track.shape == (4, 3, 3) and refuses_writing(track) and wind.flags.writeable
    before = own.state(), own.achieved()
    inner.now, inner.rates = START, Command.of(FLOWN.array() + 1.0)
    assert own.state() is before[0] and own.achieved() is before[1]
    assert np.array_equal(own.achieved().array(), FLOWN.array()) and refuses_writing(own.state().z)


@pytest.mark.parametrize(
    ("takes", "reset"),
    [
        ([], lambda self, state, rng: None),
        (["wind"], lambda self, state, rng, wind: self.given.append({"wind": wind})),
        (["speed"], lambda self, state, rng, *, speed: self.given.append({"speed": speed})),
        (["speed", "wind"], lambda self, s, r, **named: self.given.append(named)),
        (
            ["speed", "wind"],
            lambda self, s, r, speed, wind: self.given.append({"wind": wind, "speed": speed}),
        ),
    ],
)
def test_reset_is_given_wind_and_speed_by_name_as_far_as_it_takes_them(takes: list[str], reset: Any) -> None:
    inner = type("Own", (Unicycles,), {"reset": reset})()
    own, _ = plant(inner)
    wind = np.full((3, 3), 2.0)
    own.reset(START, RNG, wind, SPEED)
    named = inner.given[0] if inner.given else {}
    assert sorted(named) == takes
    for name, value in named.items():
        assert np.array_equal(value, {"wind": wind, "speed": SPEED}[name]) and refuses_writing(value)
    assert wind.flags.writeable and SPEED.flags.writeable


def moved(x: float = 0.0, theta: float = 0.0) -> Any:
    """A plant that begins so far from where it was asked to."""
    shift = np.array([[0.0] * 4, [0.0, 0.0, theta, x], [0.0] * 4])
    return type("Own", (Unicycles,), {"state": lambda self: State.of(self.now.array() + shift)})()


def test_a_plant_begins_where_it_was_asked_to() -> None:
    turn = 2.0 * np.pi
    for fine in (moved(9e-4), moved(-9e-4), moved(0.0, 9e-4), moved(0.0, -9e-4), moved(0.0, turn),
                 moved(0.0, -3 * turn)):  # fmt: skip
        started(fine)
    assert said(started, moved(-0.002)) == "state() after reset() is 0.002 m and 0 rad away from the start"
    clause = "state() after reset() is 0 m and 0.002 rad away from the start"
    assert said(started, moved(0.0, -0.002)) == said(started, moved(0.0, 0.002 + turn)) == clause
    assert said(started, moved(2.0, 3.0)) == "state() after reset() is 2 m and 3 rad away from the start"


def test_the_state_is_the_end_of_the_track() -> None:
    for off, fine in ((9e-7, True), (-9e-7, True), (1.2e-6, False), (-0.25, False)):
        own, inner = started()
        for axis in range(3):
            away = np.zeros(3)
            away[axis] = off

            def bent(command: Command, wind: Any, n: int, away: Any = away, inner: Any = inner) -> Any:
                track = Unicycles.step(inner, command, wind, n)
                track[-1, 1] += away
                return track

            inner.step = bent
            own = OwnPlant(contract(), inner, DT)
            if fine:
                own.step(FLOWN, CALM, 2)
            else:
                clause = f"state() is {abs(off):.3g} m away from the end of the track of step()"
                assert said(own.step, FLOWN, CALM, 2) == clause


def test_many_small_differences_are_no_difference() -> None:
    """Each of the nine coordinates is off by less than the tolerance; together they are by more."""
    _, inner = started()
    inner.step = lambda command, wind, n: Unicycles.step(inner, command, wind, n) + 9e-7
    OwnPlant(contract(), inner, DT).step(FLOWN, CALM, 2)


@pytest.mark.parametrize(
    ("name", "value", "clause"),
    [
        ("reset", raising, "reset() raised RuntimeError: the engine fell off"),
        ("step", raising, "step() raised RuntimeError: the engine fell off"),
        ("state", raising, "state() raised RuntimeError: the engine fell off"),
        ("achieved", raising, "achieved() raised RuntimeError: the engine fell off"),
        ("state", lambda self: None, "state() is None, not a State"),
        ("achieved", lambda self: START, "achieved() is a State, not a Command"),
        ("step", lambda self, c, w, n: np.zeros((n, 2, 3)), "the track of step() has shape (2, 2, 3), not"),
    ],
)
def test_a_method_that_breaks_a_clause_is_named(name: str, value: Any, clause: str) -> None:
    inner = type("Own", (Unicycles,), {name: value})()

    def flies() -> None:
        own, _ = started(inner)
        own.step(FLOWN, CALM, 2)

    assert said(flies).startswith(clause)


@pytest.mark.parametrize("name", ["reset", "step", "state", "achieved", "telemetry", "faults"])
def test_a_plant_has_every_method(name: str) -> None:
    assert said(plant, type("Own", (Unicycles,), {name: None})()) == f"it has no method {name}()"


def test_the_plants_period_is_the_scenarios() -> None:
    due = "the scenario's rates.fdm_dt_s is 0.02 s"
    for dt, clause in (
        (0.01, f"its dt is 0.01 s, {due}"),
        (DT * (1 + 2e-9), f"its dt is 0.02 s, {due}"),
        (np.float32(0.03), f"its dt is 0.0299999993 s, {due}"),
        (2, f"its dt is 2 s, {due}"),
        (np.nan, f"its dt is nan s, {due}"),
        (10**400, f"its dt is a int, {due}"),
        (10**9, f"its dt is a int, {due}"),
        (-(10**9) + 1, f"its dt is -999999999 s, {due}"),
        (True, f"its dt is a bool, {due}"),
        ("0.02", f"its dt is a str, {due}"),
        (None, f"its dt is a NoneType, {due}"),
    ):
        assert said(plant, type("Own", (Unicycles,), {"dt": dt})()) == clause
    for fine in (DT, np.float64(DT), DT * (1 + 5e-10)):
        plant(type("Own", (Unicycles,), {"dt": fine})())
    whole = OwnPlant(contract(), type("Own", (Unicycles,), {"dt": 2})(), 2.0)
    assert whole.dt == 2.0
    none = type("Own", (Unicycles,), {})
    del none.__bases__[0].dt
    try:
        assert said(plant, none()) == f"its dt is a NoneType, {due}"
    finally:
        Unicycles.dt = DT
    broken = type("Own", (Unicycles,), {"dt": property(raising)})
    assert said(plant, broken()).startswith("its attribute dt raised RuntimeError: the engine fell off (")


def test_a_period_that_is_read_only_the_second_time_is_the_plants() -> None:
    reads: list[int] = []

    def dt(self: Any) -> float:
        reads.append(1)
        return DT if len(reads) % 2 == 0 else 1.0

    plant(type("Own", (Unicycles,), {"dt": property(dt)})())


def test_a_period_that_changes_in_flight_is_a_breach() -> None:
    own, inner = plant()
    inner.dt = 0.01
    assert said(own.reset, START, RNG, CALM, SPEED).startswith("its dt is 0.01 s")
    inner.dt = DT
    own.reset(START, RNG, CALM, SPEED)
    inner.dt = 0.5
    assert said(own.step, FLOWN, CALM, 1).startswith("its dt is 0.5 s")


def test_telemetry_is_copied_and_its_channels_stay_the_same() -> None:
    own, inner = started()
    found = own.telemetry()
    assert list(found) == ["flap"] and np.array_equal(found["flap"], inner.said["flap"], equal_nan=True)
    found["flap"][:] = 7.0
    assert inner.said["flap"][0] == 0.1
    assert np.isnan(own.telemetry()["flap"][1])
    for other in ({}, {"slat": np.zeros(3)}, {"flap": np.zeros(3), "slat": np.zeros(3)}):
        inner.said = other
        assert said(own.telemetry) == "telemetry() has other channels than before"


@pytest.mark.parametrize(
    ("telemetry", "clause"),
    [
        (None, "telemetry() is a NoneType, not a dict"),
        ([], "telemetry() is a list, not a dict"),
        ({3: np.zeros(3)}, "telemetry() has a channel 3, which is no Python name"),
        ({"a b": np.zeros(3)}, "telemetry() has a channel 'a b', which is no Python name"),
        ({"höhe": np.zeros(3)}, "telemetry() has a channel 'höhe', which is no Python name"),
        ({"x" * 99 + "!": 0}, f"telemetry() has a channel 'x{'x' * 38}, which is no Python name"),
        ({"x_m": np.zeros(3)}, "telemetry() has a channel x_m, which the testbed itself records"),
        (
            {"wind_up_mps": np.zeros(3)},
            "telemetry() has a channel wind_up_mps, which the testbed itself records",
        ),
        ({"left": np.zeros(3)}, "telemetry() has a channel left, which the testbed itself records"),
        ({"flap": np.zeros(2)}, "telemetry()['flap'] has shape (2,), not (3,)"),
    ],
)
def test_telemetry_that_breaks_a_clause_is_named(telemetry: Any, clause: str) -> None:
    own, inner = started()
    inner.said = telemetry
    assert said(own.telemetry) == clause


def test_telemetry_and_faults_that_raise_are_named() -> None:
    own, _ = started(type("Own", (Unicycles,), {"telemetry": raising, "faults": raising})())
    assert said(own.telemetry).startswith("telemetry() raised RuntimeError: the engine fell off (")
    assert said(own.faults).startswith("faults() raised RuntimeError: the engine fell off (")


def test_telemetry_may_use_the_names_of_an_aircrafts_channels() -> None:
    own, inner = started()
    inner.said = {"roll_rad": np.zeros(3), "throttle": np.ones(3)}
    assert list(own.telemetry()) == ["roll_rad", "throttle"]


def test_faults_are_one_printable_line_a_vehicle() -> None:
    own, inner = started()
    fine = own.faults()
    assert fine == ["", "", ""]
    fine[0] = "changed"
    assert own.faults() == ["", "", ""]
    inner.ended = ("stalled", "", "out\nof   fuel\x07")
    assert own.faults() == ["stalled", "", "out of fuel?"]
    inner.ended = ["x" * 500, "  \n", ""]
    assert own.faults() == ["x" * 120, "fault without a name", ""]
    for wrong in (None, "abc", ["", ""], {"a": 1, "b": 2, "c": 3}):
        inner.ended = wrong
        assert said(own.faults) == "faults() is not a list of 3 strings"
    inner.ended = ["", 0, ""]
    assert said(own.faults) == "faults() has a int in it, not strings alone"


def test_a_plant_is_closed_if_it_can_be_and_an_error_changes_nothing() -> None:
    own, inner = plant()
    own.close()
    closed: list[int] = []
    inner.close = lambda: closed.append(1)
    own.close()
    assert closed == [1]

    def leaves() -> None:
        raise SystemExit

    for error in (raising, leaves):
        inner.close = error
        own.close()
