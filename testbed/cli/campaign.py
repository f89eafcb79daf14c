"""`testbed campaign`: flies many runs of one campaign file and reports them."""

from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from testbed.cli.common import (
    JsonOption,
    OverwriteOption,
    PartsOption,
    WorkersOption,
    named,
    show,
    show_named,
)
from testbed.errors import UserError

if TYPE_CHECKING:
    from testbed.campaigns.plan import Plan
    from testbed.campaigns.progress import Progress

app = typer.Typer(no_args_is_help=True, help="Fly many runs of one file: grids, draws, seeds.")

FileArg = Annotated[str, typer.Argument(help="a campaign that comes with the package, or a TOML file")]
FolderArg = Annotated[Path, typer.Argument(help="a campaign's folder")]
ClusterOption = Annotated[
    str | None,
    typer.Option("--cluster", metavar="ADDRESS", help="address of a Dask scheduler, tcp://HOST:8786"),
]


@app.command(
    short_help="Fly a campaign, or continue it.",
    epilog="Examples: testbed campaign run head-on-x8 --out runs/head-on --workers 2;"
    " testbed campaign run mine.toml --out runs/mine --parts my_parts.py:Cone",
)
def run(
    file: FileArg,
    out: Annotated[Path, typer.Option("--out", help="folder to write")],
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    parts: PartsOption = None,
    overwrite: OverwriteOption = False,
    as_json: JsonOption = False,
) -> None:
    """Fly a campaign; interrupted, the same command or `campaign resume` goes on with it."""
    from testbed.campaigns.runner import prepare

    _check_workers(workers, cluster)
    _fly(prepare(file, out, overwrite, named(parts)), out, workers, cluster, as_json)


@app.command(epilog="Example: testbed campaign resume runs/head-on")
def resume(
    folder: FolderArg,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    parts: PartsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Fly what is missing of a campaign that was interrupted."""
    from testbed.campaigns.runner import reopen

    _check_workers(workers, cluster)
    _fly(reopen(folder, parts=named(parts)), folder, workers, cluster, as_json)


@app.command(epilog="Example: testbed campaign status runs/head-on --json")
def status(folder: FolderArg, as_json: JsonOption = False) -> None:
    """How far a campaign is, and what its runs say so far. Reads only."""
    from testbed.campaigns.folder import is_locked, journal
    from testbed.campaigns.identity import changed_airframes
    from testbed.campaigns.progress import progress
    from testbed.campaigns.runner import reopen

    state = progress(reopen(folder, to_fly=False), journal(folder).entries)
    _report(state, folder, as_json, flying=is_locked(folder))
    if not as_json:
        for name in changed_airframes(state.plan.airframes):
            print(f"airframe {name} has changed since; these are the numbers of the earlier one")


@app.command(
    short_help="Check a campaign file; nothing is flown.",
    epilog="Example: testbed campaign check my-campaign.toml",
)
def check(file: FileArg, parts: PartsOption = None, as_json: JsonOption = False) -> None:
    """Read a campaign file, resolve every run of it, and say how many there are. Flies nothing."""
    from testbed.campaigns.bases import bases
    from testbed.campaigns.distinct import check_distinct
    from testbed.campaigns.file import load
    from testbed.campaigns.plan import expand
    from testbed.campaigns.sent_parts import OwnParts

    campaign, here = load(file)
    plan = expand(campaign, bases(campaign, here), parts=OwnParts.of(named(parts)))
    check_distinct(plan)
    if as_json:
        cells = [cell.label for cell in plan.cells]
        print(json.dumps({"campaign": campaign.name, "runs": len(plan.runs), "cells": cells}, indent=2))
        return
    each = f"{len(campaign.seed_list)} seeds"
    if campaign.encounters:
        each = f"up to {plan.longest} encounters" if len(campaign.seed_list) == 1 else f"{each} an encounter"
    print(f"{campaign.name}: {len(plan.runs)} runs, {len(plan.cells)} cells x {each}")
    for cell in plan.cells:
        print(f"  {cell.label}")


@app.command("list", epilog="Example: testbed campaign list --json")
def list_(as_json: JsonOption = False) -> None:
    """The campaigns that come with the package."""
    from testbed.campaigns.file import builtin, load

    rows = {name: load(name)[0].description for name in builtin()}
    show_named(rows, as_json)


@app.command(epilog="Example: testbed campaign schema > campaign.schema.json")
def schema() -> None:
    """The JSON Schema of campaign files."""
    from testbed.campaigns.file import Campaign

    print(json.dumps(Campaign.model_json_schema(), indent=2))


def _check_workers(workers: int | None, cluster: str | None) -> None:
    if workers is not None and cluster is not None:
        raise UserError("--workers and --cluster: the cluster has its own workers; give one of the two")


def _fly(plan: Plan, out: Path, workers: int | None, cluster: str | None, as_json: bool) -> None:
    from testbed.campaigns.executor import executor
    from testbed.campaigns.folder import journal
    from testbed.campaigns.progress import progress
    from testbed.campaigns.runner import fly_all, hint
    from testbed.campaigns.view import View
    from testbed.errors import StoppedError

    try:
        with executor(workers, cluster) as pool:
            state = fly_all(plan, out, pool, View())
    except (KeyboardInterrupt, StoppedError) as error:
        kept = progress(plan, journal(out).entries)
        print(f"interrupted; {hint(kept, out)}", file=sys.stderr)
        raise typer.Exit(128 + getattr(error, "number", signal.SIGINT)) from None
    if state.complete:
        from testbed.report.campaign_part import part
        from testbed.report.page import attach

        attach(out, out.name, part)
    _report(state, out, as_json)


def _report(state: Progress, out: Path, as_json: bool, flying: bool = False) -> None:
    from testbed.campaigns.distinct import counted
    from testbed.campaigns.flight import FLOWN
    from testbed.campaigns.summary import summary, table
    from testbed.statistics import Rate

    campaign, rows = state.plan.campaign, [e["row"] for e in state.entries.values()]
    cells = summary(state)
    if as_json:
        from testbed.records.checksums import plain

        data: dict[str, Any] = {"folder": str(out), "campaign": campaign.name, "complete": state.complete}
        data |= {"done": len(rows), "most": len(state.plan.runs), "flying": flying, "cells": cells}
        print(json.dumps(plain(data), indent=2))
        return
    from testbed.report.tables import plain_table

    show(plain_table(f"{campaign.name}: runs that lose '{campaign.guarantee}'", table(cells)))
    said = counted(sum(c["runs"] for c in cells), sum(c["distinct"] for c in cells))
    print(f"{said}; intervals of rates: {Rate.method}")
    if reasons := _reasons(row["reason"] for row in rows if row["status"] != FLOWN):
        print("not flown to the end of its verdicts:")
        for line in reasons:
            print(f"  {line}")
    if state.complete:
        print(f"tables: {out / 'runs.parquet'}; report: {out / 'report.html'}")
        return
    doing = "being flown now" if flying else f"go on with: testbed campaign resume {out}"
    print(f"{len(rows)} of {len(state.plan.runs)} runs done; {doing}")


def _reasons(reasons: Any, most: int = 5) -> list[str]:
    """Each reason once, the most frequent first."""
    from collections import Counter

    counted = Counter(reasons).most_common()
    more = [f"and {len(counted) - most} other reasons"] if len(counted) > most else []
    return [f"{n} x {reason}" for reason, n in counted[:most]] + more
