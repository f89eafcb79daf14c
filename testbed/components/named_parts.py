"""Parts that a person names by text: a class or function of a file, or an installed part.

    parts = Parts.of(named_parts.read(["my_parts.py:Cone(gain=2)", "my_parts.py:Homing"]))
    testbed.run(scenario, parts=parts)

The rules of the text are in `own_code.spelling`, those by which the role is told in `own_code.roles`.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from testbed.components.own_code import installed, roles, source, spelling
from testbed.components.own_code.installed import Installed
from testbed.components.own_code.source import Source
from testbed.components.provenance import Origin
from testbed.errors import UserError, nearest


@dataclass(frozen=True)
class NamedPart:
    """One part of the user's own; called by the testbed, it makes the part of one run.

    label      what tables and campaign axes call it: `Cone`, or `Cone(gain=2)`
    role       "plant", "filter", "guidance" or "environment"
    name       of the class or function, within its file
    arguments  keyword -> value
    source     the file or the installed part that it comes from

    It is data: sent to another process it takes the file's text with it and is imported from that.
    """

    label: str
    role: str
    name: str
    arguments: dict[str, Any] = field(hash=False)
    source: Source | Installed

    @property
    def origin(self) -> Origin:
        """Its name, file, checksums and arguments, as the manifest states them."""
        given = {name: repr(value) for name, value in self.arguments.items()}
        if isinstance(self.source, Source):
            file = self.source.name
            name = f"{PurePath(file).stem}.{self.name}"
            return Origin(name, file, self.source.sha256, given, self.source.imports)
        there = self.source.file
        name = f"{self.source.module_name}.{self.name}"
        return Origin(name, there.name if there else None, self.source.sha256, given, {}, self.source.package)

    def __call__(self, *given: Any) -> Any:
        """The part, made from what the testbed gives its role by position; see `own_code.roles.GIVEN`."""
        return roles.make(self.target(), self.role, given, self.arguments)

    def target(self) -> Any:
        """The class or function. Raises UserError where its file cannot be imported."""
        if isinstance(self.source, Installed):
            return self.source.loaded()
        return _attribute(self.source, self.name)


def read(texts: Iterable[str]) -> list[NamedPart]:
    """The parts that `texts` name, in their order; each label is there once.

    Raises UserError in one line: a file that is missing or raises on import, a name that is not in it, no
    part of any role, wrong arguments, two parts of one label.
    """
    files: dict[str, Source] = {}
    found = [_read(spelling.written(text), files) for text in texts]
    return _told_apart(found)


def split(text: str) -> list[str]:
    """The names of a list with commas between, such as `centralised,my_parts.py:Cone(gain=2),none`."""
    return spelling.split(text)


def only(named: Sequence[NamedPart], *allowed: str, where: str) -> None:
    """UserError if a part has another role than those allowed; `where` says why in words."""
    for part in named:
        if part.role not in allowed:
            raise UserError(f"--parts {part.label}: it is a {part.role}; {where}")


def _read(said: spelling.Written, files: dict[str, Source]) -> NamedPart:
    if said.file is None:
        found = installed.find(said.name, said.role)
        return _checked(said, found.loaded(), found.role, found.attribute, found)
    if said.file not in files:
        files[said.file] = source.read(said.file)
    file = files[said.file]
    return _checked(said, _attribute(file, said.name), said.role, said.name, file)


def _checked(
    said: spelling.Written, target: Any, role: str | None, name: str, where: Source | Installed
) -> NamedPart:
    role = roles.role_of(target, said.where, role)
    roles.check_arguments(target, said.where, role, said.arguments)
    return NamedPart(spelling.label(said.name, said.arguments), role, name, said.arguments, where)


def _attribute(its_source: Source, name: str) -> Any:
    """The class or function of that name in a file."""
    module = its_source.module()
    found: Any = module
    for part in name.split("."):
        try:
            found = getattr(found, part)
        except AttributeError:
            makers = {n: v for n, v in vars(module).items() if inspect.isclass(v) or inspect.isfunction(v)}
            known = [n for n, v in makers.items() if v.__module__ == module.__name__ and n[0] != "_"]
            hint = nearest(name, known) if known else "it defines no class and no function"
            raise UserError(f"--parts: {its_source.path} has no {name!r}; {hint}") from None
    return found


def _told_apart(found: list[NamedPart]) -> list[NamedPart]:
    """The parts, those of one label called by their file too."""
    labels = [part.label for part in found]
    apart = []
    for part in found:
        again = labels.count(part.label) > 1
        stem = PurePath(part.source.name).stem if isinstance(part.source, Source) else part.source.module_name
        label = f"{stem}.{part.label}" if again else part.label
        apart.append(NamedPart(label, part.role, part.name, part.arguments, part.source))
    for part in apart:
        if [p.label for p in apart].count(part.label) > 1:
            raise UserError(f"--parts {part.label}: given twice; leave one out, or rename one in its file")
    return apart
