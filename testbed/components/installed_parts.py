"""Replaces the kinds that a scenario names and the testbed has not by parts of installed packages."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from testbed.components import named_parts
from testbed.components.components import FIELDS, Parts
from testbed.scenario.installed import BUILT_IN, named
from testbed.scenario.scenario import Scenario


def effective(s: Scenario, parts: Parts | None = None) -> Parts:
    """The makers of a run of `s`: those given, or else the installed parts that `s` names by kind.

    Raises  UserError if a kind is neither the testbed's nor installed, or the part needs arguments
    """
    given = parts or Parts()
    made: dict[str, Any] = {}
    for role, name in named(s).items():
        if name not in BUILT_IN[role] and getattr(given, FIELDS[role]) == getattr(Parts, FIELDS[role]):
            made[FIELDS[role]] = named_parts.read([f"{role}={name}"])[0]
    return replace(given, **made) if made else given
