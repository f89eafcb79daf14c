"""Compiles an autopilot's equations and its gains into a JSBSim `<system>`.

One equation becomes one named component, with its formula as a comment. `testbed aircraft autopilot` writes
the XML, which flies in any JSBSim host.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator, Mapping

from aircraft.airframes.schema import property_name
from aircraft.equations.language import DESIGN_DT_S, PERIOD, Channel, Equations, expression

MADE_BY = "Made by `testbed aircraft autopilot`"  # marks a compiled autopilot

_THROTTLE = "fcs/throttle-cmd-norm"
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


def _xml(node: ast.AST, properties: Mapping[str, str], period: str) -> str:
    """One expression as JSBSim function elements; `period` are those of the channel's period."""

    def within(n: ast.AST) -> str:
        return _xml(n, properties, period)

    def element(tag: str, *children: ast.AST) -> str:
        return f"<{tag}>{''.join(within(c) for c in children)}</{tag}>"

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
        case ast.Name(id=name) if name == PERIOD:
            return period
        case ast.Name(id=name):
            if name not in properties:
                raise ValueError(f"{name} is neither an equation, an input, a use nor a gain")
            return f"<p>{properties[name]}</p>"
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return f"<product><v>-1</v>{within(operand)}</product>"
        case ast.BinOp(op=ast.Add() | ast.Mult() as op):
            return element(_BINARY[type(op)], *flat(node, type(op)))
        case ast.BinOp(left=left, op=op, right=right):
            return element(_BINARY[type(op)], left, right)
        case ast.Compare(left=left, ops=[op], comparators=[right]):
            return element(_BINARY[type(op)], left, right)
        case ast.Call(func=ast.Name(id="clip"), args=[x, low, high]):
            return f"<max>{within(low)}{element('min', x, high)}</max>"
        case ast.Call(func=ast.Name(id="interp"), args=args):
            return element("interpolate1d", *args)
        case ast.Call(func=ast.Name(id="normal")):
            return "<random/>"
        case ast.Call(func=ast.Name(id=name), args=args):
            return element("ifthen" if name == "where" else name, *args)
    raise ValueError(f"cannot express {ast.unparse(node)} in JSBSim")


def system_xml(
    equations: Equations, gains: Mapping[str, float], dt: float = DESIGN_DT_S, engines: int = 1
) -> str:
    """The `<system>` of these equations with `gains` (name -> value, SI) as the properties' defaults.

    equations  those that the airframe has
    engines    how many get the throttle that the equations drive
    dt         s, the period of JSBSim: channels with a rate in Hz are evaluated every so many of these
    Raises     ValueError naming what has no value
    """
    assigned = equations.assigned()
    values = {n: p.default for n, p in equations.parameters.items()} | dict(gains)
    names = {**dict.fromkeys([*equations.inputs, *values, *assigned])}
    properties = {n: property_name(n) for n in names} | equations.uses
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {MADE_BY}; edit autopilot.eq and airframe.toml. -->",
        '<system name="autopilot">',
    ]
    defaults = {n: v for n, (v, _) in equations.inputs.items()} | values | dict.fromkeys(assigned, 0.0)
    lines += [f'  <property value="{v!r}"> {property_name(n)} </property>' for n, v in defaults.items()]
    for channel in equations.channels:
        lines += _channel(channel, properties, dt)
    if engines > 1:
        lines += _all_engines(engines)
    return "\n".join([*lines, "</system>", ""])


def _channel(channel: Channel, properties: Mapping[str, str], dt: float) -> Iterator[str]:
    every = channel.periods(dt)
    step = "<p>simulation/dt</p>"  # zero while the model is evaluated without moving
    period = step if every == 1 else f"<product><v>{every}</v>{step}</product>"
    when = f' execute="{property_name(channel.condition)}"' if channel.condition else ""
    when += f' execrate="{every}"' if every > 1 else ""
    yield f'  <channel name="{channel.name}"{when}>'
    for e in channel.equations:
        output = f"<output>{e.output}</output>" if e.output else ""
        try:
            formula = _xml(expression(e.formula), properties, period)
        except ValueError as error:
            raise ValueError(f"line {e.line}: {error}" if e.line else str(error)) from None
        yield f"    <!-- {e.name} = {e.formula.replace('--', '- -')} -->"
        yield f'    <fcs_function name="{property_name(e.name)}">'
        yield f"      <function>{formula}</function>{output}"
        yield "    </fcs_function>"
    yield "  </channel>"


def _all_engines(count: int) -> Iterator[str]:
    """A channel that gives every engine the first one's throttle, whoever commands it."""
    yield '  <channel name="engines">'
    for k in range(1, count):
        yield f'    <fcs_function name="{property_name(f"throttle_{k}_norm")}">'
        yield f"      <function><p>{_THROTTLE}</p></function><output>{_THROTTLE}[{k}]</output>"
        yield "    </fcs_function>"
    yield "  </channel>"
