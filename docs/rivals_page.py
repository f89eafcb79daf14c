"""Writes the table of costs in docs/guide/rivals.md from docs/guide/data/rivals.

python docs/rival_costs.py && python docs/rivals_page.py
"""

from __future__ import annotations

import csv
from pathlib import Path

GUIDE = Path(__file__).parent / "guide"
PAGE, DATA = GUIDE / "rivals.md", GUIDE / "data" / "rivals"


def rows(name: str) -> list[dict[str, str]]:
    with (DATA / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def costs() -> str:
    lines = [
        "| kind | ms, 2 vehicles | times the paper's | times the flow's |"
        " ms, 20 vehicles | times the paper's | times the flow's |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows("costs"):
        cells = (row[c] for c in ("ms_2", "ratio_2", "flow_2", "ms_20", "ratio_20", "flow_20"))
        lines.append(f"| `{row['kind']}` | " + " | ".join(cells) + " |")
    slow = [row["kind"] for row in rows("costs") if max(float(row["ratio_2"]), float(row["ratio_20"])) > 10]
    names = ", ".join(f"`{kind}`" for kind in slow)
    return "\n".join(lines) + (f"\n\nMore than ten times the paper's filter: {names}." if slow else "")


def written(page: str) -> str:
    """The page with its table anew, which stands between two comments."""
    begin, end = "<!-- table: costs -->", "<!-- end of table -->"
    before, rest = page.split(begin)
    return f"{before}{begin}\n{costs()}\n{end}{rest.partition(end)[2]}"


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
