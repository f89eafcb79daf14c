"""Escapes text for a Tacview recording."""

from __future__ import annotations


def escaped(text: str) -> str:
    """Text as a property's value: commas and newlines behind a backslash.

    The format has no escape for the backslash itself, which becomes a slash.
    """
    lines = text.replace("\\", "/").splitlines()
    clean = ("".join(c for c in line if c.isprintable()).replace(",", "\\,") for line in lines)
    return "\\\n".join(clean)
