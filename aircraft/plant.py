"""The Plant protocol: vehicles that fly commands, such as JSBSim aircraft, unicycles, unicycles with lags."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from filters.model import Array, Command, State


class Plant(Protocol):
    """Vehicles that fly commands. `step` returns every position passed, so that no minimum is missed.

    reset(state, rng,       start at `state` (N,) with ground speeds `speed` (N,) m/s in `wind` (N, 3) m/s;
          wind, speed)      internal states settled
    step(command, wind, n)  fly `command` (N,) for n periods of `dt` in `wind` (N, 3) m/s (east, north, up:
                            the air's motion over the ground); returns positions (n, N, 3) m after each
    state()                 the pose now: course and east-north-up position, the truth
    achieved()              ground speed, course rate and climb rate now, in the type they were asked in; of
                            aircraft the course rate as the autopilot measures it, see `JsbsimFleet.achieved`
    telemetry()             further recorded channels, name -> (N,); empty for kinematic plants
    faults()                per vehicle "" or what ended its flight: "stalled", "hit the ground", ...
    close()                 the flight is over: release what is held; may be called twice
    """

    dt: float

    def reset(self, state: State, rng: np.random.Generator, wind: Array, speed: Array) -> None: ...
    def step(self, command: Command, wind: Array, n: int) -> Array: ...
    def state(self) -> State: ...
    def achieved(self) -> Command: ...
    def telemetry(self) -> dict[str, Array]: ...
    def faults(self) -> list[str]: ...
    def close(self) -> None: ...
