"""Starts engines that have a state (propeller, manifold, spools), and settles them with the body held.

JSBSim evaluates an engine at rest with whatever speed its shaft has, zero at first. So the body is held while
engines and actuators run until neither their state nor their forces change: a captive run. Evaluated at
dt = 0 a turboprop falls back to idle; its spools are written again after the first period that moves.
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from aircraft.airframes.schema import Airframe
from aircraft.jsbsim.errors import FdmError

FORCES = (
    *(f"forces/fb{axis}-{part}-lbs" for part in ("prop", "total") for axis in "xyz"),
    *(f"moments/{axis}-{part}-lbsft" for part in ("prop", "total") for axis in "lmn"),
)
_INTEGRATORS = ("rate/rotational", "rate/translational", "position/rotational", "position/translational")
_OFF, _ALL = 0.0, -1  # JSBSim's numbers for no integration, for all engines
_THROTTLE, _STARTING_PERIODS = "fcs/throttle-cmd-norm", 200
_CRANKING_PERIODS = 1000  # by magneto and starter
_BURNING = ("map-pa", "n1")  # states of pistons and turbines: they can stand still, or windmill
_BOTH_MAGNETOS = 3.0
_CHUNK = 20  # periods between two looks at the engines
_MOST_PERIODS = 8_000  # 40 s at 200 Hz; spools take twenty seconds
_SETTLED = 1e-9  # change over a chunk, as a share of the largest force and of each state
_NEARLY = 1e-7  # a change that counts as settled where an engine does not come nearer
_CYCLING = 1e-4  # what may still change after that time
_PATIENCE = 40  # chunks without progress until it does
_TURNS = 1.0  # rpm or percent: a slower shaft counts as standing
_NOTHING = 1e-3  # rpm, percent, Pa, lbs or lbs ft: changes of smaller values are taken as shares of this
_KEPT = 1e-3  # share of state and force by which an engine may change after an evaluation at rest


class Held(Protocol):
    """The part of `aircraft.jsbsim.fdm.Fdm` that settling engines needs."""

    airframe: Airframe
    executive: Any
    engine_states: list[Any]
    forgets: bool | None  # whether engines lose their state at dt = 0; None before it was tried

    def node(self, path: str) -> Any: ...

    def run_ic(self) -> None: ...


def settle(fdm: Held) -> None:
    """Run engines that have a state until they are steady in the flight just initialised.

    An engine that forgets its state at dt = 0 is left as the captive run leaves it, the longitude a little
    off; others are initialised again, at the place exactly.
    Raises  FdmError if they do not start, or do not become steady
    """
    if not is_captive(fdm):
        return
    if fdm.forgets is None and fdm.engine_states:
        _start(fdm)
    now = _steady(fdm)
    if fdm.forgets:
        return
    fdm.run_ic()  # the Earth has turned, and the place with it
    if fdm.forgets is None:
        run_held(fdm, 1)
        fdm.forgets = _change(fdm, now, _look(fdm)) > _KEPT
        _steady(fdm)
        if not fdm.forgets:
            fdm.run_ic()


def is_captive(fdm: Held) -> bool:
    """Whether forces are known only after a captive run: of engines or of the model's own flight control."""
    return bool(fdm.engine_states) or fdm.airframe.setup.captive


def spools(fdm: Held) -> list[tuple[Any, float]]:
    """The settled states of engines that forget them at dt = 0, to be written after the first period."""
    return [(node, node.get_double_value()) for node in fdm.engine_states] if fdm.forgets else []


def _steady(fdm: Held) -> NDArray[np.float64]:
    """Run the captive aircraft until its engines are steady; returns their states and forces."""
    before = now = _look(fdm)
    least, idle, change = np.inf, 0, np.inf
    for _ in range(_MOST_PERIODS // _CHUNK):
        before = now
        run_held(fdm, _CHUNK)
        now = _look(fdm)
        change = _change(fdm, before, now)
        if change < _SETTLED:
            return now
        idle = 0 if change < 0.9 * least else idle + 1
        least = min(least, change)
        if idle > _PATIENCE and change < _NEARLY:
            return now
    # A governor that hunts, and a shaft without a motor that coasts and no longer pulls.
    if change < _CYCLING or _change(fdm, before, now, forces=True) < _CYCLING:
        return now
    what = "engines are" if fdm.engine_states else "the model's own flight control is"
    raise FdmError(f"{fdm.airframe.name}: {what} not steady after {_MOST_PERIODS} periods at rest")


def _start(fdm: Held) -> None:
    """Let all engines run a second at half throttle: a propeller does not start by itself.

    A piston that JSBSim's own way of starting leaves standing is cranked by magnetos and starter.
    """
    engines = fdm.airframe.engines
    throttle = fdm.node(_THROTTLE)
    asked = throttle.get_double_value()
    for k in range(engines.count):
        fdm.node(f"fcs/mixture-cmd-norm{_index(k)}").set_double_value(engines.mixture)
        fdm.node(f"fcs/advance-cmd-norm{_index(k)}").set_double_value(engines.propeller)
    throttle.set_double_value(0.5)
    fdm.executive.get_propulsion().init_running(_ALL)
    _levers(fdm, 0.5)
    run_held(fdm, _STARTING_PERIODS)
    if not running(fdm):
        _crank(fdm)
    throttle.set_double_value(asked)
    if not running(fdm):
        raise FdmError(
            f"{fdm.airframe.name}: the engine does not run at half throttle; look at its fuel and sizes"
        )


def _levers(fdm: Held, throttle: float) -> None:
    """JSBSim opens every lever when it lets engines run: put them back."""
    engines = fdm.airframe.engines
    for k in range(engines.count):
        fdm.node(f"{_THROTTLE}{_index(k)}").set_double_value(throttle)
        fdm.node(f"fcs/mixture-cmd-norm{_index(k)}").set_double_value(engines.mixture)
        fdm.node(f"fcs/advance-cmd-norm{_index(k)}").set_double_value(engines.propeller)


def _crank(fdm: Held) -> None:
    manager = fdm.executive.get_property_manager()
    for path, value in (("propulsion/magneto_cmd", _BOTH_MAGNETOS), ("propulsion/starter_cmd", 1.0)):
        if manager.get_node(path) is not None:
            fdm.node(path).set_double_value(value)
    run_held(fdm, _CRANKING_PERIODS)
    if manager.get_node("propulsion/starter_cmd") is not None:
        fdm.node("propulsion/starter_cmd").set_double_value(0.0)
    run_held(fdm, _STARTING_PERIODS)


def running(fdm: Held) -> bool:
    """Whether the first engine's shaft turns, and no engine that burns fuel has stopped."""
    if fdm.engine_states[0].get_double_value() < _TURNS:
        return False
    manager = fdm.executive.get_property_manager()
    for k in range(fdm.airframe.engines.count):
        engine = f"propulsion/engine{_index(k)}/"
        burns = any(manager.get_node(engine + state) is not None for state in _BURNING)
        if burns and not fdm.node(engine + "set-running").get_double_value():
            return False
    return True


def _index(k: int) -> str:
    return f"[{k}]" if k else ""


def run_held(fdm: Held, n: int, at_once: bool = True) -> None:
    """Run n periods while the body stands still: engines and actuators move; clock and tanks do not.

    at_once  actuators take their commands at once, as in a trim
    """
    executive = fdm.executive
    integrators = [fdm.node(f"simulation/integrator/{path}") for path in _INTEGRATORS]
    kept = [node.get_double_value() for node in integrators]
    freeze, time = fdm.node("propulsion/fuel_freeze"), executive.get_sim_time()
    for node in integrators:
        node.set_double_value(_OFF)
    freeze.set_double_value(1.0)
    executive.set_trim_status(at_once)
    for _ in range(n):
        executive.run()
    executive.set_trim_status(False)
    freeze.set_double_value(float(fdm.airframe.setup.fuel_freeze))  # always 0 where it is read
    for node, value in zip(integrators, kept, strict=True):
        node.set_double_value(value)
    executive.set_sim_time(time)


def _look(fdm: Held) -> NDArray[np.float64]:
    """States of the engines, then forces and moments, of the propulsion and of all, in JSBSim's units."""
    nodes = [*fdm.engine_states, *(fdm.node(path) for path in FORCES)]
    return np.array([node.get_double_value() for node in nodes])


def _change(fdm: Held, before: NDArray[np.float64], now: NDArray[np.float64], forces: bool = False) -> float:
    """The largest change, as a share of each state and of the largest force; or of the forces alone."""
    n = len(fdm.engine_states)
    size = np.maximum(np.abs(now), _NOTHING)
    size[n:] = size[n:].max()
    return float((np.abs(now - before) / size)[n if forces else 0 :].max())
