"""Scenarios under the rivals that plan: flown, judged by their own claims, looked at again, and refused."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

import testbed
from testbed.scenario.scenario import Scenario, load
from testbed.verification.check import check
from tests.forgery import copied, differing, edit_entry, edit_table, entry, read, seal, write

OWN = {
    "backup": "F1 monitor-flow_clear",
    "gatekeeper": "R3 monitor-plan_clear",
    "receding-horizon": "R3 monitor-plan_clear",
}


def meeting(kind: str, **fields: object) -> Scenario:
    """Two vehicles near each other, head-on, at 20 Hz on the lagged plant."""
    said = {
        "filter.kind": kind,
        "plant": "lagged",
        "lags.source": "airframe",
        "guidance.lookahead_m": 10,
        "start.radius_m": 100,
        "rates.filter_dt_s": 0.05,
        "rates.record_dt_s": 0.05,
        "duration_s": 1.5,
        "manoeuvre_instants": 0,
    } | fields
    return load("paper-2-turn", [f"{k}={json.dumps(v)}" for k, v in said.items()])


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Kind -> run folder."""
    folder = tmp_path_factory.mktemp("rivals")
    for kind in OWN:
        testbed.run(meeting(kind), out=folder / kind)
    return {kind: folder / kind for kind in OWN}


@pytest.mark.parametrize("kind", OWN)
def test_a_run_is_judged_by_its_filters_own_claim_and_the_second_opinion_agrees(
    flown: dict[str, Path], kind: str
) -> None:
    entries = {f"{e['number']} {e['id']}": e for e in read(flown[kind], "guarantees.json")}
    assert entries[OWN[kind]]["verdict"] == "holds" and entries["G1 separation"]["verdict"] == "holds"
    # What rests on the paper's barrier it did not promise.
    assert entries["G2 safe-set"]["why"] == "not this filter's claim"
    found = {f.what: f for f in check(flown[kind]).findings}
    assert [f for f in found.values() if f.agrees is False] == []
    own = found[OWN[kind]]
    if kind == "backup":
        assert own.agrees is True and float(own.own) == pytest.approx(entries[OWN[kind]]["value"], abs=5e-3)
    elif kind == "gatekeeper":
        assert own.agrees is True
    else:
        assert own.agrees is None and "the value is at most" in own.why


@pytest.mark.parametrize(
    "kind, change",
    [
        ("backup", {"value": 40.0, "margin": 40.0}),
        ("backup", {"verdict": "violated"}),
        ("gatekeeper", {"verdict": "violated"}),
        ("gatekeeper", {"bound": -1.0, "margin": 2.0}),
        ("receding-horizon", {"value": -3.0}),
    ],
)
def test_a_forged_claim_is_found(
    flown: dict[str, Path], tmp_path: Path, kind: str, change: dict[str, object]
) -> None:
    folder, name = copied(flown[kind], tmp_path / "run"), OWN[kind].split()[1]
    edit_entry(folder, name, **change)
    seal(folder)
    assert name in differing(folder)


def test_a_backup_that_says_it_kept_more_than_it_did_is_told_by_its_commands(
    flown: dict[str, Path], tmp_path: Path
) -> None:
    folder = copied(flown["backup"], tmp_path / "run")
    manifest = read(folder, "manifest.json")
    manifest["scenario"]["filter"]["margin_m"] = 2.0
    write(folder, "manifest.json", manifest)
    seal(folder)
    assert "monitor-flow_clear" in differing(folder)


@pytest.fixture(scope="module")
def near(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Kind -> run folder of an encounter in which plans go to the border of what is clear."""
    folder = tmp_path_factory.mktemp("near")
    for kind in ("gatekeeper", "receding-horizon"):
        own = {"filter.horizon_s": 1.0} if kind == "gatekeeper" else {}
        s = meeting(kind, **{"start.radius_m": 50.0, "duration_s": 2.4}, **own)
        testbed.run(s, out=folder / kind)
    return {kind: folder / kind for kind in ("gatekeeper", "receding-horizon")}


def test_what_a_gatekeeper_committed_to_is_found_from_its_commands(near: dict[str, Path]) -> None:
    said = {e["id"]: e["value"] for e in read(near["gatekeeper"], "guarantees.json")}["monitor-plan_clear"]
    found = {f.what: f for f in check(near["gatekeeper"]).findings}[OWN["gatekeeper"]]
    assert abs(said) < 1.0 and found.agrees is True and float(found.own) == pytest.approx(said, abs=2e-3)


@pytest.mark.parametrize("kind", ["gatekeeper", "receding-horizon"])
def test_plans_that_say_they_kept_more_than_they_did_are_found(
    near: dict[str, Path], tmp_path: Path, kind: str
) -> None:
    folder = copied(near[kind], tmp_path / "run")
    e = entry(folder, "monitor-plan_clear")
    edit_entry(folder, "monitor-plan_clear", value=e["value"] + 5.0, margin=e["margin"] + 5.0)
    seal(folder)
    assert "monitor-plan_clear" in differing(folder)


def test_commands_that_no_plan_of_a_gatekeeper_has_are_found(near: dict[str, Path], tmp_path: Path) -> None:
    """Neither wanted now, nor committed to before, nor gamma."""
    folder = copied(near["gatekeeper"], tmp_path / "run")

    def turned(table: pd.DataFrame) -> pd.DataFrame:
        here = (table.vehicle == 1) & (abs(table.t_s - 1.0) < 1e-6)
        return table.assign(omega_command_radps=table.omega_command_radps.where(~here, 0.01))

    edit_table(folder, "vehicles", turned)
    seal(folder)
    found = {f.what: f for f in check(folder).findings}[OWN["gatekeeper"]]
    assert found.agrees is False and "vehicle 1 flies no plan that it can have had at 1 s" in found.why


def test_a_horizon_that_was_not_flown_is_found(near: dict[str, Path], tmp_path: Path) -> None:
    folder = copied(near["gatekeeper"], tmp_path / "run")
    manifest = read(folder, "manifest.json")
    manifest["scenario"]["filter"]["horizon_s"] = 0.1
    write(folder, "manifest.json", manifest)
    seal(folder)
    assert "monitor-plan_clear" in differing(folder)


def test_a_receding_horizon_that_says_nobody_was_short_must_have_kept_clear(
    near: dict[str, Path], tmp_path: Path
) -> None:
    folder = copied(near["receding-horizon"], tmp_path / "run")
    assert entry(folder, "monitor-plan_clear")["verdict"] == "violated"  # by what is missed between samples
    edit_table(folder, "vehicles", lambda t: t.assign(qp_status="solved"))
    seal(folder)
    assert "monitor-plan_clear" in differing(folder)


@pytest.mark.parametrize("kind", OWN)
@pytest.mark.parametrize(
    "name, field, said",
    [
        (
            "paper-2-turn",
            "network.latency_s=0.1",
            "network.latency_s: the filter {kind} needs poses and plans",
        ),
        ("intruder-head-on", "duration_s=1", "filter.kind: {kind} knows no intruders"),
        ("fenced-field", "duration_s=1", "filter.kind: {kind} knows no fences"),
    ],
)
def test_what_it_cannot_filter_is_refused(kind: str, name: str, field: str, said: str) -> None:
    with pytest.raises(testbed.UserError, match=said.format(kind=repr(kind))):
        testbed.run(load(name, [f'filter.kind="{kind}"', 'plant="lagged"', field]))


@pytest.mark.parametrize(
    "kind, fields, said",
    [
        ("backup", {"filter.beta_per_m": 1.0}, "filter.blending = 'regulation' takes it"),
        ("backup", {"filter.alpha_per_s": 30.0}, r"filter: alpha must be positive and at most 1 / dt = 20"),
        ("gatekeeper", {"filter.horizon_s": 0.01}, r"filter: the horizon must be finite and a filter period"),
        ("receding-horizon", {"filter.block_s": 0.001}, "filter: a plan needs a block"),
        ("gatekeeper", {"filter.blocks": 2, "filter.horizon_s": 1.0}, None),
        ("gatekeeper", {"filter.blocks": 3}, "filter.blocks"),
        ("receding-horizon", {"remedy.ds_buffer_m": 1.0}, "filter 'receding-horizon' cannot take it"),
    ],
)
def test_settings_are_refused_with_their_place(
    kind: str, fields: dict[str, object], said: str | None
) -> None:
    if said is None:
        assert meeting(kind, **fields)  # another kind's field at its default says nothing
        return
    with pytest.raises(testbed.UserError, match=said):
        testbed.run(meeting(kind, **fields))


def test_a_straight_manoeuvre_is_no_backup_for_ever() -> None:
    said = ['filter.kind="gatekeeper"', 'plant="lagged"']
    with pytest.raises(testbed.UserError, match="one turn rate for all, not zero"):
        testbed.run(load("paper-2-straight", said))


def test_on_the_unicycle_a_rivals_model_does_not_lag(tmp_path: Path) -> None:
    """Its plans keep what they were promised to; with an aircraft's lags they would be flown too soon."""
    run = testbed.run(meeting("gatekeeper", plant="unicycle", duration_s=4.0, **{"lags.source": "airframe"}))
    assert run.guarantee("monitor-plan_clear")["verdict"] == "holds"
