"""Figures as they go into a page: SVG whose ids are its own, or an image as an address."""

from __future__ import annotations

import base64
import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Ids and what points at them; matplotlib names groups alike in every figure.
_ID = re.compile(r'(\bid="|xlink:href="#|url\(#)')
_PROLOGUE = re.compile(r"<\?xml.*?\?>|<!DOCTYPE.*?>|<metadata>.*?</metadata>|<!--.*?-->", re.DOTALL)
_SIZE = re.compile(r'(<svg[^>]*?) width="[^"]*"([^>]*?)', re.DOTALL)
_HEIGHT = re.compile(r'(<svg[^>]*?) height="[^"]*"', re.DOTALL)


def markup(figure: Figure, name: str) -> str:
    """The figure as SVG for a page, closed afterwards; see `inline`."""
    from matplotlib import pyplot as plt

    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return inline(text.getvalue(), name)


def inline(svg: str, name: str) -> str:
    """SVG text without prologue, comments and fixed size, its ids prefixed so that figures do not mix."""
    svg = _PROLOGUE.sub("", svg).strip()
    svg = _HEIGHT.sub(r"\1", _SIZE.sub(r"\1\2", svg, count=1), count=1)
    return _ID.sub(rf"\g<1>{name}-", svg)


def image(file: Path) -> str:
    """A PNG as an address."""
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()
