"""Every command as a terminal, a pipe and a program meet it."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from testbed.cli.main import app

# Why a program can read these all the same.
WITHOUT_JSON = {"campaign schema": "JSON is all it prints"}


def leaves(command: Any, path: tuple[str, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Every command that does something, with its words."""
    inner = getattr(command, "commands", None)
    if inner is None:
        yield " ".join(path), command
        return
    for name, sub in inner.items():
        yield from leaves(sub, (*path, name))


COMMANDS = dict(leaves(get_command(app)))


def examples(command: Any) -> list[list[str]]:
    """The commands of its help's example, as words; one inside another's $(...) is left out."""
    said = re.sub(r"\$\(.*?\)", "", command.epilog or "")
    return [shlex.split(part) for part in re.findall(r"testbed [^;]*", said)]


@pytest.mark.parametrize("name", COMMANDS)
def test_help_fits_a_terminal_and_ends_with_an_example(
    name: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(*name.split(), "--help") == 0
    text = capsys.readouterr().out
    assert max(map(len, text.splitlines())) <= 80
    command = COMMANDS[name]
    assert re.match(r"Examples?: testbed ", command.epilog or ""), f"{name} has no example"
    assert f"testbed {name}" in " ".join(text.split())
    assert (command.help or "").strip(), f"{name} does not say what it does"
    silent = [p.name for p in command.params if not getattr(p, "help", None) and p.name != "help"]
    assert not silent, f"{name}: no help for {silent}"


@pytest.mark.parametrize("group", ["", "aircraft", "campaign", "regress"])
def test_lists_of_commands_say_each_in_a_whole_line(
    group: str, call: Callable[..., int], capsys: pytest.CaptureFixture[str]
) -> None:
    assert call(*group.split(), "--help") == 0
    text = capsys.readouterr().out
    listed = text.partition("Commands:\n")[2].splitlines()
    assert listed and "..." not in " ".join(listed) and max(map(len, listed)) <= 80
    names = {name.removeprefix(group).split()[0] for name in COMMANDS if name.startswith(group)}
    assert {line.split()[0] for line in listed} == names


def test_the_program_says_its_version(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    assert call("--version") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("cbf-jsbsim-testbed ") and any(line.startswith("jsbsim ") for line in lines)


@pytest.mark.parametrize("name", COMMANDS)
def test_examples_are_commands_that_exist(name: str) -> None:
    for words in examples(COMMANDS[name]):
        path = next(p for p in (" ".join(words[1:3]), words[1]) if p in COMMANDS)
        known = {o for p in COMMANDS[path].params for o in p.opts}
        options = {w.partition("=")[0] for w in words if w.startswith("--")}
        assert options <= known, f"{' '.join(words)}: unknown {options - known}"


@pytest.mark.parametrize("name", COMMANDS)
def test_a_program_can_read_the_answer(name: str) -> None:
    offered = any("--json" in p.opts for p in COMMANDS[name].params)
    assert offered or WITHOUT_JSON.get(name), f"{name} has no --json"
    assert not (offered and name in WITHOUT_JSON)


WORKERS = [name for name, command in COMMANDS.items() if any("--workers" in p.opts for p in command.params)]


@pytest.mark.parametrize("name", WORKERS)
def test_no_workers_are_refused_before_anything_is_flown(name: str, refusal: Callable[..., str]) -> None:
    needed = [p for p in COMMANDS[name].params if p.required]
    words = [w for p in needed for w in ([p.opts[0]] if p.opts[0].startswith("--") else []) + ["x8"]]
    assert refusal(*name.split(), *words, "--workers", 0) == "error: --workers 0: give at least 1\n"


def test_numbers_in_tables_are_never_broken() -> None:
    """Where a terminal is narrow words break at spaces, headings too."""
    from rich.console import Console

    from testbed.report.tables import plain_table

    rows = [
        {"rung": "latency", "least distance [m]": -12.3, "change [95 % CI]": "-2.02 [-2.30, -1.67]"},
        {"rung": "loss", "least distance [m]": 4.05, "change [95 % CI]": "", "more": None},
    ]
    for width in (80, 40, 30):
        console = Console(width=width)
        with console.capture() as shown:
            console.print(plain_table("t", rows))
        words = shown.get().split()
        assert {"-12.3", "4.05", "latency", "-2.02", "distance", "more", "-"} <= set(words), width


@pytest.mark.slow
def test_in_a_pipe_there_is_no_colour_and_no_progress_bar(tmp_path: Path) -> None:
    program = Path(sys.executable).parent / "testbed"
    plain = {k: v for k, v in os.environ.items() if k not in ("FORCE_COLOR", "COLUMNS", "TTY_COMPATIBLE")}
    done = subprocess.run(
        [program, "compare", "paper-2-turn", "--plants", "unicycle,lagged", "--set", "duration_s=0.05"],
        capture_output=True, text=True, check=True, cwd=tmp_path, env=plain | {"TERM": "xterm-256color"},
    )  # fmt: skip
    for text in (done.stdout, done.stderr):
        assert "\x1b" not in text and "\r" not in text
    assert "separation" in done.stdout
    assert max(map(len, done.stdout.splitlines())) <= 80
    # A log gets a line for each piece of work, and no more.
    assert done.stderr.splitlines() == ["flying unicycle ...", "flying lagged ..."]


def test_both_lists_print_alike(call: Callable[..., int], capsys: pytest.CaptureFixture[str]) -> None:
    for words in (["list"], ["aircraft", "list"], ["campaign", "list"]):
        assert call(*words) == 0
        lines = capsys.readouterr().out.splitlines()
        assert max(map(len, lines)) <= 80
        names = [line for line in lines if not line.startswith("    ")]
        assert call(*words, "--json") == 0
        rows = json.loads(capsys.readouterr().out)
        assert names == list(rows) and all(rows.values())


def test_an_airframe_is_checked_by_name_or_by_folder_and_copied(
    tmp_path: Path,
    call: Callable[..., int],
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from aircraft.airframe import load
    from aircraft.airframes.schema import AIRFRAMES
    from aircraft.check import check

    checked: list[Path] = []
    monkeypatch.setattr(check, "check", lambda folder: checked.append(folder) or [])
    monkeypatch.chdir(tmp_path)
    assert call("aircraft", "copy", "x8", "my-wing") == 0
    for name in ("x8", "my-wing"):
        assert call("aircraft", "check", name) == 0
    assert checked == [AIRFRAMES / "x8", Path("my-wing")]
    mine, source = load("my-wing"), load("x8")
    assert mine.name == "my-wing" and mine.gains == source.gains
    assert mine.identified is not None and mine.identified.command.endswith(" my-wing")
    capsys.readouterr()
    for words, said in (
        (("x8", "my-wing"), "my-wing exists"),
        (("x8", "my wing"), "cannot name an airframe"),
        (("x9", "other"), "no airframe x9"),
    ):
        assert call("aircraft", "copy", *words) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert said in line
    assert [p.name for p in tmp_path.iterdir()] == ["my-wing"]
