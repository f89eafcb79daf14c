"""`testbed tune`: scores, sweeps or optimises an airframe's gains."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.aircraft import (
    GainsOption,
    JsonOption,
    NameArg,
    OutOption,
    OverwriteOption,
    airframe_of,
    flying,
    show_table,
)
from testbed.cli.common import WorkersOption
from testbed.errors import UserError


def tune(
    name: NameArg,
    sweep: Annotated[
        list[str] | None,
        typer.Option("--sweep", metavar="GAIN=FROM:TO:COUNT", help="factors of the gain; :abs for values"),
    ] = None,
    scenario: Annotated[
        str | None, typer.Option("--scenario", help="flown at every point of the sweep, for its guarantee")
    ] = None,
    set_: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="FIELD=VALUE", help="set a field of the scenario; may be repeated"),
    ] = None,
    optimise: Annotated[
        bool, typer.Option("--optimise", help="find gains that meet the specification")
    ] = False,
    vary: Annotated[
        list[str] | None,
        typer.Option("--vary", metavar="GAIN", help="what --optimise may change; may be repeated"),
    ] = None,
    seed: Annotated[int, typer.Option("--seed", help="seed of the first search of --optimise")] = 1,
    starts: Annotated[
        int, typer.Option("--starts", help="number of searches of --optimise, with consecutive seeds")
    ] = 2,
    evaluations: Annotated[
        int, typer.Option("--evaluations", help="largest number of scores in each search of --optimise")
    ] = 300,
    check: Annotated[
        bool, typer.Option("--check", help="exit with code 1 if a bound of the specification is missed")
    ] = False,
    gains: GainsOption = None,
    out: OutOption = None,
    workers: WorkersOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Score an airframe's gains on the step specification; sweep them, a scenario in the loop; optimise them.

    Gains are those of airframe.toml, SECTION.NAME; any unambiguous beginning will do. A sweep's range is in
    factors of the file's value, in equal ratios: 0.5:2:9 has the value itself in the middle.
    """
    from testbed.studies.tuning import optimisation, tuning

    airframe = airframe_of(name, gains)
    if scenario and not sweep:
        raise UserError("--scenario: flown at the points of a --sweep; give one")
    if check and sweep:
        raise UserError("--check: a --sweep has many sets of gains; check one with --gains FILE")
    if sweep and optimise:
        raise UserError("--sweep and --optimise: one at a time")
    said = _command(name, sweep, scenario, set_, gains)
    where = out or Path("runs") / f"{airframe.name}-tune"
    with flying(name):
        if sweep:
            from testbed.scenario.scenario import load

            s = load(scenario, [*(set_ or []), "plant=jsbsim"]) if scenario else None
            swept = [tuning.Sweep.parse(text, airframe) for text in sweep]
            found = tuning.sweep(
                airframe, name, swept, s, where, command=said, workers=workers, overwrite=overwrite
            )
        elif optimise:
            said += "".join(f" --vary {v}" for v in vary or [])
            said += f" --optimise --seed {seed} --starts {starts} --evaluations {evaluations}"
            found = optimisation.optimise(
                airframe, name, where, command=said, vary=vary or [], seed=seed, starts=starts,
                evaluations=evaluations, workers=workers, overwrite=overwrite,
            )  # fmt: skip
        else:
            found = tuning.specification(airframe, out, command=said, overwrite=overwrite)
    if as_json:
        from testbed.records.checksums import plain

        print(json.dumps(plain(found.data), indent=2))
    else:
        show_table(found.title, found.rows)
        print("\n".join(found.lines))
    if (optimise or check) and not found.met:
        raise typer.Exit(1)


TUNE_EXAMPLES = (
    "Examples: testbed tune x8;"
    " testbed tune x8 --sweep turn.bandwidth=0.5:2:9 --scenario paper-2-turn --out sweep;"
    " testbed tune rascal --optimise --out tuned; testbed tune rascal --gains tuned/gains.toml"
)


def _command(
    name: str, sweep: list[str] | None, scenario: str | None, set_: list[str] | None, gains: Path | None
) -> str:
    """The command that remakes a result: what decides its numbers, and no more."""
    import shlex

    words = ["testbed", "tune", name]
    for option, values in (("--sweep", sweep), ("--set", set_)):
        words += [w for value in values or [] for w in (option, value)]
    words += ["--scenario", scenario] if scenario else []
    words += ["--gains", str(gains)] if gains else []
    return shlex.join(words)
