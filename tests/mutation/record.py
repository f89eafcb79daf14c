"""What is known of mutants and tests, kept on disk so that an interrupted or repeated run goes on from there."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mutation.mutants import Mutant


@dataclass(frozen=True)
class Outcome:
    """result  "killed", "timeout", "crash" (all three noticed) or "survived"; by: the test; tests: how many had it"""

    result: str
    by: str
    tests: int

    @property
    def survived(self) -> bool:
        return self.result == "survived"


class Record:
    """Outcomes by mutant, one JSON line each, the last one counts; and the lines each test reaches.

    tests  what the tests are now: a survivor of other tests is tried again
    """

    def __init__(self, folder: Path, tests: str) -> None:
        self.folder, self.tests = folder, tests
        folder.mkdir(parents=True, exist_ok=True)
        self._outcomes = folder / "outcomes.jsonl"
        self._reached = folder / "reached.json"
        self.outcomes: dict[str, tuple[Outcome, str]] = {}
        if self._outcomes.exists():
            for line in self._outcomes.read_text(encoding="utf-8").splitlines():
                d = json.loads(line)
                self.outcomes[d["key"]] = Outcome(d["result"], d["by"], d["tests"]), d["of"]

    def settled(self, mutant: Mutant) -> bool:
        """Whether it was killed, or survived the tests as they are now."""
        known = self.outcomes.get(mutant.key)
        return known is not None and (not known[0].survived or known[1] == self.tests)

    def add(self, mutant: Mutant, outcome: Outcome) -> None:
        self.outcomes[mutant.key] = outcome, self.tests
        line = {"key": mutant.key, "of": self.tests, **outcome.__dict__}
        with self._outcomes.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")

    def reached(self, sources: dict[str, str]) -> dict[str, Any]:
        """What is known of tests, as far as the sources they touch are still the same."""
        if not self._reached.exists():
            return {}
        known = json.loads(self._reached.read_text(encoding="utf-8"))
        return {t: seen for t, seen in known.items() if seen["sources"].items() <= sources.items()}

    def keep_reached(self, known: dict[str, Any]) -> None:
        self._reached.write_text(json.dumps(known), encoding="utf-8")

    def quickest(self, file: str, seconds: float) -> list[str]:
        """The quickest tests that reach the file, of a total duration of `seconds`."""
        known = json.loads(self._reached.read_text(encoding="utf-8"))
        tests = [(seen["seconds"], t) for t, seen in known.items() if seen["passed"] and file in seen["lines"]]
        spent, within = 0.0, []
        for duration, test in sorted(tests):
            spent += duration
            if spent <= seconds:
                within.append(test)
        return within
