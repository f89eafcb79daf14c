"""Steady flight is found wherever the airframe has it; where it has none, the missing force is named."""

import math
import re
from functools import cache

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.datasheets.envelope import climbs
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import G_MPS2, Origin
from aircraft.jsbsim.rest import Start
from aircraft.jsbsim.trim import trim, trim_map

everyone = pytest.mark.parametrize("name", ["x8", "rascal"])

# 500 points, from the stall to beyond the fastest level flight, from steep dives to beyond the best climb.
SPEEDS = np.linspace(10.0, 32.0, 10).tolist()
CLIMBS = np.linspace(-12.0, 10.0, 10).tolist()
TURNS = np.radians([0.0, 8.0, 16.0, 25.0, 40.0]).tolist()


@pytest.mark.slow
@everyone
def test_trim_and_envelope_agree_at_500_points(name):
    """The envelope seeks the climb of a throttle, the trim the throttle of a climb.

    Without continuation the trim misses 19 (X8) and 23 (Rascal) of these flights.
    """
    airframe = load(name)
    found = trim_map(airframe, SPEEDS, CLIMBS, TURNS)
    differ = []
    for v in SPEEDS:
        for omega in TURNS:
            lowest, highest = climbs(airframe, v, omega)
            differ += [
                (v, zeta, omega, lowest, highest)
                for zeta in CLIMBS
                if (found[v, zeta, omega] is not None) != (lowest <= zeta <= highest)
            ]
    assert len(found) == 500
    assert 200 < sum(t is not None for t in found.values()) < 300  # both answers are asked for
    assert not differ


@pytest.mark.parametrize(("v", "zeta"), [(20.0, -3.9), (16.0, -2.19), (15.0, 7.0), (13.0, 8.0)])
def test_steady_flights_that_the_direct_solution_misses_are_found(v, zeta):
    t = trim(load("x8"), v, zeta)
    below, above = (trim(load("x8"), v, zeta + d) for d in (-0.01, 0.01))
    assert t.airspeed == pytest.approx(math.hypot(v, zeta))
    assert below.throttle < t.throttle < above.throttle  # one branch of flights, in order of climb
    assert abs(t.roll) < 1e-3 and abs(t.beta) < 1e-6 and 0 < t.alpha < 0.15


@everyone
def test_a_trim_found_by_continuation_is_at_rest_in_the_flight_model(name):
    airframe = load(name)
    fdm = Fdm(airframe, 0.005, Origin())
    fdm.trim(Start(0.0, 0.0, 0.0, 0.0, 13.0, 8.0))
    for axis in ("u", "v", "w"):
        assert abs(fdm.read(f"accelerations/{axis}dot-ft_sec2")) < 1e-6
    for axis in ("p", "q", "r"):
        assert abs(fdm.read(f"accelerations/{axis}dot-rad_sec2")) < 1e-6


@everyone
def test_what_is_missing_is_what_the_climb_rate_lacks(name):
    """A thrust or drag a [m/s^2] short is a climb rate a v / g beyond the envelope, at angles this small."""
    v = 16.0
    lowest, highest = climbs(load(name), v)
    for zeta, what in ((highest + 0.5, "thrust"), (lowest - 0.5, "drag")):
        with pytest.raises(FdmError, match=rf"cannot fly steadily.*: {what} is short by") as error:
            trim(load(name), v, zeta)
        short = float(re.search(r"short by ([\d.]+) m/s\^2", str(error.value)).group(1))
        assert short == pytest.approx(G_MPS2 * 0.5 / v, rel=0.25)
        assert "throttle 1.00 (its limit)" in str(error.value) or "throttle 0.00 (its limit)" in str(
            error.value
        )


def test_below_the_stall_it_is_lift_that_is_short():
    with pytest.raises(FdmError, match="lift is short by"):
        trim(load("x8"), 7.0)


@cache
def _fast():
    return climbs(load("x8"), 30.0)


def test_a_dive_whose_drag_outgrows_gravity_has_no_lowest_climb_rate():
    """At 30 m/s over the ground an idle X8 cannot keep its speed: steeper is faster through the air, too."""
    lowest, highest = _fast()
    assert lowest < -30 and 1 < highest < 3
    assert trim(load("x8"), 30.0, -20.0).throttle > 0.01
