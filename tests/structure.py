"""Reads which module imports which, and finds wrong arrows, circles and dependencies away from home.

Every import counts: those inside functions, under TYPE_CHECKING, and `importlib.import_module("...")` with a
constant name.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Import:
    """`line` of `importer` imports the module or the outside package `imported`."""

    importer: str
    imported: str
    line: int


@dataclass(frozen=True)
class Module:
    name: str  # dotted
    path: Path
    imports: tuple[Import, ...]  # of modules of this tree
    outside: frozenset[str]  # top-level packages that are not of this tree

    @property
    def parts(self) -> tuple[str, ...]:
        """Dotted name with `__init__` kept, so that a package and its folder are told apart."""
        parts = tuple(self.name.split("."))
        return (*parts, "__init__") if self.path.name == "__init__.py" else parts


def read(root: Path, packages: Sequence[str]) -> dict[str, Module]:
    """All modules below `root`/package by dotted name, with what they import."""
    files: dict[str, Path] = {}
    for package in packages:
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    modules = {}
    for name, file in files.items():
        ours: dict[str, Import] = {}
        outside: set[str] = set()
        for written, line in _imported_names(file):
            target = _module_of(written, files)
            if target is None:
                outside.add(written.partition(".")[0])
            elif target != name:
                ours.setdefault(target, Import(name, target, line))
        modules[name] = Module(name, file, tuple(ours.values()), frozenset(outside))
    return modules


def _imported_names(file: Path) -> Iterator[tuple[str, int]]:
    """Dotted names with their line; for `from a import b` it is "a.b", whether b is a module or not."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            if node.level or not node.module:
                raise ValueError(f"{file}:{node.lineno}: relative import; write the full name")
            yield from ((f"{node.module}.{alias.name}", node.lineno) for alias in node.names)
        elif isinstance(node, ast.Call):
            called = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
            first = node.args[0] if node.args else None
            if called == "import_module" and isinstance(first, ast.Constant) and isinstance(first.value, str):
                yield first.value, node.lineno


def _module_of(written: str, files: Mapping[str, Path]) -> str | None:
    """The module of this tree that `written` names or lies in; None for other packages."""
    while written:
        if written in files:
            return written
        written = written.rpartition(".")[0]
    return None


def wrong_arrows(modules: Mapping[str, Module], order: Mapping[str, Sequence[str]]) -> list[Import]:
    """Imports of what stands later in the order.

    order   package -> its folders and modules, from the ground up; each imports only what stands before it.
    The packages themselves stand in the order of the mapping. The front door (`package/__init__`) stands
    above all its folders, and nothing of the package may import it.
    Raises  ValueError for a folder or module that the order does not name.
    """
    packages = list(order)
    wrong = []
    for module in modules.values():
        for arrow in module.imports:
            here, there = _place(module.parts, order), _place(modules[arrow.imported].parts, order)
            same_child = module.parts[:2] == modules[arrow.imported].parts[:2]
            if not same_child and (packages.index(there[0]), there[1]) >= (packages.index(here[0]), here[1]):
                wrong.append(arrow)
    return wrong


def _place(parts: tuple[str, ...], order: Mapping[str, Sequence[str]]) -> tuple[str, int]:
    package, child = parts[0], parts[1]
    children = order[package]
    if child == "__init__":
        return package, len(children)
    if child not in children:
        raise ValueError(f"{package}/{child} has no place in the folder order")
    return package, children.index(child)


def circular_imports(modules: Mapping[str, Module]) -> list[str]:
    """Arrows that lie on a circle between modules or folders, as "parent: child -> child".

    At each package, an import between two modules is an arrow between the two children (module or
    subfolder) they lie in, so that folders that import each other are found even if no two modules do.
    """
    arrows: dict[tuple[str, ...], dict[str, set[str]]] = {}
    for module in modules.values():
        for arrow in module.imports:
            ours, theirs = module.parts, modules[arrow.imported].parts
            depth = next(k for k, (a, b) in enumerate(zip(ours, theirs, strict=False)) if a != b)
            level = arrows.setdefault(ours[:depth], {})
            level.setdefault(ours[depth], set()).add(theirs[depth])
    found = []
    for parent, graph in sorted(arrows.items()):
        reached = {child: _reachable(child, graph) for child in graph}
        found += [
            f"{'/'.join(parent) or '.'}: {a} -> {b}"
            for a in sorted(graph)
            for b in sorted(graph[a])
            if a in reached.get(b, ())
        ]
    return found


def _reachable(start: str, graph: Mapping[str, Iterable[str]]) -> set[str]:
    seen: set[str] = set()
    waiting = list(graph.get(start, ()))
    while waiting:
        child = waiting.pop()
        if child not in seen:
            seen.add(child)
            waiting += graph.get(child, ())
    return seen


def away_from_home(
    modules: Mapping[str, Module], root: Path, homes: Mapping[str, Sequence[str]]
) -> list[tuple[str, str]]:
    """(dependency, file) for each file that imports a dependency outside its homes.

    homes   dependency -> path prefixes below `root`: a file, or a folder with its closing slash.
    """
    return [
        (dependency, path)
        for module in modules.values()
        if (path := module.path.relative_to(root).as_posix())
        for dependency in sorted(module.outside & homes.keys())
        if not path.startswith(tuple(homes[dependency]))
    ]


def private_names(file: Path) -> list[str]:
    """Private names of others that a file uses: imported ones, and attributes of anything but self or cls
    that the file does not set itself. As "name (line)"."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    own = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    own |= {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    own |= {
        node.attr
        for node in ast.walk(tree)
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id in ("self", "cls")
    }
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom):
            found += [f"{alias.name} ({node.lineno})" for alias in node.names if _private(alias.name)]
        elif isinstance(node, ast.Attribute) and _private(node.attr) and node.attr not in own:
            found.append(f"{node.attr} ({node.lineno})")
    return found


def _private(name: str) -> bool:
    return name.startswith("_") and not name.endswith("__") and name != "_exit"  # os._exit is documented
