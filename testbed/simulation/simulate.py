"""Flies a scenario from start to end and judges it: the one loop."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from testbed.components.components import Parts
from testbed.records.run import Run
from testbed.records.store import RunWriter, load, staged
from testbed.scenario.scenario import Scenario
from testbed.simulation.session import Session, assemble

Progress = Callable[[float, float], None]


def run(
    scenario: Scenario,
    out: str | Path | None = None,
    *,
    force: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
    parts: Parts | None = None,
) -> Run:
    """Fly `scenario` and judge it.

    out        run directory to write; None keeps the tables in memory
    force      fly even from a start outside the safe set
    overwrite  replace a run that stands at `out`
    progress   called with (t, duration) in seconds, at every filter step
    parts      a plant, filter, guidance or environment of your own; None is the scenario's
    Raises     UserError for a start outside the safe set, two vehicles at one place, or bad files
    """
    if out is None:
        return _fly(assemble(scenario, parts, force=force), progress)
    out = Path(out)
    with staged(out, overwrite) as folder:
        writer = RunWriter(folder)
        writer.finish(_fly(assemble(scenario, parts, force=force, sink=writer), progress))
    return load(out)


def _fly(session: Session, progress: Progress | None) -> Run:
    """Step `session` to its end."""
    try:
        for step in session:
            if progress is not None:
                progress(step.t, session.scenario.duration_s)
        return session.judge()
    finally:
        session.close()
