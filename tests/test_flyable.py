"""P4: trims decide whether the vehicles can fly gamma, at both ends of the airspeeds that wind makes."""

import math

import pytest

from aircraft.jsbsim import trim as trims
from aircraft.jsbsim.errors import FdmError, UnsteadyError
from testbed.claims.flyable import unflyable
from testbed.components import catalogue
from testbed.scenario.scenario import load


def asked(*overrides):
    s = load("paper-2-turn", list(overrides))
    return unflyable(s, catalogue.barrier(s), catalogue.airframes(s))


def test_an_x8_flies_the_papers_gamma_in_calm_air_and_not_where_wind_takes_its_airspeed():
    """gamma is flown at 16 m/s or so; less 8 m/s of wind is below the stall."""
    assert asked("plant=jsbsim") == []
    first, second = asked("plant=jsbsim", "wind.speed_mps=8")
    assert (
        first.startswith("vehicle 1 (x8) has no steady turn of 11.7 deg/s at ")
        and "lift is short by" in first
    )
    assert second == first.replace("vehicle 1", "vehicle 2")


def test_every_vehicle_is_asked_for_gamma_at_both_airspeeds(monkeypatch):
    flown = []

    def trim(airframe, v, zeta, omega):
        flown.append((airframe.name, v, zeta, omega))
        if v < 15:
            raise (
                UnsteadyError("long story", "lift is short")
                if airframe.name == "x8"
                else FdmError("no model")
            )
        if airframe.name == "rascal":
            raise ValueError("too fast")

    monkeypatch.setattr(trims, "trim", trim)
    s = load("paper-2-turn", ["plant=jsbsim", 'airframes=["x8", "rascal"]', "wind.speed_mps=3"])
    gamma = catalogue.barrier(s).manoeuvre(2)
    found = unflyable(s, catalogue.barrier(s), catalogue.airframes(s))
    v, turn = float(gamma.v[0]), float(gamma.omega[0])
    rest = (pytest.approx(float(gamma.zeta[0])), pytest.approx(turn))
    assert flown == [(name, pytest.approx(w), *rest) for name in ("x8", "rascal") for w in (v - 3, v + 3)]
    slow, fast = (f"no steady turn of {math.degrees(turn):.1f} deg/s at {w:.1f} m/s" for w in (v - 3, v + 3))
    low = v - 3 < 15
    assert found == [
        *[f"vehicle 1 (x8) has {slow}: lift is short"] * low,
        f"vehicle 2 (rascal) has {slow}: {'no model' if low else 'too fast'}",
        f"vehicle 2 (rascal) has {fast}: too fast",
    ]


def test_kinematic_vehicles_and_a_barrier_without_one_manoeuvre_need_no_trim(monkeypatch):
    monkeypatch.setattr(trims, "trim", None)
    assert asked() == [] and asked("plant=lagged", "lags.source=table") == []
