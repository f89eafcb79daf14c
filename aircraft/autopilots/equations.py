"""Compiles the autopilot's equations and an airframe's gains into a JSBSim `<system>`.

The equations are in `autopilot.eq` beside this file. `testbed aircraft autopilot` writes the XML, which flies
in any JSBSim host. One equation becomes one named component, with its formula as a comment.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from aircraft.airframes.schema import Airframe, property_name

EQUATIONS = Path(__file__).with_name("autopilot.eq")
MADE_BY = "Made by `testbed aircraft autopilot`"  # marks a compiled autopilot

_BINARY: dict[type[ast.AST], str] = {
    ast.Add: "sum",
    ast.Sub: "difference",
    ast.Mult: "product",
    ast.Div: "quotient",
    ast.Gt: "gt",
    ast.Lt: "lt",
    ast.Eq: "eq",
    ast.NotEq: "nq",
}
_FUNCTIONS = {"min", "max", "abs", "sqrt", "sin", "cos", "atan", "where"}


@dataclass(frozen=True)
class Equation:
    """`name = formula`, and the property besides ap/NAME that it drives, if any."""

    name: str
    formula: str
    output: str | None


@dataclass
class Channel:
    """Equations in order, evaluated every so many periods while ap/CONDITION is set; for airframes that have
    gains of `section`."""

    name: str
    section: str | None
    condition: str | None
    every: int = 1
    equations: list[Equation] = field(default_factory=list)


@dataclass
class Equations:
    """The file, parsed: other systems' properties in use, inputs with defaults, channels of equations."""

    uses: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, tuple[float, str | None]] = field(default_factory=dict)  # default, section
    channels: list[Channel] = field(default_factory=list)

    def of(self, gains: Iterable[str]) -> Equations:
        """Without what is for airframes that have a section which these gains (section_name) lack."""
        sections = {None, *(g.partition("_")[0] for g in gains)}
        inputs = {name: (value, s) for name, (value, s) in self.inputs.items() if s in sections}
        return Equations(self.uses, inputs, [c for c in self.channels if c.section in sections])

    def assigned(self) -> list[str]:
        """Names with an equation, in order, once each."""
        return list(dict.fromkeys(e.name for c in self.channels for e in c.equations))


def parse(text: str) -> Equations:
    """The equations of `text`. Raises ValueError naming the line that does not parse."""
    parsed = Equations()
    for number, line in enumerate(text.splitlines(), 1):
        line = line.split("#")[0].strip()
        if not line:
            continue
        if m := re.fullmatch(r"use (\w+) = (\S+)", line):
            parsed.uses[m[1]] = m[2]
        elif m := re.fullmatch(r"input (\w+)(?: for (\w+))? = (\S+)", line):
            parsed.inputs[m[1]] = (float(m[3]), m[2])
        elif m := re.fullmatch(r"== (\w+)(?: for (\w+))?(?: if (\w+))?(?: every (\d+))? ==", line):
            parsed.channels.append(Channel(m[1], m[2], m[3], int(m[4] or 1)))
        elif m := re.fullmatch(r"(\w+) = (.+?)(?: -> (\S+))?", line):
            parsed.channels[-1].equations.append(Equation(m[1], m[2], m[3]))
        else:
            raise ValueError(f"line {number}: not a use, input, channel or equation: {line}")
    return parsed


@cache
def autopilot() -> Equations:
    """The autopilot's equations, `autopilot.eq`."""
    return parse(EQUATIONS.read_text(encoding="utf-8"))


def of_airframe(airframe: Airframe) -> Equations:
    """The autopilot's equations, those that this airframe has."""
    return autopilot().of(airframe.gain_values())


def _xml(node: ast.AST, properties: Mapping[str, str]) -> str:
    """One expression as JSBSim function elements."""

    def element(tag: str, *children: ast.AST) -> str:
        return f"<{tag}>{''.join(_xml(c, properties) for c in children)}</{tag}>"

    def flat(n: ast.AST, kind: type[ast.AST]) -> Iterator[ast.AST]:
        """The terms of a sum, the factors of a product: n-ary elements evaluate faster than nested pairs."""
        if isinstance(n, ast.BinOp) and isinstance(n.op, kind):
            yield from flat(n.left, kind)
            yield from flat(n.right, kind)
        else:
            yield n

    match node:
        case ast.Constant(value=value):
            return f"<v>{value!r}</v>"
        case ast.Name(id=name):
            if name not in properties:
                raise ValueError(f"{name} is neither an equation, an input, a use nor a gain")
            return f"<p>{properties[name]}</p>"
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return f"<product><v>-1</v>{_xml(operand, properties)}</product>"
        case ast.BinOp(op=ast.Add() | ast.Mult() as op):
            return element(_BINARY[type(op)], *flat(node, type(op)))
        case ast.BinOp(left=left, op=op, right=right):
            return element(_BINARY[type(op)], left, right)
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return element(_BINARY[type(op)], left, right)
        case ast.Call(func=ast.Name(id="clip"), args=[x, low, high]):
            return f"<max>{_xml(low, properties)}{element('min', x, high)}</max>"
        case ast.Call(func=ast.Name(id=name), args=args) if name in _FUNCTIONS:
            return element("ifthen" if name == "where" else name, *args)
    raise ValueError(f"cannot express {ast.unparse(node)} in JSBSim")


def system_xml(equations: Equations, gains: Mapping[str, float]) -> str:
    """The `<system>` of these equations with `gains` (name -> value, SI) as the properties' defaults."""
    equations = equations.of(gains)
    assigned = equations.assigned()
    names = {**dict.fromkeys([*equations.inputs, *gains, *assigned])}
    properties = {n: property_name(n) for n in names} | equations.uses
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {MADE_BY}; edit autopilot.eq and airframe.toml. -->",
        '<system name="autopilot">',
    ]
    defaults = {n: v for n, (v, _) in equations.inputs.items()} | dict(gains) | dict.fromkeys(assigned, 0.0)
    lines += [f'  <property value="{v!r}"> {property_name(n)} </property>' for n, v in defaults.items()]
    for channel in equations.channels:
        when = f' execute="{property_name(channel.condition)}"' if channel.condition else ""
        when += f' execrate="{channel.every}"' if channel.every > 1 else ""
        lines.append(f'  <channel name="{channel.name}"{when}>')
        for e in channel.equations:
            output = f"<output>{e.output}</output>" if e.output else ""
            formula = _xml(ast.parse(e.formula, mode="eval").body, properties)
            lines += [
                f"    <!-- {e.name} = {e.formula.replace('--', '- -')} -->",
                f'    <fcs_function name="{property_name(e.name)}">',
                f"      <function>{formula}</function>{output}",
                "    </fcs_function>",
            ]
        lines.append("  </channel>")
    return "\n".join([*lines, "</system>", ""])
