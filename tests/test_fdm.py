"""One JSBSim aircraft: where it is, how it starts, and the failures JSBSim would pass in silence."""

import math
import shutil

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aircraft.airframe import load
from aircraft.airframes.schema import RECORDED_ANGLES
from aircraft.jsbsim.errors import FdmError
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin, ecef, geodetic, motions, positions
from aircraft.jsbsim.properties import TELEMETRY
from aircraft.jsbsim.rest import Start, rotation

CALM = (0.0, 0.0, 0.0)


def started(start, dt=0.005, origin=None, airframe=None):
    fdm = Fdm(airframe or load("x8"), dt, origin or Origin())
    fdm.start(start)
    return fdm


def at(fdm):
    return positions([fdm.position()], fdm.origin)[0]


@pytest.mark.parametrize("latitude", [-80.0, -33.0, 0.0, 52.0])
def test_geodetic_is_the_inverse_of_ecef(latitude):
    for altitude in (0.0, 300.0, 9000.0):
        found = geodetic(ecef(math.radians(latitude), 0.7, altitude))
        assert found == pytest.approx((math.radians(latitude), 0.7, altitude), abs=2e-9)


@pytest.mark.parametrize("place", [(0.0, 0.0, 0.0), (3000.0, -4000.0, 120.0), (-6000.0, 2000.0, -80.0)])
@pytest.mark.parametrize("latitude", [-33.0, 0.0, 65.0])
def test_an_aircraft_starts_where_it_was_put(place, latitude):
    fdm = started(Start(*place, theta=1.0, v=20.0), origin=Origin(latitude_deg=latitude))
    np.testing.assert_allclose(at(fdm), place, atol=1e-4)


@pytest.mark.parametrize("wind", [CALM, (5.0, 0.0, 0.0), (-3.0, 4.0, 0.0), (2.0, 2.0, 0.5)])
@pytest.mark.parametrize("v", [18.0, 20.0, 25.0])  # with 5 m/s behind, 18 is near the lowest airspeed
def test_the_start_is_settled(v, wind):
    fdm = started(Start(0.0, 0.0, 0.0, 0.3, v, wind=wind))
    for _ in range(400):
        fdm.run(wind, 5)
        _, rates = motions([fdm.motion()], fdm.origin)
        np.testing.assert_allclose(rates[0], [v, 0.0, 0.0], atol=1e-3)


def test_flying_north_means_theta_is_half_pi():
    fdm = started(Start(0.0, 0.0, 0.0, math.pi / 2, 20.0))
    x, y, z = positions(fdm.run(CALM, 200), fdm.origin)[-1]
    assert (x, y, z) == pytest.approx((0.0, 20.0, 0.0), abs=1e-3)
    assert fdm.telemetry()["heading_rad"] == pytest.approx(math.pi / 2, abs=1e-4)


def test_positive_omega_turns_left_and_positive_zeta_climbs():
    fdm = started(Start(0.0, 0.0, 0.0, 0.0, 20.0))
    fdm.command(20.0, 0.2, 2.0)
    x, y, z = positions(fdm.run(CALM, 600), fdm.origin)[-1]
    assert x > 40 and y > 5 and z > 4
    assert fdm.telemetry()["roll_rad"] < -0.3  # left wing down


def test_position_is_the_integral_of_ground_speed_and_course_kilometres_from_the_origin():
    # Simpson's rule over two periods: its own error is below 1e-7 m/s here
    dt = 0.005
    fdm = started(Start(5000.0, -3000.0, 0.0, 2.0, 20.0, wind=(3.0, -2.0, 0.0)), dt)
    fdm.command(20.0, 0.15, 1.5)
    wind = (3.0, -2.0, 0.0)
    fdm.run(wind, 400)
    for _ in range(50):
        track, moves = list(fdm.position()), [fdm.motion()]
        for _ in range(2):
            track += fdm.run(wind, 1)
            moves.append(fdm.motion())
        course, rates = motions(moves, fdm.origin)
        moved = np.diff(positions(track, fdm.origin)[[0, -1]], axis=0)[0] / (2 * dt)
        v = rates[:, 0] * np.stack([np.cos(course), np.sin(course)])
        np.testing.assert_allclose(moved[:2], v @ [1 / 6, 4 / 6, 1 / 6], atol=2e-5)
        assert moved[2] == pytest.approx(rates[:, 2] @ [1 / 6, 4 / 6, 1 / 6], abs=2e-5)


def test_the_same_flight_twice_is_the_same_bits():
    def flight():
        fdm = started(Start(10.0, 20.0, 5.0, 1.0, 18.0))
        fdm.command(21.0, -0.2, 1.0)
        return fdm.run((1.0, 0.0, 0.0), 1000)

    assert flight() == flight()


def test_a_nan_command_is_refused_before_it_is_written():
    fdm = started(Start(0.0, 0.0, 0.0, 0.0, 20.0))
    with pytest.raises(ValueError, match="omega nan"):
        fdm.command(20.0, math.nan, 0.0)
    assert fdm.read("ap/omega-cmd-radps") == 0.0


def test_nan_wind_is_refused():
    fdm = started(Start(0.0, 0.0, 0.0, 0.0, 20.0))
    with pytest.raises(ValueError, match="wind"):
        fdm.run((math.nan, 0.0, 0.0), 1)


def test_an_unknown_property_is_an_error_and_is_not_created():
    fdm = Fdm(load("x8"), 0.005, Origin())
    for _ in range(2):
        with pytest.raises(FdmError, match="ap/no-such-gain"):
            fdm.node("ap/no-such-gain")


def test_a_gain_the_model_does_not_have_is_named(tmp_path):
    shutil.copytree(load("x8").folder, tmp_path / "x8")
    toml = tmp_path / "x8" / "airframe.toml"
    toml.write_text(toml.read_text().replace("side_share", "slide_share"))
    with pytest.raises(FdmError, match="ap/turn-slide-share"):
        Fdm(load(tmp_path / "x8"), 0.005, Origin())


@pytest.mark.parametrize("missing", ["x8.xml", "engine/motor.xml", "systems/autopilot.xml"])
def test_a_missing_model_file_is_an_error(tmp_path, missing):
    shutil.copytree(load("x8").folder, tmp_path / "x8")
    (tmp_path / "x8" / missing).unlink()
    with pytest.raises(FdmError, match=r"x8\.xml"):
        Fdm(load(tmp_path / "x8"), 0.005, Origin())


def test_a_malformed_model_names_its_file(tmp_path):
    shutil.copytree(load("x8").folder, tmp_path / "x8")
    model = tmp_path / "x8" / "x8.xml"
    model.write_text(model.read_text().replace("</aerodynamics>", ""))
    with pytest.raises(ValueError, match=r"x8\.xml:\d+: not well-formed"):
        Fdm(load(tmp_path / "x8"), 0.005, Origin())


@pytest.mark.parametrize("v", [5.0, 40.0])
def test_a_start_outside_the_envelope_is_refused(v):
    with pytest.raises(FdmError, match="cannot fly steadily"):
        started(Start(0.0, 0.0, 0.0, 0.0, v))


def test_nothing_is_printed(capfd):
    started(Start(0.0, 0.0, 0.0, 0.0, 20.0)).run(CALM, 10)
    out, err = capfd.readouterr()
    assert out == "" and err == ""


def test_the_rotation_is_scipys() -> None:
    for angles in np.random.default_rng(3).uniform(-3.0, 3.0, (50, 3)):
        np.testing.assert_allclose(
            rotation(*angles), Rotation.from_euler("ZYX", angles[::-1]).as_matrix(), atol=1e-14
        )


def test_no_surface_may_take_the_name_of_an_angle_that_is_recorded() -> None:
    assert {name for name in TELEMETRY if name.endswith("_rad")} < RECORDED_ANGLES
