"""Wraps a user's plant, and checks what it returns."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np

from filters.model import Array, Command, State
from testbed.components.border.contract import LARGEST, Contract, copy_of, locked
from testbed.records.run import AIRCRAFT_COLUMNS, LEFT_COLUMNS, VEHICLE_COLUMNS, WIND_COLUMNS

# What a state may differ from the end of the track, and the start from what was asked: round-off and a trim.
TRACK_M, START_M, START_RAD = 1e-6, 1e-3, 1e-3
NEEDED = ("reset", "step", "state", "achieved", "telemetry", "faults")
RECORDED = (VEHICLE_COLUMNS.keys() | WIND_COLUMNS.keys() | LEFT_COLUMNS.keys()) - AIRCRAFT_COLUMNS.keys()
LONGEST_FAULT = 120


def parameters(function: Callable[..., Any]) -> tuple[list[str], bool]:
    """The names of a function's parameters, and whether it takes any keyword; none where nothing is known."""
    try:
        found = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return [], False
    names = [p.name for p in found if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    return names, any(p.kind == p.VAR_KEYWORD for p in found)


class OwnPlant:
    """A Plant over a user's: `reset` may leave out wind and speed, and `close` may be missing.

    State and rates are asked for once after every `reset` and `step`; what they were then is the truth.
    """

    def __init__(self, contract: Contract, plant: Any, dt: float) -> None:
        self._contract, self._plant, self.dt = contract, plant, dt
        methods = {name: contract.method(plant, name) for name in NEEDED}
        names, anything = parameters(methods["reset"])
        self._takes = [name for name in ("wind", "speed") if anything or name in names]
        self._reset, self._step = methods["reset"], methods["step"]
        self._ask_state, self._ask_rates = methods["state"], methods["achieved"]
        self._ask_telemetry, self._ask_faults = methods["telemetry"], methods["faults"]
        self._channels: list[str] | None = None
        self._fine = [""] * contract.vehicles
        self._check_dt()

    def reset(self, state: State, rng: np.random.Generator, wind: Array, speed: Array) -> None:
        """As `Plant.reset`; wind and speed go by name, as far as the plant takes them."""
        given = {"wind": wind, "speed": speed}
        named = {name: locked(given[name].copy()) for name in self._takes}
        self._contract.call("reset()", self._reset, copy_of(state), rng, **named)
        self._check_dt()
        self._look()
        away = np.abs(self._state.position - state.position).max()
        turned = np.abs(np.remainder(self._state.theta - state.theta + np.pi, 2 * np.pi) - np.pi).max()
        if away > START_M or turned > START_RAD:
            raise self._contract.breach(
                f"state() after reset() is {away:.3g} m and {turned:.3g} rad away from the start"
            )

    def step(self, command: Command, wind: Array, n: int) -> Array:
        """As `Plant.step`."""
        contract = self._contract
        flown = contract.call("step()", self._step, copy_of(command), locked(wind.copy()), n)
        self._check_dt()
        track = contract.array("the track of step()", flown, (n, contract.vehicles, 3))
        self._look()
        s, end = self._state, track[-1].T
        if end.tolist() != [s.x.tolist(), s.y.tolist(), s.z.tolist()]:  # numpy takes twice as long for a few
            off = np.abs(np.array((s.x, s.y, s.z)) - end).max()
            if off > TRACK_M:
                raise contract.breach(f"state() is {off:.3g} m away from the end of the track of step()")
        return track

    def _look(self) -> None:
        contract = self._contract
        self._state = contract.state("state()", contract.call("state()", self._ask_state))
        self._rates = contract.command("achieved()", contract.call("achieved()", self._ask_rates))

    def _check_dt(self) -> None:
        try:
            dt: Any = self._plant.dt
        except Exception:
            dt = None  # said below
        if type(dt) is float and dt == self.dt:
            return
        dt = self._contract.call("its attribute dt", getattr, self._plant, "dt", None)
        if type(dt) is float and dt == self.dt:
            return
        number = isinstance(dt, float | np.floating) or (type(dt) is int and abs(dt) < LARGEST)
        if not number or not math.isclose(float(dt), self.dt, rel_tol=1e-9):
            said = f"{float(dt):.9g} s" if number else f"a {type(dt).__name__}"
            raise self._contract.breach(f"its dt is {said}, the scenario's rates.fdm_dt_s is {self.dt:g} s")

    def state(self) -> State:
        """As `Plant.state`."""
        return self._state

    def achieved(self) -> Command:
        """As `Plant.achieved`."""
        return self._rates

    def telemetry(self) -> dict[str, Array]:
        """As `Plant.telemetry`; NaN marks a channel that a vehicle does not have."""
        contract = self._contract
        found = contract.call("telemetry()", self._ask_telemetry)
        if not isinstance(found, dict):
            raise contract.breach(f"telemetry() is a {type(found).__name__}, not a dict")
        out = {}
        for name, value in found.items():
            if not (isinstance(name, str) and name.isidentifier() and name.isascii()):
                raise contract.breach(f"telemetry() has a channel {name!r:.40}, which is no Python name")
            if name in RECORDED:
                raise contract.breach(f"telemetry() has a channel {name}, which the testbed itself records")
            out[str(name)] = contract.channel(f"telemetry()[{name!r}]", value)
        if self._channels is None:
            self._channels = list(out)
        elif list(out) != self._channels:
            raise contract.breach("telemetry() has other channels than before")
        return out

    def faults(self) -> list[str]:
        """As `Plant.faults`."""
        contract = self._contract
        found = contract.call("faults()", self._ask_faults)
        if type(found) is list and found == self._fine:
            return list(self._fine)
        if not isinstance(found, list | tuple) or len(found) != contract.vehicles:
            raise contract.breach(f"faults() is not a list of {contract.vehicles} strings")
        for fault in found:
            if not isinstance(fault, str):
                raise contract.breach(f"faults() has a {type(fault).__name__} in it, not strings alone")
        return [_plain(fault) if fault else "" for fault in found]

    def close(self) -> None:
        """Close the plant, if it can be closed. The flight is over: an error changes nothing any more."""
        with suppress(Exception, SystemExit):
            self._plant.close()


def _plain(fault: str) -> str:
    """A fault in one printable line."""
    line = " ".join(str(fault).split())[:LONGEST_FAULT]
    return "".join(c if c.isprintable() else "?" for c in line) or "fault without a name"
