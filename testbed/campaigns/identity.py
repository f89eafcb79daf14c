"""Names runs by what their numbers depend on: scenario, code, packages and airframe files."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from testbed.components import catalogue
from testbed.components.versions import versions
from testbed.scenario import fleet
from testbed.scenario.location import identity, path_of
from testbed.scenario.scenario import Scenario, parse

ROOT = Path(__file__).parent.parent.parent
_OURS = r"((?:filters|aircraft|testbed)[\w.]*)"
_IMPORT = re.compile(rf"^\s*(?:from {_OURS} import (\([^)]*\)|.+)|import {_OURS})", re.MULTILINE)


def content_id(data: Any) -> str:
    """16 hex digits for anything that JSON can say, whatever the order of its keys."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def modules(start: str = "testbed.simulation.simulate") -> list[Path]:
    """The project's files that `start` can reach by imports, those inside functions included."""
    found: dict[str, Path] = {}
    todo = [start]
    while todo:
        name = todo.pop()
        # The package itself only offers names, of which a run uses none.
        if "." not in name or name in found or (file := _file(name)) is None:
            continue
        found[name] = file
        for package, names, module in _IMPORT.findall(file.read_text(encoding="utf-8")):
            todo.append(package or module)
            # `from testbed import catalogue` names a module.
            todo += [f"{package}.{n}" for n in re.findall(r"(\w+)(?: as \w+)?", names)]
    return [found[name] for name in sorted(found)]


@cache
def code_id(start: str = "testbed.simulation.simulate") -> str:
    """Of the code that a run is computed by and of the packages it stands on; drawing is not part of it."""
    digest = hashlib.sha256(json.dumps(versions(), sort_keys=True).encode())
    for file in modules(start):
        digest.update(str(file.relative_to(ROOT)).encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()[:16]


class AirframeHashes:
    """Checksums of the airframes that scenarios use, computed once for each set of airframes.

    recorded  what an earlier process computed, `known` of then; nothing is read from files where it is given
    known     JSON of what decides a scenario's airframes -> airframe -> SHA-256
    """

    def __init__(self, recorded: Mapping[str, dict[str, str]] | None = None) -> None:
        self._from_files = recorded is None
        self.known: dict[str, dict[str, str]] = dict(recorded or {})

    def of(self, s: Scenario) -> dict[str, str]:
        """Airframe -> SHA-256 of its files and gains; empty where no airframe is used."""
        decides = [s.plant, s.lags.source, s.remedy.predict_lags, s.vehicles, *fleet.named_airframes(s)]
        key = json.dumps(decides)
        if key not in self.known:
            self.known[key] = catalogue.airframe_hashes(s) if self._from_files else {}
        return self.known[key]


def changed_airframes(recorded: Mapping[str, dict[str, str]], folder: str = "") -> list[str]:
    """Names of airframes whose files or gains are no longer those of `AirframeHashes.known`, or are gone.

    folder  where relative airframes start
    """
    from aircraft.airframe import load

    now: dict[str, str] = {}
    for source in {source for key in recorded for source in json.loads(key)[4:]}:
        with suppress(OSError, ValueError):
            airframe = load(path_of(source, folder))
            now[airframe.name] = airframe.fingerprint()
    then = {name: sha for hashes in recorded.values() for name, sha in hashes.items()}
    return sorted(name for name, sha in then.items() if now.get(name) != sha)


class RunIds:
    """Names runs: runs of one name were flown by the same code and packages, from the same files.

    start  the module whose code makes a run's row
    """

    def __init__(self, start: str) -> None:
        self._code = code_id(start)
        self._hashes = AirframeHashes()
        self._known: dict[str, tuple[dict[str, Any], dict[str, str]]] = {}

    def of(self, data: str, seed: int, origins: str = "") -> str:
        """The name of a scenario (as JSON) under `seed`. Raises UserError for an airframe not there.

        origins  `SentParts.origins` of the parts that fly in it; "" for the scenario's
        """
        if data not in self._known:
            s = parse(json.loads(data))
            self._known[data] = (identity(s.model_dump(mode="json")), self._hashes.of(s))
        content, hashes = self._known[data]
        own = [json.loads(origins)] if origins else []
        return content_id([content | {"seed": seed}, self._code, hashes, *own])


def _file(name: str) -> Path | None:
    path = ROOT / Path(*name.split("."))
    for file in (path.with_suffix(".py"), path / "__init__.py"):
        if file.is_file():
            return file
    return None
