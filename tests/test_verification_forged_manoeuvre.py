"""What a run states of the manoeuvres flown changed: the verification names the claim."""

# Fixtures are imported by name, and asked for by name.
# ruff: noqa: F811

from __future__ import annotations

from pathlib import Path

import pytest

from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
from tests.forged_runs import NEAR, crowd, lagged, unicycle  # noqa: F401
from tests.forgery import (
    copied,
    differing,
    edit_entry,
    entry,
    seal,
)

HOLDS, VIOLATED, PREMISE, OTHER = "holds", "violated", "premise not met", "not applicable"


@pytest.mark.parametrize(
    ("key", "by"),
    [
        ("h", 1e-3),
        ("promised_m", 1e-3),
        ("least_m", 1e-3),
        ("short_m", -1e-3),
        ("short_m", 1e-3),
        ("safe_pairs", 1),
        ("t_s", 0.02),
    ],
)
def test_a_manoeuvre_flown_from_a_unicycle(unicycle: Path, tmp_path: Path, key: str, by: float) -> None:
    """Also an instant that does not decide the verdict."""
    folder = copied(unicycle, tmp_path / "x")
    e = entry(folder, "manoeuvre-keeps-Ds")
    branch = max(e["detail"]["branches"], key=lambda b: b["least_m"])
    branch[key] += by
    edit_entry(folder, "manoeuvre-keeps-Ds", detail=e["detail"])
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


def test_promises_of_manoeuvres_are_those_of_the_recorded_poses(lagged: Path, tmp_path: Path) -> None:
    for key in ("h", "promised_m", "safe_pairs"):
        folder = copied(lagged, tmp_path / key)
        e = entry(folder, "manoeuvre-keeps-Ds")
        e["detail"]["branches"][1][key] += 1
        edit_entry(folder, "manoeuvre-keeps-Ds", detail=e["detail"])
        seal(folder)
        assert differing(folder) == {"manoeuvre-keeps-Ds"}


@pytest.mark.parametrize(("key", "by"), [("h", 60.0), ("promised_m", 1e-3)])
def test_promises_between_recorded_instants_are_near_those_around(
    tmp_path: Path, key: str, by: float
) -> None:
    run(load("paper-2-turn", [*NEAR[:4], "record_dt_s=0.4", "plant=lagged"]), tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    e = entry(tmp_path / "run", "manoeuvre-keeps-Ds")
    branch = next(b for b in e["detail"]["branches"] if (b["t_s"] + 0.01) % 0.4 > 0.02)
    branch[key] += by
    if key == "h":
        branch["promised_m"] += by
        branch["short_m"] += by
    edit_entry(tmp_path / "run", "manoeuvre-keeps-Ds", detail=e["detail"])
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"manoeuvre-keeps-Ds"}


def test_the_worst_manoeuvres_left_out(lagged: Path, tmp_path: Path) -> None:
    folder = copied(lagged, tmp_path / "x")
    e = entry(folder, "manoeuvre-keeps-Ds")
    good = [b for b in e["detail"]["branches"] if b["least_m"] >= 5.0]
    assert good
    best = min(good, key=lambda b: b["least_m"])
    fields = {"value": best["least_m"], "margin": best["least_m"] - 5.0, "t_s": best["t_s"], "verdict": HOLDS}
    edit_entry(folder, "manoeuvre-keeps-Ds", detail={"branches": good}, **fields)
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


def test_a_worst_manoeuvre_that_none_of_those_flown_is(unicycle: Path, tmp_path: Path) -> None:
    folder = copied(unicycle, tmp_path / "x")
    edit_entry(folder, "manoeuvre-keeps-Ds", value=entry(folder, "manoeuvre-keeps-Ds")["value"] + 1e-6)
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}


def test_who_has_the_least_room_for_the_manoeuvre(tmp_path: Path) -> None:
    run(
        load("paper-2-turn", [*NEAR, "duration_s=0.5", "sigma=[1.0, 1.2]", "omega_degps=8"]), tmp_path / "run"
    )
    assert entry(tmp_path / "run", "manoeuvre-in-U")["vehicles"] == [1]
    edit_entry(tmp_path / "run", "manoeuvre-in-U", vehicles=[2])
    seal(tmp_path / "run")
    assert differing(tmp_path / "run") == {"manoeuvre-in-U"}


def test_a_fault_in_a_manoeuvre_is_no_pass(unicycle: Path, tmp_path: Path) -> None:
    folder = copied(unicycle, tmp_path / "x")
    e = entry(folder, "manoeuvre-keeps-Ds")
    e["detail"]["branches"][0]["fault"] = "vehicle 1: stall"
    edit_entry(folder, "manoeuvre-keeps-Ds", detail=e["detail"])
    seal(folder)
    assert differing(folder) == {"manoeuvre-keeps-Ds"}
