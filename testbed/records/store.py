"""Run directories: the only writer, and the reader, of run files.

A run is written under a temporary name beside its place and renamed when whole, so that a directory with
a manifest is a finished run and nothing else is. The manifest has the checksum of every file that decides
something, and its own; no file holds anything that is executed.
"""

from __future__ import annotations

import errno
import functools
import json
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.errors import UserError
from testbed.records.checksums import plain, read_json, seal, sealed, sha256
from testbed.records.locking import PathLock
from testbed.records.run import Columns, Run
from testbed.records.verdict import Verdict
from testbed.scenario.location import moved, placed

if TYPE_CHECKING:
    import pandas as pd

# Of run folders. The scenario in a manifest has a schema of its own, and older ones are read.
SCHEMA_VERSION = 1
MANIFEST, GUARANTEES, TIMING = "manifest.json", "guarantees.json", "timing.json"
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
    "overlay.json",
    "tune.json",
    "campaign.json",
    "export.json",
    "falsify.json",
    "rare.json",
    "encounters.json",
    "benchmark.json",
)


# Errors of the disk, not of the program.
WRITE_ERRORS = {
    errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EROFS, errno.EACCES, errno.EPERM, errno.EIO, errno.ESTALE,
}  # fmt: skip


@contextmanager
def staged(path: Path, overwrite: bool = False) -> Iterator[Path]:
    """A temporary folder beside `path` that becomes `path` when the block ends well, and vanishes otherwise.

    Raises UserError if `path` exists (unless `overwrite`, and then only what this program wrote is replaced),
    nothing can be written there, the disk fills, or another process is writing the same folder. Remains of
    an unfinished folder of a killed process are removed, with a message.
    """
    check_free(path, overwrite)
    made = [p for p in (path.parent, *path.parent.parents) if not p.exists()]
    partial, lock = _begin(path)
    try:
        check_free(path, overwrite)  # somebody may have finished it just before we had the lock
        yield partial
        _put(partial, path, overwrite)
    except BaseException as error:
        shutil.rmtree(partial, ignore_errors=True)
        lock.release()
        for parent in made:
            with suppress(OSError):
                parent.rmdir()
        if isinstance(error, OSError) and error.errno in WRITE_ERRORS:
            raise UserError(
                f"cannot write {path}: {os.strerror(error.errno)}; nothing is left of it"
            ) from None
        raise
    finally:
        lock.release()


def _beside(path: Path) -> tuple[Path, Path]:
    """Where `path` is written before it is whole, and where an old one waits while it is replaced."""
    return path.with_name(f".{path.name}.partial"), path.with_name(f".{path.name}.replaced")


def _begin(path: Path) -> tuple[Path, PathLock]:
    """The empty temporary folder of `path`, and its lock, which dies with the process that holds it."""
    partial, _ = _beside(path)
    lock = PathLock(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        free = lock.acquire()
        if free:
            _recover(path)
            partial.mkdir(exist_ok=True)
    except OSError as error:
        lock.release()
        raise UserError(f"cannot write below {path.parent}: {error.strerror}") from None
    if not free:
        raise UserError(f"{path} is being written by another process; give another --out")
    left = list(partial.iterdir())
    for item in left:
        shutil.rmtree(item) if item.is_dir() and not item.is_symlink() else item.unlink()
    if left:
        print(f"removed what a killed process left of {path}", file=sys.stderr, flush=True)
    return partial, lock


def _put(partial: Path, path: Path, overwrite: bool) -> None:
    """Rename the whole folder `partial` to `path`; killed in the middle, `_recover` ends it."""
    _, replaced = _beside(path)
    try:
        check_free(path, overwrite)
    except UserError:
        kept = path.with_name(f"{path.name}-{os.getpid()}")
        partial.rename(kept)
        raise UserError(f"{path} was made by somebody else meanwhile; the new one is {kept}") from None
    if path.exists():
        path.rename(replaced)
    partial.rename(path)
    shutil.rmtree(replaced, ignore_errors=True)


def _recover(path: Path) -> None:
    """End a replacement of `path` that was killed half-way."""
    partial, replaced = _beside(path)
    if not replaced.exists():
        return
    if not path.exists():
        partial.rename(path)
    shutil.rmtree(replaced, ignore_errors=True)


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
            # Few numbers repeat: looking each up in a dictionary doubles the time and lengthens the file.
            self._writers[table] = pq.ParquetWriter(
                self.folder / f"{table}.parquet",
                block.schema,
                compression="zstd",
                use_dictionary=["qp_status"],
            )
        self._writers[table].write_table(block)

    def finish(self, run: Run) -> None:
        """Close the tables and write everything else; the manifest last, it marks the run as whole."""
        for writer in self._writers.values():
            writer.close()
        write_json(self.folder / GUARANTEES, run.guarantees)
        write_json(self.folder / TIMING, sealed(run.timing))
        files = [f"{table}.parquet" for table in self._writers] + [GUARANTEES]
        sums = {"files": {name: sha256(self.folder / name) for name in sorted(files)}}
        write_json(self.folder / MANIFEST, sealed(_placed(run.manifest, self.folder) | sums))


def save(run: Run, folder: Path) -> None:
    """Write a run, kept in memory or read from elsewhere, as files into the empty `folder`."""
    writer, manifest = RunWriter(folder), {k: v for k, v in run.manifest.items() if k != "files"}
    if run.path is not None:
        manifest["scenario"] = placed(manifest["scenario"], run.path)
    for name in ("vehicles", "pairs"):
        if run.tables.get(name):
            writer.write(name, run.tables[name])
        elif f"{name}.parquet" in run.manifest.get("files", {}):
            frame = getattr(run, name)
            writer.write(name, {column: frame[column].to_numpy() for column in frame})
    writer.finish(replace(run, manifest=manifest))


def check_free(path: Path, overwrite: bool) -> None:
    """UserError unless `path` is free, or holds something this program wrote and `overwrite` is given."""
    try:
        if not path.exists():
            return
    except OSError as error:  # a name that no folder can have
        raise UserError(f"cannot write {str(path)[:80]}: {error.strerror}") from None
    if not overwrite:
        raise UserError(f"{path} exists; give another --out, or --overwrite")
    if path.is_dir() and any((path / mark).is_file() for mark in MARKS):
        return
    if path.is_dir() and not any(path.iterdir()):
        return
    raise UserError(f"{path} exists and is not a run; it is left alone, give another --out")


def _placed(manifest: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The manifest as `folder` has it: paths in its scenario start from there."""
    return manifest | {"scenario": moved(manifest["scenario"], folder)}


def write_json(path: Path, value: Any) -> None:
    path.write_text(json.dumps(plain(value), indent=2, allow_nan=False) + "\n", encoding="utf-8")


def load(path: str | Path) -> Run:
    """A finished run, its tables read when asked for.

    Raises UserError if the directory holds no finished run, a damaged one or one of another schema version.
    """
    path = Path(path)
    if not (path / MANIFEST).is_file():
        raise UserError(f"{path} holds no finished run (no {MANIFEST})")
    manifest, timing = (read_json(path / name) for name in (MANIFEST, TIMING))
    if manifest.get("schema_version") != SCHEMA_VERSION:
        raise UserError(
            f"{path} has schema version {manifest.get('schema_version')}, this program reads"
            f" {SCHEMA_VERSION}; run it again"
        )
    if "files" not in manifest:
        raise UserError(f"{path} was written by an older version, without checksums; run it again")
    for name, said in ((MANIFEST, manifest), (TIMING, timing)):
        if said.pop("sha256", None) != seal(said):
            raise UserError(f"{path / name} is damaged: it was changed after the run; run it again")
    _check(path, GUARANTEES, manifest)
    verdicts = read_verdicts(path / GUARANTEES)
    return Run(manifest, verdicts, timing, path, reader=functools.partial(table, path, manifest=manifest))


def read_verdicts(file: Path) -> list[Verdict]:
    """The verdicts in a run's guarantees.json; UserError if it holds anything else."""
    try:
        return [Verdict.from_json(entry) for entry in read_json(file, list)]
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise UserError(f"{file} holds no verdicts of this program: {error}; run it again") from None


def table(path: Path, name: str, manifest: dict[str, Any]) -> pd.DataFrame:
    """The table `name` of the run at `path`; UserError if its checksum is not the manifest's."""
    import pandas as pd

    file = f"{name}.parquet"
    _check(path, file, manifest)
    try:
        return pd.read_parquet(path / file)
    except (OSError, ValueError) as error:
        raise UserError(f"{path / file} cannot be read: {error}") from None


def _check(path: Path, name: str, manifest: dict[str, Any]) -> None:
    """UserError unless the file is byte for byte what the manifest says."""
    try:
        same = sha256(path / name) == manifest["files"].get(name)
    except OSError as error:
        raise UserError(f"{path / name} is damaged: {error.strerror}") from None
    if not same:
        raise UserError(f"{path / name} is damaged: not the file that the run wrote; run it again")
