"""Placing an aircraft before it flies: where, how fast, with which attitude; evaluated at rest."""

import math

import numpy as np
import pytest

from aircraft.jsbsim.geodesy import M_PER_FT, Origin, enu_axes
from aircraft.jsbsim.rest import Start, hold, initialise, place, rotation, write_ic
from tests.paper_plane import PaperPlane

ORIGIN = Origin(latitude_deg=-33.0, longitude_deg=18.0, altitude_m=400.0, ground_m=90.0)


@pytest.fixture
def plane():
    plane = PaperPlane(rudder=True)
    plane.origin = ORIGIN
    return plane


def test_a_place_is_written_in_jsbsims_units(plane):
    place(plane, Start(3000.0, -4000.0, 25.0, 0.4, 20.0))
    latitude, longitude, altitude = ORIGIN.geodetic(3000.0, -4000.0, 25.0)
    n = {name: node.value for name, node in plane.nodes.items()}
    assert (n["latitude_ic"], n["longitude_ic"]) == (latitude, longitude)
    assert n["altitude_ic"] * M_PER_FT == pytest.approx(altitude, abs=1e-9) == pytest.approx(425.0)
    assert n["ground_ic"] * M_PER_FT == pytest.approx(90.0, abs=1e-12)


def test_the_height_can_be_corrected_by_what_the_last_initialisation_missed(plane):
    start = Start(0.0, 0.0, 25.0, 0.4, 20.0)
    place(plane, start)
    write_ic(plane, (0.0, 0.0, 0.0), (20.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    plane.run_ic()
    assert plane.nodes["altitude"].value * M_PER_FT == pytest.approx(425.0 - 0.005 * M_PER_FT, abs=1e-9)
    place(plane, start)
    plane.run_ic()
    assert plane.nodes["altitude"].value * M_PER_FT == pytest.approx(425.0 - 0.005 * M_PER_FT, abs=1e-9)
    place(plane, start, correct=True)
    plane.run_ic()
    assert plane.nodes["altitude"].value * M_PER_FT == pytest.approx(425.0, abs=1e-9)


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (40_000.0, -70_000.0)])
@pytest.mark.parametrize("zeta", [0.0, 3.0])
def test_speed_and_course_are_those_in_the_origins_plane(plane, x, y, zeta):
    """The velocity here, rotated into the origin's axes, has that course and ground speed there."""
    wind = (3.0, -2.0, 0.5)
    air, ground = place(plane, Start(x, y, 10.0, 0.7, 21.0, zeta, wind))
    north, east, down = ground
    assert down == -zeta
    latitude, longitude, _ = ORIGIN.geodetic(x, y, 10.0)
    there = ORIGIN.axes @ enu_axes(latitude, longitude).T @ [east, north, -down]
    np.testing.assert_allclose(there[:2], [21 * math.cos(0.7), 21 * math.sin(0.7)], atol=1e-12)
    np.testing.assert_allclose(air, [north + 2.0, east - 3.0, down + 0.5], atol=1e-12)


def test_an_attitude_is_rolled_last():
    """Nose north, right wing down by 30 degrees: body y points to the east and down; body z to the west."""
    np.testing.assert_allclose(rotation(0.0, 0.0, 0.0), np.eye(3), atol=1e-15)
    s, c = 0.5, math.cos(math.pi / 6)
    np.testing.assert_allclose(
        rotation(math.pi / 6, 0.0, 0.0), [[1, 0, 0], [0, c, -s], [0, s, c]], atol=1e-15
    )
    np.testing.assert_allclose(
        rotation(0.0, math.pi / 6, 0.0), [[c, 0, s], [0, 1, 0], [-s, 0, c]], atol=1e-15
    )
    np.testing.assert_allclose(
        rotation(0.0, 0.0, math.pi / 6), [[c, -s, 0], [s, c, 0], [0, 0, 1]], atol=1e-15
    )
    for angles in ((0.3, -0.4, 2.0), (-2.5, 1.2, -0.1)):
        roll, pitch, yaw = angles
        whole = rotation(0.0, 0.0, yaw) @ rotation(0.0, pitch, 0.0) @ rotation(roll, 0.0, 0.0)
        np.testing.assert_allclose(rotation(*angles), whole, atol=1e-15)


def test_initial_conditions_are_written_in_their_order(plane):
    write_ic(plane, (0.1, 0.2, 0.3), (1.0, 2.0, 3.0), (0.4, 0.5, 0.6))
    n = plane.nodes
    assert [n[f"{k}_ic"].value for k in ("roll", "pitch", "yaw")] == [0.1, 0.2, 0.3]
    assert [n[f"{k}_ic"].value for k in "uvw"] == [k / 0.3048 for k in (1.0, 2.0, 3.0)]
    assert [n[f"{k}_ic"].value for k in "pqr"] == [0.4, 0.5, 0.6]
    assert plane.evaluations == 0


def test_an_initialisation_turns_velocity_and_yaw_rate_into_body_axes(plane):
    attitude, velocity = (0.1, 0.2, 0.3), np.array([18.0, 5.0, -2.0])
    initialise(plane, attitude, velocity, 0.25)
    n, to_ned = plane.nodes, rotation(*attitude)
    np.testing.assert_allclose(to_ned @ [n[f"{k}_ic"].value * 0.3048 for k in "uvw"], velocity, atol=1e-13)
    np.testing.assert_allclose(to_ned @ [n[f"{k}_ic"].value for k in "pqr"], [0, 0, 0.25], atol=1e-15)
    assert plane.evaluations == 1 and [n[f"{k}_ic"].value for k in ("roll", "pitch", "yaw")] == [*attitude]


@pytest.mark.parametrize(("forgets", "again"), [(None, 3), (False, 3), (True, 0)])
def test_an_aircraft_held_still_has_the_accelerations_of_its_forces(plane, forgets, again):
    """Forces due to accelerations need evaluations more, but not where engines would lose their state."""
    plane.forgets = forgets
    commands = {"fcs/throttle-cmd-norm": 0.7, "fcs/elevator-cmd-norm": 0.1}
    found = hold(plane, (20.0, 0.5, 1.5), (0.1, 0.2, 0.3), (0.01, 0.02, 0.03), commands)
    np.testing.assert_allclose(found, plane.left(), rtol=1e-12)
    assert plane.rests == again and plane.nodes["on"].value == 0.0
    assert (plane.nodes["throttle"].value, plane.nodes["elevator"].value) == (0.7, 0.1)
    assert plane.nodes["u_ic"].value == 20.0 / 0.3048 and plane.nodes["q_ic"].value == 0.02
    assert plane.nodes["yaw_ic"].value == 0.3


def test_an_aircraft_held_still_has_settled_engines():
    plane = PaperPlane(captive=True)
    hold(plane, (20.0, 0.0, 1.5), (0.0, 0.1, 0.0), (0.0, 0.0, 0.0), {})
    assert plane.executive.periods > 0


def test_a_start_flies_level_in_calm_air_unless_told(plane):
    assert Start(1.0, 2.0, 3.0, 0.5, 20.0) == Start(1.0, 2.0, 3.0, 0.5, 20.0, 0.0, (0.0, 0.0, 0.0))
    air, ground = place(plane, Start(0.0, 0.0, 0.0, 0.0, 20.0))
    np.testing.assert_allclose(air, [0.0, 20.0, 0.0], atol=1e-12)
    np.testing.assert_array_equal(air, ground)
