"""Run directories: the only writer, and the reader, of run files.

A run is written under a temporary name beside its place and renamed when whole, so that a directory with
a manifest is a finished run and nothing else is.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from testbed.errors import UserError
from testbed.record import Columns, Run
from testbed.scenario import SCHEMA_VERSION

MANIFEST = "manifest.json"
# What a folder written by this program holds, of which it may be replaced.
MARKS = (
    MANIFEST,
    "comparison.json",
    "figures.json",
    "ladder.json",
    "remedies.json",
    "margin.json",
    "ledger.json",
    "answer.json",
    "datasheet.json",
    "tune.json",
    "campaign.json",
    "export.json",
)


@contextmanager
def staged(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """A temporary folder beside `path` that becomes `path` when the block ends well, and vanishes otherwise.

    Raises UserError if `path` exists (unless `overwrite`, and then only what this program wrote is replaced)
    or nothing can be written there.
    """
    check_free(path, overwrite)
    partial = path.parent / f".{path.name}.partial-{os.getpid()}"
    made = [p for p in (path.parent, *path.parent.parents) if not p.exists()]
    try:
        partial.mkdir(parents=True)
    except OSError as error:
        raise UserError(f"cannot write below {path.parent}: {error.strerror}") from None
    try:
        yield partial
        if path.exists():
            shutil.rmtree(path)
        partial.rename(path)
    except BaseException:
        shutil.rmtree(partial, ignore_errors=True)
        for parent in made:
            with suppress(OSError):
                parent.rmdir()
        raise


class RunWriter:
    """A sink that writes tables into `folder` as parquet row groups; `finish` adds the rest."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._writers: dict[str, Any] = {}

    def write(self, table: str, columns: Columns) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        block = pa.table(columns)
        if table not in self._writers:
            self._writers[table] = pq.ParquetWriter(
                self.folder / f"{table}.parquet", block.schema, compression="zstd"
            )
        self._writers[table].write_table(block)

    def finish(self, run: Run) -> None:
        """Close the tables and write everything else; the manifest last, it marks the run as whole."""
        for writer in self._writers.values():
            writer.close()
        write_json(self.folder / "guarantees.json", run.guarantees)
        write_json(self.folder / "timing.json", run.timing)
        write_json(self.folder / MANIFEST, run.manifest)


def check_free(path: Path, overwrite: bool) -> None:
    """UserError unless `path` is free, or holds something this program wrote and `overwrite` is given."""
    if not path.exists():
        return
    if not overwrite:
        raise UserError(f"{path} exists; give another --out, or --overwrite")
    if path.is_dir() and any((path / mark).is_file() for mark in MARKS):
        return
    if path.is_dir() and not any(path.iterdir()):
        return
    raise UserError(f"{path} exists and is not a run; it is left alone, give another --out")


def plain(value: Any) -> Any:
    """`value` with numpy scalars and arrays as plain ones and non-finite numbers as None, for JSON."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(plain(value), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def load(path: str | Path) -> Run:
    """A finished run, its tables read when asked for.

    Raises UserError if the directory holds no finished run or one of another schema version.
    """
    path = Path(path)
    if not (path / MANIFEST).is_file():
        raise UserError(f"{path} holds no finished run (no {MANIFEST})")
    try:
        manifest, guarantees, timing = (
            json.loads((path / name).read_text(encoding="utf-8"))
            for name in (MANIFEST, "guarantees.json", "timing.json")
        )
    except (OSError, ValueError) as error:
        raise UserError(f"{path} is damaged: {error}") from None
    if manifest.get("schema_version") != SCHEMA_VERSION:
        raise UserError(
            f"{path} has schema version {manifest.get('schema_version')}, this program reads"
            f" {SCHEMA_VERSION}; run it again"
        )
    return Run(manifest, guarantees, timing, path)
