"""The second opinion: it agrees with sound runs, shares no formula with them, notices what was changed."""

from __future__ import annotations

import ast
import hashlib
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from testbed import catalogue
from testbed.errors import UserError
from testbed.scenario import builtin, load
from testbed.simulate import run
from testbed.start import generators, places
from testbed.verification.check import verify
from testbed.verification.future import barrier

ROOT = Path(__file__).parent.parent
SHORT = ["duration_s=0.1", "record_dt_s=0.005", "manoeuvre_instants=0"]


def test_it_imports_nothing_of_what_it_checks() -> None:
    for file in (ROOT / "testbed/verification").glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [a.name for a in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                if name.split(".")[0] in ("testbed", "filters", "aircraft"):
                    assert name == "testbed.errors" or name.startswith("testbed.verification."), name


def differing(folder: Path) -> set[str]:
    return {f.what for f in verify(folder) if f.agrees is False}


@pytest.mark.parametrize("name", builtin())
def test_it_agrees_with_every_built_in_scenario(name: str, tmp_path: Path) -> None:
    run(load(name, SHORT), tmp_path / "run", force=True)
    findings = verify(tmp_path / "run")
    assert [f for f in findings if f.agrees is not True] == []
    assert {f.what for f in findings} >= {"distance_m", "h_m", "separation", "safe-set", "barrier-condition"}


@pytest.mark.parametrize(
    "overrides",
    [
        ["barrier.smoothing_m2=30", "delta_m2=0"],
        ["barrier.form=squared"],
        ["sigma=[1.0, 1.2]"],
        ["barrier.kind=straight", "zeta_mps=[0.5, -0.5]"],
        ["barrier.kind=euclidean"],
    ],
    ids=str,
)
def test_h_by_flying_on_is_h_in_closed_form(overrides: list[str]) -> None:
    s = load(
        "paper-2-turn", [*overrides, "heading_perturbation_deg=180", "height_perturbation_m=3", "radius_m=20"]
    )
    for seed in range(1, 30):
        state, _ = places(s, generators(seed)["start"])
        position = np.stack([state.x, state.y, state.z], axis=-1)[None]
        own = barrier(s.model_dump(mode="json"), position, state.theta[None], np.array([0]), np.array([1]))
        assert own is not None
        assert own[0, 0] == pytest.approx(catalogue.barrier(s).values(state).h[0], abs=1e-9)


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two vehicles that meet and violate nothing; and on the way near each other."""
    folder = tmp_path_factory.mktemp("verify") / "run"
    overrides = [
        "radius_m=40",
        "lookahead_m=10",
        "duration_s=3",
        "fdm_dt_s=0.02",
        "filter_dt_s=0.02",
        "record_dt_s=0.02",
    ]
    run(load("paper-2-turn", [*overrides, "manoeuvre_instants=0"]), folder)
    assert differing(folder) == set()
    return folder


def copied(folder: Path, target: Path) -> Path:
    target.mkdir()
    for file in folder.iterdir():
        (target / file.name).write_bytes(file.read_bytes())
    return target


def seal(folder: Path) -> None:
    """Make the checksums fit again, as a forger would."""
    manifest = json.loads((folder / "manifest.json").read_text())
    for name in manifest.get("files", {}):
        manifest["files"][name] = hashlib.sha256((folder / name).read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest))


def edit_table(folder: Path, name: str, change: Callable[[pd.DataFrame], pd.DataFrame | None]) -> None:
    table = pd.read_parquet(folder / f"{name}.parquet")
    changed = change(table)
    (table if changed is None else changed).to_parquet(folder / f"{name}.parquet", index=False)


def edit_entry(folder: Path, name: str, **fields: object) -> None:
    entries = json.loads((folder / "guarantees.json").read_text())
    next(e for e in entries if e["id"] == name).update(fields)
    (folder / "guarantees.json").write_text(json.dumps(entries))


def test_an_edited_position_shows(sound: Path, tmp_path: Path) -> None:
    folder = copied(sound, tmp_path / "x")

    def move(table: pd.DataFrame) -> None:
        table.loc[100, "x_m"] += 1e-3

    edit_table(folder, "vehicles", move)
    assert "files" in differing(folder)
    seal(folder)
    assert differing(folder) >= {"distance_m", "h_m", "barrier-condition"}


def test_positions_and_distances_edited_together_show_in_the_motion(sound: Path, tmp_path: Path) -> None:
    folder = copied(sound, tmp_path / "x")
    edit_table(
        folder,
        "vehicles",
        lambda table: table.assign(x_m=table.x_m.where(table.index != 100, table.x_m + 2.0)),
    )
    seal(folder)
    assert "motion" in differing(folder)


@pytest.mark.parametrize(
    ("name", "verdict"), [("separation", "violated"), ("safe-set", "premise not met"), ("goal", "violated")]
)
def test_an_edited_verdict_shows(sound: Path, tmp_path: Path, name: str, verdict: str) -> None:
    folder = copied(sound, tmp_path / "x")
    said = next(e for e in json.loads((folder / "guarantees.json").read_text()) if e["id"] == name)["verdict"]
    edit_entry(folder, name, verdict="holds" if said == verdict else verdict)
    seal(folder)
    assert differing(folder) == {name}


@pytest.mark.parametrize(
    "name", ["separation", "safe-set", "barrier-condition", "goal", "command-limits", "qp-feasibility"]
)
def test_an_edited_value_shows(sound: Path, tmp_path: Path, name: str) -> None:
    folder = copied(sound, tmp_path / "x")
    entry = next(e for e in json.loads((folder / "guarantees.json").read_text()) if e["id"] == name)
    edit_entry(folder, name, value=entry["value"] + 1e-2)
    seal(folder)
    assert name in differing(folder)


@pytest.mark.parametrize("column", ["h_m", "distance_m"])
def test_an_edited_column_of_pairs_shows(sound: Path, tmp_path: Path, column: str) -> None:
    folder = copied(sound, tmp_path / "x")

    def edit(table: pd.DataFrame) -> None:
        table.loc[7, column] += 1e-4

    edit_table(folder, "pairs", edit)
    seal(folder)
    assert column in differing(folder)


@pytest.mark.parametrize(
    "drop",
    [
        pytest.param(lambda t: t.iloc[:-2], id="the last instant"),
        pytest.param(lambda t: t.drop(index=[40, 41]), id="an instant in the middle"),
        pytest.param(lambda t: t.drop(index=[41]), id="one vehicle's row"),
        pytest.param(lambda t: pd.concat([t, t.iloc[-2:]]), id="an instant twice"),
    ],
)
def test_dropped_rows_are_refused(
    sound: Path, tmp_path: Path, drop: Callable[[pd.DataFrame], pd.DataFrame]
) -> None:
    folder = copied(sound, tmp_path / "x")
    edit_table(folder, "vehicles", drop)
    seal(folder)
    with pytest.raises(UserError, match=r"rows|instants"):
        verify(folder)


def test_the_command_answers_by_its_exit_code(
    sound: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("verify", sound) == 0
    assert "agrees" in capsys.readouterr().out
    folder = copied(sound, tmp_path / "x")
    edit_entry(folder, "separation", value=99.0)
    assert call("verify", folder, "--json") == 1
    told = json.loads(capsys.readouterr().out)
    assert not told["agrees"] and {f["what"] for f in told["findings"] if f["agrees"] is False} == {
        "files",
        "separation",
    }
    assert call("verify", tmp_path) == 2


@pytest.mark.parametrize("plant", ["unicycle", "jsbsim"])
def test_thinned_records_bound_the_values(tmp_path: Path, plant: str) -> None:
    overrides = [
        f"plant={plant}",
        "radius_m=60",
        "lookahead_m=10",
        "duration_s=2",
        "filter_dt_s=0.05",
        "record_dt_s=0.1",
    ]
    run(load("paper-2-turn", [*overrides, "manoeuvre_instants=0"]), tmp_path / "run")
    assert differing(tmp_path / "run") == set()
    entry = json.loads((tmp_path / "run/guarantees.json").read_text())
    value = next(e for e in entry if e["id"] == "separation")["value"]
    edit_entry(tmp_path / "run", "separation", value=value + 0.01)
    seal(tmp_path / "run")
    assert "separation" in differing(tmp_path / "run")
