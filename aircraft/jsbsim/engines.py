"""Settles engines that have a state (propeller, manifold, spools) while the aircraft stands still.

JSBSim evaluates an engine at rest with whatever speed its shaft has, zero at first. So the body is held while
engines and actuators run until neither their state nor their forces change.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.errors import FdmError

FORCES = (*(f"forces/fb{axis}-prop-lbs" for axis in "xyz"), *(f"moments/{axis}-prop-lbsft" for axis in "lmn"))
_INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
_OFF, _ALL = 0.0, -1  # JSBSim's numbers for no integration, for all engines
_THROTTLE, _STARTING_PERIODS = "fcs/throttle-cmd-norm", 200
_CHUNK = 20  # periods between two looks at the engines
_MOST_PERIODS = 24_000  # two minutes at 200 Hz; spools take twenty seconds
_SETTLED = 1e-12  # change over a chunk, as a share of the largest force and of each state
_TURNS = 1.0  # rpm or percent: a slower shaft counts as standing
_NOTHING = 1e-3  # rpm, percent, Pa, lbs or lbs ft: changes of smaller values are taken as shares of this
_KEPT = 1e-3  # share of state and force by which an engine may change after an evaluation at rest


class Held(Protocol):
    """The part of `aircraft.jsbsim.fdm.Fdm` that settling engines needs."""

    airframe: Airframe
    executive: Any
    engine_states: list[Any]

    def node(self, path: str) -> Any: ...

    def run_ic(self) -> None: ...


def settle(fdm: Held) -> None:
    """Run engines that have a state until they are steady in the flight just initialised.

    Raises  FdmError if they do not become steady, or forget their state when a flight is initialised
    """
    if not fdm.engine_states:
        return
    now = _look(fdm)
    first = now[0] < _TURNS
    if first:
        _start(fdm)
    for _ in range(_MOST_PERIODS // _CHUNK):
        before = now
        _run_held(fdm, _CHUNK)
        now = _look(fdm)
        if _change(fdm, before, now) < _SETTLED:
            break
    else:
        raise FdmError(f"{fdm.airframe.name}: engines are not steady after {_MOST_PERIODS} periods at rest")
    fdm.run_ic()  # the Earth has turned, and the place with it
    if first:
        _run_held(fdm, 1)
        if _change(fdm, now, _look(fdm)) > _KEPT:
            raise FdmError(
                f"{fdm.airframe.name}: JSBSim forgets this engine's state when it initialises a flight, as"
                " it does a turboprop's; give the model a piston, electric or turbine engine"
            )
        settle(fdm)


def _start(fdm: Held) -> None:
    """Let all engines run, mixture rich, a second at half throttle: a propeller does not start by itself."""
    throttle = fdm.node(_THROTTLE)
    asked = throttle.get_double_value()
    fdm.node("fcs/mixture-cmd-norm").set_double_value(1.0)
    fdm.executive.get_propulsion().init_running(_ALL)
    throttle.set_double_value(0.5)
    _run_held(fdm, _STARTING_PERIODS)
    throttle.set_double_value(asked)
    if fdm.engine_states[0].get_double_value() < _TURNS:
        raise FdmError(
            f"{fdm.airframe.name}: the engine does not run at half throttle; look at its fuel and sizes"
        )


def _run_held(fdm: Held, n: int) -> None:
    """Run n periods while the body stands still: engines and actuators move; clock and tanks do not."""
    executive = fdm.executive
    integrators = [fdm.node(f"simulation/integrator/{path}") for path in _INTEGRATORS]
    kept = [node.get_double_value() for node in integrators]
    freeze, time = fdm.node("propulsion/fuel_freeze"), executive.get_sim_time()
    for node in integrators:
        node.set_double_value(_OFF)
    freeze.set_double_value(1.0)
    executive.set_trim_status(True)
    for _ in range(n):
        executive.run()
    executive.set_trim_status(False)
    freeze.set_double_value(0.0)
    for node, value in zip(integrators, kept, strict=True):
        node.set_double_value(value)
    executive.set_sim_time(time)


def _look(fdm: Held) -> NDArray[np.float64]:
    """States, then forces and moments of the propulsion, in JSBSim's units."""
    nodes = [*fdm.engine_states, *(fdm.node(path) for path in FORCES)]
    return np.array([node.get_double_value() for node in nodes])


def _change(fdm: Held, before: NDArray[np.float64], now: NDArray[np.float64]) -> float:
    """The largest change, as a share of each state and of the largest force."""
    n = len(fdm.engine_states)
    size = np.maximum(np.abs(now), _NOTHING)
    size[n:] = size[n:].max()
    return float((np.abs(now - before) / size).max())
