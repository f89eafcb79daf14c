"""`testbed tune`: gains files, sweeps with a scenario in the loop, optimisation, and mistakes in one line."""

from __future__ import annotations

import json
import math
import os
import re
import signal
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from aircraft.airframe import copy, load
from aircraft.airframes.schema import Airframe, Channel, Identified
from aircraft.autopilots import gains
from aircraft.autopilots.freshness import stale_lags
from aircraft.autopilots.specification import Row, evaluate
from testbed.errors import UserError
from testbed.studies.tuning import lags, stages, tuning
from testbed.studies.tuning.optimisation import Search, cost, search
from testbed.studies.tuning.tuning import Sweep


@pytest.fixture(scope="module")
def x8() -> Airframe:
    return load("x8")


@pytest.fixture
def detuned(tmp_path: Path) -> Path:
    """Gains with which the X8 overshoots its turns."""
    gains.write(tmp_path / "detuned.toml", "x8", {"turn.damping": 0.8}, {"command": "by hand"})
    return tmp_path / "detuned.toml"


# -- gains files


def test_a_gains_file_stands_for_an_airframe(x8: Airframe, detuned: Path) -> None:
    changed = load(detuned)
    assert changed.name == "x8+detuned" and changed.folder == x8.folder
    assert changed.gains["turn"]["damping"] == 0.8 and changed.gains["climb"] == x8.gains["climb"]
    assert changed.fingerprint() != x8.fingerprint()


def test_a_scenario_flies_a_gains_file(detuned: Path) -> None:
    from testbed.scenario.scenario import load as scenario
    from testbed.simulation.simulate import run

    overrides = ["plant=jsbsim", "duration_s=0.1", "guidance.kind=manoeuvre"]
    done = run(scenario("paper-2-turn", [*overrides, f'airframes=["x8", "{detuned}"]']))
    assert set(done.manifest["airframes"]) == {"x8", "x8+detuned"}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('base = "x8"\n[gains.turn]\ndamping = -1.0', r"gains.turn.damping: must be zero or more"),
        ('base = "x8"\n[gains.turn]\ndamping = nan', r"gains.turn.damping: must be a finite number"),
        ('base = "x8"\n[gains.turn]\ndamping = "1"', r"gains.turn.damping: must be a finite number"),
        ('base = "x8"\n[gains.turn]\ndampin = 1.0', r"turn.dampin.*turn.damping"),
        ('base = "x8"\n[gains.turn]\nfilter_s = 0.0', r"gains.turn.filter_s: must be positive"),
        ('base = "x9"\n[gains.turn]\ndamping = 1.0', r"no airframe x9"),
        ("[gains.turn]\ndamping = 1.0", r'needs base = "NAME"'),
        ("[gains.turn", r"bad.toml"),
    ],
)
def test_a_bad_gains_file_is_one_line_and_exit_code_2(
    text: str,
    message: str,
    tmp_path: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    import re

    (tmp_path / "bad.toml").write_text(text)
    assert call("tune", "x8", "--gains", tmp_path / "bad.toml") == 2
    said = capsys.readouterr().err.strip()
    assert re.search(message, said) and len(said.splitlines()) == 1, said


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["tune", "albatross"], "albatross"),
        (["tune", "x8", "--gains", "nowhere.toml"], "nowhere.toml does not exist"),
        (["tune", "x8", "--sweep", "turn.bandwith=1:2:3"], "turn.bandwidth_radps"),
        (["tune", "x8", "--sweep", "turn.bandwidth=1:2"], "GAIN=FROM:TO:COUNT"),
        (["tune", "x8", "--sweep", "turn.bandwidth=-1:2:3"], "above 0"),
        (["tune", "x8", "--sweep", "turn.bandwidth=nan:2:3"], "finite"),
        (["tune", "x8", "--sweep", "turn.damping=-1:2:3:abs"], "must be zero or more"),
        (["tune", "x8", "--scenario", "paper-2-turn"], "--sweep"),
        (["tune", "x8", "--sweep", "turn.damping=1:2:2", "--optimise"], "one at a time"),
        (["tune", "x8", "--optimise", "--vary", "turn.sharpness"], "turn.sharpness"),
        (["tune", "x8", "--sweep", "turn.damping=1:2:2", "--scenario", "paper-2-tun"], "paper-2-turn"),
        (["tune", "x8@px4", "--sweep", "turn.damping=1:2:2"], "px4 does not read the gain turn.damping"),
        (["tune", "x8@px4", "--sweep", "FW_R_TV=0.3:0.5:2"], "has no gain FW_R_TV; there are FW_R_TC"),
        (
            ["tune", "x8@px4", "--optimise", "--vary", "speed.window"],
            "px4 does not read the gain speed.window",
        ),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    arguments: list[str], message: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(*arguments) == 2
    said = capsys.readouterr().err.strip()
    assert message in said and len(said.splitlines()) == 1, said


# -- sweeps


def test_a_sweep_is_in_factors_of_the_files_value(x8: Airframe) -> None:
    swept = Sweep.parse("turn.bandwidth=0.5:2:9", x8)
    assert swept.gain == "turn.bandwidth_radps"
    assert swept.values[4] == pytest.approx(x8.gains["turn"]["bandwidth_radps"])
    assert swept.values[8] == pytest.approx(4 * swept.values[0])
    assert Sweep.parse("turn.damping=0.5:1.5:3:abs", x8).values == (0.5, 1.0, 1.5)
    # an exact name wins over longer ones that begin with it
    assert Sweep.parse("climb.filter=1:1:1", x8).gain == "climb.filter_radps"
    with pytest.raises(UserError, match=r"climb\.f"):
        Sweep.parse("climb.f=1:1:1", x8)


def fake(point: tuning.Point) -> dict[str, Any]:
    """A flight that costs nothing."""
    value = dict(point.gains)["turn.damping"]
    return {"turn.damping": value, "missed": 0, "omega_t63_s": value, "min_distance_m": 5 * value}


def test_an_interrupted_sweep_goes_on_where_it_was(
    x8: Airframe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    flown: list[float] = []

    def once_cut_short(point: tuning.Point) -> dict[str, Any]:
        if len(flown) == 2:
            flown.append(math.nan)
            raise KeyboardInterrupt
        flown.append(dict(point.gains)["turn.damping"])
        return fake(point)

    monkeypatch.setattr(tuning, "measure", once_cut_short)
    swept, out = [Sweep.parse("turn.damping=0.8:1.2:4:abs", x8)], tmp_path / "s"

    def go() -> tuning.Tuned:
        return tuning.sweep(x8, "x8", swept, None, out, command="testbed tune x8", workers=1)

    with pytest.raises(KeyboardInterrupt):
        go()
    assert not out.exists()
    found = go()
    assert [row["turn.damping"] for row in found.data["rows"]] == pytest.approx(swept[0].values)
    assert np.nansum(flown) == pytest.approx(sum(swept[0].values))  # each value once
    assert {p.name for p in out.iterdir()} == {
        "sweep.csv",
        "sweep.png",
        "sweep.pdf",
        "sweep.svg",
        "report.html",
        "tune.json",
        "gains",
    }
    assert [p.name for p in tmp_path.iterdir()] == ["s"]  # the notebook is gone


@pytest.mark.slow
def test_more_turn_bandwidth_keeps_two_x8s_farther_apart(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    settings = ["rates.filter_dt_s=0.05", "rates.record_dt_s=0.05", "duration_s=13"]
    chosen = [word for s in settings for word in ("--set", s)]
    sweep = ["--sweep", "turn.bandwidth=0.4:2:2", "--scenario", "paper-2-turn"]
    assert call("tune", "x8", *sweep, *chosen, "--out", tmp_path / "s", "--json") == 0
    slow, fast = json.loads(capsys.readouterr().out)["rows"]
    # 2.4 and 5.3 m
    assert slow["min_distance_m"] < 4.0 < fast["min_distance_m"]
    assert slow["omega_t63_s"] > 1.5 * fast["omega_t63_s"]
    assert slow["min_h_m"] < fast["min_h_m"]
    # the gains file of a point flies the same gains again
    again = load(tmp_path / "s" / "gains" / "002.toml")
    assert again.gains["turn"]["bandwidth_radps"] == pytest.approx(fast["turn.bandwidth_radps"])


# -- optimisation


def test_the_cost_is_zero_where_all_bounds_are_met_with_a_reserve() -> None:
    near = Row("turn", "a", "t63_s", 0.33, 0.34)
    far = Row("turn", "a", "t63_s", 0.30, 0.34)
    assert cost([far]) == 0 < cost([near]) < cost([Row("turn", "a", "t63_s", 0.5, 0.34)])
    assert cost([Row("turn", "a", "t63_s", math.nan, 0.34)]) > 0.5
    assert cost([Row("turbulence", "a", "v_rms_mps", 9.0, math.inf)]) == 0


def job(tmp_path: Path, evaluations: int = 40) -> Search:
    stage = (("turn.damping", "turn.bandwidth_radps"), ("turn",))
    base = (("turn.damping", 0.7),)
    return Search("x8", base, (stage,), 1, evaluations, tmp_path / "memory.jsonl")


def test_a_search_mends_a_detuned_turn_and_repeats_itself(
    x8: Airframe, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = evaluate(x8.with_gains({"turn.damping": 0.7}), ["turn"])
    assert not all(r.met for r in before)
    found = search(job(tmp_path))
    assert found["cost"] == 0.0
    assert all(r.met for r in evaluate(x8.with_gains(found["gains"]), ["turn"]))

    def never(*_: object) -> list[Row]:
        raise AssertionError("flown again")

    # interrupted and begun again, it flies nothing it has flown
    monkeypatch.setattr("aircraft.autopilots.specification.evaluate", never)
    assert search(job(tmp_path)) == found


@pytest.mark.slow
def test_optimise_writes_gains_that_can_be_given_back(
    detuned: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setitem(stages.CHANNELS, "turn", (("damping", "bandwidth"), ("turn",)))
    out = tmp_path / "o"
    options = ["--gains", detuned, "--optimise", "--vary", "turn.damping", "--vary", "turn.bandwidth"]
    limits = ["--starts", 1, "--workers", 1, "--evaluations", 40, "--seed", 3]
    call("tune", "x8", *options, *limits, "--out", out)
    capsys.readouterr()
    text = (out / "gains.toml").read_text()
    assert "--seed 3" in text and "airframe_sha256" in text and "jsbsim" in text
    tuned = load(out / "gains.toml")
    assert all(r.met for r in evaluate(tuned, ["turn"]))
    # its lags were identified with these gains, and the command that remakes them names the file
    assert tuned.identified is not None and stale_lags(tuned) is None
    assert tuned.identified.command == f"testbed aircraft identify {out / 'gains.toml'}"
    assert len(json.loads((out / "tune.json").read_text())["lags"]) == 3
    assert not list(tmp_path.glob(".o.*"))
    # the folder is taken
    assert call("tune", "x8", *options, *limits, "--out", out) == 2


@pytest.mark.slow
def test_tune_says_whether_all_bounds_are_met(
    monkeypatch: pytest.MonkeyPatch, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert call("tune", "x8") == 0
    out = capsys.readouterr().out
    assert "bounds met" in out and "omega 0 to 11.7 deg/s at 25 m/s" in out
    assert max(map(len, out.splitlines())) <= 80


def identified(*channels: tuple[float, float]) -> Identified:
    v, omega, zeta = (Channel(time_constant_s=t, delay_s=d) for t, d in channels)
    return Identified(command="none", v=v, omega=omega, zeta=zeta)


def test_a_channel_that_got_slower_is_named_with_both_times() -> None:
    before = identified((0.3, 0.1), (0.2, 0.1), (0.5, 0.1))
    after = identified((0.3, 0.1), (0.3, 0.15), (0.4, 0.1))
    found = lags.rows(before, after)
    assert [row["t63_s"] for row in found] == [0.4, 0.45, 0.5]
    assert lags.sentences(found) == ["turn rate got slower by 50 %: 63 % after 0.450 s, before 0.300 s"]
    assert lags.sentences(lags.rows(before, before)) == ["no channel got slower"]
    assert lags.sentences(lags.rows(None, after)) == [
        "the lags before are not known: nothing to compare with"
    ]


@pytest.mark.slow
def test_missed_bounds_end_a_check_with_exit_code_1_and_the_page_says_them(
    detuned: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "scores"
    assert call("tune", "x8", "--gains", detuned) == 0
    assert call("tune", "x8", "--gains", detuned, "--check", "--out", out) == 1
    rows = pd.read_csv(out / "specification.csv")
    missed = int((~rows.met).sum())
    assert missed > 0 and f"{missed} of {len(rows)} bounds missed" in capsys.readouterr().out
    page = (out / "report.html").read_text(encoding="utf-8")
    assert f"{missed} of {len(rows)} bounds missed" in page and "specification.csv" in page
    assert json.loads((out / "tune.json").read_text())["rows"][0].keys() == set(rows.columns)


def test_a_sweep_is_not_checked(refusal: Callable[..., str]) -> None:
    said = refusal("tune", "x8", "--sweep", "turn.damping=0.5:2:3", "--check")
    assert "--check: a --sweep has many sets of gains" in said


@pytest.mark.parametrize("command", [("tune",), ("aircraft", "describe")])
@pytest.mark.parametrize(
    ("old", "new", "cause"),
    [
        ('<system file="autopilot"/>', "", "no property ap/"),
        ('<wingarea unit="M2"> 0.75', '<wingarea unit="M2"> 0', "its <wingarea> is 0"),
    ],
)
def test_a_model_that_cannot_be_flown_is_one_line_and_exit_code_2(
    command: tuple[str, ...],
    old: str,
    new: str,
    cause: str,
    tmp_path: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    mine = copy("x8", tmp_path / "mine")
    text = (mine / "x8.xml").read_text()
    assert old in text
    (mine / "x8.xml").write_text(text.replace(old, new))
    assert call(*command, mine) == 2
    (said,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("error: ")]
    assert re.search(cause, said) and f"see: testbed aircraft check {mine}" in said


# -- autopilots that people fly


def test_what_is_varied_are_the_parameters_that_the_autopilot_reads(tmp_path: Path) -> None:
    for name in ("x8", "x8@arduplane", "x8@px4"):
        airframe = load(name)
        varied = [gain for gains_, _ in stages.stages(airframe, []) for gain in gains_]
        assert len(varied) >= 8 and len(set(varied)) == len(varied)
        assert all(airframe.gain(gain) > 0 for gain in varied)
        assert all((gain in airframe.parameters) == ("@" in name) for gain in varied)
    (_, groups), *more = stages.stages(load("x8@px4"), ["FW_R_TC"])
    assert not more and set(groups) == {"turn", "all", "margins"}
    wing = copy("x8", tmp_path / "wing")
    (wing / "pid.eq").write_text((Path(__file__).parents[1] / "docs/guide/examples/pid.eq").read_text())
    own = load(f"{wing}@pid.eq")
    with pytest.raises(UserError, match=r"may change in pid.eq with --vary NAME; it has BANK_MAX, ROLL_P"):
        stages.stages(own, [])
    assert stages.stages(own, ["ROLL_P"])[0][0] == ("ROLL_P",)


def fake_parameters(point: tuning.Point) -> dict[str, Any]:
    return {**dict(point.gains), "missed": 1, "omega_t63_s": 0.5, "v_t63_s": 2.0, "zeta_t63_s": 3.0}


def test_parameters_are_swept_on_a_grid_and_shown_on_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tuning, "measure", fake_parameters)
    airframe, out = load("x8@arduplane"), tmp_path / "s"
    swept = [Sweep.parse(t, airframe) for t in ("RLL2SRV_TCONST=0.3:0.8:3", "RLL_RATE_P=0.01:0.05:2")]
    found = tuning.sweep(airframe, "x8@arduplane", swept, None, out, command="testbed tune", workers=1)
    assert [row["RLL2SRV_TCONST"] for row in found.data["rows"]] == [0.3, 0.3, 0.55, 0.55, 0.8, 0.8]
    assert found.rows[0].keys() >= {"RLL2SRV_TCONST", "RLL_RATE_P", "v_t63_s"}
    assert "at RLL2SRV_TCONST 0.3, RLL_RATE_P 0.01" in (out / "report.html").read_text("utf-8")
    assert load(out / "gains" / "002.toml").parameters["RLL_RATE_P"] == 0.05


def test_a_killed_optimisation_ends_as_one_that_was_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Killed for good after some scores, begun again: the same gains, and no score twice."""
    scored: list[int] = []
    most = 10**6

    def fake(airframe: Airframe, groups: object) -> list[Row]:
        scored.append(1)
        if len(scored) > most:
            os.kill(os.getpid(), signal.SIGKILL)
        off = abs(airframe.gain("turn.damping") - 1.31) + abs(airframe.gain("turn.bandwidth_radps") - 7.0)
        return [Row("turn", "a", "t63_s", 1.0 + off, 1.01)]

    def go(memory: str) -> dict[str, Any]:
        scored.clear()
        stage = (("turn.damping", "turn.bandwidth_radps"), ("turn",))
        return search(Search("x8", (), (stage,), 1, 40, tmp_path / memory))

    monkeypatch.setattr("aircraft.autopilots.specification.evaluate", fake)
    found, whole = go("whole.jsonl"), len(scored)
    most = 11
    child = os.fork()
    if child == 0:
        try:
            go("cut.jsonl")
        finally:
            os._exit(1)
    assert os.WTERMSIG(os.waitpid(child, 0)[1]) == signal.SIGKILL
    assert len((tmp_path / "cut.jsonl").read_text().splitlines()) == 11
    most = 10**6
    assert go("cut.jsonl") == found and len(scored) == whole - 11
    assert "goes on: 11 scores found" in capsys.readouterr().err


def test_before_and_after_stand_beside_each_other() -> None:
    from testbed.studies.tuning.optimisation import before_and_after

    def rows(t63: float, at: float) -> list[Row]:
        phases = {v: 50.0 + abs(v - at) for v in (15, 25)}
        margins = [
            Row("margins", f"aileron at {v} m/s", "phase_deg", p, 45.0, False) for v, p in phases.items()
        ]
        return [Row("turn", "omega 0 to 11 deg/s at 16 m/s", "t63_s", t63, 0.34), *margins]

    step, margin = before_and_after(rows(0.5, 15), rows(0.3, 25))
    assert (step["value"], step["before"], step["met"]) == ("0.3 s", "before 0.5 s", "yes")
    # the least of the loop, at whichever speed
    assert margin["step"] == "aileron at 25 m/s"
    assert (margin["value"], margin["before"]) == ("50 deg", "before 50 deg")


def test_parameters_of_a_gains_file_are_flown_whatever_the_airframe_says_of_its_autopilot(
    tmp_path: Path,
) -> None:
    file = tmp_path / "quick.toml"
    gains.write(file, "x8@arduplane", {"RLL_RATE_P": 0.05}, {})
    quick, own = load(file), load("x8@arduplane")
    assert quick.parameters == own.parameters | {"RLL_RATE_P": 0.05} != own.parameters
    assert quick.name == "x8@arduplane+quick" and quick.autopilot == "arduplane"
    # lags of the base are not those of other parameters
    assert quick.identified is None and own.identified is not None
    late = load(f"{file}@typical")
    assert late.parameters == quick.parameters and late.fit == "arduplane@typical" and late.identified is None
    other = load(f"{file}@px4")
    assert other.autopilot == "px4" and other.parameters.keys() == load("x8@px4").parameters.keys()
