"""Words that run folders and the guide promise: the registry of claims, and the table of what is covered."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from testbed.claims import promises, registry
from testbed.records.verdict import Kind, Status
from testbed.verification import coverage_table
from tests import registered
from tests.hand_made_runs import recorded, scenario

REMAKE = (
    "the words changed: earlier runs differ from now on. If so it shall be: cd tests && python registered.py"
)


def test_the_claims_are_those_of_earlier_runs() -> None:
    assert registered.text(registered.claims()) == registered.CLAIMS.read_text(encoding="utf-8"), REMAKE
    assert {c.kind for c in registry.EVERY} == {Kind.PREMISE, Kind.GUARANTEE, Kind.OWN}


def test_claims_are_grouped_by_what_they_rest_on() -> None:
    def numbers(claims: Any) -> list[str]:
        return [c.number for c in claims]

    assert numbers(registry.PREMISES) == ["P1", "P2", "P3", "P4", "P5", "P6"]
    assert numbers(registry.GUARANTEES) == ["G1", "G2", "G3", "G4a", "G4", "G5", "G6", "G7", "G8"]
    assert numbers(registry.OWN) == ["O1", "O2", "O3"] and numbers(registry.RANGES) == ["P7"]
    assert numbers(registry.INTRUDERS) == ["G1i"] and numbers(registry.FENCES) == ["G10", "G11"]
    assert numbers(registry.OF_THE_PAPERS_BARRIER) == ["G2", "G3", "G4a", "G6", "G9", "G11"]
    judged = "G1 G2 G3 G4a G4 G5 G6 G7 G7b G9 G1i G10 G11 O1 O2 O3"
    lost = set(judged.split())
    assert set(numbers(registry.JUDGED)) == lost and len(registry.JUDGED) == len(lost)
    assert {c.id for c in registry.EVERY} == set(registry.CLAIMS)
    assert registry.NOT_ITS_CLAIM == "not this filter's claim"


def test_what_a_filter_did_not_claim_is_excused() -> None:
    own, flow = promises.excused(declared=True), promises.excused(declared=False, kind="flow")
    assert own == {c.id for c in registry.OF_THE_PAPERS_BARRIER}
    assert own - flow == {"rows-satisfied"} and flow < own
    assert promises.excused(declared=True, kind="flow") == flow
    assert promises.excused(declared=False) == frozenset()


def test_a_claim_without_data_is_not_applicable_in_the_scenarios_words() -> None:
    v = registry.GOAL.unjudged("root", 12.5)
    assert (v.id, v.number, v.kind, v.unit, v.status) == (
        "goal",
        "G7",
        Kind.GUARANTEE,
        "m",
        Status.NOT_APPLICABLE,
    )
    assert v.claim == "every vehicle passes its goal within 12.5 m before the run ends"
    assert v.source == registry.GOAL.source and v.quantity == registry.GOAL.quantity and v.value is None
    among = registry.GOAL.unjudged("root", 12.5, True).claim
    assert among == "every vehicle under the filter passes its goal within 12.5 m before the run ends"
    assert registry.SAFE_SET.unjudged("squared", 1.0, True).claim == "h >= 0 for ever"
    assert registry.SAFE_SET.unjudged("squared", 1.0).unit == "m^2"
    assert registry.SAFE_SET.unjudged("root", 1.0).unit == "m"
    assert registry.BARRIER_CONDITION.unjudged("squared", 1.0).unit == "m^2/s"


def test_a_check_inside_a_filter_makes_a_claim_with_its_unit() -> None:
    made = registry.check_claim("row", "each row is satisfied [m/s]")
    assert (made.id, made.number, made.kind) == ("monitor-row", "M", Kind.MONITOR) and made.unit == "m/s"
    assert made.text == "each row is satisfied" and made.source == "Theorems 3 and 4"
    assert made.quantity == "smallest seen"
    flow = registry.check_claim("a", "no unit", "F2", "its own theorem")
    assert (flow.number, flow.kind, flow.text, flow.unit) == ("F2", Kind.FLOW, "no unit", "")
    assert flow.source == "its own theorem" and registry.check_id("a") == flow.id == "monitor-a"
    twice = registry.check_claim("b", "a share [of all] [m]")
    assert (twice.text, twice.unit) == ("a share", "of all] [m")


# What is covered


def run(command: Any = None, override: bool = False, **scenario_fields: Any) -> Any:
    """Two vehicles at commands (2, 3); the usual one is inside the limits."""
    u = np.array([[20.0, 0.0, 0.0], [21.0, 0.1, 1.0]] if command is None else command, dtype=float)[None]
    made = recorded(scenario((0.1, 0.1, 0.1), **scenario_fields), np.zeros((1, 2, 4)), u)
    made.vehicles["override"] = np.array([[False, override]])
    return made


LIMITS = {"v_min_mps": 15.0, "v_max_mps": 25.0, "omega_max_degps": np.degrees(0.2), "zeta_max_mps": 3.0}
# Field -> commands of the first vehicle that touch that limit.
TOUCHING = {
    "limits.v_min_mps": [[15.0, 0.0, 0.0]],
    "limits.v_max_mps": [[25.0, 0.0, 0.0]],
    "limits.omega_max_degps": [[20.0, 0.2, 0.0], [20.0, -0.2, 0.0]],
    "limits.zeta_max_mps": [[20.0, 0.0, 3.0], [20.0, 0.0, -3.0]],
}


def test_the_table_of_what_is_covered_is_the_guides() -> None:
    assert registered.text(registered.covered()) == registered.COVERAGE.read_text(encoding="utf-8"), REMAKE
    quiet = run(limits=LIMITS)
    for name, checked in coverage_table.SCENARIO.items():
        assert checked.needs is None or checked.needs(quiet) is False, name


@pytest.mark.parametrize("field", TOUCHING)
def test_a_limit_shows_only_where_a_command_touches_it(field: str) -> None:
    def has_effect(name: str, u: Any) -> bool:
        needs = coverage_table.SCENARIO[name].needs
        assert needs is not None
        return needs(run([u, [20.0, 0.0, 0.0]], limits=LIMITS))

    for u in TOUCHING[field]:
        assert {name for name in TOUCHING if has_effect(name, u)} == {field}
        k = int(np.flatnonzero(np.array(u) != [20.0, 0.0, 0.0])[0])
        for off, due in ((5e-10, True), (2e-9, False)):
            near = list(u)
            near[k] -= off * np.sign(u[k] - 20.0 * (k == 0))
            assert has_effect(field, near) is due


def test_what_the_filter_was_told_shows_only_where_it_altered_a_command() -> None:
    def needs(name: str, made: Any) -> bool:
        found = coverage_table.SCENARIO[name].needs
        assert found is not None
        return found(made)

    scaled = scenario((0.1, 0.1, 0.1))["remedy"] | {"issf_epsilon": 10.0}
    robust = (f"remedy.robust_{name}" for name in ("v_mps", "omega_degps", "zeta_mps"))
    for name in ("filter.", "intruders.", "remedy.issf_epsilon", *robust):
        assert needs(name, run(override=True)) is True and needs(name, run()) is False
    for name in ("remedy.issf_v_mps", "remedy.issf_omega_degps", "remedy.issf_zeta_mps"):
        for epsilon, override, due in ((True, True, True), (True, False, False), (False, True, False)):
            made = run(override=override, **({"remedy": scaled} if epsilon else {}))
            assert needs(name, made) is due
