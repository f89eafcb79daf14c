"""Reads formulas of signal temporal logic from text.

formula   := either ["implies" formula]
either    := both {"or" both}                 both := until {"and" until}
until     := unary ["until" [interval] unary]
unary     := ("not" | ("always" | "eventually") [interval]) unary | comparison
comparison := sum [("<" | "<=" | ">" | ">=") sum]
sum       := product {("+" | "-") product}    product := factor {("*" | "/") factor}
factor    := number | column | "abs" "(" sum ")" | "-" factor | "(" formula ")"
interval  := "[" seconds "," (seconds | "end") "]"
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from math import isfinite

from testbed.errors import UserError, nearest, short
from testbed.requirements.formula import (
    Always,
    And,
    Arithmetic,
    ColumnName,
    Comparison,
    Eventually,
    Expression,
    Formula,
    Interval,
    Not,
    Number,
    Or,
    Until,
)

_TOKEN = re.compile(
    r"\s*(?:(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|(\w+)|(<=|>=|==|!=|->|&&|\|\||.))"
)
_WORDS = {"&&": "and", "&": "and", "||": "or", "|": "or", "!": "not", "->": "implies"}
WORDS = ("always", "eventually", "until", "and", "or", "not", "implies", "abs", "end")
LONGEST = 1000
MOST_DEPTH = 50
_Read = Callable[[], Formula | Expression]
_EXAMPLE = '"always[0,20](distance_m > 5)"'


def parse(text: str) -> Formula:
    """The formula of a text. Raises UserError with the place in it."""
    if len(text) > LONGEST:
        raise UserError(f"requirement {short(text)!r} has more than {LONGEST} letters")
    return _Parser(text, _tokens(text)).whole()


@dataclass(frozen=True)
class _Token:
    kind: str  # number, word, sign or end
    text: str
    at: int


def _tokens(text: str) -> list[_Token]:
    found, at = [], 0
    while at < len(text.rstrip()):
        match = _TOKEN.match(text, at)
        assert match is not None
        number, word, sign = match.groups()
        place = match.end() - len(number or word or sign) + 1
        if number:
            found.append(_Token("number", number, place))
        elif word and word[0].isdigit():
            raise UserError(
                f"requirement {short(text)!r}: {word!r} at letter {place} is no number and no column"
            )
        else:
            said = word or _WORDS.get(sign, sign)
            found.append(_Token("word" if said.isidentifier() else "sign", said, place))
        at = match.end()
    return [*found, _Token("end", "", len(text) + 1)]


@dataclass
class _Parser:
    text: str
    tokens: list[_Token]
    place: int = 0
    depth: int = field(default=0)

    @property
    def now(self) -> _Token:
        return self.tokens[self.place]

    def whole(self) -> Formula:
        found = self._formula_of(self._formula(), self.now)
        if self.now.kind != "end":
            raise self._wrong("is not expected there", "join formulas by and, or, implies or until")
        return found

    def _take(self, *texts: str) -> _Token | None:
        if self.now.kind in ("word", "sign") and self.now.text in texts:
            self.place += 1
            return self.tokens[self.place - 1]
        return None

    def _expect(self, text: str, why: str) -> None:
        if self._take(text) is None:
            raise self._wrong(f"stands where {text} is expected, {why}")

    def _formula(self) -> Formula | Expression:
        self.depth += 1
        if self.depth > MOST_DEPTH:
            raise self._wrong("is nested too deeply", "split the requirement")
        first = self._either()
        if token := self._take("implies"):
            then = self._formula_of(self._formula(), token)
            first = Or((Not(self._formula_of(first, token)), then))
        self.depth -= 1
        return first

    def _either(self) -> Formula | Expression:
        return self._joined("or", Or, self._both)

    def _both(self) -> Formula | Expression:
        return self._joined("and", And, self._until)

    def _joined(self, word: str, kind: type[And] | type[Or], one: _Read) -> Formula | Expression:
        first, parts = one(), list[Formula]()
        while token := self._take(word):
            parts = parts or [self._formula_of(first, token)]
            parts.append(self._formula_of(one(), token))
        return kind(tuple(parts)) if parts else first

    def _until(self) -> Formula | Expression:
        left = self._unary()
        if token := self._take("until"):
            during = self._interval()
            right = self._formula_of(self._unary(), token)
            return Until(self._formula_of(left, token), right, during)
        return left

    def _unary(self) -> Formula | Expression:
        self.depth += 1
        if self.depth > MOST_DEPTH:
            raise self._wrong("is nested too deeply", "split the requirement")
        try:
            if token := self._take("not"):
                return Not(self._formula_of(self._unary(), token))
            if token := self._take("always", "eventually"):
                during = self._interval()
                of = self._formula_of(self._unary(), token)
                return Always(of, during) if token.text == "always" else Eventually(of, during)
            return self._comparison()
        finally:
            self.depth -= 1

    def _interval(self) -> Interval:
        if self._take("[") is None:
            return Interval()
        first = self._seconds()
        if self._take(",", ":") is None:
            raise self._wrong("stands where a comma is expected", "an interval is [first,last] in s")
        last = None if self._take("end") else self._seconds()
        self._expect("]", "which ends an interval")
        if last is not None and last < first:
            raise UserError(f"{self._said()}: the interval [{first:g},{last:g}] ends before it begins")
        return Interval(first, last)

    def _seconds(self) -> float:
        token = self.now
        if token.kind != "number":
            raise self._wrong(
                "is no time", "an interval is [first,last] in s, with last = end for the run's end"
            )
        self.place += 1
        return float(token.text)

    def _comparison(self) -> Formula | Expression:
        left = self._sum()
        token = self._take("<", "<=", ">", ">=", "==", "!=", "=")
        if token is None:
            return left
        if "=" in token.text and token.text not in ("<=", ">="):
            remedy = "two numbers of a run are hardly ever equal; write abs(a - b) < tolerance"
            raise self._wrong("is not read", remedy, token)
        one, other = self._number_of(left, token), self._number_of(self._sum(), token)
        if self.now.text in ("<", "<=", ">", ">="):
            raise self._wrong("compares a third time", "write a < b and b < c")
        return Comparison(one, other, token.at) if ">" in token.text else Comparison(other, one, token.at)

    def _sum(self) -> Formula | Expression:
        return self._chain(("+", "-"), self._product)

    def _product(self) -> Formula | Expression:
        return self._chain(("*", "/"), self._factor)

    def _chain(self, signs: tuple[str, ...], one: _Read) -> Formula | Expression:
        found = one()
        while token := self._take(*signs):
            both = (self._number_of(found, token), self._number_of(one(), token))
            found = Arithmetic(token.text, both, token.at)
        return found

    def _factor(self) -> Formula | Expression:
        token = self.now
        if token.kind == "number":
            self.place += 1
            if not isfinite(float(token.text)):
                raise self._wrong("is too large", token=token)
            return Number(float(token.text))
        if self._take("-"):
            return Arithmetic("neg", (self._number_of(self._factor(), token),), token.at)
        if self._take("abs"):
            self._expect("(", "behind abs")
            of = self._number_of(self._sum(), token)
            self._expect(")", "which ends abs(...)")
            return Arithmetic("abs", (of,), token.at)
        if self._take("("):
            found = self._formula()
            self._expect(")", "which ends what ( began")
            return found
        if token.kind == "word" and token.text not in WORDS:
            self.place += 1
            if self.now.text in ("(", "["):
                hint = nearest(token.text, WORDS)
                raise self._wrong("is no operator", hint, token)
            return ColumnName(token.text, token.at)
        raise self._wrong("stands where a column or a number is expected", f"for example {_EXAMPLE}")

    def _formula_of(self, found: Formula | Expression, token: _Token) -> Formula:
        if isinstance(found, Expression):
            where = f"{token.text!r} at letter {token.at}" if token.text else "it"
            raise UserError(
                f"{self._said()}: {where} is about a number, not a comparison; for example {_EXAMPLE}"
            )
        return found

    def _number_of(self, found: Formula | Expression, token: _Token) -> Expression:
        if not isinstance(found, Expression):
            said = f"{token.text!r} at letter {token.at} is about a formula, not a number"
            raise UserError(f"{self._said()}: {said}; compare columns and numbers")
        return found

    def _wrong(self, what: str, remedy: str = "", token: _Token | None = None) -> UserError:
        token = token or self.now
        said = f"{token.text!r} at letter {token.at}" if token.kind != "end" else "the end"
        return UserError(f"{self._said()}: {said} {what}" + (f"; {remedy}" if remedy else ""))

    def _said(self) -> str:
        return f"requirement {short(self.text)!r}"
