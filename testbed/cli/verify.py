"""`testbed verify`: computes h and every verdict again from the recorded positions."""

from __future__ import annotations

import json
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from testbed.cli.common import JsonOption, PartsOption, display, parts_of, show
from testbed.errors import UserError

if TYPE_CHECKING:
    from rich.table import Table

    from testbed.verification.coverage import Uncovered
    from testbed.verification.finding import Finding

EXAMPLE = (
    "Examples: testbed verify runs/demo/jsbsim --fly; testbed verify runs/mine --fly --parts my_parts.py:Cone"
)
# So many names of one table are printed one by one.
FEW = 4
ANSWERS = {True: "agrees", False: "DIFFERS", None: "open"}


def verify(
    run: Annotated[Path, typer.Argument(help="a run's folder")],
    fly: Annotated[
        bool,
        typer.Option("--fly", help="fly the run again as well and compare bit for bit; decides what is open"),
    ] = False,
    parts: PartsOption = None,
    as_json: JsonOption = False,
) -> None:
    """Compute h and the verdicts of a finished run again, from its positions and by other formulas.

    Values agree within what is printed. Open means that the record cannot decide it, for example because
    steps were not recorded. Exit code 1 if anything differs or a file was changed, 2 if the folder cannot be
    read or lacks rows.
    """
    from testbed.verification.check import check

    if parts and not fly:
        raise UserError("--parts: only --fly flies parts; the record alone is checked without them")
    own = parts_of(parts)
    checked = check(run)
    findings = checked.findings
    if fly:
        from testbed.simulation.refly import refly

        with display() as bar:
            findings += refly(run, bar.track("again"), own)
    wrong, left = ([f for f in findings if f.agrees is answer] for answer in (False, None))
    if as_json:
        said = {"run": str(run), "agrees": not wrong, "open": [f.what for f in left]}
        said |= {"findings": [vars(f) for f in findings], "not_covered": [vars(u) for u in checked.uncovered]}
        print(json.dumps(said, indent=2))
    else:
        show(_table(str(run), findings))
        for line in [*_reasons(wrong, left), *_not_covered(checked.uncovered)]:
            print(textwrap.fill(line, 80, subsequent_indent="  "))
        print(_last(findings, wrong, left, fly))
    if wrong:
        raise typer.Exit(1)


def _table(title: str, findings: list[Finding]) -> Table:
    """What the run states and what we compute, within 80 columns."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title), title_justify="left", pad_edge=False, padding=(0, 1), box=None)
    for name in ("", "recorded", "computed", "within", "result"):
        table.add_column(name, overflow="fold", no_wrap=name in ("", "within", "result"))
    for f in findings:
        within = "-" if f.within is None else f"{f.within:.2g}"
        # Long names break at a dash.
        what = f.what.replace("monitor-", "").replace("_limited", "-limited")
        table.add_row(*map(Text, (what, f.said, f.own, within, ANSWERS[f.agrees])))
    return table


def _reasons(wrong: list[Finding], left: list[Finding]) -> list[str]:
    """A line for each finding that differs; findings that are open, grouped by reason."""
    lines = [f"{f.what} differs: {f.why or f.own}" for f in wrong]
    for why in dict.fromkeys(f.why for f in left):
        names = [f.what for f in left if f.why == why]
        lines.append(f"open: {', '.join(names)}: {why}")
    return lines


def _not_covered(uncovered: list[Uncovered]) -> list[str]:
    """Everything in the folder that nothing was compared with, by reason."""
    lines = []
    for why in dict.fromkeys(u.why for u in uncovered):
        names = [u.what for u in uncovered if u.why == why]
        lines.append(f"not covered: {', '.join(_short(names))}: {why}")
    return lines


def _short(names: list[str]) -> list[str]:
    """Names of one table in one, where there are many; the same field of many claims too."""
    tables: dict[str, list[str]] = {}
    for name in names:
        table, _, field = name.rpartition(".")
        tables.setdefault(f"{field} of every claim" if field == "why" else table, []).append(name)
    short = []
    for table, members in tables.items():
        if table.endswith("of every claim"):
            short.append(table)
        else:
            short += members if len(members) <= FEW else [f"{table}.* ({len(members)})"]
    return short


def _last(findings: list[Finding], wrong: list[Finding], left: list[Finding], fly: bool) -> str:
    if wrong:
        again = [f.what.removeprefix("again: ") for f in wrong if f.what.startswith(("again", "flown again"))]
        words, names = ("flown otherwise", again) if again else ("differs", [f.what for f in wrong])
        return textwrap.fill(f"{words}: {', '.join(names)}", 80, subsequent_indent="  ")
    agreed = f"{len(findings) - len(left)} of {len(findings)} verdicts and columns reproduced"
    if not left:
        return agreed
    if fly and any(f.what.startswith("flown again") for f in left):
        return f"{agreed};\n  not flown again, {len(left)} are open: see above"
    if fly:
        return f"{agreed}; flown again, all is the same"
    return f"{agreed};\n  {len(left)} cannot be derived from this record (--fly flies the run again)"
