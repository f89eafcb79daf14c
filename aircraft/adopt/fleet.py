"""Adopts every aircraft that comes with JSBSim and tabulates the verdicts.

    python -m aircraft.adopt.fleet FILE.json [NAME ...]

keeps each row in FILE.json as it comes; rows that are there are not flown again. `table` is Markdown.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path
from typing import Any

from aircraft.adopt.command import adopted
from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.source import stock, wheel
from aircraft.adopt.verdict import GOOD, REFUSED, Verdict

_COLUMNS = ("overshoot", "final_error", "disk_margin", "t63_omega_s", "t63_zeta_s", "t63_v_s")


def row(name: str) -> dict[str, Any]:
    """Adopt one aircraft into nowhere; what became of it, and its processor time [s]."""
    began = os.times()
    with tempfile.TemporaryDirectory() as nowhere:
        try:
            verdict = adopted(name, Path(nowhere) / "adopted")
        except AdoptionError as error:
            verdict = Verdict(REFUSED, error.stage, (error.reason.replace(f"{wheel()}/", ""),), {})
    now = os.times()
    lasted = round(now.children_user + now.children_system - began.children_user - began.children_system, 1)
    return {
        "verdict": verdict.kind,
        "stage": verdict.stage,
        "remarks": list(verdict.remarks),
        "worst": {key: round(value, 4) for key, value in verdict.worst.items()},
        "seconds": lasted,
    }


def table(rows: dict[str, dict[str, Any]]) -> str:
    """The rows as Markdown, and the counts."""
    flying = [r for r in rows.values() if r["verdict"] != REFUSED]
    good = [r for r in flying if r["verdict"] == GOOD]
    lines = [
        f"Of {len(rows)} aircraft {len(flying)} fly every step, and {len(good)} of these are good.",
        "",
        "| aircraft | verdict | overshoot [%] | final error [%] | disk margin | t63 turn, climb, speed [s]"
        " | remarks, or stage and reason |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, r in rows.items():
        w = r["worst"]
        numbers = ["", "", "", ""]
        if w:
            overshoot, error, disk, *times = (w[key] for key in _COLUMNS)
            numbers = [f"{100 * overshoot:.1f}", f"{100 * error:.1f}", f"{disk:.2f}"]
            numbers.append(", ".join(f"{t:.2f}" for t in times))
        said = "; ".join(r["remarks"]).replace("|", "/")
        said = f"{r['stage']}: {said}" if r["stage"] else said
        mark = "*" if r.get("earlier") else ""
        lines.append(f"| {name}{mark} | {r['verdict']} | {' | '.join(numbers)} | {said} |")
    return "\n".join([*lines, ""])


def main(path: Path, names: list[str]) -> None:
    """Adopt what is not in the file yet; print the table."""
    rows: dict[str, Any] = json.loads(path.read_text(encoding="utf-8")) if path.is_file() else {}
    for name in names or stock():
        if name not in rows:
            rows[name] = row(name)
            print(name, rows[name], file=sys.stderr, flush=True)
            path.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")
    print(table({name: rows[name] for name in sorted(rows, key=str.lower)}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
