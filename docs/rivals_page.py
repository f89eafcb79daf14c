"""Writes the tables of docs/guide/rivals.md from docs/guide/data/rivals: settings found, and costs.

python docs/rival_settings.py && python docs/rival_costs.py && python docs/rivals_page.py
"""

from __future__ import annotations

import csv
from pathlib import Path

from testbed.components import catalogue
from testbed.statistics.rates import rate_of

GUIDE = Path(__file__).parent / "guide"
PAGE, DATA = GUIDE / "rivals.md", GUIDE / "data" / "rivals"


def rows(name: str) -> list[dict[str, str]]:
    with (DATA / f"{name}.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def settings() -> str:
    """What the search found best for each kind, with exact intervals of the share lost."""
    lines = [
        "| kind | tried | best setting | unicycles lost | X8s lost | goals missed | altered, of each |",
        "|---|---|---|---|---|---|---|",
    ]
    for kind in catalogue.FILTERS:
        if not (DATA / f"{kind}.csv").is_file():
            continue
        found = rows(kind)
        [best] = [row for row in found if row["best"] == "1"]
        n = int(best["n"])
        lost = [_lost(int(best[f"lost_{plant}"]), n) for plant in ("unicycle", "X8")]
        late = int(best["late_unicycle"]) + int(best["late_X8"])
        altered = ", ".join(f"{float(best[f'altered_{plant}']):.2f}" for plant in ("unicycle", "X8"))
        said = f"`{best['setting']}`" if best["setting"] else "nothing to set"
        lines.append(
            f"| `{kind}` | {len(found)} | {said} | {lost[0]} | {lost[1]} | {late} of {2 * n} | {altered} |"
        )
    return "\n".join(lines)


def _lost(count: int, n: int) -> str:
    r = rate_of(count, n)
    return f"{count} of {n} ({100 * r.low:.0f} to {100 * r.high:.0f} %)"


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
    """The page with its tables anew; each stands between two comments."""
    end = "<!-- end of table -->"
    for name, table in (("settings", settings()), ("costs", costs())):
        begin = f"<!-- table: {name} -->"
        before, rest = page.split(begin)
        page = f"{before}{begin}\n{table}\n{end}{rest.partition(end)[2]}"
    return page


if __name__ == "__main__":
    PAGE.write_text(written(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
