"""What the fuzz tests share: how many cases, junk, TOML, and changes to a document.

`make test` tries 1,000 files and 2,000 compositions of parts, the same every time;
`make soak` tries twenty times as many, new every time.
"""

from __future__ import annotations

import json
import math
import os
import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from hypothesis import HealthCheck, settings
from hypothesis import strategies as st

TIMES = int(os.environ.get("TESTBED_FUZZ", "1"))
UNUSUAL_S = 60  # idle machine: 0.02 s a case


def cases(count: int) -> Callable[[Any], Any]:
    return settings(
        max_examples=count * TIMES, derandomize=TIMES == 1, database=None, deadline=None,
        suppress_health_check=list(HealthCheck), print_blob=True,
    )  # fmt: skip


@contextmanager
def no_hang() -> Iterator[None]:
    def late(*_: object) -> None:
        raise AssertionError(f"no answer in {UNUSUAL_S} s")

    before = signal.signal(signal.SIGALRM, late)
    signal.alarm(UNUSUAL_S)
    try:
        yield
    finally:
        signal.alarm(0)
        signal.signal(signal.SIGALRM, before)


def toml(value: Any) -> str:
    """A value as TOML writes it, tables inline."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else "nan" if math.isnan(value) else f"{value:+}"
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, list):
        return "[" + ", ".join(map(toml, value)) + "]"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{toml(k)} = {toml(v)}" for k, v in value.items()) + "}"
    return str(value)


def document(tables: dict[str, Any]) -> str:
    return "".join(f"{toml(key)} = {toml(value)}\n" for key, value in tables.items())


TEXT = st.one_of(
    st.text(max_size=20),
    st.sampled_from(
        ["", " ", "../x", "/etc/passwd", "[bold]", "[/x]", "$x^$", "<b>", "\x1b[2J", "\u202e", "a\nb", "."]
    ),
)  # fmt: skip
NUMBERS = st.one_of(
    st.integers(), st.floats(), st.sampled_from([0, -1, 1e-4, 1.0, 0.01, 500.0, 1e308, 5e-324, 1e-300]),
    st.integers(min_value=1, max_value=4000).map(lambda digits: 10**digits),
)  # fmt: skip
SCALARS = st.one_of(NUMBERS, TEXT, st.booleans(), st.dates(), st.datetimes(), st.times())
JUNK = st.recursive(
    SCALARS,
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=3),
    max_leaves=8,
)


def paths(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*at, key)
        yield from paths(inner, (*at, key))


def change(draw: st.DrawFn, tables: dict[str, Any], kinds: list[str], words: list[str]) -> tuple[Any, ...]:
    """Change one thing in `tables`; returns its path.

    words  that a text field may plausibly hold
    """
    path = draw(st.sampled_from(list(paths(tables))))
    target: Any = tables
    for key in path[:-1]:
        target = target[key]
    old, key, kind = target[path[-1]], path[-1], draw(st.sampled_from(kinds))
    if kind == "plausible" and isinstance(old, bool):
        target[key] = not old
    elif kind == "plausible" and isinstance(old, str):
        target[key] = draw(st.sampled_from(words))
    elif kind == "plausible" and isinstance(old, int):
        target[key] = old + draw(st.sampled_from([-1, 1, 10]))
    elif kind == "plausible" and isinstance(old, float):
        factor, more = st.sampled_from([0.1, 0.5, 2.0, 10.0, 1e3, -1.0]), st.sampled_from([0.0, 1.0, 30.0])
        target[key] = old * draw(factor) + draw(more)
    elif kind == "number" and isinstance(old, float):
        target[key] = draw(st.sampled_from([-old, old * 1e3, old * 1e-3, old + 1, 0, math.nan, math.inf]))
    elif kind == "remove":
        del target[key]
    elif kind == "add" and isinstance(target, dict):
        name = draw(TEXT)
        target[name], path = draw(JUNK), (*path[:-1], name)
    elif kind == "rename" and isinstance(target, dict):
        name = str(key) + draw(st.sampled_from(["s", "_", "\u0000", "\u00e9"]))
        target[name], path = target.pop(key), (*path[:-1], name)
    elif kind == "nest":
        target[key] = {"a": old} if draw(st.booleans()) else [old]
    elif kind != "plausible":
        target[key] = draw(JUNK)
    return path


@st.composite
def damaged(draw: st.DrawFn, valid: bytes) -> bytes:
    """Bytes that were the file `valid`, or never were one."""
    kind = draw(st.sampled_from(["raw", "flip", "cut", "insert", "deep", "long"]))
    at = draw(st.integers(0, len(valid) - 1))
    if kind == "raw":
        return draw(st.binary(max_size=200))
    if kind == "flip":
        return valid[:at] + bytes([valid[at] ^ draw(st.integers(1, 255))]) + valid[at + 1 :]
    if kind == "cut":
        return valid[:at]
    if kind == "insert":
        junk = [b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\n[a]\n", b"'''", b"<!--", b"]]>", b"&#0;", b"<a>"]
        return valid[:at] + draw(st.sampled_from(junk)) + valid[at:]
    times = draw(st.integers(1, 20_000))
    pieces = [b"[", b"{a=", b"<a>"] if kind == "deep" else [b"9", b"1.", b"'a'", b"a.", b"x='1' "]
    return valid + b"\nx = " + draw(st.sampled_from(pieces)) * times
