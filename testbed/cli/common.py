"""Options that commands share, and helpers that load, count and print for them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.campaigns.display import Display
    from testbed.components.components import Parts
    from testbed.components.named_parts import NamedPart
    from testbed.records.run import Run
    from testbed.scenario.scenario import Scenario
    from testbed.studies.common.found import Found

ScenarioArg = Annotated[str, typer.Argument(help="a built-in scenario (see: testbed list) or a TOML file")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="FIELD=VALUE", help="set a field of the scenario; may be repeated"),
]
OutOption = Annotated[
    Path | None, typer.Option("--out", help="folder to write; by default a folder in runs/")
]
SeedOption = Annotated[int | None, typer.Option("--seed", help="seed of all random numbers of the run")]
ForceOption = Annotated[bool, typer.Option("--force", help="fly even if the start is outside the safe set")]
OverwriteOption = Annotated[bool, typer.Option("--overwrite", help="replace an earlier run in that folder")]
JsonOption = Annotated[bool, typer.Option("--json", help="print the result as JSON")]

PartsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--parts",
        metavar="FILE.py:NAME",
        help="fly a filter, guidance, plant or environment of your own: my_parts.py:Cone, or"
        " 'my_parts.py:Cone(gain=2)'; may be repeated",
    ),
]
PlantOption = Annotated[str | None, typer.Option("--plant", help="unicycle, lagged or jsbsim")]
SeedsOption = Annotated[int, typer.Option("--seeds", help="number of runs of each setting, from seed 1")]


def _workers(asked: int | None) -> int | None:
    if asked is not None and asked < 1:
        raise UserError(f"--workers {asked}: give at least 1")
    return asked


WorkersOption = Annotated[
    int | None,
    typer.Option("--workers", help="number of processes; by default one per core", callback=_workers),
]

# Studies sample the filter as an autopilot would, 20 Hz, unless told otherwise.
STUDY_RATES = ("rates.filter_dt_s=0.05", "rates.record_dt_s=1")


def count(seeds: int) -> int:
    if seeds < 1:
        raise UserError(f"--seeds {seeds}: give at least 1")
    return seeds


def show_named(rows: Mapping[str, str], as_json: bool) -> None:
    """Names, each with a description below it, within 80 columns."""
    import textwrap

    if as_json:
        print(json.dumps(dict(rows), indent=2))
        return
    for name, description in rows.items():
        print(name)
        print(textwrap.indent(textwrap.fill(description, 76), "    "))


def show_study(found: Found, as_json: bool) -> None:
    from testbed.report.tables import plain_table

    if as_json:
        from testbed.records.checksums import plain

        print(json.dumps(plain({"folder": str(found.folder), "rows": found.rows} | found.data), indent=2))
        return
    show(plain_table(found.title, found.rows))
    for line in found.lines:
        print(line)
    print(f"tables and figures: {found.folder}")


def parts_of(texts: list[str] | None) -> Parts | None:
    """The parts that `--parts` names; None for none. UserError in one line where they cannot be had."""
    if not texts:
        return None
    from testbed.components.components import Parts

    return Parts.of(named(texts))


def named(texts: list[str] | None) -> list[NamedPart]:
    """The parts that `--parts` names, several of one role too."""
    from testbed.components.named_parts import read

    return read(texts or [])


def folder_name(s: Scenario, parts: Parts | None, *more: str) -> str:
    """The folder's name by default: the scenario, what the user's own parts are called, and more."""
    from testbed.components.installed_parts import effective

    own = effective(s, parts).own()
    return "-".join([s.name, *more, *(origin.name.rpartition(".")[2] for origin in own.values())])


ScaleOption = Annotated[
    bool,
    typer.Option(
        "--scale-to-airframe",
        help="scale speeds, lengths, times and limits to the airframes' speeds; the description says by what",
    ),
]


def scenario_of(
    source: str, overrides: list[str] | None, seed: int | None, plant: str | None, scale: bool = False
) -> Scenario:
    from testbed.scenario.scenario import load

    s = load(source, [*with_seed(overrides, seed), *([f"plant={plant}"] if plant is not None else [])])
    return to_airframes({"": s})[""] if scale else s


def to_airframes(scenarios: Mapping[str, Scenario]) -> dict[str, Scenario]:
    """The scenarios at the speeds of the airframes that the first of them flies which flies any.

    Raises  UserError where none does
    """
    from testbed.components.catalogue import airframes
    from testbed.scenario.scaling import scaled

    flying = next((s for s in scenarios.values() if s.plant != "unicycle"), None)
    if flying is None:
        raise UserError("--scale-to-airframe: a unicycle has no airframe; give --plant jsbsim or lagged")
    known = airframes(flying)
    return {label: scaled(s, known) for label, s in scenarios.items()}


def with_seed(overrides: list[str] | None, seed: int | None) -> list[str]:
    return [*(overrides or []), *([f"seed={seed}"] if seed is not None else [])]


def fly_into(s: Scenario, where: Path, force: bool, overwrite: bool, parts: Parts | None = None) -> Run:
    from testbed.simulation.simulate import run as fly

    with display() as bar:
        return fly(s, where, force=force, overwrite=overwrite, progress=bar.track(s.plant), parts=parts)


def display() -> Display:
    from testbed.campaigns.display import Display

    return Display()


def show(table: object) -> None:
    from rich.console import Console

    Console().print(table)
