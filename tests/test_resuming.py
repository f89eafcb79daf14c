"""Studies that go on where they were interrupted, and never from rows that other code or files have flown."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from aircraft.airframe import copy
from testbed.campaigns import identity
from testbed.campaigns.job import Job
from testbed.campaigns.journal import Journal, journal_beside
from testbed.errors import UserError
from testbed.scenario.scenario import load
from testbed.studies.common.measure import keys, override
from testbed.studies.margin import margin as margins
from testbed.studies.remedies import remedies

SETTINGS = ["duration_s=1", "filter_dt_s=0.05", "record_dt_s=0.05"]


def key(*settings: str, seed: int = 1, **fields: Any) -> str:
    made = override(load("paper-2-turn", [*SETTINGS, *settings]), fields)
    return keys([Job("any", made, seed)])[0]


@pytest.fixture
def wing(tmp_path: Path) -> Path:
    return copy("x8", tmp_path / "wing")


def touch(file: Path, pattern: str, to: str) -> None:
    text, count = re.subn(pattern, to, file.read_text(), count=1)
    assert count
    file.write_text(text)


def test_equal_runs_have_equal_keys_whatever_they_are_called() -> None:
    s = override(load("paper-2-turn"), {})
    one, two, other = keys([Job("one", s, 1), Job("two", s, 1), Job("one", s, 2)])
    assert one == two != other
    assert key() != key("d_safe_m=6") and key() != key(**{"remedy.ds_buffer_m": 1.0})


@pytest.mark.parametrize("plant", ["jsbsim", "lagged"])
@pytest.mark.parametrize(
    ("file", "pattern", "to"),
    [
        ("x8.xml", "<wingarea", "<!-- another wing --><wingarea"),
        ("airframe.toml", "bandwidth_radps = ", "bandwidth_radps = 1"),
        ("systems/autopilot.xml", "<system", "<!-- another autopilot --><system"),
    ],
)
def test_a_changed_airframe_is_another_run(wing: Path, plant: str, file: str, pattern: str, to: str) -> None:
    settings = (f"plant={plant}", f"airframes=['{wing}']")
    before = key(*settings)
    assert key(*settings) == before
    touch(wing / file, pattern, to)
    assert key(*settings) != before


def test_a_prediction_by_identified_lags_knows_the_airframe(wing: Path) -> None:
    settings = ("plant=unicycle", f"airframes=['{wing}']")
    unicycle, predicting = key("plant=unicycle"), key(*settings, "predict_lags=true")
    touch(wing / "airframe.toml", "time_constant_s = ", "time_constant_s = 1")
    assert key(*settings, "predict_lags=true") != predicting
    # and a manifest names it
    s = load("paper-2-turn", [*settings, "predict_lags=true"])
    assert list(identity.catalogue.airframe_hashes(s)) == ["wing"]
    # A unicycle that predicts nothing has no airframe.
    assert key("plant=unicycle") == unicycle
    assert identity.catalogue.airframe_hashes(load("paper-2-turn", ["plant=unicycle"])) == {}


def test_a_changed_gains_file_is_another_run(tmp_path: Path) -> None:
    file = tmp_path / "slow.toml"
    file.write_text('base = "x8"\n[gains.turn]\nbandwidth_radps = 6.65\n')
    settings = ("plant=jsbsim", f"airframes=['{file}']")
    before = key(*settings)
    touch(file, "6.65", "6.64")
    assert key(*settings) != before


def test_two_different_airframes_of_one_name_are_refused(tmp_path: Path) -> None:
    """Manifests, tables and recordings tell airframes apart by name."""
    mine, yours = (copy("x8", tmp_path / of / "wing") for of in ("mine", "yours"))
    with pytest.raises(UserError, match="are both called wing; rename one"):
        key("plant=jsbsim", f"airframes=['{mine}', '{yours}']")
    assert key("plant=jsbsim", f"airframes=['{mine}', '{mine}', 'x8']")


def test_an_airframe_that_is_not_there_is_refused_before_anything_is_flown() -> None:
    with pytest.raises(UserError, match="no airframe nope"):
        key("plant=jsbsim", "airframes=['nope']")


def test_changed_code_or_packages_are_another_run(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    before = key()
    monkeypatch.setattr(identity, "code_id", lambda start: f"changed {start}")
    assert key() != before
    monkeypatch.undo()
    fresh = identity.code_id.__wrapped__
    now = fresh("testbed.studies.common.measure")
    versions = identity.versions()
    monkeypatch.setattr(identity, "versions", lambda: versions | {"jsbsim": "0.1"})
    assert fresh("testbed.studies.common.measure") != now
    monkeypatch.undo()
    other = tmp_path / "changed.py"
    other.write_text("")
    files = identity.modules("testbed.studies.common.measure")
    assert {f.name for f in files} >= {"measure.py", "simulate.py", "fleet.py", "constraints.py"}
    monkeypatch.setattr(identity, "modules", lambda start: [*files[:-1], other])
    monkeypatch.setattr(identity, "ROOT", Path("/"))
    assert fresh("testbed.studies.common.measure") != now


def interrupted_after(flights: int, monkeypatch: pytest.MonkeyPatch) -> list[Job]:
    """Studies fly this script from now on: `flights` runs, then Ctrl-C once, then on. What was flown."""
    flown: list[Job] = []
    left = [flights]

    def scripted(job: Job) -> dict[str, Any]:
        if left and not left[0]:
            left.clear()
            raise KeyboardInterrupt
        if left:
            left[0] -= 1
        flown.append(job)
        row = {name: 1.0 for name in ("distance_m", "h_m", "infeasible", "overridden_share", "path_added_m")}
        row |= {"time_added_s": 0.0, "arrived_share": 1.0, "goal_passed_s": 10.0}
        return row | {"refused": "", "ended_early": "", "distance_verdict": "holds"}

    monkeypatch.setattr(remedies, "measure", scripted)
    monkeypatch.setattr(margins, "find", partial(margins.find, measured=scripted))
    return flown


@pytest.fixture
def study(tmp_path: Path, call: Callable[..., int], wing: Path) -> Callable[..., int]:
    chosen = ["--only", "none", "--only", "buffer 1 m", "--seeds", "3", "--workers", "1"]
    settings = [a for s in (*SETTINGS, f"airframes=['{wing}']") for a in ("--set", s)]
    return lambda: call("remedies", "paper-2-turn", *chosen, *settings, "--out", tmp_path / "r")


def test_an_interrupted_study_goes_on_where_it_was(
    study: Callable[[], int],
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    flown = interrupted_after(4, monkeypatch)
    assert study() == 130
    assert "4 finished runs are kept; the same command goes on from there" in capsys.readouterr().err
    assert study() == 0
    assert "resuming: 4 of 6 runs found" in capsys.readouterr().err
    assert len(flown) == 6 and (tmp_path / "r" / "remedies.csv").is_file()
    assert not list(tmp_path.glob(".*"))


def test_a_changed_airframe_resumes_nothing(
    study: Callable[[], int], monkeypatch: pytest.MonkeyPatch, wing: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flown = interrupted_after(4, monkeypatch)
    assert study() == 130
    touch(wing / "x8.xml", "<wingarea", "<!-- another wing --><wingarea")
    assert study() == 0
    assert "resuming" not in capsys.readouterr().err
    assert len(flown) == 4 + 6


def test_a_full_disk_at_the_end_costs_no_flight(
    study: Callable[[], int], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from testbed.studies.remedies import figures as robustness_figures

    flown = interrupted_after(100, monkeypatch)
    draw = robustness_figures.remedies

    def full(*_: object) -> None:
        monkeypatch.setattr(robustness_figures, "remedies", draw)
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(robustness_figures, "remedies", full)
    assert study() == 2
    assert "No space left" in capsys.readouterr().err
    assert study() == 0
    assert len(flown) == 6


def test_an_interrupted_margin_goes_on(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, call: Callable[..., int]
) -> None:
    flown = interrupted_after(5, monkeypatch)

    def margin() -> int:
        options = ["--knob", "ds_buffer", "--target-rate", "0.5", "--seeds", "2", "--workers", "1"]
        return call("margin", "paper-2-turn", *options, "--out", tmp_path / "m")

    assert margin() == 130 and margin() == 0
    assert len(flown) == len({(job.data, job.seed) for job in flown})
    assert json.loads((tmp_path / "m" / "margin.json").read_text())["certified"]


def test_a_line_cut_short_costs_one_run_and_not_its_neighbour(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt), journal_beside(tmp_path / "s", "study") as book:
        book.keep("a", {"value": 1.0})
        book.keep("b", {"value": float("nan")})
        raise KeyboardInterrupt
    (file,) = tmp_path.iterdir()
    for cut in range(2, 34):  # within the second line, wherever a brace may stand
        whole = '{"id": "a", "row": {"value": 1.0}, "timing": {}}\n'
        file.write_text(whole + '{"id": "b{}", "row": {"value": null}, "timing": {}}'[:cut])
        torn = Journal(file)
        assert torn.rows == {"a": {"value": 1.0}}
        torn.keep("c", {})
        assert Journal(file).rows == {"a": {"value": 1.0}, "c": {}}
