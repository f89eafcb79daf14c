"""Parts of one's own in every command: they fly in worker processes, and no other file is taken for them."""

from __future__ import annotations

import functools
import html
import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import testbed
from testbed.campaigns.flight import FLOWN
from testbed.campaigns.inprocess import InProcess
from testbed.campaigns.journal import Journal
from testbed.campaigns.outcome import Executor
from testbed.campaigns.processes import Processes
from testbed.campaigns.runner import fly_all, prepare, reopen
from testbed.campaigns.sent_parts import SentParts
from testbed.campaigns.view import View
from testbed.components.components import Parts
from testbed.components.named_parts import read
from testbed.errors import UserError
from testbed.regression.check import check
from testbed.regression.recording import record
from testbed.scenario.scenario import load
from testbed.simulation.refly import refly
from testbed.studies.common.measure import job_of, keys, override
from testbed.studies.margin import margin as margins

sys.path[:0] = [str(Path(__file__).parent)]
import own_code  # noqa: E402

SETTINGS = ["duration_s=0.5", "filter_dt_s=0.05", "record_dt_s=0.05", "manoeuvre_instants=0"]
SET = [word for item in SETTINGS for word in ("--set", item)]
CAMPAIGN = """
name = "own"
scenario = "paper-2-turn"
seeds = 4
[set]
duration_s = 1.0
"rates.filter_dt_s" = 0.05
"rates.record_dt_s" = 0.05
"start.lateral_perturbation_m" = 5.0
"""


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    own_code.write(tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "helper", raising=False)
    return tmp_path


def own(*texts: str) -> Parts:
    return Parts.of(read(texts))


class Mine:
    """A filter of a module that can be imported."""

    def __init__(self, scenario: Any, barrier: Any, goal: Any) -> None: ...


def test_a_run_says_whose_filter_flew(
    here: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    parts = ["--parts", "mine.py:Slow(share=0.5)", "--parts", "mine.py:Straight"]
    assert call("run", "paper-2-turn", *SET, *parts) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "paper-2-turn on unicycle, filter mine.Slow(share=0.5), guidance mine.Straight" in said
    folder = Path("runs") / "paper-2-turn-unicycle-Slow-Straight"
    run = testbed.load(folder)
    sums = {role: origin["sha256"] for role, origin in run.manifest["parts"].items()}
    assert sums.keys() == {"filter", "nominal"} and run.part("filter") == "mine.Slow(share=0.5)"
    assert run.manifest["parts"]["filter"]["imports"].keys() == {"helper.py"}
    # A report and a recording say it too.
    assert call("report", folder) == 0
    assert call("export", folder, "--format", "acmi", "--out", "run.txt.acmi") == 0
    for file in (folder / "report.html", Path("run.txt.acmi")):
        text = file.read_text(encoding="utf-8")
        assert "mine.Slow(share=0.5)" in text and sums["filter"][:12] in text and "guidance" in text


def test_verify_flies_again_with_the_same_parts_only(
    here: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call("run", "paper-2-turn", *SET, "--parts", "mine.py:Slow(share=0.5)", "--out", "r") == 0

    def verified(*parts: str) -> tuple[int, str]:
        capsys.readouterr()
        words = [word for part in parts for word in ("--parts", part)]
        code = call("verify", "r", "--fly", *words)
        return code, " ".join(capsys.readouterr().out.split())

    code, said = verified("mine.py:Slow(share=0.5)")
    assert code == 0 and "flown again, all is the same" in said
    code, said = verified()
    assert code == 0 and "give --parts 'mine.py:Slow(share=0.5)'" in said and "not flown again" in said
    for other in (["mine.py:Slow"], ["mine.py:Slow(share=0.5)", "mine.py:Straight"], ["mine.py:Straight"]):
        code, said = verified(*other)
        assert code == 1 and "flown otherwise" in said
    own_code.write(here, speed=21.0)  # what it imports is another
    code, said = verified("mine.py:Slow(share=0.5)")
    assert code == 1 and "filter differs: it is not the part that flew" in said
    assert call("verify", "r", "--parts", "mine.py:Slow") == 2
    assert "only --fly flies parts" in capsys.readouterr().err


def test_a_script_s_part_is_the_same_as_that_of_its_file(here: Path) -> None:
    script = (
        "import testbed\n" + own_code.SMALL + "\nif __name__ == '__main__':\n"
        f"    s = testbed.load_scenario('paper-2-turn', {SETTINGS})\n"
        "    testbed.run(s, __import__('pathlib').Path('r'), parts=testbed.Parts(nominal=made_straight))\n"
    ).replace(
        "class Glider",
        "def made_straight(scenario, goal, barrier):\n    return Straight(goal)\n\nclass Glider",
    )
    Path("script.py").write_text(script)

    subprocess.run([sys.executable, "script.py"], check=True)
    # A script's imports are not recorded, as it is no file that was named.
    found = refly(Path("r"), parts=own("script.py:made_straight"))
    assert [f.what for f in found if f.agrees is False] == ["flown again: guidance"]
    assert "made_straight" in found[0].said and "made_straight" in found[0].own


def flown(out: Path, pool: Executor, view: View | None = None, *texts: str) -> None:
    Path("own.toml").write_text(CAMPAIGN, encoding="utf-8")
    plan = prepare("own.toml", out, parts=read(texts or ["mine.py:Slow(share=0.9)"]))
    if isinstance(pool, Processes):
        Path("mine.py").rename("moved.txt")  # the text travels with the job
    try:
        with pool:
            assert fly_all(plan, out, pool, view or View()).complete
    finally:
        if Path("moved.txt").is_file():
            Path("moved.txt").rename("mine.py")


class Stopping(View):
    def done(self, row: dict[str, Any]) -> None:
        super().done(row)
        raise KeyboardInterrupt


def test_a_campaign_is_the_same_on_processes_and_after_an_interruption(
    here: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    flown(here / "one", InProcess())
    with pytest.raises(KeyboardInterrupt):
        flown(here / "two", Processes(2), Stopping())
    for parts, said in {
        (): "was begun with filter Slow(share=0.9): give --parts 'mine.py:Slow(share=0.9)'",
        ("mine.py:Slow",): "was begun with filter Slow(share=0.9)",
        ("mine.py:Slow(share=0.9)", "mine.py:Straight"): "was begun without Straight; leave it out",
    }.items():
        with pytest.raises(UserError) as refused:
            reopen(here / "two", parts=read(parts))
        assert said in str(refused.value)
    own_code.write(here, own_code.SMALL + "\n# edited\n")
    with pytest.raises(UserError, match=r"begun with another mine.py \(SHA-256 \w{12}, now \w{12}\)"):
        reopen(here / "two", parts=read(["mine.py:Slow(share=0.9)"]))
    with pytest.raises(UserError, match=r"another mine.py .* or give another --out"):
        flown(here / "two", InProcess())
    # Nothing is flown to read how far it came.
    assert call("campaign", "status", "two") == 0 and "of 4 runs done" in capsys.readouterr().out
    own_code.write(here)
    assert call("campaign", "resume", "two", "--workers", 1, "--parts", "mine.py:Slow(share=0.9)") == 0
    assert "Part of the user's own: filter mine.Slow(share=0.9) (mine.py, SHA-256 " in html.unescape(
        Path("two/report.html").read_text(encoding="utf-8")
    )
    one, two = ((here / name / "runs.parquet").read_bytes() for name in ("one", "two"))
    assert one == two
    rows = [json.loads(line)["row"] for line in (here / "one" / "journal.jsonl").read_text().splitlines()]
    assert {row["status"] for row in rows} == {FLOWN} and not any(row["ended_early"] for row in rows)
    flown(here / "other", InProcess(), None, "mine.py:Slow(share=0.8)")
    assert (here / "other" / "runs.parquet").read_bytes() != one


def test_ids_know_the_file_its_imports_and_the_arguments(here: Path) -> None:
    data = override(load("paper-2-turn", SETTINGS), {})

    def key(*texts: str) -> str:
        return keys([job_of("any", data, 1, own(*texts) if texts else None)])[0]

    first, plain = key("mine.py:Slow"), key()
    assert plain == keys([job_of("any", data, 1, Parts())])[0] != first
    assert (
        len({plain, first, key("mine.py:Slow(share=0.5)"), key("mine.py:made"), key("mine.py:Straight")}) == 5
    )
    # Where the file lies does not matter, what it imports does.
    own_code.write(here / "elsewhere")
    for name in ("mine.py", "helper.py"):
        assert (here / name).read_bytes() == (here / "elsewhere" / name).read_bytes()
    sys.modules.pop("helper")
    assert key("elsewhere/mine.py:Slow") == first
    sys.modules.pop("helper")
    own_code.write(here, speed=19.0)
    assert key("mine.py:Slow") != first


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        (
            Parts(filter=lambda s, b, g: None),
            "flies in this process alone: it is a lambda; put",
        ),
        (Parts(plant=functools.partial(Mine, goal=object())), "its argument .* is no literal"),
        (Parts(filter=Mine.__call__), "object of class"),
    ],
)
def test_what_has_no_checksum_flies_in_this_process_alone(parts: Parts, said: str) -> None:
    with pytest.raises(UserError, match=said):
        SentParts.of(parts)


def test_a_maker_of_a_module_is_sent_and_a_local_one_is_not() -> None:
    sent = SentParts.of(Parts(filter=Mine))
    assert sent is not None and sent.here().filter is Mine and SentParts.of(Parts()) is None

    def local(scenario: Any, barrier: Any, goal: Any) -> None: ...

    with pytest.raises(UserError, match="it is defined inside a function"):
        SentParts.of(Parts(filter=local))
    # Another source where it arrives.
    with pytest.raises(UserError, match=r"a worker has another test_parts_in_commands.py \(SHA-256 "):
        SentParts(sent.parts, sent.origins.replace('"sha256": "', '"sha256": "0')).here()


def test_studies_fly_them(here: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    part = ["--parts", "mine.py:Slow(share=0.9)"]
    short = [*SET, "--plant", "unicycle"]
    margin = ["margin", "paper-2-turn", *short, "--knob", "prediction", "--seeds", 2, "--target-rate", 0.5]
    assert call(*margin, "--workers", 1, "--out", "m", *part) == 0
    assert json.loads(Path("m/margin.json").read_text())["parts"]["filter"]["name"] == "mine.Slow"
    assert "filter mine.Slow(share=0.9): margin by prediction" in " ".join(capsys.readouterr().out.split())
    words = ["remedies", "paper-2-turn", *short, "--seeds", 2, "--only", "none", "--only", "buffer 1 m"]
    assert call(*words, "--workers", 1, "--out", "x", *part) == 0
    words = ["falsify", "paper-2-turn", *short, "--budget", 3, "--workers", 1, "--out", "f"]
    assert call(*words, *part) == 0
    data = json.loads(Path("f/falsify.json").read_text())
    assert data["parts"]["filter"]["arguments"] == {"share": "0.9"}
    assert data["reproduce"] == "testbed run f/scenario.toml --parts 'mine.py:Slow(share=0.9)'"


def test_a_filter_that_takes_no_remedy_is_told_from_one_that_needs_more(here: Path) -> None:
    """All settings of a knob that the filter does not use give the same runs; the sentence says so."""

    def measured(job: Any) -> dict[str, Any]:
        assert job.own().own()["filter"].name == "mine.Slow"
        return {"rung": job.label, "distance_m": 1.0 + job.seed, "distance_verdict": "violated"}

    s = load("paper-2-turn", [*SETTINGS, "lateral_perturbation_m=5"])
    parts = own("mine.py:Slow")
    found = margins.find(s, "ds_buffer", 0.1, 2, 1, measured, Journal(), parts)
    assert margins.sentence(found).endswith(
        "; every setting gave the same runs: the filter does not use ds_buffer, or nobody meets"
    )


def test_a_filter_is_made_for_the_remedies_that_any_filter_has(here: Path) -> None:
    Path("who.py").write_text(
        "from filters.cbf.collision import Passthrough\nGIVEN = {}\n\n"
        "class Who(Passthrough):\n    def __init__(self, scenario, barrier):\n"
        "        GIVEN['d'] = scenario.d_safe_m, barrier.d_safe\n        GIVEN['r'] = scenario.remedy\n"
        "    def __call__(self, view, nominal, limits):\n"
        "        GIVEN.setdefault('x', view.state.x[0])\n"
        "        return super().__call__(view, nominal, limits)\n"
    )
    remedies = ["ds_buffer_m=2", "prediction_s=0.5", "robust_v_mps=0.3"]
    s = load("paper-2-turn", [*SETTINGS, *remedies, "start.speed_mps=20"])
    (part,) = read(["who.py:Who"])
    run = testbed.run(s, parts=Parts.of([part]))
    given = part.target().__init__.__globals__["GIVEN"]
    assert given["d"] == (7.0, 7.0) and given["r"].chosen == ["robust_v_mps"]
    # It saw itself half a second ahead; verdicts use the scenario's Ds.
    assert abs(abs(given["x"] - run.vehicles.x_m[0]) - 10.0) < 1e-6
    assert run.guarantee("separation")["bound"] == 5.0


def test_a_remedied_filter_of_the_catalogue_is_the_same_by_ones_own_maker() -> None:
    from testbed.components import catalogue

    s = load("paper-2-turn", [*SETTINGS, "ds_buffer_m=2", "prediction_s=0.5", "robust_v_mps=0.3"])
    usual = testbed.run(s)
    again = testbed.run(s, parts=Parts(filter=lambda s, b, goal: catalogue.filter_(s, b, goal)))
    assert usual.vehicles.v_command_mps.equals(again.vehicles.v_command_mps)
    assert usual.vehicles.omega_command_radps.equals(again.vehicles.omega_command_radps)


def test_a_baseline_carries_the_part_and_names_a_changed_one(here: Path) -> None:
    words: dict[str, Any] = {"blocks": 2, "seeds": 16, "rungs": ["unicycle"], "workers": 1}
    settings = ["duration_s=0.3", "filter_dt_s=0.05", "record_dt_s=0.05"]
    parts = own("mine.py:Slow(share=0.9)")
    made, _ = record(here / "b", "mine", "paper-2-turn", settings, parts=parts, **words)
    assert made.parts["filter"]["arguments"] == {"share": "0.9"}
    same = check(here / "b", "mine", workers=1, parts=parts)
    assert not same.degraded and not [line for line in same.lines if "filter" in line]
    with pytest.raises(UserError, match=r"with filter mine.Slow\(share=0.9\): give --parts 'mine.py:Slow"):
        check(here / "b", "mine", workers=1)
    changed = check(here / "b", "mine", workers=1, parts=own("mine.py:Slow(share=0.8)"))
    (line,) = [line for line in changed.lines if line.startswith("filter ")]
    assert "mine.Slow(share=0.8) (mine.py, SHA-256 " in line and "recorded with mine.Slow(share=0.9)" in line
    Path("plant.py").write_text(own_code.SMALL)
    with pytest.raises(UserError, match="the rungs of a baseline have plants of their own"):
        check(here / "b", "mine", workers=1, parts=own("mine.py:Slow", "plant.py:Glider"))


@pytest.mark.parametrize("command", ["run", "compare", "remedies", "margin", "falsify"])
def test_a_wrong_part_is_one_line_of_any_command(
    command: str, here: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    more = ["--knob", "ds_buffer"] if command == "margin" else []
    assert call(command, "paper-2-turn", *more, "--parts", "mine.py:Slaw") == 2
    assert capsys.readouterr().err == "error: --parts: mine.py has no 'Slaw'; did you mean Slow?\n"
    assert not Path("runs").exists()
