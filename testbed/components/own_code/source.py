"""Reads a user's Python file and the modules beside it that it imports, and runs it as a module of its own.

What is read is what runs, here and in worker processes: the text travels with the job, so every process
imports the same whatever becomes of the file meanwhile.
"""

from __future__ import annotations

import contextlib
import hashlib
import sys
import traceback
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType

from testbed.components.own_code.beside import Module, check_names, modules_beside, offer
from testbed.errors import StoppedError, UserError, nearest, printable

# A file beyond this is no source of parts [bytes].
LARGEST_FILE = 2_000_000
_LOADED: dict[str, ModuleType] = {}


@dataclass(frozen=True)
class Source:
    """A file as it was read.

    path      as the user wrote it, for messages
    absolute  where it was read, for `__file__`
    text      the file's bytes
    beside    the modules that stand beside it and that it imports, by name
    """

    path: str
    absolute: str
    text: bytes
    beside: tuple[Module, ...] = ()

    @property
    def name(self) -> str:
        """The file's name without its folder."""
        return Path(self.absolute).name

    @cached_property
    def sha256(self) -> str:
        """SHA-256 of the file's bytes."""
        return hashlib.sha256(self.text).hexdigest()

    @property
    def imports(self) -> dict[str, str]:
        """File beside it -> SHA-256, of all that it imports from there."""
        return {module.file: hashlib.sha256(module.text).hexdigest() for module in self.beside}

    def module(self) -> ModuleType:
        """The file's module, run once in this process.

        Raises UserError naming the line of the user's file where it cannot be run.
        """
        key = hashlib.sha256(repr((self.absolute, self.sha256, self.imports)).encode()).hexdigest()
        if key not in _LOADED:
            _LOADED[key] = self._run(f"{Path(self.name).stem}__{key[:12]}")
        return _LOADED[key]

    def _run(self, name: str) -> ModuleType:
        module = ModuleType(name)
        module.__file__ = self.absolute
        check_names(self.path, self.beside)
        offer(self.beside)
        try:
            code = compile(self.text, self.absolute, "exec", dont_inherit=True)
        except (SyntaxError, ValueError) as error:
            line = getattr(error, "lineno", None)
            raise UserError(
                f"{self.path}{f', line {line}' if line else ''}: {getattr(error, 'msg', error)}"
            ) from None
        # Dataclasses and pickles look their module up.
        sys.modules[name] = module
        try:
            # What it prints must not mix with a command's own output.
            with contextlib.redirect_stdout(sys.stderr):
                exec(code, module.__dict__)
        except BaseException as error:
            del sys.modules[name]
            if isinstance(error, KeyboardInterrupt | StoppedError):
                raise
            raise UserError(self._raised(error)) from None
        return module

    def _raised(self, error: BaseException) -> str:
        """What happened on import, and the line of the user's file that led there."""
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == self.absolute]
        where = f", line {lines[-1]}" if lines else ""
        said = " ".join(str(error).split())
        return printable(f"{self.path}{where}: importing it raised {type(error).__name__}: {said}")


def read(path: str) -> Source:
    """The file at `path` with what it imports from its folder.

    Raises UserError for a file that is missing or cannot be read.
    """
    file = Path(path)
    try:
        if file.stat().st_size > LARGEST_FILE:
            raise UserError(f"--parts {path}: more than {LARGEST_FILE // 1_000_000} MB; this is no such file")
        text = file.read_bytes()
        absolute = file.resolve()
        return Source(path, str(absolute), text, tuple(modules_beside(absolute, text)))
    except FileNotFoundError:
        known = sorted(f.name for f in file.parent.glob("*.py")) if file.parent.is_dir() else []
        hint = f"; {nearest(file.name, known)}" if known else ""
        raise UserError(f"--parts: file {path} does not exist{hint}") from None
    except (OSError, ValueError) as error:
        raise UserError(f"--parts: file {path}: {getattr(error, 'strerror', None) or error}") from None
