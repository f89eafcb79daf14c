"""The registry of claims and the form of a verdict."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

from testbed.claims import registry
from testbed.claims.monitored import MONITORED
from testbed.records.checksums import plain
from testbed.records.verdict import Kind, Status, Verdict
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

ROOT = Path(__file__).parent.parent
EVERY = (*registry.CLAIMS.values(), *MONITORED)
# Words that are a claim's name and something else: a statistic, a field of scenarios, a check, a table.
HOMONYMS = {
    "goal": {
        "filters/rivals/navigation.py",
        "testbed/cli/encounters.py",
        "testbed/components/own_code/roles.py",
        "testbed/encounters/scenarios.py",
        "testbed/scenario/contents.py",
        "testbed/studies/benchmark/file.py",
        "testbed/studies/benchmark/meetings.py",
        "testbed/verification/departed.py",
        "testbed/verification/settings.py",
    },
    "separation": {"testbed/measures/run_statistics.py", "testbed/studies/paper/paper.py"},
    "gradient": {
        "filters/cbf/theorem_monitor.py",
        "testbed/claims/monitored.py",
        "testbed/measures/run_statistics.py",
        "testbed/verification/fleet.py",
        "testbed/verification/monitor_claims.py",
        "testbed/verification/rows.py",
    },
}


def constants(file: Path) -> set[str]:
    tree = ast.parse(file.read_text(encoding="utf-8"))
    return {
        node.value for node in ast.walk(tree) if isinstance(node, ast.Constant) and type(node.value) is str
    }


def test_a_claims_name_stands_in_one_source_file() -> None:
    ids = {claim.id for claim in EVERY}
    for folder in ("testbed", "aircraft", "filters"):
        for file in (ROOT / folder).rglob("*.py"):
            name = file.relative_to(ROOT).as_posix()
            if name != "testbed/claims/registry.py":
                spelt = {word for word in constants(file) & ids if name not in HOMONYMS.get(word, ())}
                assert not spelt, f"{name} spells {spelt}; take it from testbed.claims.registry"


def test_a_claims_number_begins_with_the_letter_of_its_kind_and_names_are_unique() -> None:
    assert all(claim.number.startswith(claim.kind.value) for claim in EVERY)
    assert len({claim.id for claim in EVERY}) == len(EVERY)
    numbers = [claim.number for claim in registry.CLAIMS.values()]
    assert len(set(numbers)) == len(numbers)


def test_runs_are_judged_by_the_claims_of_the_registry_in_its_order() -> None:
    short = ["duration_s=0.1", "filter.monitor=true", "manoeuvre_instants=1"]
    rare = (*registry.OWN, *registry.INTRUDERS, *registry.RANGES, *registry.LIVENESS)
    due = [claim for claim in EVERY if claim not in rare]
    judged = run(load("paper-2-turn", short))
    assert [v.id for v in judged.guarantees] == [claim.id for claim in due if claim not in registry.FENCES]
    judged = run(load("paper-2-turn", [*short, 'fence=[{kind="heights", floor_m=-50}]']))
    assert [v.id for v in judged.guarantees] == [claim.id for claim in due]
    for verdict, claim in zip(judged.guarantees, due, strict=True):
        assert (verdict.number, verdict.kind, verdict.source) == (claim.number, claim.kind, claim.source)


VERDICT = registry.SAFE_SET.unjudged("squared", 20.0).but(
    value=-1.5, bound=0.0, margin=-1.5, instant=2.25, vehicles=(1, 3), status=Status.VIOLATED, detail={"a": 1}
)


def test_a_verdict_on_disk_is_the_verdict_read_back() -> None:
    entry = json.loads(json.dumps(VERDICT.to_json()))
    assert list(entry) == [
        "id", "number", "claim", "source", "quantity", "unit", "value", "bound", "margin", "t_s", "vehicles",
        "verdict", "why", "detail",
    ]  # fmt: skip
    assert (entry["t_s"], entry["verdict"], entry["unit"]) == (2.25, "violated", "m^2")
    back = Verdict.from_json(entry)
    assert back == VERDICT and (back.kind, back.status) == (Kind.GUARANTEE, Status.VIOLATED)
    assert plain([VERDICT]) == [entry]


def test_a_verdict_reads_like_a_dictionary_with_the_keys_of_run_files() -> None:
    assert (VERDICT["verdict"], VERDICT["t_s"], VERDICT["vehicles"]) == ("violated", 2.25, [1, 3])
    assert dict(VERDICT) == VERDICT.to_json() and VERDICT.get("kind") is None and "value" in VERDICT
    with pytest.raises(AttributeError):
        VERDICT.value = 0.0  # type: ignore[misc]


@pytest.mark.parametrize(
    "wrong", [{"verdict": "fine"}, {"number": "X1"}, {"number": ""}, {"vehicles": None}, {"more": 1}]
)
def test_an_entry_that_states_no_verdict_is_refused(wrong: dict[str, object]) -> None:
    with pytest.raises((ValueError, TypeError)):
        Verdict.from_json(VERDICT.to_json() | wrong)


def test_only_claims_that_can_be_lost_are_counted() -> None:
    assert registry.INTERVENTION not in registry.JUDGED and registry.MANOEUVRE_KEEPS_DS in registry.JUDGED
    assert all(claim.kind in (Kind.GUARANTEE, Kind.OWN) for claim in registry.JUDGED)
