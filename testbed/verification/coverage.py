"""Lists everything in a run folder, and for each item the findings that check it, or why none does.

An item is a column ("vehicles.x_m"), a field of the manifest ("manifest.filter_steps"), of its scenario
("scenario.d_safe_m"), of a claim ("separation.value", "separation.detail.between_steps_m") or of the timing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

from testbed.claims.monitored import RECORDED
from testbed.claims.registry import CLAIMS, COMMAND_LIMITS
from testbed.errors import UserError
from testbed.scenario.relevance import idle
from testbed.scenario.scenario import parse
from testbed.verification.coverage_table import (
    DETAILS,
    FENCES,
    FIELDS,
    MANIFEST,
    PAIRS,
    SCENARIO,
    TIMING,
    VEHICLES,
    Checked,
)
from testbed.verification.finding import Finding
from testbed.verification.recorded import Recorded

REGISTERED = CLAIMS | RECORDED
SURFACE = Checked((), "no formula gives the surfaces")


@dataclass(frozen=True)
class Uncovered:
    """Something in a run folder that no finding decided, and why."""

    what: str
    why: str


def uncovered(run: Recorded, findings: Iterable[Finding]) -> list[Uncovered]:
    """The items of `run` that none of its findings decided."""
    by: dict[str, Finding] = {f.what: f for f in findings}
    left, without = [], _idle(run)
    for name in items(run):
        checked = entry(name, run)
        if checked is None:
            continue  # named by the finding "fields"
        if name in without:
            left.append(Uncovered(name, "it had no effect on this run"))
            continue
        looked = [by[what] for what in checked.by if what in by]
        if checked.needs is not None and not checked.needs(run):
            left.append(Uncovered(name, "it had no effect on this run"))
            continue
        if not any(f.agrees is not None for f in looked):
            left.append(Uncovered(name, next((f.why for f in looked if f.why), "") or checked.otherwise))
    return left


def _idle(run: Recorded) -> set[str]:
    """Fields of the scenario that another one leaves without effect."""
    try:
        return {f"scenario.{path}" for path in idle(parse(run.manifest["scenario"], keep_idle=True))}
    except UserError:  # named by the finding "scenario"
        return set()


def items(run: Recorded) -> list[str]:
    """The names of everything in the folder."""
    named = [f"vehicles.{c}" for c in run.vehicles] + [f"pairs.{c}" for c in run.pairs]
    named += [f"fences.{c}" for c in run.fences]
    named += [f"manifest.{key}" for key in run.manifest if key != "scenario"]
    named += [f"scenario.{path}" for path in leaves(run.scenario)]
    named += [f"timing.{key}" for key in run.timing]
    for e in run.entries:
        named += [f"{e['id']}.{key}" for key in e if key != "detail"]
        named += [f"{e['id']}.detail.{key}" for key in e.get("detail", {})]
    return named


def leaves(table: dict[str, Any], path: str = "") -> Iterator[str]:
    """The dotted names of the fields of nested tables."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}"


def entry(name: str, run: Recorded) -> Checked | None:
    """What checks an item; None for one that no run has."""
    place, _, rest = name.partition(".")
    if place == "vehicles":
        return VEHICLES.get(rest) or (SURFACE if rest in _surfaces(run) else None)
    tables: dict[str, Callable[[str], Checked | None]] = {
        "pairs": PAIRS.get,
        "fences": FENCES.get,
        "manifest": MANIFEST.get,
        "timing": TIMING.get,
        "scenario": partial(_scenario, run),
    }
    if place in tables:
        return tables[place](rest)
    claim = REGISTERED.get(place)
    if claim is None:
        return None
    finding = f"{claim.number} {claim.id}"
    key = rest.removeprefix("detail.")
    checked = (FIELDS if key == rest else DETAILS.get(place, {})).get(key)
    if checked is None:
        return None
    return Checked(tuple(what or finding for what in checked.by), checked.otherwise)


def _scenario(run: Recorded, path: str) -> Checked | None:
    """By the field, or by its table."""
    found = SCENARIO.get(path) or SCENARIO.get(path.partition(".")[0] + ".")
    return found.given(run) if found is not None and found.given is not None else found


def _surfaces(run: Recorded) -> set[str]:
    """Columns of an airframe's surfaces, named as angles; any column of a user's plant."""
    if "plant" in run.parts:
        return set(run.vehicles)
    limits = run.guarantees.get(COMMAND_LIMITS.id, {})
    stops = set(limits.get("detail", {}).get("share_at_stop", {}))
    flown = (
        {name for name in run.vehicles if name.endswith("_rad")}
        if run.scenario["plant"] == "jsbsim"
        else set()
    )
    return stops | flown


def required(run: Recorded) -> list[str]:
    """What every run has."""
    pairs = [f"pairs.{c}" for c, checked in PAIRS.items() if checked.always] if run.i.size else []
    pairs += [f"fences.{c}" for c in FENCES] if run.fences else []
    named = [f"vehicles.{c}" for c, checked in VEHICLES.items() if checked.always]
    named += [f"manifest.{key}" for key, checked in MANIFEST.items() if checked.always]
    return [*named, *pairs, *(f"{e['id']}.{key}" for e in run.entries for key in FIELDS)]
