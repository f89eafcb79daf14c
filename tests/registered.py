"""Writes the guide's tables of all claims and of what verification covers; a test compares them with today's.

    cd tests && python registered.py

Run folders carry the words of claims, and `testbed verify` compares them: a word that changes makes every
earlier run differ. What verification covers is promised in the guide.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator
from pathlib import Path

from testbed.claims import registry
from testbed.verification import coverage_table

DATA = Path(__file__).parents[1] / "docs/guide/data"
CLAIMS = DATA / "scorecard/claims.csv"
COVERAGE = DATA / "reliability/coverage.csv"


def claims() -> Iterator[tuple[str, ...]]:
    """A row per claim: what run files say of it, with a barrier in m and one in m^2; of 20 m goal radius."""
    yield "number", "id", "kind", "claim", "with intruders", "source", "quantity", "unit", "unit if squared"
    for c in registry.EVERY:
        words = c.words(20.0), c.words(20.0, intruders=True)
        yield (
            c.number,
            c.id,
            c.kind.name.lower(),
            *words,
            c.source,
            c.quantity,
            c.unit_of("root"),
            c.unit_of("squared"),
        )


def covered() -> Iterator[tuple[str, ...]]:
    """A row per item of a run folder: the findings that decide it, and the reason where none does."""
    yield "item", "decided by", "else", "in every run", "only where it had an effect"
    tables = {
        "vehicles": coverage_table.VEHICLES,
        "pairs": coverage_table.PAIRS,
        "fences": coverage_table.FENCES,
        "manifest": coverage_table.MANIFEST,
        "scenario": coverage_table.SCENARIO,
        "timing": coverage_table.TIMING,
        "a claim": coverage_table.FIELDS,
        **{f"{claim}.detail": table for claim, table in coverage_table.DETAILS.items()},
    }
    for place, table in tables.items():
        for name, checked in table.items():
            by = " or ".join(what or "the claim's own" for what in checked.by)
            yes = "yes" if checked.always else "", "yes" if checked.needs else ""
            yield f"{place}.{name}", by, checked.otherwise, *yes


def text(rows: Iterator[tuple[str, ...]]) -> str:
    """Rows as CSV."""
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


if __name__ == "__main__":
    for path, rows in ((CLAIMS, claims()), (COVERAGE, covered())):
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text(rows), encoding="utf-8")
