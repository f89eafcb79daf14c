"""Simulates, measures and judges: scenarios, the simulation loop, verdicts, studies, reports.

import testbed

scenario = testbed.load_scenario("paper-2-turn", ["d_safe_m=8"])
run = testbed.run(scenario)
run.scorecard                      # pandas DataFrame, a row per claim
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from testbed.errors import check_packages

if TYPE_CHECKING:
    from testbed.components.components import Parts as Parts
    from testbed.errors import UserError as UserError
    from testbed.records.run import Run as Run
    from testbed.records.store import load as load
    from testbed.scenario.scenario import Scenario as Scenario
    from testbed.scenario.scenario import load as load_scenario
    from testbed.simulation.session import Session as Session
    from testbed.simulation.session import assemble as assemble
    from testbed.simulation.simulate import run as run
    from testbed.studies.comparison.comparison import compare as compare

check_packages("filters", "aircraft")

# Loaded when first asked for, so that the command line answers at once.
_HOMES = {
    "load_scenario": ("testbed.scenario.scenario", "load"),
    "Scenario": ("testbed.scenario.scenario", "Scenario"),
    "run": ("testbed.simulation.simulate", "run"),
    "compare": ("testbed.studies.comparison.comparison", "compare"),
    "load": ("testbed.records.store", "load"),
    "Run": ("testbed.records.run", "Run"),
    "Parts": ("testbed.components.components", "Parts"),
    "Session": ("testbed.simulation.session", "Session"),
    "assemble": ("testbed.simulation.session", "assemble"),
    "UserError": ("testbed.errors", "UserError"),
}

__all__ = [
    "Parts",
    "Run",
    "Scenario",
    "Session",
    "UserError",
    "assemble",
    "compare",
    "load",
    "load_scenario",
    "run",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'testbed' has no attribute {name!r}")
    from importlib import import_module

    home, there = _HOMES[name]
    return getattr(import_module(home), there)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
