"""Changing a finished run as a forger would: checksums made again, so that only its numbers can tell."""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd

from testbed.verification.check import verify

Change = Callable[[pd.DataFrame], pd.DataFrame | None]


def differing(folder: Path) -> set[str]:
    """What the verification finds to differ, by the claims' ids."""
    return {f.what.split()[-1] for f in verify(folder) if f.agrees is False}


def open_(folder: Path) -> set[str]:
    """What it leaves open."""
    return {f.what.split()[-1] for f in verify(folder) if f.agrees is None}


def copied(folder: Path, target: Path) -> Path:
    shutil.copytree(folder, target)
    return target


def read(folder: Path, name: str) -> Any:
    return json.loads((folder / name).read_text(encoding="utf-8"))


def write(folder: Path, name: str, value: Any) -> None:
    (folder / name).write_text(json.dumps(value, indent=2), encoding="utf-8")


def seal(folder: Path) -> None:
    """Make the checksums fit again, the manifest's own included."""
    manifest = read(folder, "manifest.json")
    manifest["files"] = {
        name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in manifest["files"]
    }
    manifest.pop("sha256", None)
    text = json.dumps(manifest, sort_keys=True)
    write(folder, "manifest.json", manifest | {"sha256": hashlib.sha256(text.encode()).hexdigest()})


def edit_table(folder: Path, name: str, change: Change) -> None:
    table = pd.read_parquet(folder / f"{name}.parquet")
    changed = change(table)
    (table if changed is None else changed).to_parquet(folder / f"{name}.parquet", index=False)


def edit_cell(folder: Path, name: str, column: str, row: int, by: Any) -> None:
    """Add to a number, or put a word or a flag in its place."""

    def change(table: pd.DataFrame) -> None:
        old = table.loc[row, column]
        table.loc[row, column] = by if isinstance(by, str | bool) else old + by

    edit_table(folder, name, change)


def entry(folder: Path, name: str) -> dict[str, Any]:
    return dict(next(e for e in read(folder, "guarantees.json") if e["id"] == name))


def edit_entry(folder: Path, name: str, **fields: Any) -> None:
    entries = read(folder, "guarantees.json")
    next(e for e in entries if e["id"] == name).update(fields)
    write(folder, "guarantees.json", entries)


def edit_manifest(folder: Path, **fields: Any) -> None:
    write(folder, "manifest.json", read(folder, "manifest.json") | fields)
