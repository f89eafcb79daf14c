"""Scenario files from a fuzzer: a valid run, or one line with the field's path. Never anything else.

`make test` tries 600 files, the same every time; `make soak` twenty times as many, new ones every time.
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from testbed.errors import UserError
from testbed.scenario import Scenario, builtin, load
from testbed.simulate import run

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


def everything() -> dict[str, Any]:
    """A scenario with every field said, those of lists too."""
    said = Scenario.model_validate({"name": "all", "vehicles": 2}).model_dump(exclude_none=True)
    place = {"x_m": 0.0, "y_m": 0.0, "course_deg": 0.0, "goal_x_m": 100.0, "goal_y_m": 0.0}
    said["start"] |= {"pattern": "list", "places": [place, place | {"x_m": 100.0, "course_deg": 180.0}]}
    said["barrier"] |= {"sigma": [1.0, 1.1], "zeta_mps": [0.0, 0.1]}
    said["barrier"]["manoeuvres"] = [{"v_mps": 16.0, "omega_degps": 11.7, "zeta_mps": 0.0}]
    said["alpha"]["coefficients"] = [0.1, 0.1]
    return dict(said)


SCHEMA = json.dumps(Scenario.model_json_schema())
ENUMS = re.findall(r'"enum": \[([^]]+)\]', SCHEMA)
BASES = [everything(), *(tomllib.loads(text) for text in builtin().values())]
TEXT = st.one_of(
    st.text(max_size=20),
    st.sampled_from(
        ["", " ", "../../x", "/etc/passwd", "[bold]", "[/x]", "$x^$", "<script>", "\x1b[2J", "\u202e", "a\nb", "."]
    ),
)  # fmt: skip
NUMBERS = st.one_of(
    st.integers(), st.floats(), st.sampled_from([0, -1, 1e-4, 1.0, 0.01, 500.0, 1e308, 5e-324, 1e-300]),
    st.integers(min_value=1, max_value=4000).map(lambda digits: 10**digits),
)  # fmt: skip
SCALARS = st.one_of(NUMBERS, TEXT, st.booleans(), st.dates(), st.datetimes(), st.times())
JUNK = st.recursive(
    SCALARS, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(TEXT, inner, max_size=3), max_leaves=8
)


def paths(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, inner in items:
        yield (*at, key)
        yield from paths(inner, (*at, key))


WORDS = sorted(set(re.findall(r'"const": "([^"]+)"', SCHEMA)) | {w for e in ENUMS for w in json.loads(f"[{e}]")})


def change(draw: st.DrawFn, tables: dict[str, Any], kinds: list[str]) -> tuple[Any, ...]:
    """Change one thing in `tables`; returns its path."""
    path = draw(st.sampled_from(list(paths(tables))))
    target: Any = tables
    for key in path[:-1]:
        target = target[key]
    old, key, kind = target[path[-1]], path[-1], draw(st.sampled_from(kinds))
    if kind == "plausible" and isinstance(old, bool):
        target[key] = not old
    elif kind == "plausible" and isinstance(old, str):
        target[key] = draw(st.sampled_from(WORDS))
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
def mutants(draw: st.DrawFn) -> tuple[str, tuple[Any, ...]]:
    """A scenario file with one thing in it changed, and the path of that."""
    tables: dict[str, Any] = json.loads(json.dumps(draw(st.sampled_from(BASES))))
    if draw(st.integers(0, 9)) == 0:
        key = draw(st.sampled_from(list(tables)))
        return document(tables) + f"{key} = 1\n", (key,)
    path = change(draw, tables, ["plausible", "number", "remove", "add", "rename", "nest", "junk", "junk"])
    return document(tables), path


@st.composite
def variants(draw: st.DrawFn) -> str:
    """A scenario file with some things in it changed to others that might be meant."""
    tables: dict[str, Any] = json.loads(json.dumps(draw(st.sampled_from(BASES))))
    for _ in range(draw(st.integers(1, 4))):
        change(draw, tables, ["plausible"])
    return document(tables)


def brief(s: Scenario) -> Scenario | None:
    """`s` over at most two filter periods, or None where even that is long."""
    if s.vehicles > 12 or s.rates.fdm_steps > 2000 or s.plant == "jsbsim":
        return None
    # Flying gamma takes a full turn, whatever the run.
    checks = s.checks.model_copy(update={"manoeuvre_instants": 0})
    duration = min(s.duration_s, 2 * s.rates.filter_dt_s)
    return s.model_copy(update={"duration_s": duration, "checks": checks})


def sound(s: Scenario) -> None:
    """Fly `s`: what is recorded must be numbers, what is judged must be verdicts."""
    result = run(s, force=True)
    vehicles, pairs = result.tables["vehicles"], result.tables["pairs"]
    for name, values in vehicles.items():
        assert values.dtype.kind != "f" or np.isfinite(values).all(), name
    assert not pairs or np.isfinite(pairs["h_m"]).all() and np.isfinite(pairs["distance_m"]).all()
    json.dumps(result.guarantees)


def answer(file: Path) -> str:
    """What the program says to a scenario file; "" after a valid run."""
    with no_hang():
        try:
            s = load(file)
            small = brief(s)
            if small is not None:
                sound(small)
        except UserError as error:
            return str(error)
    return ""


@given(mutants())
@cases(300)
def test_one_change_to_a_scenario_is_flown_or_named(tmp_path_factory, mutant) -> None:  # type: ignore[no-untyped-def]
    text, path = mutant
    file = tmp_path_factory.getbasetemp() / "mutant.toml"
    file.write_text(text, encoding="utf-8")
    said = answer(file)
    assert "\n" not in said and len(said) < 3000
    if said and "not valid TOML" not in said:
        named = [str(UserError(p)) for p in path if isinstance(p, str)]
        assert any(n[:20] in said for n in named), (said, path)


@given(variants())
@cases(150)
def test_changes_that_might_be_meant_are_flown_or_refused(tmp_path_factory, text) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path_factory.getbasetemp() / "variant.toml"
    file.write_text(text, encoding="utf-8")
    said = answer(file)
    assert "\n" not in said and len(said) < 3000


VALID = document(BASES[1]).encode()


@st.composite
def damaged(draw: st.DrawFn) -> bytes:
    """Bytes that were a scenario file, or never were."""
    kind = draw(st.sampled_from(["raw", "flip", "cut", "insert", "deep", "long"]))
    at = draw(st.integers(0, len(VALID) - 1))
    if kind == "raw":
        return draw(st.binary(max_size=200))
    if kind == "flip":
        return VALID[:at] + bytes([VALID[at] ^ draw(st.integers(1, 255))]) + VALID[at + 1 :]
    if kind == "cut":
        return VALID[:at]
    if kind == "insert":
        return VALID[:at] + draw(st.sampled_from([b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\n[a]\n", b"'''"])) + VALID[at:]
    if kind == "deep":
        depth = draw(st.integers(1, 20_000))
        return VALID + b"x = " + draw(st.sampled_from([b"[", b"{a="])) * depth
    return VALID + b"x = " + draw(st.sampled_from([b"9", b"1.", b"'a'", b"a."])) * draw(st.integers(1, 20_000))


@given(damaged())
@cases(150)
def test_bytes_are_a_scenario_or_refused_in_one_line(tmp_path_factory, content) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path_factory.getbasetemp() / "damaged.toml"
    file.write_bytes(content)
    said = answer(file)
    assert "\n" not in said and len(said) < 3000
