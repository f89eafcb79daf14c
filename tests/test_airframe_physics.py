"""Each airframe in JSBSim against its published coefficients, summed, moved and linearised here."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.autopilots.linear_model import linear_model
from aircraft.autopilots.margins import modes
from aircraft.jsbsim.fdm import Fdm
from aircraft.jsbsim.geodesy import Origin
from aircraft.jsbsim.rest import Start, place
from aircraft.jsbsim.rest import hold as held

N_PER_LB, M_PER_FT = 4.4482216152605, 0.3048
NM_PER_LBFT = N_PER_LB * M_PER_FT
KGM3_PER_SLUGFT3 = 515.3788183931961
KGM2_PER_SLUGFT2 = 1.3558179483314
LIMIT = math.radians(30)  # full deflection of every surface


@dataclass(frozen=True)
class Air:
    """Angles [rad], body rates and the rate of alpha [rad/s], airspeed [m/s], density [kg/m^3]."""

    alpha: float
    beta: float
    p: float
    q: float
    r: float
    speed: float
    rho: float
    alpha_dot: float = 0.0


def x8(a, de, da, dr):
    """Force [N] along body axes and moment [N m] about the centre of gravity: Gryte et al. 2018."""
    s, b, c = 0.75, 2.1, 0.357143
    up, down = math.exp(-50 * (a.alpha - 0.267)), math.exp(50 * (a.alpha + 0.267))
    sigma = (1 + up + down) / ((1 + up) * (1 + down))
    sin, cos = math.sin(a.alpha), math.cos(a.alpha)
    pitch, yaw = c / (2 * a.speed), b / (2 * a.speed)
    plate = 2 * math.copysign(1, a.alpha) * sin**2
    cl = (1 - sigma) * (0.0867356 + 4.020328 * a.alpha) + sigma * plate * cos
    cl += 3.87 * pitch * a.q + 0.2780736 * de
    cd = 0.0197 + (1 - sigma) * (0.0790915 * a.alpha + 1.05547 * a.alpha**2) + sigma * plate * sin
    cd += -0.005843 * a.beta + 0.1478119 * a.beta**2 + 0.0633474 * de**2
    cy = -0.2238722 * a.beta + yaw * (-0.1373551 * a.p + 0.0838688 * a.r) + 0.0432764 * da
    roll = -0.0848963 * a.beta + yaw * (-0.404198 * a.p + 0.0555206 * a.r) + 0.1201881 * da
    nose = 0.02275 - 0.4629 * a.alpha - 1.301237 * pitch * a.q - 0.2292 * de
    turn = 0.0283 * a.beta + yaw * (0.0043655 * a.p - 0.072 * a.r) - 0.00339 * da
    qs = 0.5 * a.rho * a.speed**2 * s
    force = np.array([cl * sin - cd * cos, cy, -cl * cos - cd * sin]) * qs
    return force, np.array([roll * b, nose * c, turn * b]) * qs


def rascal(a, de, da, dr):
    """The same of the Rascal: the circulating table, lift, side force and drag along the air's own axes."""
    s, b, c = 10.57 * M_PER_FT**2, 9.17 * M_PER_FT, 1.15 * M_PER_FT
    pitch, yaw = c / (2 * a.speed), b / (2 * a.speed)
    cl = np.interp(a.alpha, [-1.57, -0.2, 0, 0.23, 0.6, 1.57], [0, -0.75, 0.25, 1.4, 0.71, 0]) + 0.2 * de
    cd = np.interp(a.alpha, [-1.57, -0.26, 0, 0.26, 1.57], [1.5, 0.056, 0.028, 0.056, 1.5]) + 0.04 * cl**2
    cd += np.interp(abs(a.beta), [0, 0.26, 1.57], [0, 0.05, 1.23]) + 0.03 * abs(de)
    cy = -1.0 * a.beta
    roll = -0.1 * a.beta + yaw * (-0.4 * a.p + 0.15 * a.r) + 0.13 * da + 0.01 * dr
    nose = -0.5 * a.alpha - 0.5 * de + pitch * (-12 * a.q - 7 * a.alpha_dot)
    turn = 0.12 * a.beta - 0.15 * yaw * a.r - 0.05 * dr - 0.03 * da
    (sa, ca), (sb, cb) = ((math.sin(x), math.cos(x)) for x in (a.alpha, a.beta))
    to_body = np.array([[ca * cb, -ca * sb, -sa], [sb, cb, 0], [sa * cb, -sa * sb, ca]])
    qs = 0.5 * a.rho * a.speed**2 * s
    force = qs * to_body @ [-cd, cy, -cl]
    # The reference point is an inch behind the centre of gravity and four below it.
    lever = np.array([-1, 0, 4]) * M_PER_FT / 12
    return force, np.array([roll * b, nose * c, turn * b]) * qs + np.cross(lever, force)


@dataclass(frozen=True)
class Published:
    """m [kg], inertia Jx, Jy, Jz, Jxz [kg m^2] of the equations of motion, S_prop [m^2], C_prop."""

    aerodynamics: Callable
    mass: float
    inertia: tuple[float, float, float, float]
    s_prop: float
    c_prop: float

    def thrust(self, speed, throttle, rho):
        """T = 1/2 rho S_prop C_prop Vd (Vd - Va), and the assumed drag of the idle propeller."""
        vd = speed + throttle * (45.0 - speed)
        windmill = 0.1 * speed**2 * max(0.0, 1 - throttle / 0.1)
        return 0.5 * rho * self.s_prop * (self.c_prop * vd * (vd - speed) - windmill)

    @property
    def tensor(self):
        jx, jy, jz, jxz = self.inertia
        return np.array([[jx, 0, -jxz], [0, jy, 0], [-jxz, 0, jz]])

    def derivative(self, x, surfaces, throttle, rho, g):
        """d/dt of (u, v, w, p, q, r, roll, pitch) of a rigid body over a flat Earth."""
        velocity, rates, (roll, pitch) = x[:3], x[3:6], x[6:]
        u, v, w = velocity
        speed = float(np.linalg.norm(velocity))
        weight = np.array(
            [-math.sin(pitch), math.sin(roll) * math.cos(pitch), math.cos(roll) * math.cos(pitch)]
        )
        air = Air(math.atan2(w, u), math.asin(v / speed), *rates, speed, rho)
        force, _ = self.aerodynamics(air, *surfaces)
        thrust = np.array([self.thrust(speed, throttle, rho), 0, 0])
        moved = (force + thrust) / self.mass + g * weight
        moved -= np.cross(rates, velocity)
        turning = Air(**{**vars(air), "alpha_dot": (u * moved[2] - w * moved[0]) / (u * u + w * w)})
        _, moment = self.aerodynamics(turning, *surfaces)
        spun = np.linalg.solve(self.tensor, moment - np.cross(rates, self.tensor @ rates))
        p, q, r = rates
        yaw_rate = (q * math.sin(roll) + r * math.cos(roll)) / math.cos(pitch)
        tilted = [p + yaw_rate * math.sin(pitch), q * math.cos(roll) - r * math.sin(roll)]
        return np.concatenate([moved, spun, tilted])


AIRFRAMES = {
    "x8": Published(x8, 3.364, (0.335, 0.140, 0.400, -0.029), 0.1017876, 0.248),
    "rascal": Published(
        rascal, 13 * 0.45359237, (*(KGM2_PER_SLUGFT2 * i for i in (1.95, 1.55, 1.91)), 0.0), 0.1642, 0.28
    ),
}
everyone = pytest.mark.parametrize("name", AIRFRAMES)


@cache
def simulated(name):
    fdm = Fdm(load(name), 0.005, Origin())
    place(fdm, Start(0.0, 0.0, 0.0, 0.0, 18.0))  # in the air
    return fdm


def commands(elevator, aileron, rudder, throttle):
    values = {"elevator": elevator, "aileron": aileron, "rudder": rudder, "throttle": throttle}
    return {f"fcs/{surface}-cmd-norm": value for surface, value in values.items()}


def hold(name, alpha, beta, speed, rates, **given):
    """Put JSBSim at a state; its acceleration (6,) and the air it is in."""
    fdm = simulated(name)
    body = [math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)]
    found = held(fdm, speed * np.array(body), (0.2, 0.1, 1.0), rates, commands(**given))
    rho = fdm.read("atmosphere/rho-slugs_ft3") * KGM3_PER_SLUGFT3
    return found, Air(alpha, beta, *rates, speed, rho, fdm.read("aero/alphadot-rad_sec"))


def states(count, seed=1):
    rng = np.random.default_rng(seed)
    for k in range(count):
        # half attached, half through and beyond the stall on either side
        alpha = rng.uniform(-0.2, 0.2) if k % 2 else rng.choice([-1, 1]) * rng.uniform(0.2, 1.2)
        elevator = rng.uniform(-0.6, 0.6)
        given = {
            "elevator": elevator,
            "aileron": rng.uniform(-1, 1) * (1 - abs(elevator)),
            "rudder": rng.uniform(-1, 1),
            "throttle": rng.uniform(0, 1) if k % 3 else rng.uniform(0, 0.1),
        }
        yield alpha, rng.uniform(-0.3, 0.3), rng.uniform(10, 30), rng.uniform(-1, 1, 3), given


@everyone
def test_forces_moments_and_thrust_are_the_published_ones_on_both_sides_of_the_stall(name):
    fdm, published = simulated(name), AIRFRAMES[name]
    for alpha, beta, speed, rates, given in states(40):
        _, air = hold(name, alpha, beta, speed, rates, **given)
        surfaces = (given[k] * LIMIT for k in ("elevator", "aileron", "rudder"))
        force, moment = published.aerodynamics(air, *surfaces)
        forces = [fdm.read(f"forces/fb{a}-aero-lbs") * N_PER_LB for a in "xyz"]
        moments = [fdm.read(f"moments/{a}-aero-lbsft") * NM_PER_LBFT for a in "lmn"]
        # 1e-6 of the term itself, or of its axis' size where terms of opposite sign nearly cancel
        np.testing.assert_allclose(forces, force, rtol=1e-6, atol=1e-7 * np.abs(force).max())
        np.testing.assert_allclose(moments, moment, rtol=1e-6, atol=1e-7 * np.abs(moment).max())
        thrust = fdm.read("forces/fbx-external-lbs") * N_PER_LB
        assert thrust == pytest.approx(
            published.thrust(speed, given["throttle"], air.rho), rel=1e-6, abs=1e-6
        )


@everyone
def test_thrust_passes_through_the_centre_of_gravity(name):
    hold(name, 0.05, 0.0, 18.0, (0, 0, 0), elevator=0.0, aileron=0.0, rudder=0.0, throttle=0.8)
    for axis in "lmn":
        assert simulated(name).read(f"moments/{axis}-external-lbsft") == pytest.approx(0.0, abs=1e-9)


@everyone
def test_aerodynamics_are_finite_at_every_angle_of_attack(name):
    for alpha in np.linspace(-3.1, 3.1, 25):
        found, _ = hold(name, alpha, 0, 15.0, (0, 0, 0), elevator=0, aileron=0, rudder=0, throttle=0.3)
        assert np.isfinite(found).all()


@everyone
def test_the_inertia_is_possible_and_the_published_or_assumed_one(name):
    fdm, published = simulated(name), AIRFRAMES[name]
    ixx, iyy, izz, ixz = (
        fdm.read(f"inertia/i{a}-slugs_ft2") * KGM2_PER_SLUGFT2 for a in ("xx", "yy", "zz", "xz")
    )
    # JSBSim's kg m^2 is 0.9999 of one, and its property is minus the product of the equations of motion
    assert (ixx, iyy, izz, -ixz) == pytest.approx(published.inertia, rel=2e-4)
    principal = sorted(np.linalg.eigvalsh(published.tensor))
    assert principal[0] > 0 and principal[2] < principal[0] + principal[1]
    assert fdm.read("inertia/mass-slugs") * 14.593902937 == pytest.approx(published.mass, rel=1e-6)


@everyone
def test_a_spinning_rolling_yawing_body_accelerates_as_the_equations_of_motion_say(name):
    published = AIRFRAMES[name]
    for alpha, beta, speed, rates, given in states(10, seed=2):
        found, air = hold(name, alpha, beta, speed, rates, **given)
        surfaces = [given[k] * LIMIT for k in ("elevator", "aileron", "rudder")]
        _, moment = published.aerodynamics(air, *surfaces)
        expected = np.linalg.solve(published.tensor, moment - np.cross(rates, published.tensor @ rates))
        # the Earth turns at 7e-5 rad/s, and JSBSim's kg m^2 is 0.9999 of one
        np.testing.assert_allclose(found[3:], expected, rtol=2e-3, atol=2e-3 * np.abs(expected).max())


def test_elevons_saturate_at_30_degrees_each():
    fdm = simulated("x8")
    hold("x8", 0.05, 0.0, 18.0, (0, 0, 0), elevator=0.8, aileron=0.8, rudder=0.0, throttle=0.3)
    assert fdm.read("fcs/elevon-left-pos-rad") == pytest.approx(math.radians(30))
    assert fdm.read("fcs/elevon-right-pos-rad") == pytest.approx(0.0, abs=1e-12)


# Natural frequency [rad/s] and damping ratio at 18 m/s in level flight; a real mode has damping +-1.
MODES = {
    "x8": {
        "short period": (14.2, 0.51), "phugoid": (0.71, None), "roll": (21.5, 1.0),
        "Dutch roll": (4.9, 0.39), "spiral": (0.18, 1.0),
    },
    "rascal": {
        "short period": (7.71, 0.963), "phugoid": (0.508, None), "roll": (6.39, 1.0),
        "Dutch roll": (5.64, 0.367), "spiral": (0.092, -1.0),
    },
}  # fmt: skip


def eigenvalues(name, v):
    """Short period, phugoid, roll, Dutch roll and spiral from the published coefficients at JSBSim's trim."""
    published, fdm = AIRFRAMES[name], Fdm(load(name), 0.005, Origin())
    trim = fdm.start(Start(0, 0, 0, 0, v))
    rho = fdm.read("atmosphere/rho-slugs_ft3") * KGM3_PER_SLUGFT3
    g = 9.8008  # normal gravity at 40 degrees north and 300 m
    surfaces = trim.elevator * LIMIT, trim.aileron * LIMIT, trim.rudder * LIMIT
    x = np.array([v * math.cos(trim.alpha), 0, v * math.sin(trim.alpha), 0, 0, 0, 0, trim.alpha])

    def f(y):
        return published.derivative(y, surfaces, trim.throttle, rho, g)

    assert np.abs(f(x)).max() < 5e-3  # the same equilibrium, but for the Coriolis acceleration
    jacobian = np.array([(f(x + step) - f(x - step)) / 2e-5 for step in 1e-5 * np.eye(8)]).T
    pitch = sorted(np.linalg.eigvals(jacobian[np.ix_([0, 2, 4, 7], [0, 2, 4, 7])]), key=abs)
    roll = np.linalg.eigvals(jacobian[np.ix_([1, 3, 5, 6], [1, 3, 5, 6])])
    real = sorted(roll[np.abs(roll.imag) < 1e-9].real, key=abs)
    dutch = next(z for z in roll if z.imag > 1e-9)
    return {
        "short period": pitch[2:], "phugoid": pitch[:2], "roll": [real[1]], "Dutch roll": [dutch],
        "spiral": [real[0]],
    }  # fmt: skip


@everyone
@pytest.mark.parametrize("v", [15.0, 18.0, 25.0])
def test_modes_are_those_of_the_published_coefficients(name, v):
    independent = eigenvalues(name, v)
    for mode in modes(linear_model(load(name), v).point):
        nearest = min(independent[mode.name], key=lambda z: abs(z - mode.eigenvalue))
        # density falls with height and the Earth is round: 0.005 rad/s, seen in phugoid and spiral
        assert abs(nearest - mode.eigenvalue) < 0.005 + 0.005 * abs(nearest), mode


@everyone
def test_modes_at_18_mps_are_the_expected_ones(name):
    found = {mode.name: mode for mode in modes(linear_model(load(name), 18.0).point)}
    for which, (frequency, damping) in MODES[name].items():
        assert found[which].frequency == pytest.approx(frequency, rel=0.02), found[which]
        if damping is not None:
            assert found[which].damping == pytest.approx(damping, abs=0.01), found[which]
