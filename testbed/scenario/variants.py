"""Makes scenarios from one that a person wrote: for other plants, remedies, cells of a campaign.

A change of a kind leaves fields without effect behind, which are left out; a field that has no effect in any
of the scenarios made is the person's mistake and is refused.
"""

from __future__ import annotations

import copy
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from testbed.errors import Mistake, UserError
from testbed.scenario.location import placed
from testbed.scenario.overrides import assign
from testbed.scenario.relevance import said
from testbed.scenario.scenario import Scenario, homes, override, parse, read, settled, tables, without_foreign

# What the ladder and other studies choose among.
EVERY_PLANT = ("unicycle", "lagged", "jsbsim")


class Variants:
    """Scenarios made from what one person wrote, and which of its fields had no effect in any of them."""

    def __init__(self) -> None:
        self._idle: dict[str, str] = {}
        self._heard: set[str] = set()

    def add(self, data: dict[str, Any], where: str = "scenario") -> Scenario:
        """The scenario of plain data, without what has no effect; UserError as `parse` raises."""
        made, dropped = settled(data, where)
        self._idle |= dropped
        self._heard |= said(made)
        return made

    def refuse(self, where: str) -> None:
        """UserError naming a field that has no effect in any of the scenarios."""
        for path, why in self._idle.items():
            if path not in self._heard:
                raise UserError(Mistake(why, path), file=where)


def changed(s: Scenario, fields: Mapping[str, Any], where: str = "") -> Scenario:
    """`s` with fields (by dotted path) set, and without what has no effect any more."""
    data = s.model_dump(mode="json")
    for path, value in fields.items():
        assign(data, tuple(path.split(".")), copy.deepcopy(value))
    return settled(data, where or s.name)[0]


def load_each(
    source: str | Path, overrides: Sequence[str] | None, plants: Iterable[str]
) -> dict[str, Scenario]:
    """Plant -> the scenario as that plant flies it; read as `load` does."""
    return load_changed(source, overrides, {plant: {("plant",): plant} for plant in plants})


def load_changed(
    source: str | Path, overrides: Sequence[str] | None, changes: Mapping[str, Mapping[tuple[str, ...], Any]]
) -> dict[str, Scenario]:
    """Label -> the scenario with the fields set that stand under that label, by path; read as `load` does."""
    where, made = str(source), Variants()
    data = tables(read(where), where)
    asked = [override(data, item) for item in overrides or []]
    data = placed(data, *homes(where, asked))
    parse(without_foreign(data, asked)[0] | {"plant": "unicycle"}, where, keep_idle=True)
    each = {}
    for label, fields in changes.items():
        changed_data = copy.deepcopy(data)
        for path, value in fields.items():
            assign(changed_data, path, value)
        each[label] = made.add(changed_data, where)
    made.refuse(where)
    return each


def load_base(
    source: str | Path, overrides: Sequence[str] | None = None, plants: Sequence[str] = EVERY_PLANT
) -> Scenario:
    """A scenario that `changed` takes to other plants: each of its fields has an effect on one of them."""
    load_each(source, overrides, plants)
    data = tables(read(str(source)), str(source))
    asked = [override(data, item) for item in overrides or []]
    data = placed(data, *homes(str(source), asked))
    return parse(data, str(source), keep_idle=True)
