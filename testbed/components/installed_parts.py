"""Replaces the kinds that a scenario names and the testbed has not by parts of installed packages."""

from __future__ import annotations

from dataclasses import replace

from testbed.components import named_parts
from testbed.components.components import FIELDS, Parts
from testbed.errors import UserError
from testbed.scenario.control import InstalledFilter
from testbed.scenario.guidance import InstalledGuidance
from testbed.scenario.installed import PLANTS
from testbed.scenario.scenario import Scenario


def effective(s: Scenario, parts: Parts | None = None) -> Parts:
    """The makers of a run of `s`: those given, or else the installed parts that `s` names by kind.

    Raises  UserError if the part that is installed cannot be made without arguments, or not imported
    """
    given = parts or Parts()
    said = {"plant": s.plant} if s.plant not in PLANTS else {}
    if isinstance(s.filter, InstalledFilter):
        said["filter"] = s.filter.kind
    if isinstance(s.guidance, InstalledGuidance):
        said["guidance"] = s.guidance.kind
        if several := ", ".join(str(k) for k, v in enumerate(s.vehicle, 1) if v.guidance is not None):
            said_kind = f"guidance.kind {s.guidance.kind!r}"
            raise UserError(f"{said_kind} flies all vehicles; vehicle {several} has guidance of its own")
    own = given.own() if said else {}
    found = {
        FIELDS[role]: named_parts.read([f"{role}={name}"])[0]
        for role, name in said.items()
        if FIELDS[role] not in own
    }
    return replace(given, **found) if found else given
