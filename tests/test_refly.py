"""A run flown again is the run, bit for bit; a forged one is not, and what differs is named."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

import testbed
from testbed.scenario.scenario import load
from testbed.simulation.refly import refly
from testbed.simulation.simulate import run
from tests.forgery import copied, differing, edit_cell, edit_entry, edit_manifest, entry, read, seal

NEAR = ["radius_m=60", "lookahead_m=10", "duration_s=2", "filter_dt_s=0.05", "record_dt_s=0.1"]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A thin record of an X8 in wind, with manoeuvres flown: much that the record cannot decide."""
    folder = tmp_path_factory.mktemp("refly") / "run"
    run(load("paper-2-turn", [*NEAR, "plant=jsbsim", "wind.speed_mps=4", "filter.monitor=true"]), folder)
    return folder


def again(folder: Path) -> set[str]:
    return {f.what.removeprefix("again: ") for f in refly(folder) if f.agrees is not True}


@pytest.mark.slow
def test_flown_again_it_is_the_same(flown: Path) -> None:
    assert again(flown) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["manoeuvre-flyable", "manoeuvre-keeps-Ds", "monitor-cheaper", "rows-satisfied"]
)
def test_what_the_record_leaves_open_is_settled(flown: Path, tmp_path: Path, name: str) -> None:
    """A forgery that agrees with itself and with every recorded number."""
    folder, e = copied(flown, tmp_path / "x"), entry(flown, name)
    if name == "manoeuvre-flyable":
        fields = {"verdict": "premise not met", "why": "vehicle 1 (x8) has no steady turn"}
    elif name == "manoeuvre-keeps-Ds":
        worst = min(e["detail"]["branches"], key=lambda b: b["least_m"])
        worst["least_m"] -= 1e-3
        worst["possible_m"] -= 1e-3
        worst["short_m"] += 1e-3
        less = {"value": worst["least_m"], "margin": worst["least_m"] - e["bound"]}
        fields = {"detail": e["detail"], **less}
    else:
        fields = {"value": e["value"] - 1e-9, "margin": e["margin"] - 1e-9}
    edit_entry(folder, name, **fields)
    seal(folder)
    assert differing(folder) == set()
    assert again(folder) == {"claims", name}


@pytest.mark.slow
def test_a_cell_and_the_manifest_are_named(flown: Path, tmp_path: Path) -> None:
    folder = copied(flown, tmp_path / "x")
    edit_cell(folder, "vehicles", "alpha_rad", 7, 1e-9)
    edit_manifest(folder, worst_qp_residual=0.5)
    seal(folder)
    found = {f.what: f for f in refly(folder) if f.agrees is False}
    assert set(found) == {"again: vehicles.parquet", "again: manifest"}
    assert found["again: vehicles.parquet"].why.startswith("alpha_rad of row 8 is")
    assert found["again: manifest"].own == "worst_qp_residual"


@pytest.mark.slow
def test_a_difference_stays_one_when_versions_differ_too(flown: Path, tmp_path: Path) -> None:
    folder = copied(flown, tmp_path / "x")
    versions = read(folder, "manifest.json")["versions"]
    edit_manifest(folder, versions=versions | {"numpy": "1.0"})
    seal(folder)
    assert again(folder) == set()  # the same all the same
    edit_cell(folder, "vehicles", "x_m", 7, 1e-9)
    seal(folder)
    (found,) = [f for f in refly(folder) if f.agrees is not True]
    assert found.agrees is False and found.why.endswith("flown by other versions of numpy")


def test_an_airframe_whose_files_changed_is_named(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    """Heavier than the one that flew, or with another word in a comment: neither is the same flight."""
    assert call("aircraft", "copy", "x8", tmp_path / "mine") == 0
    mine = f'airframes=["{(tmp_path / "mine").as_posix()}"]'
    run(
        load("paper-2-turn", [*NEAR, "duration_s=0.5", "plant=jsbsim", "manoeuvre_instants=0", mine]),
        tmp_path / "r",
    )
    assert again(tmp_path / "r") == set()
    model = tmp_path / "mine" / "x8.xml"
    text = model.read_text(encoding="utf-8")
    model.write_text(text.replace("</fdm_config>", "<!-- mine --></fdm_config>"), encoding="utf-8")
    (only,) = again(tmp_path / "r")
    assert only.startswith("airframe ")
    heavier = re.sub(r'(<emptywt unit="KG">)[^<]*', r"\1 4.8 ", text)
    assert heavier != text
    model.write_text(heavier, encoding="utf-8")
    assert again(tmp_path / "r") >= {only, "vehicles.parquet", "pairs.parquet"}
    capsys.readouterr()
    assert call("verify", tmp_path / "r", "--fly") == 1
    last = " ".join(capsys.readouterr().out.split()).partition("flown otherwise: ")[2]
    assert last.startswith("airframe ") and "vehicles.parquet" in last
    # Without its files the run cannot be flown again.
    shutil.rmtree(tmp_path / "mine")
    assert again(tmp_path / "r") == {"airframes"}


def test_parts_of_ones_own_are_not_flown_again(tmp_path: Path) -> None:
    from testbed.components import catalogue

    parts = testbed.Parts(filter=lambda s, b, goal: catalogue.filter_(s, b, goal))
    run(load("paper-2-turn", ["duration_s=0.1", "manoeuvre_instants=0"]), tmp_path / "run", parts=parts)
    (found,) = refly(tmp_path / "run")
    assert found.agrees is None and "a part of its own" in found.why


def test_the_command_flies_again(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    run(load("paper-2-turn", ["duration_s=0.1", "manoeuvre_instants=0"]), tmp_path / "run")
    assert call("verify", tmp_path / "run", "--fly") == 0
    text = capsys.readouterr().out
    assert "again: claims" in text and max(map(len, text.splitlines())) <= 80
    edit_manifest(tmp_path / "run", worst_qp_residual=0.5)
    seal(tmp_path / "run")
    assert call("verify", tmp_path / "run", "--fly", "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert [f["what"] for f in told["findings"] if f["agrees"] is False] == ["again: manifest"]
