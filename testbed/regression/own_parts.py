"""Compares the parts of the user's own that a baseline was recorded with and those that are given now."""

from __future__ import annotations

from typing import Any

from testbed.campaigns.sent_parts import Origins, origins
from testbed.components.border.making import WORDS
from testbed.components.components import Parts
from testbed.components.installed_parts import effective
from testbed.errors import UserError
from testbed.records.run import called, option
from testbed.scenario.scenario import Scenario

DIGITS = 12


def own_parts(s: Scenario, parts: Parts | None) -> Origins:
    """Role -> origin of the parts that fly in a baseline's runs.

    Raises  UserError for a plant, which the rungs set, and for a part that has no checksum
    """
    found = origins(effective(s, parts))
    if "plant" in found:
        raise UserError(f"plant {called(found['plant'])}: the rungs of a baseline have plants of their own")
    return found


def check_given(name: str, recorded: Origins, given: Origins) -> None:
    """UserError unless every role that was the user's own is given again; another part may be tried."""
    for role, origin in recorded.items():
        if role not in given:
            raise UserError(
                f"baseline {name!r} was recorded with {WORDS[role]} {called(origin)}: {option(origin)}"
            )


def changed_parts(recorded: Origins, given: Origins) -> list[str]:
    """In words, the parts that are not those recorded: another file, name or arguments."""
    said = []
    for role, origin in given.items():
        old = recorded.get(role)
        if old != origin:
            then = f"recorded with {_known(old)}" if old else "recorded without it"
            said.append(f"{WORDS[role]} {_known(origin)}: {then}")
    return said


def _known(origin: dict[str, Any]) -> str:
    return f"{called(origin)} ({origin['file']}, SHA-256 {str(origin['sha256'])[:DIGITS]})"
