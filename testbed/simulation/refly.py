"""Flies a finished run again from its manifest and compares both bit for bit.

This is no independent check, because the same code flies. It shows whether that code gives this record for
that scenario, and so decides what the record alone cannot: flown manoeuvres, a monitor's QPs, steps that
were not recorded.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from testbed.components import catalogue
from testbed.components.border.making import WORDS
from testbed.components.components import Parts
from testbed.components.installed_parts import effective
from testbed.components.versions import versions
from testbed.errors import UserError
from testbed.records.checksums import sha256
from testbed.records.run import called, option
from testbed.scenario.location import identity, placed
from testbed.scenario.scenario import is_old, parse, settled
from testbed.simulation.simulate import Progress, run
from testbed.verification.finding import Finding

Origins = dict[str, dict[str, Any]]
# Manifest fields that equal runs need not share, or that are compared by themselves.
PASSING = {"sha256", "files", "versions", "airframes", "parts"}


def refly(folder: Path, progress: Progress | None = None, parts: Parts | None = None) -> list[Finding]:
    """Fly the run in `folder` again; a finding per table and airframe, and one per claim that differs.

    parts  of the user's own, that the run flew with; without them it is not flown again
    Any difference is a finding that does not agree, whatever its cause; the packages whose versions differ
    are named with it.
    Raises  UserError if its scenario is none.
    """
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    data, where = placed(manifest["scenario"], folder), f"{folder / 'manifest.json'}: scenario"
    s = settled(data, where)[0] if is_old(data) else parse(data, where, keep_idle=True)
    try:
        own = {role: origin.to_json() for role, origin in effective(s, parts).own().items()}
    except UserError as error:
        return [Finding("flown again", "a run", "not flown", False, None, str(error))]
    if unflown := list(_parts(manifest.get("parts", {}), own, parts is not None)):
        return unflown
    try:
        found = list(_airframes(manifest, catalogue.airframe_hashes(s)))
    except UserError as error:
        return [Finding("again: airframes", "flown", "not to be read", False, None, str(error))]
    with tempfile.TemporaryDirectory() as place:
        again = Path(place) / "again"
        try:
            run(s, again, force=True, progress=progress, parts=parts)
        except UserError as error:
            return [*found, Finding("flown again", "a run", "refused", False, None, str(error))]
        found += _compared(folder, again, manifest)
    other = _other_versions(manifest.get("versions", {}), versions())
    if not other:
        return found
    return [f if f.agrees else replace(f, why="; ".join(filter(None, (f.why, other)))) for f in found]


def _parts(there: Origins, here: Origins, given: bool) -> Iterator[Finding]:
    """Why the run cannot be flown again with the parts that are given here: none where it can."""
    for role in sorted(there | here):
        said, own = there.get(role), here.get(role)
        what, name = f"flown again: {WORDS[role]}", called(said) if said else "the scenario's"
        if said is not None and own is None:
            # Without --parts nobody said that it is the same; with other parts it is a difference.
            agrees = False if given else None
            yield Finding(what, name, "not given", agrees, None, f"a part of its own; {option(said)}")
        elif said is None and own is not None:
            yield Finding(what, name, called(own), False, None, "the run flew without it; leave it out")
        elif said is not None and own is not None and _told(said) != _told(own):
            yield Finding(what, _known(said), _known(own), False, None, "it is not the part that flew")


def _told(origin: dict[str, Any]) -> dict[str, Any]:
    """What an origin says, but for the module's name, which may be that of a script."""
    return origin | {"name": str(origin["name"]).rpartition(".")[2]}


def _known(origin: dict[str, Any]) -> str:
    return f"{called(origin)} {str(origin.get('sha256'))[:12]}"


def _airframes(manifest: dict[str, Any], here: dict[str, str]) -> Iterator[Finding]:
    """The airframes' files are those that flew."""
    there = manifest.get("airframes", {})
    for name in sorted(there | here):
        said, own = (hashes.get(name, "none") for hashes in (there, here))
        why = "" if said == own else "its files are not those that flew"
        yield Finding(f"again: airframe {name}", said[:12], own[:12], said == own, None, why)


def _other_versions(there: dict[str, str], here: dict[str, str]) -> str:
    """The packages whose version differs from the one that flies here."""
    names = [name for name in sorted(there | here) if there.get(name) != here.get(name)]
    return f"flown by other versions of {', '.join(names)}" if names else ""


def _compared(old: Path, new: Path, manifest: dict[str, Any]) -> Iterator[Finding]:
    for name in sorted(path.name for path in new.glob("*.parquet")):
        same = (old / name).is_file() and sha256(old / name) == sha256(new / name)
        why = "" if same else _first_difference(old / name, new / name)
        # A table written differently may still hold the same numbers.
        yield Finding(f"again: {name}", "a table", "the same" if not why else "another", not why, None, why)
    said, flown = (
        {e["id"]: e for e in json.loads((place / "guarantees.json").read_text(encoding="utf-8"))}
        for place in (old, new)
    )
    names = list(dict.fromkeys([*flown, *said]))
    wrong = [name for name in names if said.get(name) != flown.get(name)]
    yield Finding("again: claims", f"{len(said)} claims", f"{len(names) - len(wrong)} the same", not wrong)
    for name in wrong:
        yield Finding(
            f"again: {name}", _word(said.get(name)), _word(flown.get(name)), False, None, "flown otherwise"
        )
    fresh = json.loads((new / "manifest.json").read_text(encoding="utf-8"))
    manifest, fresh = (m | {"scenario": _flown(m["scenario"])} for m in (manifest, fresh))
    odd = [k for k in sorted({*manifest, *fresh} - PASSING) if manifest.get(k) != fresh.get(k)]
    yield Finding("again: manifest", "as written", ", ".join(odd) or "as written", not odd)


def _flown(scenario: dict[str, Any]) -> dict[str, Any]:
    """A manifest's scenario as this program says it, wherever its airframes lie."""
    s = settled(scenario)[0] if is_old(scenario) else parse(scenario, keep_idle=True)
    return identity(s.model_dump(mode="json"))


def _word(entry: dict[str, Any] | None) -> str:
    if entry is None:
        return "no such claim"
    value = entry["value"]
    return entry["verdict"] if value is None else f"{value:.6g}, {entry['verdict']}"


def _first_difference(old: Path, new: Path) -> str:
    """Where two tables differ first; "" if they hold the same."""
    import pandas as pd

    try:
        a, b = pd.read_parquet(old), pd.read_parquet(new)
    except (OSError, ValueError) as error:
        return f"cannot be read: {error}"
    if list(a.columns) != list(b.columns) or len(a) != len(b):
        return f"{a.shape[0]} rows of {a.shape[1]} columns, flown again {b.shape[0]} of {b.shape[1]}"
    for name in a.columns:
        x, y = a[name].to_numpy(), b[name].to_numpy()
        numbers = x.dtype.kind == "f" and y.dtype.kind == "f"
        differ = (x != y) & ~(np.isnan(x) & np.isnan(y)) if numbers else x != y
        if np.any(differ):
            k = int(np.argmax(differ))
            return f"{name} of row {k + 1} is {x[k]}, flown again {y[k]}"
    return ""
