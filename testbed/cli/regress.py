"""`testbed regress`: records how a project's vehicles fly, and checks that they fly no worse."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from testbed.cli.common import STUDY_RATES, JsonOption, PartsOption, SetOption, WorkersOption, parts_of

app = typer.Typer(no_args_is_help=True, help="Record baselines and check that nothing flies worse.")

BaselinesOption = Annotated[
    Path | None,
    typer.Option(
        "--baselines", help="folder; default tests/baselines, or [tool.testbed] baselines in pyproject.toml"
    ),
]


@app.command(
    short_help="Fly and write a baseline.",
    epilog="Examples: testbed regress record x8-head-on --scenario paper-2-turn --set lookahead_m=10;"
    ' testbed regress record x8-head-on --reason "turn gains retuned"',
)
def record(
    name: Annotated[str, typer.Argument(help="the baseline, NAME.json in the folder")],
    scenario: Annotated[
        str | None, typer.Option("--scenario", help="built-in or a TOML file; needed for a new baseline")
    ] = None,
    set_: SetOption = None,
    reason: Annotated[
        str | None, typer.Option("--reason", help="why an existing baseline may change; kept in its history")
    ] = None,
    seeds: Annotated[
        int | None, typer.Option("--seeds", help="number of seeds in a block; default 20")
    ] = None,
    blocks: Annotated[int | None, typer.Option("--blocks", help="blocks to record; default 3")] = None,
    rungs: Annotated[
        str | None,
        typer.Option("--rungs", help="rungs of the fidelity ladder; default unicycle,6-DOF"),
    ] = None,
    requirement: Annotated[
        list[str] | None,
        typer.Option(
            "--requirement",
            metavar="NAME=FORMULA",
            help="compare the robustness of a formula over run columns too; may be repeated",
        ),
    ] = None,
    parts: PartsOption = None,
    baselines: BaselinesOption = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly a scenario on unicycles and aircraft over blocks of seeds, and write the baseline.

    The filter runs at 20 Hz unless --set says otherwise. An existing baseline is flown again as it was
    recorded, with what is given here changed.
    """
    from testbed.regression.baseline import folder
    from testbed.regression.recording import record as make

    overrides = [*STUDY_RATES, *(set_ or [])] if scenario is not None else set_
    names = [r.strip() for r in rungs.split(",") if r.strip()] if rungs is not None else None
    made, path = make(
        folder(Path(), baselines), name, scenario, overrides,
        reason=reason, seeds=seeds, blocks=blocks, rungs=names, workers=workers, parts=parts_of(parts),
        requirements=_named(requirement),
    )  # fmt: skip
    if as_json:
        said = {"baseline": str(path), "blocks": made.blocks, "seeds": made.seeds, "rungs": list(made.rungs)}
        print(json.dumps(said | {"changed": made.history[-1].get("changed", [])}, indent=2))
        return
    for line in made.history[-1].get("changed", []):
        print(line)
    print(f"baseline: {path}, {made.blocks} blocks of {made.seeds} seeds on {', '.join(made.rungs)}")


def _named(texts: list[str] | None) -> dict[str, str] | None:
    """Name -> formula of `--requirement`; None where none is given, and those of an old baseline stay."""
    from testbed.errors import UserError

    if texts is None:
        return None
    found: dict[str, str] = {}
    for text in texts:
        name, equals, formula = (part.strip() for part in text.partition("="))
        if not equals or not name.replace("-", "_").isidentifier():
            raise UserError(
                f"--requirement {text}: write NAME=FORMULA, such as apart='always(distance_m > 5)'"
            )
        if name in found:
            raise UserError(f"--requirement {name}: given twice")
        found[name] = formula
    return found


@app.command(
    short_help="Fly baselines again; exit code 1 if worse.",
    epilog="Example: testbed regress check x8-head-on; exit code 0 no worse, 1 degraded, 2 cannot be checked",
)
def check(
    names: Annotated[
        list[str] | None, typer.Argument(metavar="[NAME]...", help="baselines; default all in the folder")
    ] = None,
    block: Annotated[
        int, typer.Option("--block", help="block of seeds; one beyond those recorded is fresh")
    ] = 1,
    set_: SetOption = None,
    every: Annotated[
        bool, typer.Option("--all", help="show every quantity, not only those that changed")
    ] = False,
    parts: PartsOption = None,
    baselines: BaselinesOption = None,
    workers: WorkersOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly baselines again and exit 1 if anything is significantly worse than recorded.

    A recorded block of seeds (the default) is compared run by run: equal code gives equal runs, so nothing is
    left to chance. A fresh block shows that nothing was tuned to the recorded seeds. --set tries a change.
    """
    from testbed.errors import UserError
    from testbed.regression.baseline import folder, known
    from testbed.regression.check import check as judge

    where = folder(Path(), baselines)
    chosen = names or known(where)
    if not chosen:
        raise UserError(f"no baselines in {where}; record one: testbed regress record NAME --scenario FILE")
    own = parts_of(parts)
    reports = {
        n: judge(where, n, block=block, overrides=set_ or [], workers=workers, parts=own) for n in chosen
    }
    if as_json:
        from testbed.records.checksums import plain

        print(json.dumps(plain({n: r.as_dict() for n, r in reports.items()}), indent=2))
    else:
        for report in reports.values():
            print(report.text(every))
    if any(r.degraded for r in reports.values()):
        raise typer.Exit(1)
