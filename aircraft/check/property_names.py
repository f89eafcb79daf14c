"""References to properties that nobody makes: JSBSim loads them, and takes the process with it later."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from difflib import get_close_matches

from aircraft.airframe import AIRFRAMES, Airframe
from aircraft.check.files import Files, Finding, read_folder
from aircraft.check.rules import declared
from aircraft.jsbsim.initialisation import FdmError

_REFERENCES = {"property", "p", "input", "independentVar"}
_NUMBERS_OR_PROPERTIES = {"gain", "min", "max", "c1", "c2", "kp", "ki", "kd", "lag", "rate_limit"}


# Fingerprints of airframes that were looked at, in this process.
_resolved: set[str] = set()


class UnresolvedError(FdmError):
    """A model refers to properties that nobody makes."""

    def __init__(self, airframe: Airframe, findings: list[Finding]) -> None:
        first = findings[0]
        super().__init__(f"{airframe.folder / first.file}:{first.line}: {first.message}; {first.remedy}")
        self.findings = findings


def resolve(airframe: Airframe, exists: Callable[[str], bool]) -> None:
    """UnresolvedError for a loaded model that does not come with the package and that `unresolved` faults."""
    if airframe.folder.parent == AIRFRAMES.resolve():
        return
    mark = airframe.fingerprint()
    if mark in _resolved:
        return
    files, _ = read_folder(airframe.folder)
    if files is not None and (findings := list(unresolved(files, exists))):
        raise UnresolvedError(airframe, findings)
    _resolved.add(mark)


def unresolved(files: Files, exists: Callable[[str], bool]) -> Iterator[Finding]:
    """References to properties that neither JSBSim nor the files have.

    exists  whether the loaded model has the property
    """
    own = declared(files)
    for file, tree in files.trees.items():
        for e in tree.walk():
            name = e.text.lstrip("-").strip()
            listed = e.name in _REFERENCES or (e.name in _NUMBERS_OR_PROPERTIES and e.number() is None)
            if not name or not listed or e.children or e.number() is not None or name in own:
                continue
            if not exists(name):
                near = get_close_matches(name, sorted(own | _used(files) - {name}), 1, 0.8)
                remedy = f"did you mean {near[0]}?" if near else "correct the name, or make the property"
                yield Finding("property", "error", file, e.line, f"there is no property {name}", remedy)


def _used(files: Files) -> set[str]:
    return {e.text for tree in files.trees.values() for e in tree.walk() if e.name in _REFERENCES}
