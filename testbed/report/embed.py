"""Prepares figures for a page: SVG with ids of its own, or an image as a data address."""

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
# Of the root, which comes first.
_SIZE = re.compile(r' (?:width|height)="[0-9.]+pt"')


def markup(figure: Figure) -> str:
    """The figure as SVG for a page, closed afterwards; see `inline`."""
    from matplotlib import pyplot as plt

    text = io.StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    plt.close(figure)
    return inline(text.getvalue())


def inline(svg: str) -> str:
    """SVG text without prologue, comments and fixed size."""
    svg = _PROLOGUE.sub("", svg).strip()
    return _SIZE.sub("", svg, count=2)


def own_ids(svg: str, prefix: str) -> str:
    """The same with every id and what points at it prefixed, so that the figures of a page do not mix."""
    return _ID.sub(rf"\g<1>{prefix}-", svg)


def image(file: Path) -> str:
    """A PNG as an address."""
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode()
