"""Words, columns and manifest of a run compared with what they have to be, one change at a time."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from testbed.verification.finding import Finding
from testbed.verification.recorded import Recorded, read
from testbed.verification.wording import wording

TELEMETRY = (
    "roll_rad", "pitch_rad", "heading_rad", "alpha_rad", "beta_rad", "airspeed_mps", "throttle",
    "load_factor", "limited_v", "limited_omega", "limited_zeta",
)  # fmt: skip
WINDS = ("wind_east_mps", "wind_north_mps", "wind_up_mps")
SHORT = ["duration_s=0.02", "filter_dt_s=0.01", "record_dt_s=0.01", "manoeuvre_instants=0"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    folder = tmp_path_factory.mktemp("words") / "r"
    run(load("paper-2-turn", [*SHORT, "filter.monitor=true"]), folder)
    return read(folder)


def found(made: Recorded, what: str) -> Finding:
    every = list(wording(made))
    assert [f.what for f in every] == ["texts", "fields", "columns", "manifest", "scenario"]
    [one] = [f for f in every if f.what == what]
    return one


def wrong(made: Recorded, what: str) -> str:
    """What is found to differ; "" if nothing is."""
    one = found(made, what)
    assert one.agrees is (not one.why) and one.within is None
    assert not one.why or one.own == f"{len(one.why.split('; '))} differ"
    return one.why


def columns(made: Recorded, *names: str, table: str = "vehicles") -> Recorded:
    """With further columns of zeros."""
    have = getattr(made, table)
    return replace(made, **{table: have | {name: np.zeros_like(have["t_s"]) for name in names}})


def without(made: Recorded, name: str, table: str = "vehicles") -> Recorded:
    return replace(made, **{table: {k: v for k, v in getattr(made, table).items() if k != name}})


def said(made: Recorded, **manifest: Any) -> Recorded:
    return replace(made, manifest=made.manifest | manifest)


def scenario(made: Recorded, **fields: Any) -> Recorded:
    return replace(made, scenario=made.scenario | fields)


def test_a_run_as_it_was_flown_has_all_its_words(flown: Recorded) -> None:
    texts, fields, tables, manifest, flyable = wording(flown)
    assert {f.agrees for f in (texts, fields, tables, manifest, flyable)} == {True}
    assert (flyable.said, flyable.own, flyable.why) == ("as written", "can be flown", "")
    assert (texts.said, texts.own) == (f"{len(flown.entries)} claims", "as registered")
    assert fields.said.endswith(" fields") and int(fields.said.split()[0]) > 200 and fields.own == "known"
    assert (tables.said, tables.own) == (f"{len(flown.vehicles) + len(flown.pairs)} columns", "as due")
    assert (manifest.said, manifest.own, manifest.why) == ("as written", "as due", "")


# Texts


@pytest.mark.parametrize("name", ["number", "claim", "source", "quantity", "unit"])
def test_every_word_of_every_claim_is_the_registrys(flown: Recorded, name: str) -> None:
    for k, entry in enumerate(flown.entries):
        entries = [*flown.entries[:k], entry | {name: "another"}, *flown.entries[k + 1 :]]
        assert wrong(replace(flown, entries=entries), "texts") == f"{name} of {entry['id']} is 'another'"
    every = [e | {name: "another"} for e in flown.entries]
    assert len(wrong(replace(flown, entries=every), "texts").split("; ")) == len(every)
    # A claim that is unknown has no words; "fields" names it.
    odd = [*flown.entries, flown.entries[0] | {"id": "odd", name: "another"}]
    assert wrong(replace(flown, entries=odd), "texts") == ""


def test_words_depend_on_the_goal_radius_the_form_and_intruders(flown: Recorded) -> None:
    assert wrong(scenario(flown, goal_radius_m=30.0), "texts").startswith(
        "claim of goal is 'every vehicle pas"
    )
    squared = wrong(scenario(flown, barrier=flown.scenario["barrier"] | {"form": "squared"}), "texts")
    assert "unit of safe-set is 'm'" in squared and "unit of separation" not in squared
    intruded = wrong(scenario(flown, vehicle=[{}, {"filter": False}]), "texts")
    assert intruded.startswith("claim of separation is 'every pair keeps Ds'; claim of goal is ")


# Fields


def test_what_is_unknown_is_named(flown: Recorded) -> None:
    assert wrong(columns(flown, "odd"), "fields") == "vehicles.odd is unknown"
    assert wrong(columns(flown, "odd", "even", table="pairs"), "fields") == (
        "pairs.odd is unknown; pairs.even is unknown"
    )
    assert wrong(said(flown, odd=1), "fields") == "manifest.odd is unknown"
    assert wrong(scenario(flown, odd=1), "fields") == "scenario.odd is unknown"


def test_what_every_run_has_may_not_be_missing(flown: Recorded) -> None:
    assert wrong(without(flown, "v_mps"), "fields") == "vehicles.v_mps is missing"
    assert wrong(without(flown, "h_m", "pairs"), "fields") == "pairs.h_m is missing"
    gone = replace(flown, manifest={k: v for k, v in flown.manifest.items() if k != "versions"})
    assert wrong(gone, "fields") == "manifest.versions is missing"
    both = columns(without(flown, "v_mps"), "odd")
    assert wrong(both, "fields") == "vehicles.odd is unknown; vehicles.v_mps is missing"
    entries = [{k: v for k, v in e.items() if k != "why"} for e in flown.entries]
    assert wrong(replace(flown, entries=entries), "fields").count("why is missing") == len(entries)


# Columns


def test_an_aircraft_has_its_telemetry_and_nobody_else(flown: Recorded) -> None:
    for name in TELEMETRY:
        assert wrong(columns(flown, name), "columns") == f"{name} is recorded"
    aircraft = scenario(flown, plant="jsbsim")
    assert wrong(aircraft, "columns") == "; ".join(f"{name} is missing" for name in TELEMETRY)
    whole = columns(aircraft, *TELEMETRY)
    assert wrong(whole, "columns") == ""
    for name in TELEMETRY:
        assert wrong(without(whole, name), "columns") == f"{name} is missing"
    own = said(columns(flown, "roll_rad"), parts={"plant": {}})
    assert wrong(own, "columns") == "" and wrong(said(aircraft, parts={"plant": {}}), "columns") == ""
    assert wrong(said(aircraft, parts={"filter": {}}), "columns") != ""


def test_a_run_with_wind_has_its_columns_and_no_other_run(flown: Recorded) -> None:
    for name in WINDS:
        assert wrong(columns(flown, name), "columns") == f"{name} is recorded"
    windy = scenario(flown, wind=flown.scenario["wind"] | {"speed_mps": 3.0})
    assert wrong(windy, "columns") == "; ".join(f"{name} is missing" for name in WINDS)
    assert wrong(columns(windy, *WINDS), "columns") == ""
    assert wrong(said(windy, parts={"disturbance": {}}), "columns") == ""
    assert wrong(said(columns(flown, *WINDS), parts={"disturbance": {}}), "columns") == ""
    assert wrong(said(windy, parts={"plant": {}}), "columns") != ""


def test_a_declared_barrier_has_its_columns_and_a_filter_of_the_users_own(flown: Recorded) -> None:
    names = ("h_declared", "alpha_declared")
    for name in names:
        assert wrong(columns(flown, name, table="pairs"), "columns") == f"{name} is recorded"
    declared = said(flown, declared=["barrier"], parts={"filter": {}})
    assert wrong(declared, "columns") == "; ".join(f"{name} is missing" for name in names)
    whole = columns(declared, *names, table="pairs")
    assert wrong(whole, "columns") == ""
    assert (
        wrong(said(whole, parts={}), "columns") == "a barrier is declared without a filter of the user's own"
    )
    nobody = np.zeros(0, dtype=int)
    assert wrong(replace(declared, i=nobody, j=nobody), "columns") == ""
    assert (
        wrong(replace(whole, i=nobody, j=nobody), "columns")
        == "h_declared is recorded; alpha_declared is recorded"
    )


def test_a_run_without_a_row_has_no_columns_but_those_of_every_run(flown: Recorded) -> None:
    def none(table: dict[str, Any]) -> dict[str, Any]:
        return {name: values[:0] for name, values in table.items()}

    empty = replace(flown, t=flown.t[:0], vehicles=none(flown.vehicles), pairs=none(flown.pairs))
    made = scenario(empty, plant="jsbsim")
    one = found(made, "columns")
    assert one.agrees and one.own == "as due" and one.why == ""
    assert one.said == f"{len(flown.vehicles) + len(flown.pairs)} columns"


# Manifest


def test_schema_and_random_streams_are_the_known_ones(flown: Recorded) -> None:
    assert wrong(said(flown, schema_version=2), "manifest") == "schema_version is 2"
    streams = ["start", "plant", "gust", "noise", "network", "other"]
    assert flown.manifest["seed_streams"] == streams
    for k in range(len(streams)):
        other = [*streams[:k], "odd", *streams[k + 1 :]]
        assert wrong(said(flown, seed_streams=other), "manifest") == f"seed_streams are {other}"
    assert wrong(said(flown, seed_streams=[], schema_version=3), "manifest") == (
        "schema_version is 3; seed_streams are []"
    )


def test_a_scenario_that_cannot_be_flown_is_named(flown: Recorded) -> None:
    def recorded(**fields: Any) -> Recorded:
        changed = scenario(flown, **fields)
        return said(changed, scenario=flown.manifest["scenario"] | fields)

    assert "duration_s" in wrong(recorded(duration_s=-1.0), "scenario")
    assert not wrong(recorded(duration_s=-1.0), "scenario").startswith("scenario: ")
    assert found(recorded(duration_s=-1.0), "scenario").said == "as written"
    idle = flown.scenario["gusts"] | {"intensity": "light"}  # moves no unicycle: recorded all the same
    assert wrong(recorded(gusts=idle), "scenario") == ""
    own = recorded(plant="balloon")
    one = found(own, "scenario")
    assert (one.said, one.own, one.agrees) == ("as written", "unknown", None)
    assert one.why == "its plant is not installed here" and one.within is None


# The scenario's airframes, sensors, and the manifest's names -> whether they belong together.
NAMED = [
    (["x8"], None, ["x8"], True),
    (["x8"], None, ["rascal"], False),
    (["x8"], None, [], False),
    (["x8"], None, ["x8", "rascal"], False),
    (["x8", "rascal"], None, ["x8", "rascal"], True),
    (["x8", "rascal"], None, ["rascal", "x8"], True),
    (["x8", "rascal"], None, ["x8"], False),
    # A folder is named by its last part, a gains' file by the airframe and its own name.
    (["../mine/glider"], None, ["glider"], True),
    (["../mine/glider"], None, ["mine"], False),
    (["slow.toml"], None, ["x8+slow"], True),
    (["../gains/slow.toml"], None, ["x8+slow"], True),
    (["slow.toml"], None, ["x8+fast"], False),
    (["slow.toml"], None, ["x8"], False),
    (["slow.txt"], None, ["x8+slow"], False),
    # Autopilot and sensors behind an @; those that no name says need no name.
    (["x8@arduplane"], None, ["x8@arduplane"], True),
    (["x8@arduplane"], None, ["x8"], False),
    (["x8@arduplane"], None, ["x8@other"], False),
    (["x8@inverting"], None, ["x8"], True),
    (["x8@perfect"], None, ["x8"], True),
    (["x8@mine.eq"], None, ["x8@mine"], True),
    (["x8"], None, ["x8@typical"], False),
    (["../mine/glider"], None, ["glider@typical"], True),
    (["x8"], "typical", ["x8@typical"], True),
    (["x8"], "typical", ["x8"], False),
    (["x8"], "perfect", ["x8"], True),
    (["x8@arduplane"], "typical", ["x8@arduplane@typical"], True),
    (["x8@arduplane"], "typical", ["x8@arduplane"], False),
]


@pytest.mark.parametrize(("asked", "sensors", "named", "fine"), NAMED)
def test_airframes_are_those_of_the_scenario(
    flown: Recorded, asked: list[str], sensors: str | None, named: list[str], fine: bool
) -> None:
    made = scenario(flown, plant="jsbsim", airframes=asked, **({"sensors": sensors} if sensors else {}))
    made = said(made, airframes={name: {} for name in named})
    due = "" if fine else f"airframes are {', '.join(sorted(named)) or 'none'}"
    assert wrong(made, "manifest") == due
    assert wrong(said(made, parts={"plant": {}}), "manifest") == ""
    assert wrong(scenario(made, plant="lagged"), "manifest") == ""
    assert wrong(said(made, parts={"filter": {}}), "manifest") == due


def test_the_airframes_that_the_vehicles_have_of_their_own_count(flown: Recorded) -> None:
    made = scenario(flown, plant="jsbsim", vehicle=[{"airframe": "rascal"}, {}])
    assert wrong(said(made, airframes={"x8": {}, "rascal": {}}), "manifest") == ""
    assert wrong(said(made, airframes={"x8": {}}), "manifest") == "airframes are x8"
