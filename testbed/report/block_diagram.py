"""Draws an autopilot's block diagram: one drawing for each output, made from its equations."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from testbed.report.style import COLOURS, drawing

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from aircraft.airframes.schema import Airframe
    from aircraft.equations.dataflow import Block

_WIDE, _GAP, _LINE, _APART = 2.05, 0.62, 0.135, 0.22  # inches: block, between columns, line of text, rows
_LETTERS = 34  # of small text in a block's width
_SHOWN = 8  # gains or measurements in a block; more are counted


@dataclass
class _Box:
    """A block or command where it is drawn: its left edge, its middle, and its lines of text."""

    name: str
    lines: list[tuple[str, str]]  # kind, text
    color: str
    state: bool = False
    way: bool = False  # no block: a place where a line passes between blocks
    column: int = 0
    x: float = 0.0
    y: float = 0.0

    @property
    def height(self) -> float:
        return 0.0 if self.way else _LINE * len(self.lines) + 0.14


def write(airframe: Airframe, folder: Path) -> list[Path]:
    """`folder`/AUTOPILOT-OUTPUT.svg and .png for each output of an airframe's autopilot; the SVG files."""
    from aircraft.equations.catalogue import equations_of
    from aircraft.equations.dataflow import blocks, outputs

    equations = equations_of(airframe).of(airframe.gain_values())
    autopilot = airframe.autopilot.removesuffix(".eq")
    channels = [c.name for c in equations.channels if c.condition in (None, "on")]
    made = []
    folder.mkdir(parents=True, exist_ok=True)
    with drawing() as plt:
        for output in outputs(equations):
            name = output.removesuffix("_norm")
            figure = draw(blocks(equations, output), f"{autopilot}: {name}", channels)
            made.append(folder / f"{autopilot}-{name}.svg")
            figure.savefig(made[-1], metadata={"Date": None})
            figure.savefig(made[-1].with_suffix(".png"), dpi=120)
            plt.close(figure)
    return made


def draw(blocks: Sequence[Block], title: str, channels: Sequence[str]) -> Figure:
    """One output's diagram; signals flow from left to right, dashed ones are a period old."""
    from matplotlib import pyplot as plt

    look = {name: COLOURS[k % len(COLOURS)] for k, name in enumerate(channels)}
    boxes = _boxes(blocks, look)
    lines = _lines(boxes, blocks)
    last = max(box.column for box in boxes.values())
    columns = [[b for b in boxes.values() if b.column == k] for k in range(last + 1)]
    height = _place(columns, lines)
    width = len(columns) * (_WIDE + _GAP)
    figure = plt.figure(figsize=(width + 0.2, height + 0.75))
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set(xlim=(-0.3, width - 0.1), ylim=(-0.35, height + 0.4))
    axes.axis("off")
    for line in lines:
        _arrow(axes, line)
    for box in boxes.values():
        if not box.way:
            _draw(axes, box)
    axes.text(-0.2, height + 0.33, title, fontsize=9, weight="bold", va="top")
    used = [name for name in channels if any(b.channel == name for b in blocks)]
    x = -0.2
    for name in used:
        axes.text(x, -0.28, f"■ {name}", color=look[name], fontsize=7)
        x += 0.25 + 0.075 * len(name)
    axes.text(x + 0.2, -0.28, "double border: keeps its value;  dashed: of the period before", fontsize=7)
    return figure


def _boxes(blocks: Sequence[Block], look: Mapping[str, str]) -> dict[str, _Box]:
    found: dict[str, _Box] = {}
    made = {b.name for b in blocks}
    for block in blocks:
        for name in block.reads:
            if name not in made and name not in found:
                found[name] = _Box(name, [("name", name), ("more", "command")], "0.2")
    for block in blocks:
        lines = [("name", block.name)]
        for kind, names in (("gain", block.gains), ("measured", block.measured)):
            said = ", ".join(names[:_SHOWN]) + (f" and {len(names) - _SHOWN} more" if names[_SHOWN:] else "")
            before = "" if kind == "gain" else "measured: "
            lines += [(kind, text) for text in textwrap.wrap(before + said, _LETTERS)] if names else []
        if block.equations > 1:
            lines.append(("more", f"{block.equations} equations"))
        found[block.name] = _Box(block.name, lines, look[block.channel], block.state)
    return found


@dataclass(frozen=True)
class _Line:
    """A signal from one box to another, by way of places in the columns between."""

    boxes: tuple[_Box, ...]
    late: bool


def _lines(boxes: dict[str, _Box], blocks: Sequence[Block]) -> list[_Line]:
    """Sets the boxes' columns, by how long the longest way to them is; every signal, with its places."""
    for block in blocks:  # in order of evaluation: what is read this period has its column already
        box = boxes[block.name]
        box.column = max((boxes[n].column + 1 for n in block.reads if n in boxes), default=0)
    last = max(box.column for box in boxes.values())
    boxes[blocks[-1].name].column = last
    # Towards those that read them, so that lines are short.
    made = {block.name for block in blocks[:-1]}
    for name in reversed(list(boxes)):
        readers = [boxes[b.name].column for b in blocks if name in b.reads]
        if readers and (name in made or name not in {b.name for b in blocks}):
            boxes[name].column = max(boxes[name].column, min(readers) - 1)
    found = []
    for block in blocks:
        for names, late in ((block.reads, False), (block.late, True)):
            for name in names:
                if name in boxes:
                    found.append(_Line(_way(boxes, boxes[name], boxes[block.name], late), late))
    return found


def _way(boxes: dict[str, _Box], begin: _Box, end: _Box, late: bool) -> tuple[_Box, ...]:
    step = 1 if end.column >= begin.column else -1
    between = range(begin.column + step, end.column, step) if end.column != begin.column else ()
    places = []
    for column in between:
        # Signals of one box share their places as far as they go the same way.
        key = f"{begin.name} {column} {step} {late}"
        if key not in boxes:
            boxes[key] = _Box(key, [], begin.color, way=True, column=column)
        places.append(boxes[key])
    return (begin, *places, end)


def _place(columns: Sequence[list[_Box]], lines: Sequence[_Line]) -> float:
    """Sets x and y of every box, in an order that crosses few lines; returns the height."""
    neighbours: dict[str, list[str]] = {}
    for line in lines:
        for here, there in pairwise(line.boxes):
            neighbours.setdefault(here.name, []).append(there.name)
            neighbours.setdefault(there.name, []).append(here.name)
    tall = max(sum(b.height + _APART for b in column) for column in columns)
    where: dict[str, float] = {}
    for sweep in range(12):
        for column in columns if sweep % 2 == 0 else columns[::-1]:
            wished = {}
            for box in column:
                seen = [where[n] for n in neighbours.get(box.name, []) if n in where]
                wished[box.name] = sum(seen) / len(seen) if seen else where.get(box.name, tall / 2)
            column.sort(key=lambda box: wished[box.name], reverse=True)
            _stack(column, wished, tall)
            where |= {box.name: box.y for box in column}
    for k, column in enumerate(columns):
        for box in column:
            box.x = k * (_WIDE + _GAP)
    return tall


def _stack(column: Sequence[_Box], wished: Mapping[str, float], tall: float) -> None:
    """Boxes from above in their order, each as near to its wish as those before and after allow."""
    below = [0.0]
    for box in reversed(column):
        below.append(below[-1] + box.height + _APART)
    top = tall
    for box, under in zip(column, below[-2::-1], strict=True):
        half = (box.height + _APART) / 2
        box.y = min(top - half, max(under + half, wished[box.name]))
        top = box.y - half


def _draw(axes: Axes, box: _Box) -> None:
    from matplotlib.patches import Rectangle

    x, y, h = box.x, box.y - box.height / 2, box.height
    style: dict[str, Any] = {"edgecolor": box.color, "linewidth": 1.0, "zorder": 3}
    axes.add_patch(Rectangle((x, y), _WIDE, h, facecolor="white", **style))
    if box.state:
        axes.add_patch(Rectangle((x + 0.03, y + 0.03), _WIDE - 0.06, h - 0.06, fill=False, **style))
    top = box.y + h / 2 - 0.07
    looks = {
        "name": {"fontsize": 7.5, "weight": "bold"},
        "gain": {"fontsize": 6, "color": box.color, "family": "monospace"},
        "measured": {"fontsize": 6, "color": "0.35"},
        "more": {"fontsize": 6, "color": "0.35", "style": "italic"},
    }
    for kind, text in box.lines:
        shown: dict[str, Any] = looks[kind]
        axes.text(x + 0.08, top, text, va="top", zorder=4, **shown)
        top -= _LINE


def _arrow(axes: Axes, line: _Line) -> None:
    """A smooth line by its places; what goes back ends at the lower edge."""
    from matplotlib.patches import FancyArrowPatch
    from matplotlib.path import Path as Curve

    begin, *places, end = line.boxes
    forward = begin.column < end.column
    bend = _GAP * 0.55 if forward else -_GAP * 0.55
    if forward:
        points = [(begin.x + _WIDE, begin.y)]
        for place in places:
            points += [(place.x, place.y), (place.x + _WIDE, place.y)]
        points.append((end.x, end.y))
    elif begin.column == end.column:
        side = begin.x + _WIDE
        points = [(side, begin.y - 0.05), (side, end.y - 0.05)]
        bend = _GAP * 0.9
    else:
        points = [(begin.x, begin.y - begin.height * 0.3)]
        for place in places:
            points += [(place.x + _WIDE, place.y), (place.x, place.y)]
        points.append((end.x + _WIDE, end.y - end.height * 0.3))
    vertices, codes = [points[0]], [Curve.MOVETO]
    for k, (here, there) in enumerate(pairwise(points)):
        if k % 2:  # along a block's width
            vertices.append(there)
            codes.append(Curve.LINETO)
            continue
        back = bend if begin.column == end.column else -bend
        vertices += [(here[0] + bend, here[1]), (there[0] + back, there[1]), there]
        codes += [Curve.CURVE4] * 3
    look: dict[str, Any] = {"linewidth": 0.8, "linestyle": "--" if line.late else "-", "zorder": 2}
    color = "0.45" if line.late else begin.color
    axes.add_patch(
        FancyArrowPatch(path=Curve(vertices, codes), arrowstyle="-|>", mutation_scale=7, color=color, **look)
    )
