"""Compares the numbers of two checkouts: built-in scenarios, a ladder, a campaign, tuning and the baselines.

    cd tests && python -m benchmarks.same_numbers produce OUT --checkout FOLDER   # once a checkout
    cd tests && python -m benchmarks.same_numbers compare BEFORE AFTER

`produce` calls the checkout's own command line, in its own environment; it takes about a quarter of an hour.
`compare` prints what moved and exits 1 if any number moved by more than 1e-12 of its size (of 1 for smaller
numbers), or if a verdict, status or other word changed. Left out: timing, hashes, versions, scenarios and the
wording of sentences; of a sentence it only compares whether there is one. A worst instant that moved to
another one just as bad is printed as a tie.
"""

from __future__ import annotations

import argparse
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.reference import difference

TOLERANCE = 1e-12
LADDER = "compare paper-2-turn --ladder --seeds 3 --set lookahead_m=10 --set duration_s=15"
TUNE = "tune x8"
SWEEP = (
    "tune rascal --sweep turn.bandwidth=0.5:2:3 --scenario paper-2-turn "
    "--set lookahead_m=10 --set duration_s=12"
)
CAMPAIGN = "head-on-x8"
# Not numbers of a flight, at any depth of a JSON document.
LEFT_OUT = {
    "airframes",
    "campaign",
    "claim",
    "command",
    "description",
    "files",
    "history",
    "id",
    "parts",
    "quantity",
    "run",
    "scenario",
    "schema_version",
    "sha256",
    "source",
    "versions",
}
# Text for people: only whether there is any is compared.
SENTENCES = {"why", "reason", "ended_early", "refused", "fault", "note"}
# Columns that put the rows of a table in the same order in both checkouts.
ORDER = ["t_s", "vehicle", "i", "j", "rung", "plant", "remedy", "seed", "turn.bandwidth_radps"]


def produce(checkout: Path, out: Path) -> int:
    """Writes everything that is compared into `out`; returns how many commands failed."""
    testbed = checkout / ".venv" / "bin" / "testbed"
    names = json.loads(_call(testbed, checkout, ["list", "--json"]).stdout)
    out.mkdir(parents=True, exist_ok=True)
    commands = {f"run-{name}": ["run", name, "--force"] for name in names}
    commands |= {"ladder": LADDER.split(), "sweep": SWEEP.split(), "campaign": ["campaign", "run", CAMPAIGN]}
    failed = 0
    for name, words in commands.items():
        where = ["--out", str(out / name), "--overwrite"]
        failed += _done(name, _call(testbed, checkout, [*words, *where]))
    done = _call(testbed, checkout, [*TUNE.split(), "--json"])
    failed += _done("tune", done)
    (out / "tune.json").write_text(done.stdout, encoding="utf-8")
    (out / "baselines").mkdir(exist_ok=True)
    for baseline in sorted((checkout / "tests" / "baselines").glob("*.json")):
        shutil.copy(baseline, out / "baselines")
        words = ["regress", "record", baseline.stem, "--reason", "flown again", "--baselines"]
        failed += _done(baseline.stem, _call(testbed, checkout, [*words, str(out / "baselines")]))
    return failed


def _call(program: Path, checkout: Path, words: list[str]) -> subprocess.CompletedProcess[str]:
    return subprocess.run([program, *words], cwd=checkout, capture_output=True, text=True, check=False)


def _done(name: str, done: subprocess.CompletedProcess[str]) -> int:
    """1 if the command broke; exit code 1 is a verdict (a lost guarantee), not a failure."""
    print(f"{name}: exit code {done.returncode}", file=sys.stderr)
    if done.returncode in (0, 1):
        return 0
    print(done.stderr[-2000:], file=sys.stderr)
    return 1


@dataclass
class Moved:
    """What differs between two files of the same name."""

    numbers: int = 0
    largest: float = 0.0
    where: str = ""
    ties: list[str] = field(default_factory=list)  # worst instants that moved to another one just as bad
    words: list[str] = field(default_factory=list)  # words, shapes and places without a number
    gone: list[str] = field(default_factory=list)
    new: list[str] = field(default_factory=list)

    @property
    def any(self) -> bool:
        return self.largest > TOLERANCE or bool(self.words or self.gone)


def compare(before: Path, after: Path) -> dict[str, Moved]:
    """One entry per compared file of `before`; what `after` lacks is gone."""
    report = {}
    for name, read in _files(before):
        there = after / name
        report[name] = (
            differ(read(before / name), read(there)) if there.exists() else Moved(gone=["the file"])
        )
    return report


def differ(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> Moved:
    moved = Moved(new=sorted(after.keys() - before.keys()))
    for key, was in before.items():
        if key not in after:
            moved.gone.append(key)
            continue
        moved.numbers += was.size
        change = difference(was, after[key])
        if change > TOLERANCE and key.endswith(".t_s") and _as_bad(key, before, after):
            moved.ties.append(key)
            continue
        if not np.isfinite(change):
            moved.words.append(key)
        elif change > moved.largest:
            moved.largest, moved.where = change, key
    return moved


def _as_bad(instant: str, before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> bool:
    """Whether the value of the verdict whose worst instant this is has stayed what it was."""
    value = instant.removesuffix(".t_s") + ".value"
    return value in before and value in after and difference(before[value], after[value]) <= TOLERANCE


def _files(folder: Path) -> Iterator[tuple[str, Callable[[Path], dict[str, np.ndarray]]]]:
    """Compared files, relative to `folder`, each with what reads its numbers."""
    readers: dict[str, Callable[[Path], dict[str, np.ndarray]]] = {
        "run-*/vehicles.parquet": table,
        "run-*/pairs.parquet": table,
        "run-*/guarantees.json": document,
        "run-*/manifest.json": document,
        "campaign/runs.parquet": table,
        "campaign/summary.json": document,
        "ladder/*.csv": table,
        "sweep/*.csv": table,
        "sweep/tune.json": document,
        "tune.json": document,
        "baselines/*.json": document,
    }
    for pattern, read in readers.items():
        for file in sorted(folder.glob(pattern)):
            yield file.relative_to(folder).as_posix(), read


def table(file: Path) -> dict[str, np.ndarray]:
    """Columns of a parquet or CSV file, rows in an order that both checkouts share."""
    frame = pd.read_parquet(file) if file.suffix == ".parquet" else pd.read_csv(file)
    order = [name for name in ORDER if name in frame]
    frame = frame.sort_values(order, kind="stable") if order else frame
    return {
        str(name): _values(str(name), values) for name, values in frame.items() if str(name) not in LEFT_OUT
    }


def _values(name: str, values: pd.Series[Any]) -> np.ndarray:
    if values.dtype.kind in "biuf":
        return values.to_numpy(dtype=float)
    words = values.fillna("").astype(str).to_numpy(dtype=str)
    return words != "" if name in SENTENCES else words


def document(file: Path) -> dict[str, np.ndarray]:
    """Numbers and words of a JSON document by their path."""
    return dict(_leaves("", json.loads(file.read_text(encoding="utf-8"))))


def _leaves(path: str, value: Any) -> Iterator[tuple[str, np.ndarray]]:
    if isinstance(value, dict):
        for key, inner in value.items():
            if key not in LEFT_OUT:
                sentence = key in SENTENCES and not isinstance(inner, int | float)
                yield from _leaves(f"{path}.{key}".strip("."), bool(inner) if sentence else inner)
    elif isinstance(value, list):
        for k, inner in enumerate(value):
            # An entry with an identity keeps it, so that a new entry before it moves nothing.
            name = inner.get("id", k) if isinstance(inner, dict) else k
            yield from _leaves(f"{path}.{name}".strip("."), inner)
    elif isinstance(value, bool | int | float):
        yield path, np.asarray(float(value))
    else:
        yield path, np.asarray("" if value is None else str(value))


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    actions = parser.add_subparsers(dest="action", required=True)
    making = actions.add_parser("produce", help="fly everything and write it into a folder")
    making.add_argument("out", type=Path)
    making.add_argument("--checkout", type=Path, default=Path(__file__).resolve().parents[2])
    comparing = actions.add_parser("compare", help="compare two such folders; exit code 1 if anything moved")
    comparing.add_argument("before", type=Path)
    comparing.add_argument("after", type=Path)
    asked = parser.parse_args()
    if asked.action == "produce":
        began = time.monotonic()
        failed = produce(asked.checkout.resolve(), asked.out.resolve())
        print(f"{time.monotonic() - began:.0f} s, {failed} commands failed", file=sys.stderr)
        return int(failed > 0)
    report = compare(asked.before, asked.after)
    for name, moved in report.items():
        print(f"{name:48} {moved.numbers:9d} values, largest change {moved.largest:.1e} {moved.where}")
        for kind in ("ties", "words", "gone", "new"):
            if found := getattr(moved, kind):
                print(f"    {kind}: {', '.join(found[:6])}{f' and {len(found) - 6} more' * (len(found) > 6)}")
    changed = [name for name, moved in report.items() if moved.any]
    print(f"{len(report)} files, {len(changed)} with changes" + f": {', '.join(changed)}" * bool(changed))
    return int(bool(changed) or not report)


if __name__ == "__main__":
    sys.exit(main())
