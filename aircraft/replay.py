"""Wraps a plant and records its commands and wind, so that its flight can be branched at any time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from aircraft.plant import Plant
from filters.model import Array, Command, State


class Replay:
    """Wraps the plants that `make` builds; a Plant itself.

    make  builds a plant as it was built the first time
    JSBSim cannot save a state, so `branch` repeats the recorded commands and wind from the start.
    """

    def __init__(self, make: Callable[[], Plant]) -> None:
        self._make = make
        self._plant = make()
        self.dt = self._plant.dt
        self._start: tuple[State, np.random.Generator, Array, Array] | None = None
        self._told: list[tuple[Command, Array, int]] = []

    def reset(self, state: State, rng: np.random.Generator, wind: Array, speed: Array) -> None:
        self._start = (state, _copy(rng), wind, speed)
        self._told = []
        self._plant.reset(state, rng, wind, speed)

    def step(self, command: Command, wind: Array, n: int) -> Array:
        # Kept as copies: the caller may reuse its arrays.
        self._told.append((Command.of(command.array()), np.array(wind, dtype=float), n))
        return self._plant.step(command, wind, n)

    def state(self) -> State:
        return self._plant.state()

    def achieved(self) -> Command:
        return self._plant.achieved()

    def telemetry(self) -> dict[str, Array]:
        return self._plant.telemetry()

    def faults(self) -> list[str]:
        return self._plant.faults()

    def close(self) -> None:
        self._plant.close()

    def branch(self, t: float) -> Plant:
        """A plant at time `t` [s] of this flight; flying it leaves this one untouched.

        Raises  ValueError if `t` is negative, past the flight, or not a whole number of periods.
        """
        if self._start is None:
            raise ValueError("nothing has been flown yet: reset the plant first")
        left = round(t / self.dt)
        flown = sum(n for _, _, n in self._told)
        if abs(left * self.dt - t) > 1e-6 * max(self.dt, t) or not 0 <= left <= flown:
            raise ValueError(
                f"cannot branch at {t:g} s: the flight lasted {flown * self.dt:g} s in steps of {self.dt:g} s"
            )
        plant = self._make()
        state, rng, air, speed = self._start
        plant.reset(state, _copy(rng), air, speed)
        for command, wind, n in self._told:
            if left == 0:
                break
            plant.step(command, wind, min(n, left))
            left -= min(n, left)
        return plant


def _copy(rng: np.random.Generator) -> np.random.Generator:
    """A generator that goes on as `rng` would, leaving `rng` where it is."""
    bits = type(rng.bit_generator)()
    bits.state = rng.bit_generator.state
    return np.random.Generator(bits)
