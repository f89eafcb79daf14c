"""Measures how often the intervals of rare-event estimates cover known probabilities, for the guide.

From the project's folder:
python docs/rare_tables.py coverage METHOD CASE PROBABILITY [REPETITIONS] [FIRST]
    adds a row to docs/guide/data/rare-coverage.csv. METHOD is importance or subset, CASE linear, passing,
    crossing or sphere, PROBABILITY for instance 1e-4. Rows of other seeds (FIRST) add up in the table.
python docs/rare_tables.py table
    prints the table of docs/guide/rare-events.md
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from testbed.rare_events import importance, subset
from testbed.rare_events.estimate import Estimate
from testbed.rare_events.limit_states import Known, crossing, linear, passing, sphere
from testbed.statistics import rate_of

FILE = Path(__file__).parent / "guide" / "data" / "rare-coverage.csv"
CASES = {"linear": linear, "passing": passing, "crossing": crossing, "sphere": sphere}
METHODS = {"importance": importance, "subset": subset}
# The first seed of the table; those of the development were below 1000.
FIRST = 20_000


def estimates(method: str, known: Known, repetitions: int, first: int = FIRST) -> list[Estimate]:
    run = METHODS[method].estimate
    return [run(known.state, known.size, np.random.default_rng(first + k)) for k in range(repetitions)]


def row(
    method: str, case: str, probability: float, repetitions: int, first: int = FIRST
) -> dict[str, object]:
    """How `repetitions` estimates did; sums, so that rows of other seeds can be added."""
    found = estimates(method, CASES[case](probability), repetitions, first)
    ratios = np.array([e.probability / probability for e in found])
    widths = np.array([np.log(e.high / max(e.low, 1e-300)) for e in found])
    return {
        "method": method,
        "case": case,
        "probability": f"{probability:g}",
        "first_seed": first,
        "repetitions": repetitions,
        "covered": sum(e.low <= probability <= e.high for e in found),
        "runs": sum(e.runs for e in found),
        "ratios": f"{ratios.sum():.6f}",
        "squares": f"{(ratios**2).sum():.6f}",
        "within_5": int((widths < np.log(5.0)).sum()),
        "doubted": sum(bool(e.doubts) for e in found),
    }


def joined(rows: Iterable[dict[str, str]]) -> list[dict[str, object]]:
    """The rows of the guide's table."""
    sums: dict[tuple[str, ...], np.ndarray] = {}
    for of in rows:
        key = of["method"], of["case"], of["probability"]
        names = ("repetitions", "covered", "runs", "ratios", "squares", "within_5", "doubted")
        sums[key] = sums.get(key, np.zeros(7)) + np.array([float(of[n]) for n in names])
    table = []
    for (method, case, text), (n, covered, runs, ratios, squares, within, doubted) in sums.items():
        p, mean = float(text), ratios / n
        deviation = np.sqrt((squares - n * mean**2) / (n - 1))
        seen = rate_of(int(covered), int(n))
        table.append(
            {
                "method": method,
                "case": case,
                "P": text,
                "n": int(n),
                "covered": f"{100 * seen.value:.1f} % ({100 * seen.low:.1f}-{100 * seen.high:.1f})",
                "mean / P": f"{mean:.3f}",
                "deviation / P": f"{deviation:.3f}",
                "runs": f"{runs / n:.0f}",
                "times fewer than plain": f"{(1 - p) / (p * deviation**2) / (runs / n):.3g}",
                "interval within 5 times": f"{100 * within / n:.0f} %",
                "doubted": f"{100 * doubted / n:.0f} %",
            }
        )
    return table


def main(words: list[str]) -> None:
    if words[:1] == ["table"]:
        with FILE.open(newline="", encoding="utf-8") as file:
            rows = joined(csv.DictReader(file))
        print("| " + " | ".join(rows[0]) + " |\n" + "|---" * len(rows[0]) + "|")
        for of in rows:
            print("| " + " | ".join(map(str, of.values())) + " |")
    elif words[:1] == ["coverage"] and len(words) >= 4 and words[1] in METHODS and words[2] in CASES:
        made = row(words[1], words[2], float(words[3]), *map(int, words[4:6] or ["500"]))
        new = not FILE.exists()
        with FILE.open("a", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(made), lineterminator="\n")
            if new:
                table.writeheader()
            table.writerow(made)
        print(made)
    else:
        sys.exit(__doc__)


if __name__ == "__main__":
    main(sys.argv[1:])
