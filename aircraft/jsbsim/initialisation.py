"""Starts a flight: steady flight found on the model itself, with the autopilot settled in it."""

from __future__ import annotations

from aircraft.jsbsim.engines import spools
from aircraft.jsbsim.rest import Instance, Start, initialise, place
from aircraft.jsbsim.steady import Trim, trim

_NEAR = 1e-5  # of a command: how near the settled autopilot's commands are to the trim's
# Integrators: the command that each holds in level flight, and the limit that the equations give its state.
_INTEGRALS = {
    "turn_integral": ("aileron", 0.15),
    "climb_integral": ("elevator", 3.0),
    "speed_integral": ("throttle", 2.0),
}


def start(fdm: Instance, at: Start, near: Trim | None = None) -> Trim:
    """Trim, take the start's place, velocity and wind, settle the autopilot's states and switch it on.

    near  a trim of a flight like this one
    """
    n = fdm.nodes
    found = trim(fdm, at, near=near)
    fdm.spools = spools(fdm)
    _, ground = place(fdm, at, correct=True)
    initialise(fdm, (found.roll, found.pitch, found.yaw), ground, 0.0)
    fdm.blow(at.wind)
    fdm.command(at.v, 0.0, at.zeta)
    # Initialising knew no wind: evaluate everything again without moving, and keep the old acceleration,
    # which Adams-Bashforth would take, out of the first period.
    fdm.evaluate()
    fdm.forget_acceleration()
    if not _INTEGRALS.keys() <= n.keys():  # it has followed the trim's commands until now, and begins there
        n["on"].set_double_value(1.0)
        fdm.evaluate()
        return found
    n["on"].set_double_value(1.0)
    for _ in range(2):  # elevator and throttle depend a little on each other's integrator
        _settle(fdm, "aileron_wanted", found.aileron, "turn_integral")
        _settle(fdm, "elevator_wanted", found.elevator, "climb_integral")
        _settle(fdm, "throttle_wanted", found.throttle, "speed_integral")
    for _ in range(3):
        fdm.evaluate()
    targets = {"aileron": found.aileron, "elevator": found.elevator, "throttle": found.throttle}
    if any(abs(n[f"{name}_wanted"].get_double_value() - x) > _NEAR for name, x in targets.items()):
        _settle_apart(fdm, targets)
    return found


def _settle_apart(fdm: Instance, targets: dict[str, float]) -> None:
    """Choose the integrators' states with the surfaces held where the trim has them.

    An autopilot of high gain answers the side force that its own surfaces make: evaluated again and again
    without the surfaces' lag, it runs away. Here it is evaluated once at a time, from the trim.
    """
    from scipy.optimize import brentq

    n = fdm.nodes
    values = dict.fromkeys(_INTEGRALS, 0.0)

    def answer() -> None:
        """Evaluate the autopilot at the trim, with the integrators at `values`."""
        n["on"].set_double_value(0.0)
        for name, target in targets.items():
            n[name].set_double_value(target)
        for _ in range(3):
            fdm.evaluate()
        n["on"].set_double_value(1.0)
        for integral, value in values.items():
            n[integral].set_double_value(value)
        fdm.evaluate()

    def miss(value: float, name: str, integral: str) -> float:
        values[integral] = value
        answer()
        return float(n[f"{name}_wanted"].get_double_value()) - targets[name]

    for _ in range(2):
        for integral, (name, most) in _INTEGRALS.items():
            low, high = miss(-most, name, integral), miss(most, name, integral)
            if low * high < 0:
                values[integral] = float(brentq(miss, -most, most, (name, integral), xtol=1e-12))
            else:
                values[integral] = 0.0
    answer()


def _settle(fdm: Instance, wanted: str, target: float, integral: str) -> None:
    """Choose an integrator's state so that the autopilot's output is `target`, by secants."""
    n = fdm.nodes

    def miss(value: float) -> float:
        n[integral].set_double_value(value)
        for _ in range(4):  # what the surfaces do to the side force comes back one evaluation later
            fdm.evaluate()
        return n[wanted].get_double_value() - target

    a, b = 0.0, 0.05
    miss_a, miss_b = miss(a), miss(b)
    for _ in range(8):
        if abs(miss_b) < 1e-12 or miss_b == miss_a:
            break
        a, miss_a, b = b, miss_b, b - miss_b * (b - a) / (miss_b - miss_a)
        miss_b = miss(b)
