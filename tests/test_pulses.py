"""Poles and pulses that tell a stable aircraft from an unstable one, on motions that are known."""

import math
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from aircraft.airframes.sensors import silent
from aircraft.autopilots import stability
from aircraft.autopilots.stability import Instability, flown_oscillation, instabilities, unstable_modes
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.geodesy import Origin

DT = 0.005


def model_of(*modes, loops=("elevator", "aileron")):
    """A linear model with the motions of growth [1/s], frequency [rad/s] and moves, in mixed coordinates.

    moves  of each loop, the amplitude
    """
    a, c = np.zeros((0, 0)), np.zeros((len(loops), 0))
    for growth, frequency, moves in modes:
        turn, size = frequency * DT, math.exp(growth * DT)
        block = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]]) * size
        rows = np.array([[m, 0.0] for m in moves])
        if frequency == 0.0:
            block, rows = block[:1, :1], rows[:, :1]
        n = len(a)
        a = np.block([[a, np.zeros((n, len(block)))], [np.zeros((len(block), n)), block]])
        c = np.hstack([c, rows])
    mix = np.random.default_rng(1).normal(size=a.shape) + 3 * np.eye(len(a))
    back = np.linalg.inv(mix)
    return SimpleNamespace(cycle=lambda: (mix @ a @ back, c @ back, DT), loops=loops)


@settings(max_examples=30, deadline=None)
@given(growth=st.floats(0.01, 3.0), frequency=st.floats(0.5, 60.0), elevator=st.booleans())
def test_a_growing_oscillation_is_found_once_with_its_growth_frequency_and_loop(growth, frequency, elevator):
    moves = (1.0, 0.4) if elevator else (0.4, 1.0)
    model = model_of((-1.0, 5.0, (2.0, 2.0)), (growth, frequency, moves), (-0.01, 0.0, (3.0, 3.0)))
    (found,) = unstable_modes(model, 18.0)
    assert (found.v, found.loop, found.flown) == (18.0, "elevator" if elevator else "aileron", False)
    assert (found.growth, found.frequency) == pytest.approx((growth, frequency), rel=1e-6)


def test_the_fastest_growth_comes_first_and_a_divergence_has_no_frequency():
    found = unstable_modes(model_of((0.2, 3.0, (1.0, 0.0)), (0.7, 0.0, (0.0, 1.0))), 20.0)
    assert [(m.loop, round(m.growth, 9), round(m.frequency, 9)) for m in found] == [
        ("aileron", 0.7, 0.0),
        ("elevator", 0.2, 3.0),
    ]


@pytest.mark.parametrize(("growth", "count"), [(-0.05, 0), (0.0, 0), (0.9e-4, 0), (1.1e-4, 1)])
def test_what_does_not_grow_is_no_instability(growth, count):
    """The heading is neutral: a pole at 1, to rounding. A pole at 0 is a motion that ends at once."""
    model = model_of((growth, 2.0, (1.0, 1.0)))
    assert len(unstable_modes(model, 18.0)) == count
    at_once = SimpleNamespace(cycle=lambda: (np.zeros((1, 1)), np.ones((2, 1)), DT), loops=("a", "b"))
    assert unstable_modes(at_once, 18.0) == []


def test_an_instability_says_where_which_loop_and_how():
    told = {
        Instability(
            18.5, "aileron", 21.34, 0.456
        ): "the aileron loop oscillates at 21.3 rad/s and grows by 0.46 per s",
        Instability(18.5, "throttle", 0.0, 1.5): "the throttle loop diverges and grows by 1.5 per s",
        Instability(
            18.5, "aileron", 2.0, math.nan
        ): "the aileron loop oscillates at 2.0 rad/s and does not decay in flight",
    }
    for found, words in told.items():
        assert str(found) == f"unstable at 18.5 m/s: {words}"
    assert [found.flown for found in told] == [False, False, True]


# -- in flight


class Noisy:
    """An airframe as far as it is asked: its sensors, and a copy with others."""

    sensors: ClassVar = {"preset": "typical"}

    def model_copy(self, update):
        assert list(update) == ["sensors"]
        return tuple(update["sensors"].items())


X, QUIET = Noisy(), tuple(silent({"preset": "typical"}).items())


class Flight:
    """Stands for `Fdm`: what is sent to each loop after each period is a formula of time."""

    def __init__(self, monkeypatch, loops, dt=DT):
        self.loops, self.dt, self.k, self.probed = loops, dt, -1, []
        self.probes = {name: 0.0 for name in loops}
        monkeypatch.setattr(stability, "Fdm", self.made)
        monkeypatch.setattr(
            stability, "loops", lambda airframe: dict.fromkeys(loops) if airframe in (X, QUIET) else {}
        )

    def made(self, airframe, dt, origin):
        assert (airframe, dt, origin) == (QUIET, self.dt, Origin())
        self.k, self.probed = -1, []
        return self

    def start(self, start):
        assert (start.x, start.y, start.z, start.theta, start.zeta, start.wind) == (0, 0, 0, 0, 0, (0, 0, 0))
        self.v = start.v

    def node(self, path):
        kind, name = path.rpartition("-")[2], path.removeprefix("ap/").rpartition("-")[0]
        assert path == f"ap/{name}-{kind}"
        if kind == "probe":
            return SimpleNamespace(set_double_value=lambda value: self.probes.update({name: value}))
        return SimpleNamespace(get_double_value=lambda: self.loops[name](self.k * self.dt))

    def run(self, wind, n):
        assert wind == (0.0, 0.0, 0.0) and n == 1
        self.k += 1
        self.probed.append(tuple(self.probes.values()))


def test_every_loop_gets_a_short_pulse_at_once(monkeypatch):
    flight = Flight(monkeypatch, {"elevator": lambda t: 0.0, "aileron": lambda t: 0.0})
    assert flown_oscillation(X, 18.0) is None
    assert flight.v == 18.0 and flight.k == 4800 - 1
    assert flight.probed == [(0.02, 0.02)] * 10 + [(0.0, 0.0)] * 4790
    coarse = Flight(monkeypatch, {"elevator": lambda t: 0.0}, dt=0.02)
    assert flown_oscillation(X, 18.0, 0.02) is None
    assert coarse.probed == [(0.02,)] * 2 + [(0.0,)] * 1198


def swing(size, frequency, decay=0.0, offset=0.3, slope=0.001):
    return lambda t: offset + slope * t + size * math.exp(-decay * t) * math.sin(frequency * t)


@pytest.mark.parametrize(
    ("decay", "found"),
    # After 15 s the window's swing has fallen to exp(-15 decay): 0.7 at 0.0238 per s.
    [(-0.05, True), (0.0, True), (0.0225, True), (0.025, False), (0.1, False)],
)
def test_what_leaves_less_than_seven_tenths_after_15_s_decays(monkeypatch, decay, found):
    Flight(monkeypatch, {"elevator": swing(0.01, 7.0, decay), "aileron": swing(0.002, 7.0, decay)})
    known = flown_oscillation(X, 18.0)
    assert (known is not None) is found
    if found:
        assert (known.v, known.loop, known.flown) == (18.0, "elevator", True)
        assert known.frequency == pytest.approx(7.0, rel=0.01)


@pytest.mark.parametrize("frequency", [1.5, 7.0, 25.0])
def test_the_frequency_is_that_of_the_loop_that_moves_most(monkeypatch, frequency):
    Flight(monkeypatch, {"elevator": swing(0.01, 3.0), "aileron": swing(0.02, frequency)})
    known = flown_oscillation(X, 20.0)
    assert known.loop == "aileron" and known.frequency == pytest.approx(frequency, abs=0.15)


def test_a_small_oscillation_and_a_steady_change_are_none(monkeypatch):
    """Rms of 2e-4 of full deflection: an amplitude of 2.83e-4. A ramp is a trim that changes, not a swing."""
    for size, found in ((2.7e-4, False), (2.95e-4, True)):
        Flight(monkeypatch, {"elevator": swing(size, 7.0, slope=0.01)})
        assert (flown_oscillation(X, 18.0) is not None) is found


def test_the_first_second_after_the_pulse_does_not_count(monkeypatch):
    """A large kick that ends there does not make what remains look small, nor a late one what went before."""
    steady = swing(0.01, 7.0)
    Flight(monkeypatch, {"elevator": lambda t: steady(t) + (5.0 * math.sin(9 * t) if t < 0.99 else 0.0)})
    assert flown_oscillation(X, 18.0) is not None
    # The early window is from 1 to 9 s, the late one the last 8 s.
    Flight(monkeypatch, {"elevator": lambda t: steady(t) if 1.1 < t < 8.9 or 9.1 < t < 15.9 else 0.0})
    assert flown_oscillation(X, 18.0) is None
    Flight(
        monkeypatch,
        {"elevator": lambda t: steady(t) * (1.0 if t > 16.1 else 100.0 if 9.1 < t < 15.9 else 1.2)},
    )
    assert flown_oscillation(X, 18.0) is not None


def test_a_motion_that_is_not_finite_is_unstable(monkeypatch):
    flight = {
        "elevator": lambda t: math.nan if t > 3 else 0.0,
        "aileron": lambda t: math.inf if t > 2 else 0.0,
    }
    Flight(monkeypatch, flight)
    known = flown_oscillation(X, 18.0)
    assert (known.v, known.loop, known.frequency, known.flown) == (18.0, "aileron", 0.0, True)


# -- both


def test_a_flight_is_asked_only_where_the_poles_are_stable(monkeypatch):
    pole, oscillation = Instability(16.0, "elevator", 3.0, 0.1), Instability(20.0, "aileron", 5.0, math.nan)
    flown = []

    def linear_model(asked, v):
        assert asked is airframe
        if v >= 22.0:
            raise FdmError("no first-order lag")
        return v

    def fly(airframe, v):
        flown.append((airframe, v))
        return {20.0: oscillation, 22.0: oscillation}.get(v)

    monkeypatch.setattr(stability, "linear_model", linear_model)
    monkeypatch.setattr(
        stability, "unstable_modes", lambda model, v: [pole, pole] if model == v == 16.0 else []
    )
    monkeypatch.setattr(stability, "flown_oscillation", fly)
    airframe = SimpleNamespace(speeds=SimpleNamespace(trim_mps=[16.0, 18.0, 20.0, 22.0]))
    assert instabilities(airframe) == [pole, pole, oscillation, oscillation]
    assert flown == [(airframe, 18.0), (airframe, 20.0), (airframe, 22.0)]
    assert instabilities(airframe, [24.0]) == []  # no linear model, and a flight that decays
    assert instabilities(airframe, [18.0]) == [] and instabilities(airframe, []) == []
