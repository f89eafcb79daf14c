"""The X8's forces and moments in JSBSim against the published polynomial, evaluated here by itself."""

import math

import numpy as np
import pytest

from aircraft.airframe import load
from aircraft.earth import Origin
from aircraft.fdm import Fdm

N_PER_LB, M_PER_FT = 4.4482216152605, 0.3048
NM_PER_LBFT = N_PER_LB * M_PER_FT
KGM3_PER_SLUGFT3 = 515.3788183931961
S, B, C = 0.75, 2.1, 0.357143


def published(alpha, beta, p, q, r, de, da, speed, rho):
    """Body forces X, Y, Z [N], moments l, m, n [N m]: Gryte et al. 2018 sums, Beard & McLain stall blend."""
    up, down = math.exp(-50 * (alpha - 0.267)), math.exp(50 * (alpha + 0.267))
    sigma = (1 + up + down) / ((1 + up) * (1 + down))
    sin, cos = math.sin(alpha), math.cos(alpha)
    pitch, yaw = C / (2 * speed), B / (2 * speed)
    plate = 2 * math.copysign(1, alpha) * sin**2
    cl = (
        (1 - sigma) * (0.0867356 + 4.020328 * alpha) + sigma * plate * cos + 3.87 * pitch * q + 0.2780736 * de
    )
    cd = 0.0197 + (1 - sigma) * (0.0790915 * alpha + 1.05547 * alpha**2) + sigma * plate * sin
    cd += -0.005843 * beta + 0.1478119 * beta**2 + 0.0633474 * de**2
    cy = -0.2238722 * beta + yaw * (-0.1373551 * p + 0.0838688 * r) + 0.0432764 * da
    roll = -0.0848963 * beta + yaw * (-0.404198 * p + 0.0555206 * r) + 0.1201881 * da
    nose = 0.02275 - 0.4629 * alpha - 1.301237 * pitch * q - 0.2292 * de
    turn = 0.0283 * beta + yaw * (0.0043655 * p - 0.072 * r) - 0.00339 * da
    qs = 0.5 * rho * speed**2 * S
    forces = np.array([cl * sin - cd * cos, cy, -cl * cos - cd * sin]) * qs
    return forces, np.array([roll * B, nose * C, turn * B]) * qs


def published_thrust(speed, throttle, rho):
    """T = 1/2 rho S_prop C_prop Vd (Vd - Va), and the assumed drag of the idle propeller."""
    vd = speed + throttle * (45.0 - speed)
    windmill = 0.1 * speed**2 * max(0.0, 1 - throttle / 0.1)
    return 0.5 * rho * 0.1017876 * (0.248 * vd * (vd - speed) - windmill)


@pytest.fixture(scope="module")
def fdm():
    return Fdm(load("x8"), 0.005, Origin())


def at(fdm, alpha, beta, speed, rates, elevator, aileron, throttle):
    """Put JSBSim at a state and return what it says of forces, moments, thrust and air."""
    fdm.node("ap/on").set_double_value(0.0)
    for name, value in (("elevator", elevator), ("aileron", aileron), ("throttle", throttle)):
        fdm.node(f"fcs/{name}-cmd-norm").set_double_value(value)
    body = (
        speed
        / M_PER_FT
        * np.array([math.cos(alpha) * math.cos(beta), math.sin(beta), math.sin(alpha) * math.cos(beta)])
    )
    settings = {"ic/h-sl-ft": 1000.0, "ic/phi-rad": 0.2, "ic/theta-rad": 0.1, "ic/psi-true-rad": 1.0}
    settings |= dict(zip(("ic/u-fps", "ic/v-fps", "ic/w-fps"), body, strict=True))
    settings |= dict(zip(("ic/p-rad_sec", "ic/q-rad_sec", "ic/r-rad_sec"), rates, strict=True))
    for path, value in settings.items():
        fdm.node(path).set_double_value(float(value))
    fdm._fdm.set_trim_status(True)
    fdm._fdm.run_ic()
    fdm._fdm.set_trim_status(False)
    forces = [fdm.read(f"forces/fb{a}-aero-lbs") * N_PER_LB for a in "xyz"]
    moments = [fdm.read(f"moments/{a}-aero-lbsft") * NM_PER_LBFT for a in "lmn"]
    thrust = fdm.read("forces/fbx-external-lbs") * N_PER_LB
    return (
        np.array(forces),
        np.array(moments),
        thrust,
        fdm.read("atmosphere/rho-slugs_ft3") * KGM3_PER_SLUGFT3,
    )


def states(count, seed=1):
    rng = np.random.default_rng(seed)
    for k in range(count):
        # half attached, half through and beyond the stall on either side
        alpha = rng.uniform(-0.2, 0.2) if k % 2 else rng.choice([-1, 1]) * rng.uniform(0.2, 1.2)
        elevator = rng.uniform(-0.6, 0.6)
        aileron = rng.uniform(-1, 1) * (1 - abs(elevator))
        yield (
            alpha, rng.uniform(-0.3, 0.3), rng.uniform(10, 30), rng.uniform(-1, 1, 3), elevator, aileron,
            rng.uniform(0, 1) if k % 3 else rng.uniform(0, 0.1),
        )  # fmt: skip


def test_forces_moments_and_thrust_are_the_published_ones_on_both_sides_of_the_stall(fdm):
    limit = math.radians(30)
    for alpha, beta, speed, rates, elevator, aileron, throttle in states(50):
        forces, moments, thrust, rho = at(fdm, alpha, beta, speed, rates, elevator, aileron, throttle)
        f, m = published(alpha, beta, *rates, elevator * limit, aileron * limit, speed, rho)
        np.testing.assert_allclose(forces, f, rtol=1e-6)
        np.testing.assert_allclose(moments, m, rtol=1e-6)
        assert thrust == pytest.approx(published_thrust(speed, throttle, rho), rel=1e-6, abs=1e-6)


def test_aerodynamics_are_finite_at_every_angle_of_attack(fdm):
    for alpha in np.linspace(-3.1, 3.1, 25):
        forces, moments, _, _ = at(fdm, alpha, 0.0, 15.0, (0, 0, 0), 0.0, 0.0, 0.3)
        assert np.isfinite(forces).all() and np.isfinite(moments).all()


def test_elevons_saturate_at_30_degrees_each(fdm):
    at(fdm, 0.05, 0.0, 18.0, (0, 0, 0), 0.8, 0.8, 0.3)
    assert fdm.read("fcs/elevon-left-pos-rad") == pytest.approx(math.radians(30))
    assert fdm.read("fcs/elevon-right-pos-rad") == pytest.approx(0.0, abs=1e-12)


def test_the_inertia_is_possible_and_that_of_the_readme(fdm):
    unit = 1.3558179483314  # slug ft^2 to kg m^2
    ixx, iyy, izz, ixz = (fdm.read(f"inertia/i{a}-slugs_ft2") * unit for a in ("xx", "yy", "zz", "xz"))
    # JSBSim's kg m^2 is 0.9999 of one, and its property is minus the product of the equations of motion
    assert (ixx, iyy, izz, -ixz) == pytest.approx((0.335, 0.140, 0.400, -0.029), rel=2e-4)
    principal = sorted(np.linalg.eigvalsh([[ixx, 0, ixz], [0, iyy, 0], [ixz, 0, izz]]))
    assert principal[2] < principal[0] + principal[1]


def test_the_product_of_inertia_enters_as_in_the_equations_of_motion(fdm):
    _, moments, _, _ = at(fdm, 0.05, 0.0, 18.0, (0, 0, 0), 0.0, 0.5, 0.3)
    l, _, n = moments
    gamma = 0.335 * 0.400 - 0.029**2
    expected = (0.400 * l - 0.029 * n) / gamma, (-0.029 * l + 0.335 * n) / gamma
    measured = fdm.read("accelerations/pdot-rad_sec2"), fdm.read("accelerations/rdot-rad_sec2")
    assert measured == pytest.approx(expected, rel=1e-3)
