"""Faults around a run: kills, full disks, a second process, damaged files. Nothing finished is lost, nothing
unfinished is taken for finished."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from pathlib import Path

import pytest

import testbed
from testbed.cli import interrupts
from testbed.errors import UserError
from testbed.records.store import staged
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run

BRIEF = ["duration_s=0.1", "checks.manoeuvre_instants=0"]
# Some seconds of flying, recorded at every step, so that a moment at random is one in the middle of it.
LONG = ["--set=duration_s=60", "--set=checks.manoeuvre_instants=0", "--set=vehicles=8"]
PROGRAM = [sys.executable, "-c", "from testbed.cli.main import main; main()"]
KILLS = int(os.environ.get("TESTBED_FUZZ", "1"))


def start(*arguments: str, cwd: Path) -> subprocess.Popen[str]:
    """`testbed` with these arguments, once it flies and has its folder."""
    process = subprocess.Popen(
        [*PROGRAM, *arguments], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    assert process.stderr is not None
    while "flying" not in (line := process.stderr.readline()):
        assert line, "ended before it flew"
    while not list(cwd.rglob(".r.partial")):
        assert process.poll() is None, "ended before it had a folder"
        time.sleep(0.01)
    return process


@pytest.mark.slow
def test_a_run_killed_at_any_moment_is_absent_and_what_it_left_is_removed(tmp_path: Path) -> None:
    moments = random.Random(None if KILLS > 1 else 1)
    for _ in range(3 * KILLS):
        process = start("run", "paper-2-turn", "--out=r", *LONG, cwd=tmp_path)
        time.sleep(moments.uniform(0.0, 0.5))
        process.kill()
        process.communicate()
        # killed while flying or, just possibly, whole
        if (tmp_path / "r").exists():
            testbed.load(tmp_path / "r")
            return
        assert set(os.listdir(tmp_path)) <= {".r.partial", ".r.lock"}
        with pytest.raises(UserError, match="holds no finished run"):
            testbed.load(tmp_path / "r")
    run(load("paper-2-turn", BRIEF), tmp_path / "r")
    assert os.listdir(tmp_path) == ["r"]


def test_a_signal_inside_a_callback_is_not_lost_and_says_nothing_more(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "unraisablehook", sys.__unraisablehook__)  # pytest has put its own there

    class Thing:
        pass

    def command() -> None:
        thing = Thing()
        kept = weakref.ref(thing, lambda _: signal.raise_signal(signal.SIGINT))
        del thing  # what the callback raises is dropped by the interpreter
        time.sleep(30)
        assert kept

    with pytest.raises(SystemExit) as end:
        interrupts.ending(command)
    assert end.value.code == 128 + signal.SIGINT
    assert capsys.readouterr().err == "stopped by SIGINT; nothing half-written is left\n"


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "command"),
    [(signal.SIGTERM, "run"), (signal.SIGINT, "run"), (signal.SIGHUP, "run"), (signal.SIGTERM, "compare")],
)
def test_a_signal_ends_it_in_one_line_and_nothing_is_left(
    tmp_path: Path, number: signal.Signals, command: str
) -> None:
    process = start(command, "paper-2-turn", "--out=deep/r", *LONG, cwd=tmp_path)
    process.send_signal(number)
    _, error = process.communicate(timeout=300)
    assert process.returncode == 128 + number
    assert error == f"stopped by {number.name}; nothing half-written is left\n"
    assert os.listdir(tmp_path) == []


# A command in which the signal comes where every exception is swallowed, or while it cleans up at length.
STOPPED = """
import os, signal, sys, time
from testbed.cli.interrupts import ending
from testbed.errors import StoppedError

def swallowed():
    try:
        os.kill(os.getpid(), signal.SIGINT)
    except:
        pass
    time.sleep(60)

def cleaning():
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    finally:
        time.sleep(1)
        print("cleaned")

def translating():
    try:
        os.kill(os.getpid(), signal.SIGTERM)
    except StoppedError:
        time.sleep(1)
        raise SystemExit(9)

ending(globals()[sys.argv[1]])
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "code", "said"),
    [("swallowed", 130, ""), ("cleaning", 143, "cleaned\n"), ("translating", 9, "")],
)
def test_a_signal_is_neither_lost_nor_interrupts_the_cleaning_up(command: str, code: int, said: str) -> None:
    done = subprocess.run(
        [sys.executable, "-c", STOPPED, command], capture_output=True, text=True, timeout=30, check=False
    )
    assert (done.returncode, done.stdout) == (code, said)
    assert done.stderr.startswith("stopped by SIG") == (command != "translating")


@pytest.mark.slow
def test_a_second_process_on_one_folder_is_refused_and_the_first_goes_on(tmp_path: Path) -> None:
    process = start("run", "paper-2-turn", "--out=r", *LONG, cwd=tmp_path)
    with pytest.raises(UserError, match="r is being written by another process"):
        run(load("paper-2-turn", BRIEF), tmp_path / "r", overwrite=True)
    assert process.poll() is None and (tmp_path / ".r.partial").is_dir()
    process.kill()
    process.communicate()
    run(load("paper-2-turn", BRIEF), tmp_path / "r")  # the lock died with its process


def test_what_a_killed_process_left_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / ".r.partial" / "figures").mkdir(parents=True)
    (tmp_path / ".r.partial" / "manifest.json").write_text("{}")
    run(load("paper-2-turn", BRIEF), tmp_path / "r")
    assert "removed what a killed process left" in capsys.readouterr().err
    assert "figures" not in os.listdir(tmp_path / "r")
    assert testbed.load(tmp_path / "r").manifest["scenario"]["name"] == "paper-2-turn"


def whole(path: Path, text: str) -> None:
    path.mkdir()
    (path / "manifest.json").write_text(text)


def test_a_replacement_killed_between_its_renames_is_ended_by_the_next(tmp_path: Path) -> None:
    whole(tmp_path / ".r.replaced", "old")
    whole(tmp_path / ".r.partial", "new")
    with pytest.raises(UserError, match="exists; give another --out"), staged(tmp_path / "r"):
        pass
    assert (tmp_path / "r" / "manifest.json").read_text() == "new"
    assert os.listdir(tmp_path) == ["r"]


def test_a_failure_while_replacing_keeps_the_old(tmp_path: Path) -> None:
    whole(tmp_path / "r", "old")
    with pytest.raises(ZeroDivisionError), staged(tmp_path / "r", overwrite=True) as folder:
        (folder / "manifest.json").write_text("half")
        raise ZeroDivisionError
    assert (tmp_path / "r" / "manifest.json").read_text() == "old"
    assert os.listdir(tmp_path) == ["r"]


def test_what_somebody_else_made_meanwhile_is_not_overwritten_and_ours_is_kept(tmp_path: Path) -> None:
    with pytest.raises(UserError, match="made by somebody else meanwhile"), staged(tmp_path / "r") as folder:
        (folder / "manifest.json").write_text("ours")
        whole(tmp_path / "r", "theirs")
    assert (tmp_path / "r" / "manifest.json").read_text() == "theirs"
    (kept,) = [p for p in tmp_path.iterdir() if p.name != "r"]
    assert (kept / "manifest.json").read_text() == "ours"


# Run with a limit on what may be written, raised step by step; says what each attempt left.
FILLING = """
import json, os, resource, sys
from pathlib import Path
from testbed.cli import interrupts
from testbed.errors import UserError
from testbed.scenario.scenario import load
from testbed.simulation.simulate import run
s = load("paper-2-turn", ["duration_s=1", "checks.manoeuvre_instants=0"])
hard = resource.getrlimit(resource.RLIMIT_FSIZE)[1]
for size in (0, 1, 100, 1000, 3000, 10_000, 20_000, 30_000):
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        run(s, Path("r"))
        said = ""
    except UserError as error:
        said = str(error)
    resource.setrlimit(resource.RLIMIT_FSIZE, (hard, hard))
    print(json.dumps([size, said, os.listdir(".")]))
    if not said:
        break
"""


@pytest.mark.slow
def test_writing_that_fails_at_any_size_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    done = subprocess.run([sys.executable, "-c", FILLING], cwd=tmp_path, capture_output=True, text=True)
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    assert done.returncode == 0 and done.stderr == ""
    failed = [row for row in rows if row[1]]
    assert len(failed) >= 5
    for _, said, left in failed:
        assert said == "cannot write r: File too large; nothing is left of it" and left == []


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    where = tmp_path / "disk"
    where.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=48k", "tmpfs", str(where)], capture_output=True, check=False
    )
    if mounted.returncode:
        pytest.skip("mounting a small disk needs root; the test of sizes above stands in")
    yield where
    # Lazily: what the machine's other programs look at for a moment keeps it busy.
    subprocess.run(["umount", "--lazy", str(where)], check=True)


@pytest.mark.skipif(sys.platform != "linux", reason="tmpfs is Linux's")
def test_a_full_disk_is_one_line_and_keeps_the_run_that_is_there(
    small_disk: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    out = small_disk / "r"
    run(load("paper-2-turn", BRIEF), out)
    before = (out / "manifest.json").read_bytes()
    with pytest.raises(UserError, match="No space left on device; nothing is left of it"):
        run(load("paper-2-turn", ["duration_s=20", *BRIEF[1:]]), out, overwrite=True)
    assert (out / "manifest.json").read_bytes() == before and os.listdir(small_disk) == ["r"]
    assert len(testbed.load(out).vehicles) == 42
    assert "Exception ignored" not in capfd.readouterr().err


def test_an_output_that_cannot_be_written_is_refused_before_anything_is_flown(tmp_path: Path) -> None:
    flown: list[float] = []
    locked = tmp_path / "locked"
    locked.mkdir(mode=0o500)
    places = [Path("/proc/testbed/r")] + ([locked / "r"] if os.geteuid() else [])
    for place in places:
        with pytest.raises(UserError, match="cannot write below"):
            run(load("paper-2-turn", BRIEF), place, progress=lambda t, duration: flown.append(t))
    assert not flown


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
def test_output_nobody_can_read_is_no_traceback(tmp_path: Path) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([*PROGRAM, "list"], stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2 and done.stderr == "error: [Errno 28] No space left on device\n"


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("kept") / "r"
    run(load("paper-2-turn", BRIEF), folder)
    return folder


FILES = ["manifest.json", "guarantees.json", "timing.json", "vehicles.parquet", "pairs.parquet"]


def content(folder: Path) -> tuple[object, ...]:
    read = testbed.load(folder)
    return read.manifest, read.guarantees, read.timing, read.vehicles.to_json(), read.pairs.to_json()


@pytest.mark.parametrize("name", FILES)
def test_a_damaged_file_is_one_line_or_makes_no_difference(kept: Path, name: str) -> None:
    """Bytes flipped and cut at random: 40 times a file."""
    file, chance = kept / name, random.Random(f"{name} {KILLS}")
    good, said = file.read_bytes(), content(kept)
    try:
        for _ in range(20 * KILLS):
            at = chance.randrange(len(good))
            flipped = good[:at] + bytes([good[at] ^ chance.randrange(1, 256)]) + good[at + 1 :]
            for damage in (flipped, good[:at]):
                file.write_bytes(damage)
                try:
                    assert content(kept) == said, f"taken for whole: {name} damaged at byte {at}"
                except UserError as error:
                    assert str(kept) in str(error) and "\n" not in str(error)
        file.unlink()
        with pytest.raises(UserError, match=r"is damaged|holds no finished run"):
            content(kept)
    finally:
        file.write_bytes(good)


def test_an_older_schema_and_a_run_without_checksums_are_said_to_be(kept: Path) -> None:
    file = kept / "manifest.json"
    good = file.read_text()
    try:
        for change, said in (({"schema_version": 0}, "schema version 0"), ({}, "an older version")):
            manifest = json.loads(good) | change
            del manifest["files"]
            file.write_text(json.dumps(manifest))
            with pytest.raises(UserError, match=said):
                testbed.load(kept)
    finally:
        file.write_text(good)


def test_a_tables_checksum_is_not_that_of_another_table(kept: Path) -> None:
    vehicles, pairs = kept / "vehicles.parquet", kept / "pairs.parquet"
    good = vehicles.read_bytes()
    try:
        vehicles.write_bytes(pairs.read_bytes())
        with pytest.raises(UserError, match="not the file that the run wrote"):
            _ = testbed.load(kept).vehicles
    finally:
        vehicles.write_bytes(good)


def test_no_run_file_is_pickled(kept: Path) -> None:
    """JSON and parquet columns of plain numbers and words; pyarrow from 15 on unpickles nothing by itself."""
    import pyarrow.parquet as pq

    assert sorted(os.listdir(kept)) == sorted(FILES)
    for table in ("vehicles", "pairs"):
        schema = pq.read_schema(kept / f"{table}.parquet")
        assert not schema.metadata or b"ARROW:extension" not in b"".join(schema.metadata)
        assert {str(t) for t in schema.types} <= {"double", "int32", "bool", "string", "float"}
