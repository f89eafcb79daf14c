"""Nothing lost, nothing double: campaigns killed, crashed, cut short and spread out give the same bytes."""

from __future__ import annotations

import json
import os
import random
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pandas as pd
import psutil
import pytest

from aircraft.airframe import copy
from testbed.campaigns.cluster import Cluster, on_worker
from testbed.campaigns.folder import locked
from testbed.campaigns.outcome import Executor
from testbed.campaigns.processes import Processes
from testbed.campaigns.progress import Progress
from testbed.campaigns.runner import fly_all, prepare
from testbed.campaigns.transfer import packed
from testbed.campaigns.view import View
from testbed.errors import UserError

pytestmark = pytest.mark.slow

PROGRAM = Path(sys.executable).parent / "testbed"

SHORT = """
name = "short"
scenario = "paper-2-turn"
seeds = {seeds}
plants = ["unicycle", "lagged"]

[set]
duration_s = 0.1
"checks.manoeuvre_instants" = 0
"start.heading_perturbation_deg" = 5

[random]
d_safe_m = {{ uniform = [4, 6] }}
"""


class Watched(View):
    """Calls back with the number of runs that ended, in the middle of the campaign."""

    def __init__(self, call: Callable[[int], None]) -> None:
        super().__init__()
        self._call, self._seen = call, 0

    def done(self, row: dict[str, Any]) -> None:
        super().done(row)
        self._seen += 1
        self._call(self._seen)


def campaign_file(folder: Path, seeds: int = 15, text: str = SHORT) -> Path:
    file = folder / "short.toml"
    file.write_text(text.format(seeds=seeds), encoding="utf-8")
    return file


def flown(file: Path, out: Path, pool: Executor | None = None, view: View | None = None) -> Progress:
    with pool or Processes(2) as open_pool:
        return fly_all(prepare(str(file), out), out, open_pool, view or View())


def table(out: Path) -> bytes:
    return (out / "runs.parquet").read_bytes()


def started(*arguments: object, **more: Any) -> subprocess.Popen[str]:
    command = [str(PROGRAM), "campaign", *map(str, arguments)]
    return subprocess.Popen(command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True, **more)


def lines(out: Path) -> int:
    """Runs in the journal."""
    file = out / "journal.jsonl"
    return file.read_bytes().count(b"\n") if file.is_file() else 0


def wait(
    until: Callable[[], bool], process: subprocess.Popen[str] | None = None, timeout_s: float = 60
) -> None:
    """Until it is so, or the process has ended."""
    end = time.monotonic() + timeout_s
    while not until() and (process is None or process.poll() is None):
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.005)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The campaign flown by one worker without interruption."""
    place = tmp_path_factory.mktemp("whole")
    flown(campaign_file(place), place / "out", Processes(1))
    return place / "out"


def test_a_campaign_has_a_row_per_run_and_its_timings_apart(whole: Path) -> None:
    runs = pd.read_parquet(whole / "runs.parquet")
    assert len(runs) == 30 and runs.id.is_unique and (runs.status == "flown").all()
    assert runs.plant.tolist() == ["unicycle"] * 15 + ["lagged"] * 15
    assert runs.seed.tolist() == [*range(1, 16)] * 2
    assert runs.d_safe_m.between(4, 6).all() and runs.d_safe_m[:15].tolist() == runs.d_safe_m[15:].tolist()
    assert (runs.separation_verdict == "holds").all() and runs.separation_value.between(390, 400).all()
    timings = pd.read_parquet(whole / "timings.parquet")
    assert timings.id.tolist() == runs.id.tolist() and (timings.wall_s > 0).all()
    assert "wall_s" not in runs and not (whole / "runs").exists()


def test_a_row_is_what_the_run_alone_says(whole: Path) -> None:
    from testbed.scenario.scenario import load
    from testbed.simulation.simulate import run

    row = pd.read_parquet(whole / "runs.parquet").iloc[20]
    fields = [f"d_safe_m={float(row.d_safe_m)!r}", f"seed={row.seed}", f"plant={row.plant}", "duration_s=0.1"]
    alone = run(load("paper-2-turn", [*fields, "heading_perturbation_deg=5", "manoeuvre_instants=0"]))
    assert row.separation_value == alone.guarantee("separation")["value"]
    assert row.safe_set_value == alone.guarantee("safe-set")["value"]
    assert row.goal_verdict == alone.guarantee("goal")["verdict"] == "violated"


def test_killed_at_ten_random_moments_it_gives_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    file, out, rng = campaign_file(tmp_path), tmp_path / "out", random.Random(6)
    reached = []
    for moment in range(10):
        process = started("run", file, "--out", out, "--workers", 1 + moment % 2)
        # Some moments while it starts, most while runs end.
        more = lines(out) + rng.randrange(1, 3)
        until = time.monotonic() + (60.0 if moment % 5 else rng.uniform(0.05, 1.0))
        wait(lambda more=more, until=until: lines(out) >= more or time.monotonic() > until, process)
        time.sleep(rng.uniform(0, 0.01))
        children = psutil.Process(process.pid).children() if process.poll() is None else []
        process.kill()
        process.communicate()
        reached.append(lines(out))
        assert not psutil.wait_procs(children, timeout=20)[1], "a worker outlived its campaign"
    assert reached == sorted(reached) and len(set(reached)) > 4 and reached[-1] < 30
    state = flown(file, out)
    assert state.complete and table(out) == table(whole)
    ids = [
        json.loads(line)["id"]
        for line in (out / "journal.jsonl").read_text().splitlines()
        if line[-1:] == "}"
    ]
    assert len(ids) == len(set(ids)) == 30, "flown twice"


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_stopped_by_a_signal_it_says_how_to_go_on(
    number: int, code: int, whole: Path, tmp_path: Path
) -> None:
    file, out = campaign_file(tmp_path), tmp_path / "out"
    process = started("run", file, "--out", out, "--workers", 1)
    wait(lambda: lines(out) >= 3, process)
    process.send_signal(number)
    said = process.communicate(timeout=30)[1].splitlines()
    assert process.returncode == code
    assert "interrupted; " in said[-1] and f"testbed campaign resume {out}" in said[-1]
    assert not (out / "runs.parquet").exists()
    flown(file, out)
    assert table(out) == table(whole)


def test_a_worker_killed_time_and_again_loses_nothing(whole: Path, tmp_path: Path) -> None:
    pool = Processes(2)
    killed: list[int] = []

    def kill(seen: int) -> None:
        pid = pool.pids[0]
        if seen % 3 == 0 and pid is not None and pid not in killed:
            os.kill(pid, signal.SIGKILL)
            killed.append(pid)

    state = flown(campaign_file(tmp_path), tmp_path / "out", pool, Watched(kill))
    assert len(killed) >= 3 and state.complete
    assert table(tmp_path / "out") == table(whole)


# Python reads it at the start of every process whose PYTHONPATH it is on: of ours, the workers die by it.
CRASH = """
import os, sys
if sys.argv[0] == "-c":
    import testbed.components.initial_conditions
    generators = testbed.components.initial_conditions.generators
    def crashing(seed):
        if seed == 4:
            os.abort()
        if seed == 5:
            raise ZeroDivisionError("an error within the run")
        return generators(seed)
    testbed.components.initial_conditions.generators = crashing
"""


def test_a_run_that_always_crashes_is_recorded_and_costs_no_other(
    whole: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "sitecustomize.py").write_text(CRASH)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    flown(campaign_file(tmp_path), tmp_path / "out")
    runs, sound = (pd.read_parquet(p / "runs.parquet") for p in (tmp_path / "out", whole))
    crashed = runs[runs.seed == 4]
    assert crashed.status.tolist() == ["failed"] * 2
    assert crashed.reason.tolist() == ["its process died of SIGABRT, 2 times"] * 2
    assert crashed.separation_verdict.isna().all()
    assert runs[runs.seed == 5].reason.tolist() == ["ZeroDivisionError: an error within the run"] * 2
    others = ~runs.seed.isin([4, 5])
    pd.testing.assert_frame_equal(runs[others], sound[others])
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())["cells"]
    # What did not hold, for whatever reason, is no pass.
    assert [(c["failed"], c["lost"]) for c in summary] == [(2, 2), (2, 2)]


def test_a_full_disk_leaves_a_resumable_campaign(whole: Path, tmp_path: Path) -> None:
    file, out = campaign_file(tmp_path), tmp_path / "out"
    # No file may grow beyond this: the tenth line or so is cut short.
    limit = (8000, 8000)
    process = started(
        "run", file, "--out", out, "--workers", 1,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, limit),
    )  # fmt: skip
    said = process.communicate(timeout=60)[1].splitlines()
    assert process.returncode == 2
    assert said[-1].startswith("error: ") and "File too large" in said[-1] and "resume" in said[-1]
    assert 3 < lines(out) < 30 and (out / "journal.jsonl").stat().st_size == 8000
    flown(file, out)
    assert table(out) == table(whole)


def test_another_process_or_another_campaign_is_refused_its_folder(
    whole: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    before = table(whole)
    other = campaign_file(tmp_path, seeds=14)
    (tmp_path / "notes").mkdir()
    (tmp_path / "notes" / "mine.txt").write_text("")
    assert call("campaign", "run", other, "--out", whole) == 2
    assert call("campaign", "run", other, "--out", tmp_path / "notes") == 2
    assert call("campaign", "resume", tmp_path / "notes") == 2
    with locked(whole):
        assert call("campaign", "resume", whole) == 2
        assert call("campaign", "run", other, "--out", whole, "--overwrite") == 2
    said = capsys.readouterr().err.splitlines()
    expected = (
        "another campaign",
        "exists; give another --out",
        "holds no campaign",
        "flown by another process",
        "process",
    )
    assert len(said) == len(expected) and all(e in line for e, line in zip(expected, said, strict=True))
    assert table(whole) == before


def test_a_campaign_whose_code_has_changed_is_not_gone_on_with(
    whole: Path, tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "old"
    out.mkdir()
    manifest = json.loads((whole / "campaign.json").read_text())
    (out / "campaign.json").write_text(json.dumps(manifest | {"code": "0" * 16}))
    assert call("campaign", "resume", out) == 2
    assert "was begun by other code" in capsys.readouterr().err


def test_run_folders_are_kept_for_violations_alone(tmp_path: Path) -> None:
    from testbed.records.store import load

    near = """
name = "near"
scenario = "paper-2-turn"
seeds = 2
keep = "violations"
[set]
"filter.kind" = "none"
"checks.manoeuvre_instants" = 0
duration_s = 0.5
heading_perturbation_deg = 1
[grid]
"start.radius_m" = [8, 100]
"""
    flown(campaign_file(tmp_path, text=near), tmp_path / "out")
    runs = pd.read_parquet(tmp_path / "out" / "runs.parquet")
    lost = runs[runs.separation_verdict != "holds"]
    assert sorted(lost["start.radius_m"]) == [8, 8]
    assert sorted(p.name for p in (tmp_path / "out" / "runs").iterdir()) == sorted(lost.id)
    kept = load(tmp_path / "out" / "runs" / lost.id.iloc[0])
    assert kept.guarantee("separation")["value"] == lost.separation_value.iloc[0]
    assert len(kept.vehicles) == 202


def test_a_cell_is_flown_no_further_once_its_rate_is_sure(tmp_path: Path) -> None:
    looking = """
name = "looking"
scenario = "paper-2-turn"
[set]
"filter.kind" = "none"
"checks.manoeuvre_instants" = 0
duration_s = 0.5
[grid]
"start.radius_m" = [8, 100]
[random]
d_safe_m = {{ uniform = [0.1, 20] }}
[stop]
looks = [6, 12, 18]
target = 0.5
"""
    flown(campaign_file(tmp_path, text=looking), tmp_path / "out", Processes(1))
    runs = pd.read_parquet(tmp_path / "out" / "runs.parquet")
    cells = json.loads((tmp_path / "out" / "summary.json").read_text())["cells"]
    for cell, (_, of) in zip(cells, runs.groupby("start.radius_m"), strict=True):
        assert of.seed.tolist() == [*range(1, cell["runs"] + 1)]
        assert cell["lost"] == (of.separation_verdict != "holds").sum()
    # Never lost: sure at the second look, 1 - (0.05 / 3 / 2)^(1/12) = 0.33 < 0.5; at the first it is 0.55.
    assert [(c["runs"], c["decision"]) for c in cells][1] == (12, "below")
    file = tmp_path / "short.toml"
    flown(file, tmp_path / "again", Processes(2))
    assert table(tmp_path / "again") == table(tmp_path / "out")


@pytest.fixture
def dask(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler's address, and its two workers and the scheduler."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": tmp_path}
    program = [str(PROGRAM.parent / "dask")]
    host, port = address.removeprefix("tcp://").split(":")
    at = ["--host", host, "--port", port, "--no-dashboard", "--no-show"]
    scheduler = subprocess.Popen([*program, "scheduler", *at], **quiet)
    options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", host]
    workers = [subprocess.Popen([*program, "worker", address, *options], **quiet) for _ in range(2)]
    try:
        yield address, [*workers, scheduler]
    finally:
        for process in (*workers, scheduler):
            process.kill()
            process.wait()


def test_over_a_cluster_with_a_worker_killed_it_gives_the_same_bytes(
    dask: tuple[str, list[subprocess.Popen[bytes]]], whole: Path, tmp_path: Path
) -> None:
    address, workers = dask
    with Cluster(address, timeout_s=60) as pool:
        wait(lambda: pool.workers == 2)
        # Runs are short: a worker that still imports would find none left.
        ready = packed(exec, "import testbed.campaigns.flight")
        for worker in pool.client.scheduler_info()["workers"]:
            pool.client.submit(on_worker, 0, ready, workers=[worker], pure=False).result()

        def kill(seen: int) -> None:
            if seen == 10:
                workers[0].kill()

        state = flown(campaign_file(tmp_path), tmp_path / "out", pool, Watched(kill))
    assert workers[0].wait() == -signal.SIGKILL and state.complete
    assert table(tmp_path / "out") == table(whole)
    by = pd.read_parquet(tmp_path / "out" / "timings.parquet").worker
    assert by.nunique() == 2, "both workers flew"


def test_a_connection_that_breaks_is_made_again(
    dask: tuple[str, list[subprocess.Popen[bytes]]], whole: Path, tmp_path: Path
) -> None:
    with Cluster(dask[0], timeout_s=60) as pool:
        wait(lambda: pool.workers == 2)

        def cut(seen: int) -> None:
            if seen in (5, 15):
                client = pool.client
                client.loop.add_callback(client.scheduler_comm.comm.abort)

        state = flown(campaign_file(tmp_path), tmp_path / "out", pool, Watched(cut))
    assert state.complete and table(tmp_path / "out") == table(whole)


def test_a_scheduler_that_dies_leaves_a_campaign_to_go_on_with(
    dask: tuple[str, list[subprocess.Popen[bytes]]],
    whole: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("testbed.campaigns.cluster.TIMEOUT_S", 1.0)
    address, processes = dask
    with Cluster(address, timeout_s=60) as pool:

        def kill(seen: int) -> None:
            if seen == 5:
                processes[-1].kill()

        with pytest.raises(UserError, match="the scheduler is gone"):
            flown(campaign_file(tmp_path), tmp_path / "out", pool, Watched(kill))
    assert flown(campaign_file(tmp_path), tmp_path / "out", Processes(2)).complete
    assert table(tmp_path / "out") == table(whole)


def test_an_unreachable_cluster_is_one_line(
    tmp_path: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("testbed.campaigns.cluster.TIMEOUT_S", 0.5)
    file = campaign_file(tmp_path)
    assert call("campaign", "run", file, "--out", tmp_path / "out", "--cluster", "tcp://127.0.0.1:1") == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1 and "no Dask scheduler answers there within 0.5 s" in said[0]
    assert call("campaign", "status", tmp_path / "out") == 0
    assert "0 of 30 runs done" in capsys.readouterr().out


def test_a_finished_campaign_is_read_after_its_airframe_was_edited(
    tmp_path: Path, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    wing, out = copy("x8", tmp_path / "wing"), tmp_path / "out"
    text = SHORT.replace('["unicycle", "lagged"]', '["lagged"]') + f'[grid]\nairframes = [["{wing}"]]\n'
    file = campaign_file(tmp_path, seeds=2, text=text)
    assert call("campaign", "run", file, "--out", out, "--workers", 1) == 0
    capsys.readouterr()
    assert call("campaign", "status", out) == 0
    assert "changed" not in capsys.readouterr().out
    model = wing / "x8.xml"
    model.write_text(model.read_text().replace("<wingarea", "<!-- another wing --><wingarea", 1))
    assert call("campaign", "status", out) == 0
    said = capsys.readouterr().out
    assert "0/2" in said
    assert "airframe wing has changed since; these are the numbers of the earlier one" in said
    assert call("report", out) == 0
    assert "Airframe wing has changed since" in (out / "report.html").read_text(encoding="utf-8")
    capsys.readouterr()
    assert call("campaign", "resume", out) == 2
    assert "was begun with other files or gains of airframe wing; restore them" in capsys.readouterr().err


@pytest.mark.parametrize("address", ["x", "", "tcp://", "foo://127.0.0.1:8786"])
def test_an_address_that_is_none_makes_no_client(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A client of Dask's that fails over its address prints a trace when it is deleted, at the exit."""
    import distributed

    from testbed.campaigns.executor import executor

    def client(*arguments: object, **options: object) -> None:
        raise AssertionError("a client was made")

    monkeypatch.setattr(distributed, "Client", client)
    with pytest.raises(UserError, match=r"^--cluster .*(missing port|unknown address scheme)"):
        executor(cluster=address)
