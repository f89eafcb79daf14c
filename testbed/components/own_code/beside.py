"""Finds the modules beside a user's file that it imports, and offers their texts to Python's import."""

from __future__ import annotations

import ast
import importlib.util
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Any

from testbed.errors import UserError

# Taken from where they are installed, whatever stands beside the file.
OURS = frozenset({"filters", "aircraft", "testbed"})
MOST_FILES = 200


@dataclass(frozen=True)
class Module:
    """A module that stands beside a user's file.

    name      dotted
    file      path from the folder of the user's file, with "/"
    absolute  where it was read
    text      its bytes
    """

    name: str
    file: str
    absolute: str
    text: bytes

    @property
    def is_package(self) -> bool:
        return self.file.endswith("/__init__.py")


def modules_beside(file: Path, text: bytes) -> list[Module]:
    """The modules in the folder of `file` that its text imports, and those that they import, by name.

    Of a package all modules are taken. Imports inside functions count; names computed at run time do not.
    """
    found: dict[str, Module] = {}
    todo, seen = sorted(_imported(text)), {file.stem}
    while todo:
        top = todo.pop()
        if top in seen or top in OURS or top in sys.stdlib_module_names:
            continue
        seen.add(top)
        for path in _files(file.parent, top):
            relative = path.relative_to(file.parent)
            parts = relative.with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = Module(name, relative.as_posix(), str(path), path.read_bytes())
            todo += sorted(_imported(found[name].text))
            if len(found) > MOST_FILES:
                raise UserError(f"--parts {file.name}: it imports more than {MOST_FILES} files beside it")
    return [found[name] for name in sorted(found)]


def _files(folder: Path, top: str) -> list[Path]:
    if (folder / top / "__init__.py").is_file():
        return sorted((folder / top).rglob("*.py"))
    return [folder / f"{top}.py"] if (folder / f"{top}.py").is_file() else []


def _imported(text: bytes) -> set[str]:
    """First names of what a source imports; none where it cannot be parsed: running it says why."""
    try:
        tree = ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        return set()
    names = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module)
    return {name.partition(".")[0] for name in names}


class _Beside(MetaPathFinder, Loader):
    """Imports registered modules from their texts."""

    def __init__(self) -> None:
        self.modules: dict[str, Module] = {}

    def find_spec(self, fullname: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        module = self.modules.get(fullname)
        if module is None:
            return None
        folders = [str(Path(module.absolute).parent)] if module.is_package else None
        return importlib.util.spec_from_file_location(
            fullname, module.absolute, loader=self, submodule_search_locations=folders
        )

    def exec_module(self, module: ModuleType) -> None:
        known = self.modules[module.__name__]
        exec(compile(known.text, known.absolute, "exec", dont_inherit=True), module.__dict__)


_FINDER = _Beside()


def check_names(path: str, modules: Sequence[Module]) -> None:
    """UserError if a name is in use by another module: Python has one module of a name."""
    for module in modules:
        known = _FINDER.modules.get(module.name)
        loaded = sys.modules.get(module.name)
        where = known.absolute if known else getattr(loaded, "__file__", None)
        if loaded is not None and where != module.absolute:
            raise UserError(
                f"{path} imports {module.name}, which stands beside it, but another module of that name is"
                f" in use ({where or 'built in'}); rename {module.file}"
            )


def offer(modules: Sequence[Module]) -> None:
    """Let `import` find these modules, now and later; one whose text has changed is imported anew."""
    if modules and _FINDER not in sys.meta_path:
        sys.meta_path.insert(0, _FINDER)
    for module in modules:
        if _FINDER.modules.get(module.name, module).text != module.text:
            sys.modules.pop(module.name, None)
        _FINDER.modules[module.name] = module
