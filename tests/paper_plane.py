"""An aircraft whose forces are formulas, in place of JSBSim: its steady flights are known in closed form.

Lift, drag, thrust (along the path) and the three moments are written below, per mass and per inertia; the
elevator's limit ends its lift. It evaluates in microseconds, and counts how often.
"""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from aircraft.jsbsim import steady
from aircraft.jsbsim.continuation import Reached
from aircraft.jsbsim.engines import FORCES
from aircraft.jsbsim.geodesy import G_MPS2, M_PER_FT, Origin
from aircraft.jsbsim.properties import NODES
from aircraft.jsbsim.rest import Start

EAST = math.pi / 2  # heading, clockwise from north
K = 0.05  # lift = K V^2 cl, and so on
CL_0, CL_ALPHA, CD_2, SIDE = 0.1, 4.5, 0.06, 0.4
PITCH_0, PITCH_ALPHA, PITCH_ELEVATOR, PITCH_DAMPING = 0.02, 0.5, 0.2, 0.7
ROLL_AILERON, ROLL_BETA, ROLL_DAMPING = 0.3, 0.05, 0.5
YAW_BETA, YAW_RUDDER, YAW_DAMPING = 0.2, 0.15, 0.4
INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")


class Node:
    """A property: a number that is set and got."""

    def __init__(self, value=0.0):
        self.value = value

    def get_double_value(self):
        return self.value

    def set_double_value(self, value):
        assert isinstance(value, float)  # JSBSim takes no numpy array and no None
        self.value = value


class Executive:
    """What settles engines: periods with the body held, which change nothing here."""

    def __init__(self, plane):
        self.plane, self.time, self.periods = plane, 3.0, 0

    def set_trim_status(self, status):
        assert isinstance(status, bool)

    def run(self):
        self.periods += 1
        self.plane.held_period()

    def get_sim_time(self):
        return self.time

    def set_sim_time(self, time):
        self.time = time


class PaperPlane:
    """`aircraft.jsbsim.rest.Instance` with forces in closed form.

    thrust   m/s^2 at full throttle;  drag  coefficient without lift
    fastest  m/s, above which nothing is known of its forces
    rudder   whether there is one;  captive  whether forces are known only after a captive run
    """

    def __init__(self, thrust=4.0, drag=0.03, rudder=False, captive=False, idle=0.0, full=1.0, fastest=1e9):
        self.thrust, self.drag, self.fastest = thrust, drag, fastest
        self.airframe = SimpleNamespace(
            name="paper", has_rudder=rudder, setup=SimpleNamespace(captive=captive, fuel_freeze=False),
            engines=SimpleNamespace(idle=idle, full=full, count=1),
            speeds=SimpleNamespace(start_mps=20.0, v_min_mps=14.0, v_max_mps=26.0),
        )  # fmt: skip
        self.origin = Origin()
        self.nodes = {name: Node() for name in NODES}
        self.nodes["on"].value = 1.0
        self.paths = {NODES[name]: node for name, node in self.nodes.items()}
        self.paths |= {path: Node() for path in FORCES}
        self.paths |= {f"simulation/integrator/{path}": Node(2.0) for path in INTEGRATORS}
        self.paths["propulsion/fuel_freeze"] = Node()
        self.executive, self.engine_states, self.forgets, self.spools = Executive(self), [], None, []
        self.evaluations = self.rests = 0

    def node(self, path):
        return self.paths[path]

    def held_period(self):
        """What a period with the body held does to engines."""

    def run_ic(self):
        self.evaluations += 1
        n = {name: node.value for name, node in self.nodes.items()}
        u, v, w = (n[f"{axis}_ic"] * M_PER_FT for axis in "uvw")
        p, q, r, phi, theta = n["p_ic"], n["q_ic"], n["r_ic"], n["roll_ic"], n["pitch_ic"]
        speed = math.sqrt(u * u + v * v + w * w)
        alpha, beta, square = math.atan2(w, u), math.asin(v / speed), speed * speed
        lift, drag = K * square * (CL_0 + CL_ALPHA * alpha), self.drag_at(speed, CL_0 + CL_ALPHA * alpha)
        along, flat = (self.thrust * n["throttle"] - drag) / speed, math.hypot(u, w)
        force = (
            along * u + lift * w / flat,
            along * v - K * SIDE * square * beta,
            along * w - lift * u / flat,
        )
        down = G_MPS2 * math.cos(theta)
        rudder = n["rudder"] if self.airframe.has_rudder else 0.0
        rates = {
            "udot": force[0] - G_MPS2 * math.sin(theta) + r * v - q * w,
            "vdot": force[1] + down * math.sin(phi) + p * w - r * u,
            "wdot": force[2] + down * math.cos(phi) + q * u - p * v,
            "pdot": square * (ROLL_AILERON * n["aileron"] - ROLL_BETA * beta) - ROLL_DAMPING * speed * p,
            "qdot": square * (PITCH_0 + PITCH_ELEVATOR * n["elevator"] - PITCH_ALPHA * alpha)
            - PITCH_DAMPING * speed * q,
            "rdot": square * (YAW_BETA * beta + YAW_RUDDER * rudder) - YAW_DAMPING * speed * r,
        }  # fmt: skip
        for name, rate in rates.items():
            known = rate if speed <= self.fastest else math.nan
            self.nodes[name].value = known / M_PER_FT if name in ("udot", "vdot", "wdot") else known
        self.nodes["alpha"].value, self.nodes["beta"].value = alpha, beta
        self.nodes["altitude"].value = n["altitude_ic"] - 0.005  # JSBSim's, too, is a little low

    def evaluate(self):
        self.rests += 1

    def drag_at(self, speed, cl):
        """m/s^2"""
        return K * speed * speed * (self.drag + CD_2 * cl * cl)

    # -- its steady flights, without sideslip

    def lift_needed(self, speed, climb, omega):
        """m/s^2, at airspeed [m/s], climb angle [rad] and turn rate [rad/s]."""
        level = speed * math.cos(climb)
        return math.hypot(G_MPS2 * math.cos(climb), level * omega)

    def cl_needed(self, speed, climb, omega=0.0):
        return self.lift_needed(speed, climb, omega) / (K * speed * speed)

    def throttle_needed(self, speed, climb, omega=0.0):
        drag = self.drag_at(speed, self.cl_needed(speed, climb, omega))
        return (drag + G_MPS2 * math.sin(climb)) / self.thrust

    def largest_cl(self):
        """That of full elevator, without pitch damping."""
        return CL_0 + CL_ALPHA * (PITCH_0 + PITCH_ELEVATOR) / PITCH_ALPHA

    def steepest(self, v, throttle, omega=0.0):
        """The climb rate [m/s] of a throttle at ground speed v [m/s], by bisection of the formulas."""
        low, high = -1.0, 1.0  # rad
        for _ in range(60):
            middle = 0.5 * (low + high)
            if self.throttle_needed(v / math.cos(middle), middle, omega) < throttle:
                low = middle
            else:
                high = middle
        return v * math.tan(low)

    def left(self):
        """Accelerations as last evaluated [m/s^2, rad/s^2] (6,)."""
        values = np.array([self.nodes[k].value for k in ("udot", "vdot", "wdot", "pdot", "qdot", "rdot")])
        return values * np.array([M_PER_FT] * 3 + [1.0] * 3)


def start(v, zeta=0.0, theta=0.0, wind=(0.0, 0.0, 0.0), x=0.0, y=0.0):
    return Start(x, y, 0.0, theta, v, zeta, wind)


def problem_of(plane, p):
    steady.place(plane, start(20.0))
    return steady.trim_problem(plane, EAST, p[0], p[1], steady.velocity_of(p[0], p[1], EAST))


class Ways:
    """Stands for `follow`: arrives only where it is told to."""

    def __init__(self, *arrives):
        self.arrives, self.targets = list(arrives), []

    def __call__(self, problem, p, x, target):
        self.problem = problem if not self.targets else self.problem
        assert problem is self.problem is not None
        self.targets.append((p.tolist(), target.tolist()))
        arrived = len(self.targets) in self.arrives
        return Reached(target if arrived else 0.5 * (p + target), x + len(self.targets), arrived)
