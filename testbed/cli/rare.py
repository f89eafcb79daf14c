"""`testbed rare`: estimates the probability of a rare event over a scenario's random starts."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import (
    JsonOption,
    OutOption,
    OverwriteOption,
    PartsOption,
    PlantOption,
    ScenarioArg,
    SetOption,
    WorkersOption,
    folder_name,
    parts_of,
    scenario_of,
    show_study,
)
from testbed.errors import UserError

EXAMPLES = (
    "Examples: testbed rare paper-2-turn --below distance_m=5 --set filter_dt_s=0.05 --plant lagged;"
    " testbed rare paper-2-turn --below h_m=0 --method importance --runs 1000;"
    " testbed rare paper-2-turn --below distance_m=5 --method importance --shift lateral-1=2 --spread 1.2"
)


def rare(
    scenario: ScenarioArg,
    below: Annotated[
        str | None,
        typer.Option("--below", metavar="STATISTIC=BOUND", help="the event: distance_m=5, h_m=0 ..."),
    ] = None,
    requirement: Annotated[
        str | None,
        typer.Option("--requirement", metavar="FORMULA", help="instead: the event is that it is not met"),
    ] = None,
    method: Annotated[
        str, typer.Option("--method", help="subset, importance, or plain sampling to compare with")
    ] = "subset",
    runs: Annotated[
        int | None,
        typer.Option(
            "--runs",
            help="subset: of each level, default 100; importance: from the final proposal, default 1000;"
            " plain: in all, default 1000",
        ),
    ] = None,
    repetitions: Annotated[
        int, typer.Option("--repetitions", help="subset: independent ones, from which the interval comes")
    ] = 10,
    adapting: Annotated[
        int, typer.Option("--adapting", help="importance: runs of each level of its four adaptations")
    ] = 100,
    modes: Annotated[
        int, typer.Option("--modes", help="importance: normal distributions of the adapted proposal")
    ] = 2,
    shift: Annotated[
        list[str] | None,
        typer.Option(
            "--shift",
            metavar="NUMBER=DEVIATIONS",
            help="importance: state the proposal instead: lateral-1=2 moves the mean of vehicle 1's offset by"
            " two standard deviations; may be repeated",
        ),
    ] = None,
    spread: Annotated[
        float,
        typer.Option("--spread", help="with --shift: deviation of the proposal, in those of starts"),
    ] = 1.0,
    lateral: Annotated[
        float | None, typer.Option("--lateral", help="largest offset of each start, m; default 10")
    ] = None,
    heading: Annotated[
        float | None, typer.Option("--heading", help="largest change of each first course, deg; default 5")
    ] = None,
    height: Annotated[
        float | None, typer.Option("--height", help="largest height change of each start, m; default 1")
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="seed of what is drawn")] = 1,
    plant: PlantOption = None,
    set_: SetOption = None,
    parts: PartsOption = None,
    out: OutOption = None,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Estimate how probable an event is over random starts, in far fewer runs than plain sampling.

    Offsets, courses and heights of the starts are drawn uniformly within the scenario's own perturbations,
    or --lateral, --heading and --height. Nothing else may be random. Interrupted, the same command goes on.
    """
    from testbed.records.store import check_free
    from testbed.studies.falsify.space import Space, bounds
    from testbed.studies.rare.flights import Event
    from testbed.studies.rare.study import METHODS, Plan
    from testbed.studies.rare.study import rare as estimate

    if (below is None) == (requirement is None):
        raise UserError("give the event: --below distance_m=5, or --requirement FORMULA")
    if method not in METHODS:
        raise UserError(f"--method {method}: give one of {', '.join(METHODS)}")
    event = Event.read(below) if below is not None else Event(requirement or "", 0.0)
    own = method == "importance"
    for option, given in (("--shift", shift), ("--spread", spread != 1.0)):
        if given and not own:
            raise UserError(f"{option}: belongs to --method importance")
    if spread != 1.0 and not shift:
        raise UserError("--spread: belongs to a proposal that --shift states")
    _least("--runs", runs, {"subset": 20, "importance": 100, "plain": 1}[method])
    _least("--repetitions", repetitions, 3)
    _least("--adapting", adapting, 100)
    _least("--modes", modes, 1)
    if not 0.1 <= spread <= 10:
        raise UserError(f"--spread {spread:g}: give 0.1 to 10")
    s = scenario_of(scenario, set_, None, plant)
    event.check(s)
    given_parts = parts_of(parts)
    where = out or Path("runs") / folder_name(s, given_parts, "rare", method)
    check_free(where, overwrite)
    space = Space.of(s, bounds(s, lateral, heading, height, 0.0, 0.0))
    count = runs or {"subset": 100, "importance": 1000, "plain": 1000}[method]
    plan = Plan(method, count, repetitions, adapting, modes, _shifts(shift), spread, seed)
    show_study(estimate(space, event, plan, where, workers, overwrite, given_parts), as_json)


def _least(option: str, value: int | None, least: int) -> None:
    if value is not None and value < least:
        raise UserError(f"{option} {value}: give at least {least}")


def _shifts(said: list[str] | None) -> dict[str, float]:
    found = {}
    for text in said or []:
        name, _, number = text.partition("=")
        try:
            found[name] = float(number)
            if not abs(found[name]) <= 10:
                raise ValueError
        except ValueError:
            raise UserError(f"--shift {text}: give NUMBER=DEVIATIONS, at most 10, as lateral-1=2") from None
    return found
