"""Starts a flight: steady flight found on the model itself, with the autopilot settled in it."""

from __future__ import annotations

from aircraft.jsbsim.rest import Instance, Start, initialise, place
from aircraft.jsbsim.steady import Trim, trim


def start(fdm: Instance, at: Start) -> Trim:
    """Trim, take the start's place, velocity and wind, settle the autopilot's states and switch it on."""
    n = fdm.nodes
    found = trim(fdm, at)
    _, ground = place(fdm, at, correct=True)
    initialise(fdm, (found.roll, found.pitch, found.yaw), ground, 0.0)
    fdm.blow(at.wind)
    fdm.command(at.v, 0.0, at.zeta)
    # Initialising knew no wind: evaluate everything again without moving, and keep the old acceleration,
    # which Adams-Bashforth would take, out of the first period.
    fdm.evaluate()
    fdm.forget_acceleration()
    n["on"].set_double_value(1.0)
    for _ in range(2):  # elevator and throttle depend a little on each other's integrator
        _settle(fdm, "aileron_wanted", found.aileron, "turn_integral")
        _settle(fdm, "elevator_wanted", found.elevator, "climb_integral")
        _settle(fdm, "throttle_wanted", found.throttle, "speed_integral")
    for _ in range(3):
        fdm.evaluate()
    return found


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
