"""Many runs at once: one process each, results in the order asked for, kept if the work is interrupted."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from testbed.campaigns.executor import executor
from testbed.campaigns.folder import append
from testbed.records.checksums import plain

J = TypeVar("J")
R = TypeVar("R")


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
    """Rows that outlive an interruption, in a hidden file beside `out`; gone once the block ends well.

    The block should write what it makes of the rows, too: a full disk then costs no flight.
    """
    book = Notebook(out.parent / f".{out.name}.{name}.jsonl")
    try:
        yield book
    except BaseException:
        if book.rows:
            kept = f"{len(book.rows)} finished runs are kept; the same command goes on from there"
            print(kept, file=sys.stderr)
        raise
    if book.file is not None:
        book.file.unlink(missing_ok=True)


class Notebook:
    """Finished rows by key, one JSON line each. A key says all that its row depends on.

    file  None: in memory only
    """

    def __init__(self, file: Path | None = None) -> None:
        self.file = file
        self.rows: dict[str, dict[str, Any]] = {}
        if file is not None and file.is_file():
            for line in file.read_text(encoding="utf-8").splitlines():
                # A line cut short by a crash is work to do again.
                with suppress(ValueError, KeyError, TypeError):
                    entry = json.loads(line)
                    self.rows[entry["key"]] = entry["row"]
        self._read = set(self.rows)

    def keep(self, key: str, row: dict[str, Any]) -> None:
        self.rows[key] = row = plain(row)
        if self.file is not None:
            self.file.parent.mkdir(parents=True, exist_ok=True)
            append(self.file, json.dumps({"key": key, "row": row}))

    def fly(
        self,
        work: Callable[[J], dict[str, Any]],
        jobs: Sequence[J],
        keys: Sequence[str],
        workers: int | None = None,
        said: Callable[[J, dict[str, Any]], str] = lambda job, row: str(job),
    ) -> list[dict[str, Any]]:
        """`fly_all` of jobs whose keys have no row yet, equal keys once; rows in the order of `jobs`."""
        if found := len(self._read.intersection(keys)):
            print(f"resuming: {found} of {len(set(keys))} runs found in {self.file}", file=sys.stderr)
        waiting = {key: job for key, job in zip(keys, jobs, strict=True) if key not in self.rows}
        named = {id(job): key for key, job in waiting.items()}

        def done(job: J, row: dict[str, Any]) -> str:
            self.keep(named[id(job)], row)
            return said(job, row)

        fly_all(work, list(waiting.values()), workers, done)
        return [self.rows[key] for key in keys]
