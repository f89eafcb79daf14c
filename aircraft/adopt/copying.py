"""Copies a model into a folder of its own and makes it safe to load: what was left out or added is said."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from aircraft.adopt.failures import AdoptionError
from aircraft.adopt.flightgear import use_jsbsims_own
from aircraft.adopt.source import STAGE, Source, parse
from aircraft.airframes.safety import says
from aircraft.airframes.xml import Element, write

_LEFT_OUT = {
    "output": "it writes files",
    "input": "it opens a socket",
    "script": "it flies the aircraft",
    "autopilot": "the testbed's takes its place",
    "fileheader": "",  # of prose only the author and the licence are kept, in the README
}
_ENGINE_FILES = ("engine", "thruster")
_COMMAND = re.compile(r"fcs/(elevator|aileron|rudder|throttle)-cmd-norm(\[\d+\])?")
_DECLARED = "declared"
_AUTOPILOT = re.compile(r"(?<![\w./-])(-?/?)ap/")
_OWN_AUTOPILOT = "model-ap/"


@dataclass
class Copy:
    """The files of a model, by their place in the new folder, and what to say about them."""

    name: str
    model: Element
    systems: dict[str, Element] = field(default_factory=dict)
    engines: dict[str, Element] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    about: dict[str, str] = field(default_factory=dict)  # author, licence, description
    declared: dict[str, float] = field(default_factory=dict)

    @property
    def engine_count(self) -> int:
        """How many engines the model has."""
        propulsion = self.model.first("propulsion")
        return 0 if propulsion is None else sum(e.name == "engine" for e in propulsion.children)

    @property
    def retracts(self) -> bool:
        """Whether a wheel can be retracted."""
        return any(e.text.strip() == "1" for e in self.model.all("retractable"))

    def write(self, folder: Path) -> None:
        """Write all files below `folder`, which may exist."""
        for place, trees in (("systems", self.systems), ("engine", self.engines)):
            (folder / place).mkdir(parents=True, exist_ok=True)
            for stem, tree in trees.items():
                (folder / place / f"{stem}.xml").write_text(write(tree), encoding="utf-8")
        (folder / f"{self.name}.xml").write_text(write(self.model), encoding="utf-8")

    def declare(self, paths: list[str], value: float = 0.0) -> None:
        """Let the model have properties that it reads and nobody makes."""
        self.declared |= dict.fromkeys(paths, value)
        system = next((e for e in self.model.children if e.attributes.get("name") == _DECLARED), None)
        if system is None:
            system = Element("system", {"name": _DECLARED}, 0, parent=self.model)
            first = next(k for k, e in enumerate(self.model.children) if e.name == "system")
            self.model.children.insert(first, system)
        for path in paths:
            system.children.append(Element("property", {"value": repr(value)}, 0, text=path, parent=system))


def safe_copy(source: Source, name: str) -> Copy:
    """Read a model and all that it names. Raises AdoptionError at the stage "files"."""
    root = parse(source.model)
    if root.name != "fdm_config":
        raise AdoptionError(STAGE, f"{source.model.name}: root element <{root.name}>, not <fdm_config>")
    found = Copy(name, root)
    root.attributes = {"name": name, "version": root.attributes.get("version", "2.0"), "release": "ALPHA"}
    _about(found)
    _bring_sections_in(found, source)
    _leave_out(found)
    _systems(found, source)
    _engines(found, source)
    trees = (found.model, *found.systems.values(), *found.engines.values())
    if mirrored := use_jsbsims_own(trees):
        found.notes.append(f"FlightGear's {', '.join(mirrored)} read as JSBSim's own")
    if any([_move_autopilot(tree) for tree in trees]):
        found.notes.append(
            f"its own properties ap/ are {_OWN_AUTOPILOT} here: ap/ is the testbed's autopilot"
        )
    for tree in trees:
        _make_safe(found, tree)
        _play(found, tree)
    _add_autopilot(root)
    return found


def _about(found: Copy) -> None:
    header = found.model.first("fileheader")
    for e in [] if header is None else header.walk():
        text = " ".join(e.text.split())
        if e.name == "license":
            text = " ".join([*e.attributes.values(), text]).strip()
        if e.name in ("author", "license", "description", "email", "organization") and text:
            found.about.setdefault(e.name, text)


def _bring_sections_in(found: Copy, source: Source) -> None:
    """Replace a section that names a file by that file's contents."""
    for e in list(found.model.walk()):
        file = e.attributes.get("file")
        if file is None or e.name in ("system", "autopilot", *_ENGINE_FILES, *_LEFT_OUT):
            continue
        path = source.locate(file, "section")
        if path is None:
            raise AdoptionError(
                STAGE, f"{source.model.name}:{e.line}: <{e.name}> names {file}, which is missing"
            )
        tree = parse(path)
        e.attributes = {**{k: v for k, v in e.attributes.items() if k != "file"}, **tree.attributes}
        e.text, e.children = tree.text, tree.children
        for child in e.children:
            child.parent = e
        found.notes.append(f"<{e.name}> brought in from {path.name}")


def _leave_out(found: Copy) -> None:
    kept = []
    for e in found.model.children:
        if e.name in _LEFT_OUT:
            if _LEFT_OUT[e.name]:
                found.notes.append(f"<{e.name}> left out: {_LEFT_OUT[e.name]}")
        else:
            kept.append(e)
    found.model.children = kept


def _systems(found: Copy, source: Source) -> None:
    """Copy system files; a missing one, and an autopilot of the testbed, is left out."""
    waiting = [e for e in found.model.children if e.name == "system"]
    while waiting:
        e = waiting.pop(0)
        file = e.attributes.get("file")
        if file is None:
            continue
        path = source.locate(file, "system")
        stem = Path(file.removesuffix(".xml")).name
        if path is None:
            found.notes.append(f"system {file} left out: there is no such file")
            _remove(e)
            continue
        tree = parse(path)
        if _is_testbeds(tree):
            found.notes.append(f"system {file} left out: it is an autopilot of the testbed")
            _remove(e)
            continue
        if stem.lower() == "autopilot":
            stem = f"{stem}-of-the-model"
        e.attributes["file"] = stem
        if stem not in found.systems:
            found.systems[stem] = tree
            tree.attributes.setdefault("name", stem)
            tree.name = "system"
            waiting += [inner for inner in tree.children if inner.name == "system"]


def _is_testbeds(tree: Element) -> bool:
    return any(e.name == "property" and e.text == "ap/v-cmd-mps" for e in tree.children)


def _remove(e: Element) -> None:
    assert e.parent is not None
    e.parent.children = [child for child in e.parent.children if child is not e]


def _engines(found: Copy, source: Source) -> None:
    for e in found.model.walk():
        file = e.attributes.get("file")
        if e.name not in _ENGINE_FILES or file is None:
            continue
        stem = Path(file.removesuffix(".xml")).name
        path = source.locate(file, "engine")
        if path is None:
            where = f"{source.model.name}:{e.line}"
            raise AdoptionError(STAGE, f"{where}: <{e.name}> names {file}, and there is no {stem}.xml")
        e.attributes["file"] = stem
        found.engines[stem] = parse(path)


def _move_autopilot(tree: Element) -> bool:
    """Rename properties ap/ of the model's own autopilot: `ap/on` of ours would switch it on. Whether any."""
    moved = False
    for e in tree.walk():
        for key, value in e.attributes.items():
            if (now := _AUTOPILOT.sub(rf"\1{_OWN_AUTOPILOT}", value)) != value:
                e.attributes[key], moved = now, True
        if (now := _AUTOPILOT.sub(rf"\1{_OWN_AUTOPILOT}", e.text)) != e.text:
            e.text, moved = now, True
    return moved


def _make_safe(found: Copy, tree: Element) -> None:
    """Leave out components that control the simulation or command the aircraft, and outputs to files."""
    for e in list(tree.walk()):
        said = [message for message, _ in says(e)]
        if e.name == "output" and _COMMAND.fullmatch(e.text.strip()):
            said.append(f"it commands {e.text.strip()} itself")
        if not said and not (e.name == "output" and e.attributes):
            continue
        part = _component(e)
        if part.parent is None or part.parent.parent is None:
            raise AdoptionError(STAGE, f"<{part.name}>: {(said or ['writes files'])[0]}")
        name = part.attributes.get("name", "")
        note = f"<{part.name}{' ' + name if name else ''}> left out: {(said or ['writes files'])[0]}"
        if note not in found.notes:
            found.notes.append(note)
        _remove(part)


def _play(found: Copy, tree: Element) -> None:
    """Say which actuators do not answer small commands: the autopilot cannot hold what they leave."""
    for e in tree.all("actuator"):
        for kind in ("hysteresis_width", "deadband_width"):
            width = e.first(kind)
            if width is not None and width.text.strip() not in ("", "0", "0.0"):
                what = kind.partition("_")[0]
                name = e.attributes.get("name", "")
                found.notes.append(
                    f"actuator {name} has a {what} of {width.text.strip()}: small loops wander in it"
                )


def _component(e: Element) -> Element:
    """The part of a channel or a system that an element belongs to."""
    above = e
    for parent in _parents(e):
        if parent.name in ("channel", "system", "fdm_config", "flight_control", "propulsion"):
            break
        above = parent
    return above


def _parents(e: Element) -> Iterator[Element]:
    while e.parent is not None and e.parent.name:
        e = e.parent
        yield e


def _add_autopilot(root: Element) -> None:
    """Name the autopilot before all other systems: what moves the surfaces reads it in the same period."""
    order = ("system", "flight_control", "external_reactions", "buoyant_forces", "aerodynamics")
    places = [k for k, e in enumerate(root.children) if e.name in order]
    system = Element("system", {"file": "autopilot"}, 0, parent=root)
    root.children.insert(places[0] if places else len(root.children), system)
