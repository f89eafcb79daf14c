"""Finds references to properties that do not exist: JSBSim loads them, and aborts the process later."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from difflib import get_close_matches

from aircraft.airframes.files import Files, Finding
from aircraft.airframes.setup import is_property
from aircraft.airframes.xml import Element

_REFERENCES = {"property", "p", "input", "independentVar"}
MISSING = "there is no property "  # how a finding begins; the name follows
_NUMBERS_OR_PROPERTIES = {"gain", "min", "max", "c1", "c2", "kp", "ki", "kd", "lag", "rate_limit"}


def declared(files: Files) -> set[str]:
    """Properties that the files themselves make: declarations, components, functions and their outputs."""
    names = set()
    for tree in files.trees.values():
        for e in tree.walk():
            if ("value" in e.attributes and e.name == "property") or e.name == "output":
                names.add(e.text.lstrip("-"))
            if "name" in e.attributes and e.name not in ("contact", "location", "axis", "channel", "system"):
                name = e.attributes["name"]
                names |= {name, "fcs/" + name.replace(" ", "-").lower()}
    return names


def unresolved(files: Files, exists: Callable[[str], bool]) -> Iterator[Finding]:
    """References to properties that neither JSBSim nor the files have.

    exists  whether the loaded model has the property
    """
    own = declared(files)
    for file, tree in files.trees.items():
        for e in tree.walk():
            for name in _named(e):
                # An engine's functions are templates: # stands for the engine's number.
                one = name.replace("#", "0")
                if name in own or one in own or (is_property(one) and exists(one)):
                    continue
                near = get_close_matches(name, sorted(own | _used(files) - {name}), 1, 0.8)
                remedy = f"did you mean {near[0]}?" if near else "correct the name, or make the property"
                yield Finding("property", "error", file, e.line, f"{MISSING}{name}", remedy)


def _named(e: Element) -> Iterator[str]:
    """The properties that an element names: in its text, in the conditions of a test, as its value."""
    names: list[str] = []
    if e.name in ("test", "condition"):
        for words in (line.split() for line in e.text.splitlines()):
            names += [words[0], words[2]] if len(words) == 3 else []
    elif not e.children and (e.name in _REFERENCES or e.name in _NUMBERS_OR_PROPERTIES):
        names.append(e.text)
    if e.name in ("test", "default"):
        names.append(e.attributes.get("value", ""))
    yield from (name for word in names if (name := word.lstrip("-").strip()) and not _is_number(name))


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _used(files: Files) -> set[str]:
    return {e.text for tree in files.trees.values() for e in tree.walk() if e.name in _REFERENCES}
