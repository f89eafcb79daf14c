"""Refuses airframe folders from others that reach outside themselves, write, listen, or exhaust memory.

JSBSim itself is trusted to parse XML that has no document type; whether the model is sound is checked by
`testbed aircraft check`, in a process of its own.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from pathlib import Path

from aircraft.airframes.files import PLACES, Files, Finding, read_folder
from aircraft.airframes.schema import Airframe
from aircraft.airframes.xml import Element, RefusedError, read

MOST_FILES, MOST_BYTES = 1000, 50_000_000
# Of JSBSim's own controls a model may ask for the time; the others write files or stop the simulation.
_TIME = {"simulation/sim-time-sec", "simulation/dt", "simulation/frame", "simulation/cycle_duration"}
_PROSE = {
    "description",
    "note",
    "documentation",
    "fileheader",
    "limitation",
    "reference",
    "author",
    "license",
}
# Conditions of switches, arguments of functions, the property a table looks up.
_READS = {"test", "condition", "p", "independentVar"}
_KEEP = "keep every file below the folder"


def vet(airframe: Airframe) -> None:
    """ValueError naming file, line and remedy of the first thing that this folder may not do.

    A missing file is no danger; loading the model reports it.
    """
    found = next((f for f in dangers(airframe.folder) if f.rule != "files"), None)
    if found is not None:
        where = found.file if found.line is None else f"{found.file}:{found.line}"
        raise ValueError(f"{airframe.folder / where}: {found.message}; {found.remedy}")


def dangers(folder: Path) -> Iterator[Finding]:
    """Everything that makes a folder unsafe to load, as findings of severity error."""
    outside = list(_outside(folder))
    yield from outside
    if outside:
        return
    files, findings = read_folder(folder)
    yield from (f for f in findings if f.severity == "error")
    if files is None:
        return
    trees = dict(files.trees)
    # JSBSim looks for a file in more places than one: every XML file counts, named or not.
    for path in sorted(folder.rglob("*.xml")):
        name = path.relative_to(folder).as_posix()
        if name not in trees:
            try:
                trees[name] = read(path)
            except RefusedError as error:
                yield Finding(
                    "refused", "error", name, error.line, str(error), "correct the file, or remove it"
                )
    every = Files(files.folder, files.airframe, trees)
    yield from output(every)
    yield from _rules(every)


def output(files: Files) -> list[Finding]:
    """A model's own files and sockets; a component's <output> is something else."""
    says = {"output": "writes files wherever the program runs", "input": "opens a socket"}
    return [
        Finding("output", "error", file, e.line, f"<{name}> {what}", "remove it")
        for name, what in says.items()
        for file, e in files.elements(name)
        if e.parent is not None and e.parent.name == "fdm_config"
    ]


def _rules(files: Files) -> Iterator[Finding]:
    """What the elements of all files may not say."""
    for file, tree in files.trees.items():
        for e in tree.walk():
            for message, remedy in says(e):
                yield Finding("refused", "error", file, e.line, message, remedy)


def says(e: Element) -> Iterator[tuple[str, str]]:
    """What an element may not say, and the remedy."""
    named = e.attributes.get("file")
    if named is not None and e.name not in PLACES:
        yield f'<{e.name} file="{named}">: only systems, engines and thrusters have files', "put it inline"
    elif named is not None and ".." in re.split(r"[/\\]", named):
        # JSBSim looks below the folder before it looks where the file should lie.
        yield f"{named} is outside the folder", _KEEP
    if e.name == "output" and ({"port", "protocol", "type", "rate"} & e.attributes.keys()):
        yield "<output> writes files or to a network", "remove it"
    if e.name not in _PROSE:
        texts = [*e.attributes.values()] if _only_reads(e) else [e.text, *e.attributes.values()]
        for text in texts:
            name = "-".join(text.lower().lstrip("-").split())
            if re.search(r"simulation\s*[/\[]", name) and name not in _TIME:
                yield f"{text.strip()} controls the simulation", "remove it"


def _only_reads(e: Element) -> bool:
    """Whether the text of an element names properties that JSBSim reads, and writes to none of them."""
    if e.name in _READS:
        return True
    above = e.parent
    while above is not None and above.name != "function":
        above = above.parent
    return e.name == "property" and "value" not in e.attributes and above is not None


def _outside(folder: Path) -> Iterator[Finding]:
    """Links that lead out, special files, and more than an airframe can need."""
    count = size = 0
    root = folder.resolve()
    for at, folders, names in os.walk(root):
        for path in (Path(at) / name for name in [*folders, *names]):
            count += 1
            shown = path.relative_to(root).as_posix()
            if path.is_symlink() and not path.resolve().is_relative_to(root):
                yield Finding("refused", "error", shown, None, "is a link to outside the folder", _KEEP)
            elif not (path.is_file() or path.is_dir()):
                yield Finding("refused", "error", shown, None, "is no ordinary file", "remove it")
            elif path.is_file():
                size += path.stat().st_size
        if count > MOST_FILES or size > MOST_BYTES:
            message = f"more than {MOST_FILES} files or {MOST_BYTES / 1e6:g} MB"
            yield Finding("refused", "error", ".", None, message, "give the folder of one airframe")
            return
