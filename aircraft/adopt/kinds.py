"""Refuses what is no aircraft that an engine drives and a wing carries: rotors, gas, rockets, no engine."""

from __future__ import annotations

from aircraft.adopt.copying import Copy
from aircraft.adopt.failures import AdoptionError

STAGE = "engines"


def only_winged(copy: Copy) -> None:
    """AdoptionError for a model that no throttle holds in level flight on a wing; seen in its files alone."""
    if copy.model.first("gas_cell") is not None:
        raise AdoptionError(STAGE, "gas carries it: it has no stall speed, from which all speeds follow")
    if not copy.engine_count:
        raise AdoptionError(STAGE, "the model has no engine: without thrust no speed can be held")
    kinds = {tree.name for tree in copy.engines.values()}
    if "rotor" in kinds:
        raise AdoptionError(STAGE, "a rotor carries it: the autopilot flies aircraft with wings")
    if "rocket_engine" in kinds:
        raise AdoptionError(
            STAGE,
            "a rocket drives it: it has thrust only while its tanks empty, and level flight never lasts",
        )
