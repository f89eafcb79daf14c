"""XML with line numbers, read without trusting it: no document types, so no entities, and a limit on size."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.parsers import expat
from xml.sax.saxutils import escape, quoteattr

LARGEST_BYTES = 5_000_000
DEEPEST = 200
_DOCUMENT_TYPE = re.compile(rb"<!DOCTYPE[^\[>]*(\[.*?\]\s*)?>", re.DOTALL)


class RefusedError(ValueError):
    """XML that was refused: why, in one line, and where."""

    def __init__(self, message: str, line: int | None = None) -> None:
        super().__init__(message)
        self.line = line


@dataclass
class Element:
    """One element: name, attributes, own text, children, the line it begins on."""

    name: str
    attributes: dict[str, str]
    line: int
    text: str = ""
    children: list[Element] = field(default_factory=list)
    parent: Element | None = field(default=None, repr=False)

    def walk(self) -> Iterator[Element]:
        """This element and all below it, in the file's order."""
        waiting = [self]
        while waiting:
            now = waiting.pop()
            yield now
            waiting.extend(reversed(now.children))

    def all(self, name: str) -> Iterator[Element]:
        return (e for e in self.walk() if e.name == name)

    def first(self, name: str) -> Element | None:
        return next(self.all(name), None)

    def mentions(self, word: str) -> Element | None:
        """The first element at or below this one with `word` in its text."""
        return next((e for e in self.walk() if word in e.text), None)

    def number(self) -> float | None:
        try:
            return float(self.text)
        except ValueError:
            return None


def read(path: Path, skip_document_type: bool = False) -> Element:
    """The root element of a file.

    skip_document_type  leave a document type out instead of refusing the file; entities stay undefined
    Raises  RefusedError: not readable, too large, too deep, not well-formed, or with a document type, which
            is what entity bombs and references to other files need.
    """
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise RefusedError(f"larger than {LARGEST_BYTES // 1_000_000} MB")
        text = path.read_bytes()
    except OSError as error:
        raise RefusedError(f"cannot be read: {error.strerror}") from None
    if skip_document_type:
        text = _DOCUMENT_TYPE.sub(b"", text, count=1)
    parser = expat.ParserCreate()
    top = Element("", {}, 0)
    open_ = [top]

    def begin(name: str, attributes: dict[str, str]) -> None:
        if len(open_) > DEEPEST:
            raise RefusedError(f"nested deeper than {DEEPEST} elements", parser.CurrentLineNumber)
        element = Element(name, attributes, parser.CurrentLineNumber, parent=open_[-1])
        open_[-1].children.append(element)
        open_.append(element)

    def end(name: str) -> None:
        closed = open_.pop()
        closed.text = closed.text.strip()

    def characters(data: str) -> None:
        open_[-1].text += data

    def refuse(*_: object) -> None:
        raise RefusedError("has a document type or entities; a model needs none", parser.CurrentLineNumber)

    parser.StartElementHandler, parser.CharacterDataHandler = begin, characters
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = parser.EntityDeclHandler = refuse
    try:
        parser.Parse(text, True)
    except expat.ExpatError as error:
        raise RefusedError(f"not well-formed: {expat.errors.messages[error.code]}", error.lineno) from None
    return top.children[0]


def write(root: Element) -> str:
    """The file of a root element: each element's own text comes before its children."""
    lines = ['<?xml version="1.0"?>']

    def add(e: Element, depth: int) -> None:
        pad = "  " * depth
        head = f"{pad}<{e.name}" + "".join(f" {k}={quoteattr(v)}" for k, v in e.attributes.items())
        text = escape(e.text)
        if not e.children:
            lines.append(f"{head}>{text}</{e.name}>" if text else f"{head}/>")
            return
        lines.append(f"{head}>{text}")
        for child in e.children:
            add(child, depth + 1)
        lines.append(f"{pad}</{e.name}>")

    add(root, 0)
    return "\n".join([*lines, ""])
