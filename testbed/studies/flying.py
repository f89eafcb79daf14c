"""Many runs at once: one process each, results in the order asked for, kept if the work is interrupted."""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from testbed.campaigns.executor import executor

J = TypeVar("J")
R = TypeVar("R")

ROOT = Path(__file__).parent.parent.parent
# What a run on unicycles is computed by; drawing and the command line are not part of it.
SOURCES = ("filters/*.py", "aircraft/kinematic.py", "testbed/*.py", "testbed/scenarios/*.toml")


def fly_all(
    work: Callable[[J], R],
    jobs: Sequence[J],
    workers: int | None = None,
    done: Callable[[J, R], str] = lambda job, result: str(job),
) -> list[R]:
    """`work(job)` for each job, on `workers` processes (None: one per processor; 1: in this process).

    work  a module's function: it is sent to the processes by name
    done  called in this process with each job as it ends, in any order; its answer is shown on stderr
    """
    count = min(len(jobs), workers or os.cpu_count() or 1)
    results: dict[int, R] = {}

    def take(index: int, result: R) -> None:
        results[index] = result
        line = f"{len(results)} of {len(jobs)}: {done(jobs[index], result)}"
        print(line, file=sys.stderr, flush=True)

    if count <= 1:
        for index, job in enumerate(jobs):
            take(index, work(job))
        return list(results.values())
    with executor(count) as pool:
        for outcome in pool.imap(work, jobs):
            take(outcome.index, outcome.value())
    return [results[k] for k in range(len(jobs))]


@contextmanager
def notebook(out: Path, name: str) -> Iterator[Notebook]:
    """Rows that outlive an interruption, in a hidden file beside `out`; gone once the block ends well."""
    book = Notebook(out.parent / f".{out.name}.{name}-{_fingerprint()}.jsonl")
    try:
        yield book
    except BaseException:
        print(
            f"{len(book.rows)} finished runs are kept; the same command goes on from there", file=sys.stderr
        )
        raise
    book.file.unlink(missing_ok=True)


class Notebook:
    """Finished rows by key, one JSON line each."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.rows: dict[str, dict[str, Any]] = {}
        if file.is_file():
            for line in file.read_text(encoding="utf-8").splitlines():
                # A line cut short by a crash is work to do again.
                if line.endswith("}"):
                    entry = json.loads(line)
                    self.rows[entry["key"]] = entry["row"]
            print(f"resuming: {len(self.rows)} runs found in {file}", file=sys.stderr)

    def keep(self, key: str, row: dict[str, Any]) -> None:
        self.rows[key] = row
        self.file.parent.mkdir(parents=True, exist_ok=True)
        with self.file.open("a", encoding="utf-8") as file:
            file.write(json.dumps({"key": key, "row": row}) + "\n")


def _fingerprint() -> str:
    """Of the code and the package versions a row depends on: changed code never resumes old rows."""
    from testbed.catalogue import versions

    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for file in sorted(f for pattern in SOURCES for f in ROOT.glob(pattern)):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:12]
