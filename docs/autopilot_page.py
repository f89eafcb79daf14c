"""Makes docs/guide/loops.md and its block diagrams from the equations of the autopilots.

python docs/autopilot_page.py docs/guide/figures/blocks > docs/guide/loops.md
The diagrams are drawn into the folder that is named.
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from aircraft.airframe import load
from aircraft.airframes.schema import Airframe
from aircraft.autopilots.parameters import cell
from aircraft.equations.catalogue import equations_of
from aircraft.equations.dataflow import outputs

ROOT = Path(__file__).parent.parent
EXAMPLE = ROOT / "docs/guide/examples/pid.eq"
HEAD = """# The loops of the autopilots

Block diagrams and tables of gains, made from the equations. Of any airframe and autopilot:

```sh
testbed aircraft autopilot x8@px4 --diagram blocks
testbed aircraft autopilot x8@px4 --parameters --markdown
```

There is a diagram for each output. Signals flow from left to right; a box is a signal with the gains and
measurements that it is computed from. What is computed of measurements alone counts as measured. Where
equations are more than fit a page, neighbours are joined in one box, which says how many. A double border
keeps its value from one period to the next; a dashed line is the value of the period before. What each name
is, says the equation of that name:
[inverting](../../aircraft/autopilots/inverting/autopilot.eq),
[arduplane](../../aircraft/autopilots/arduplane/autopilot.eq),
[px4](../../aircraft/autopilots/px4/autopilot.eq), [pid](examples/pid.eq). This page is made by `make guide`.
"""
# Title, airframe that the diagrams are of, airframes whose values the table has.
SECTIONS = (
    ("inverting", "rascal", ("x8", "rascal")),
    ("arduplane", "rascal@arduplane", ("x8@arduplane",)),
    ("px4", "rascal@px4", ("x8@px4",)),
    ("pid, the example of your own", "{example}", ()),
)


def example(folder: Path) -> str:
    """The guide's own autopilot on a copy of the X8: what names it."""
    if not (folder / "my-wing").exists():
        shutil.copytree(load("x8").folder, folder / "my-wing")
        shutil.copy(EXAMPLE, folder / "my-wing")
    return f"{folder / 'my-wing'}@{EXAMPLE.name}"


def airframe(name: str, folder: Path) -> Airframe:
    return load(example(folder) if name == "{example}" else name)


def markdown() -> str:
    """The page."""
    parts = [HEAD]
    with tempfile.TemporaryDirectory() as folder:
        for title, drawn, compared in SECTIONS:
            one = airframe(drawn, Path(folder))
            equations = equations_of(one).of(one.gain_values())
            parts.append(f"## {title}\n")
            autopilot = one.autopilot.removesuffix(".eq")
            for output in outputs(equations):
                name = output.removesuffix("_norm")
                parts.append(f"![{autopilot}: {name}](figures/blocks/{autopilot}-{name}.svg)\n")
            parts.append("\n".join(table(one, [load(n) for n in compared])) + "\n")
    return "\n".join(parts)


def table(one: Airframe, compared: list[Airframe]) -> list[str]:
    """A row for each parameter and each gain that the equations describe."""
    equations = equations_of(one)
    heads = ["gain", "unit", *(["default"] if equations.parameters else []), *(a.name for a in compared)]
    lines = [f"| {' | '.join([*heads, 'usual', 'what it does'])} |", "|---" * (len(heads) + 2) + "|"]
    for p in equations.parameters.values():
        values = [cell(a.parameters.get(p.name, p.default)) for a in compared]
        lines.append(row(p.name, p.unit, [cell(p.default), *values], p.low, p.high, p.meaning))
    for g in equations.gains:
        section, _, name = g.name.partition("_")
        values = [cell(a.gains.get(section, {}).get(name, "")) for a in compared]
        lines.append(row(f"{section}.{name}", g.unit, values, g.low, g.high, g.meaning))
    return lines


def row(name: str, unit: str, values: list[str], low: float | None, high: float | None, does: str) -> str:
    span = "" if low is None or high is None else f"{low:g} to {high:g}"
    return f"| `{name}` | {' | '.join([unit, *values, span, does])} |"


def draw(folder: Path) -> None:
    """The page's diagrams, SVG only."""
    from testbed.report.block_diagram import write

    with tempfile.TemporaryDirectory() as aside:
        for _, drawn, _ in SECTIONS:
            write(airframe(drawn, Path(aside)), folder)
    for file in folder.glob("*.png"):
        file.unlink()


if __name__ == "__main__":
    if len(sys.argv) > 1:
        draw(Path(sys.argv[1]))
    print(markdown(), end="")
