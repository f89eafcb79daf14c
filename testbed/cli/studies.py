"""The commands that fly many runs: figures, remedies, margin, answer."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import (
    STUDY_RATES,
    JsonOption,
    OutOption,
    OverwriteOption,
    PlantOption,
    ScenarioArg,
    SeedsOption,
    SetOption,
    WorkersOption,
    count,
    scenario_of,
    show,
    show_study,
)
from testbed.errors import UserError

app = typer.Typer()


@app.command(short_help="The paper's figures, with errors.", epilog="Example: testbed figures --out figures")
def figures(
    out: Annotated[Path, typer.Option("--out", help="folder to write")],
    plant: Annotated[str, typer.Option("--plant", help="unicycle, lagged or jsbsim")] = "unicycle",
    kink: Annotated[bool, typer.Option("--kink", help="the kink study instead (some minutes)")] = False,
    onset: Annotated[bool, typer.Option("--onset", help="when overriding begins, instead")] = False,
    seeds: Annotated[int, typer.Option("--seeds", help="headings of the kink study")] = 20,
    workers: WorkersOption = None,
    set_: SetOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Redraw the paper's figures 2, 3 and 6, with errors at the published points; or --onset, --kink."""
    from testbed.report.tables import plain_table
    from testbed.studies.paper.paper import make

    what = [name for name, asked in (("onset", onset), ("kink", kink)) if asked] or ["paper"]
    book = make(
        out,
        what,
        plant=plant,
        overrides=set_ or [],
        seeds=seeds,
        workers=workers,
        overwrite=overwrite,
    )
    if as_json:
        from testbed.records.checksums import plain

        print(json.dumps(plain(book.summary()), indent=2))
        return
    for title, rows in book.tables.items():
        show(plain_table(title, rows))
    print(f"{len(book.files)} files in {out}")


@app.command(
    short_help="What restores the guarantee, at equal seeds.",
    epilog="Example: testbed remedies paper-2-turn --set lookahead_m=10 --seeds 50",
)
def remedies(
    scenario: ScenarioArg,
    plant: PlantOption = "jsbsim",
    set_: SetOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 20,
    first_seed: Annotated[int, typer.Option("--first-seed", help="the seed of the first run")] = 1,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="fly only this remedy; may be repeated")
    ] = None,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """What restores the guarantee: remedies compared at equal seeds."""
    from testbed.studies.remedies.study import compare

    s = scenario_of(scenario, [*STUDY_RATES, *(set_ or [])], None, plant)
    where = out or Path("runs") / f"{s.name}-remedies"
    chosen = range(first_seed, first_seed + count(seeds))
    show_study(compare(s, chosen, only or [], where, workers, overwrite), as_json)


@app.command(
    short_help="The smallest setting of a remedy that is enough.",
    epilog="Example: testbed margin paper-2-turn --knob ds_buffer --target-rate 0.01",
)
def margin(
    scenario: ScenarioArg,
    knob: Annotated[str, typer.Option("--knob", help="ds_buffer, prediction, robust, issf or derate")],
    target_rate: Annotated[
        float, typer.Option("--target-rate", help="share of runs that may lose Ds")
    ] = 0.01,
    plant: PlantOption = "jsbsim",
    set_: SetOption = None,
    out: OutOption = None,
    seeds: SeedsOption = 20,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """The smallest setting of a remedy that meets a violation rate, certified on fresh seeds."""
    from testbed.studies.margin.study import margin as find

    s = scenario_of(scenario, [*STUDY_RATES, *(set_ or [])], None, plant)
    where = out or Path("runs") / f"{s.name}-margin-{knob}"
    show_study(find(s, knob, target_rate, count(seeds), where, workers, overwrite), as_json)


@app.command(
    short_help="The central table: does the guarantee survive?",
    epilog="Example: testbed answer --airframes x8 --vehicles 2 --seeds 20",
)
def answer(
    airframes: Annotated[str, typer.Option("--airframes", help="names or folders")] = "x8,rascal",
    vehicles: Annotated[str, typer.Option("--vehicles", help="2, 20 or both")] = "2,20",
    out: OutOption = None,
    seeds: SeedsOption = 50,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Does the guarantee survive? Aircraft, numbers, weather and remedies in one table."""
    from testbed.studies.answer.answer import FLEETS
    from testbed.studies.answer.study import answer as find

    fleets = {str(n): n for n in FLEETS}
    asked = [v.strip() for v in vehicles.split(",")]
    if unknown := [v for v in asked if v not in fleets]:
        raise UserError(f"--vehicles {unknown[0]}: give 2, 20 or 2,20")
    names = [a.strip() for a in airframes.split(",") if a.strip()]
    where = out or Path("runs") / "answer"
    show_study(find(names, [fleets[v] for v in asked], count(seeds), where, workers, overwrite), as_json)
