"""The identified channels, and how near a unicycle with them comes to the aircraft."""

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.autopilots.identification import identify
from aircraft.jsbsim.fleet import JsbsimFleet
from aircraft.kinematic import KinematicFleet, Lag
from filters.model import Command, State


def lagged(airframe):
    channels = airframe.identified
    return KinematicFleet(
        1,
        lags=[
            Lag(c.time_constant_s, c.delay_s, c.rate_min, c.rate_max)
            for c in (channels.v, channels.omega, channels.zeta)
        ],
    )


everyone = pytest.mark.parametrize("name", ["x8", "rascal"])


@pytest.mark.slow
@everyone
def test_the_committed_channels_are_what_identification_finds(name):
    airframe = load(name)
    t, delay, falls, rises = identify(airframe, "omega")
    committed = airframe.identified.omega
    found = (committed.time_constant_s, committed.delay_s, -committed.rate_min, committed.rate_max)
    assert found == pytest.approx((t, delay, falls, rises), rel=0.02)


@everyone
def test_a_lagged_unicycle_stays_near_the_aircraft_on_commands_it_was_not_fitted_to(name):
    rng = np.random.default_rng(3)
    airframe = load(name)
    plants = JsbsimFleet([airframe]), lagged(airframe)
    for plant in plants:
        plant.reset(State([0.0], [0.0], [0.0], [0.0]), rng)
    miss = []
    for _ in range(8):  # a new command every second, all channels at once, inside the filter's box
        command = Command([rng.uniform(16, 24)], [rng.uniform(-0.2, 0.2)], [rng.uniform(-1.5, 3.5)])
        tracks = [plant.step(command, np.zeros((1, 3)), 200) for plant in plants]
        miss.append(np.linalg.norm(tracks[0][-1, 0] - tracks[1][-1, 0]))
    # along 160 m: healthy 2.6 m, without lags 6 m. Later they part: climbing aircraft slow down faster
    assert max(miss) < 3.5, miss
