"""Scenario files from a fuzzer: a valid run, or one line with the field's path. Never anything else."""

from __future__ import annotations

import json
import re
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from testbed.errors import UserError
from testbed.scenario.scenario import Scenario, builtin, load
from testbed.simulation.simulate import run
from tests.fuzzing import cases, change, damaged, document, no_hang

PLACE = {"x_m": 0.0, "y_m": 0.0, "course_deg": 0.0, "goal_x_m": 100.0, "goal_y_m": 0.0}
GAMMA = {"v_mps": 16.0, "omega_degps": 11.7, "zeta_mps": 0.0}
# Tables of every kind, which take different fields.
KINDS: list[dict[str, Any]] = [
    {"barrier": {"sigma": [1.0, 1.1]}, "plant": "lagged", "lags": {"source": "table"}},
    {"start": {"pattern": "list", "places": [PLACE, PLACE | {"x_m": 100.0, "course_deg": 180.0}]}},
    {"barrier": {"kind": "straight", "zeta_mps": [0.0, 0.1]}, "alpha": {"kind": "linear"}},
    {"barrier": {"kind": "rollout", "manoeuvres": [GAMMA]}, "filter": {"kind": "limited"}},
    {"barrier": {"shared": False, "pairs": [{"i": 1, "j": 2, "v_mps": 16.0, "omega_degps": 11.7}]}},
    {"alpha": {"kind": "odd-polynomial", "coefficients": [0.1, 0.1]}, "filter": {"kind": "navigation"}},
    {"barrier": {"kind": "euclidean"}, "guidance": {"kind": "manoeuvre"}, "filter": {"kind": "none"}},
]


def everything() -> list[dict[str, Any]]:
    """Scenarios with every field said, of every kind of table."""
    said = [Scenario.model_validate({"name": "all", "vehicles": 2} | kinds) for kinds in KINDS]
    return [s.model_dump(mode="json", exclude_none=True) for s in said]


SCHEMA = json.dumps(Scenario.model_json_schema())
ENUMS = re.findall(r'"enum": \[([^]]+)\]', SCHEMA)
BASES = [*everything(), *(tomllib.loads(text) for text in builtin().values())]
WORDS = sorted(
    set(re.findall(r'"const": "([^"]+)"', SCHEMA)) | {w for e in ENUMS for w in json.loads(f"[{e}]")}
)


@st.composite
def mutants(draw: st.DrawFn) -> tuple[str, tuple[Any, ...]]:
    """A scenario file with one thing in it changed, and the path of that."""
    tables: dict[str, Any] = json.loads(json.dumps(draw(st.sampled_from(BASES))))
    if draw(st.integers(0, 9)) == 0:
        key = draw(st.sampled_from(list(tables)))
        return document(tables) + f"{key} = 1\n", (key,)
    path = change(
        draw, tables, ["plausible", "number", "remove", "add", "rename", "nest", "junk", "junk"], WORDS
    )
    return document(tables), path


@st.composite
def variants(draw: st.DrawFn) -> str:
    """A scenario file with some things in it changed to others that might be meant."""
    tables: dict[str, Any] = json.loads(json.dumps(draw(st.sampled_from(BASES))))
    for _ in range(draw(st.integers(1, 4))):
        change(draw, tables, ["plausible"], WORDS)
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
    assert not pairs or (np.isfinite(pairs["h_m"]).all() and np.isfinite(pairs["distance_m"]).all())
    json.dumps([v.to_json() for v in result.guarantees])


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


VALID = document({"name": "all", "vehicles": 2}).encode()


@example(VALID + b"x = " + b"9" * 5000)
@example(VALID + b"x = " + b"[" * 5000)
@given(damaged(VALID))
@cases(100)
def test_bytes_are_a_scenario_or_refused_in_one_line(tmp_path_factory, content) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path_factory.getbasetemp() / "damaged.toml"
    file.write_bytes(content)
    said = answer(file)
    assert "\n" not in said and len(said) < 3000
