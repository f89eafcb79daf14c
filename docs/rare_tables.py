"""Measures how often the intervals of rare-event estimates cover known probabilities, for the guide.

From the project's folder: python docs/rare_tables.py coverage METHOD PROBABILITY [REPETITIONS]
adds rows to docs/guide/data/rare-coverage.csv; PROBABILITY e.g. 1e-4, METHOD importance or subset.
"""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np

from testbed.rare_events import importance, subset
from testbed.rare_events.estimate import Estimate
from testbed.rare_events.limit_states import Known, crossing, linear, passing, sphere
from testbed.statistics import rate

FILE = Path(__file__).parent / "guide" / "data" / "rare-coverage.csv"
CASES = (linear, passing, crossing, sphere)
METHODS = ("importance", "subset")
# Seeds of this table; those of the development were others.
SEEDS = 20_000


def estimate(method: str, known: Known, seed: int) -> Estimate:
    of = importance if method == "importance" else subset
    return of.estimate(known.state, known.size, np.random.default_rng(SEEDS + seed))


def row(method: str, known: Known, repetitions: int) -> dict[str, object]:
    """How `repetitions` estimates did."""
    found = [estimate(method, known, k) for k in range(repetitions)]
    covered = rate([e.low <= known.probability <= e.high for e in found])
    runs = float(np.mean([e.runs for e in found]))
    ratios = np.array([e.probability / known.probability for e in found])
    deviation = float(ratios.std(ddof=1))
    plain = (1.0 - known.probability) / (known.probability * deviation**2)
    return {
        "method": method,
        "case": known.name,
        "probability": f"{known.probability:g}",
        "repetitions": repetitions,
        "first_seed": SEEDS,
        "covered": f"{covered.value:.3f}",
        "covered_low": f"{covered.low:.3f}",
        "covered_high": f"{covered.high:.3f}",
        "mean_ratio": f"{ratios.mean():.3f}",
        "deviation": f"{deviation:.3f}",
        "runs": f"{runs:.0f}",
        "times_fewer": f"{plain / runs:.3g}",
        "width": f"{np.median([e.high / max(e.low, 1e-300) for e in found]):.2f}",
        "doubted": sum(bool(e.doubts) for e in found),
    }


def coverage(method: str, probability: float, repetitions: int) -> None:
    for make in CASES:
        made = row(method, make(probability), repetitions)
        new = not FILE.exists()
        with FILE.open("a", newline="", encoding="utf-8") as file:
            table = csv.DictWriter(file, list(made), lineterminator="\n")
            if new:
                table.writeheader()
            table.writerow(made)
        print(made, flush=True)


if __name__ == "__main__":
    what, method, probability, *rest = sys.argv[1:]
    if what != "coverage" or method not in METHODS:
        sys.exit(__doc__)
    coverage(method, float(probability), int(rest[0]) if rest else 500)
