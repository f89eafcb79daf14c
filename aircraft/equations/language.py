"""Parses the equations of an autopilot: what is used, inputs, parameters and channels of equations.

The language is described in docs/guide/autopilots.md. An equation may hold arithmetic, comparisons and the
functions of FUNCTIONS; nothing else is accepted, so that a file from somebody else cannot run code.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache

FUNCTIONS = {"min", "max", "abs", "sqrt", "sin", "cos", "atan", "where", "clip", "interp", "normal"}
PERIOD = "period"  # in an equation: the time from one evaluation of its channel to the next [s]
DESIGN_DT_S = 0.005  # period of the autopilot for which XML is written to a folder
_ARGUMENTS = {
    "where": (3, 3),
    "clip": (3, 3),
    "min": (2, 99),
    "max": (2, 99),
    "interp": (5, 99),
    "normal": (0, 0),
}
_OPERATORS = (ast.Add, ast.Sub, ast.Mult, ast.Div)
_COMPARISONS = (ast.Gt, ast.Lt, ast.Eq, ast.NotEq)
_NUMBER = r"[-+]?[\d.]+(?:[eE][-+]?\d+)?"
_PATH = r"[A-Za-z][\w.-]*(?:\[\d+\])?(?:/[A-Za-z][\w.-]*(?:\[\d+\])?)*"
_PARAMETER = re.compile(
    rf"parameter ([A-Za-z]\w*) = ({_NUMBER})(?: \[([^\]]*)\])?(?: ({_NUMBER}) to ({_NUMBER}))?(?:: (.*))?"
)
_GAIN = re.compile(rf"gain ([a-z][\w*]*)(?: \[([^\]]*)\])?(?: ({_NUMBER}) to ({_NUMBER}))?: (.+)")
_CHANNEL = re.compile(r"== (\w+)(?: for (\w+))?(?: if (\w+))?(?: every (\d+)| at (\d+(?:\.\d+)?) Hz)? ==")


@dataclass(frozen=True)
class Equation:
    """`name = formula`, the property besides ap/NAME that it drives, if any, and the line it begins on.

    section  only for airframes that have gains of this section;  but  only for those that lack these
    """

    name: str
    formula: str
    output: str | None
    line: int = 0
    section: str | None = None
    but: str | None = None


@dataclass(frozen=True)
class Parameter:
    """A gain that the file itself declares: default, unit, usual range, what it does."""

    name: str
    default: float
    unit: str = ""
    low: float | None = None
    high: float | None = None
    meaning: str = ""


@dataclass(frozen=True)
class Gain:
    """What a gain of airframe.toml does: unit, usual range. A * in its name stands for a number."""

    name: str
    unit: str
    low: float | None
    high: float | None
    meaning: str

    def is_of(self, name: str) -> bool:
        """Whether this is said of the gain `name`."""
        return re.fullmatch(re.escape(self.name).replace(r"\*", r"\d+"), name) is not None


@dataclass
class Channel:
    """Equations in order, evaluated every so many periods while ap/CONDITION is set.

    section  only for airframes that have gains of this section
    rate_hz  how often, in place of `every`, whatever the period
    """

    name: str
    section: str | None
    condition: str | None
    every: int = 1
    rate_hz: float | None = None
    equations: list[Equation] = field(default_factory=list)

    def periods(self, dt: float) -> int:
        """Every how many periods of dt [s] it is evaluated."""
        return self.every if self.rate_hz is None else max(1, round(1 / (self.rate_hz * dt)))


@dataclass
class Equations:
    """The file, parsed: other systems' properties in use, inputs with defaults, parameters, channels."""

    uses: dict[str, str] = field(default_factory=dict)
    inputs: dict[str, tuple[float, str | None]] = field(default_factory=dict)  # default, section
    parameters: dict[str, Parameter] = field(default_factory=dict)
    gains: list[Gain] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)

    def of(self, gains: Iterable[str]) -> Equations:
        """Without what is for airframes that have a section which these gains (section_name) lack."""
        sections = {None, *(g.partition("_")[0] for g in gains)}
        inputs = {name: (value, s) for name, (value, s) in self.inputs.items() if s in sections}
        channels = []
        for c in self.channels:
            if c.section in sections:
                apart = {e.but for e in c.equations} & sections - {None}
                mine = [e for e in c.equations if e.section in sections and e.but not in apart]
                channels.append(replace(c, equations=mine))
        return replace(self, inputs=inputs, channels=channels)

    def assigned(self) -> list[str]:
        """Names with an equation, in order, once each."""
        return list(dict.fromkeys(e.name for c in self.channels for e in c.equations))

    def about(self, gain: str) -> Gain | None:
        """What the file says of a gain of airframe.toml, section_name; None if nothing."""
        return next((g for g in self.gains if g.is_of(gain)), None)

    def read(self) -> set[str]:
        """Names that the equations read."""
        return set().union(*(names_in(e.formula) for c in self.channels for e in c.equations))

    def needed(self) -> set[str]:
        """Names that the equations read and the file does not give: gains of airframe.toml."""
        given = {*self.assigned(), *self.inputs, *self.uses, *self.parameters, PERIOD}
        return self.read() - given


def names_in(formula: str) -> set[str]:
    """The names that a formula reads, without functions."""
    return set(_names(formula))


@cache
def _names(formula: str) -> frozenset[str]:
    tree = expression(formula)
    called = {id(n.func) for n in ast.walk(tree) if isinstance(n, ast.Call)}
    return frozenset(n.id for n in ast.walk(tree) if isinstance(n, ast.Name) and id(n) not in called)


@cache
def expression(formula: str) -> ast.expr:
    """A formula's syntax tree. Raises ValueError saying what an equation may not hold."""
    try:
        tree = ast.parse(formula, mode="eval").body
    except (SyntaxError, ValueError, RecursionError, MemoryError):
        raise ValueError(f"not a formula: {formula}") from None
    _allow(tree)
    return tree


def _allow(node: ast.expr) -> None:
    match node:
        case ast.Constant(value=value) if isinstance(value, int | float) and not isinstance(value, bool):
            return
        case ast.Name():
            return
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _allow(operand)
        case ast.BinOp(left=left, op=op, right=right) if isinstance(op, _OPERATORS):
            _allow(left)
            return _allow(right)
        case ast.Compare(left=left, ops=[op], comparators=[right]) if isinstance(op, _COMPARISONS):
            _allow(left)
            return _allow(right)
        case ast.Call(func=ast.Name(id=name), args=args, keywords=[]) if name in FUNCTIONS:
            least, most = _ARGUMENTS.get(name, (1, 1))
            if not least <= len(args) <= most:
                raise ValueError(f"{name}() takes {least} argument{'s' * (least != 1)}, got {len(args)}")
            for argument in args:
                _allow(argument)
            return
    raise ValueError(
        f"an equation may not hold {ast.unparse(node)}; there are + - * /, comparisons with < > == != and"
        f" {', '.join(sorted(FUNCTIONS))}"
    )


def parse(text: str) -> Equations:
    """The equations of `text`. Raises ValueError naming the line that does not parse."""
    parsed = Equations()
    for number, line in _statements(text):
        try:
            _take(parsed, line, number)
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from None
    needed = parsed.needed() if parsed.gains else set()
    for gain in parsed.gains:
        if not any(gain.is_of(name) for name in needed):
            raise ValueError(f"gain {gain.name}: no equation reads it; remove the line, or correct the name")
    return parsed


def without_gains(text: str) -> str:
    """The text of equations without what it says of gains, which changes no flight."""
    return re.sub(r"^gain .*\n(?:[ \t]+\S.*\n)*", "", text, flags=re.MULTILINE)


def _statements(text: str) -> Iterator[tuple[int, str]]:
    """Lines without comments, with the lines that continue them: those that are indented."""
    number, said = 0, ""
    for n, line in enumerate(text.splitlines(), 1):
        line = line.split("#")[0].rstrip()
        if not line.strip():
            continue
        if said and line[0].isspace():
            said += " " + line.strip()
            continue
        if said:
            yield number, said
        number, said = n, line.strip()
    if said:
        yield number, said


def _take(parsed: Equations, line: str, number: int) -> None:
    if m := re.fullmatch(rf"use (\w+) = ({_PATH})", line):
        parsed.uses[m[1]] = m[2]
    elif m := re.fullmatch(rf"input (\w+)(?: for (\w+))? = ({_NUMBER})", line):
        parsed.inputs[m[1]] = (float(m[3]), m[2])
    elif m := _PARAMETER.fullmatch(line):
        low, high = (None if x is None else float(x) for x in (m[4], m[5]))
        parsed.parameters[m[1]] = Parameter(m[1], float(m[2]), m[3] or "", low, high, m[6] or "")
    elif m := _GAIN.fullmatch(line):
        low, high = (None if x is None else float(x) for x in (m[3], m[4]))
        if any(g.name == m[1] for g in parsed.gains):
            raise ValueError(f"gain {m[1]} is described twice")
        parsed.gains.append(Gain(m[1], m[2] or "", low, high, m[5]))
    elif m := _CHANNEL.fullmatch(line):
        rate = None if m[5] is None else float(m[5])
        if m[4] == "0" or rate == 0:
            raise ValueError("a channel is evaluated at least every period: a rate above zero")
        parsed.channels.append(Channel(m[1], m[2], m[3], int(m[4] or 1), rate))
    elif m := re.fullmatch(rf"(?:(for|without) (\w+): )?([A-Za-z]\w*) = (.+?)(?: -> ({_PATH}))?", line):
        word, section, name, formula, output = m.groups()
        if not parsed.channels:
            raise ValueError(f"{name} is before the first channel; begin one: == NAME ==")
        expression(formula)
        if output and not output.startswith("fcs/"):
            raise ValueError(f"{output}: an equation drives properties below fcs/ and no others")
        with_, but = (section if word == kind else None for kind in ("for", "without"))
        parsed.channels[-1].equations.append(Equation(name, formula, output, number, with_, but))
    else:
        raise ValueError(f"not a use, input, parameter, gain, channel or equation: {line}")
