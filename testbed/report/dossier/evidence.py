"""Gathers what folders of results rest on: airframes with their assumptions, checked run folders, commit."""

from __future__ import annotations

import json
import re
import subprocess
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from testbed.errors import UserError
from testbed.report.registry import OWN, Kind, kind_of
from testbed.scenario.location import path_of
from testbed.verification.check import check
from testbed.verification.coverage import Uncovered

ROOT = Path(__file__).parent.parent.parent.parent
MANIFEST = "manifest.json"


@dataclass(frozen=True)
class Checked:
    """What the second opinion says of one run folder.

    agrees        number of findings that agree
    open          name -> why the record cannot decide it
    differs       names of findings that differ
    uncovered     everything in the folder that no finding decided
    fault         why the folder could not be checked; "" if it was
    """

    run: str
    agrees: int = 0
    open: Mapping[str, str] = field(default_factory=dict)
    differs: tuple[str, ...] = ()
    uncovered: tuple[Uncovered, ...] = ()
    fault: str = ""


def records(folder: Path, kinds: Iterable[Kind]) -> dict[str, Any]:
    """What a folder's own file says: the file by which its kind is known."""
    kind = kind_of(folder, (*kinds, *OWN))
    if kind is None:
        return {}
    found = json.loads((folder / kind.mark).read_text(encoding="utf-8"))
    return found if isinstance(found, dict) else {}


def run_folders(folder: Path) -> list[Path]:
    """The run folders in a folder of results: itself, or any below it."""
    return sorted(file.parent for file in folder.rglob(MANIFEST) if not _hidden(file.relative_to(folder)))


def marks(folder: Path, kinds: Iterable[Kind]) -> list[Path]:
    """The file by which a folder's kind is known, and the manifest of every run folder in it."""
    kind = kind_of(folder, (*kinds, *OWN))
    own = [folder / kind.mark] if kind is not None else []
    return [*own, *(f for run in run_folders(folder) if (f := run / MANIFEST) not in own)]


def _hidden(path: Path) -> bool:
    return any(part.startswith(".") for part in path.parts)


def checked(folder: Path, name: str) -> Checked:
    """The second opinion on a run folder, from its record alone."""
    try:
        found = check(folder)
    except UserError as error:
        return Checked(name, fault=str(error))
    agrees = sum(f.agrees is True for f in found.findings)
    undecided = {f.what: f.why for f in found.findings if f.agrees is None}
    differs = tuple(f.what for f in found.findings if f.agrees is False)
    return Checked(name, agrees, undecided, differs, tuple(found.uncovered))


@dataclass
class Airframe:
    """An airframe that results rest on.

    sha256  recorded when it flew
    places  names or paths by which it may be found now
    """

    sha256: str
    places: list[str]


def airframes(folders: Sequence[Path], kinds: Iterable[Kind]) -> dict[str, Airframe]:
    """Name -> airframe, of all folders.

    Raises  UserError if folders were flown with different files of one airframe
    """
    found: dict[str, Airframe] = {}
    for folder in folders:
        listed = [(folder, records(folder, kinds))]
        listed += [(run, _json(run / MANIFEST)) for run in run_folders(folder) if run != folder]
        for where, data in listed:
            s = data.get("scenario") or data.get("base") or {}
            home = str(where / s.get("airframes_folder", "")) if s.get("airframes_folder") else ""
            sources = [path_of(source, home) for source in s.get("airframes", [])]
            for name, sha in _flat(data.get("airframes") or {}):
                known = found.setdefault(name, Airframe(sha, [name]))
                known.places += [p for p in sources if p not in known.places]
                if known.sha256 != sha:
                    raise UserError(
                        f"{folder} was flown with other files of airframe {name} than the folders before it;"
                        " write a dossier of each"
                    )
    return found


def _flat(hashes: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """A campaign has them by set of airframes."""
    for name, value in hashes.items():
        if isinstance(value, Mapping):
            yield from _flat(value)
        else:
            yield name, str(value)


def _json(file: Path) -> dict[str, Any]:
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise UserError(f"{file} is damaged: {error}") from None
    return found if isinstance(found, dict) else {}


def assumptions(name: str, places: Iterable[str]) -> tuple[str, list[str]]:
    """An airframe's present SHA-256, "" if it is not there, and the assumptions that its README states."""
    from aircraft.airframe import load

    for place in places:
        with suppress(OSError, ValueError):
            airframe = load(place)
            if airframe.name == name:
                file = airframe.folder / "README.md"
                text = file.read_text(encoding="utf-8") if file.is_file() else ""
                return airframe.fingerprint(), stated(text)
    return "", []


def stated(text: str) -> list[str]:
    """The points below a heading of a Markdown text that speaks of assumptions, as plain text."""
    points: list[str] = []
    inside = False
    for line in text.splitlines():
        if line.startswith("#"):
            inside = "assumption" in line.lower()
        elif inside and line.startswith(("- ", "* ")):
            points.append(line[2:])
        elif inside and line.strip() and not line.lstrip().startswith("|") and points:
            points[-1] += " " + line.strip()
    return [re.sub(r"[*`]|\[([^]]*)\]\([^)]*\)", r"\1", point).strip() for point in points]


def commit() -> str:
    """The commit of the program that writes the dossier, and whether its files differ from it; or why not."""
    with suppress(OSError, subprocess.SubprocessError):
        found = _git("rev-parse", "HEAD")
        changed = _git("status", "--porcelain", "--untracked-files=no")
        return f"{found}{', with changes that are not committed' if changed else ''}"
    return "not known: the program does not lie in a Git repository"


def _git(*words: str) -> str:
    done = subprocess.run(
        ["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True, timeout=10
    )
    return done.stdout.strip()
