"""Change the code in one place at a time and see whether a test notices.

    cd tests && python -m mutation                          # all files; goes on where it stopped
    cd tests && python -m mutation filters/barriers/class_k.py         # some
    cd tests && python -m mutation --seconds 120 --slow     # more tests for the survivors

Prints a table per file and writes every survivor to runs/mutants/survivors.txt.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import importlib.abc
import importlib.machinery
import math
import os
import sys
from collections import Counter
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any

# One thread: numpy's own would not survive the forks. Before numpy comes in.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import pytest
from hypothesis import Phase, settings

from mutation import child, mutants
from mutation.loop import PATIENCE, TIMES, Loop
from mutation.mutants import Mutant
from mutation.record import Outcome, Record

ROOT = Path(__file__).parents[2]
FILES = [
    *(f"filters/{name}.py" for name in (
        "model", "barriers/class_k", "barriers/range_functions", "barriers/global_minimum", "barriers/pairs",
        "barriers/rollout", "wrappers/row_margins", "wrappers/air_mass", "wrappers/pose_prediction",
        "constraints", "filter", "barriers/euclidean", "barriers/per_pair", "cbf/problem",
        "cbf/theorem_monitor", "qp/single", "qp/batch", "qp/active_set", "qp/infeasibility",
        *(f"rivals/{rival}" for rival in (
            "navigation", "collision_cone", "optimal_decay", "velocity_obstacles", "least_violation",
            "backup", "gatekeeper", "plans", "plan_programs", "receding_horizon",
        )),
    )),
    *(f"testbed/{name}.py" for name in ("claims/guarantees", "records/verdict", "claims/premises")),
    *(f"filters/{name}.py" for name in (
        "barriers/closed_form", "barriers/turn_kernel", "cbf/constraints", "cbf/collision",
    )),
    # What makes a verdict right: the border, the judge, the second opinion, provenance, trim, statistics.
    *(f"testbed/{name}.py" for name in (
        "scenario/randomness", "statistics/means", "statistics/distinct", "campaigns/distinct",
        *(f"measures/{name}" for name in (
            "extreme", "between_samples", "declared_rows", "chords", "cylinders", "declared_barrier",
            "encounter_comparison", "encounter_measures", "fence_statistics", "hdot_ledger", "lost_volumes",
            "near_misses", "progress", "roles", "run_statistics", "saturation", "solo_time", "track_error",
        )),
        *(f"rare_events/{name}" for name in ("estimate", "importance", "limit_states", "subset")),
        "claims/own_filter", "claims/judging", "claims/registry",
        "components/border/contract", "components/border/making", "components/border/others",
        "components/border/plant",
        "verification/coverage_table", "verification/passing", "verification/path_bounds",
        "verification/wording",
    )),
    *(f"aircraft/{name}.py" for name in (
        "airframes/provenance", "autopilots/freshness", "autopilots/remaking", "autopilots/stability",
        "jsbsim/shortfall", "jsbsim/engines", "jsbsim/rest", "jsbsim/steady", "jsbsim/climbs",
        "jsbsim/continuation",
    )),
]  # fmt: skip
# The tests that use these modules directly; whole flights would come too late to be chosen.
TESTS = [
    *(
        "alpha",
        "barrier",
        "barrier_vectors",
        "collision",
        "guarantees",
        "kinematic",
        "kink",
        "lags",
        "monitor",
    ),
    *("navigation", "qp", "qp_solvers", "robust", "robust_scenario", "rollout", "sensing", "step_buffer"),
    *("unicycle", "verification"),
    *("contract", "border_plant", "border_filter", "border_others", "border_making"),
    *("judging", "border", "between_samples", "blinded", "claims", "claims_signs", "parts", "session"),
    *("statistics", "registered", "passing", "path_bounds", "wording"),
    *("declared_rows", "randomness", "verification_no_steps"),
    *("verification_coverage", "verification_forged_claims", "verification_forged_tables"),
    *("campaign_file", "engines", "provenance", "stability", "trim"),
    *("continuation", "engines_held", "freshness", "placing", "pulses", "steady_flight"),
    *("measures", "rare_events", "rivals", "rivals_known", "plan_rivals"),
]
THIRD_PARTY = (
    "numpy",
    "scipy.optimize",
    "scipy.sparse",
    "pandas",
    "pyarrow.parquet",
    "pydantic",
    "daqp",
    "osqp",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("files", nargs="*", default=FILES)
    parser.add_argument("--seconds", type=float, default=20.0, help="of tests for each mutant")
    parser.add_argument("--slow", action="store_true", help="the tests marked slow, too")
    parser.add_argument("--tests", nargs="*", default=TESTS, metavar="NAME", help="tests/test_NAME.py only")
    parser.add_argument("--share", type=float, default=1.0, help="of each file's mutants, drawn at random")
    parser.add_argument(
        "--seed", type=int, default=1, help="of that draw; a larger share contains a smaller one"
    )
    parser.add_argument("--table", action="store_true", help="only what is known already")
    options = parser.parse_args()
    os.chdir(ROOT)
    paths = [f"tests/test_{name}.py" for name in options.tests]
    record = Record(ROOT / "runs" / "mutants")
    found = {f: drawn(mutants.of_file(ROOT, f), options.share, options.seed) for f in options.files}
    if not options.table:
        open_ = [m for ms in found.values() for m in ms if not record.settled(m)]
        arguments = ["--quiet", "--tb=native", "-p", "no:cacheprovider"]
        arguments += ["-m", "not soak" if options.slow else "not soak and not slow"]
        for name in THIRD_PARTY:
            importlib.import_module(name)
        settings.register_profile("mutants", database=None, derandomize=True, deadline=None,
                                  phases=(Phase.explicit, Phase.generate))  # fmt: skip
        settings.load_profile("mutants")
        loop = Loop(ROOT, FILES, [m for m in open_ if not m.is_definition], record, options.seconds)

        def work(allow: Any) -> int:
            allow(1e6)
            return int(pytest.main([*arguments, *paths], plugins=[loop]))

        # In a process of its own, for the definitions need one that has not imported the project.
        if child.run(work, PATIENCE) != 0:
            sys.exit("the tests could not be collected, or a mutant's trial failed")
        record = Record(record.folder)
        try_definitions([m for m in open_ if m.is_definition], arguments, record, options.seconds)
    report(found, record)


def drawn(every: list[Mutant], share: float, seed: int) -> list[Mutant]:
    """A share of the mutants, rounded up: those with the smallest hashes of the seed and their keys."""
    order = sorted(every, key=lambda m: hashlib.sha256(f"{seed} {m.key}".encode()).digest())
    taken = set(order[: math.ceil(share * len(every))])
    return [m for m in every if m in taken]


def try_definitions(found: list[Mutant], arguments: list[str], record: Record, seconds: float) -> None:
    """Constants and defaults: the tests that reach the file, the quickest, run from their import on."""
    for mutant in found:
        tests, of = record.quickest(mutant.file, seconds)
        if record.settled(mutant, of):
            continue

        def work(allow: Any, mutant: Mutant = mutant, tests: list[str] = tests) -> int:
            sys.meta_path.insert(0, _Changed(mutant))
            sink = os.open(os.devnull, os.O_WRONLY)
            os.dup2(sink, 1)
            os.dup2(sink, 2)
            code = int(pytest.main([*arguments, "-x", *tests]))
            # Passed, failed; 2 and 4 if a test file, or what pytest itself imports, fails at import.
            assert code in (0, 1, 2, 4), code
            return code

        result = child.run(work, 10 * PATIENCE + TIMES * seconds)
        word = result if isinstance(result, str) else "killed" if result else "survived"
        record.add(mutant, Outcome(word, "", len(tests), of))


class _Changed(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports the mutant in place of its file."""

    def __init__(self, mutant: Mutant) -> None:
        self.mutant = mutant
        self.name = mutant.file.removesuffix(".py").replace("/", ".")

    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        if name != self.name:
            return None
        return importlib.machinery.ModuleSpec(name, self, origin=str(ROOT / self.mutant.file))

    def exec_module(self, module: ModuleType) -> None:
        code: CodeType = self.mutant.code()
        module.__file__ = str(ROOT / self.mutant.file)
        exec(code, module.__dict__)


def report(found: dict[str, list[Mutant]], record: Record) -> None:
    """The table per file, and the survivors to a file."""
    print(f"{'file':32}{'mutants':>9}{'killed':>8}{'timeout':>9}{'crash':>7}{'survived':>10}{'noticed':>9}")
    total: Counter[str] = Counter()
    lines = []
    for file, ms in found.items():
        count = Counter(record.outcomes[m.key].result for m in ms if m.key in record.outcomes)
        total += count
        _row(file, count)
        for m in ms:
            if m.key in record.outcomes and record.outcomes[m.key].survived:
                tests = record.outcomes[m.key].tests
                lines.append(
                    f"{m.file}:{m.lines[0]} {m.place} ({tests} tests)\n    - {m.before}\n    + {m.after}\n"
                )
    _row("all", total)
    left = sum(map(len, found.values())) - total.total()
    if left:
        print(f"{left} not tried yet")
    survivors = record.folder / "survivors.txt"
    survivors.write_text("".join(lines), encoding="utf-8")
    print(f"survivors: {survivors.relative_to(ROOT)}")


def _row(name: str, count: Counter[str]) -> None:
    tried = count.total()
    share = f"{100 * (1 - count['survived'] / tried):.1f} %" if tried else ""
    print(
        f"{name:32}{tried:>9}{count['killed']:>8}{count['timeout']:>9}{count['crash']:>7}"
        f"{count['survived']:>10}{share:>9}"
    )


if __name__ == "__main__":
    main()
