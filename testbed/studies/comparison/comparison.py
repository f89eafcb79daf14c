"""Flies one scenario on several plants and draws them together."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from testbed.campaigns.display import Display
from testbed.components.components import Parts
from testbed.records.checksums import plain
from testbed.records.run import Run
from testbed.records.store import load, staged, write_json
from testbed.report.blocks import Part
from testbed.scenario.scenario import Scenario
from testbed.simulation.simulate import run


@dataclass(frozen=True)
class Comparison:
    """Runs by plant, and the figures drawn of them."""

    runs: dict[str, Run]
    figures: list[Path]
    path: Path

    def summary(self) -> dict[str, Any]:
        return {
            "runs": {name: str(self.path / name) for name in self.runs},
            "guarantees": {name: plain(run.guarantees) for name, run in self.runs.items()},
            "figures": [str(f) for f in self.figures],
        }


def compare(
    scenarios: dict[str, Scenario],
    out: Path,
    *,
    force: bool = False,
    overwrite: bool = False,
    progress: Display | None = None,
    report: bool = True,
    parts: Mapping[str, Parts] | None = None,
) -> Comparison:
    """Fly each scenario into its own run folder below `out`, and draw them together.

    scenarios  label, usually the plant -> scenario
    report     write report.html too
    parts      label -> components of your own for that run; the scenario's where there is no entry
    Raises     UserError as `simulate.run` does, before anything is flown where that can be known
    """
    from testbed.report import figures, page

    with staged(out, overwrite) as folder:
        for name, s in scenarios.items():
            track = progress.track(name) if progress else None
            run(s, folder / name, force=force, progress=track, parts=(parts or {}).get(name))
        runs = {name: load(folder / name) for name in scenarios}
        drawn = figures.compare(runs, folder / "figures")
        write_json(folder / "comparison.json", {name: r.guarantees for name, r in runs.items()})
        if report:
            page.attach(folder, out.name, part)
    return Comparison(
        {name: load(out / name) for name in scenarios}, [out / f.relative_to(folder) for f in drawn], out
    )


def part(folder: Path, title: str) -> Part:
    """A comparison's part of a page."""
    from testbed.report import run_part

    labels = json.loads((folder / "comparison.json").read_text(encoding="utf-8"))
    return run_part.part({label: load(folder / label) for label in labels}, folder, title)
