"""Compares runs: flies scenarios, or takes runs that were flown, and draws and tabulates them together."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.campaigns.display import Display
from testbed.components.components import Parts
from testbed.errors import UserError
from testbed.records.checksums import plain
from testbed.records.run import Run
from testbed.records.store import load, save, staged, write_json
from testbed.report.blocks import Part
from testbed.scenario.scenario import Scenario
from testbed.simulation.simulate import run

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

MARK = "comparison.json"


@dataclass(frozen=True)
class Comparison:
    """Runs by label, and the figures drawn of them.

    figures  the PNG files; none where no folder was given
    path     that folder
    """

    runs: dict[str, Run]
    figures: list[Path]
    path: Path | None

    def summary(self) -> dict[str, Any]:
        """What `testbed compare --json` prints."""
        folders = folder_names(self.runs)
        return {
            "runs": {name: str(self.path / folders[name]) for name in self.runs} if self.path else {},
            "guarantees": {name: plain(run.guarantees) for name, run in self.runs.items()},
            "figures": [str(f) for f in self.figures],
        }

    @property
    def scorecard(self) -> pd.DataFrame:
        """A row per claim and a pair of columns per run: its verdict and its value."""
        import pandas as pd

        each = {name: run.scorecard[["verdict", "value"]] for name, run in self.runs.items()}
        ids = dict.fromkeys(v.id for run in self.runs.values() for v in run.guarantees)
        return pd.concat(each, axis=1).reindex(list(ids))

    def panels(self) -> Figure:
        """The paper's four panels with all runs overlaid."""
        from testbed.report import figures
        from testbed.report.style import drawing

        with drawing():
            return figures.panels(self.runs)


def compare(
    runs: Mapping[str, Scenario | Run],
    out: str | Path | None = None,
    *,
    force: bool = False,
    overwrite: bool = False,
    progress: Display | None = None,
    report: bool = True,
    parts: Mapping[str, Parts] | None = None,
) -> Comparison:
    """Fly each scenario into its own run folder below `out`, and draw and tabulate all runs together.

    runs       label, for example the plant -> scenario to fly, or a run that was flown
    out        folder to write; None, for runs alone, writes none
    force      fly even from a start outside the safe set
    report     write report.html too
    parts      label -> components of your own for that run; the scenario's where there is no entry
    Raises     UserError as `simulate.run` does, before anything is flown where that can be known; where there
               is nothing to compare, or no folder for what is flown
    """
    from testbed.report import figures, page

    if not runs:
        raise UserError("nothing to compare: give at least one scenario or run, each under a label")
    for name, thing in runs.items():
        if not isinstance(name, str) or not name.strip():
            raise UserError(f"compare: a label must be text, not {name!r}")
        if not isinstance(thing, Scenario | Run):
            kind = type(thing).__name__
            raise UserError(f"compare: {name!r} is a {kind}; give a testbed.Scenario or a testbed.Run")
        if out is None and isinstance(thing, Scenario):
            raise UserError(f"compare: {name!r} is to be flown; say into which folder with out=")
    if out is None:
        return Comparison({name: r for name, r in runs.items() if isinstance(r, Run)}, [], None)
    out = Path(out)
    folders = folder_names(runs)
    with staged(out, overwrite) as folder:
        for name, thing in runs.items():
            where = folder / folders[name]
            if isinstance(thing, Run):
                where.mkdir()
                save(thing, where)
                continue
            track = progress.track(name) if progress else None
            run(thing, where, force=force, progress=track, parts=(parts or {}).get(name))
        flown = {name: load(folder / folders[name]) for name in runs}
        drawn = figures.compare(flown, folder / "figures")
        write_json(folder / MARK, {name: r.guarantees for name, r in flown.items()})
        if report:
            page.attach(folder, out.name, part)
    return Comparison(
        {name: load(out / folders[name]) for name in runs}, [out / f.relative_to(folder) for f in drawn], out
    )


def folder_names(labels: Iterable[str]) -> dict[str, str]:
    """Label -> name of its folder: plain letters, all different, and none that a comparison has otherwise."""
    names: dict[str, str] = {}
    taken = {"figures", MARK, "report.html"}
    for label in labels:
        stem = re.sub(r"[^A-Za-z0-9_.+=-]+", "-", label).strip("-.")[:80] or "run"
        name, k = stem, 2
        while name.lower() in {t.lower() for t in taken}:
            name, k = f"{stem}-{k}", k + 1
        names[label] = name
        taken.add(name)
    return names


def part(folder: Path, title: str) -> Part:
    """A comparison's part of a page."""
    from testbed.report import run_part

    folders = folder_names(json.loads((folder / MARK).read_text(encoding="utf-8")))
    return run_part.part({label: load(folder / name) for label, name in folders.items()}, folder, title)
