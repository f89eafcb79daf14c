"""Baselines: what makes a change a degradation, on numbers of known answer; files and their mistakes."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aircraft.airframe import copy
from testbed.campaigns.job import Job
from testbed.errors import UserError
from testbed.regression import recording
from testbed.regression.baseline import folder, read
from testbed.regression.check import check
from testbed.regression.judging import DEGRADED, IMPROVED, WITHIN, findings
from testbed.regression.quantities import Quantity, quantities
from testbed.regression.recording import record, rung_fields
from testbed.regression.tolerance import ALPHA_RECORDED, compare, holm, seeds_needed, tolerance
from testbed.scenario.scenario import load

DISTANCE = Quantity("separation", "m", -1, 0.01)
LOST = Quantity("separation lost", "", +1, 0.0, verdict=True)
N = 16


def judged(q: Quantity, recorded: np.ndarray, now: np.ndarray, paired: bool = True) -> str:
    allowed = {"r": {q.name: tolerance(q, recorded, now.size)}}
    return findings([q], {"r": {q.name: recorded}}, {"r": {q.name: now}}, allowed, paired)[0].verdict


# -- significance and tolerance


def test_equal_runs_are_no_finding() -> None:
    values = np.random.default_rng(1).normal(6.0, 1.0, N)
    change = compare(DISTANCE, values, values, paired=True)
    assert change.p_worse == change.p_better == 1.0 and change.worse == 0.0
    assert judged(DISTANCE, values, values) == ""


@pytest.mark.parametrize(
    ("shift", "verdict"), [(-0.5, DEGRADED), (+0.5, IMPROVED), (-0.1, WITHIN), (0.1, "")]
)
def test_a_shift_is_judged_by_its_way_and_its_size(shift: float, verdict: str) -> None:
    """One metre of spread over seeds is a tolerance of 0.25 m for a block of 16."""
    values = np.random.default_rng(1).normal(6.0, 1.0, N)
    assert judged(DISTANCE, values, values + shift) == verdict


def test_rounding_is_no_evidence() -> None:
    values = np.random.default_rng(1).normal(6.0, 1e-9, N)
    assert compare(DISTANCE, values, values - 1e-6, paired=True).p_worse == 1.0


def test_worse_on_some_seeds_and_better_on_others_is_no_finding() -> None:
    rng = np.random.default_rng(2)
    values = rng.normal(6.0, 1.0, N)
    assert judged(DISTANCE, values, values + np.tile([-1.0, 1.0], N // 2) * rng.uniform(0.5, 1, N)) == ""


@pytest.mark.parametrize("paired", [True, False])
def test_a_value_that_went_missing_is_worse_than_any(paired: bool) -> None:
    values = np.random.default_rng(1).normal(6.0, 1.0, N)
    assert compare(DISTANCE, values, np.full(N, np.nan), paired).worse == np.inf
    assert judged(DISTANCE, values, np.full(N, np.nan), paired) == DEGRADED
    assert judged(DISTANCE, np.full(N, np.nan), np.full(N, np.nan), paired) == ""


def test_lost_verdicts_take_exact_tests() -> None:
    held, lost = np.zeros(N), np.ones(N)
    assert judged(LOST, held, lost) == judged(LOST, held, lost, paired=False) == DEGRADED
    assert judged(LOST, lost, held) == IMPROVED
    assert compare(LOST, held, lost, paired=True).p_worse == pytest.approx(2.0**-N)
    once = held.copy()
    once[0] = 1.0
    assert compare(LOST, held, once, paired=True).p_worse == 0.5
    # one lost run of 16 against none of 48: 16 of 64 places for it
    assert compare(LOST, np.zeros(48), once, paired=False).p_worse == pytest.approx(0.25)


def test_ties_on_fresh_seeds_count_against_the_finding() -> None:
    """Counts that are mostly zero: the normal formula for ties says p < 1e-5 of 6 in 16 against 0 in 48."""
    count = Quantity("qp-feasibility", "", +1, 1.0)
    now = np.zeros(N)
    now[:6] = 40.0
    assert compare(count, np.zeros(48), now, paired=False).p_worse > 0.5
    assert compare(count, np.zeros(48), np.full(N, 40.0), paired=False).p_worse < 1e-12


def test_the_tolerance_is_the_spread_of_block_means() -> None:
    rng = np.random.default_rng(3)
    blocks = rng.gamma(2.0, 1.0, (4000, N))
    assert tolerance(DISTANCE, blocks[:40].ravel(), N) == pytest.approx(blocks.mean(axis=1).std(), rel=0.1)
    assert tolerance(DISTANCE, np.full(40, 6.0), N) == DISTANCE.resolution
    assert np.isnan(tolerance(DISTANCE, np.full(40, np.nan), N))


@pytest.mark.parametrize("paired", [True, False])
def test_an_unchanged_project_is_rarely_accused(paired: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Skewed, correlated quantities, two runs of which are two draws even at one seed: 5 % asked, at most."""
    monkeypatch.setattr("testbed.regression.judging.ALPHA_FRESH", 0.05)
    monkeypatch.setattr("testbed.regression.judging.ALPHA_RECORDED", 0.05)
    # the interval that `compare` does not look at is most of its time
    monkeypatch.setattr("testbed.statistics.paired.mean", lambda *_: None)
    rng, trials = np.random.default_rng(4), 120
    several = [Quantity(f"q{k}", "m", -1, 0.0) for k in range(4)]

    def draw(seeds: int) -> dict[str, dict[str, np.ndarray]]:
        values = rng.lognormal(0.0, 1.0, (seeds, 1)) + rng.lognormal(0.0, 1.0, (seeds, 4))
        return {"r": {q.name: values[:, k] for k, q in enumerate(several)}}

    accused = 0
    for _ in range(trials):
        recorded = draw(N if paired else 3 * N)
        allowed = {"r": {q.name: tolerance(q, recorded["r"][q.name], N) for q in several}}
        found = findings(several, recorded, draw(N), allowed, paired)
        accused += any(f.verdict == DEGRADED for f in found)
    # 6 of 120 expected at most; more than 14 has a chance of 0.1 %
    assert accused <= 14


def test_holm_is_what_its_inventor_says() -> None:
    """Worked by hand: 0.01 x 4, 0.02 x 3, 0.03 x 2 = 0.06, 0.2 x 1; never falling."""
    assert holm([0.03, 0.01, 0.2, 0.02]) == pytest.approx([0.06, 0.04, 0.2, 0.06])
    assert holm([0.9, 0.8]) == pytest.approx([1.0, 1.0])


def test_fewer_seeds_than_needed_find_nothing_and_as_many_do() -> None:
    enough = seeds_needed(50)
    assert 50 * 2.0**-enough <= ALPHA_RECORDED < 50 * 2.0 ** -(enough - 1)
    values = np.random.default_rng(5).normal(6.0, 1.0, enough)
    p = compare(DISTANCE, values, values - 1.0 - 0.01 * values, paired=True).p_worse
    assert p == pytest.approx(2.0**-enough)


# -- files, on a scripted flight


def scripted(job: Job, slower: float = 0.0) -> dict[str, float | None]:
    """Quantities of a run without the run: aircraft come a metre closer than unicycles, and `slower` more."""
    data = json.loads(job.data)
    row: dict[str, float | None] = {q.name: 0.0 for q in quantities(load("paper-2-turn"))}
    distance = 6.0 + 0.1 * np.random.default_rng(job.seed).normal()
    row["separation"] = round(distance - (1.0 + slower if data["plant"] == "jsbsim" else 0.0), 6)
    return row


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "fly", scripted)


@pytest.fixture
def kept(tmp_path: Path, quick: None) -> Path:
    """A folder with the baseline "x8"."""
    where = tmp_path / "baselines"
    record(where, "x8", "paper-2-turn", ["lookahead_m=10"], workers=1)
    return where


def test_a_baseline_reads_back_as_it_was_written(kept: Path) -> None:
    found = read(kept, "x8")
    assert found.runs["6-DOF"]["separation"].shape == (60,) and found.seeds == 20
    gap = found.runs["unicycle"]["separation"] - found.runs["6-DOF"]["separation"]
    assert gap == pytest.approx(1.0)
    assert found.tolerances["6-DOF"]["separation"] == pytest.approx(0.1 / 20**0.5, rel=0.3)
    # a line per block in a diff
    lines = (kept / "x8.json").read_text().splitlines()
    assert sum(line.count("5.9") > 0 for line in lines) >= 3 and max(map(len, lines)) < 300


def test_recording_twice_gives_the_same_bytes(kept: Path, tmp_path: Path) -> None:
    record(tmp_path / "again", "x8", "paper-2-turn", ["lookahead_m=10"], workers=1)
    assert (tmp_path / "again" / "x8.json").read_bytes() == (kept / "x8.json").read_bytes()


@pytest.mark.parametrize("block", [1, 3, 9])
def test_an_unchanged_project_passes_on_recorded_and_on_fresh_seeds(kept: Path, block: int) -> None:
    report = check(kept, "x8", block=block, workers=1)
    assert not report.degraded and f"seeds {20 * block - 19} to {20 * block}" in report.title


def test_a_check_refuses_an_airframe_whose_numbers_are_stale(kept: Path, tmp_path: Path) -> None:
    """Against a recorded baseline an aircraft whose lags are another's would be blamed for what it is not."""
    mine = copy("x8", tmp_path / "mine")
    toml = mine / "airframe.toml"
    toml.write_text(toml.read_text().replace("bandwidth_radps = 9.5", "bandwidth_radps = 4.5"))
    with pytest.raises(UserError, match=f"testbed aircraft identify {mine}"):
        check(kept, "x8", overrides=[f'airframes=["{mine.as_posix()}"]'], workers=1)


def test_a_degradation_says_what_where_and_by_how_much(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "fly", lambda job: scripted(job, slower=0.5))
    report = check(kept, "x8", workers=1)
    assert report.degraded
    text = report.text()
    assert "degraded: separation on 6-DOF" in text and "worse by 0.5 m" in text and "20 of 20 seeds" in text
    assert "unicycles fly as recorded" in text
    assert "recorded -1.00" in text and "now -1.50" in text
    # half a metre is five spreads: fresh seeds show it too
    assert check(kept, "x8", block=7, workers=1).degraded
    assert not check_improved(kept, monkeypatch).degraded


def check_improved(kept: Path, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(recording, "fly", lambda job: scripted(job, slower=-0.5))
    report = check(kept, "x8", workers=1)
    assert "improved: separation on 6-DOF" in report.text()
    return report


def test_recording_again_wants_a_reason_and_keeps_it(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(UserError, match="--reason"):
        record(kept, "x8", workers=1)
    monkeypatch.setattr(recording, "fly", lambda job: scripted(job, slower=0.5))
    made, _ = record(kept, "x8", reason="a heavier battery", workers=1)
    assert made.overrides == ["lookahead_m=10"]
    first, second = read(kept, "x8").history
    assert first["reason"] == "first recording" and second["reason"] == "a heavier battery"
    assert any("separation on 6-DOF" in line for line in second["changed"])
    assert not check(kept, "x8", workers=1).degraded


def damage(kept: Path, change: Callable[[dict[str, Any]], Any]) -> None:
    data = json.loads((kept / "x8.json").read_text())
    change(data)
    (kept / "x8.json").write_text(json.dumps(data))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda d: d.update(schema_version=99), "schema version 99, this program reads 1"),
        (lambda d: d["scenario"]["flown"].update(d_safe_m=6.0), "changed since: d_safe_m 6.0 -> 5.0"),
        (lambda d: d["scenario"].update(set=[]), "changed since: guidance.lookahead_m 10.0 -> 1.0"),
        (lambda d: d["scenario"].update(source="gone.toml"), "gone.toml does not exist"),
        (lambda d: d["quantities"]["6-DOF"].pop("separation"), "is damaged"),
        (lambda d: d["quantities"]["6-DOF"]["goal"]["runs"].pop(), "is damaged"),
        (lambda d: d.pop("history"), "is damaged"),
    ],
)
def test_a_baseline_that_cannot_be_compared_is_one_line(
    kept: Path, change: Callable[[dict[str, Any]], Any], message: str
) -> None:
    damage(kept, change)
    with pytest.raises(UserError, match=message) as caught:
        check(kept, "x8", workers=1)
    assert len(str(caught.value).splitlines()) == 1
    # whatever it was, it can be recorded again
    record(kept, "x8", "paper-2-turn", ["lookahead_m=10"], reason="remade", workers=1)
    assert not check(kept, "x8", workers=1).degraded


def test_a_scenario_file_is_found_from_anywhere(
    tmp_path: Path, quick: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = tmp_path / "mine.toml"
    mine.write_text('name = "mine"\nvehicles = 2\n')
    monkeypatch.chdir(tmp_path)
    made, _ = record(Path("tests/baselines"), "mine", "mine.toml", [], workers=1)
    assert made.source == "../../mine.toml"
    monkeypatch.chdir("/")
    assert not check(tmp_path / "tests/baselines", "mine", workers=1).degraded
    mine.write_text('name = "mine"\nvehicles = 2\nd_safe_m = 7.0\n')
    with pytest.raises(UserError, match=r"mine.toml has changed since: d_safe_m 5.0 -> 7.0"):
        check(tmp_path / "tests/baselines", "mine", workers=1)


def test_the_folder_is_the_projects_to_choose(tmp_path: Path) -> None:
    assert folder(tmp_path) == tmp_path / "tests" / "baselines"
    (tmp_path / "pyproject.toml").write_text('[tool.testbed]\nbaselines = "ci/fidelity"\n')
    assert folder(tmp_path) == tmp_path / "ci/fidelity"
    assert folder(tmp_path, Path("asked")) == Path("asked")
    (tmp_path / "pyproject.toml").write_text("[tool.testbed]\nbaselines = 3\n")
    with pytest.raises(UserError, match="give a folder, got 3"):
        folder(tmp_path)


def test_rungs_are_the_ladders_and_add_up() -> None:
    s = load("paper-2-turn")
    found = rung_fields(s, ["wind", "unicycle", "6-DOF"])
    assert list(found) == ["unicycle", "6-DOF", "wind"]
    assert found["unicycle"] == {"plant": "unicycle"}
    assert found["6-DOF"]["plant"] == found["wind"]["plant"] == "jsbsim"
    assert "wind.speed_mps" in found["wind"].keys() - found["6-DOF"].keys()
    assert not any(name.startswith("rates") for of in found.values() for name in of)


# -- the command


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["record", "new"], "--scenario"),
        (["record", "a/b", "--scenario", "paper-2-turn"], "baseline name 'a/b'"),
        (["record", "new", "--scenario", "paper-2-tur"], "paper-2-turn"),
        (["record", "new", "--scenario", "paper-2-turn", "--seeds", "5"], "give 13"),
        (["record", "new", "--scenario", "paper-2-turn", "--blocks", "1"], "at least 2"),
        (["record", "new", "--scenario", "paper-2-turn", "--rungs", "6DOF"], "6-DOF"),
        (["record", "new", "--scenario", "paper-2-turn", "--rungs", ","], "name each rung once"),
        (["record", "new", "--scenario", "paper-2-turn", "--set", "plant=jsbsim"], "--rungs"),
        (["record", "x8"], "x8.json exists"),
        (["check", "x9"], "did you mean x8"),
        (["check", "x8", "--block", "0"], "count from 1"),
        (["check", "x8", "--set", "seed=3"], "--block"),
        (["check", "x8", "--set", 'airframes=["nowhere.toml"]'], "nowhere.toml"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(
    arguments: list[str],
    message: str,
    kept: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
) -> None:
    capsys.readouterr()
    assert call("regress", *arguments, "--baselines", kept, "--workers", 1) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if " of " not in line]
    assert len(said) == 1 and message in said[0], said


def test_the_command_checks_all_and_its_exit_code_tells(
    kept: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    record(kept, "other", "paper-2-turn", [], workers=1)
    assert call("regress", "check", "--baselines", kept, "--workers", 1) == 0
    out = capsys.readouterr().out
    assert "x8: no significant degradation" in out and "other: no significant degradation" in out
    monkeypatch.setattr(recording, "fly", lambda job: scripted(job, slower=0.5))
    assert call("regress", "check", "x8", "--baselines", kept, "--workers", 1, "--json") == 1
    found = json.loads(capsys.readouterr().out)["x8"]
    assert found["degraded"] and len(found["quantities"]) == 2 * len(quantities(load("paper-2-turn")))
    bad = [row for row in found["quantities"] if row["verdict"] == DEGRADED]
    assert [(row["rung"], row["quantity"]) for row in bad] == [("6-DOF", "separation")]


def test_an_empty_folder_says_how_to_begin(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("regress", "check", "--baselines", tmp_path) == 2
    assert "testbed regress record" in capsys.readouterr().err
