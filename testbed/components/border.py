"""Adapts parts of a user's own to the interfaces that the simulation calls."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

import numpy as np

from aircraft.plant import Plant
from filters.model import Array, Command, State, View
from testbed.components.guidance import Guidance


def parameters(function: Callable[..., Any]) -> tuple[list[str], bool]:
    """The names of a function's parameters, and whether it takes any keyword; none where nothing is known."""
    try:
        found = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return [], False
    names = [p.name for p in found if p.kind not in (p.VAR_POSITIONAL, p.VAR_KEYWORD)]
    return names, any(p.kind == p.VAR_KEYWORD for p in found)


class OwnPlant:
    """A user's plant, whose `reset` may leave out wind and speed, and which may have no `close`."""

    def __init__(self, plant: Any) -> None:
        self._plant = plant
        self.dt: float = plant.dt
        names, anything = parameters(plant.reset)
        self._takes = [name for name in ("wind", "speed") if anything or name in names]
        self.step, self.state, self.achieved = plant.step, plant.state, plant.achieved
        self.telemetry, self.faults = plant.telemetry, plant.faults

    def reset(self, state: State, rng: np.random.Generator, wind: Array, speed: Array) -> None:
        """Pass wind and speed by name, as far as the plant takes them."""
        given = {"wind": wind, "speed": speed}
        self._plant.reset(state, rng, **{name: given[name] for name in self._takes})

    def close(self) -> None:
        """Close the plant, if it can be closed."""
        if close := getattr(self._plant, "close", None):
            close()


def adapt_plant(plant: Any) -> Plant:
    """`plant` as the simulation calls it: itself, if its `reset` takes wind and speed and it has `close`."""
    names, _ = parameters(plant.reset)
    if {"wind", "speed"} <= set(names) and hasattr(plant, "close"):
        whole: Plant = plant
        return whole
    return OwnPlant(plant)


def adapt_guidance(guidance: Any) -> Guidance:
    """`guidance` as the simulation calls it, (t, view).

    One whose second parameter is not called `view` is called with the state (N,) instead, which each vehicle
    knows of itself.
    """
    names, _ = parameters(guidance)
    if names[1:2] == ["view"]:
        whole: Guidance = guidance
        return whole

    def of_state(t: float, view: View) -> Command:
        answer: Command = guidance(t, view.state)
        return answer

    return of_state
