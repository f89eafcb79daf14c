"""What is known of mutants and tests, kept on disk so that a run goes on where the last one stopped."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutation.mutants import Mutant

# A test of another module must be this much quicker to be tried before one of the mutant's own.
FAR = 10.0
# The test files whose subject a module is, where their name is another.
DIRECT = {
    "class_k": "alpha",
    "model": "unicycle",
    "closed_form": "barrier",
    "theorem_monitor": "monitor",
    "row_margins": "robust robust_scenario",
    "air_mass": "robust",
    "pose_prediction": "robust lags",
    "range_functions": "rollout barrier",
    "global_minimum": "rollout",
    "pairs": "barrier",
    "turn_kernel": "barrier",
    "problem": "collision",
    "single": "qp qp_solvers",
    "batch": "qp_solvers qp collision",
    "active_set": "qp_solvers qp",
    "infeasibility": "qp_solvers qp",
    "constraints": "collision sensing",
    "guarantees": "guarantees scorecard",
    "premises": "guarantees scorecard",
    "verdict": "guarantees claims claims_signs",
    "randomness": "randomness",
    "means": "statistics",
    "distinct": "randomness statistics campaign_file",
    "extreme": "blinded claims_signs declared_rows",
    "declared_rows": "declared_rows border blinded",
    "own_filter": "judging",
    "judging": "judging",
    "registry": "registered",
    "contract": "contract",
    "making": "border_making",
    "others": "border_filter border_others",
    "plant": "border_plant",
    "coverage_table": "registered",
    "passing": "passing",
    "path_bounds": "path_bounds",
    "wording": "wording",
    "freshness": "provenance freshness",
    "remaking": "provenance freshness",
    "provenance": "provenance freshness",
    "stability": "stability pulses",
    "shortfall": "trim steady_flight",
    "engines": "engines engines_held",
    "rest": "placing engines trim",
    "steady": "trim engines steady_flight",
    "climbs": "trim steady_flight",
    "continuation": "trim continuation",
}


@dataclass(frozen=True)
class Outcome:
    """What became of a mutant.

    result  "killed", "timeout" or "crash", all three noticed, or "survived"
    by      the test that failed
    tests   how many were to have it
    of      which they were, and in which version: a survivor of others is tried again
    """

    result: str
    by: str
    tests: int
    of: str

    @property
    def survived(self) -> bool:
        return self.result == "survived"


class Record:
    """Outcomes by mutant, one JSON line each, the last one counts; and the lines each test reaches."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        folder.mkdir(parents=True, exist_ok=True)
        self._outcomes = folder / "outcomes.jsonl"
        self._reached = folder / "reached.json"
        self.outcomes: dict[str, Outcome] = {}
        if self._outcomes.exists():
            for line in self._outcomes.read_text(encoding="utf-8").splitlines():
                known = json.loads(line)
                key = known.pop("key")
                self.outcomes[key] = Outcome(**known)

    def settled(self, mutant: Mutant, of: str = "") -> bool:
        """Whether it was noticed, or survived the tests `of`."""
        known = self.outcomes.get(mutant.key)
        return known is not None and (not known.survived or known.of == of)

    def add(self, mutant: Mutant, outcome: Outcome) -> None:
        self.outcomes[mutant.key] = outcome
        with self._outcomes.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": mutant.key, **outcome.__dict__}) + "\n")

    def reached(self, sources: dict[str, str]) -> dict[str, Any]:
        """What is known of tests, as far as the sources they touch are still the same."""
        if not self._reached.exists():
            return {}
        known = json.loads(self._reached.read_text(encoding="utf-8"))
        return {t: seen for t, seen in known.items() if seen["sources"].items() <= sources.items()}

    def keep_reached(self, known: dict[str, Any], collected: set[str]) -> None:
        for name, seen in known.items():
            seen["collected"] = name in collected
        self._reached.write_text(json.dumps(known), encoding="utf-8")

    def quickest(self, file: str, seconds: float) -> tuple[list[str], str]:
        """The tests that reach the file, in the order of `Loop.chosen`, for `seconds`, and their version."""
        known = json.loads(self._reached.read_text(encoding="utf-8"))
        tests = [
            (seen["seconds"], t) for t, seen in known.items() if seen["passed"] and file in seen["lines"]
        ]
        spent, within = 0.0, []
        for duration, test in sorted(tests):
            spent += duration
            if spent <= seconds:
                within.append(test)
        return within, version({t: known[t] for t in within})


def version(tests: dict[str, Any]) -> str:
    """One word for a set of tests as they are now."""
    text = json.dumps(sorted((name, seen["test"]) for name, seen in tests.items()))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def weight(file: str, test: str) -> float:
    """By which a test's duration counts when the order for mutants of a file is made."""
    own = DIRECT.get(Path(file).stem, Path(file).stem).split()
    return 1.0 if Path(test.partition("::")[0]).stem.removeprefix("test_") in own else FAR
