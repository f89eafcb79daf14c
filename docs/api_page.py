"""The Python API's page of the guide, made from docstrings: python docs/api_page.py > docs/guide/api.md"""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Any

import testbed
from aircraft import airframe, plant
from filters import filter as filters_
from testbed.components import guidance
from testbed.environment import atmosphere, observation
from testbed.gym import rewards
from testbed.records import run

INTRODUCTION = """\
# The Python API

This page is written by `python docs/api_page.py`, from the docstrings.

```python
import testbed

scenario = testbed.load_scenario("paper-2-turn", ["filter_dt_s=0.05", "record_dt_s=0.05"])
run = testbed.run(scenario)
print(run.scorecard[["verdict", "value", "margin", "t_s"]])

nearest = run.pairs.loc[run.pairs.distance_m.idxmin()]
print(f"vehicles {nearest.i:.0f} and {nearest.j:.0f}: {nearest.distance_m:.2f} m at {nearest.t_s:.2f} s")

apart = run.vehicles.pivot(index="t_s", columns="vehicle", values="omega_command_radps")
```

`testbed.run(scenario, Path("runs/mine"))` writes a run folder, `testbed.load("runs/mine")` reads it back.
Equal scenarios give equal runs, so a study is a loop:

```python
settings = ["filter_dt_s=0.05", "record_dt_s=0.05", "heading_perturbation_deg=5"]
least = []
for seed in (1, 2, 3):
    perturbed = testbed.load_scenario("paper-2-turn", [*settings, f"seed={seed}"])
    least.append(testbed.run(perturbed).guarantee("separation")["value"])
```

For hundreds of runs use `testbed campaign run`: it flies them in parallel and goes on after an interruption.
Mistakes are raised as `testbed.UserError`, in one line. The fields of a scenario are in
[scenarios.md](scenarios.md).
"""
PROTOCOLS = (
    plant.Plant,
    filters_.Filter,
    guidance.Guidance,
    atmosphere.Atmosphere,
    observation.Observation,
)
FUNCTIONS = (airframe.load, airframe.copy)
TABLES = {
    "run.vehicles": run.VEHICLE_COLUMNS,
    "of it, for aircraft only": run.AIRCRAFT_COLUMNS,
    "of it, in wind only": run.WIND_COLUMNS,
    "of it, where vehicles may leave": run.LEFT_COLUMNS,
    "run.pairs": run.PAIR_COLUMNS,
    "of it, with a filter that declares a barrier only": run.DECLARED_COLUMNS,
    "run.fences, with fences only": run.FENCE_COLUMNS,
}


def markdown() -> str:
    """The whole page."""
    parts = [INTRODUCTION.strip(), "## What `testbed` names"]
    for name in testbed.__all__:
        parts += _entry(f"testbed.{name}", getattr(testbed, name))
    parts.append("## The tables")
    for title, columns in TABLES.items():
        parts += [f"### {title}", _columns(columns)]
    parts += ["## The seams", "A part of your own has these methods; see [extend.md](extend.md)."]
    for seam in (*PROTOCOLS, filters_.Decision):
        parts += _entry(f"{seam.__module__}.{seam.__name__}", seam)
    parts += ["## Rewards", "The environments of Gymnasium and PettingZoo are in [steps.md](steps.md)."]
    for thing in (rewards.Transition, rewards.progress):
        parts += _entry(f"{thing.__module__}.{thing.__name__}", thing)
    parts.append("## Airframes")
    for thing in FUNCTIONS:
        parts += _entry(f"{thing.__module__}.{thing.__name__}", thing)
    return "\n\n".join(parts) + "\n"


def _entry(name: str, thing: Any) -> Iterator[str]:
    """A heading, the signature, the docstring; of a class its public members too."""
    yield f"### `{name}`"
    if inspect.isclass(thing):
        if members := list(_members(thing)):
            yield "\n".join(["```text", *members, "```"])
    else:
        yield f"```text\n{name.rpartition('.')[2]}{_signature(thing)}\n```"
    yield from _prose(inspect.cleandoc(thing.__doc__ or ""))


def _prose(doc: str) -> Iterator[str]:
    """The first paragraph as text, the aligned rest as it stands."""
    first, _, rest = doc.partition("\n\n")
    if "  " in first:  # aligned itself
        first, rest = "", doc
    if first:
        yield " ".join(first.split())
    if rest.strip():
        yield f"```text\n{rest.strip()}\n```"


def _signature(thing: Any) -> str:
    text = str(inspect.signature(thing))
    return re.sub(r"\b(?:\w+\.)+(\w+)", r"\1", text).replace("'", "")


def _members(thing: type) -> Iterator[str]:
    """Lines of a class: methods and properties it defines itself, with their first sentence."""
    for name, member in vars(thing).items():
        if isinstance(member, property | cached_property):
            getter = member.fget if isinstance(member, property) else member.func
            if said := _sentence(getter):
                yield f".{name}  # {said}"
        elif inspect.isfunction(member) and member.__qualname__ == f"{thing.__name__}.{name}":
            said = _sentence(member)
            call = re.sub(r"\(self(, )?", "(", _signature(member))
            if name == "__call__":
                yield f"part{call}"
            elif not name.startswith("_") and (said or thing in PROTOCOLS) and name != "own":
                yield f".{name}{call}" + (f"  # {said}" if said else "")


def _sentence(member: Any) -> str:
    return " ".join((member.__doc__ or "").partition("\n\n")[0].split())


def _columns(columns: Mapping[str, tuple[str, str]]) -> str:
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    return "\n".join(
        rows + [f"| `{name}` | {unit} | {meaning} |" for name, (unit, meaning) in columns.items()]
    )


if __name__ == "__main__":
    print(markdown(), end="")
