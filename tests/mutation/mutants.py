"""The mutants of a source file: mutmut's operators, applied to one place at a time.

A mutant of a function's body is the function's changed code, put into the living function. One of a module's
constants or of a default is the whole file's changed source, since its value is copied at import; there only
numbers, strings, True and False and operators are changed. So is one of what runs while a class is made, or
of a function that uses super(). Annotations, decorators, triple-quoted strings, `len`, `isinstance` and
`__all__` are left alone, and what compiles to the same instructions is no mutant.
"""

from __future__ import annotations

import difflib
import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from types import CodeType

import libcst as cst
import libcst.matchers as matchers
from libcst.metadata import MetadataWrapper, PositionProvider
from mutmut.mutation.mutators import (
    mutation_operators,
    operator_arg_removal,
    operator_assignment,
    operator_dict_arguments,
    operator_lambda,
)

UNTOUCHED_CALLS = ("len", "isinstance")
IN_FUNCTIONS_ONLY = (operator_arg_removal, operator_assignment, operator_dict_arguments, operator_lambda)
AT_IMPORT = "__init_subclass__"
FUTURE = "from __future__ import annotations\n"


@dataclass(frozen=True)
class Mutant:
    """One change.

    file, lines  where: relative path, first and last line of the statement (or condition) changed
    place        qualified name of the outermost function, or "" for a definition
    before, after  the changed lines
    source       what to compile: the function, or the whole file
    key          of the change: equal keys are the same mutant in another version of the file
    """

    file: str
    lines: tuple[int, int]
    place: str
    before: str
    after: str
    source: str
    key: str

    @property
    def is_definition(self) -> bool:
        return not self.place

    def code(self) -> CodeType:
        """The function's code, or the module's."""
        code = compile(self.source, self.file, "exec", dont_inherit=True)
        return code if self.is_definition else function_code(code)


def function_code(module: CodeType) -> CodeType:
    return next(c for c in module.co_consts if isinstance(c, CodeType))


def unchanged(root: Path, file: str, place: str) -> Mutant:
    """No mutant: the function as it is, put in the same way; no test may fail."""
    changes = _Visitor()
    MetadataWrapper(cst.parse_module((root / file).read_text(encoding="utf-8"))).visit(changes)
    change = next(c for c in changes.changes if c.place == place)
    return Mutant(file, change.lines, place, "", "", FUTURE + cst.Module([_bare(change.function)]).code, "")


def of_file(root: Path, file: str) -> list[Mutant]:
    """All mutants of one file, in the order of its lines."""
    source = (root / file).read_text(encoding="utf-8")
    wrapper = MetadataWrapper(cst.parse_module(source))
    visitor = _Visitor()
    wrapper.visit(visitor)
    found, seen = [], set()
    plain: dict[cst.CSTNode | None, tuple[str, object]] = {None: (source, _compiled(file, source))}
    for change in visitor.changes:
        if change.function not in plain:
            old = FUTURE + cst.Module([_bare(change.function)]).code
            plain[change.function] = old, _compiled(file, old)
        mutant = _made(file, wrapper.module, change, *plain[change.function])
        if mutant is not None and mutant.key not in seen:
            seen.add(mutant.key)
            found.append(mutant)
    return found


@dataclass(frozen=True)
class _Change:
    original: cst.CSTNode
    mutated: cst.CSTNode
    function: cst.FunctionDef | None
    place: str
    lines: tuple[int, int]


class _Visitor(cst.CSTVisitor):
    METADATA_DEPENDENCIES = (PositionProvider,)

    def __init__(self) -> None:
        super().__init__()
        self.changes: list[_Change] = []
        self.names: list[str] = []
        self.function: cst.FunctionDef | None = None
        self.in_body = False
        self.cell = False  # whether the function knows its class, which its code alone does not
        self.statement: cst.CSTNode | None = None

    def on_visit(self, node: cst.CSTNode) -> bool:
        if _untouched(node):
            return False
        if isinstance(node, cst.SimpleStatementLine):
            self.statement = node
        if isinstance(node, cst.ClassDef | cst.FunctionDef) and self.function is None:
            self.names.append(node.name.value)
            if isinstance(node, cst.FunctionDef):
                self.function = node
                self.cell = bool(matchers.findall(node, matchers.Name("super")))
        if self.function is not None and node is self.function.body:
            self.in_body = True
        self._change(node)
        return True

    def on_leave(self, original_node: cst.CSTNode) -> None:
        if original_node is self.statement:
            self.statement = None
        if self.function is not None and original_node is self.function.body:
            self.in_body = False
        if original_node is self.function:
            self.function = None
            self.names.pop()
        elif isinstance(original_node, cst.ClassDef) and self.function is None:
            self.names.pop()

    def _change(self, node: cst.CSTNode) -> None:
        for kind, operator in mutation_operators:
            if not isinstance(node, kind) or (not self.in_body and operator in IN_FUNCTIONS_ONLY):
                continue
            spot = self.get_metadata(PositionProvider, self.statement or node)
            lines = (spot.start.line, spot.end.line)
            alive = self.in_body and self.names[-1] != AT_IMPORT and not self.cell
            function, place = (self.function, ".".join(self.names)) if alive else (None, "")
            for mutated in _applied(operator, node):
                self.changes.append(_Change(node, mutated, function, place, lines))


def _applied(operator: object, node: cst.CSTNode) -> Iterator[cst.CSTNode]:
    made: Iterable[cst.CSTNode] = operator(node)  # type: ignore[operator]
    yield from made


def _untouched(node: cst.CSTNode) -> bool:
    if isinstance(node, cst.Annotation | cst.Decorator | cst.Import | cst.ImportFrom):
        return True
    if isinstance(node, cst.Assign):
        return any(isinstance(t.target, cst.Name) and t.target.value == "__all__" for t in node.targets)
    return (
        isinstance(node, cst.Call) and isinstance(node.func, cst.Name) and node.func.value in UNTOUCHED_CALLS
    )


def _bare(function: cst.FunctionDef | None) -> cst.FunctionDef:
    assert function is not None
    return function.with_changes(decorators=[], leading_lines=[])


def _made(file: str, module: cst.Module, change: _Change, old: str, instructions: object) -> Mutant | None:
    if change.function is None:
        new = module.deep_replace(change.original, change.mutated).code  # type: ignore[arg-type]
    else:
        changed = _bare(change.function).deep_replace(change.original, change.mutated)
        new = FUTURE + cst.Module([changed]).code  # type: ignore[list-item]
    try:
        if _compiled(file, new) == instructions:
            return None
    except SyntaxError:
        return None
    before, after = _difference(old, new)
    key = hashlib.sha256(f"{file}\0{change.place}\0{new}".encode()).hexdigest()[:16]
    return Mutant(file, change.lines, change.place, before, after, new, key)


def _compiled(file: str, source: str) -> object:
    return _instructions(compile(source, file, "exec", dont_inherit=True))


def _instructions(code: CodeType) -> tuple[object, ...]:
    """What of a code decides how it runs: no line numbers."""
    constants = [(type(c), _instructions(c) if isinstance(c, CodeType) else repr(c)) for c in code.co_consts]
    return code.co_code, constants, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars


def _difference(old: str, new: str) -> tuple[str, str]:
    lines = list(difflib.unified_diff(old.splitlines(), new.splitlines(), n=0, lineterm=""))[2:]
    removed = " ".join(line[1:].strip() for line in lines if line.startswith("-"))
    added = " ".join(line[1:].strip() for line in lines if line.startswith("+"))
    return removed, added
